//! Correspondence whose classical stress is that of a St Venant–Kirchhoff solid.

use std::sync::Arc;

use super::{
    Constants, LocalCorrespondence, NamedLaw, Parameter, Ratio, correspondence::STABILISATION,
};
use crate::{
    material::{Kinematics, StVenantKirchhoff},
    peridynamics::Law,
};

/// [`LocalCorrespondence`] with the stress of [`StVenantKirchhoff`].
#[derive(Clone, Copy, Debug)]
pub struct StVenantKirchhoffSolid<const D: usize>;

impl<const D: usize> NamedLaw<D> for StVenantKirchhoffSolid<D> {
    const KEY: &'static str = "st-venant-kirchhoff";
    const ABOUT: &'static str = "Correspondence with a St Venant–Kirchhoff solid, for large rotations and moderate strains.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] = &[STABILISATION, LocalCorrespondence::<D>::CONTROL];

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let shear = constants.shear;
        let solid = Arc::new(StVenantKirchhoff::new(constants.solid_lambda(), shear));
        let local = constants.local(solid);
        let linear = constants.correspondence(values[0], values[1]);
        Arc::new(LocalCorrespondence::new(
            "St Venant–Kirchhoff correspondence",
            linear,
            local,
        ))
    }
}
