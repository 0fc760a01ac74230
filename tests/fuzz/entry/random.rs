//! Bytes to a scene within the schema: tiny, valid-looking, most often solvable.
//!
//! Every coupling, law, influence function, weight, partial volume, condition and kind of run can come; what goes together is left to bondline to
//! judge, so some scenes are refused. The first of all choices is the plainest: a scene of which bytes are taken away grows simpler.

use std::fmt::Write;

use arbitrary::{Result, Unstructured};

/// The plate of `tests/fixtures`, 2 by 1, and the block, 4 by 1 by 2.
const PLATES: [&str; 4] = [
    "plate_41_ascii.msh",
    "plate_22_binary.msh",
    "plate_zlib.vtu",
    "plate_binary.vtk",
];

/// Data that the parts of a scene share.
struct Frame {
    dimension: usize,
    kind: Kind,
    /// Length of a cell.
    h: f64,
    /// Horizon over spacing.
    ratio: f64,
    min: [f64; 3],
    length: [f64; 3],
    modulus: f64,
    density: f64,
    law: &'static str,
    /// True if bonds can break.
    breaks: bool,
    /// True if there is a transition zone.
    transition: bool,
    coupling: &'static str,
    from_file: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Static,
    Explicit,
    QuasiStatic,
}

/// A scene.
///
/// # Errors
/// If the bytes cannot be read as choices, which `Unstructured` never says of these.
pub fn scene(u: &mut Unstructured<'_>) -> Result<String> {
    let dimension = *u.choose(&[1, 2, 2, 1, 2, 3, 2, 1, 3, 2])?;
    let kind = *u.choose(&[
        Kind::Static,
        Kind::Static,
        Kind::Explicit,
        Kind::QuasiStatic,
        Kind::Static,
        Kind::Explicit,
    ])?;
    let coupling = *u.choose(&[
        "splice",
        "local",
        "nonlocal",
        "blending",
        "truncated",
        "balanced",
        "partial-stress",
        "",
    ])?;
    let law = *u.choose(&["lps", "bond-based", "correspondence", "lps"])?;
    let transition = match coupling {
        "blending" | "partial-stress" => true,
        "local" | "nonlocal" => false,
        _ => u.ratio(1, 3)?,
    };
    let mut frame = Frame {
        dimension,
        kind,
        coupling,
        h: *u.choose(&[0.1, 1.0, 1e-3, 0.125, 250.0])?,
        // a transition zone has to leave something local
        ratio: *u.choose(match (dimension, transition) {
            (1, _) => &[3.0, 2.0, 1.0, 1.5, 4.0, 2.7],
            (2, false) => &[3.0, 2.0, 2.5, 3.015, 1.5, 3.5],
            (2, true) => &[2.0, 2.5, 1.5, 2.015],
            (_, false) => &[2.0, 1.5, 2.2, 3.0],
            (_, true) => &[1.5, 2.0],
        })?,
        min: [0.0; 3],
        length: [0.0; 3],
        modulus: *u.choose(&[200e9, 1.0, 72e9, 1e-3])?,
        density: *u.choose(&[2440.0, 1.0, 7800.0])?,
        law,
        breaks: kind != Kind::Static && law != "correspondence" && u.ratio(1, 2)?,
        transition,
        from_file: false,
    };
    let mut text = String::new();
    mesh(u, &mut frame, &mut text)?;
    materials(u, &frame, &mut text)?;
    if coupling != "local" || u.ratio(1, 4)? {
        peridynamics(u, &frame, &mut text)?;
        zones(u, &frame, &mut text)?;
        obstacles(u, &frame, &mut text)?;
    }
    joined(u, &frame, &mut text)?;
    conditions(u, &frame, &mut text)?;
    run(u, &frame, &mut text)?;
    outputs(u, &frame, &mut text)?;
    // last, so that what was found before is read as it was
    if frame.kind != Kind::Static && u.ratio(1, 5)? {
        impactor(u, &frame, &mut text)?;
    }
    Ok(text)
}

/// Adds a line.
macro_rules! line {
    ($text:expr, $($part:tt)*) => {{
        // text grows in memory and does not fail
        let _ = writeln!($text, $($part)*);
    }};
}

