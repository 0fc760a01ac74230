//! Several horizons in one body: lattices with a layer of finite elements between them.
//!
//! A body whose horizon jumps is either reciprocal or passes the patch test, not both: with bonds taken from both ends forces are pairwise, but a point beside the jump sees
//! half of its bonds with another stiffness. Two lattices that end on the faces of a layer of elements, by truncated bonds, do both.

use std::ops::ControlFlow;

use crate::{
    Effort,
    enclosed::{Enclosed, INFLUENCE, Law, Method, POISSON, SPACING, YOUNGS_MODULUS},
    meshes::scene::{self, SceneFailure},
    patch::{affine_residual, solution_error},
    tangents::momentum,
    typed,
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
    progress::Progress,
    solve::{
        explicit::{Explicit, ExplicitParams, State, Undriven},
        stable_step, stencils,
    },
    system::{LinearMotion, Symmetry},
    tensor::Vector,
};

/// Largest asymmetry, sum of forces and sum of moments.
pub const RECIPROCITY_LIMIT: f64 = 1e-12;

/// Largest affine residual per volume, relative to `E |G|/h` with the larger spacing.
pub const AFFINE_LIMIT: f64 = 1e-11;

/// Larger horizon over the smaller one.
pub const HORIZONS: u32 = 4;

/// A block whose halves have lattices and horizons of their own, the larger ones where x is negative.
///
/// # Errors
/// [`SceneFailure`] of the scene or its model.
pub fn bodies<const D: usize>(law: Law, ratio: u32) -> Result<Enclosed<D>, SceneFailure> {
    // half of the block, of the peridynamic zone, in cells; the layer is the cell right of the middle
    let (half, zone): (u32, u32) = if D == 3 { (5, 3) } else { (11, 7) };
    let (end, zone) = (f64::from(half) * SPACING, f64::from(zone) * SPACING);
    let fine = SPACING / f64::from(HORIZONS);
    // what is left of it and touches it becomes the layer
    let right = std::array::from_fn(|k| if k == 0 { SPACING } else { -zone });
    let text = format!(
        "kinematics = \"{}\"\ncoupling = \"truncated\"\n{}{}[peridynamics]\nhorizon = {:?}\npoints.lattice = {{ spacing = {SPACING}, origin = {} }}\n{}[zones]\nnonlocal = {}\n[zones.bodies.fine]\ninside = {}\nspacing = {fine:?}\nhorizon = {:?}\n{}",
        typed::kinematics::<D>(),
        typed::grid([-end; D], [end; D], [2 * half as usize; D]),
        typed::material(law, YOUNGS_MODULUS, POISSON),
        f64::from(ratio) * SPACING,
        typed::place([0.5 * SPACING; D]),
        typed::law_line(law),
        typed::cube::<D>(zone),
        typed::cuboid(right, [zone; D]),
        f64::from(ratio) * fine,
        typed::FREE
    );
    Enclosed::of_scene(&text, &[], end)
}

fn property_rows<const D: usize>(law: Law, ratio: u32) -> Vec<TableRow> {
    let name = format!("{D}D {}, m = {ratio}", law.name());
    let e = match bodies::<D>(law, ratio) {
        Ok(e) => e,
        Err(why) => {
            let row = TableRow::at_most(name, "residual", f64::NAN, AFFINE_LIMIT);
            return vec![row.because(why.to_string())];
        }
    };
    let places: Vec<Vector<D>> = e.positions().copied().collect();
    let (forces, moments) = momentum(&e.stiffness, &places);
    let mut rows = vec![
        TableRow::at_most(
            &name,
            "asymmetry",
            e.stiffness.asymmetry(),
            RECIPROCITY_LIMIT,
        ),
        TableRow::at_most(&name, "forces", forces, RECIPROCITY_LIMIT),
        TableRow::at_most(&name, "residual", affine_residual(&e), AFFINE_LIMIT),
        TableRow::info(&name, "sites", e.model.sites.len() as f64),
    ];
    if D > 1 {
        rows.push(TableRow::at_most(
            &name,
            "moments",
            moments,
            RECIPROCITY_LIMIT,
        ));
    }
    rows.push(match solution_error(&e) {
        Ok(error) => TableRow::at_most(&name, "solution error", error, 1e-9),
        Err(why) => TableRow::at_most(&name, "solution error", f64::NAN, 1e-9).because(why),
    });
    rows
}

