//! Bytes to a scene as users type it: few keys, round numbers, a zone drawn without regard to the mesh, and meshes as Gmsh writes them.
//!
//! Points, coupling, weights, influence and partial volumes are left to bondline more often than not. Nothing is made to fit: what goes together is left to
//! bondline to judge, which proves the run, warns of it or refuses it. A scene at rest in which nothing is cut comes with two more, its elements alone on the
//! same mesh and on one with every edge halved, by which its answer is judged.

use std::fmt::Write;

use arbitrary::{Result, Unstructured};

/// A scene and what it is compared with.
pub struct Typed {
    /// The scene.
    pub text: String,
    /// The same with elements alone, and on a mesh with every edge halved; none where classical elasticity has no answer to give.
    pub alone: Option<[String; 2]>,
    /// Names and contents of the meshes.
    pub meshes: Vec<(String, String)>,
    /// Horizon over the smallest extent of the body: the squared is the order of what nonlocality does to a smooth field.
    pub horizon_over_size: f64,
}

/// A number with two digits, as one types it.
fn round(x: f64) -> f64 {
    format!("{x:.1e}").parse().expect("it was a number")
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Static,
    Explicit,
    LoadSteps,
}

struct Frame {
    d: usize,
    cells: [usize; 3],
    size: [f64; 3],
    /// Length of a cell, roughly.
    h: f64,
    modulus: f64,
    kind: Kind,
}

impl Frame {
    fn list(&self, of_axis: impl Fn(usize) -> f64) -> String {
        // a multiple of a length has digits that nobody types
        let typed = |x: f64| format!("{x:.6e}").parse().expect("it was a number");
        let numbers: Vec<f64> = (0..self.d).map(|k| typed(of_axis(k))).collect();
        format!("{numbers:?}")
    }

    /// A place at fractions of the body.
    fn place(&self, fractions: [f64; 3]) -> String {
        self.list(|k| self.size[k] * fractions[k])
    }
}

/// Adds a line.
macro_rules! line {
    ($text:expr, $($part:tt)*) => {{
        // text grows in memory and does not fail
        let _ = writeln!($text, $($part)*);
    }};
}

/// Points, their horizon, weights and volumes; whether these keep the typed stiffness: points without a correction have one of their own.
fn peridynamics(
    u: &mut Unstructured<'_>,
    frame: &Frame,
    horizon: f64,
    rest: &mut String,
) -> Result<bool> {
    line!(rest, "[peridynamics]\nhorizon = {horizon:?}");
    match u.int_in_range(0..=9)? {
        0..=5 => {}
        6 => line!(rest, "points = 'cells'"),
        7 if frame.d < 3 => line!(rest, "points.lattice.spacing = {:?}", 0.5 * frame.h),
        _ => line!(rest, "points.lattice.spacing = {:?}", round(0.93 * frame.h)),
    }
    let mut is_typed = true;
    match u.int_in_range(0..=11)? {
        0 => {
            line!(rest, "weights = 'plain'");
            is_typed = false;
        }
        1 => line!(rest, "weights = 'fitted'"),
        2 => line!(rest, "influence = {{ degree = 1, alpha = 1 }}"),
        3 => {
            line!(rest, "volumes = 'hhb'\nweights = 'plain'");
            is_typed = false;
        }
        _ => {}
    }
    Ok(is_typed)
}

/// Writes the table of the solver, if the scene has one.
fn solution(frame: &Frame, rest: &mut String) {
    match frame.kind {
        Kind::Static => {}
        Kind::Explicit => {
            let crossing = frame.h / frame.modulus.sqrt();
            line!(
                rest,
                "[solve.explicit]\nduration = {:e}\noutputs = 2",
                round(12.0 * crossing)
            );
        }
        Kind::LoadSteps => line!(rest, "[solve.quasi-static]\nsteps = 2"),
    }
}

