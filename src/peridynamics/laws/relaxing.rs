//! The keys of a shear modulus that relaxes by Maxwell arms, for the laws that have one.

use std::sync::Arc;

use super::{Constants, Parameter};
use crate::material::{GeneralisedMaxwell, LocalLaw, PronySeries};

/// Numbers that the arms of a series take.
pub(super) const NUMBERS: usize = 2 * PronySeries::ARMS;

/// The keys of the arms after the first.
macro_rules! of_arms {
    ($($arm:literal)*) => {
        const MORE_ARMS: [Parameter; NUMBERS - 2] = [
            $(
                share(
                    concat!("relaxing-share-", $arm),
                    concat!("The same of arm ", $arm, "."),
                    Some(0.0),
                    // two arms are enough for the tests of every law
                    if $arm == 2 { 0.3 } else { 0.0 },
                ),
                time(
                    concat!("relaxation-time-", $arm),
                    concat!("The relaxation time of arm ", $arm, "."),
                    Some(1.0),
                ),
            )*
        ];
    };
}
of_arms!(2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);

/// The share and the relaxation time of each arm, arm by arm.
pub(super) const PARAMETERS: [Parameter; NUMBERS] = {
    let mut all = [share(
        "relaxing-share",
        "Part λ of the shear modulus that relaxes in the first arm.",
        None,
        0.2,
    ); NUMBERS];
    all[1] = time("relaxation-time", "Relaxation time τ of that arm.", None);
    let mut k = 0;
    while k < MORE_ARMS.len() {
        all[k + 2] = MORE_ARMS[k];
        k += 1;
    }
    all
};

const fn share(
    key: &'static str,
    about: &'static str,
    default: Option<f64>,
    usual: f64,
) -> Parameter {
    Parameter {
        key,
        about,
        default,
        least: 0.0,
        most: 1.0,
        usual,
        words: &[],
    }
}

const fn time(key: &'static str, about: &'static str, default: Option<f64>) -> Parameter {
    Parameter {
        key,
        about,
        default,
        least: 1e-100,
        most: 1e100,
        usual: 0.7,
        words: &[],
    }
}

/// Returns the key of the number to change and the reason, if the numbers of the arms conflict with each other.
pub(super) fn conflict(arms: &[f64]) -> Option<(&'static str, String)> {
    let shares: f64 = arms.iter().step_by(2).sum();
    (shares > 1.0).then(|| {
        (
            "relaxing-share",
            format!("the shares of all arms add up to {shares}, and may come to 1 at most: they are parts of one shear modulus"),
        )
    })
}

/// The series of the numbers of the arms.
pub(super) fn series(arms: &[f64]) -> PronySeries {
    let typed = arms.chunks_exact(2).map(|arm| (arm[0], arm[1]));
    // the first arm is there even if it has no share
    let arms = typed
        .enumerate()
        .filter(|(k, arm)| *k == 0 || arm.0 > 0.0)
        .map(|(_, arm)| arm)
        .collect();
    PronySeries::new(arms)
}

/// The local law of a solid of these constants in its kinematics, its shear modulus that of a series.
pub(super) fn local<const D: usize>(
    constants: &Constants,
    series: PronySeries,
) -> Arc<dyn LocalLaw<D>> {
    let solid = GeneralisedMaxwell::new(constants.solid_lambda(), constants.shear, series);
    constants.local(Arc::new(solid))
}
