//! Order of convergence to classical elasticity beside meshes that fit nothing: exact solutions, a zone fixed in space, δ and elements halved together.
//!
//! | problem | mesh | exact solution |
//! |---|---|---|
//! | cantilever | squares, lattice between the nodes | Timoshenko: a cubic |
//! | thick ring | polar, a quarter | Lamé: `u = A r + B/r` |
//! | hole in a plate | polar, cells that widen outwards; the zone is a ring, elements line the hole | Kirsch |
//! | thick sphere | an octant of three blocks of hexahedra that meet in the zone | Lamé: `u = A r + B/r²` |
//!
//! m = 3, isotropic weights. The zone is enclosed by elements, farther than families reach. The error is that of all sites in the L2 norm, each with its volume, over the norm of the exact field.

use std::fmt::Write as _;

use rayon::prelude::*;

use super::{gmsh, scene};
use crate::Effort;
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};

/// Least order over the last two meshes in the plane.
pub const ORDER_LIMIT: f64 = 1.8;

/// The same in space, unless the error is at most that of elements alone.
pub const ORDER_LIMIT_3D: f64 = 1.5;

/// Largest excess of an error on the second mesh over that of elements alone.
pub const BEYOND_LIMIT: f64 = 0.02;

/// A displacement field, all of three components.
type Exact = fn(&[f64; 3]) -> [f64; 3];

/// A problem with its exact solution.
struct Problem {
    name: &'static str,
    kinematics: &'static str,
    /// Poisson's ratio, that of bonds that act alone.
    pairwise: bool,
    ratio: f64,
    /// Elements per length of the coarsest mesh.
    coarsest: usize,
    /// Elements per length to the mesh: a table of the scene, and the text of a file that it names.
    mesh: fn(usize) -> (String, Option<String>),
    /// The zone, and the core that is nonlocal where there is a transition zone.
    zone: &'static str,
    core: &'static str,
    conditions: &'static str,
    exact: Exact,
}

const YOUNGS_MODULUS: f64 = 1.0;

const PROBLEMS: &[Problem] = &[
    Problem {
        name: "cantilever",
        kinematics: "plane-stress",
        pairwise: true,
        ratio: 1.0 / 3.0,
        coarsest: 10,
        mesh: |n| (rectangle(4, 2, n), None),
        zone: "box = { min = [1.5, -0.3], max = [2.5, 0.3] }",
        core: "box = { min = [1.75, -0.1], max = [2.25, 0.1] }",
        conditions: CANTILEVER,
        exact: cantilever,
    },
    Problem {
        name: "thick ring",
        kinematics: "plane-stress",
        pairwise: false,
        ratio: 0.4,
        coarsest: 10,
        mesh: |n| file(polar(n, [1.0, 3.0], Turn::Quarter)),
        zone: "ball = { center = [1.4142, 1.4142], radius = 0.35 }",
        core: "ball = { center = [1.4142, 1.4142], radius = 0.15 }",
        conditions: RING,
        exact: ring,
    },
    Problem {
        name: "hole in a plate",
        kinematics: "plane-stress",
        pairwise: false,
        ratio: 0.3,
        coarsest: 8,
        mesh: |n| file(polar(n, [1.0, 3.5], Turn::Whole)),
        zone: "without = { from = { ball = { center = [0, 0], radius = 2.5 } }, removed = { ball = { center = [0, 0], radius = 1.9 } } }",
        core: "without = { from = { ball = { center = [0, 0], radius = 2.3 } }, removed = { ball = { center = [0, 0], radius = 2.1 } } }",
        conditions: PLATE,
        exact: plate,
    },
    Problem {
        name: "thick sphere",
        kinematics: "solid",
        pairwise: true,
        ratio: 0.25,
        coarsest: 3,
        mesh: |n| file(octant(n, [1.0, 3.0])),
        zone: "ball = { center = [1.1547, 1.1547, 1.1547], radius = 0.35 }",
        core: "ball = { center = [1.1547, 1.1547, 1.1547], radius = 0.2 }",
        conditions: SPHERE,
        exact: sphere,
    },
];

/// Timoshenko's cantilever of length 4, depth 2 and I = 2/3 under an end load of 1e-3, ν = 1/3: displaced at its root, pulled at its end.
const CANTILEVER: &str = r#"
[conditions.root.displacement]
on = "left"
x = "-1e-3*y/4*(7/3*(y^2-1))"
y = "1e-3/4*(4*y^2)"
[conditions.end.traction]
on = "right"
y = "1e-3*0.75*(1-y^2)"
"#;

