//! Zones of any shape, on meshes that follow the lattice and on those that do not.

use std::sync::Arc;

use rayon::prelude::*;

use super::{AFFINE_LIMIT, Material, rows_of};
use crate::{
    Effort,
    enclosed::{Enclosed, EnclosedError, SPACING},
    patch::IRREGULAR_LIMIT,
};
use bondline::{
    coupling::{
        Coupling, Model, ModelError, Peridynamics, PointSource, Problem, Surfaces, Truncated, Zone,
        truncated::seam_conditions,
    },
    mesh::generate::{Axis, Grid},
    observe::report::{Columns, Row, Table},
    peridynamics::{BondWeights, Micromodulus, PartialVolume},
    progress::{Progress, Silent},
    shape::{Barrier, Shape},
    tensor::{Tensor4, Vector},
};

/// The shape of a zone; lengths are in cells, the zone reaches from −`half` to `half` where nothing else is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// All of it.
    Block,
    /// Without its corner of positive coordinates: re-entrant corners and edges.
    Reentrant,
    /// With elements in its middle.
    Hole,
    /// Two blocks, one cell apart.
    Two,
    /// Up to the boundary of the mesh.
    Boundary,
    /// With a crack from its middle through the seam.
    Cracked,
    /// About a ball.
    Ball,
}

impl Form {
    fn name(self) -> &'static str {
        match self {
            Self::Block => "block",
            Self::Reentrant => "re-entrant corner",
            Self::Hole => "elements inside",
            Self::Two => "two zones",
            Self::Boundary => "at the boundary",
            Self::Cracked => "crack through the seam",
            Self::Ball => "staircase of a ball",
        }
    }

    fn holds<const D: usize>(self, s: &Vector<D>, half: f64) -> bool {
        let across = (1..D).all(|i| s[i].abs() < half);
        let block = s.amax() < half;
        match self {
            Self::Reentrant => block && !s.iter().all(|&s| s > 0.0),
            Self::Hole => block && s.amax() > (half / 2.0).floor(),
            Self::Two => across && s[0].abs() < half && !(0.0..1.0).contains(&s[0]),
            Self::Boundary => across && s[0] < half,
            Self::Block | Self::Cracked => block,
            Self::Ball => s.norm() < half,
        }
    }
}

/// A mesh around a zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Grain {
    /// Cells of so many spacings, aligned to the lattice.
    Aligned(u32),
    /// Boxes of two spacings whose nodes are moved by up to a fifth.
    Jittered,
    /// Simplices of two spacings whose nodes are moved by up to a fifth.
    Simplices,
}

impl Grain {
    fn size(self) -> u32 {
        match self {
            Self::Aligned(n) => n,
            Self::Jittered | Self::Simplices => 2,
        }
    }

    fn name(self) -> String {
        match self {
            Self::Aligned(n) => format!("cells of {n} h"),
            Self::Jittered => "boxes of 2 h, jittered".to_owned(),
            Self::Simplices => "simplices of 2 h, jittered".to_owned(),
        }
    }
}

struct Case {
    form: Form,
    grain: Grain,
    material: Material,
    ratio: u32,
}

/// Half widths of the zone and of the block, in cells.
fn halves<const D: usize>(form: Form, size: u32) -> (u32, u32) {
    match (D, size) {
        // small enough for all eigenvalues of its conditions
        (3, _) if form == Form::Block => (1, 3),
        (_, _) if form == Form::Block => (3, 5),
        (3, 1) => (4, 6),
        (3, _) => (2, 4),
        (_, 1) => (6, 10),
        (_, 2) => (4, 6),
        _ => (2, 4),
    }
}

/// The model of a case, half the width of its block, and its tensor.
fn model<const D: usize>(case: &Case) -> Result<Placed<D>, EnclosedError> {
    let (zone, total) = halves::<D>(case.form, case.grain.size());
    let cell = f64::from(case.grain.size()) * SPACING;
    let half = f64::from(total) * cell;
    let mut grid = Grid::<D>::new(std::array::from_fn(|_| Axis::Uniform {
        min: -half,
        max: half,
        cells: 2 * total as usize,
    }));
    if case.grain == Grain::Simplices {
        grid.simplices();
    }
    let regular = grid.mesh()?;
    let zones = (0..regular.cell_count())
        .map(|c| {
            // the middle of the box in which the cell lies
            let s = regular.centroid(c) / cell;
            if case
                .form
                .holds(&s.map(|s| s.floor() + 0.5), f64::from(zone))
            {
                Zone::Nonlocal
            } else {
                Zone::Local
            }
        })
        .collect();
    let mesh = match case.grain {
        Grain::Aligned(_) => regular,
        _ => grid.jitter(0.2, 7).mesh()?,
    };
    let law = case.material.law::<D>();
    let tensor = *law.linearised().tensor();
    let horizon = f64::from(case.ratio) * SPACING;
    let end = (f64::from(zone) + 0.4) * cell;
    let barriers = if case.form == Form::Cracked {
        vec![Barrier::Crack(crack::<D>(end))]
    } else {
        Vec::new()
    };
    let problem = Problem {
        cell_material: vec![0; mesh.cell_count()],
        mesh,
        zones,
        tensors: vec![tensor],
        peridynamic_material: 0,
        peridynamics: Some(Peridynamics {
            law,
            horizon: Arc::new(move |_| horizon),
            points: PointSource::Lattice {
                spacing: SPACING,
                origin: Vector::repeat(0.5 * SPACING),
            },
            weights: BondWeights::Isotropic,
            volumes: PartialVolume::Full,
            barriers,
            voids: Vec::new(),
            surfaces: Surfaces::Uncut,
        }),
        coupling: Box::new(Truncated::default()),
    };
    let (model, coupling) = Model::new(problem, &Silent)?;
    Ok(Placed {
        model,
        coupling,
        half,
        tensor,
    })
}

