//! Zones of any shape, on meshes that follow the lattice and on those that do not.

use rayon::prelude::*;

use super::seam_conditions::Conditions;
use super::{AFFINE_LIMIT, Material, rows_of};
use crate::{
    Effort,
    enclosed::{Enclosed, EnclosedError, MESH, SPACING, YOUNGS_MODULUS, jittered},
    meshes::{gmsh, scene},
    patch::IRREGULAR_LIMIT,
    typed,
};
use bondline::{
    coupling::truncated::seam_conditions,
    model::ModelError,
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
    progress::Progress,
};

/// Largest factor of an energy for which it is shown that none helps.
const MOST_FACTOR: f64 = 1e3;

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
    /// With a crack from its middle to a quarter of a cell before the seam: through elements a scene takes none.
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
            Self::Cracked => "crack up to the seam",
            Self::Ball => "staircase of a ball",
        }
    }

    /// The zone as a shape, `half` cells to either side in a block of `total`.
    fn shape<const D: usize>(self, half: u32, total: u32, cell: f64) -> String {
        let size = |cells: u32| f64::from(cells) * cell;
        let (zone, end) = (size(half), size(total));
        let block = typed::cube::<D>(zone);
        // all of the zone in the other directions, this much along x
        let slice = |from: f64, to: f64| {
            let along = |first: f64, rest: f64| std::array::from_fn(|k| [first, rest][k.min(1)]);
            typed::cuboid::<D>(along(from, -zone), along(to, zone))
        };
        match self {
            Self::Block | Self::Cracked => block,
            Self::Reentrant => typed::without(&block, &typed::cuboid([0.0; D], [zone; D])),
            Self::Hole => typed::without(&block, &typed::cube::<D>(size(half / 2))),
            Self::Two => typed::without(&block, &slice(0.0, cell)),
            Self::Boundary => slice(-end, zone),
            Self::Ball => format!(
                "{{ ball = {{ center = {}, radius = {zone:?} }} }}",
                typed::place([0.0; D])
            ),
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

/// A case as a scene: its text, its mesh where that is a file, and half the width of its block.
fn typed_case<const D: usize>(case: &Case) -> Result<(String, Option<String>, f64), EnclosedError> {
    let (zone, total) = halves::<D>(case.form, case.grain.size());
    let cell = f64::from(case.grain.size()) * SPACING;
    let (half, cells) = (f64::from(total) * cell, 2 * total as usize);
    let mut shape = case.form.shape::<D>(zone, total, cell);
    let (mesh, file) = match case.grain {
        Grain::Aligned(_) => (typed::grid([-half; D], [half; D], [cells; D]), None),
        grain => {
            let simplices = grain == Grain::Simplices;
            let regular = jittered::<D>(half, cells, simplices, 0.0)?;
            let moved = jittered::<D>(half, cells, simplices, 0.2)?;
            // a ball goes by the middle of the box in which a cell lies; boxes hold moved centroids too
            let in_ball = |c: usize| {
                let middle = (regular.centroid(c) / cell).map(|s| s.floor() + 0.5);
                (middle.norm() < f64::from(zone)).then_some(0)
            };
            if case.form == Form::Ball {
                shape = "{ set = \"ball\" }".to_owned();
            }
            (
                format!("[mesh.file]\npath = \"{MESH}\"\n"),
                Some(gmsh::of_mesh(&moved, &["ball"], in_ball)),
            )
        }
    };
    let law = case.material.law();
    let cracks = match case.form {
        Form::Cracked => crack::<D>((f64::from(zone) - 0.25) * cell),
        _ => String::new(),
    };
    let text = format!(
        "kinematics = \"{}\"\ncoupling = \"truncated\"\n{mesh}{}[peridynamics]\nhorizon = {:?}\npoints.lattice = {{ spacing = {SPACING}, origin = {} }}\n{}{}[zones]\nnonlocal = {shape}\n{cracks}{}",
        typed::kinematics::<D>(),
        typed::material(law, YOUNGS_MODULUS, case.material.poisson_ratio()),
        f64::from(case.ratio) * SPACING,
        typed::place([0.5 * SPACING; D]),
        typed::law_line(law),
        typed::UNCUT,
        typed::FREE
    );
    Ok((text, file, half))
}

fn files(file: &Option<String>) -> Vec<(&str, &str)> {
    file.iter().map(|text| (MESH, text.as_str())).collect()
}

fn build<const D: usize>(case: &Case) -> Result<Enclosed<D>, EnclosedError> {
    let (text, file, half) = typed_case::<D>(case)?;
    Ok(Enclosed::of_scene(&text, &files(&file), half)?)
}

/// Lists the conditions of a seam that does not follow the lattice, and the residual of its fit.
fn obstruction<const D: usize>(grain: Grain, ratio: u32) -> Vec<TableRow> {
    let case = Case {
        form: Form::Block,
        grain,
        material: Material::Pairwise(Micromodulus::InverseDistance),
        ratio,
    };
    let name = format!("{D}D, m = {ratio}, {}", grain.name());
    let laid = typed_case::<D>(&case)
        .and_then(|(text, file, _)| Ok(scene::model::<D>(&text, &files(&file))?));
    let laid = match laid {
        Ok(laid) => laid,
        Err(e) => return vec![TableRow::refused(name, "conditions", e.to_string())],
    };
    let mut rows = Vec::new();
    if let Some(found) = seam_conditions(&laid.model) {
        let (count, unknowns) = (found.target.len(), found.columns.len());
        let floor = found.floor;
        let conditions = Conditions::of(found);
        let (rank, unreachable) = conditions.rank();
        rows.push(TableRow::info(&name, "conditions", count as f64));
        rows.push(TableRow::info(&name, "rank", rank as f64));
        rows.push(TableRow::info(&name, "unknowns", unknowns as f64));
        rows.push(TableRow::info(&name, "unreachable", unreachable));
        rows.push(TableRow::info(
            &name,
            "unreachable by factors of 0.1 to 1000, at least",
            conditions.out_of_reach(floor, MOST_FACTOR - 1.0),
        ));
    }
    rows.push(match laid.coupling.operator(&laid.model) {
        Ok(_) => TableRow::info(&name, "left after the fit", 0.0),
        Err(ModelError::Seam { residual, .. }) => {
            TableRow::info(&name, "left after the fit", residual)
                .because("refused when the model is made")
        }
        Err(e) => TableRow::refused(&name, "left after the fit", e.to_string()),
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
    let mut rows: Vec<TableRow> = Vec::new();
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
fn crack<const D: usize>(end: f64) -> String {
    let shape = match D {
        3 => format!(
            "polygon = {:?}",
            [
                [0.0, 0.0, -end],
                [end, 0.0, -end],
                [end, 0.0, end],
                [0.0, 0.0, end]
            ]
        ),
        _ => format!(
            "segment = {{ from = {}, to = {} }}",
            typed::place([0.0; 2]),
            typed::place([end, 0.0])
        ),
    };
    format!("[cracks.c]\n{shape}\n")
}

fn rows<const D: usize>(case: &Case) -> Vec<TableRow> {
    let name = format!(
        "{D}D {}, m = {}, {}, {}",
        case.material.name(),
        case.ratio,
        case.form.name(),
        case.grain.name()
    );
    let e = match build::<D>(case) {
        Ok(e) => e,
        Err(EnclosedError::Scene(e)) if e.is_seam() => {
            return vec![TableRow::refused(name, "residual", e.to_string())];
        }
        Err(e) => {
            return vec![
                TableRow::at_most(name, "residual", f64::NAN, AFFINE_LIMIT).because(e.to_string()),
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
    let mut all: Vec<Vec<TableRow>> = one.par_iter().map(rows::<1>).collect();
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
        let mut all: Vec<TableRow> = cases::<1>(Effort::Quick)
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
