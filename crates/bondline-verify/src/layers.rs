//! Several horizons in one body: lattices with a layer of finite elements between them.
//!
//! A body whose horizon jumps is either reciprocal or passes the patch test, not both: with bonds taken from both ends forces are pairwise, but a point beside the jump sees
//! half of its bonds with another stiffness. Two lattices that end on the faces of a layer of elements, by truncated bonds, do both.

use std::{ops::ControlFlow, sync::Arc};

use crate::{
    Effort,
    enclosed::{Enclosed, INFLUENCE, Law, SPACING},
    patch::{affine_residual, solution_error},
    tangents::momentum,
};
use bondline::{
    coupling::{
        Coupling, Lattice, Model, Nonlocal, PartialStressMeshfree, Peridynamics, PointSource,
        Problem, Surfaces, Truncated, Zone,
    },
    mesh::generate::{Axis, Grid},
    observe::report::{Columns, Row, Table},
    peridynamics::{BondWeights, Micromodulus, PartialVolume},
    progress::{Progress, Silent},
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
pub fn bodies<const D: usize>(law: Law, ratio: u32) -> Result<Enclosed<D>, String> {
    // half of the block, of the peridynamic zone, in cells; the layer is the cell right of the middle
    let (half, zone): (u32, u32) = if D == 3 { (5, 3) } else { (11, 7) };
    let grid = Grid::<D>::new(std::array::from_fn(|_| Axis::Uniform {
        min: -f64::from(half) * SPACING,
        max: f64::from(half) * SPACING,
        cells: 2 * half as usize,
    }));
    let mesh = grid.mesh().map_err(|e| e.to_string())?;
    let (mut zones, mut of_cell) = (Vec::new(), Vec::new());
    for c in 0..mesh.cell_count() {
        let x = mesh.centroid(c) / SPACING;
        let is_layer = x[0] > 0.0 && x[0] < 1.0;
        zones.push(if x.amax() < f64::from(zone) && !is_layer {
            Zone::Nonlocal
        } else {
            Zone::Local
        });
        of_cell.push(u16::from(x[0] > 0.0));
    }
    let lattice = |spacing: f64| Lattice {
        spacing,
        origin: Vector::repeat(0.5 * spacing),
        horizon: f64::from(ratio) * spacing,
    };
    let lattices = vec![lattice(SPACING), lattice(SPACING / f64::from(HORIZONS))];
    let law = law.law::<D>();
    let tensor = *law.linearised().tensor();
    let horizon = lattices[0].horizon;
    let problem = Problem {
        cell_material: vec![0; mesh.cell_count()],
        mesh,
        zones,
        tensors: vec![tensor],
        peridynamic_material: 0,
        peridynamics: Some(Peridynamics {
            law,
            horizon: Arc::new(move |_| horizon),
            points: PointSource::Lattices { lattices, of_cell },
            weights: BondWeights::Isotropic,
            volumes: PartialVolume::Full,
            barriers: Vec::new(),
            voids: Vec::new(),
            surfaces: Surfaces::Cut,
        }),
        coupling: Box::new(Truncated::default()),
    };
    let (model, coupling) = Model::new(problem, &Silent).map_err(|e| e.to_string())?;
    let stiffness = {
        let operator = coupling.operator(&model).map_err(|e| e.to_string())?;
        model.assemble(operator.as_ref(), &Silent)
    };
    Ok(Enclosed {
        model,
        stiffness,
        half: f64::from(half) * SPACING,
        tensor,
    })
}

fn property_rows<const D: usize>(law: Law, ratio: u32) -> Vec<Row> {
    let name = format!("{D}D {}, m = {ratio}", law.name());
    let e = match bodies::<D>(law, ratio) {
        Ok(e) => e,
        Err(why) => {
            return vec![Row::at_most(name, "residual", f64::NAN, AFFINE_LIMIT).because(why)];
        }
    };
    let places: Vec<Vector<D>> = e.positions().copied().collect();
    let (forces, moments) = momentum(&e.stiffness, &places);
    let mut rows = vec![
        Row::at_most(
            &name,
            "asymmetry",
            e.stiffness.asymmetry(),
            RECIPROCITY_LIMIT,
        ),
        Row::at_most(&name, "forces", forces, RECIPROCITY_LIMIT),
        Row::at_most(&name, "residual", affine_residual(&e), AFFINE_LIMIT),
        Row::info(&name, "sites", e.model.sites.len() as f64),
    ];
    if D > 1 {
        rows.push(Row::at_most(&name, "moments", moments, RECIPROCITY_LIMIT));
    }
    rows.push(match solution_error(&e) {
        Ok(error) => Row::at_most(&name, "solution error", error, 1e-9),
        Err(why) => Row::at_most(&name, "solution error", f64::NAN, 1e-9).because(why),
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

/// How two horizons meet along a bar.
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

/// A bar of spacing 1 and modulus 1 from −`half` to `half`; the horizon changes at 0, larger on the left.
fn bar(meeting: Meeting, half: u32, ratio: u32) -> Result<(LinearMotion, Vec<f64>, f64), String> {
    let fine = 1.0 / f64::from(HORIZONS);
    let (large, small) = (f64::from(ratio), f64::from(ratio) * fine);
    let grid = Grid::<1>::new([Axis::Uniform {
        min: -f64::from(half),
        max: f64::from(half),
        cells: 2 * half as usize,
    }]);
    let mesh = grid.mesh().map_err(|e| e.to_string())?;
    let layer = match meeting {
        Meeting::Layer(n) => n,
        _ => 0,
    };
    let x: Vec<f64> = (0..mesh.cell_count())
        .map(|c| mesh.centroid(c)[0])
        .collect();
    let zones: Vec<Zone> = x
        .iter()
        .map(|&x| {
            if x > 0.0 && x < f64::from(layer) {
                Zone::Local
            } else if meeting == Meeting::Bridge && x.abs() < large {
                Zone::Transition
            } else {
                Zone::Nonlocal
            }
        })
        .collect();
    let lattice = |spacing: f64| Lattice {
        spacing,
        origin: Vector::repeat(0.5 * spacing),
        horizon: f64::from(ratio) * spacing,
    };
    let one = |spacing: f64| PointSource::Lattice {
        spacing,
        origin: Vector::repeat(0.5 * spacing),
    };
    let points = match meeting {
        Meeting::Layer(_) => PointSource::Lattices {
            lattices: vec![lattice(1.0), lattice(fine)],
            of_cell: x.iter().map(|&x| u16::from(x > 0.0)).collect(),
        },
        Meeting::Coarse => one(1.0),
        _ => one(fine),
    };
    let law = bondline::peridynamics::BondBased::<1>::new(Micromodulus::InverseDistance, 1.0 / 3.0);
    let coupling: Box<dyn Coupling<1>> = match meeting {
        Meeting::Layer(_) => Box::new(Truncated::default()),
        Meeting::Bridge => Box::new(PartialStressMeshfree {
            influence: INFLUENCE,
        }),
        _ => Box::new(Nonlocal),
    };
    let problem = Problem {
        cell_material: vec![0; mesh.cell_count()],
        mesh,
        zones,
        tensors: vec![*bondline::peridynamics::LinearForceState::tensor(&law)],
        peridynamic_material: 0,
        peridynamics: Some(Peridynamics {
            law: Arc::new(law),
            horizon: Arc::new(move |x| match meeting {
                Meeting::Smaller => small,
                Meeting::Jump | Meeting::Bridge if x[0] > 0.0 => small,
                _ => large,
            }),
            points,
            weights: BondWeights::Isotropic,
            volumes: PartialVolume::Full,
            barriers: Vec::new(),
            voids: Vec::new(),
            surfaces: Surfaces::Cut,
        }),
        coupling,
    };
    let (model, coupling) = Model::new(problem, &Silent).map_err(|e| e.to_string())?;
    let operator = coupling.operator(&model).map_err(|e| e.to_string())?;
    let mut stiffness = model.assemble(operator.as_ref(), &Silent);
    let mut symmetry = coupling.symmetry();
    if meeting == Meeting::Splice {
        let (other, ..) = bar(Meeting::Smaller, half, ratio)?;
        let is_left = |s: usize| model.sites[s].position[0] < 0.0;
        stiffness = stencils::splice(&stiffness, &other.stiffness, is_left);
        symmetry = Symmetry::Unsymmetric;
    }
    let x: Vec<f64> = model.sites.iter().map(|s| s.position[0]).collect();
    let volumes = model.sites.iter().map(|s| s.volume).collect();
    // largest affine force per volume away from the ends
    let force = stiffness.multiply(&x);
    let ghost = model
        .sites
        .iter()
        .zip(&force)
        .filter(|(s, _)| s.position[0].abs() < f64::from(half) - 4.0 * large)
        .map(|(s, f)| (f / s.volume).abs())
        .fold(0.0, f64::max);
    let motion = LinearMotion {
        stiffness,
        mass: volumes,
        symmetry,
    };
    Ok((motion, x, ghost))
}

/// What is left, on the left, of a pulse `exp(−(x/w)²)` that went right past 0: displacement by position in thousandths.
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

/// What two horizons send back of a pulse that comes from the larger one.
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
                    table.push(Row::info(&name, "reflected", amplitude));
                    table.push(match meeting {
                        Meeting::Layer(_) => Row::at_most(&name, "affine", ghost, AFFINE_LIMIT),
                        _ => Row::info(&name, "affine", ghost),
                    });
                }
                Err(why) => table.push(Row::refused(&name, "reflected", why)),
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