fn mesh(u: &mut Unstructured<'_>, frame: &mut Frame, text: &mut String) -> Result<()> {
    let d = frame.dimension;
    let kinematics = match d {
        1 => "bar",
        2 => *u.choose(&["plane-stress", "plane-strain"])?,
        _ => "solid",
    };
    line!(text, "kinematics = '{kinematics}'");
    if d == 2 && u.ratio(1, 16)? {
        let file = *u.choose(&PLATES)?;
        line!(text, "mesh.file.path = '{file}'");
        (frame.h, frame.from_file) = (0.1, true);
        (frame.min, frame.length) = ([0.0; 3], [2.0, 1.0, 0.0]);
        return Ok(());
    }
    let most = match (d, frame.transition) {
        (1, _) => 40,
        (2, false) => 14,
        (2, true) => 20,
        (_, false) => 6,
        (_, true) => 8,
    };
    let origin = *u.choose(&[0.0, -1.5, 1000.0])?;
    line!(text, "[mesh.{}]", ["line", "rectangle", "box"][d - 1]);
    let mut axes = String::new();
    for k in 0..d {
        let cells = u.int_in_range(most * 2 / 3..=most)?;
        frame.min[k] = origin * frame.h;
        frame.length[k] = f64::from(cells) * frame.h;
        let axis = ["x", "y", "z"][k];
        match u.int_in_range(0..=9)? {
            0..=6 => line!(axes, "{axis} = {{ cells = {cells} }}"),
            7 | 8 => line!(axes, "{axis} = {{ spacing = {} }}", frame.h),
            _ => line!(
                axes,
                "{axis} = {{ graded = {{ fine = [{}, {}], spacing = {}, growth = 1.4 }} }}",
                frame.on_grid(k, 0.3),
                frame.on_grid(k, 0.7),
                frame.h
            ),
        }
    }
    line!(text, "min = {}", frame.corner(0.0));
    line!(text, "max = {}", frame.corner(1.0));
    text.push_str(&axes);
    if d > 1 && u.ratio(1, 5)? {
        line!(text, "cell = '{}'", ["tri3", "tet4"][d - 2]);
    }
    if d > 1 && u.ratio(1, 12)? {
        let (a, b) = (frame.corner(0.0), frame.list(|k| frame.on_grid(k, 0.26)));
        line!(text, "cutouts.corner = {{ min = {a}, max = {b} }}");
    }
    Ok(())
}

impl Frame {
    /// The coordinate at a fraction of axis `k`.
    fn at(&self, k: usize, fraction: f64) -> f64 {
        self.min[k] + fraction * self.length[k]
    }

    /// A coordinate of the grid near a fraction of axis `k`.
    fn on_grid(&self, k: usize, fraction: f64) -> f64 {
        self.min[k] + (fraction * self.length[k] / self.h).round() * self.h
    }

    fn list(&self, of_axis: impl Fn(usize) -> f64) -> String {
        let numbers: Vec<f64> = (0..self.dimension).map(of_axis).collect();
        format!("{numbers:?}")
    }

    fn corner(&self, fraction: f64) -> String {
        self.list(|k| self.at(k, fraction))
    }

    fn delta(&self) -> f64 {
        self.ratio * self.h
    }

    /// A shape of about the fractions `from` to `to` along x.
    fn shape(&self, u: &mut Unstructured<'_>, from: f64, to: f64) -> Result<String> {
        let whole = u.ratio(3, 5)?;
        let at = |k: usize, fraction: f64| match (k, whole) {
            // at least a cell long
            (0, _) if fraction == to => self
                .on_grid(0, to)
                .max(self.on_grid(0, from) + 2.0 * self.h),
            (0, _) => self.on_grid(0, fraction),
            (_, true) => self.at(k, if fraction == from { 0.0 } else { 1.0 }),
            (_, false) if fraction == to => self
                .on_grid(k, to)
                .max(self.on_grid(k, from) + 2.0 * self.h),
            (_, false) => self.on_grid(k, fraction),
        };
        let (min, max) = (self.list(|k| at(k, from)), self.list(|k| at(k, to)));
        let middle = self.corner(0.5 * (from + to));
        let radius = 0.5 * (to - from) * self.length[0];
        Ok(match u.int_in_range(0..=11)? {
            0..=7 => format!("box = {{ min = {min}, max = {max} }}"),
            8 => format!("ball = {{ center = {middle}, radius = {radius} }}"),
            9 => format!("near = {{ within = {radius}, point = {middle} }}"),
            10 => format!(
                "any = [{{ box = {{ min = {min}, max = {max} }} }}, {{ ball = {{ center = {middle}, radius = {radius} }} }}]"
            ),
            _ => format!(
                "without = {{ from = {{ box = {{ min = {min}, max = {max} }} }}, removed = {{ ball = {{ center = {middle}, radius = {} }} }} }}",
                0.3 * radius
            ),
        })
    }
}

