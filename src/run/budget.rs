//! Memory that a run may take, and the needs of a scene, counted before anything is laid out.
//!
//! Points follow from the volume of the cells that hold them, bonds from points times the size of a family, the stiffness from the families that a row
//! sees. None of this needs the points themselves, so a spacing that is ten times too small is refused in milliseconds instead of ending in an allocation
//! that fails. `src/predict/` counts exactly once the model is laid out.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::mesh::Mesh;
use crate::model::{CellRole, PointSource, Reach};
use crate::observe::report::number;
use crate::observe::summary::{bytes_text, grouped, resident_memory_bytes};
use crate::peridynamics::BondWeights;
use crate::run::error::RunError;
use crate::scene::Peridynamics;
use crate::scene::solve::Solve;
use crate::scene::temperature::TemperatureValue;
use crate::scene::validated::Scene;
use serde::Serialize;

/// A share of the memory of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// Name of the item that holds it.
    pub name: &'static str,
    /// Bytes.
    pub bytes: u64,
}

impl Share {
    /// The bytes of an item.
    pub(crate) fn new(name: &'static str, bytes: u64) -> Self {
        Self { name, bytes }
    }
}

/// Bytes that [`set_memory_budget`] has set; no limit of its own while zero.
static TYPED: AtomicU64 = AtomicU64::new(0);

/// Limits the memory of this process to so many bytes, instead of what the system can still give.
///
/// One limit for the process, as memory belongs to the process: every run, check and pilot in it counts against the same bytes.
pub fn set_memory_budget(bytes: u64) {
    TYPED.store(bytes.max(1), Ordering::Relaxed);
}

/// Bytes that this process may hold: the limit that was set, else what it holds already and what the system can still give; `None` where the system
/// does not tell.
pub fn memory_budget() -> Option<u64> {
    match TYPED.load(Ordering::Relaxed) {
        0 => Some(available_memory()? + resident_memory_bytes().unwrap_or(0)),
        typed => Some(typed),
    }
}

/// Bytes of the budget that this process does not hold yet.
pub(crate) fn memory_left() -> Option<u64> {
    Some(memory_budget()?.saturating_sub(resident_memory_bytes().unwrap_or(0)))
}

/// Bytes that the system can still give, to the machine or to the control group that this process belongs to, whichever has less.
fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    let machine = kibibytes * 1024;
    Some(control_group().map_or(machine, |group| group.min(machine)))
}

/// Bytes left below the limit of the control group, if it has one. Pages of files that it can drop count as free.
fn control_group() -> Option<u64> {
    let number = |name: &str| -> Option<u64> {
        let text = std::fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok()?;
        text.trim().parse().ok()
    };
    let (most, held) = (number("memory.max")?, number("memory.current")?);
    let stat = std::fs::read_to_string("/sys/fs/cgroup/memory.stat").unwrap_or_default();
    let files = stat.lines().find_map(|l| l.strip_prefix("inactive_file "));
    let files: u64 = files.and_then(|f| f.trim().parse().ok()).unwrap_or(0);
    Some(most.saturating_sub(held.saturating_sub(files)))
}

/// Sizes of a scene, counted from volumes.
///
/// Points within a hundredth where cells are larger than the spacing; bonds within a tenth of those of whole families from a horizon of two spacings on, and near surfaces fewer exist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Cells of the mesh.
    pub cells: usize,
    /// Peridynamic points that are sites.
    pub points: f64,
    /// Points in and around elements, which complete families and keep no unknowns.
    pub ghosts: f64,
    /// Directed bonds of the sites.
    pub bonds: f64,
    /// Directed bonds that the search for families finds, those of `ghosts` included.
    pub searched: f64,
    /// Places of the lattice that are looked at: those of the box around the zone.
    pub looked_at: f64,
    /// Unknowns, those that supports hold included.
    pub dofs: f64,
    /// Scalars of the assembled stiffness.
    pub nonzeros: f64,
    /// Bytes of heat conduction: a temperature per node and instant, matrices and gradients.
    heat: f64,
    /// True if the rows of points couple to the families of their neighbours as well.
    is_state_based: bool,
    /// True if the run takes steps, each of which traverses the bonds.
    is_moving: bool,
    /// True if equal bonds share their weights.
    is_lattice: bool,
}