fn cantilever(&[x, y, _]: &[f64; 3]) -> [f64; 3] {
    let (load, length, nu) = (1e-3, 4.0, 1.0 / 3.0);
    let scale = load / (6.0 * YOUNGS_MODULUS * (2.0 / 3.0));
    [
        -scale * y * ((6.0 * length - 3.0 * x) * x + (2.0 + nu) * (y * y - 1.0)),
        scale
            * (3.0 * nu * y * y * (length - x) + (4.0 + 5.0 * nu) * x + (3.0 * length - x) * x * x),
        0.0,
    ]
}

/// `u_r = 1e-3 (r + 2/r)` displaces all but the hole, whose pressure is `E/(1−ν²) ((1+ν) A − (1−ν) B/r²)` at r = 1, ν = 0.4.
const RING: &str = r#"
[conditions.held.displacement]
on = "held"
x = "1e-3*x*(1+2/(x^2+y^2))"
y = "1e-3*y*(1+2/(x^2+y^2))"
[conditions.inner.traction]
on = "inner"
x = "-1e-3/0.84*(1.4-0.6*2)*x"
y = "-1e-3/0.84*(1.4-0.6*2)*y"
"#;

fn ring(&[x, y, _]: &[f64; 3]) -> [f64; 3] {
    let scale = 1e-3 * (1.0 + 2.0 / (x * x + y * y));
    [scale * x, scale * y, 0.0]
}

/// Kirsch's plate under a tension of 1e-3 along x, hole of radius 1, ν = 0.3 (κ = 2.7/1.3); displaced along its outer circle.
const PLATE: &str = r#"
[conditions.held.displacement]
on = "held"
x = "1e-3*1.3/4*(x*(2.7/1.3+1)+2/(x^2+y^2)*((1+2.7/1.3)*x+(4*x^3/(x^2+y^2)-3*x))-2/(x^2+y^2)^2*(4*x^3/(x^2+y^2)-3*x))"
y = "1e-3*1.3/4*(y*(2.7/1.3-3)+2/(x^2+y^2)*((1-2.7/1.3)*y+(3*y-4*y^3/(x^2+y^2)))-2/(x^2+y^2)^2*(3*y-4*y^3/(x^2+y^2)))"
"#;

fn plate(&[x, y, _]: &[f64; 3]) -> [f64; 3] {
    // σ a/(8 G) {…}, G = E/(2 (1 + ν)), with the angle of the point
    let (r, angle) = (x.hypot(y), y.atan2(x));
    let kappa = (3.0 - 0.3) / 1.3;
    let scale = 1e-3 / (8.0 * YOUNGS_MODULUS / 2.6);
    let (c, s) = (angle.cos(), angle.sin());
    let (c3, s3) = ((3.0 * angle).cos(), (3.0 * angle).sin());
    [
        scale * (r * (kappa + 1.0) * c + 2.0 / r * ((1.0 + kappa) * c + c3) - 2.0 / r.powi(3) * c3),
        scale * (r * (kappa - 3.0) * s + 2.0 / r * ((1.0 - kappa) * s + s3) - 2.0 / r.powi(3) * s3),
        0.0,
    ]
}

/// `u_r = 1e-3 (r + 2/r²)`; λ = μ = 0.4, so that the hollow's surface is pushed by `(3λ + 2μ) A − 4 μ B = −1.2e-3`.
const SPHERE: &str = r#"
[conditions.held.displacement]
on = "held"
x = "1e-3*x*(1+2/(x^2+y^2+z^2)^1.5)"
y = "1e-3*y*(1+2/(x^2+y^2+z^2)^1.5)"
z = "1e-3*z*(1+2/(x^2+y^2+z^2)^1.5)"
[conditions.inner.traction]
on = "inner"
x = "1.2e-3*x"
y = "1.2e-3*y"
z = "1.2e-3*z"
"#;

fn sphere(x: &[f64; 3]) -> [f64; 3] {
    let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    x.map(|x| 1e-3 * x * (1.0 + 2.0 / r.powi(3)))
}

fn rectangle(length: usize, depth: usize, n: usize) -> String {
    let half = depth as f64 / 2.0;
    format!(
        "[mesh.rectangle]\nmin = [0, {}]\nmax = [{length}, {half}]\nx = {{ cells = {} }}\ny = {{ cells = {} }}\n",
        -half,
        length * n,
        depth * n
    )
}