struct Placed<const D: usize> {
    model: Model<D>,
    coupling: Box<dyn Coupling<D>>,
    half: f64,
    tensor: Tensor4<D>,
}

fn build<const D: usize>(case: &Case) -> Result<Enclosed<D>, EnclosedError> {
    let Placed {
        model,
        coupling,
        half,
        tensor,
    } = model::<D>(case)?;
    let stiffness = {
        let operator = coupling.operator(&model)?;
        model.assemble(operator.as_ref(), &Silent)
    };
    Ok(Enclosed {
        model,
        stiffness,
        half,
        tensor,
    })
}

/// What stands in the way of a seam that does not follow the lattice, and whether it could be fitted.
fn obstruction<const D: usize>(grain: Grain, ratio: u32) -> Vec<Row> {
    let case = Case {
        form: Form::Block,
        grain,
        material: Material::Pairwise(Micromodulus::InverseDistance),
        ratio,
    };
    let name = format!("{D}D, m = {ratio}, {}", grain.name());
    let placed = match model::<D>(&case) {
        Ok(placed) => placed,
        Err(e) => return vec![Row::refused(name, "conditions", e.to_string())],
    };
    let mut rows = Vec::new();
    if let Some(found) = seam_conditions(&placed.model) {
        rows.push(Row::info(&name, "conditions", found.conditions as f64));
        rows.push(Row::info(&name, "rank", found.rank as f64));
        rows.push(Row::info(&name, "unknowns", found.unknowns as f64));
        rows.push(Row::info(&name, "unreachable", found.unreachable));
        rows.push(Row::info(
            &name,
            "unreachable by factors of 0.1 to 1000, at least",
            found.out_of_reach,
        ));
    }
    rows.push(match placed.coupling.operator(&placed.model) {
        Ok(_) => Row::info(&name, "left after the fit", 0.0),
        Err(ModelError::Seam { residual, .. }) => Row::info(&name, "left after the fit", residual)
            .because("refused when the model is made"),
        Err(e) => Row::refused(&name, "left after the fit", e.to_string()),
    });
    rows
}

/// The table of seams that do not follow the lattice.
pub(super) fn obstructions(effort: Effort, progress: &dyn Progress) -> Table {
    progress.stage("conditions of seams", None);
    let mut table = Table::new(
        "Seams that do not follow the lattice, a block of 12 h in 2D and of 4 h in 3D: conditions for affine fields (pairwise part), how many are independent, energies that may change, the part of what is missing that no \
         change of any sign can reach, and what the fit with factors of at least 0.1 leaves, relative to the largest traction of a face",
        Columns::ByQuantity,
    );
    let grains = [Grain::Jittered, Grain::Simplices];
    let mut rows: Vec<Row> = Vec::new();
    for grain in grains {
        for ratio in [2, 3] {
            rows.extend(obstruction::<2>(grain, ratio));
        }
    }
    let solid: &[u32] = match effort {
        Effort::Quick => &[2],
        Effort::Full => &[2, 3],
    };
    for grain in grains {
        for &ratio in solid {
            rows.extend(obstruction::<3>(grain, ratio));
        }
    }
    rows.into_iter().for_each(|row| table.push(row));
    table
}

/// The half plane `y = 0`, `x > 0` up to `end`: a segment in 2D, a rectangle through the block in 3D.
fn crack<const D: usize>(end: f64) -> Shape<D> {
    let corner = |x: f64, z: f64| Vector::<D>::from_fn(|i, _| [x, 0.0, z][i]);
    match D {
        3 => Shape::Polygon(vec![
            corner(0.0, -end),
            corner(end, -end),
            corner(end, end),
            corner(0.0, end),
        ]),
        _ => Shape::Segment {
            a: corner(0.0, 0.0),
            b: corner(end, 0.0),
        },
    }
}

