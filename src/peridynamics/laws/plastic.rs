//! Correspondence whose classical stress is that of J2 plasticity.

use std::sync::Arc;

use super::{Constants, Correspondence, LocalCorrespondence, NamedLaw, Parameter, Ratio};
use crate::{
    material::{Hardening, J2, Kinematics, LocalLaw, Reduced},
    peridynamics::Law,
};

/// [`LocalCorrespondence`] with the stress of [`J2`].
#[derive(Clone, Copy, Debug)]
pub struct PlasticCorrespondence<const D: usize>;

impl<const D: usize> NamedLaw<D> for PlasticCorrespondence<D> {
    const KEY: &'static str = "plastic-correspondence";
    const ABOUT: &'static str = "Correspondence with von Mises plasticity and isotropic hardening, linear and saturating, for small strains.";
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
        LocalCorrespondence::<D>::STABILISATION,
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let hardening = Hardening::Voce {
            yield_stress: values[0],
            modulus: values[1],
            saturation: values[2],
            rate: values[3],
        };
        plastic("plastic correspondence", constants, hardening, values[4])
    }
}

/// A J2 material at points and in finite elements.
pub(super) fn plastic<const D: usize>(
    name: &'static str,
    constants: Constants,
    hardening: Hardening,
    stabilisation: f64,
) -> Arc<dyn Law<D>> {
    let Constants {
        lambda,
        shear,
        influence,
        kinematics,
    } = constants;
    let local: Arc<dyn LocalLaw<D>> = match kinematics {
        Kinematics::PlaneStress => {
            let solid = J2::<3>::with_hardening(constants.solid_lambda(), shear, hardening);
            Arc::new(Reduced::new(Arc::new(solid), kinematics))
        }
        _ => Arc::new(J2::<D>::with_hardening(lambda, shear, hardening)),
    };
    let linear = Correspondence::new(influence, lambda, shear, stabilisation);
    Arc::new(LocalCorrespondence::new(name, linear, local))
}