fn file(text: String) -> (String, Option<String>) {
    (format!("[mesh.file]\npath = \"{MESH_FILE}\"\n"), Some(text))
}

const MESH_FILE: &str = "mesh.msh";

/// Angle that a polar mesh covers.
#[derive(Clone, Copy, PartialEq)]
enum Turn {
    Quarter,
    Whole,
}

/// A polar mesh in the format Gmsh 2.2, `n` cells per length along the radius and, in the middle, around: sets `inner` and `held`, all other sides.
fn polar(n: usize, [inner, outer]: [f64; 2], turn: Turn) -> String {
    let radial = ((outer - inner) * n as f64).round() as usize;
    let share = match turn {
        Turn::Quarter => 0.25,
        Turn::Whole => 1.0,
    };
    let angle = share * std::f64::consts::TAU;
    let around = (angle * 0.5 * (inner + outer) * n as f64).round() as usize;
    let columns = match turn {
        Turn::Quarter => around + 1,
        Turn::Whole => around,
    };
    let node = |i: usize, j: usize| i * columns + j % columns;
    let mut mesh = Polar::default();
    for i in 0..=radial {
        let r = inner + (outer - inner) * i as f64 / radial as f64;
        for j in 0..columns {
            let a = angle * j as f64 / around as f64;
            mesh.nodes.push([r * a.cos(), r * a.sin(), 0.0]);
        }
    }
    for i in 0..radial {
        for j in 0..around {
            let cell = [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ];
            mesh.cells.push((gmsh::QUADRILATERAL, BODY, cell.to_vec()));
        }
    }
    for j in 0..around {
        mesh.cells
            .push((gmsh::LINE, INNER, vec![node(0, j), node(0, j + 1)]));
        mesh.cells
            .push((gmsh::LINE, HELD, vec![node(radial, j), node(radial, j + 1)]));
    }
    if turn == Turn::Quarter {
        for i in 0..radial {
            for j in [0, around] {
                mesh.cells
                    .push((gmsh::LINE, HELD, vec![node(i, j), node(i + 1, j)]));
            }
        }
    }
    mesh.text(2)
}

/// An octant of a thick sphere: three blocks, one around each axis, that meet along (1, 1, 1).
pub(crate) fn octant(n: usize, [inner, outer]: [f64; 2]) -> String {
    let radial = ((outer - inner) * n as f64).round() as usize;
    let across = (std::f64::consts::FRAC_PI_8 * (inner + outer) * n as f64).round() as usize;
    let mut mesh = Polar::default();
    let mut known = std::collections::HashMap::new();
    let mut node = |mesh: &mut Polar, block: usize, k: [usize; 3]| {
        let slope = |i: usize| (std::f64::consts::FRAC_PI_4 * i as f64 / across as f64).tan();
        let mut x = [0.0; 3];
        x[block] = 1.0;
        x[(block + 1) % 3] = slope(k[0]);
        x[(block + 2) % 3] = slope(k[1]);
        let r = inner + (outer - inner) * k[2] as f64 / radial as f64;
        let scale = r / x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let x = x.map(|x| x * scale);
        *known
            .entry(x.map(|x| (x * 1e8).round() as i64))
            .or_insert_with(|| {
                mesh.nodes.push(x);
                mesh.nodes.len() - 1
            })
    };
    // a face of a cell as corners along its two directions, in order
    let around = [[0, 0], [1, 0], [1, 1], [0, 1]];
    for block in 0..3 {
        for i in 0..across {
            for j in 0..across {
                for k in 0..radial {
                    let mut corners = |level: usize| {
                        around.map(|[a, b]| node(&mut mesh, block, [i + a, j + b, k + level]))
                    };
                    let (low, high) = (corners(0), corners(1));
                    let cell: Vec<usize> = low.into_iter().chain(high).collect();
                    // the sides of the octant are where a block's first cells begin
                    if i == 0 {
                        let face = vec![cell[0], cell[3], cell[7], cell[4]];
                        mesh.cells.push((gmsh::QUADRILATERAL, HELD, face));
                    }
                    if j == 0 {
                        let face = vec![cell[0], cell[1], cell[5], cell[4]];
                        mesh.cells.push((gmsh::QUADRILATERAL, HELD, face));
                    }
                    if k == 0 {
                        mesh.cells.push((gmsh::QUADRILATERAL, INNER, low.to_vec()));
                    }
                    if k + 1 == radial {
                        mesh.cells.push((gmsh::QUADRILATERAL, HELD, high.to_vec()));
                    }
                    mesh.cells.push((gmsh::HEXAHEDRON, BODY, cell));
                }
            }
        }
    }
    mesh.text(3)
}

