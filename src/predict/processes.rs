//! What each of several processes will have of a scene.

use rayon::prelude::*;
use rustc_hash::FxHashSet;
use serde::Serialize;

use crate::coupling::Model;
use crate::observe::summary::{bytes_text, grouped};
use crate::progress::Progress;
use crate::run::chosen::with_choice;
use crate::run::motion::dynamic_system::{LayoutStart, dynamic};
use crate::run::motion::{Sharing, may_share, moves_own_sites};
use crate::run::{AnyScene, RunError, setup};
use crate::scene::{Scene, Solve};
use crate::system::Partition;

/// Bytes of a scalar of a sparse matrix in memory: its value and its column.
const SCALAR: u64 = 12;

/// What one of several processes has.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProcessShare {
    /// Sites whose rows it computes.
    pub sites: usize,
    /// Sites of other processes whose displacements these rows need, or the forces of these sites where each process moves its own.
    pub ghosts: usize,
    /// Blocks of these rows: bonds, and pairs of nodes of an element; where points alone move in time, bonds.
    pub blocks: usize,
    /// What its part of the stiffness takes \[bytes\], without factors or coarse levels; zero of a scene in time, which assembles none.
    pub stiffness_bytes: u64,
    /// What it receives for each product with the stiffness, or for each step in time \[bytes\]: the numbers of its ghosts, or of all sites that others have.
    pub received_bytes: u64,
}

/// What each of `count` processes will have of a scene, by their number.
///
/// # Errors
/// [`RunError`] if the model cannot be built, as a run would.
pub fn processes(
    scene: AnyScene,
    count: usize,
    progress: &dyn Progress,
) -> Result<Vec<ProcessShare>, RunError> {
    scene.fits()?;
    match scene {
        AnyScene::Bar(s) => with_choice(s.scene, |s| shares(s, count, progress)),
        AnyScene::Plane(s) => with_choice(s.scene, |s| shares(s, count, progress)),
        AnyScene::Solid(s) => with_choice(s.scene, |s| shares(s, count, progress)),
    }
}

fn shares<const D: usize>(
    scene: Scene<D>,
    count: usize,
    progress: &dyn Progress,
) -> Result<Vec<ProcessShare>, RunError> {
    let is_static = scene.solve == Solve::Static;
    let explicit = match &scene.solve {
        Solve::Explicit(spec) => Some(spec.clone()),
        _ => None,
    };
    let (problem, rest) = setup::problem(scene);
    let is_shared = explicit.is_some() && may_share(&problem, &rest);
    let (model, coupling) = setup::model(problem, &rest, progress)?;
    let partition = model.partition(count, is_shared);
    let ranks = (0..partition.ranks()).into_par_iter();
    let moves_own = |spec| model.can_spread_families() && moves_own_sites(spec, &rest);
    if is_shared && explicit.as_ref().is_some_and(moves_own) {
        progress.finish();
        return Ok(ranks
            .map(|rank| of_points(&model, &partition, rank))
            .collect());
    }
    let operator = coupling.operator(&model)?;
    let system = match &explicit {
        Some(spec) if moves_own_sites(spec, &rest) => {
            let start = LayoutStart {
                sharing: Sharing::Steps,
                ..LayoutStart::default()
            };
            let (coupling, choices) = (coupling.as_ref(), &mut Vec::new());
            let operator = operator.as_ref();
            let moving = dynamic(&model, coupling, operator, &rest, start, choices, progress)?;
            Some(moving.system)
        }
        _ => None,
    };
    let pattern = model.pattern(operator.as_ref(), &[], progress);
    let of_rank = |rank: usize| {
        let own = partition.of(rank);
        let row = |site: &u32| {
            let site = *site as usize;
            &pattern.columns[pattern.row_offsets[site]..pattern.row_offsets[site + 1]]
        };
        let blocks = own.iter().map(|site| row(site).len()).sum();
        let is_foreign = |site: &u32| partition.owner(*site) != rank;
        let reached = system.as_ref().and_then(|system| {
            let sites = 0..model.sites.len() as u32;
            let own: Vec<bool> = sites.map(|site| !is_foreign(&site)).collect();
            system.sites_reached(&own)
        });
        let ghosts = match &reached {
            Some(reached) => reached.iter().filter(|is_reached| **is_reached).count() - own.len(),
            None => {
                let columns = own.iter().flat_map(row).copied();
                columns.filter(is_foreign).collect::<FxHashSet<u32>>().len()
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
            stiffness_bytes: match is_static {
                true => (blocks * D * D) as u64 * SCALAR,
                false => 0,
            },
            received_bytes: (numbers * D * 8) as u64,
        }
    };
    let all = ranks.map(of_rank).collect();
    progress.finish();
    Ok(all)
}

/// The same where each process moves its own points, and knows those of others whose displacements their forces take.
fn of_points<const D: usize>(model: &Model<D>, partition: &Partition, rank: usize) -> ProcessShare {
    let points = 0..partition.sites() as u32;
    let own: Vec<bool> = points.map(|i| partition.owner(i) == rank).collect();
    let reached = model.points_reached(&own).into_iter().zip(own);
    let ghosts = reached.filter(|(is_reached, is_own)| *is_reached && !is_own);
    let ghosts = ghosts.count();
    let sites = partition.of(rank);
    let bonds = |i: &u32| model.body().map_or(0, |b| b.families.of(*i as usize).len());
    ProcessShare {
        sites: sites.len(),
        ghosts,
        blocks: sites.iter().map(bonds).sum(),
        stiffness_bytes: 0,
        received_bytes: (ghosts * D * 8) as u64,
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
    grid
}
