//! The part of the body that each site stands for: its tributary volume, its mass, and the loads on it.
//!
//! | file | what |
//! |---|---|
//! | `grid.rs` | places on a lattice, expressed through sites |
//! | `around.rs` | places beside points at centroids |
//! | `marks.rs` | the cells of a lattice that the edge of a region cuts |
//! | `found.rs` | volumes and moments of parts that were found |
//! | `half_space.rs` | what of cells and facets lies beyond a plane |
//! | `shares.rs` | shares that nodes hand on which follow a fit |
//! | `volumes.rs` | volumes and masses of all sites |
//! | `parts.rs` | a region of the zone, or of its surface, in parts that follow sites |
//!
//! The principle of virtual work gives all of it. The displacement of a finite element is `Σ N_a u_a`; a cell of the lattice that lies in the zone as a whole has that of its point; one that the seam, a surface or a void cuts has
//! that of the place at its centre of gravity, `Σ w_s u_s` over the sites around. A force on a part goes to the sites by the transpose of these weights. They add up to one and are exact for affine fields, so the total of every load and
//! its first moment are those of the integral over the mesh, and masses add up to that of the body.
//!
//! **Rows.** With an energy the stiffness knows of volumes, and nothing else has to change. A coupling by forces has rows that are equations at a place, each times a volume of its own: the hat of a node at the seam is whole,
//! and so are the cells of points that reach into elements. They overlap. Such a row is scaled by its tributary volume over its own ([`Model::row_scale`]); the solution of a body force that is the same everywhere does not change, and
//! sums over sites, of forces, masses and momentum, count every part of the body once. The own volume of a point is the part that it would have if its lattice went on in the elements, so that rows far from the seam, at surfaces
//! too, stay as they are: there forces between points are equal and opposite.

mod around;
pub(crate) mod found;
mod grid;
mod half_space;
mod marks;
mod parts;
mod shares;
mod volumes;

pub use crate::model::tributary::found::{Detail, Moments};
pub use half_space::HalfSpace;
pub use parts::Parts;
pub use volumes::Tributary;

use crate::{
    fem,
    model::{
        CellRole, Interface, Model, PointSource, SiteKind,
        simplex::{Cells, as_box},
    },
};

impl Tributary {
    /// Lays out the parts of a model's sites.
    pub(crate) fn new<const D: usize>(model: &Model<D>) -> Self {
        let mut volume = vec![0.0; model.sites.len()];
        let mesh = &model.mesh;
        let mut by_material: Vec<(u32, u16, f64)> = Vec::new();
        let own = model.peridynamic_material();
        // nodes by the cells around them; those that follow others pass on what they have
        for c in (0..mesh.cell_count()).filter(|&c| model.is_element(c)) {
            let material = model.material_of_cell(c);
            fem::for_each_share(mesh, c, |n, part, whole| {
                for (site, w) in model.node_shares(n as usize) {
                    let share = w * part * whole;
                    volume[site as usize] += share;
                    if material != own {
                        by_material.push((site, material, share));
                    }
                }
            });
        }
        let holds: Vec<bool> = model.roles.iter().map(|&r| r == CellRole::Points).collect();
        let mut zone = 0.0;
        if holds.contains(&true) && model.body().is_some() {
            let parts = Parts::of_cells(model, &holds, Detail::Centre);
            parts.add_sizes(&mut volume);
            zone = parts.total();
            by_material.extend(parts_of_materials(model, &holds));
        }
        by_material.sort_by_key(|m| (m.0, m.1));
        by_material.dedup_by(|next, kept| {
            let same = (next.0, next.1) == (kept.0, kept.1);
            if same {
                kept.2 += next.2;
            }
            same
        });
        Self {
            volume,
            mixed: by_material,
            zone,
            inertia: None,
            shares: None,
        }
    }
}

