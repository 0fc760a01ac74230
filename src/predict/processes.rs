//! Share of a scene that each of several processes will have.

use super::process_memory::{Spreading, divide, per_bond};
use super::resource_estimate::{Prediction, ProcessShare};
use crate::observe::summary::{bytes_text, grouped};
use crate::parallel;
use crate::progress::Progress;
use crate::run::chosen::with_choice;
use crate::run::equilibrium;
use crate::run::motion::dynamic_system::{LayoutStart, dynamic};
use crate::run::motion::{Sharing, has_one_stage, may_share, may_share_rows, moves_own_sites};
use crate::run::{AnyScene, RunError, setup};
use crate::scene::{Scene, Solve};
use crate::solve::statics::Method;
use crate::system::{BlockCsr, Ranks, Symmetry, share_long_rows};
use crate::{
    coupling::Coupling,
    model::{Distribution, Model},
};

/// Bytes of a scalar of a sparse matrix in memory: its value and its column.
const SCALAR: u64 = 12;

/// Shares of several processes in a scene, their memory aside.
#[derive(Clone, Debug)]
pub struct Processes {
    shares: Vec<ProcessShare>,
    distribution: String,
    spreading: Spreading,
    /// Bytes of each bond of a family that others hold; zero where every process has all families.
    per_bond: f64,
}

impl Processes {
    /// Share of each process, by its number; its memory is zero.
    pub fn shares(&self) -> &[ProcessShare] {
        &self.shares
    }

    /// Rule by which sites are distributed, and its reason.
    pub fn distribution(&self) -> &str {
        &self.distribution
    }

    /// The same with the memory of each, where one process would need `alone`.
    pub fn with_memory(mut self, alone: &Prediction) -> Vec<ProcessShare> {
        divide(&mut self.shares, self.spreading, self.per_bond, alone);
        self.shares
    }
}

/// Predicts the shares of `count` processes in a scene; `partitioner` is a process that can cut graphs, without which sites are distributed by bisection.
///
/// # Errors
/// [`RunError`] if the model cannot be built, as a run would.
pub fn processes(
    scene: AnyScene,
    count: usize,
    partitioner: Option<&dyn Ranks>,
    progress: &dyn Progress,
) -> Result<Processes, RunError> {
    scene.fits()?;
    match scene {
        AnyScene::Bar(s) => with_choice(s.scene, |s| shares(s, count, partitioner, progress)),
        AnyScene::Plane(s) => with_choice(s.scene, |s| shares(s, count, partitioner, progress)),
        AnyScene::Solid(s) => with_choice(s.scene, |s| shares(s, count, partitioner, progress)),
    }
}

fn shares<const D: usize>(
    scene: Scene<D>,
    count: usize,
    partitioner: Option<&dyn Ranks>,
    progress: &dyn Progress,
) -> Result<Processes, RunError> {
    has_one_stage(&scene)?;
    let is_static = scene.solve == Solve::Static;
    let explicit = scene.solve.motion().cloned();
    let (problem, rest) = setup::problem(scene);
    let is_shared = match &explicit {
        Some(_) => may_share(&problem, &rest),
        None => is_static && may_share_rows(&problem, &rest),
    };
    let (model, coupling) = setup::model(problem, &rest, progress)?;
    let Distribution { partition, why } = model.distribute(count, is_shared, partitioner);
    let has_own_families = is_shared && model.can_spread_families();
    let operator = coupling.operator(&model)?;
    // forces that are not linear are solved for by every process, with all rows
    let has_rows = is_static && rest.nonlinear(&model).is_none();
    let rows = has_rows.then(|| model.assemble(&operator, progress));
    let spreading = match &rows {
        Some(rows) => of_statics(&model, coupling.as_ref(), rows, rest.solver.method),
        None if has_own_families && !is_static => Spreading::Families,
        None => Spreading::Work,
    };
    let moves_own = (explicit.as_ref()).is_some_and(|spec| moves_own_sites(spec, &rest));
    let mut system = None;
    if moves_own {
        let start = LayoutStart {
            sharing: Sharing::Steps,
            ..LayoutStart::default()
        };
        let (coupling, told) = (coupling.as_ref(), &mut Vec::new());
        system = Some(dynamic(&model, coupling, &operator, &rest, start, told, progress)?.system);
    }
    let work = model.work_of_sites();
    let of_rank = |rank: usize| {
        let sites = partition.of(rank);
        let own = (0..model.sites.len() as u32).map(|site| partition.owner(site) == rank);
        let own: Vec<bool> = own.collect();
        let (reached, blocks) = match &rows {
            Some(rows) => of_rows(rows, sites, &own),
            None => {
                let reached = system.as_ref().and_then(|s| s.sites_reached(&own));
                let blocks = sites.iter().map(|&i| work[i as usize] as usize).sum();
                // else forces are gathered
                (reached.unwrap_or_else(|| vec![true; own.len()]), blocks)
            }
        };
        let ghosts = reached.iter().filter(|is_reached| **is_reached).count() - sites.len();
        let stored = match spreading {
            Spreading::Work | Spreading::Families => 0,
            Spreading::Products => sites.len() * 3usize.pow(D as u32),
            Spreading::Factors | Spreading::Rows => blocks,
        };
        ProcessShare {
            sites: sites.len(),
            ghosts,
            blocks,
            bonds: match has_own_families {
                true => bonds_held(&model, &own),
                false => model.bond_count(),
            },
            stiffness_bytes: (stored * D * D) as u64 * SCALAR,
            received_bytes: (ghosts * D * 8) as u64,
            memory_bytes: 0,
        }
    };
    let shares = parallel::map(partition.ranks(), 1, of_rank);
    progress.finish();
    Ok(Processes {
        shares,
        distribution: why,
        spreading,
        per_bond: f64::from(u8::from(has_own_families)) * per_bond(&model),
    })
}

