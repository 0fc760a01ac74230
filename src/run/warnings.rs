//! Warnings of `check` and `run`: properties of a model that make its results doubtful.

use std::sync::Arc;

use crate::material::LocalLaw;
use crate::mesh::{CellShape, quality};
use crate::model::{CellRole, Model, Zone};
use crate::observe::proof::Proof;
use crate::observe::report::number;
use crate::observe::warning::{Code, Quantity, Warning};
use crate::run::error::RunError;
use crate::run::motion::dynamic_system::failing_stretch;
use crate::run::setup::RunSettings;
use crate::scene::spec::CouplingTraits;
use crate::shape::Barrier;
use crate::solve::statics::MethodUsed;
use crate::system::{SemiDiscrete, Symmetry};

/// All doubts about a model.
pub fn doubts<const D: usize>(model: &Model<D>, traits: CouplingTraits) -> Vec<Warning> {
    let all = [one_sided(model), crack_beside_seam(model, traits)];
    let notes = model.mesh.notes.iter();
    let notes = notes.map(|note| Warning::new(Code::Mesh, note.as_str()));
    notes.chain(all.into_iter().flatten()).collect()
}

/// The warnings of a proof, then all doubts.
pub(crate) fn warnings<const D: usize>(
    model: &Model<D>,
    traits: CouplingTraits,
    proof: &Proof,
) -> Vec<Warning> {
    let proved = proof.warnings().cloned();
    proved.chain(doubts(model, traits)).collect()
}

/// Stretches at which bonds of solids break: the least is that of concrete (100 J/m², 30 GPa) with a horizon of 10 m, brittle parts
/// of millimetres have 1e-4 to 1e-2, and rubber less than the largest.
const USUAL_STRETCHES: std::ops::RangeInclusive<f64> = 2e-5..=1.0;

/// A stretch at which bonds break, or soften, that no solid has: constants in other units than lengths, most likely.
///
/// # Errors
/// [`RunError`] for a fracture energy that gives no stretch.
pub(crate) fn unusual_stretch<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
) -> Result<Option<Warning>, RunError> {
    // of bonds that soften that at which they would break at once: by it units are known
    let softening = rest.breaking.softening.softening();
    let stretch =
        failing_stretch(model, rest)?.map(|s| softening.map_or(s, |of| s * of.ratio.sqrt()));
    Ok(stretch.filter(|s| !USUAL_STRETCHES.contains(s)).map(|s| {
        Warning::new(
            Code::Units,
            format!(
                "bonds break at a stretch of {}: check the units of Young's modulus, fracture energy and lengths, which must be consistent (N, m, Pa and J/m², or N, mm, MPa and N/mm)",
                number(s)
            ),
        )
    }))
}

/// Points of a torn body whose law no longer responds.
pub(crate) fn without_response(system: &dyn SemiDiscrete, u: &[f64]) -> Option<Warning> {
    let points = system.body_state()?.points_without_response(u);
    (points > 0).then(|| {
        Warning::new(
            Code::TornPoints,
            format!(
                "{points} points have lost so many bonds that what is left does not span their surroundings, or has turned inside out: they have no deformation gradient, carry no stress of their own, and follow the bonds of their neighbours"
            ),
        )
    })
}

/// The out-of-balance force, relative to the sum of all nodal loads and reactions, from which on it is warned of.
///
/// A fixed body carries what is applied, so that a reaction that differs from the load is an error of every stress on the way. Rows of couplings by force
/// are exact under affine fields and out of balance under others. Measured on plates of an LPS with a splice, horizon 3 spacings: 0.033 with a zone a third
/// of a horizon beside a loaded face, whose reaction is 7 % too large and the displacements 8 %; with `truncated` 4e-15, and 4e-5 of the displacement. Of bars under their weight with `balanced` and `blending` 0.004 to 0.009, and the
/// displacements 1.2 to 3 %.
const OUT_OF_BALANCE: f64 = 0.002;

/// Imbalance of the forces of a solution.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Imbalance<'a> {
    /// Their sum \[N\], by axis.
    pub force: &'a [f64],
    /// Its size over that of all loads and reactions.
    pub relative: f64,
    /// Difference of displacements from those of elements alone, over the largest of these; none where that was not computed.
    pub difference: Option<f64>,
}

impl Imbalance<'_> {
    /// Returns true if it is large enough for a warning.
    pub fn is_told(&self) -> bool {
        self.relative > OUT_OF_BALANCE
    }
}