/// Symmetry, equilibrium and affine fields of two lattices with a layer between them.
pub fn properties(effort: Effort, progress: &dyn Progress) -> Table {
    progress.stage("layers", None);
    let mut table = Table::new(
        format!(
            "Two lattices, horizons and spacings {HORIZONS}:1, a layer of elements one (larger) spacing thick between them, elements around. asymmetry: |K - K'|/|K|; forces, moments: sums \
             under a random displacement over the sums of their sizes; residual: affine force per volume over E|G|/h"
        ),
        Columns::ByQuantity,
    );
    let pairwise = Law::BondBased(Micromodulus::InverseDistance);
    for law in [pairwise, Law::StateBased(INFLUENCE)] {
        for ratio in [2, 3] {
            table.rows.extend(property_rows::<1>(law, ratio));
            table.rows.extend(property_rows::<2>(law, ratio));
        }
        if effort == Effort::Full {
            table.rows.extend(property_rows::<3>(law, 2));
        }
    }
    table
}

/// Junction of two horizons along a bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meeting {
    /// A layer of elements, so many larger spacings thick.
    Layer(u32),
    /// The horizon jumps on one lattice of the smaller spacing; bonds count from both of their ends.
    Jump,
    /// The horizon jumps on one lattice of the smaller spacing; every point takes the row of its own horizon.
    Splice,
    /// As [`Meeting::Jump`], with the partial stress of points in a bridge of one larger horizon on either side.
    Bridge,
    /// One horizon, the larger, on the lattice of the smaller spacing: no meeting.
    Larger,
    /// The smaller horizon on that lattice.
    Smaller,
    /// The larger horizon on its own lattice throughout.
    Coarse,
}

impl Meeting {
    fn name(self) -> String {
        match self {
            Self::Layer(n) => format!("layer of {n} h"),
            Self::Jump => "jump of the horizon, bonds from both ends".to_owned(),
            Self::Splice => "jump of the horizon, own rows (splice)".to_owned(),
            Self::Bridge => "jump of the horizon, partial stress".to_owned(),
            Self::Smaller => "smaller horizon, one lattice".to_owned(),
            Self::Larger => "larger horizon, one lattice".to_owned(),
            Self::Coarse => "larger horizon, its own lattice".to_owned(),
        }
    }
}

/// A bar of spacing 1, modulus 1 and density 1 from −`half` to `half` as a scene; the horizon changes at 0, larger on the left.
fn bar_scene(meeting: Meeting, half: u32, ratio: u32) -> String {
    let fine = 1.0 / f64::from(HORIZONS);
    let (large, small) = (f64::from(ratio), f64::from(ratio) * fine);
    let end = f64::from(half);
    let between = |from: f64, to: f64| typed::cuboid([from], [to]);
    let everywhere = "{ everywhere = true }";
    let horizon = match meeting {
        Meeting::Smaller => format!("{small:?}"),
        Meeting::Jump | Meeting::Bridge => format!("\"if(x > 0, {small:?}, {large:?})\""),
        _ => format!("{large:?}"),
    };
    let spacing = match meeting {
        Meeting::Layer(_) | Meeting::Coarse => 1.0,
        _ => fine,
    };
    let (coupling, zones) = match meeting {
        Meeting::Layer(thick) => {
            let layer = between(0.0, f64::from(thick));
            let right = between(f64::from(thick), end);
            let body = format!("inside = {right}\nspacing = {fine:?}\nhorizon = {small:?}\n");
            let nonlocal = typed::without(everywhere, &layer);
            (
                "\"truncated\"".to_owned(),
                format!("[zones]\nnonlocal = {nonlocal}\n[zones.bodies.fine]\n{body}"),
            )
        }
        Meeting::Bridge => {
            let bridge = between(-large, large);
            let nonlocal = typed::without(everywhere, &bridge);
            (
                typed::coupling(Method::Meshfree),
                format!("[zones]\nnonlocal = {nonlocal}\ntransition = {bridge}\n"),
            )
        }
        _ => ("\"nonlocal\"".to_owned(), String::new()),
    };
    format!(
        "kinematics = \"bar\"\ncoupling = {coupling}\n{}{}[peridynamics]\nhorizon = {horizon}\npoints.lattice = {{ spacing = {spacing:?}, origin = [{:?}] }}\n{zones}{}",
        typed::grid([-end], [end], [2 * half as usize]),
        typed::material(Law::BondBased(Micromodulus::InverseDistance), 1.0, POISSON),
        0.5 * spacing,
        typed::FREE
    )
}