impl Counts {
    /// The counts of a scene.
    pub fn of<const D: usize>(scene: &Scene<D>) -> Self {
        let mesh = &scene.mesh;
        let mut counts = Self {
            nodes: mesh.nodes.len(),
            cells: mesh.cell_count(),
            is_moving: scene.solve != Solve::Static,
            heat: heat(scene),
            ..Self::default()
        };
        let of_elements = |nodes: f64| nodes * 3f64.powi(D as i32) * (D * D) as f64;
        let (Some(p), Some(law)) = (&scene.peridynamics, &scene.point_law) else {
            counts.dofs = (mesh.nodes.len() * D) as f64;
            counts.nonzeros = of_elements(mesh.nodes.len() as f64);
            return counts;
        };
        let law = law.linearised();
        let coupling = scene.coupling.build(law);
        let horizon: Vec<f64> = (0..mesh.cell_count())
            .map(|c| p.horizon_at(&mesh.centroid(c)))
            .collect();
        let largest = horizon.iter().copied().fold(0.0, f64::max);
        let roles = coupling.roles(mesh, &scene.zones, largest);
        let reach = coupling.reach(law);
        counts.is_state_based = !law.is_pairwise();
        counts.is_lattice = !matches!(p.points, PointSource::Cells)
            && p.weights != BondWeights::Fitted
            && p.horizon.as_constant().is_some();

        let around_elements = counts.add_families(mesh, p, &roles, &horizon);
        let levels = if reach == Reach::Own { 1.0 } else { 2.0 };
        let spacing = match &p.points {
            PointSource::Cells => None,
            PointSource::Lattice { spacing, .. } => Some(*spacing),
            PointSource::Lattices { lattices, .. } => {
                (lattices.iter().map(|l| l.spacing)).min_by(f64::total_cmp)
            }
        };
        let around = spacing.map(|h| (h, levels * largest));
        let is_continued = coupling.interface().faces;
        (counts.ghosts, counts.looked_at) = match around {
            Some((h, margin)) => beside(mesh, &roles, h, margin, is_continued),
            None => ((mesh.cell_count() as f64 - counts.points).max(0.0), 0.0),
        };
        let all = counts.points + counts.ghosts;
        // no family is larger than all points together
        let most = |bonds: f64, of: f64| bonds.min(of * (all - 1.0).max(0.0));
        let mean = if counts.points > 0.0 {
            counts.bonds / counts.points
        } else {
            0.0
        };
        counts.searched = most(all * mean, all) + around_elements;
        counts.bonds = most(counts.bonds, counts.points);
        let elements = roles.iter().filter(|r| **r != CellRole::Points).count() as f64;
        let nodes = (mesh.nodes.len() as f64 * elements / mesh.cell_count().max(1) as f64).ceil();
        counts.dofs = (nodes + counts.points) * D as f64;
        let row = if counts.is_state_based {
            mean * f64::from(1 << D)
        } else {
            mean
        };
        let blocks = (row + 1.0).min(nodes + counts.points);
        counts.nonzeros = of_elements(nodes) + counts.points * blocks * (D * D) as f64;
        counts
    }