/// Numbers of sets in a file.
const BODY: usize = 1;
const INNER: usize = 2;
const HELD: usize = 3;

/// Nodes, and cells by kind, set and nodes.
#[derive(Default)]
struct Polar {
    nodes: Vec<[f64; 3]>,
    cells: Vec<gmsh::Element>,
}

impl Polar {
    fn text(&self, dimension: usize) -> String {
        let sets = [
            (dimension, BODY, "body"),
            (dimension - 1, INNER, "inner"),
            (dimension - 1, HELD, "held"),
        ];
        gmsh::text(&sets, &self.nodes, &self.cells)
    }
}

/// A coupling as a scene types it, and whether it needs a transition zone.
struct Method {
    name: &'static str,
    typed: &'static str,
    has_transition: bool,
    /// Points per element along an edge in the plane: elements that carry the partial stress of points between their nodes have to be wider than one spacing, and faces that bonds end on have to be two spacings wide.
    finer: usize,
    /// Reason why it is left out in space.
    dear: Option<&'static str>,
}

const METHODS: &[Method] = &[
    Method {
        name: "splice",
        typed: "coupling = \"splice\"",
        has_transition: false,
        finer: 1,
        dear: None,
    },
    Method {
        name: "balanced",
        typed: "coupling = \"balanced\"",
        has_transition: false,
        finer: 1,
        dear: None,
    },
    Method {
        name: "blending",
        typed: "coupling = \"blending\"",
        has_transition: true,
        finer: 1,
        dear: None,
    },
    Method {
        name: "partial stress, elements",
        typed: "coupling = \"partial-stress\"",
        has_transition: true,
        finer: 2,
        dear: None,
    },
    Method {
        name: "partial stress, meshfree",
        typed: "coupling = { partial-stress = { form = \"meshfree\" } }",
        has_transition: true,
        finer: 1,
        dear: Some("left out: its second mesh took two minutes where no other coupling took one"),
    },
    Method {
        name: "truncated",
        typed: "coupling = \"truncated\"",
        has_transition: false,
        finer: 2,
        dear: None,
    },
];

/// The scene of a problem on a mesh of `n` elements per length.
fn text(problem: &Problem, method: Option<&Method>, n: usize, table: &str) -> String {
    // in space elements of three spacings, or families would not fit beside the zone on a mesh that can be paid for
    let finer = match (method, problem.kinematics) {
        (Some(_), "solid") => 3,
        (Some(method), _) => method.finer,
        (None, _) => 1,
    };
    let spacing = 1.0 / (n * finer) as f64;
    let law = match problem.pairwise {
        true => "bond-based = { youngs-modulus = 1 }".to_owned(),
        false => format!(
            "lps = {{ youngs-modulus = 1, poisson-ratio = {} }}",
            problem.ratio
        ),
    };
    let typed = method.map_or("coupling = \"local\"", |m| m.typed);
    let mut text = format!(
        "kinematics = \"{}\"\n{typed}\nmaterials.m.{law}\noutput = {{ vtu = false }}\nsolver = {{ tolerance = 1e-10 }}\n{table}",
        problem.kinematics
    );
    let between = vec![0.5 * spacing; if problem.kinematics == "solid" { 3 } else { 2 }];
    if let Some(method) = method {
        let _ = write!(
            text,
            "[peridynamics]\nhorizon = {}\npoints.lattice = {{ spacing = {spacing}, origin = {between:?} }}\n[zones]\n",
            3.0 * spacing
        );
        let _ = match method.has_transition {
            true => writeln!(
                text,
                "nonlocal.{}\ntransition.{}",
                problem.core, problem.zone
            ),
            false => writeln!(text, "nonlocal.{}", problem.zone),
        };
    }
    text.push_str(problem.conditions);
    text
}