/// Returns the shares of each material but the first in the sites of a zone of several materials: site, material and volume.
fn parts_of_materials<const D: usize>(model: &Model<D>, holds: &[bool]) -> Vec<(u32, u16, f64)> {
    let mut found = Vec::new();
    let used = model.several().map_or(&[][..], |several| several.used());
    for &material in used.iter().filter(|m| **m != model.peridynamic_material()) {
        let is_its = |c: usize| holds[c] && model.material_of_cell(c) == material;
        let its: Vec<bool> = (0..holds.len()).map(is_its).collect();
        let mut volume = vec![0.0; model.sites.len()];
        Parts::of_cells(model, &its, Detail::Centre).add_sizes(&mut volume);
        let own = volume.iter().enumerate().filter(|(_, v)| **v != 0.0);
        found.extend(own.map(|(site, &v)| (site as u32, material, v)));
    }
    found
}

impl<const D: usize> Model<D> {
    /// The part of the body that each site stands for.
    pub fn tributary(&self) -> &Tributary {
        &self.tributary
    }

    /// Returns the factors by which the row of each site is scaled; none where rows are those of an energy, or all factors are one.
    pub fn row_scale(&self) -> Option<&[f64]> {
        self.row_scale.as_deref()
    }

    /// Finds the part of each site, and what rows are scaled by.
    pub(crate) fn share_out(&mut self) {
        let mut tributary = Tributary::new(self);
        let is_beside_patch =
            !self.mesh.embedded.shares.is_empty() && self.interface.constrained.is_none();
        // rows of an energy, as those of elements beside a patch, are those of their loads whatever the masses are
        let is_free = |site: usize| is_beside_patch && self.has_row_of_energy(site);
        let mut volumes = tributary.volume.iter().enumerate();
        let is_light = volumes.any(|(site, v)| *v <= 0.0 && !is_free(site));
        if is_beside_patch && !is_light {
            self.tributary.shares = shares::shares(self);
            let mut inertia = Tributary::new(self);
            inertia.shares = self.tributary.shares.take();
            tributary.inertia = Some(Box::new(inertia));
        }
        if is_light {
            // by the volumes that sites have of their own
            self.tributary.shares = shares::shares(self);
            if self.tributary.shares.is_some() {
                tributary = Tributary::new(self);
                tributary.shares = self.tributary.shares.take();
            }
        }
        if !self.has_energy && self.body().is_some() {
            let nothing = NOTHING * self.spacing().powi(D as i32);
            let factor = |(own, volume): (f64, &f64)| {
                let ratio = volume / own;
                match ratio.is_finite() && ratio > LEAST_SCALE {
                    true if (ratio - 1.0).abs() <= 1e-11 => 1.0,
                    // a node of which others that follow it have all, but for rounding
                    _ if own.abs() <= nothing => 1.0,
                    true => ratio,
                    // an equation that next to nothing of the body belongs to stays one
                    false => LEAST_SCALE,
                }
            };
            let own = self.row_volumes().into_iter();
            let scale: Vec<f64> = own.zip(&tributary.volume).map(factor).collect();
            self.row_scale = scale.iter().any(|&s| s != 1.0).then_some(scale);
        }
        for (site, volume) in self.sites.iter_mut().zip(&tributary.volume) {
            site.volume = *volume;
        }
        self.tributary = tributary;
    }

