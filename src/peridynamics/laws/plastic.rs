//! Correspondence whose classical stress is that of J2 plasticity.

use std::sync::Arc;

use super::{Constants, Correspondence, LocalCorrespondence, NamedLaw, Parameter, Ratio};
use crate::{
    material::{J2, Kinematics, LocalLaw, Reduced},
    peridynamics::Law,
};

/// [`LocalCorrespondence`] with the stress of [`J2`].
#[derive(Clone, Copy, Debug)]
pub struct PlasticCorrespondence<const D: usize>;

impl<const D: usize> NamedLaw<D> for PlasticCorrespondence<D> {
    const KEY: &'static str = "plastic-correspondence";
    const ABOUT: &'static str = "Correspondence with von Mises plasticity and linear isotropic hardening, for small strains.";
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
        },
        Parameter {
            key: "hardening-modulus",
            about: "Growth of the yield stress with the equivalent plastic strain.",
            default: Some(0.0),
            least: 0.0,
            most: 1e100,
            usual: 0.4,
        },
        LocalCorrespondence::<D>::STABILISATION,
    ];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let Constants {
            lambda,
            shear,
            influence,
            kinematics,
        } = constants;
        let local: Arc<dyn LocalLaw<D>> = match kinematics {
            Kinematics::PlaneStress => {
                let solid = J2::<3>::new(constants.solid_lambda(), shear, values[0], values[1]);
                Arc::new(Reduced::new(Arc::new(solid), kinematics))
            }
            _ => Arc::new(J2::<D>::new(lambda, shear, values[0], values[1])),
        };
        let linear = Correspondence::new(influence, lambda, shear, values[2]);
        Arc::new(LocalCorrespondence::new(
            "plastic correspondence",
            linear,
            local,
        ))
    }
}
