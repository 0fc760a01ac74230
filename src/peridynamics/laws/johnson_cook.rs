//! Correspondence whose classical stress is that of Johnson–Cook plasticity.

use std::sync::Arc;

use super::plastic::{STRAINS, plastic};
use super::{
    Constants, LocalCorrespondence, NamedLaw, Parameter, Ratio, correspondence::STABILISATION,
};
use crate::{
    material::{Hardening, JohnsonCook, Kinematics},
    peridynamics::Law,
};

/// [`LocalCorrespondence`] with the stress of [`crate::material::J2`] whose yield stress is that of [`JohnsonCook`].
#[derive(Clone, Copy, Debug)]
pub struct JohnsonCookCorrespondence<const D: usize>;

/// A parameter with a default, or one that has to be given.
const fn parameter(
    key: &'static str,
    about: &'static str,
    default: Option<f64>,
    limits: (f64, f64),
    usual: f64,
) -> Parameter {
    Parameter {
        key,
        about,
        default,
        least: limits.0,
        most: limits.1,
        usual,
        words: &[],
    }
}

impl<const D: usize> NamedLaw<D> for JohnsonCookCorrespondence<D> {
    const KEY: &'static str = "johnson-cook";
    const ABOUT: &'static str =
        "Correspondence with Johnson–Cook plasticity at a given temperature, for small strains.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[
        parameter(
            "yield-stress",
            "A of (A + B αⁿ)(1 + C ln α̇/ε̇₀)(1 − T*ᵐ).",
            None,
            (1e-100, 1e100),
            0.1,
        ),
        parameter("hardening-modulus", "B.", None, (0.0, 1e100), 0.4),
        parameter("hardening-exponent", "n.", None, (1e-3, 10.0), 0.7),
        parameter(
            "rate-coefficient",
            "C: growth of the yield stress with the logarithm of the rate; 0 leaves it out.",
            Some(0.0),
            (0.0, 1e3),
            0.05,
        ),
        parameter(
            "reference-rate",
            "ε̇₀, the rate of plastic strain below which the yield stress does not fall.",
            Some(1.0),
            (1e-100, 1e100),
            1.0,
        ),
        parameter(
            "temperature",
            "T of the body, in the unit of the two other temperatures.",
            None,
            (-1e6, 1e6),
            400.0,
        ),
        parameter(
            "reference-temperature",
            "T_r, at which A, B, n and C were found.",
            None,
            (-1e6, 1e6),
            293.0,
        ),
        parameter(
            "melting-temperature",
            "T_m, above the other two: T* = (T − T_r)/(T_m − T_r).",
            None,
            (-1e6, 1e6),
            1793.0,
        ),
        parameter(
            "softening-exponent",
            "m of T*ᵐ.",
            Some(1.0),
            (1e-3, 1e2),
            1.03,
        ),
        STABILISATION,
        // tests of all laws take it for large strains, and `plastic-correspondence` for small ones
        Parameter {
            usual: 1.0,
            ..STRAINS
        },
        LocalCorrespondence::<D>::CONTROL,
    ];

    fn conflict(values: &[f64]) -> Option<(&'static str, String)> {
        let (here, reference, melting) = (values[5], values[6], values[7]);
        (melting <= here.max(reference)).then(|| {
            (
                "melting-temperature",
                format!(
                    "must lie above the temperature {here} and the reference temperature {reference}, in the same unit: what has melted bears nothing"
                ),
            )
        })
    }

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let softening = JohnsonCook::softening(values[5], values[6], values[7], values[8]);
        let hardening = Hardening::JohnsonCook(JohnsonCook {
            yield_stress: values[0],
            modulus: values[1],
            exponent: values[2],
            rate_coefficient: values[3],
            reference_rate: values[4],
            softening,
        });
        plastic(
            "Johnson–Cook correspondence",
            constants,
            hardening,
            (values[9], values[11]),
            values[10] != 0.0,
        )
    }
}
