//! Correspondence whose classical stress is that of linear viscoelasticity.

use std::sync::Arc;

use super::{
    Constants, LocalCorrespondence, NamedLaw, Parameter, Ratio, correspondence::STABILISATION,
    relaxing,
};
use crate::{material::Kinematics, peridynamics::Law};

/// [`LocalCorrespondence`] with the stress of [`crate::material::GeneralisedMaxwell`]; its zero-energy control is elastic.
#[derive(Clone, Copy, Debug)]
pub struct ViscoelasticCorrespondence<const D: usize>;

/// The keys of the arms, and those of all correspondence materials behind them.
const fn parameters(stabilisation: Parameter, control: Parameter) -> [Parameter; PARAMETERS] {
    let mut all = [stabilisation; PARAMETERS];
    let mut k = 0;
    while k < relaxing::NUMBERS {
        all[k] = relaxing::PARAMETERS[k];
        k += 1;
    }
    all[relaxing::NUMBERS + 1] = control;
    all
}

const PARAMETERS: usize = relaxing::NUMBERS + 2;

impl<const D: usize> NamedLaw<D> for ViscoelasticCorrespondence<D> {
    const KEY: &'static str = "viscoelastic-correspondence";
    const ABOUT: &'static str = "Correspondence with linear viscoelasticity: a shear modulus that relaxes by up to 16 Maxwell arms, an elastic bulk; the constants are those at once.";
    const RATIO: Ratio = Ratio::Any;
    const KINEMATICS: &'static [Kinematics] = Kinematics::ALL;
    const PARAMETERS: &'static [Parameter] =
        &parameters(STABILISATION, LocalCorrespondence::<D>::CONTROL);

    fn conflict(values: &[f64]) -> Option<(&'static str, String)> {
        relaxing::conflict(&values[..relaxing::NUMBERS])
    }

    fn build(constants: Constants, values: &[f64]) -> Arc<dyn Law<D>> {
        let (arms, control) = values.split_at(relaxing::NUMBERS);
        Arc::new(LocalCorrespondence::new(
            "viscoelastic correspondence",
            constants.correspondence(control[0], control[1]),
            relaxing::local(&constants, relaxing::series(arms)),
        ))
    }
}