fn materials(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    let law = frame.law;
    line!(text, "[materials.stuff.{law}]");
    line!(text, "youngs-modulus = {:e}", frame.modulus);
    if law == "bond-based" {
        let micromodulus = u.choose(&[
            "",
            "'constant'",
            "'uniform'",
            "'triangular'",
            "{ influence = { degree = 1, alpha = 1 } }",
        ])?;
        if !micromodulus.is_empty() {
            line!(text, "micromodulus = {micromodulus}");
        }
    } else {
        let nu = u.choose(&[0.25, 0.0, 0.3, 0.22, -0.3, 0.45, 0.1])?;
        line!(text, "poisson-ratio = {nu:?}");
    }
    if law == "correspondence" && u.ratio(1, 4)? {
        line!(text, "stabilisation = {}", u.choose(&[0, 2])?);
    }
    if frame.kind == Kind::Explicit || u.ratio(1, 8)? {
        line!(text, "density = {:?}", frame.density);
    }
    if frame.breaks {
        if u.ratio(1, 2)? {
            line!(
                text,
                "critical-stretch = {}",
                u.choose(&[1e-3, 1e-2, 1e-5])?
            );
        } else {
            let energy = 1e-6 * frame.modulus * frame.delta();
            line!(text, "fracture-energy = {energy:e}");
        }
    }
    Ok(())
}

fn peridynamics(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    line!(text, "[peridynamics]");
    let delta = frame.delta();
    if u.ratio(1, 10)? {
        let (lo, length) = (frame.min[0], frame.length[0]);
        line!(
            text,
            "horizon = '{delta} * (1 + 0.2 * (x - {lo}) / {length})'"
        );
    } else {
        line!(text, "horizon = {delta:?}");
    }
    let lattice = frame.from_file
        || matches!(frame.coupling, "truncated" | "partial-stress" | "")
        || u.ratio(1, 2)?;
    if lattice {
        let spacing = match frame.dimension {
            3 => frame.h,
            _ => frame.h / f64::from(*u.choose(&[1u8, 1, 1, 2])?),
        };
        line!(text, "points.lattice.spacing = {spacing:?}");
        if u.ratio(1, 8)? {
            let middle = frame.list(|k| frame.min[k] + 0.5 * spacing);
            line!(text, "points.lattice.origin = {middle}");
        }
    }
    let weights = u.choose(&["", "plain", "fitted", "isotropic", "plain"])?;
    if !weights.is_empty() {
        line!(text, "weights = '{weights}'");
    }
    let partial = lattice && frame.kind == Kind::Static && *weights != "fitted";
    if u.ratio(1, if partial { 4 } else { 40 })? {
        let volumes = u.choose(&["pdlammps", "hhb", "exact", "full"])?;
        line!(text, "volumes = '{volumes}'");
    }
    if u.ratio(1, 2)? {
        let influence = match u.int_in_range(0..=4)? {
            0 => "'gaussian'".to_owned(),
            _ => format!(
                "{{ degree = {}, alpha = {} }}",
                u.choose(&[3, 0, 1, 5, 7])?,
                u.int_in_range(0..=1)?
            ),
        };
        line!(text, "influence = {influence}");
    }
    if u.ratio(1, if frame.kind == Kind::Static { 24 } else { 4 })? {
        line!(text, "bonds = '{}'", u.choose(&["exact", "linear"])?);
    }
    if u.ratio(1, 10)? {
        line!(text, "surfaces = '{}'", u.choose(&["uncut", "cut"])?);
    }
    Ok(())
}

fn zones(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    if matches!(frame.coupling, "local" | "nonlocal") && !u.ratio(1, 12)? {
        return Ok(());
    }
    line!(text, "[zones]");
    let (from, to) = *u.choose(match frame.transition {
        false => &[(0.35, 0.65), (0.3, 0.7), (0.0, 0.5), (0.45, 0.55)],
        true => &[(0.45, 0.6), (0.4, 0.6), (0.0, 0.3)],
    })?;
    if frame.coupling == "truncated" && u.ratio(1, 4)? {
        line!(text, "nonlocal.everywhere = true\nskin = 'free-surfaces'");
    } else {
        line!(text, "nonlocal = {{ {} }}", frame.shape(u, from, to)?);
    }
    if frame.transition {
        let width = frame.delta() * *u.choose(&[1.0, 1.3, 1.1, 2.0])?;
        line!(text, "transition.around = {width:?}");
    }
    if frame.breaks && u.ratio(2, 3)? {
        line!(text, "damage-at-edge = 'warn'");
    }
    Ok(())
}