    /// Adds points and their bonds by the volume of the cells; returns the bonds of families around Gauss points.
    fn add_families<const D: usize>(
        &mut self,
        mesh: &Mesh<D>,
        p: &Peridynamics<D>,
        roles: &[CellRole],
        horizon: &[f64],
    ) -> f64 {
        let corners = (1 << D) as f64;
        // families around Gauss points are as large as those of points, and one for each corner of an element
        let mut around_elements = 0.0;
        for (c, role) in roles.iter().enumerate() {
            let volume = mesh.cell_volume(c).abs();
            let (spacing, delta) = match &p.points {
                PointSource::Cells => (volume.powf(1.0 / D as f64), horizon[c]),
                PointSource::Lattice { spacing, .. } => (*spacing, horizon[c]),
                PointSource::Lattices { lattices, of_cell } => {
                    let own = &lattices[usize::from(of_cell[c])];
                    (own.spacing, own.horizon)
                }
            };
            let family = || family_size::<D>(delta / spacing);
            match role {
                CellRole::Points => {
                    let points = volume / spacing.powi(D as i32);
                    self.points += points;
                    self.bonds += points * family();
                }
                CellRole::StressElement => around_elements += corners * family(),
                CellRole::Element => {}
            }
        }
        around_elements
    }

    /// The memory that the counts ask for; what of it is held at the same time, [`Counts::peak`] sums.
    pub fn memory(&self) -> Vec<Share> {
        let share = |name, bytes: f64| Share::new(name, bytes as u64);
        let state = f64::from(u8::from(self.is_state_based));
        let mut list = vec![
            share(
                "mesh",
                PER_CELL * self.cells as f64 + PER_NODE * self.nodes as f64,
            ),
            share(
                "points",
                PER_POINT * (self.points + self.ghosts) + PER_PLACE * self.looked_at,
            ),
            share(
                "bonds",
                PER_SEARCHED * self.searched + (PER_BOND + state * PER_STATE_BOND) * self.bonds,
            ),
        ];
        if self.heat > 0.0 {
            list.push(share("temperatures", self.heat));
        }
        if self.is_moving {
            let per_bond = if self.is_lattice {
                PER_LATTICE_PASS
            } else {
                PER_LISTED_PASS
            };
            list.push(share("passes", per_bond * self.bonds));
        } else {
            list.push(share("stiffness", PER_NONZERO * self.nonzeros));
            list.push(share("solver", SOLVER * self.nonzeros));
        }
        list
    }

    /// Bytes without stiffness and solver.
    pub fn base(&self) -> u64 {
        let shares = self.memory().into_iter();
        let base = shares.filter(|s| !["stiffness", "solver"].contains(&s.name));
        base.map(|s| s.bytes).sum()
    }

    /// Bytes that the counts ask for together.
    pub fn peak(&self) -> u64 {
        self.memory().iter().map(|s| s.bytes).sum()
    }
}

/// Bytes of heat conduction, if the scene has it.
fn heat<const D: usize>(scene: &Scene<D>) -> f64 {
    let value = scene.temperature.as_ref().map(|t| &t.value);
    let Some(TemperatureValue::Conduction(conduction)) = value else {
        return 0.0;
    };
    let instants = conduction.times.len() as f64;
    let row = 3f64.powi(D as i32) * PER_HEAT_ENTRY;
    conduction.mesh.nodes.len() as f64 * (8.0 * instants + row + PER_NODE)
}

/// Bytes of a pair of nodes in heat conduction: columns and numbers of conductance, capacity, their sum and the gradient.
const PER_HEAT_ENTRY: f64 = 64.0;
/// Bytes of a cell of the mesh: shape, nodes, zone, role, material, what finds it by its place.
const PER_CELL: f64 = 100.0;
/// Bytes of a node: position, cells around, site, its row of weights.
const PER_NODE: f64 = 150.0;
/// Bytes of a point while points are placed: position, volume, horizon, zone, element and its weights, site.
const PER_POINT: f64 = 250.0;
/// Bytes of a place of the lattice that is looked at.
const PER_PLACE: f64 = 2.0;
/// Bytes of a bond that the search finds: the number of its end.
const PER_SEARCHED: f64 = 4.0;
/// Bytes of a bond of the body: the number of its end once more, and its weight.
pub(crate) const PER_BOND: f64 = 12.0;
/// Bytes more of a state-based bond: influence, and the way back from its end.
pub(crate) const PER_STATE_BOND: f64 = 20.0;
/// Bytes of a bond of a lattice that steps traverse.
const PER_LATTICE_PASS: f64 = 1.3;
/// Bytes of a listed bond that steps traverse.
const PER_LISTED_PASS: f64 = 11.4;
/// Bytes of a scalar of the stiffness; equal rows are stored once.
const PER_NONZERO: f64 = 2.0;
/// Bytes of the factors, or of the multigrid hierarchy, per scalar of the stiffness.
const SOLVER: f64 = 12.0;

