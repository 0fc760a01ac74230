//! Stability of a seam whose energy is no sum of squares: its stiffness is factorised, and refused if that fails.
//!
//! Truncated bonds of an LPS below the Poisson ratio of a pairwise law have dilatations of negative stiffness. Whole bonds outweigh them down to a bulk modulus of zero, pieces need not: the matrix at hand decides.

use crate::observe::summary::Decision;
use crate::progress::{Progress, Silent};
use crate::run::error::RunError;
use crate::scene::materials::Ratio;
use crate::solve::FreeDofs;
use crate::solve::direct::{Analysis, Factor};
use crate::solve::direct_params::{DirectError, DirectParams};
use crate::solve::ordering::Ordering;
use crate::system::{Ranks, Symmetry};
use crate::tensor::padded;
use crate::{
    coupling::{Definiteness, Operator},
    model::Model,
};

/// Shift of the matrix, as a part of its diagonal: far above what round-off leaves of the rigid motions of a free body (6e-13), and no mode that it hides grows by more than e² in 100 000 steps.
const SHIFT: f64 = 1e-10;

/// Refuses a model that has negative eigenvalues; its matrix is looked at only if it may. Collective where families are spread over `ranks`.
///
/// # Errors
/// [`RunError::Indefinite`] if the matrix has a negative eigenvalue, or is too large to be factorised.
pub(crate) fn check<const D: usize>(
    (model, operator, ranks): (&Model<D>, &Operator<'_, D>, Option<&dyn Ranks>),
    ratio: Option<Ratio>,
    choices: &mut Vec<Decision>,
    progress: &dyn Progress,
) -> Result<(), RunError> {
    let Some(ratio) = ratio.filter(|_| operator.definiteness == Definiteness::NegativeTerms) else {
        return Ok(());
    };
    let refused = |what: String| RunError::Indefinite {
        what,
        typed: ratio.typed,
        pairwise: ratio.pairwise,
    };
    match factorised((model, operator, ranks), f64::INFINITY, progress) {
        Ok(()) => {
            choices.push(Decision {
                choice: "the seam is stable".to_owned(),
                why: format!(
                    "Poisson's ratio {:.4} is below {:.4}, so its dilatations have a negative stiffness; a Cholesky factorisation of the matrix at rest found no negative eigenvalue",
                    ratio.typed, ratio.pairwise
                ),
            });
            Ok(())
        }
        Err(Open::Negative { site }) => {
            let x = model.sites[site].position;
            let x: Vec<String> = x.iter().map(|x| format!("{x:.4e}")).collect();
            Err(refused(format!(
                "the stiffness at rest has a negative eigenvalue (found near ({}))",
                x.join(", ")
            )))
        }
        Err(Open::NotFactorised(error)) => {
            Err(refused(format!("nothing shows that it has none: {error}")))
        }
    }
}

/// Reason why a matrix is not shown to be free of negative eigenvalues.
pub(crate) enum Open {
    /// A pivot of a site is negative.
    Negative { site: usize },
    /// It could not be factorised, or not at the price.
    NotFactorised(String),
}

/// Factorises the matrix at rest of all sites, none of them held, if that takes at most so many operations. Every process does, also where families are spread over `ranks`.
pub(crate) fn factorised<const D: usize>(
    (model, operator, ranks): (&Model<D>, &Operator<'_, D>, Option<&dyn Ranks>),
    most_flops: f64,
    progress: &dyn Progress,
) -> Result<(), Open> {
    let mut matrix = match model.spread(ranks) {
        Some(spread) => {
            spread.gather_all_rows(D, |own| model.assemble_sites(operator, own, &Silent))
        }
        None => model.assemble(operator, progress),
    };
    matrix.raise_diagonal(SHIFT);
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let free = FreeDofs::from_prescribed(&vec![None; matrix.dofs()], D);
    let params = DirectParams {
        symmetry: Symmetry::Symmetric,
        smallest_pivot: 0.0,
        ..DirectParams::default()
    };
    let analysis = Analysis::new(&matrix, &free, &positions, Ordering::default())
        .map_err(|error| Open::NotFactorised(error.to_string()))?;
    let flops = analysis.cost(params.symmetry).flops;
    if flops > most_flops {
        return Err(Open::NotFactorised(format!(
            "it would take {flops:.1e} operations"
        )));
    }
    match Factor::new(&matrix, &free, analysis, &params, progress) {
        Ok(_) => Ok(()),
        Err(DirectError::NotPositive { site } | DirectError::Singular { site, .. }) => {
            Err(Open::Negative { site })
        }
        Err(error @ DirectError::TooLarge { .. }) => Err(Open::NotFactorised(error.to_string())),
    }
}