/// A solution whose loads and reactions do not balance.
pub(crate) fn out_of_balance(of: &Imbalance<'_>, traits: CouplingTraits) -> Option<Warning> {
    let force: Vec<String> = of.force.iter().map(|f| number(*f)).collect();
    // rows of a seam that cuts bonds balance whatever their displacements are
    let remedy = match traits.name {
        "truncated" => {
            "the rows of its seam balance: enclose the zone in more elements, or couple by nonlocal"
        }
        _ => {
            "its seam balances affine fields only: couple by truncated, or enclose the zone in more elements, further from surfaces and supports"
        }
    };
    let displacements = match of.difference {
        Some(part) => format!(
            "differ from those of elements alone by up to {} % of the largest",
            number(100.0 * part)
        ),
        None => "may be wrong by three times as much, and by far more where the body bends easily"
            .to_owned(),
    };
    of.is_told().then(|| {
        let message = format!(
            "loads and reactions are out of balance by {:.2} % of the sum of them all, by the force ({}), and displacements {displacements} (coupling `{}`): {remedy}",
            100.0 * of.relative,
            force.join(", "),
            traits.name
        );
        let warning = Warning::new(Code::Imbalance, message).of(Quantity::Displacement, of.difference);
        warning.remedy(match traits.name {
            "truncated" => ["coupling=nonlocal"],
            _ => ["coupling=truncated"],
        })
    })
}

/// A symmetric stiffness that took an LU factorisation, since that of Cholesky met a pivot that is not positive.
pub(crate) fn indefinite(symmetry: Symmetry, method: MethodUsed) -> Option<Warning> {
    (symmetry == Symmetry::Symmetric && method == MethodUsed::Lu).then(|| {
        Warning::new(
            Code::Indefinite,
            "the stiffness is symmetric and not positive definite: the solution is an equilibrium, and not one of least energy, so that a motion would leave it; leave peridynamics.points out, whose lattice follows the mesh, or draw the zone wider than its families",
        )
    })
}

/// Elements that resist deformations at constant volume, and those that soften in a width that depends on the direction of the crack; `laws` by material.
pub(crate) fn of_elements<const D: usize>(
    model: &Model<D>,
    laws: &[Option<Arc<dyn LocalLaw<D>>>],
) -> impl Iterator<Item = Warning> + use<D> {
    let flows = |c: usize| {
        let law = laws[model.material_of_cell(c) as usize].as_ref();
        law.is_some_and(|law| law.flows_at_constant_volume())
    };
    let softens = |c: usize| {
        let law = laws[model.material_of_cell(c) as usize].as_ref();
        law.is_some_and(|law| law.history().damage.is_some())
    };
    let all = [
        flowing(model, flows),
        nearly_incompressible(model, flows),
        elongated(model, softens),
    ];
    all.into_iter().flatten()
}

/// Elements of one quadrature point whose material flows at constant volume.
fn flowing<const D: usize>(model: &Model<D>, flows: impl Fn(usize) -> bool) -> Option<Warning> {
    let is_simplex = |c: usize| matches!(model.mesh.shapes[c], CellShape::Tri3 | CellShape::Tet4);
    let count = (0..model.mesh.cell_count())
        .filter(|&c| model.is_element(c) && is_simplex(c) && flows(c))
        .count();
    (count > 0).then(|| {
        Warning::new(Code::FlowInSimplices, format!(
            "{count} tri3 or tet4 elements flow at constant volume, which such cells resist: where they flow they are too stiff; mesh them with quad4 or hex8 cells"
        ))
    })
}

/// The longest edge of a cell over its shortest beyond which a crack band of [`crate::fem::crack_band`] takes 0.7 to 1.4 of the fracture energy.
const ELONGATED: f64 = 2.0;

/// Elements of a law that softens in which the width of a crack depends on its direction.
fn elongated<const D: usize>(model: &Model<D>, softens: impl Fn(usize) -> bool) -> Option<Warning> {
    if D == 1 {
        return None;
    }
    let cells = (0..model.mesh.cell_count())
        .filter(|&c| model.is_element(c) && softens(c))
        .map(|c| quality::edges(&model.mesh, c))
        .map(|(short, long)| long / short)
        .filter(|ratio| *ratio > ELONGATED);
    let (count, largest) = cells.fold((0, 0.0_f64), |(n, most), r| (n + 1, most.max(r)));
    let factor = largest.sqrt();
    (count > 0).then(|| {
        Warning::new(Code::CrackBand, format!(
            "{count} elements that soften are up to {} times as long as wide: a crack takes {} to {} of the fracture energy there, by its direction (docs/methods.md, section 1); mesh where cracks run with edges of one length",
            number(largest),
            number(1.0 / factor),
            number(factor)
        ))
    })
}

/// The Poisson ratio beyond which elements of first order are warned of: a cantilever of plane strain with eight quad4 cells over its height bends by 0.93 of what it should at 0.45, by 0.79 at 0.49 and by a twelfth at 0.4999 (`tests/scene_runs.rs`).
const NEARLY_INCOMPRESSIBLE: f64 = 0.45;