/// Distribution of a static scene with linear forces over processes: PETSc has its factors, products or rows.
fn of_statics<const D: usize>(
    model: &Model<D>,
    coupling: &dyn Coupling<D>,
    rows: &BlockCsr,
    method: Method,
) -> Spreading {
    let distinct = rows.values.len() / (D * D);
    let counts = [rows.rows(), rows.columns.len(), distinct].map(|n| n as f64);
    let symmetry = equilibrium::symmetry(coupling, || rows.asymmetry(), &mut Vec::new());
    let are_points = || (0..model.sites.len()).all(|site| model.point_of(site).is_some());
    match method {
        Method::Direct => Spreading::Factors,
        _ if symmetry == Symmetry::Symmetric
            && model.is_lattice()
            && are_points()
            && share_long_rows(D, counts) =>
        {
            Spreading::Products
        }
        _ => Spreading::Rows,
    }
}

/// Own sites and all that their rows see, and the number of blocks of these rows that are not zero.
fn of_rows(rows: &BlockCsr, sites: &[u32], own: &[bool]) -> (Vec<bool>, usize) {
    let (mut reached, mut blocks) = (own.to_vec(), 0);
    for &site in sites {
        let (columns, values) = rows.row(site as usize);
        for (&column, block) in columns.iter().zip(values.chunks(rows.block.pow(2))) {
            if block.iter().any(|&k| k != 0.0) {
                reached[column as usize] = true;
                blocks += 1;
            }
        }
    }
    (reached, blocks)
}

/// Bonds of the families that a process with these sites holds where families are spread over processes.
fn bonds_held<const D: usize>(model: &Model<D>, own: &[bool]) -> usize {
    let held = model.points_held(own).into_iter().enumerate();
    let of = |(i, is_held): (usize, bool)| match (is_held, model.body()) {
        (true, Some(body)) => body.families.of(i).len(),
        _ => 0,
    };
    held.map(of).sum()
}

/// The least, the mean and the most of what processes have, as a table.
pub(super) fn table(shares: &[ProcessShare]) -> Vec<Vec<String>> {
    let plain = |n: u64| grouped(n as usize);
    let kibibytes = |n: u64| format!("{} KiB", grouped(n.div_ceil(1024) as usize));
    let line = |name: &str, of: &dyn Fn(&ProcessShare) -> u64, text: &dyn Fn(u64) -> String| {
        let all = shares.iter().map(of);
        let mean = all.clone().sum::<u64>() / shares.len().max(1) as u64;
        let ends = [all.clone().min(), Some(mean), all.max()];
        let ends = ends.map(|n| text(n.unwrap_or(0)));
        std::iter::once(name.to_owned()).chain(ends).collect()
    };
    let head = [
        &*format!("of {} processes", shares.len()),
        "least",
        "mean",
        "most",
    ];
    let mut grid = vec![head.map(str::to_owned).to_vec()];
    grid.push(line("sites", &|s| s.sites as u64, &plain));
    grid.push(line("ghosts", &|s| s.ghosts as u64, &plain));
    grid.push(line("blocks", &|s| s.blocks as u64, &plain));
    grid.push(line("bonds held", &|s| s.bonds as u64, &plain));
    if shares.iter().any(|s| s.stiffness_bytes > 0) {
        grid.push(line("stiffness", &|s| s.stiffness_bytes, &bytes_text));
        grid.push(line(
            "received per product",
            &|s| s.received_bytes,
            &kibibytes,
        ));
    } else {
        grid.push(line("received per step", &|s| s.received_bytes, &kibibytes));
    }
    grid.push(line("peak memory", &|s| s.memory_bytes, &bytes_text));
    grid
}
