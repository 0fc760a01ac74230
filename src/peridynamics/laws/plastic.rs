//! Correspondence whose classical stress is that of J2 plasticity.

use std::sync::Arc;

use super::{
    Constants, LocalCorrespondence, NamedLaw, Parameter, Ratio, correspondence::STABILISATION,
};
use crate::{
    material::{Hardening, J2, Kinematics, LocalLaw, LogarithmicJ2},
    peridynamics::Law,
};

/// [`LocalCorrespondence`] with the stress of [`J2`].
#[derive(Clone, Copy, Debug)]
pub struct PlasticCorrespondence<const D: usize>;

impl<const D: usize> NamedLaw<D> for PlasticCorrespondence<D> {
    const KEY: &'static str = "plastic-correspondence";
    const ABOUT: &'static str =
        "Correspondence with von Mises plasticity and isotropic hardening, linear and saturating.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter {
            key: "yield-stress",
            about: "Equivalent stress at which the material begins to flow.",
            default: None,
            least: 1e-100,
            most: 1e100,
            usual: 0.1,
            words: &[],
        },
        Parameter {
            key: "hardening-modulus",
            about: "Growth of the yield stress with the equivalent plastic strain.",
            default: Some(0.0),
            least: 0.0,
            most: 1e100,
            usual: 0.4,
            words: &[],
        },
        Parameter {
            key: "saturation-stress",
            about: "Growth of the yield stress by saturating hardening: Q of Q (1 − exp(−b α)).",
            default: Some(0.0),
            least: 0.0,
            most: 1e100,
            usual: 0.2,
            words: &[],
        },
        Parameter {
            key: "saturation-rate",
            about: "How fast saturating hardening comes with the equivalent plastic strain α: b of Q (1 − exp(−b α)).",
            default: Some(0.0),
            least: 0.0,
            most: 1e12,
            usual: 3.0,
            words: &[],
        },
        STABILISATION,
        STRAINS,
        LocalCorrespondence::<D>::CONTROL,
    ];

    fn conflict(values: &[f64]) -> Option<(&'static str, String)> {
        let (key, other) = match (values[2] > 0.0, values[3] > 0.0) {
            (true, false) => ("saturation-stress", "saturation-rate"),
            (false, true) => ("saturation-rate", "saturation-stress"),
            _ => return None,
        };
        let why = format!("does nothing without a {other}, which is 0: give both, or neither");
        Some((key, why))
    }

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let hardening = Hardening::Voce {
            yield_stress: values[0],
            modulus: values[1],
            saturation: values[2],
            rate: values[3],
        };
        plastic(
            "plastic correspondence",
            constants,
            hardening,
            (values[4], values[6]),
            values[5] != 0.0,
        )
    }
}

/// Admissible size of strains and rotations.
pub(super) const STRAINS: Parameter = Parameter::words(
    "strains",
    "For \"small\" strains and rotations, or \"large\" ones: logarithmic strains and true stresses, slower.",
    &["small", "large"],
);

/// A J2 material at points and in finite elements, for small strains or for large ones, with the strength and the place of its zero-energy control.
pub(super) fn plastic<const D: usize>(
    name: &'static str,
    constants: Constants,
    hardening: Hardening,
    (stabilisation, control): (f64, f64),
    is_large: bool,
) -> Arc<dyn Law<D>> {
    let shear = constants.shear;
    let solid = constants.solid_lambda();
    let has_own = J2::<D>::KINEMATICS.contains(&constants.kinematics) && !constants.is_heated;
    let local: Arc<dyn LocalLaw<D>> = match is_large {
        true => constants.local(Arc::new(LogarithmicJ2::new(solid, shear, hardening))),
        false if has_own => Arc::new(J2::with_hardening(constants.lambda, shear, hardening)),
        false => constants.local(Arc::new(J2::with_hardening(solid, shear, hardening))),
    };
    let linear = constants.correspondence(stabilisation, control);
    Arc::new(LocalCorrespondence::new(name, linear, local))
}
