//! Transfer of a motion from one layout of zones to another.
//!
//! Points that stay keep their displacement and velocity as they are, and so do nodes that stay. A point that takes the place of an element follows
//!
//! ```text
//! u(x) = Σ_a N_a(x) (u_a + ½ G_a (x − x_a))
//! ```
//!
//! with the shape functions `N_a` of the element and gradients `G_a` at its nodes, by least squares from the nodes around: continuous from element to element, and exact
//! for quadratic fields on cells of any shape, since `Σ N_a (x_a − x) = 0` and the second derivatives of `u_a` and `½ G_a` cancel. Shape functions alone are exact for affine fields
//! only, and change the energy of a wave by the square of its wave number. A new node starts from a quadratic fit to the points around it.

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::model::{FitDegree, Model, SiteKind, bins::Bins, least_squares_gradient};
use crate::{assembly::Transfer, fem::Locator, parallel, tensor::Vector};

#[cfg(test)]
#[path = "state_transfer_tests.rs"]
mod tests;

const NONE: u32 = u32::MAX;

/// A position by its bits: points of one lattice have the same ones in every layout.
type Key<const D: usize> = [u64; D];

fn key<const D: usize>(x: &Vector<D>) -> Key<D> {
    // of two zeros one
    std::array::from_fn(|a| (x[a] + 0.0).to_bits())
}

/// Bonds by the places of their ends, whatever their points are numbered.
#[derive(Clone, Debug, Default)]
pub struct BrokenBonds<const D: usize> {
    of: FxHashMap<Key<D>, FxHashSet<Key<D>>>,
}

impl<const D: usize> BrokenBonds<D> {
    /// The bonds of a layout by the sites of their ends, each once for each direction, as [`crate::system::BodyState::broken_bonds`] gives them.
    pub fn of(model: &Model<D>, bonds: &[(u32, u32)]) -> Self {
        let at = |site: u32| key(&model.sites[site as usize].position);
        let mut of: FxHashMap<Key<D>, FxHashSet<Key<D>>> = FxHashMap::default();
        for &(i, j) in bonds {
            of.entry(at(i)).or_default().insert(at(j));
        }
        Self { of }
    }

    /// Returns a predicate of points at `position`: true if the bond from point `i` to point `j` is one of these.
    pub fn among<'a>(
        &'a self,
        position: &'a [Vector<D>],
    ) -> impl Fn(usize, usize) -> bool + Sync + 'a {
        let of: Vec<Option<&FxHashSet<Key<D>>>> =
            position.iter().map(|x| self.of.get(&key(x))).collect();
        move |i, j| of[i].is_some_and(|set| set.contains(&key(&position[j])))
    }

    /// Returns true if there are no such bonds.
    pub fn is_empty(&self) -> bool {
        self.of.is_empty()
    }
}

/// Positions of the sites of a layout, apart from the layout.
#[derive(Clone, Debug)]
pub struct Carried<const D: usize> {
    position: Vec<Vector<D>>,
    /// The site of each node, [`NONE`] for one that is none.
    node_site: Vec<u32>,
    points: FxHashMap<Key<D>, u32>,
    /// Sites that are points.
    listed: Vec<u32>,
    is_element: Vec<bool>,
    spacing: f64,
}

/// Error of continuing a motion in another layout.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the zones cannot change at ({}): the {found} sites of the old zones around it do not determine an affine field there; make the zones wider, or the cells finer",
    .position.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
)]
pub struct CarryError {
    /// Position of the site.
    pub position: Vec<f64>,
    /// Number of sites found.
    pub found: usize,
}

/// Transfer of the fields of one layout to another.
pub struct Carrying {
    rows: Transfer,
    sites: usize,
    /// Sites of the new layout that were none in the old one.
    pub new: Vec<u32>,
}

impl Carrying {
    /// A field of the new layout from one of the old, `D` numbers per site.
    pub fn field<const D: usize>(&self, old: &[f64]) -> Vec<f64> {
        (0..self.sites)
            .flat_map(|site| {
                let value: Vector<D> = self.rows.displacement(site, old);
                <[f64; D]>::from(value)
            })
            .collect()
    }
}