/// Elements of first order of a solid that hardly changes its volume, which they can only keep by hardly bending.
///
/// Of laws that flow at constant volume they take the mean dilatation of a cell, or are warned of anyway.
fn nearly_incompressible<const D: usize>(
    model: &Model<D>,
    flows: impl Fn(usize) -> bool,
) -> Option<Warning> {
    if D == 1 {
        return None;
    }
    // of plane stress a third at most, since its thickness gives way
    let ratio = |c: usize| {
        let tensor = model.tensor_of_cell(c);
        let (lambda, mu) = tensor.isotropic_part();
        lambda / (2.0 * (lambda + mu))
    };
    let is_first_order = |c: usize| model.mesh.shapes[c] == model.mesh.shapes[c].linear();
    let cells = (0..model.mesh.cell_count())
        .filter(|&c| model.is_element(c) && is_first_order(c) && !flows(c))
        .map(ratio)
        .filter(|ratio| *ratio > NEARLY_INCOMPRESSIBLE);
    let (count, largest) = cells.fold((0, 0.0_f64), |(n, most), r| (n + 1, most.max(r)));
    (count > 0).then(|| {
        Warning::new(Code::Locking, format!(
            "{count} elements of first order have a Poisson ratio of up to {}: they resist bending at nearly constant volume (volumetric locking), and displacements may be far too small; mesh them with cells of second order (quad8, tri6, hex20, tet10)",
            number(largest)
        ))
    })
}

/// Warns of elements with a partial stress at the surface of the body: measured in `docs/bars.md`.
fn one_sided<const D: usize>(model: &Model<D>) -> Option<Warning> {
    if D == 1 || !model.roles.contains(&CellRole::StressElement) {
        return None;
    }
    let at_surface = model.mesh.cells_at_boundary();
    let cells = at_surface.iter().zip(&model.roles);
    let count = cells
        .filter(|(outer, role)| **outer && **role == CellRole::StressElement)
        .count();
    (count > 0).then(|| {
        Warning::new(Code::TransitionAtSurface, format!(
            "{count} elements with a partial stress lie at the surface of the body, where families are one-sided: strains of the transition zone may alternate from element to element, the more the wider it is and the larger the horizon over spacing (docs/bars.md); enclose it in elements, or use another coupling"
        )).remedy(["coupling=truncated"])
    })
}

/// Cracks and voids so near to the seam that what is computed on this side of it lacks bonds: `bondline verify extremes`, "Cracks beside the seam".
fn crack_beside_seam<const D: usize>(model: &Model<D>, traits: CouplingTraits) -> Option<Warning> {
    let p = model.peridynamics.as_ref()?;
    let horizons = match traits.name {
        "splice" => SPLICE,
        "partial-stress" if model.roles.contains(&CellRole::StressElement) => STRESS_ELEMENTS,
        "partial-stress" => MESHFREE,
        _ => return None,
    };
    if p.barriers.is_empty() {
        return None;
    }
    let mut is_outside = vec![false; model.mesh.nodes.len()];
    let cells = (0..model.mesh.cell_count()).filter(|&c| model.zones[c] != Zone::Nonlocal);
    for c in cells {
        let nodes = model.mesh.cell(c);
        nodes.iter().for_each(|&n| is_outside[n as usize] = true);
    }
    let outside = model.mesh.nodes.iter().zip(is_outside);
    let nearest = outside
        .filter(|(_, is_outside)| *is_outside)
        .flat_map(|(x, _)| {
            let distance = |b: &Barrier<D>| b.shape().signed_distance(x).max(0.0) / p.horizon.at(x);
            p.barriers.iter().map(move |b| (distance(b), x))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    (nearest.0 < horizons * (1.0 + 1e-3)).then(|| {
        let place: Vec<String> = nearest.1.iter().map(|x| format!("{x:.4e}")).collect();
        Warning::new(Code::CrackAtSeam, format!(
            "a crack or void lies {:.2} horizons from the seam at ({}), where {} wants more than {horizons}: displacements are off by a few per cent to all of their size (docs/methods.md); enlarge [zones.nonlocal], or use coupling.truncated",
            nearest.0,
            place.join(", "),
            traits.name
        )).at(nearest.1.as_slice()).remedy(["coupling=truncated"])
    })
}

/// Horizons from crack to seam up to which a splice errs.
pub const SPLICE: f64 = 1.0;

/// As [`SPLICE`], of partial stress in elements.
pub const STRESS_ELEMENTS: f64 = 1.4;

/// As [`SPLICE`], of meshfree partial stress: the opening is off by 1.0 to 1.2 % there, m = 2, 3, 4.
pub const MESHFREE: f64 = 1.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::solve::statics::{StaticParams, StaticProblem, solve};
    use crate::system::BlockCsr;

    #[test]
    fn an_equilibrium_without_least_energy_is_warned_of() {
        // two unknowns with the stiffnesses 1 and `k`
        let warned = |k: f64| {
            let stiffness = BlockCsr {
                block: 1,
                row_offsets: vec![0, 1, 2],
                columns: vec![0, 1],
                values: vec![1.0, k],
                shared: None,
            };
            let problem = StaticProblem {
                stiffness: &stiffness,
                symmetry: Symmetry::Symmetric,
                positions: &[[0.0; 3], [1.0, 0.0, 0.0]],
                load: &[1.0, 1.0],
                prescribed: &[None, None],
            };
            let solution = solve(&problem, &StaticParams::default(), &Silent).expect("a solution");
            assert!((solution.displacement[1] - 1.0 / k).abs() < 1e-12);
            indefinite(Symmetry::Symmetric, solution.info.method).is_some()
        };
        assert!(!warned(2.0));
        assert!(warned(-2.0));
    }
}