/// Points within `radius` spacings, by the volume of the ball: within a tenth of those of a lattice from two spacings on.
fn family_size<const D: usize>(radius: f64) -> f64 {
    let pi = std::f64::consts::PI;
    radius.powi(D as i32) * [2.0, pi, 4.0 / 3.0 * pi][D - 1]
}

/// Points within `margin` of the cells that hold points, outside of them, and the places of the lattice in the box around both.
fn beside<const D: usize>(
    mesh: &Mesh<D>,
    roles: &[CellRole],
    h: f64,
    margin: f64,
    is_continued: bool,
) -> (f64, f64) {
    let holds: Vec<bool> = roles.iter().map(|r| *r != CellRole::Element).collect();
    let cells = (0..mesh.cell_count() as u32).filter(|&c| holds[c as usize]);
    let nodes: Vec<u32> = cells
        .clone()
        .flat_map(|c| mesh.cell(c as usize).iter().copied())
        .collect();
    if nodes.is_empty() {
        return (0.0, 0.0);
    }
    let (low, high) = mesh.bounds_of(&nodes);
    let sides = high - low;
    let places: f64 = sides.iter().map(|s| (s + 2.0 * margin) / h + 2.0).product();
    let faces = if is_continued {
        mesh.boundary_facets(cells)
    } else {
        let found = mesh.interface_facets(&holds, &true, &false);
        found.into_iter().map(|f| f.first).collect()
    };
    let area: f64 = faces.iter().map(|f| mesh.facet_normal_area(f).norm()).sum();
    let mine: f64 = (0..mesh.cell_count())
        .filter(|&c| holds[c])
        .map(|c| mesh.cell_volume(c).abs())
        .sum();
    let cell = h.powi(D as i32);
    // beyond the corners of the box there are none
    let box_around: f64 = sides.iter().map(|s| s + 2.0 * margin).product();
    let mut ghosts = area * margin + if D > 1 { margin.powi(D as i32) } else { 0.0 };
    ghosts = ghosts.min((box_around - mine).max(0.0));
    if !is_continued {
        let whole: f64 = (0..mesh.cell_count())
            .map(|c| mesh.cell_volume(c).abs())
            .sum();
        ghosts = ghosts.min((whole - mine).max(0.0));
    }
    (ghosts / cell, places)
}

/// Refuses a scene that needs more memory than there is.
///
/// # Errors
/// [`RunError::Memory`] with the three largest items and what would fit.
pub(crate) fn fits<const D: usize>(scene: &Scene<D>) -> Result<(), RunError> {
    let Some(there) = memory_budget() else {
        return Ok(());
    };
    let counts = Counts::of(scene);
    let needed = counts.peak();
    if needed <= there {
        return Ok(());
    }
    Err(RunError::Memory {
        needed: bytes_text(needed),
        there: bytes_text(there),
        largest: largest(&counts.memory()),
        sizes: counts.sizes(),
        remedy: remedy(scene, &counts, there),
    })
}

/// The three largest items, the largest first.
pub fn largest(memory: &[Share]) -> String {
    let mut list: Vec<&Share> = memory.iter().collect();
    list.sort_by_key(|s| std::cmp::Reverse(s.bytes));
    let named = |s: &&Share| format!("{} {}", s.name, bytes_text(s.bytes));
    let three: Vec<String> = list.iter().take(3).map(named).collect();
    three.join(", ")
}