fn obstacles(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    let d = frame.dimension;
    // between points, off the grid
    let x = frame.on_grid(0, 0.5) + 0.013 * frame.h;
    if u.ratio(1, 5)? {
        let y = |f: f64| frame.at(1, f);
        let z = |f: f64| frame.at(2, f);
        match d {
            1 => line!(text, "[cracks.cut]\npoint = {x:?}"),
            2 => {
                let (a, b) = *u.choose(&[(0.4, 0.6), (0.25, 0.75)])?;
                line!(
                    text,
                    "[cracks.cut.segment]\nfrom = [{x:?}, {:?}]\nto = [{x:?}, {:?}]",
                    y(a),
                    y(b)
                );
            }
            _ => line!(
                text,
                "[cracks.cut]\npolygon = [[{x:?}, {0:?}, {2:?}], [{x:?}, {1:?}, {2:?}], [{x:?}, {1:?}, {3:?}], [{x:?}, {0:?}, {3:?}]]",
                y(0.3),
                y(0.7),
                z(0.3),
                z(0.7)
            ),
        }
    }
    if u.ratio(1, 10)? {
        let radius = *u.choose(&[0.6, 1.1])? * frame.h;
        let middle = frame.corner(0.5);
        line!(
            text,
            "[voids.hole]\ninside.ball = {{ center = {middle}, radius = {radius:?} }}\ncut-bonds = {}",
            u.ratio(3, 4)?
        );
    }
    Ok(())
}

fn joined(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    match frame.coupling {
        "" => return Ok(()),
        name => line!(text, "[coupling.{name}]"),
    }
    let beta = *u.choose(&["", "smooth", "linear", "constant"])?;
    match frame.coupling {
        "blending" | "balanced" if frame.transition && !beta.is_empty() => {
            line!(text, "beta = '{beta}'")
        }
        "partial-stress" => {
            line!(text, "form = '{}'", u.choose(&["elements", "meshfree"])?);
            if u.ratio(1, 3)? {
                line!(text, "interface = 'affine'");
            }
        }
        _ => {}
    }
    Ok(())
}

fn conditions(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    let axes = &["x", "y", "z"][..frame.dimension];
    let moves = frame.kind != Kind::Static;
    let sides = if frame.from_file {
        ["fixed", "hole"]
    } else {
        ["left", "right"]
    };
    // one in twenty is held too little, unless it moves
    if frame.kind != Kind::Explicit || u.ratio(2, 3)? {
        line!(text, "[conditions.held.displacement]\non = '{}'", sides[0]);
        for axis in axes {
            if !u.ratio(1, 40)? {
                line!(text, "{axis} = 0");
            }
        }
    }
    let stretch = *u.choose(&[1e-3, 1e-5, 0.02, -1e-3])?;
    let growing = |value: f64| {
        if moves && frame.kind == Kind::QuasiStatic {
            format!("'{value:e} * t'")
        } else {
            format!("{value:e}")
        }
    };
    match u.int_in_range(0..=9)? {
        0..=3 if frame.kind != Kind::Explicit => {
            let by = stretch * frame.length[0];
            line!(
                text,
                "[conditions.pulled.displacement]\non = '{}'\nx = {}",
                sides[1],
                growing(by)
            );
        }
        0..=6 => {
            let force = stretch * frame.modulus;
            line!(
                text,
                "[conditions.pulled.traction]\non = '{}'\n{} = {}",
                sides[1],
                u.choose(axes)?,
                growing(force)
            );
        }
        7 => {
            let force = stretch * frame.modulus / frame.length[0];
            line!(
                text,
                "[conditions.weight.body-force]\n{} = {}",
                u.choose(axes)?,
                growing(force)
            );
        }
        8 => {
            let force = stretch * frame.modulus / frame.length[0];
            let shape = frame.shape(u, 0.5, 0.8)?;
            line!(
                text,
                "[conditions.part.body-force]\ninside = {{ {shape} }}\nx = '{force:e} * (1 + 0.1*sin(x))'"
            );
        }
        _ if moves => {
            let speed = stretch * (frame.modulus / frame.density).sqrt();
            line!(
                text,
                "[conditions.struck.velocity]\non = '{}'\nx = {speed:e}",
                sides[1]
            );
        }
        _ => {
            let shape = frame.shape(u, 0.8, 1.0)?;
            line!(
                text,
                "[conditions.moved.displacement]\ninside = {{ {shape} }}\nx = '{stretch:e} * x'"
            );
        }
    }
    Ok(())
}