impl<const D: usize> Carried<D> {
    /// Records the positions of the sites of a layout.
    pub fn of(model: &Model<D>) -> Self {
        let position: Vec<Vector<D>> = model.sites.iter().map(|s| s.position).collect();
        let mut node_site = vec![NONE; model.mesh.nodes.len()];
        let (mut points, mut listed) = (FxHashMap::default(), Vec::new());
        for (site, s) in model.sites.iter().enumerate() {
            match s.kind {
                SiteKind::Node(n) => node_site[n as usize] = site as u32,
                SiteKind::Point(_) => {
                    points.insert(key(&s.position), site as u32);
                    listed.push(site as u32);
                }
            }
        }
        Self {
            node_site,
            points,
            listed,
            is_element: (0..model.mesh.cell_count())
                .map(|c| model.is_element(c))
                .collect(),
            spacing: model.spacing(),
            position,
        }
    }

    /// Returns the transfer of the fields to `model`, which has the same mesh and lattice.
    ///
    /// # Errors
    /// [`CarryError`] for a new site without an element, and without enough sites around to fit to.
    pub fn onto(&self, model: &Model<D>) -> Result<Carrying, CarryError> {
        let old = |kind: SiteKind, x: &Vector<D>| match kind {
            SiteKind::Node(n) => Some(self.node_site[n as usize]).filter(|&s| s != NONE),
            SiteKind::Point(_) => self.points.get(&key(x)).copied(),
        };
        let stayed: Vec<Option<u32>> = model
            .sites
            .iter()
            .map(|s| old(s.kind, &s.position))
            .collect();
        let new: Vec<u32> = (0..stayed.len() as u32)
            .filter(|&s| stayed[s as usize].is_none())
            .collect();
        // cells that were elements and are none any more, and those around them: a point may lie on their border
        let mut changed = vec![false; model.mesh.nodes.len()];
        let cells = 0..model.mesh.cell_count();
        for c in cells
            .clone()
            .filter(|&c| self.is_element[c] && !model.is_element(c))
        {
            for &n in model.mesh.cell(c) {
                changed[n as usize] = true;
            }
        }
        let locator = Locator::new(
            &model.mesh,
            cells.filter(|&c| {
                self.is_element[c] && model.mesh.cell(c).iter().any(|&n| changed[n as usize])
            }),
        );
        let gradients = Gradients::new(self, model, &changed);
        let at: Vec<Vector<D>> = self
            .listed
            .iter()
            .map(|&s| self.position[s as usize])
            .collect();
        let bins = Bins::new(&at, 2.0 * self.spacing.max(f64::MIN_POSITIVE));
        let fresh: Vec<Vec<(u32, f64)>> = parallel::try_map(new.len(), 1, |k| {
            let site = new[k];
            let x = model.sites[site as usize].position;
            if matches!(model.sites[site as usize].kind, SiteKind::Point(_))
                && let Some(located) = locator.locate(&model.mesh, &x, 1e-9)
            {
                return Ok(gradients.row(model, &x, located.cell, &located.shape));
            }
            self.fitted(&x, &at, &bins)
        })?;
        let mut fresh = fresh.into_iter();
        let rows = Transfer::from_rows(
            self.position.len(),
            stayed.iter().map(|old| match old {
                Some(site) => vec![(*site, 1.0)],
                None => fresh.next().unwrap_or_default(),
            }),
        );
        Ok(Carrying {
            rows,
            sites: stayed.len(),
            new,
        })
    }

    /// A fit to the points around, at the positions `at` of the listed ones.
    fn fitted(
        &self,
        x: &Vector<D>,
        at: &[Vector<D>],
        bins: &Bins<D>,
    ) -> Result<Vec<(u32, f64)>, CarryError> {
        let mut found = 0;
        for degree in [FitDegree::Quadratic, FitDegree::Affine] {
            for factor in [1.8, 2.4, 3.1, 4.0, 5.4] {
                let radius = factor * self.spacing * (1.0 + 1e-9);
                let mut near: Vec<usize> = bins
                    .around(x, radius)
                    .filter(|&k| (at[k] - x).norm() <= radius)
                    .collect();
                near.sort_unstable();
                found = near.len();
                let data: Vec<Vector<D>> = near.iter().map(|&k| at[k]).collect();
                if let Some(weights) = least_squares_gradient::fit(x, &data, degree) {
                    let sites = near.into_iter().map(|k| self.listed[k]);
                    return Ok(sites.zip(weights).collect());
                }
            }
        }
        Err(CarryError {
            position: x.iter().copied().collect(),
            found,
        })
    }
}