    /// Tells of a coupling by forces that the points of an enclosed zone lie on its nodes, one on each, with elements of the same size around: what the zone has is then shared out as in elements.
    ///
    /// Row by row the load is the mean of the body force over the row's own volume there, and `K u = f` is exact for cubic fields. A cell around each point has the same moments up to the first; the second ones differ, by a quarter of `h²` in all from the
    /// elements to the points, and a strain of `h² b′/4E` would be added to the zone.
    pub(crate) fn nodes_are_points(&self) -> bool {
        let Some(p) = &self.peridynamics else {
            return false;
        };
        let PointSource::Lattice { spacing, origin } = p.points else {
            return false;
        };
        let is_hindered = !p.voids.is_empty() || !p.barriers.is_empty();
        if self.has_energy || self.interface != Interface::OVERLAP || is_hindered {
            return false;
        }
        let cells = Cells { origin, spacing };
        let slack = ON_NODE * spacing;
        let is_cube = |c: usize| {
            as_box(&self.mesh, c).is_some_and(|(low, high)| {
                let edges = high - low;
                let on_lattice = (cells.centre(&cells.index(&low)) - low).amax() <= slack;
                on_lattice && edges.iter().all(|edge| (edge - spacing).abs() <= slack)
            })
        };
        let (offsets, around) = self.node_cells();
        let of_node =
            |n: u32| &around[offsets[n as usize] as usize..offsets[n as usize + 1] as usize];
        let is_enclosed = |n: &u32| {
            let cells = of_node(*n);
            cells.len() == 1 << D && cells.iter().all(|&c| is_cube(c as usize))
        };
        (0..self.mesh.cell_count())
            .filter(|&c| self.roles[c] == CellRole::Points)
            .all(|c| self.mesh.cell(c).iter().all(is_enclosed))
    }

    /// The volume that each row has as it is: of a node that of its hat, of a point that of its part if the lattice went on in the elements.
    fn row_volumes(&self) -> Vec<f64> {
        let mut own: Vec<f64> = self.sites.iter().map(|s| s.volume).collect();
        let is_lattice = self
            .peridynamics
            .as_ref()
            .is_some_and(|p| p.points != PointSource::Cells);
        if !is_lattice || self.nodes_are_points() {
            return own;
        }
        let holds = |c: usize| self.roles[c] == CellRole::Points;
        let own_cells = (0..self.mesh.cell_count()).filter(|&c| holds(c));
        let nodes: Vec<u32> = own_cells
            .flat_map(|c| self.mesh.cell(c).iter().copied())
            .collect();
        let (low, high) = self.mesh.bounds_of(&nodes);
        let reach = NEAR * self.spacing();
        let (low, high) = (low.add_scalar(-reach), high.add_scalar(reach));
        let around: Vec<bool> = (0..self.mesh.cell_count())
            .map(|c| {
                let (from, to) = self.mesh.bounds_of(self.mesh.cell(c));
                holds(c) || (0..D).all(|k| from[k] <= high[k] && to[k] >= low[k])
            })
            .collect();
        let mut continued = vec![0.0; own.len()];
        Parts::of_continued_lattice(self, &around).add_sizes(&mut continued);
        for (own, (site, volume)) in own.iter_mut().zip(self.sites.iter().zip(continued)) {
            if matches!(site.kind, SiteKind::Point(_)) && volume > 0.0 {
                *own = volume;
            }
        }
        own
    }

    /// Returns true if a node of the mesh belongs to a cell that holds points.
    pub fn touches_points(&self, node: u32) -> bool {
        let (offsets, cells) = self.node_cells();
        let own = offsets[node as usize] as usize..offsets[node as usize + 1] as usize;
        let holds = |&c: &u32| self.roles[c as usize] == CellRole::Points;
        cells[own].iter().any(holds)
    }

    /// Returns true if a node belongs to a cell and follows no others.
    pub fn is_placed(&self, node: u32) -> bool {
        let offsets = self.node_cells().0;
        offsets[node as usize] < offsets[node as usize + 1] && self.ties.followed(node).is_none()
    }

    /// Returns true if all sites that are points lie in the cells that `counts` names.
    pub(crate) fn holds_all_points(&self, counts: &[bool]) -> bool {
        (self.roles.iter().zip(counts)).all(|(&role, &counts)| counts || role != CellRole::Points)
    }
}

/// Distance from a node within which a point coincides with it, in spacings.
const ON_NODE: f64 = 1e-9;

/// Distance around the zone to which its lattice is continued, in spacings: farther than weights reach.
const NEAR: f64 = 4.0;

/// Part of a lattice cell below which a volume is what rounding leaves of none.
const NOTHING: f64 = 1e-10;

/// The least factor of a row: a site whose part nearly vanishes keeps an equation.
const LEAST_SCALE: f64 = 1e-3;