/// The relative L2 error of a scene: of all sites, each with its volume.
fn error(text: &str, mesh: Option<&str>, exact: Exact) -> Result<f64, String> {
    let files: Vec<(&str, &str)> = mesh.into_iter().map(|m| (MESH_FILE, m)).collect();
    let (_, sites) = scene::solve(text, &[], &files)?;
    let (mut error, mut size) = (0.0, 0.0);
    for site in &sites {
        let mut x = [0.0; 3];
        x[..site.position.len()].copy_from_slice(&site.position);
        for (u, w) in site.displacement.iter().zip(exact(&x)) {
            error += site.volume * (u - w) * (u - w);
            size += site.volume * w * w;
        }
    }
    Ok((error / size).sqrt())
}

/// Errors of all couplings on a sequence of meshes, with their orders: a table per problem.
pub fn order(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let of = |problem: &Problem| {
        progress.stage(problem.name, None);
        let title = format!(
            "Order beside meshes that fit nothing, {}: m = 3, δ and elements halved together, the zone fixed and enclosed; L2 error of the displacement against classical elasticity",
            problem.name
        );
        let mut table = Table::new(title, Columns::Full);
        match measured(problem, effort) {
            Ok(rows) => table.rows.extend(rows),
            Err(why) => table.push(TableRow::info(problem.name, "error", f64::NAN).because(why)),
        }
        super::tell(&table, effort, progress);
        table
    };
    PROBLEMS
        .iter()
        // the others take minutes
        .filter(|problem| effort == Effort::Full || problem.name == "cantilever")
        .map(of)
        .collect()
}

/// A mesh of some elements per length: its table in the scene, and the text of the file that it names.
type Typed = (usize, String, Option<String>);

fn measured(problem: &Problem, effort: Effort) -> Result<Vec<TableRow>, String> {
    let is_solid = problem.kinematics == "solid";
    let meshes = match (effort, is_solid) {
        (Effort::Quick, _) => 2,
        (Effort::Full, true) => 3,
        (Effort::Full, false) => 4,
    };
    let typed: Vec<Typed> = (0..meshes)
        .map(|k| {
            let n = problem.coarsest << k;
            let (table, file) = (problem.mesh)(n);
            (n, table, file)
        })
        .collect();
    let error_of = |method: Option<&Method>| -> Vec<Result<f64, String>> {
        let run = |(n, table, file): &Typed| {
            let text = text(problem, method, *n, table);
            error(&text, file.as_deref(), problem.exact)
        };
        typed.iter().map(run).collect()
    };
    let of_elements: Vec<f64> = error_of(None).into_iter().collect::<Result<_, _>>()?;
    let rows: Vec<Vec<TableRow>> = METHODS
        .par_iter()
        .map(|method| {
            let case = format!("{}, {}", problem.name, method.name);
            match method.dear {
                Some(why) if is_solid => {
                    vec![TableRow::refused(case, "order", why)]
                }
                _ => judged(
                    &case,
                    &error_of(Some(method)),
                    &of_elements,
                    effort,
                    is_solid,
                ),
            }
        })
        .collect();
    Ok(rows.into_iter().flatten().collect())
}

/// The rows of one coupling: its errors beside those of elements alone, and their order.
fn judged(
    case: &str,
    errors: &[Result<f64, String>],
    of_elements: &[f64],
    effort: Effort,
    is_solid: bool,
) -> Vec<TableRow> {
    let mut rows = Vec::new();
    for (k, (error, alone)) in errors.iter().zip(of_elements).enumerate() {
        let quantity = format!("error, mesh {}", k + 1);
        rows.push(match error {
            Err(why) => TableRow::refused(case, quantity, why.as_str()),
            Ok(e) if k == 1 => {
                TableRow::at_most(case, quantity, *e, alone + BEYOND_LIMIT).with_reference(*alone)
            }
            Ok(e) => TableRow::info(case, quantity, *e).with_reference(*alone),
        });
    }
    // a coarser mesh may be refused: the order is that of the last two
    let [.., Ok(before), Ok(last)] = errors else {
        return rows;
    };
    let observed = (before / last).log2();
    let alone = of_elements[errors.len() - 1];
    rows.push(match (effort, is_solid) {
        (Effort::Quick, _) => TableRow::info(case, "order", observed),
        (Effort::Full, true) if *last <= alone => TableRow::info(case, "order", observed)
            .because("the error is at most that of elements alone"),
        (Effort::Full, true) => TableRow::at_least(case, "order", observed, ORDER_LIMIT_3D),
        (Effort::Full, false) => TableRow::at_least(case, "order", observed, ORDER_LIMIT),
    });
    rows
}