/// A section; lines of a static scene, a probe of one that moves.
fn outputs(frame: &Frame, rest: &mut String) {
    line!(rest, "[output]\nvtu = false");
    let along: Vec<f64> = (0..frame.d).map(|k| f64::from(u8::from(k == 0))).collect();
    line!(
        rest,
        "sections.half = {{ point = {}, normal = {along:?} }}",
        frame.place([0.5; 3])
    );
    if frame.kind == Kind::Static {
        let (from, to) = ([0.0, 0.37, 0.43], [1.0, 0.37, 0.43]);
        line!(
            rest,
            "lines.across = {{ from = {}, to = {}, samples = 41 }}",
            frame.place(from),
            frame.place(to)
        );
        let (from, to) = ([0.55, 0.0, 0.43], [0.55, 1.0, 0.43]);
        if frame.d > 1 {
            line!(
                rest,
                "lines.up = {{ from = {}, to = {}, samples = 41 }}",
                frame.place(from),
                frame.place(to)
            );
        }
    } else {
        line!(rest, "probes.middle.at = {}", frame.place([0.5; 3]));
    }
}

/// A scene.
///
/// # Errors
/// If the bytes cannot be read as choices, which `Unstructured` never says of these.
pub fn typed(u: &mut Unstructured<'_>) -> Result<Typed> {
    let d = *u.choose(&[2, 2, 1, 2, 3, 2])?;
    let (least, most) = [(20, 60), (9, 20), (4, 6)][d - 1];
    let mut frame = Frame {
        d,
        cells: [1; 3],
        size: [1.0; 3],
        h: *u.choose(&[0.1, 1.0, 0.05, 5.0, 0.025])?,
        modulus: *u.choose(&[200e9, 72e9, 1.0, 3e3])?,
        kind: *u.choose(&[
            Kind::Static,
            Kind::Static,
            Kind::Static,
            Kind::Static,
            Kind::Static,
            Kind::Static,
            Kind::Explicit,
            Kind::LoadSteps,
        ])?,
    };
    for k in 0..d {
        frame.cells[k] = u.int_in_range(least..=most)?;
        frame.size[k] = round(frame.cells[k] as f64 * frame.h);
    }
    let mut meshes = Vec::new();
    let [mesh, fine] = mesh(u, &frame, &mut meshes)?;
    let (coupling, meets) = coupling(u)?;
    let ratio = *u.choose(&[3.0, 2.0, 2.5, 3.015, 1.6])?;
    // as `3.015 * 0.1` is typed
    let horizon: f64 = format!("{:.3e}", frame.h * ratio)
        .parse()
        .expect("it was a number");
    let mut rest = String::new();
    let law = *u.choose(&["lps", "bond-based", "lps", "correspondence"])?;
    materials(u, &frame, law, &mut rest)?;
    let is_typed = peridynamics(u, &frame, horizon, &mut rest)?;
    zone(u, &frame, meets, horizon, &mut rest)?;
    let cut = frame.kind != Kind::Static || u.ratio(1, 6)?;
    if cut && u.ratio(1, 2)? {
        crack(&frame, &mut rest);
    }
    conditions(u, &frame, &mut rest)?;
    solution(&frame, &mut rest);
    outputs(&frame, &mut rest);
    let kinematics = match d {
        1 => "bar",
        2 => *u.choose(&["plane-stress", "plane-strain"])?,
        _ => "solid",
    };
    let whole = |coupling: &str, mesh: &str| {
        format!("kinematics = '{kinematics}'\n{coupling}\n{mesh}{rest}")
    };
    let local = "coupling = 'local'";
    let smallest = frame.size[..d]
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    Ok(Typed {
        alone: (!cut && is_typed).then(|| [whole(local, &mesh), whole(local, &fine)]),
        text: whole(&coupling, &mesh),
        meshes,
        horizon_over_size: horizon / smallest,
    })
}

