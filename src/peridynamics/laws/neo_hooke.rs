//! Correspondence whose classical stress is that of a Neo-Hooke solid.

use std::sync::Arc;

use super::{
    Constants, LocalCorrespondence, NamedLaw, Parameter, Ratio, correspondence::STABILISATION,
};
use crate::{
    material::{Kinematics, NeoHooke},
    peridynamics::Law,
};

/// [`LocalCorrespondence`] with the stress of [`NeoHooke`].
#[derive(Clone, Copy, Debug)]
pub struct NeoHookeSolid<const D: usize>;

impl<const D: usize> NamedLaw<D> for NeoHookeSolid<D> {
    const KEY: &'static str = "neo-hooke";
    const ABOUT: &'static str =
        "Correspondence with a compressible Neo-Hooke solid, for large rotations and strains.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[STABILISATION, LocalCorrespondence::<D>::CONTROL];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let shear = constants.shear;
        let solid = Arc::new(NeoHooke::new(constants.solid_lambda(), shear));
        let local = constants.local(solid);
        let linear = constants.correspondence(values[0], values[1]);
        Arc::new(LocalCorrespondence::new(
            "Neo-Hooke correspondence",
            linear,
            local,
        ))
    }
}
