//! Affine fields through scenes: displacements prescribed on the whole boundary, on families of meshes, with every coupling and law.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::{gmsh, scene};
use crate::Effort;
use bondline::{
    mesh::CellShape,
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

/// Largest error of a displacement over the largest one.
pub const LIMIT: f64 = 1e-9;

/// Displacement gradient of the field.
const GRADIENT: [[f64; 3]; 3] = [
    [1e-3, 2e-4, -3e-4],
    [1e-4, -3e-4, 4e-4],
    [-2e-4, 5e-4, 7e-4],
];

/// A mesh as a file, and a box in its middle that elements enclose.
#[derive(Clone)]
pub(crate) struct Family {
    pub name: &'static str,
    pub kinematics: &'static str,
    /// Name of the file.
    pub file: &'static str,
    /// Its text.
    pub mesh: String,
    /// Side of the typical element.
    pub size: f64,
    /// Lowest and highest corner of the body, about.
    pub extent: [[f64; 3]; 2],
    /// The place in the body of a place in a block between these corners.
    pub place: fn([f64; 3]) -> [f64; 3],
    /// The zone: lowest and highest corner.
    pub zone: [[f64; 3]; 2],
    /// Part of the boundary on which displacements are prescribed.
    pub boundary: &'static str,
    /// Width of the transition zone.
    pub around: f64,
}

/// Cells of a square, `cells` along each side, moved by `place`.
fn plane(name: &'static str, cells: usize, place: impl Fn(f64, f64) -> [f64; 2]) -> Family {
    let n = cells + 1;
    let nodes = (0..n * n)
        .map(|k| place((k % n) as f64, (k / n) as f64))
        .map(|[x, y]| [x, y, 0.0]);
    let cell = |c: usize| {
        let a = c / cells * n + c % cells;
        vec![a, a + 1, a + 1 + n, a + n]
    };
    Family {
        name,
        kinematics: "plane-stress",
        mesh: gmsh(
            nodes.collect(),
            &(0..cells * cells).map(cell).collect::<Vec<_>>(),
        ),
        size: 1.0,
        file: "m.msh",
        extent: [[0.0; 3], [cells as f64, cells as f64, 0.0]],
        place: |x| x,
        zone: [[4.5, 4.5, 0.0], [7.5, 7.5, 0.0]],
        boundary: "on = \"outer\"",
        around: 1.0,
    }
}

/// Quadrilaterals whose inner nodes are moved by up to a fifth of a side.
pub(crate) fn jittered(cells: usize) -> Family {
    let inner = |x: f64| x > 0.5 && x < cells as f64 - 0.5;
    plane("jittered", cells, |x, y| {
        let by = |a: f64, b: f64| match inner(x) && inner(y) {
            true => 0.2 * noise(a, b),
            false => 0.0,
        };
        [x + by(x, y), y + by(y + 3.0, x)]
    })
}

/// Depth of a notch with straight faces at 45° in the middle of the lower side of a body.
fn notch(x: f64, middle: f64) -> f64 {
    (4.0 - (x - middle).abs()).max(0.0)
}

/// Quadrilaterals of a square with a notch in its left side.
pub(crate) fn notched_plate(cells: usize) -> Family {
    let top = cells as f64;
    plane("notched plate", cells, |x, y| {
        let low = notch(y, 0.5 * top);
        [low + x / top * (top - low), y]
    })
}

/// Tetrahedra of a block with a notch in its lower side.
pub(crate) fn notched_block() -> Family {
    solid("notched block", Split::Tets, 12, |[x, y, z]| {
        let low = notch(x, 7.5);
        [x, low + y / 15.0 * (15.0 - low), z]
    })
}

/// Tetrahedra between surfaces that are bent.
pub(crate) fn lug(cells: usize) -> Family {
    solid("tets of a lug", Split::Tets, cells, |[x, y, z]| {
        let a = 0.05 * (x - 5.0);
        [x + 0.3 * (0.5 * y).sin(), y + 5.0 * a * a, z]
    })
}

/// Hexahedra of a bar in the shape of an arc.
pub(crate) fn bent_bar(cells: usize) -> Family {
    solid("hexes of a bent bar", Split::Hexes, cells, |[x, y, z]| {
        let (r, a) = (12.0 + y, 0.06 * (x - 5.0));
        [r * a.sin() + 5.0, r * a.cos() - 12.0, z]
    })
}

/// A number in [−1, 1) for a node.
fn noise(x: f64, y: f64) -> f64 {
    let s = (12.9898 * x + 78.233 * y).sin() * 43758.5453;
    2.0 * (s - s.floor()) - 1.0
}

/// The families of meshes.
pub(crate) fn families() -> Vec<Family> {
    vec![
        plane("matching", 12, |x, y| [x, y]),
        plane("coarser", 12, |x, y| [1.3 * x - 1.8, 1.3 * y - 1.8]),
        plane("graded", 12, |x, y| {
            let grade = |t: f64| t + 0.02 * t * (t - 12.0);
            [grade(x), grade(y)]
        }),
        jittered(12),
        Family {
            name: "Delaunay triangles",
            kinematics: "plane-stress",
            mesh: include_str!("../../../../meshes/graded_triangles.msh").to_owned(),
            size: 1.0,
            file: "m.msh",
            extent: [[0.0; 3], [20.0, 20.0, 0.0]],
            place: |x| x,
            zone: [[8.0, 8.0, 0.0], [12.0, 12.0, 0.0]],
            boundary: "inside = { without = { from = { everywhere = true }, removed = { box = { min = [0.01, 0.01], max = [19.99, 19.99] } } } }",
            around: 3.0,
        },
        plane("polar", 12, |x, y| {
            let (r, a) = (6.0 + x, 0.09 * (y - 6.0));
            [r * a.cos() - 6.0, r * a.sin() + 6.0]
        }),
        lug(8),
        bent_bar(8),
    ]
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Split {
    Hexes,
    Tets,
}

/// Cells of a block with sides of 1.25, `cells` along each side, moved by `place`.
fn solid(
    name: &'static str,
    split: Split,
    cells: usize,
    place: fn([f64; 3]) -> [f64; 3],
) -> Family {
    let n = cells + 1;
    let step = 1.25;
    let nodes = (0..n * n * n).map(|k| {
        let at = |i: usize| step * i as f64;
        place([at(k % n), at(k / n % n), at(k / n / n)])
    });
    let list = (0..cells * cells * cells).flat_map(|c| {
        let (i, j, k) = (c % cells, c / cells % cells, c / cells / cells);
        let at = |a: usize, b: usize, d: usize| i + a + (j + b) * n + (k + d) * n * n;
        let hex = vec![
            at(0, 0, 0),
            at(1, 0, 0),
            at(1, 1, 0),
            at(0, 1, 0),
            at(0, 0, 1),
            at(1, 0, 1),
            at(1, 1, 1),
            at(0, 1, 1),
        ];
        match split {
            Split::Hexes => vec![hex],
            // six around the diagonal from corner 0 to corner 6
            Split::Tets => [[1, 2], [2, 3], [3, 7], [7, 4], [4, 5], [5, 1]]
                .map(|[a, b]| vec![hex[0], hex[a], hex[b], hex[6]])
                .to_vec(),
        }
    });
    Family {
        name,
        kinematics: "solid",
        mesh: gmsh(nodes.collect(), &list.collect::<Vec<_>>()),
        size: step,
        file: "m.msh",
        extent: [[0.0; 3], [step * cells as f64; 3]],
        place,
        zone: [[3.5, 3.5, 3.5], [6.5, 6.5, 6.5]],
        boundary: "on = \"outer\"",
        around: step,
    }
}

/// The text of a file of cells of one shape, with its boundary as the set `outer`.
fn gmsh(nodes: Vec<[f64; 3]>, cells: &[Vec<usize>]) -> String {
    // four nodes make a quadrilateral or a tetrahedron
    let is_plane = nodes.iter().all(|x| x[2] == 0.0);
    let (kind, facet_kind, shape) = match (cells[0].len(), is_plane) {
        (4, true) => (gmsh::QUADRILATERAL, gmsh::LINE, CellShape::Quad4),
        (4, false) => (gmsh::TETRAHEDRON, gmsh::TRIANGLE, CellShape::Tet4),
        _ => (gmsh::HEXAHEDRON, gmsh::QUADRILATERAL, CellShape::Hex8),
    };
    let mut seen: BTreeMap<Vec<usize>, (Vec<usize>, usize)> = BTreeMap::new();
    for cell in cells {
        for facet in shape.facets() {
            let list: Vec<usize> = facet.iter().map(|&a| cell[a]).collect();
            let mut key = list.clone();
            key.sort_unstable();
            seen.entry(key).or_insert((list, 0)).1 += 1;
        }
    }
    let outer = seen.into_values().filter(|(_, times)| *times == 1);
    let outer = outer.map(|(list, _)| (facet_kind, 2, list));
    let inner = cells.iter().map(|cell| (kind, 1, cell.clone()));
    let elements: Vec<gmsh::Element> = outer.chain(inner).collect();
    let dimension = shape.dimension();
    let sets = [(dimension - 1, 2, "outer"), (dimension, 1, "body")];
    gmsh::text(&sets, &nodes, &elements)
}

/// Couplings by what a scene types, and whether they have a transition zone.
pub(crate) const COUPLINGS: [(&str, &str, bool); 6] = [
    ("truncated", "[coupling.truncated]", false),
    ("splice", "[coupling.splice]", false),
    ("balanced", "[coupling.balanced]", false),
    ("blending", "[coupling.blending]", true),
    (
        "partial stress, points",
        "[coupling.partial-stress]\nform = \"meshfree\"",
        true,
    ),
    (
        "partial stress, elements",
        "[coupling.partial-stress]",
        true,
    ),
];

/// Laws: at the pairwise Poisson ratio, above and below it.
const LAWS: [(&str, &str); 3] = [
    ("bond-based", "bond-based]\nyoungs-modulus = 7"),
    ("LPS, 0.4", "lps]\nyoungs-modulus = 7\npoisson-ratio = 0.4"),
    ("LPS, 0.2", "lps]\nyoungs-modulus = 7\npoisson-ratio = 0.2"),
];

/// The field as components of a condition.
pub(crate) fn field_text(dimensions: usize) -> String {
    let axes = ["x", "y", "z"];
    let component = |i: usize| {
        let terms = (0..dimensions).map(|j| format!("({:e})*{}", GRADIENT[i][j], axes[j]));
        let terms: Vec<String> = terms.collect();
        format!("{} = \"{}\"\n", axes[i], terms.join(" + "))
    };
    (0..dimensions).map(component).collect()
}

/// The displacement of the field at a place.
pub(crate) fn field(position: &[f64]) -> Vec<f64> {
    let d = position.len();
    let component = |i: usize| (0..d).map(|j| GRADIENT[i][j] * position[j]).sum();
    (0..d).map(component).collect()
}

/// The largest error of a displacement in the field, over the largest one.
pub(crate) fn error(sites: &[scene::Site]) -> f64 {
    let (mut error, mut largest) = (0.0f64, 0.0f64);
    for site in sites {
        for (u, exact) in site.displacement.iter().zip(field(&site.position)) {
            error = error.max((u - exact).abs());
            largest = largest.max(exact.abs());
        }
    }
    error / largest
}

/// The scene of one case.
fn text(
    family: &Family,
    law: &str,
    coupling: &str,
    has_transition: bool,
    per_element: f64,
) -> String {
    let dimensions = if family.kinematics == "solid" { 3 } else { 2 };
    let list = |x: &[f64; 3]| format!("{:?}", &x[..dimensions]);
    let h = family.size / per_element;
    let [low, high] = &family.zone;
    let transition = if has_transition {
        format!("[zones.transition]\naround = {}\n", family.around)
    } else {
        String::new()
    };
    let held = format!(
        "[conditions.all.displacement]\n{}\n{}",
        family.boundary,
        field_text(dimensions)
    );
    format!(
        "kinematics = \"{}\"\n[mesh.file]\npath = \"m.msh\"\n[materials.m.{law}\n[peridynamics]\nhorizon = {}\npoints.lattice = {{ spacing = {h} }}\n[zones.nonlocal]\nbox = {{ min = {}, max = {} }}\n{transition}{coupling}\n{held}[solver]\ntolerance = 1e-12\n",
        family.kinematics,
        3.0 * h,
        list(low),
        list(high),
    )
}

/// One case: its error, or why it is refused.
fn row(
    family: &Family,
    law: (&str, &str),
    coupling: (&str, &str, bool),
    per_element: f64,
) -> TableRow {
    let name = format!(
        "{}, {}, {}, {per_element} h",
        family.name, coupling.0, law.0
    );
    let text = text(family, law.1, coupling.1, coupling.2, per_element);
    // multigrid ends without a solution, far later than factors give one
    let is_slow = family.name.starts_with("tet10") && coupling.0 == "partial stress, points";
    let solver: &[&str] = if is_slow {
        &["solver.method=direct"]
    } else {
        &[]
    };
    match scene::solve(&text, solver, &[("m.msh", &family.mesh)]) {
        Ok((summary, sites)) => {
            let error = error(&sites);
            let warned = summary
                .warnings
                .iter()
                .find(|w| w.message.contains("uniform stress"));
            match warned {
                Some(why) if error > LIMIT => TableRow::warned(&name, "error", error, &why.message),
                _ => TableRow::at_most(&name, "error", error, LIMIT),
            }
        }
        Err(why) => TableRow::refused(&name, "error", why),
    }
}

/// The table of affine fields beside cells of second order, which become linear at the seam: one family for each cell, every coupling.
pub fn of_second_order(effort: Effort, progress: &dyn Progress) -> Table {
    let mut table = Table::new(
        "Cells of second order, affine displacements on the whole boundary of scenes, m = 3: largest error over the largest displacement, or the reason of the refusal",
        Columns::ByQuantity,
    );
    let mut cases = Vec::new();
    for mut family in families() {
        let name = match family.name {
            "Delaunay triangles" => "tri6, Delaunay",
            "jittered" => "quad8, jittered",
            "tets of a lug" => "tet10, lug",
            "hexes of a bent bar" => "hex20, bent bar",
            _ => continue,
        };
        let raised = match family.kinematics {
            "solid" => gmsh::raised::<3>(&family.mesh, |_| ()),
            _ => gmsh::raised::<2>(&family.mesh, |_| ()),
        };
        family.name = name;
        match raised {
            Ok(mesh) => family.mesh = mesh,
            Err(why) => table.push(TableRow::refused(name, "mesh", why)),
        }
        let laws = if effort == Effort::Full { 3 } else { 1 };
        for coupling in COUPLINGS {
            for law in &LAWS[..laws] {
                cases.push((family.clone(), *law, coupling));
            }
        }
    }
    progress.stage("affine fields", Some(cases.len() as u64));
    let rows: Vec<TableRow> = cases
        .into_par_iter()
        .map(|(family, law, coupling)| {
            let row = row(&family, law, coupling, 2.0);
            progress.advance(1);
            row
        })
        .collect();
    rows.into_iter().for_each(|row| table.push(row));
    table
}

/// The table of affine fields.
pub fn tables(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let families = families();
    let mut cases = Vec::new();
    for family in &families {
        for (k, coupling) in COUPLINGS.iter().enumerate() {
            for (l, law) in LAWS.iter().enumerate() {
                for per_element in [2.0, 2.5, 4.0] {
                    let is_solid = family.kinematics == "solid";
                    let wanted = match effort {
                        Effort::Quick => {
                            per_element == 2.0
                                && (k < 2 || l == 0)
                                && (!is_solid || (k < 2 && l == 0))
                        }
                        Effort::Full => !is_solid || per_element == 2.0,
                    };
                    if wanted {
                        cases.push((family, *law, *coupling, per_element));
                    }
                }
            }
        }
    }
    progress.stage("affine fields", Some(cases.len() as u64));
    let rows: Vec<TableRow> = cases
        .into_par_iter()
        .map(|(family, law, coupling, per_element)| {
            let row = row(family, law, coupling, per_element);
            progress.advance(1);
            row
        })
        .collect();
    let mut table = Table::new(
        "Affine displacements on the whole boundary of scenes, m = 3: largest error over the largest displacement, or the reason of the refusal",
        Columns::ByQuantity,
    );
    rows.into_iter().for_each(|row| table.push(row));
    vec![table]
}