/// The bar: how it moves, where its sites are, and its largest affine force per volume away from the ends.
fn bar(meeting: Meeting, half: u32, ratio: u32) -> Result<(LinearMotion, Vec<f64>, f64), String> {
    let laid = scene::model::<1>(&bar_scene(meeting, half, ratio), &[]);
    let laid = laid.map_err(|e| e.to_string())?;
    let mut motion = laid.motion().map_err(|e| e.to_string())?;
    let sites = &laid.model.sites;
    if meeting == Meeting::Splice {
        let (other, ..) = bar(Meeting::Smaller, half, ratio)?;
        let is_left = |s: usize| sites[s].position[0] < 0.0;
        motion.stiffness = stencils::splice(&motion.stiffness, &other.stiffness, is_left);
        motion.symmetry = Symmetry::Unsymmetric;
    }
    let x: Vec<f64> = sites.iter().map(|s| s.position[0]).collect();
    let force = motion.stiffness.multiply(&x);
    let inside = f64::from(half) - 4.0 * f64::from(ratio);
    let ghost = sites
        .iter()
        .zip(&force)
        .filter(|(s, _)| s.position[0].abs() < inside)
        .map(|(s, f)| (f / s.volume).abs())
        .fold(0.0, f64::max);
    Ok((motion, x, ghost))
}

/// Returns the displacement left behind, on the left, by a pulse `exp(−(x/w)²)` that went right past 0, by position in thousandths.
fn left_behind(
    (motion, x, _): &mut (LinearMotion, Vec<f64>, f64),
    half: u32,
    w: f64,
    step: f64,
) -> Result<Vec<(i64, f64)>, String> {
    let start = -0.5 * f64::from(half);
    let u: Vec<f64> = x
        .iter()
        .map(|x| (-((x - start) / w).powi(2)).exp())
        .collect();
    let v = x
        .iter()
        .zip(&u)
        .map(|(x, u)| 2.0 * (x - start) / (w * w) * u)
        .collect();
    let steps = (f64::from(half) / step).round() as u64;
    let params = ExplicitParams::with_step(step);
    let mut run =
        Explicit::new(motion, &Undriven, params, State::start(u, v)).map_err(|e| e.to_string())?;
    run.run(steps, &mut |_| ControlFlow::Continue(()))
        .map_err(|e| e.to_string())?;
    let u = run.into_state().u;
    let margin = 3.0 * w;
    let window = -f64::from(half) + margin..-margin;
    Ok(x.iter()
        .zip(u)
        .filter(|(x, _)| window.contains(*x))
        .map(|(x, u)| ((x * 1000.0).round() as i64, u))
        .collect())
}

/// The largest displacement that a meeting sends back, and the affine force that it leaves.
fn reflected(meeting: Meeting, width: u32, ratio: u32) -> Result<[f64; 2], String> {
    let w = f64::from(width * ratio);
    let half = (14 * width + 8) * ratio;
    let pure = match meeting {
        Meeting::Layer(_) => Meeting::Coarse,
        _ => Meeting::Larger,
    };
    let (mut ours, mut alone) = (bar(meeting, half, ratio)?, bar(pure, half, ratio)?);
    let mut step = f64::INFINITY;
    for (motion, ..) in [&ours, &alone] {
        let limit = stable_step::stable_step(motion, &[]).map_err(|e| e.to_string())?;
        step = step.min(0.95 * limit.stable);
    }
    let ghost = ours.2;
    let a = left_behind(&mut ours, half, w, step)?;
    let b = left_behind(&mut alone, half, w, step)?;
    let mut amplitude = f64::NAN;
    let mut rest = b.iter();
    for (place, u) in &a {
        if let Some((_, pure)) = rest.find(|(other, _)| other == place) {
            amplitude = amplitude.max((u - pure).abs());
        }
    }
    Ok([amplitude, ghost])
}

/// Measures the part of a pulse that two horizons reflect, from the larger one.
pub fn reflection(effort: Effort, progress: &dyn Progress) -> Table {
    progress.stage("reflection at a layer", None);
    let mut table = Table::new(
        "A pulse exp(-(x/w)^2) from horizon 4 to horizon 1 along a bar, bond-based, m = 3 (in the larger spacing h). reflected: largest displacement sent back, over the pulse's height; affine: largest affine \
         force per volume, times h/E",
        Columns::ByQuantity,
    );
    let widths: &[u32] = match effort {
        Effort::Quick => &[2, 4],
        Effort::Full => &[1, 2, 4, 8, 16],
    };
    for meeting in [
        Meeting::Layer(1),
        Meeting::Layer(3),
        Meeting::Splice,
        Meeting::Bridge,
        Meeting::Jump,
    ] {
        for &width in widths {
            let name = format!("{}, w = {width} delta", meeting.name());
            match reflected(meeting, width, 3) {
                Ok([amplitude, ghost]) => {
                    table.push(TableRow::info(&name, "reflected", amplitude));
                    table.push(match meeting {
                        Meeting::Layer(_) => {
                            TableRow::at_most(&name, "affine", ghost, AFFINE_LIMIT)
                        }
                        _ => TableRow::info(&name, "affine", ghost),
                    });
                }
                Err(why) => table.push(TableRow::refused(&name, "reflected", why)),
            }
        }
    }
    table
}

/// The suite `layers`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let tables = vec![properties(effort, progress), reflection(effort, progress)];
    progress.finish();
    tables
}