/// The mesh as a scene names it, and one with every edge halved.
fn mesh(
    u: &mut Unstructured<'_>,
    frame: &Frame,
    meshes: &mut Vec<(String, String)>,
) -> Result<[String; 2]> {
    let d = frame.d;
    if d == 1 || u.ratio(1, 2)? {
        let by_spacing = u.ratio(1, 3)?;
        let shape = ["line", "rectangle", "box"][d - 1];
        let cell = match d > 1 && u.ratio(1, 5)? {
            true => ["", "cell = 'tri3'\n", "cell = 'tet4'\n"][d - 1],
            false => "",
        };
        return Ok([1, 2].map(|times| {
            let mut text = format!("[mesh.{shape}]\n{cell}");
            line!(text, "min = {}", frame.place([0.0; 3]));
            line!(text, "max = {}", frame.place([1.0; 3]));
            for (k, axis) in ["x", "y", "z"].into_iter().enumerate().take(d) {
                match by_spacing {
                    true => line!(
                        text,
                        "{axis} = {{ spacing = {:?} }}",
                        frame.h / f64::from(times)
                    ),
                    false => line!(
                        text,
                        "{axis} = {{ cells = {} }}",
                        frame.cells[k] * times as usize
                    ),
                }
            }
            text
        }));
    }
    let simplices = d == 3 || u.ratio(2, 3)?;
    // how far nodes stand from where a grid has them, in cells, and how much smaller the cells at one end are
    let jitter = *u.choose(&[0.2, 0.1, 0.0, 0.15])?;
    let grading = *u.choose(&[0.0, 0.3, 0.0, 0.5])?;
    let seed = u64::from(u.arbitrary::<u16>()?);
    Ok([1, 2].map(|times| {
        let name = format!("mesh{times}.msh");
        let text = gmsh(frame, simplices, jitter, grading, seed, times);
        meshes.push((name.clone(), text));
        format!("mesh.file.path = '{name}'\n")
    }))
}

/// The elements of a file of Gmsh, over a grid of `many` cells.
struct GmshElements {
    d: usize,
    many: [usize; 3],
    text: String,
    count: usize,
}

/// The node that lies one further along each of the axes.
fn step(mut at: [usize; 3], along: &[usize]) -> [usize; 3] {
    along.iter().for_each(|&k| at[k] += 1);
    at
}

impl GmshElements {
    /// The number of a node.
    fn number(&self, at: [usize; 3]) -> usize {
        (at[2] * (self.many[1] + 1) + at[1]) * (self.many[0] + 1) + at[0] + 1
    }

    /// An element of a kind and a group.
    fn push(&mut self, kind: usize, group: usize, corners: &[[usize; 3]]) {
        self.count += 1;
        let count = self.count;
        let corners: Vec<String> = corners
            .iter()
            .map(|&c| self.number(c).to_string())
            .collect();
        line!(
            self.text,
            "{count} {kind} 2 {group} {group} {}",
            corners.join(" ")
        );
    }

    /// The four sides.
    fn push_sides(&mut self) {
        let many = self.many;
        for (group, axis, end) in [(1, 0, false), (2, 0, true), (3, 1, false), (4, 1, true)] {
            let fixed = if end { many[axis] } else { 0 };
            let (a, b) = (1 - axis, 2);
            for j in 0..many[b].max(1) {
                for i in 0..many[a] {
                    let mut at = [0; 3];
                    (at[axis], at[a], at[b]) = (fixed, i, j);
                    match self.d {
                        2 => self.push(1, group, &[at, step(at, &[a])]),
                        _ => {
                            let far = step(at, &[a, b]);
                            self.push(2, group, &[at, step(at, &[a]), far]);
                            self.push(2, group, &[at, far, step(at, &[b])]);
                        }
                    }
                }
            }
        }
    }

