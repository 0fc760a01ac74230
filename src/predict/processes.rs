//! Share of a scene that each of several processes will have.

use rustc_hash::FxHashSet;

use super::process_memory::{Spreading, divide, per_bond};
use super::process_share::ProcessShare;
use super::resource_estimate::Prediction;
use crate::observe::summary::{bytes_text, grouped};
use crate::progress::Progress;
use crate::run::chosen::with_choice;
use crate::run::equilibrium;
use crate::run::motion::dynamic_system::{LayoutStart, dynamic};
use crate::run::motion::{Sharing, may_share, may_share_rows, moves_own_sites};
use crate::run::{AnyScene, RunError, setup};
use crate::scene::{Scene, Solve};
use crate::solve::statics::Method;
use crate::system::{Partition, Ranks, SemiDiscrete, Symmetry, share_long_rows};
use crate::{assembly::Pattern, parallel};
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
    let is_static = scene.solve == Solve::Static;
    let explicit = match &scene.solve {
        Solve::Explicit(spec) => Some(spec.clone()),
        _ => None,
    };
    let (problem, rest) = setup::problem(scene);
    let is_shared = match &explicit {
        Some(_) => may_share(&problem, &rest),
        None => is_static && may_share_rows(&problem, &rest),
    };
    let (model, coupling) = setup::model(problem, &rest, progress)?;
    let Distribution { partition, why } = model.distribute(count, is_shared, partitioner);
    let has_own_families = is_shared && model.can_spread_families();
    let mut spreading = match is_static {
        // forces that are not linear are solved for by every process, with all rows
        true if rest.nonlinear(&model).is_none() => Spreading::Rows,
        false if has_own_families => Spreading::Families,
        _ => Spreading::Work,
    };
    let per_bond = f64::from(u8::from(has_own_families)) * per_bond(&model);
    let moves_own = (explicit.as_ref()).is_some_and(|spec| moves_own_sites(spec, &rest));
    if spreading == Spreading::Families && are_points(&model) && moves_own {
        progress.finish();
        let of_rank = |rank| of_points(&model, &partition, rank);
        let shares = parallel::map(partition.ranks(), 1, of_rank);
        return Ok(Processes {
            shares,
            distribution: why,
            spreading,
            per_bond,
        });
    }
    let operator = coupling.operator(&model)?;
    let system = match moves_own {
        true => {
            let start = LayoutStart {
                sharing: Sharing::Steps,
                ..LayoutStart::default()
            };
            let (coupling, choices) = (coupling.as_ref(), &mut Vec::new());
            let operator = &operator;
            let moving = dynamic(&model, coupling, operator, &rest, start, choices, progress)?;
            Some(moving.system)
        }
        false => None,
    };
    let pattern = model.pattern(&operator, &[], progress);
    if spreading == Spreading::Rows {
        spreading = of_statics(&model, coupling.as_ref(), &pattern, rest.solver.method);
    }
    let of_rank = |rank: usize| {
        let system = system.as_deref();
        let share = of_rows(&model, &partition, rank, (&pattern, system, is_static));
        ProcessShare {
            bonds: match has_own_families {
                true => bonds_held(&model, &own_points(&partition, rank)),
                false => model.bond_count(),
            },
            stiffness_bytes: match spreading {
                Spreading::Products => (share.sites * 3usize.pow(D as u32) * D * D) as u64 * SCALAR,
                _ => share.stiffness_bytes,
            },
            ..share
        }
    };
    let shares = parallel::map(partition.ranks(), 1, of_rank);
    progress.finish();
    Ok(Processes {
        shares,
        distribution: why,
        spreading,
        per_bond,
    })
}

/// Returns true if every site is a point.
fn are_points<const D: usize>(model: &Model<D>) -> bool {
    (0..model.sites.len()).all(|site| model.point_of(site).is_some())
}

/// Distribution of a static scene with linear forces over processes: PETSc has its factors, products or rows.
fn of_statics<const D: usize>(
    model: &Model<D>,
    coupling: &dyn Coupling<D>,
    pattern: &Pattern,
    method: Method,
) -> Spreading {
    let sites = model.sites.len();
    let counts = [sites, pattern.stored, pattern.distinct].map(|n| n as f64);
    let symmetry = equilibrium::symmetry(coupling, || pattern.asymmetry, &mut Vec::new());
    match method {
        Method::Direct => Spreading::Factors,
        _ if symmetry == Symmetry::Symmetric
            && model.is_lattice()
            && are_points(model)
            && share_long_rows(D, counts) =>
        {
            Spreading::Products
        }
        _ => Spreading::Rows,
    }
}

/// Share of a process that has the rows of its own sites; `system` is the one that moves by them, if there is one.
fn of_rows<const D: usize>(
    model: &Model<D>,
    partition: &Partition,
    rank: usize,
    (pattern, system, is_static): (&Pattern, Option<&dyn SemiDiscrete>, bool),
) -> ProcessShare {
    let own = partition.of(rank);
    let row = |site: &u32| {
        let site = *site as usize;
        &pattern.columns[pattern.row_offsets[site]..pattern.row_offsets[site + 1]]
    };
    let blocks: usize = own.iter().map(|site| row(site).len()).sum();
    let reached = system.and_then(|system| system.sites_reached(&own_points(partition, rank)));
    let ghosts = match &reached {
        Some(reached) => reached.iter().filter(|is_reached| **is_reached).count() - own.len(),
        None => {
            let columns = own.iter().flat_map(row).copied();
            let foreign = columns.filter(|site| partition.owner(*site) != rank);
            foreign.collect::<FxHashSet<u32>>().len()
        }
    };
    let numbers = match is_static || reached.is_some() {
        true => ghosts,
        // forces are gathered
        false => model.sites.len() - own.len(),
    };
    ProcessShare {
        sites: own.len(),
        ghosts,
        blocks,
        bonds: 0,
        stiffness_bytes: match is_static {
            true => (blocks * D * D) as u64 * SCALAR,
            false => 0,
        },
        received_bytes: (numbers * D * 8) as u64,
        memory_bytes: 0,
    }
}

fn own_points(partition: &Partition, rank: usize) -> Vec<bool> {
    let sites = 0..partition.sites() as u32;
    sites.map(|site| partition.owner(site) == rank).collect()
}

fn bonds_of<const D: usize>(model: &Model<D>, point: usize) -> usize {
    model.body().map_or(0, |b| b.families.of(point).len())
}

/// Bonds of the families that a process with these points holds where families are spread over processes.
fn bonds_held<const D: usize>(model: &Model<D>, own: &[bool]) -> usize {
    let held = model.points_held(own);
    let held = (0..held.len()).filter(|&i| held[i]);
    held.map(|i| bonds_of(model, i)).sum()
}

/// The same where each process moves its own points, and knows those of others whose displacements their forces take.
fn of_points<const D: usize>(model: &Model<D>, partition: &Partition, rank: usize) -> ProcessShare {
    let own = own_points(partition, rank);
    let reached = model.points_reached(&own).into_iter().zip(&own);
    let ghosts = reached.filter(|(is_reached, is_own)| *is_reached && !**is_own);
    let ghosts = ghosts.count();
    let sites = partition.of(rank);
    ProcessShare {
        sites: sites.len(),
        ghosts,
        blocks: sites.iter().map(|&i| bonds_of(model, i as usize)).sum(),
        bonds: bonds_held(model, &own),
        stiffness_bytes: 0,
        received_bytes: (ghosts * D * 8) as u64,
        memory_bytes: 0,
    }
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