/// Gradients at the nodes of elements that become points, as weights of sites.
struct Gradients<'a, const D: usize> {
    carried: &'a Carried<D>,
    /// By node; none where the nodes around do not determine a quadratic field.
    of: FxHashMap<u32, Option<Vec<(u32, Vector<D>)>>>,
}

impl<'a, const D: usize> Gradients<'a, D> {
    fn new(carried: &'a Carried<D>, model: &Model<D>, wanted: &[bool]) -> Self {
        let (offsets, cells) = model.node_cells();
        let cells_of =
            |n: u32| &cells[offsets[n as usize] as usize..offsets[n as usize + 1] as usize];
        // nodes of the elements around those of a node
        let around = |n: u32| -> Vec<u32> {
            let mut near = vec![n];
            for _ in 0..2 {
                let mut next: Vec<u32> = near
                    .iter()
                    .flat_map(|&n| cells_of(n))
                    .filter(|&&c| carried.is_element[c as usize])
                    .flat_map(|&c| model.mesh.cell(c as usize))
                    .copied()
                    .collect();
                next.sort_unstable();
                next.dedup();
                near = next;
            }
            near.retain(|&m| m != n && carried.node_site[m as usize] != NONE);
            near
        };
        let mut needed: Vec<u32> = (0..model.mesh.cell_count())
            .filter(|&c| {
                carried.is_element[c] && model.mesh.cell(c).iter().any(|&n| wanted[n as usize])
            })
            .flat_map(|c| model.mesh.cell(c))
            .copied()
            .collect();
        needed.sort_unstable();
        needed.dedup();
        let of = needed
            .into_par_iter()
            .map(|n| {
                let x = model.mesh.nodes[n as usize];
                let neighbours: Vec<(u32, Vector<D>)> = around(n)
                    .into_iter()
                    .map(|m| {
                        (
                            carried.node_site[m as usize],
                            model.mesh.nodes[m as usize] - x,
                        )
                    })
                    .collect();
                let shortest = neighbours
                    .iter()
                    .map(|(_, xi)| xi.norm())
                    .fold(f64::INFINITY, f64::min);
                let own = carried.node_site[n as usize];
                let weights = least_squares_gradient::quadratic(shortest, &neighbours)
                    .filter(|_| own != NONE)
                    .map(|w| {
                        let mut row: Vec<(u32, Vector<D>)> =
                            w.neighbours.into_iter().zip(w.gradient).collect();
                        let rest: Vector<D> = row.iter().map(|r| r.1).sum();
                        row.push((own, -rest));
                        row
                    });
                (n, weights)
            })
            .collect();
        Self { carried, of }
    }

    /// Weights of the displacement at `x` in an element, from its shape functions there.
    fn row(&self, model: &Model<D>, x: &Vector<D>, cell: usize, shape: &[f64]) -> Vec<(u32, f64)> {
        let nodes = model.mesh.cell(cell);
        let known: Option<Vec<&Vec<(u32, Vector<D>)>>> =
            nodes.iter().map(|n| self.of.get(n)?.as_ref()).collect();
        let mut row = Vec::new();
        for (a, (&n, &weight)) in nodes.iter().zip(shape).enumerate() {
            row.push((self.carried.node_site[n as usize], weight));
            if let Some(gradients) = &known {
                let way = (x - model.mesh.nodes[n as usize]) * (0.5 * weight);
                row.extend(gradients[a].iter().map(|(site, g)| (*site, g.dot(&way))));
            }
        }
        row.sort_unstable_by_key(|r| r.0);
        row.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            if same {
                kept.1 += next.1;
            }
            same
        });
        row
    }
}
