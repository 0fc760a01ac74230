//! The reference of a study: what errors are measured against, the reason for it, and its own error.

use std::path::PathBuf;

use super::parameters::{Cost, Outcome, OwnError, Reference, ReferenceRun, Trade, TradeError};
use crate::variants::{Base, Setting};
use bondline::regular_file;

/// Least ratio of two errors, of spacings one to two, in which an order is seen.
const LEAST_RATIO: f64 = 2.6;

/// The largest that counts: of third order.
const MOST_RATIO: f64 = 9.0;

/// The reference of a study, before it has run.
pub(super) struct ChosenReference {
    /// The keys that it sets.
    pub keys: Vec<String>,
    /// Another scene that it is.
    pub other: Option<(PathBuf, String)>,
    /// In words, with the reason.
    pub why: String,
    pub own_error: OwnError,
}

impl ChosenReference {
    /// The reference that is asked for, or the one that suits the scene; `runs` says of keys that a scene with them can be run.
    pub fn of(
        wanted: &Reference,
        base: &Base,
        settings: &[Setting],
        runs: impl Fn(&[String]) -> bool,
    ) -> Result<Self, TradeError> {
        let new = |keys, why: &str, own_error| Self {
            keys,
            other: None,
            why: why.to_owned(),
            own_error,
        };
        let full = |why| new(vec!["coupling=nonlocal".to_owned()], why, OwnError::Unknown);
        let elements = |why| {
            let bound = match base.is_from_file() && base.coupling() != "local" {
                true => OwnError::Bound(vec!["local".to_owned()]),
                false => OwnError::Unknown,
            };
            new(base.elements_alone(), why, bound)
        };
        let finer = |why| {
            let coarse = coarser(base, settings).map_or(OwnError::Unknown, OwnError::Order);
            new(base.overrides(&base.finer()), why, coarse)
        };
        Ok(match wanted {
            Reference::FullPd => full("peridynamics everywhere, as asked for"),
            Reference::Auto if base.breaks && base.moves => {
                full("peridynamics everywhere, since bonds break on the way")
            }
            Reference::Elements => elements("elements alone, as asked for"),
            Reference::Auto
                if !base.breaks && base.is_from_file() && runs(&base.elements_alone()) =>
            {
                elements(
                    "elements of second order alone, since nothing breaks and the mesh of a file cannot be made finer",
                )
            }
            Reference::Finer => finer("half the horizon and spacing, as asked for"),
            Reference::Auto if base.breaks => {
                finer("half the spacing, since the horizon is a length of the material")
            }
            Reference::Auto => finer("half the horizon and spacing, since nothing breaks"),
            Reference::Keys(keys) => new(keys.clone(), "keys as asked for", OwnError::Unknown),
            Reference::Scene(path) => {
                let read = regular_file::read_scene(path);
                let text = read.map_err(|source| TradeError::File {
                    path: path.clone(),
                    source,
                })?;
                Self {
                    other: Some((path.clone(), text)),
                    ..new(Vec::new(), "another scene", OwnError::Unknown)
                }
            }
        })
    }
}

impl ChosenReference {
    /// The reference after it has run.
    pub fn with(self, cost: Cost) -> ReferenceRun {
        ReferenceRun {
            keys: self.keys,
            why: self.why,
            cost,
            own_error: self.own_error,
        }
    }
}

/// The settings that make a scene twice as coarse, in horizon, spacing and elements.
fn coarser(base: &Base, settings: &[Setting]) -> Option<Vec<String>> {
    let labels = |setting: &&Setting| base.scaled(2.0).contains(&setting.change);
    let found: Vec<&Setting> = settings.iter().filter(labels).collect();
    let changes = found.iter().map(|setting| &setting.change);
    let is_whole = base.overrides(changes) == base.overrides(&base.scaled(2.0));
    let labels = found.iter().map(|setting| setting.label.clone());
    is_whole.then(|| labels.collect())
}

impl Trade {
    /// The error of the reference itself in each quantity, as far as it is known.
    ///
    /// With the errors `e` of the scene and `E` of one twice as coarse, both against a reference half as coarse, an error `C hᵖ` gives `E/e = 2ᵖ + 1`, and `e/(E/e − 2)` for the reference.
    pub fn reference_errors(&self) -> Vec<Option<f64>> {
        let errors = |settings: &[String]| {
            let mut cases = self.cases.iter();
            let case = cases.find(|c| c.settings == settings)?;
            match &case.outcome {
                Outcome::Ran { errors, .. } => Some(errors.clone()),
                _ => None,
            }
        };
        let none = vec![None; self.wants.len()];
        match &self.reference.own_error {
            OwnError::Unknown => none,
            OwnError::Bound(settings) => {
                errors(settings).map_or(none, |errors| errors.into_iter().map(Some).collect())
            }
            OwnError::Order(settings) => match (errors(settings), errors(&[])) {
                (Some(coarse), Some(own)) => {
                    let each = coarse.iter().zip(&own);
                    let estimate = |(coarse, own): (&f64, &f64)| {
                        let ratio = coarse / own;
                        (ratio >= LEAST_RATIO).then(|| own / (ratio.min(MOST_RATIO) - 2.0))
                    };
                    each.map(estimate).collect()
                }
                _ => none,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pareto::{Case, CostBy, Quantity, TradeEnd};

    /// A study whose scene and a version of it have these errors.
    fn study(own_error: OwnError, scene: f64, other: f64) -> Trade {
        let cost = Cost {
            seconds: 1.0,
            memory: 1.0,
            bond_visits: 1.0,
            unknowns: 1.0,
        };
        let case = |settings: &[&str], error: f64| Case {
            settings: settings.iter().map(|s| (*s).to_owned()).collect(),
            overrides: Vec::new(),
            coupling: "splice".to_owned(),
            mesh: None,
            outcome: Outcome::Ran {
                cost,
                errors: vec![error],
            },
            guessed: None,
        };
        Trade {
            scene: PathBuf::from("plate.toml"),
            wants: vec![(Quantity::Displacement, 0.01)],
            reference: ReferenceRun {
                keys: Vec::new(),
                why: String::new(),
                cost,
                own_error,
            },
            cases: vec![case(&[], scene), case(&["twice"], other)],
            by: CostBy::Time,
            left: 0,
            ended: TradeEnd::Complete,
        }
    }

    #[test]
    fn the_error_of_a_reference_follows_from_three_spacings() {
        let labels = || vec!["twice".to_owned()];
        // u(h) = u + 0.3 h², with h = 0.2, 0.1 and the reference at 0.05
        for order in [1.0, 2.0] {
            let off = |h: f64| 0.3 * h.powf(order);
            let errors = [0.1, 0.2].map(|h| off(h) - off(0.05));
            let trade = study(OwnError::Order(labels()), errors[0], errors[1]);
            let own = trade.reference_errors()[0].unwrap();
            assert!((own / off(0.05) - 1.0).abs() < 1e-12, "{own}");
        }
        // no order is seen
        let trade = study(OwnError::Order(labels()), 0.1, 0.12);
        assert_eq!(trade.reference_errors(), [None]);
        let trade = study(OwnError::Bound(labels()), 0.1, 0.02);
        assert_eq!(trade.reference_errors(), [Some(0.02)]);
        let trade = study(OwnError::Unknown, 0.1, 0.02);
        assert_eq!(trade.reference_errors(), [None]);
    }
}