impl Counts {
    /// In words, rounded.
    fn sizes(&self) -> String {
        let whole = |x: f64| grouped(x.round() as usize);
        let mut text = format!("{} cells", grouped(self.cells));
        if self.points > 0.0 {
            text += &format!(
                ", {} points, {} bonds",
                whole(self.points),
                whole(self.bonds)
            );
        }
        text
    }
}

/// Remedy by which the scene would fit: a spacing, where points and bonds take most of it.
fn remedy<const D: usize>(scene: &Scene<D>, counts: &Counts, there: u64) -> String {
    let rest: f64 = PER_CELL * counts.cells as f64 + PER_NODE * counts.nodes as f64;
    let left = there as f64 - rest;
    let spacing = match scene.peridynamics.as_ref().map(|p| &p.points) {
        Some(PointSource::Lattice { spacing, .. }) if left > 0.0 => *spacing,
        Some(PointSource::Lattices { .. }) if left > 0.0 => {
            return "use larger spacings or smaller horizons, or make the nonlocal zone smaller"
                .to_owned();
        }
        _ => return "use fewer cells, or a file with a coarser mesh".to_owned(),
    };
    // bonds go as the spacing to the power of twice the dimension
    let factor = ((counts.peak() as f64 - rest) / left).powf(0.5 / D as f64);
    let wider = 10f64.powf((spacing * factor).log10().floor() - 1.0);
    let fitting = (spacing * factor / wider).ceil() * wider;
    let is_larger = scene.peridynamics.as_ref().is_some_and(|p| {
        let horizon = p.horizon.as_constant().unwrap_or(f64::INFINITY);
        fitting <= horizon / 2.0
    });
    if is_larger {
        format!(
            "a peridynamics.points.lattice.spacing of {} or more fits; or make the nonlocal zone or the horizon smaller, or give more by --memory",
            number(fitting)
        )
    } else {
        "make the nonlocal zone smaller, or spacing and horizon larger, or give more by --memory"
            .to_owned()
    }
}

/// Seconds of one thread per bond that the search for families finds, measured on 6.5 million bonds in 2D with the other threads busy.
const SEARCH: f64 = 4e-7;
/// The same per bond of a body that moves: its traversals, and the stable step from its rows.
const SET_UP: f64 = 2.5e-6;
/// The same per scalar of the stiffness: assembled, ordered.
const ASSEMBLY: f64 = 1.8e-7;
/// The same per scalar of an iterative solve.
const SOLVE: f64 = 2.4e-7;
/// The same per bond and step.
const STEP: f64 = 2.5e-9;

impl Counts {
    /// Seconds that laying out takes, and what a run takes beyond it.
    pub fn seconds<const D: usize>(&self, scene: &Scene<D>) -> (f64, f64) {
        let threads = rayon::current_num_threads() as f64;
        let (lay_out, run) = match &scene.solve {
            Solve::Static => (
                SEARCH * self.searched + ASSEMBLY * self.nonzeros,
                SOLVE * self.nonzeros,
            ),
            Solve::Explicit(solve) => {
                let steps = solve.duration / self.step(scene);
                (SET_UP * self.searched, steps * STEP * self.bonds)
            }
            // load steps take what the bonds that break make them take
            Solve::QuasiStatic(_) => (SET_UP * self.searched, 0.0),
        };
        (lay_out / threads, run / threads)
    }

    /// About the stable step: the time that a wave takes for half a spacing.
    fn step<const D: usize>(&self, scene: &Scene<D>) -> f64 {
        let volume: f64 = (0..scene.mesh.cell_count())
            .map(|c| scene.mesh.cell_volume(c).abs())
            .sum();
        let cell = volume / self.cells.max(1) as f64;
        let h = match scene.peridynamics.as_ref().map(|p| &p.points) {
            Some(PointSource::Lattice { spacing, .. }) => *spacing,
            _ => cell.powf(1.0 / D as f64),
        };
        let fastest = scene
            .materials
            .iter()
            .map(|m| (m.stiffness().longitudinal_modulus() / m.density).sqrt())
            .fold(0.0, f64::max);
        0.5 * h / fastest
    }
}
