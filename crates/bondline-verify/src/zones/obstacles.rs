//! Zones that are drawn across notches, holes, corners, loads, supports and interfaces.

use rayon::prelude::*;

use super::draw::Draw;
use crate::{
    Effort,
    meshes::{
        affine::{Family, notched_block, notched_plate},
        gmsh,
        loads::{LOAD_LIMIT, worst},
        scene,
    },
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

/// The seed of all that is drawn.
const SEED: u64 = 587;

/// Largest difference of a displacement from that of elements alone, over the largest one.
const LIMIT: f64 = 0.02;

pub(crate) const LAWS: [(&str, &str); 4] = [
    ("bond-based", "bond-based = { "),
    ("LPS .2", "lps = { poisson-ratio = 0.2, "),
    ("LPS .3", "lps = { poisson-ratio = 0.3, "),
    ("LPS .4", "lps = { poisson-ratio = 0.4, "),
];

/// A body with its supports and loads.
pub(crate) struct Body {
    pub name: &'static str,
    pub family: Family,
    /// Its conditions, with [`FACTOR`] where a load may grow.
    pub conditions: &'static str,
    /// Cells of a second material, as they are typed.
    pub inclusion: Option<&'static str>,
    /// Place in the plane of x and y of a sharp root, at which stresses are not bounded.
    pub root: Option<[f64; 2]>,
}

/// Place of the factor of a load.
pub(crate) const FACTOR: &str = "{f}";

const PULLED: &str =
    "left.displacement = { inside.box = { min = [-1, -1], max = [25, 0.01] }, x = 0, y = 0 }
right.displacement = { inside.box = { min = [-1, 23.99], max = [25, 25] }, y = '0.02{f}' }
weight.body-force = { x = '1e-4{f}' }";

const BENT: &str = "left.displacement = { inside.box = { min = [-1, -1, -1], max = [0.01, 20, 20] }, x = 0, y = 0, z = 0 }
right.displacement = { inside.box = { min = [14.99, -1, -1], max = [20, 20, 20] }, y = '0.02{f}' }
weight.body-force = { z = '1e-4{f}' }";

/// The text of a mesh of the repository.
macro_rules! mesh {
    ($name:literal) => {
        include_str!(concat!("../../../../meshes/", $name)).to_owned()
    };
}

/// The bodies; those in space in full.
pub(crate) fn bodies(effort: Effort) -> Vec<Body> {
    let file = |name, kinematics, mesh, size| Family {
        name,
        kinematics,
        file: "m.msh",
        mesh,
        size,
        extent: [[0.0; 3]; 2],
        place: |x| x,
        zone: [[0.0; 3]; 2],
        boundary: "",
        around: 0.0,
    };
    let mut list = vec![
        Body {
            name: "lug with a hole",
            family: file("lug", "plane-stress", mesh!("lug.msh"), 0.06),
            conditions: "fixed.displacement = { on = \"fixed\", x = 0, y = 0 }
pin.traction = { on = \"loaded\", x = '1e-3{f}', y = '3e-4{f}' }
weight.body-force = { y = '-1e-4{f}' }",
            inclusion: None,
            root: None,
        },
        Body {
            name: "quarter ring",
            family: file("ring", "plane-strain", mesh!("quarter_ring.msh"), 0.09),
            conditions: "bottom.displacement = { on = \"bottom\", y = 0 }
left.displacement = { on = \"left\", x = 0 }
bore.pressure = { on = \"bore\", value = '1e-3{f}' }",
            inclusion: None,
            root: None,
        },
        Body {
            name: "notched plate",
            family: notched_plate(24),
            conditions: PULLED,
            inclusion: None,
            root: Some([4.0, 12.0]),
        },
        Body {
            name: "two materials",
            family: notched_plate(24),
            conditions: PULLED,
            inclusion: Some("box = { min = [-1, 14.5], max = [25, 25] }"),
            root: Some([4.0, 12.0]),
        },
    ];
    if effort == Effort::Full {
        list.push(Body {
            name: "bar of tetrahedra",
            family: file("bar", "solid", mesh!("bar_tets.msh"), 0.33),
            conditions: "start.displacement = { on = \"start\", x = 0, y = 0, z = 0 }
end.traction = { on = \"end\", x = '1e-3{f}', y = '2e-4{f}' }
weight.body-force = { z = '1e-4{f}' }",
            inclusion: None,
            root: None,
        });
        list.push(Body {
            name: "notched block",
            family: notched_block(),
            conditions: BENT,
            inclusion: None,
            root: Some([7.5, 4.0]),
        });
    }
    // linear cells are too coarse a truth where they bend
    for body in list.iter_mut().filter(|body| body.family.size > 0.1) {
        let mesh = match body.family.kinematics {
            "solid" => gmsh::raised::<3>(&body.family.mesh, |_| ()),
            _ => gmsh::raised::<2>(&body.family.mesh, |_| ()),
        };
        body.family.mesh = mesh.unwrap_or_default();
    }
    list
}

/// A scene that was drawn.
struct Case {
    body: usize,
    name: String,
    text: String,
}

/// A scene of a body, with further lines; its loads times `factor`.
pub(crate) fn text(body: &Body, law: &str, more: &str, factor: &str) -> String {
    let material = |name: &str, modulus: f64, cells: &str| {
        format!("materials.{name}.{law}youngs-modulus = {modulus}, density = 2{cells} }}\n")
    };
    let mut materials = material("m", 7.0, "");
    if let Some(cells) = body.inclusion {
        materials += &material("n", 14.0, &format!(", cells.{cells}"));
    }
    format!(
        "kinematics = \"{}\"\nmesh.file.path = \"m.msh\"\n{materials}{more}[conditions]\n{}\n",
        body.family.kinematics,
        body.conditions.replace(FACTOR, factor),
    )
}

fn drawn<const D: usize>(
    draw: &mut Draw,
    (number, body): (usize, &Body),
    nodes: &[[f64; 3]],
    k: usize,
) -> Case {
    let law = draw.one(&LAWS);
    let spacing = body.family.size * draw.within(0.5, 1.0);
    let middle = &draw.one(nodes)[..D];
    let origin: Vec<f64> = (0..D).map(|_| spacing * draw.within(0.0, 1.0)).collect();
    let radius = spacing * draw.within(3.0, if D == 3 { 4.0 } else { 6.0 });
    let zone = draw.ball_or_box(middle, radius);
    let more = format!(
        "peridynamics = {{ horizon = {}, points.lattice = {{ spacing = {spacing}, origin = {origin:?} }} }}\nzones.nonlocal.{zone}\n",
        3.0 * spacing,
    );
    Case {
        body: number,
        name: format!("{}, {}, number {k}", body.name, law.0),
        text: text(body, law.1, &more, ""),
    }
}

/// Figures of a scene.
struct Found {
    /// Largest difference of masses, loads and first moments from integrals over the mesh.
    loads: f64,
    /// True if a rim of its own lies around the zone, and elements between all points and the surface.
    is_enclosed: bool,
    /// Largest difference of the displacement from that of elements alone, over the largest one.
    beside_elements: f64,
    /// The same of points without a skin from points alone on the lattice.
    beside_points: Result<f64, String>,
}

/// Largest difference of two lists of displacements over the largest one.
fn apart(a: &[Option<[f64; 3]>], b: &[Option<[f64; 3]>]) -> f64 {
    let (mut error, mut largest) = (0.0f64, 0.0f64);
    for (a, b) in a.iter().zip(b) {
        let (Some(a), Some(b)) = (a, b) else { continue };
        for (a, b) in a.iter().zip(b) {
            error = error.max((a - b).abs());
            largest = largest.max(b.abs());
        }
    }
    error / largest
}

fn found(case: &Case, body: &Body) -> Result<Found, String> {
    let files = &[(body.family.file, body.family.mesh.as_str())];
    let checked = scene::check(&case.text, &[], files)?;
    // every site needs a mass in time
    scene::check(&case.text, &["solve.explicit.duration=1"], files)?;
    let has_rim = checked
        .choices
        .iter()
        .any(|c| c.choice.starts_with("a rim of"));
    let is_enclosed = has_rim && checked.proof.largest("rows out of balance") == 0.0;
    let mut places = Vec::new();
    let elements = scene::samples(&case.text, &["coupling=local"], files, &mut places)?;
    let of = |overrides: &[&str], places: &mut Vec<[f64; 3]>| {
        let found = scene::samples(&case.text, overrides, files, places)?;
        Ok::<_, String>(found.displacement)
    };
    let coupled = of(&[], &mut places)?;
    let bare = of(&["zones.skin=none"], &mut places);
    let points = of(&["coupling=nonlocal"], &mut places);
    Ok(Found {
        loads: worst(&checked.proof.parts),
        is_enclosed,
        beside_elements: apart(&coupled, &elements.displacement),
        beside_points: bare.and_then(|bare| Ok(apart(&bare, &points?))),
    })
}

/// Positions of the nodes of a body.
pub(crate) fn nodes(body: &Body) -> Result<Vec<[f64; 3]>, String> {
    let mut places = Vec::new();
    let files = &[(body.family.file, body.family.mesh.as_str())];
    let text = text(body, LAWS[0].1, "coupling = \"local\"\n", "");
    scene::samples(&text, &[], files, &mut places)?;
    Ok(places)
}

/// The table.
pub(super) fn tables(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let each = if effort == Effort::Full { 10 } else { 3 };
    let mut table = Table::new(
        format!(
            "Zones drawn by seed {SEED} across notches, holes, corners, loads, supports and interfaces"
        ),
        Columns::ByQuantity,
    );
    let bodies = bodies(effort);
    let mut cases = Vec::new();
    for (number, body) in bodies.iter().enumerate() {
        let mut draw = Draw::new(SEED + number as u64);
        match nodes(body) {
            Err(why) => table.push(TableRow::refused(body.name, "elements alone", why)),
            Ok(nodes) => cases.extend((0..each).map(|k| match body.family.kinematics {
                "solid" => drawn::<3>(&mut draw, (number, body), &nodes, k),
                _ => drawn::<2>(&mut draw, (number, body), &nodes, k),
            })),
        }
    }
    progress.stage("obstacles", Some(cases.len() as u64));
    let all: Vec<Result<Found, String>> = (cases.par_iter())
        .map(|case| {
            let found = found(case, &bodies[case.body]);
            progress.advance(1);
            found
        })
        .collect();
    for (case, found) in cases.iter().zip(all) {
        let name = case.name.as_str();
        match found {
            Err(why) => table.push(TableRow::refused(name, "loads and masses", why)),
            Ok(found) => {
                table.push(TableRow::at_most(
                    name,
                    "loads and masses",
                    found.loads,
                    LOAD_LIMIT,
                ));
                let value = found.beside_elements;
                table.push(match found.is_enclosed {
                    true => TableRow::at_most(name, "rim and skin, beside elements", value, LIMIT),
                    false => TableRow::info(name, "else, beside elements", value),
                });
                // no point lies on a line that is held
                if let Ok(value) = found.beside_points {
                    table.push(TableRow::info(name, "no skin, beside points", value));
                }
            }
        }
    }
    vec![table]
}