fn rows<const D: usize>(case: &Case) -> Vec<Row> {
    let name = format!(
        "{D}D {}, m = {}, {}, {}",
        case.material.name(),
        case.ratio,
        case.form.name(),
        case.grain.name()
    );
    let e = match build::<D>(case) {
        Ok(e) => e,
        Err(e @ EnclosedError::Model(ModelError::Seam { .. })) => {
            return vec![Row::refused(name, "residual", e.to_string())];
        }
        Err(e) => {
            return vec![
                Row::at_most(name, "residual", f64::NAN, AFFINE_LIMIT).because(e.to_string()),
            ];
        }
    };
    let aligned = matches!(case.grain, Grain::Aligned(_));
    let limit = if aligned {
        AFFINE_LIMIT
    } else {
        IRREGULAR_LIMIT
    };
    // where bonds are missing the body is softer, whatever the seam is: within the families of an LPS, and a cell
    let reach = (2.0 * f64::from(case.ratio) + f64::from(case.grain.size())) * SPACING;
    let end =
        f64::from(halves::<D>(case.form, case.grain.size()).0 * case.grain.size() + 1) * SPACING;
    rows_of(&name, &e, case.material, limit, |x| match case.form {
        Form::Boundary => x[0] > -e.half + reach,
        Form::Cracked => x[0] < -reach || x[0] > end + reach || (D > 1 && x[1].abs() > reach),
        _ => true,
    })
}

fn cases<const D: usize>(effort: Effort) -> Vec<Case> {
    let pairwise = Material::Pairwise(Micromodulus::InverseDistance);
    let full = effort == Effort::Full;
    let ratio = if D == 3 { 2 } else { 3 };
    let forms: &[Form] = if D == 1 {
        &[Form::Two, Form::Boundary, Form::Hole]
    } else {
        &[
            Form::Reentrant,
            Form::Hole,
            Form::Two,
            Form::Boundary,
            Form::Cracked,
            Form::Ball,
        ]
    };
    let mut grains = vec![Grain::Aligned(1), Grain::Aligned(2)];
    if full && D < 3 {
        grains.push(Grain::Aligned(4));
    }
    if D < 3 {
        grains.push(Grain::Jittered);
    }
    if D == 2 {
        grains.push(Grain::Simplices);
    }
    let mut cases = Vec::new();
    for &form in forms {
        for &grain in &grains {
            for material in [pairwise, Material::Lps(0.3)] {
                // quick: in 3D each form once, by turns with either law
                let quick = match (D, grain) {
                    (3, Grain::Aligned(1)) => material == pairwise,
                    (3, _) => false,
                    (_, Grain::Aligned(2)) => false,
                    _ => true,
                };
                if full || quick {
                    cases.push(Case {
                        form,
                        grain,
                        material,
                        ratio,
                    });
                }
            }
        }
    }
    cases
}

/// The table of zones.
pub(super) fn table(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Truncated bonds, zones of other shapes. Columns as above; at a boundary and a crack the residual is that of the sites out of reach of missing bonds. Jittered: faces cut the lattice anywhere, the energies of pieces \
         are fitted",
        Columns::ByQuantity,
    );
    progress.stage("zones", None);
    let one = cases::<1>(effort);
    let two = cases::<2>(effort);
    let three = cases::<3>(effort);
    let mut all: Vec<Vec<Row>> = one.par_iter().map(rows::<1>).collect();
    all.extend(two.par_iter().map(rows::<2>).collect::<Vec<_>>());
    all.extend(three.par_iter().map(rows::<3>).collect::<Vec<_>>());
    all.into_iter().flatten().for_each(|row| table.push(row));
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::observe::report::Verdict;

    #[test]
    fn zones_of_any_shape_pass() {
        let mut all: Vec<Row> = cases::<1>(Effort::Quick)
            .iter()
            .flat_map(rows::<1>)
            .collect();
        let plane = cases::<2>(Effort::Quick).into_iter().filter(|c| {
            matches!(c.form, Form::Reentrant | Form::Cracked) && c.grain != Grain::Jittered
        });
        all.extend(plane.flat_map(|c| rows::<2>(&c)));
        let solid = cases::<3>(Effort::Quick).into_iter();
        all.extend(
            solid
                .filter(|c| c.form == Form::Boundary)
                .flat_map(|c| rows::<3>(&c)),
        );
        for row in &all {
            assert_eq!(row.verdict, Verdict::Pass, "{row:?}");
        }
        // symmetry, residual, forces, eigenvalue, moments
        assert_eq!(all.len(), 12 * 4 + 8 * 5 + 5);
    }
}