    /// The cells of the body: boxes or simplices.
    fn push_cells(&mut self, simplices: bool) {
        let many = self.many;
        for z in 0..many[2].max(1) {
            for y in 0..many[1] {
                for x in 0..many[0] {
                    let at = [x, y, z];
                    let far = step(at, &[0, 1]);
                    match (self.d, simplices) {
                        (2, true) => {
                            self.push(2, 5, &[at, step(at, &[0]), far]);
                            self.push(2, 5, &[at, far, step(at, &[1])]);
                        }
                        (2, false) => self.push(3, 5, &[at, step(at, &[0]), far, step(at, &[1])]),
                        _ => {
                            let far = step(at, &[0, 1, 2]);
                            for (a, b, c) in [
                                (0, 1, 2),
                                (1, 2, 0),
                                (2, 0, 1),
                                (1, 0, 2),
                                (2, 1, 0),
                                (0, 2, 1),
                            ] {
                                let (first, second) = (step(at, &[a]), step(at, &[a, b]));
                                // even orders of the axes are right-handed
                                let even = (b + 3 - a) % 3 == 1 && (c + 3 - b) % 3 == 1;
                                match even {
                                    true => self.push(4, 5, &[at, first, second, far]),
                                    false => self.push(4, 5, &[at, second, first, far]),
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A body in Gmsh 2.2 with groups `left`, `right`, `bottom`, `top` and `body`, each edge divided into `times`.
fn gmsh(
    frame: &Frame,
    simplices: bool,
    jitter: f64,
    grading: f64,
    seed: u64,
    times: usize,
) -> String {
    let (d, n) = (frame.d, frame.cells);
    let many = [0, 1, 2].map(|k| if k < d { n[k] * times } else { 0 });
    // a node of the coarse mesh, by its numbers along the axes
    let coarse = |at: [usize; 3]| {
        [0, 1, 2].map(|k| {
            if k >= d {
                return 0.0;
            }
            let own = (0..d).fold(seed + 17 * k as u64, |s, j| {
                (s ^ (at[j] as u64))
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407)
            });
            let random = (own >> 33) as f64 / f64::from(1u32 << 31) - 0.5;
            let moves = at[k] > 0 && at[k] < n[k];
            let s = (at[k] as f64 + if moves { 2.0 * jitter * random } else { 0.0 }) / n[k] as f64;
            frame.size[k]
                * if k == 0 {
                    s * (1.0 - grading * (1.0 - s))
                } else {
                    s
                }
        })
    };
    let node = |at: [usize; 3]| {
        let low = coarse(at.map(|i| i / times));
        let high = coarse(at.map(|i| i.div_ceil(times)));
        [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]))
    };
    let mut file = GmshElements {
        d,
        many,
        text: String::new(),
        count: 0,
    };
    let mut nodes = String::new();
    for z in 0..=many[2] {
        for y in 0..=many[1] {
            for x in 0..=many[0] {
                let [a, b, c] = node([x, y, z]);
                line!(nodes, "{} {a} {b} {c}", file.number([x, y, z]));
            }
        }
    }
    file.push_sides();
    file.push_cells(simplices);
    let GmshElements {
        text: elements,
        count,
        ..
    } = file;
    let total = nodes.lines().count();
    let sides = d - 1;
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n5\n{sides} 1 \"left\"\n{sides} 2 \"right\"\n{sides} 3 \"bottom\"\n\
         {sides} 4 \"top\"\n{d} 5 \"body\"\n$EndPhysicalNames\n$Nodes\n{total}\n{nodes}$EndNodes\n$Elements\n{count}\n{elements}$EndElements\n"
    )
}

/// Chooses the coupling of the scene; true if it comes with a transition zone.
fn coupling(u: &mut Unstructured<'_>) -> Result<(String, bool)> {
    let (text, meets) = *u.choose(&[
        ("", false),
        ("coupling = 'truncated'", false),
        ("coupling = 'splice'", false),
        ("", false),
        ("coupling = 'blending'", true),
        ("coupling = 'balanced'", true),
        ("coupling = 'balanced'", false),
        ("coupling = 'partial-stress'", true),
        ("coupling.partial-stress.form = 'meshfree'", true),
        ("coupling = 'nonlocal'", false),
    ])?;
    Ok((text.to_owned(), meets))
}

fn materials(u: &mut Unstructured<'_>, frame: &Frame, law: &str, text: &mut String) -> Result<()> {
    line!(
        text,
        "[materials.stuff.{law}]\nyoungs-modulus = {:e}",
        frame.modulus
    );
    if law != "bond-based" {
        let nu = *u.choose(&[0.3, 0.25, 0.33, 0.2, 0.0, 0.4])?;
        line!(text, "poisson-ratio = {nu:?}");
    }
    if frame.kind == Kind::Explicit {
        line!(text, "density = 1");
    }
    if frame.kind != Kind::Static && law != "correspondence" {
        let energy = round(1e-6 * frame.modulus * frame.h);
        line!(text, "fracture-energy = {energy:e}");
    }
    Ok(())
}

/// A zone with round corners, wherever they fall among the cells.
fn zone(
    u: &mut Unstructured<'_>,
    frame: &Frame,
    meets: bool,
    horizon: f64,
    text: &mut String,
) -> Result<()> {
    line!(text, "[zones]");
    let mut fraction = |choices: &[f64]| u.choose(choices).copied();
    let low = [
        fraction(&[0.33, 0.4, 0.25, 0.0])?,
        fraction(&[0.33, 0.0, 0.3, 0.4])?,
        fraction(&[0.33, 0.0])?,
    ];
    let high = [
        fraction(&[0.67, 0.75, 0.6, 0.9])?,
        fraction(&[0.67, 1.0, 0.7, 0.6])?,
        fraction(&[0.67, 1.0])?,
    ];
    match u.int_in_range(0..=11)? {
        0 => {
            let radius = 0.25 * frame.size[0].min(frame.size[1 % frame.d]);
            line!(
                text,
                "nonlocal.ball = {{ center = {}, radius = {:?} }}",
                frame.place([0.5; 3]),
                round(radius)
            );
        }
        1 => line!(
            text,
            "nonlocal.near = {{ within = {:?}, point = {} }}",
            round(2.0 * horizon),
            frame.place([0.5; 3])
        ),
        2 if !meets => line!(text, "nonlocal.everywhere = true\nskin = 'free-surfaces'"),
        _ => line!(
            text,
            "nonlocal.box = {{ min = {}, max = {} }}",
            frame.list(|k| round(frame.size[k] * low[k])),
            // a face of the body is typed as it is
            frame.list(|k| if high[k] < 1.0 {
                round(frame.size[k] * high[k])
            } else {
                frame.size[k]
            })
        ),
    }
    if meets {
        let width = horizon * *u.choose(&[1.0, 1.5, 2.0])?;
        line!(text, "transition.around = {:?}", round(width));
    }
    Ok(())
}

/// A crack through the middle third.
fn crack(frame: &Frame, text: &mut String) {
    let at = |y, z| frame.place([0.501, y, z]);
    match frame.d {
        1 => line!(text, "[cracks.cut]\npoint = {}", at(0.5, 0.5)),
        2 => line!(
            text,
            "[cracks.cut.segment]\nfrom = {}\nto = {}",
            at(0.4, 0.5),
            at(0.6, 0.5)
        ),
        _ => line!(
            text,
            "[cracks.cut]\npolygon = [{}, {}, {}, {}]",
            at(0.4, 0.4),
            at(0.6, 0.4),
            at(0.6, 0.6),
            at(0.4, 0.6)
        ),
    }
}

fn conditions(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    let axes = &["x", "y", "z"][..frame.d];
    line!(text, "[conditions.held.displacement]\non = 'left'");
    axes.iter().for_each(|axis| line!(text, "{axis} = 0"));
    let strain = *u.choose(&[1e-3, 1e-4, 0.01])?;
    let grows = if frame.kind == Kind::LoadSteps {
        " * t"
    } else {
        ""
    };
    match u.int_in_range(0..=7)? {
        0..=2 => line!(
            text,
            "[conditions.pulled.traction]\non = 'right'\nx = '{:e}{grows}'",
            strain * frame.modulus
        ),
        3 if frame.kind != Kind::Explicit => line!(
            text,
            "[conditions.moved.displacement]\non = 'right'\nx = '{:e}{grows}'",
            strain * frame.size[0]
        ),
        4 => line!(
            text,
            "[conditions.sheared.traction]\non = 'right'\n{} = '{:e}{grows}'",
            axes[frame.d - 1],
            0.1 * strain * frame.modulus
        ),
        5 if frame.d > 1 => line!(
            text,
            "[conditions.pressed.traction]\non = 'top'\ny = '{:e}{grows}'",
            -0.1 * strain * frame.modulus
        ),
        6 => line!(
            text,
            "[conditions.wave.body-force]\nx = '{:e} * sin(pi * x / {}){grows}'",
            strain * frame.modulus / frame.size[0],
            frame.size[0]
        ),
        _ => line!(
            text,
            "[conditions.weight.body-force]\n{} = '{:e}{grows}'",
            axes[frame.d - 1],
            -0.1 * strain * frame.modulus / frame.size[0]
        ),
    }
    Ok(())
}