fn run(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    match frame.kind {
        Kind::Static => {
            if u.ratio(1, 3)? {
                let method = u.choose(&["direct", "krylov", "auto"])?;
                let ordering = u.choose(&["coordinate-nested-dissection", "metis", "amd"])?;
                line!(
                    text,
                    "[solver]\nmethod = '{method}'\nordering = '{ordering}'"
                );
            }
        }
        Kind::Explicit => {
            let speed = (frame.modulus / frame.density).sqrt();
            let crossing = frame.h / speed;
            let duration = crossing * f64::from(u.int_in_range(2u8..=12)?);
            line!(
                text,
                "[solve.explicit]\nduration = {duration:e}\noutputs = 1"
            );
            match u.int_in_range(0..=7)? {
                0 => line!(text, "step-fraction = 0.5"),
                1 => line!(
                    text,
                    "step = {:e}\nbeyond-limit = 'shorten'",
                    0.5 * crossing
                ),
                2 => line!(text, "step = {:e}", 0.2 * crossing),
                3 => line!(text, "sub-steps = 2"),
                _ => {}
            }
            if u.ratio(1, 3)? {
                line!(
                    text,
                    "[initial.kick.velocity]\nx = '{:e} * sin(x)'",
                    1e-3 * speed
                );
            }
        }
        Kind::QuasiStatic => {
            let steps = u.int_in_range(1..=3)?;
            line!(text, "[solve.quasi-static]\nsteps = {steps}");
            if u.ratio(1, 3)? {
                line!(text, "method = 'relaxation'\ntolerance = 1e-5");
            }
        }
    }
    if frame.kind == Kind::Explicit && u.ratio(1, 6)? {
        line!(text, "[contact]");
        if u.ratio(1, 2)? {
            line!(text, "radius-factor = 0.8\nstiffness-factor = 10");
        }
    }
    if frame.breaks && u.ratio(1, 5)? {
        line!(text, "[no-fail.grip]\n{}", frame.shape(u, 0.0, 0.2)?);
    }
    Ok(())
}

/// A plane before or within the body, or a sphere, that is free or driven.
fn impactor(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    let normal = frame.list(|k| -f64::from(u8::from(k == 0)));
    let at = frame.corner(f64::from(u.int_in_range(9u8..=12)?) / 10.0);
    line!(text, "[impactors.one]");
    match u.ratio(1, 2)? {
        true => line!(text, "plane = {{ point = {at}, normal = {normal} }}"),
        false => line!(text, "sphere = {{ center = {at}, radius = {:e} }}", frame.h),
    }
    let speed = (frame.modulus / frame.density).sqrt();
    match (frame.kind == Kind::Explicit, u.ratio(1, 2)?) {
        (true, true) => line!(
            text,
            "mass = {:e}\nvelocity = {{ x = {:e} }}",
            frame.density * frame.h,
            -1e-2 * speed
        ),
        (true, false) => line!(text, "velocity = {{ x = '{:e} * t' }}", -speed),
        _ => line!(text, "displacement = {{ x = '{:e} * t' }}", -1e-2 * frame.h),
    }
    Ok(())
}

fn outputs(u: &mut Unstructured<'_>, frame: &Frame, text: &mut String) -> Result<()> {
    line!(text, "[output]\nvtu = {}", u.ratio(1, 4)?);
    if u.ratio(1, 3)? {
        line!(text, "probes.here.at = {}", frame.corner(0.5));
    }
    if u.ratio(1, 6)? {
        let (from, to) = (frame.corner(0.1), frame.corner(0.9));
        line!(
            text,
            "lines.across = {{ from = {from}, to = {to}, samples = 7 }}"
        );
    }
    if frame.breaks && u.ratio(1, 4)? {
        let direction = frame.list(|k| f64::from(u8::from(k == 0)));
        line!(text, "tips.front.direction = {direction}");
    }
    Ok(())
}
