//! Second derivatives recovered from the sites around an element: what its shape functions lack to interpolate quadratic fields.
//!
//! A linear element interpolates `u` with the error `d : ∇∇u + O(h_e³)`, where `d = ½ (x ⊗ x − Σ N_a x_a ⊗ x_a)` about any origin.
//! Peridynamic forces are second differences of the displacement over a horizon, so that for `h_e ~ δ` this error is of the order of the force itself, in a layer one horizon wide:
//! the solution then converges with order one. A place in an element gets the weights `N + d : H`, where `H` gives `∇∇u` of the element exactly for quadratic fields:
//! a least-squares fit to the sites of the elements around (superconvergent patch recovery, \[ZienkiewiczZhu1992\], of the displacement instead of the stress).

use rustc_hash::FxHashMap;

use rayon::prelude::*;

use crate::{
    assembly::Transfer,
    mesh::Mesh,
    model::{
        CellRole, Model, SiteKind,
        bins::Bins,
        continued_field::ContinuedField,
        interface_interpolation::{SiteWeights, Sites},
        least_squares_gradient,
        point_cloud::{PointCarrier, PointCloud},
        recovery_patch::Patch,
    },
    parallel,
    peridynamics::Law,
    peridynamics::alike::{FamilyShape, first_alike},
    tensor::Vector,
};

/// Deviations from a quadratic below this fraction of the square of the element's size are round-off: the place coincides with a node.
const COINCIDES: f64 = 1e-12;

impl<const D: usize> Model<D> {
    /// Expresses the points of a cloud through sites, with what interpolation lacks in elements where some lie between the nodes; `site` names that of a point that is one, `among` the rows of those that continue a lattice.
    ///
    /// If nothing overlaps, a point behind a face is a place only, and interpolation will do, or what the zone has there in an element of another material; elsewhere forces of points depend on it.
    pub(crate) fn transfer_of(
        &self,
        law: &dyn Law<D>,
        sites: &Sites<'_, D>,
        cloud: &PointCloud<D>,
        among: &[SiteWeights],
        site: impl Fn(usize) -> u32 + Sync,
    ) -> (Transfer, FxHashMap<u32, Patch<D>>) {
        // families of other clouds carry no affine field, and no better ghost would mend that
        let patches = match self.interface.overlap && self.is_lattice() {
            false => FxHashMap::default(),
            true => patches(
                sites,
                cloud,
                &self.node_transfer,
                self.node_cells(),
                &self.elastic.material,
            ),
        };
        let continued = ContinuedField::new(self, law, sites, cloud);
        let rows: Vec<_> = parallel::map(cloud.position.len(), 1, |i| match &cloud.carrier[i] {
            PointCarrier::Own => vec![(site(i), 1.0)],
            PointCarrier::Lattice => among.get(i).cloned().unwrap_or_default(),
            PointCarrier::Element(cell, shape) => match continued.row(i) {
                Some(row) => row
                    .into_iter()
                    .map(|(p, w)| (site(p as usize), w))
                    .collect(),
                None => {
                    let x = &cloud.position[i];
                    row(&self.mesh, &self.node_transfer, &patches, *cell, shape, x)
                }
            },
        });
        let rows = Transfer::from_rows(self.node_transfer.sites(), rows);
        (rows, patches)
    }

    /// Returns true if points in elements that carry the partial stress, or around such, lie between the nodes.
    pub fn has_places_between_nodes(&self) -> bool {
        !self.points.patches.is_empty()
    }

    /// The place `x` in an element with these shape values, through sites.
    pub(crate) fn place_row(&self, cell: u32, shape: &[f64], x: &Vector<D>) -> Vec<(u32, f64)> {
        row(
            &self.mesh,
            &self.node_transfer,
            &self.points.patches,
            cell,
            shape,
            x,
        )
    }
}

/// The row of the place `x` in a cell with these shape values.
fn row<const D: usize>(
    mesh: &Mesh<D>,
    of_node: &Transfer,
    patches: &FxHashMap<u32, Patch<D>>,
    cell: u32,
    shape: &[f64],
    x: &Vector<D>,
) -> Vec<(u32, f64)> {
    let mut row: Vec<(u32, f64)> = mesh
        .cell(cell as usize)
        .iter()
        .zip(shape)
        .filter(|&(_, &s)| s != 0.0)
        .flat_map(|(&n, &s)| of_node.row(n as usize).map(move |(t, w)| (t, w * s)))
        .collect();
    if let Some(patch) = patches.get(&cell) {
        let lacking = lacking(mesh, patch.centre, patch.size, cell, shape, x);
        if lacking.iter().any(|d| d.abs() > COINCIDES) {
            row.extend(patch.weights.iter().map(|(t, second)| {
                let change = second.iter().zip(&lacking).map(|(s, d)| s * d);
                (*t, change.sum())
            }));
        }
    }
    row
}

/// Returns the interpolation error of the shape functions of an element at `x`, for each Taylor monomial of degree two, in units of `size²`.
fn lacking<const D: usize>(
    mesh: &Mesh<D>,
    centre: Vector<D>,
    size: f64,
    cell: u32,
    shape: &[f64],
    x: &Vector<D>,
) -> Vec<f64> {
    let of = |p: &Vector<D>| least_squares_gradient::second_monomials(&((p - centre) / size));
    let mut lacking = of(x);
    for (&n, &s) in mesh.cell(cell as usize).iter().zip(shape) {
        for (d, q) in lacking.iter_mut().zip(of(&mesh.nodes[n as usize])) {
            *d -= s * q;
        }
    }
    lacking
}

/// The patches of all elements that hold places which coincide with none of their nodes.
///
/// `node_cells` are the cells around each node, as [`crate::mesh::Mesh::node_cells`] has them; patches end where another material begins, since gradients jump there.
fn patches<const D: usize>(
    at: &Sites<'_, D>,
    cloud: &PointCloud<D>,
    of_node: &Transfer,
    node_cells: (&[u32], &[u32]),
    material: &[u16],
) -> FxHashMap<u32, Patch<D>> {
    let mut wanted: Vec<u32> = Vec::new();
    for (x, carrier) in cloud.position.iter().zip(&cloud.carrier) {
        let PointCarrier::Element(cell, shape) = carrier else {
            continue;
        };
        let (centre, size) = centre_and_size(at, *cell);
        if lacking(at.mesh, centre, size, *cell, shape, x)
            .iter()
            .any(|d| d.abs() > COINCIDES)
        {
            wanted.push(*cell);
        }
    }
    if wanted.is_empty() {
        return FxHashMap::default();
    }
    // the stress at a Gauss point follows from differences to its own displacement, which must be as exact as the others
    let carries = |c: &u32| at.roles[*c as usize] == CellRole::StressElement;
    wanted.extend((0..at.mesh.cell_count() as u32).filter(carries));
    wanted.sort_unstable();
    wanted.dedup();
    let points: Vec<(u32, Vector<D>)> = (0..at.sites.len() as u32)
        .filter(|&s| matches!(at.sites[s as usize].kind, SiteKind::Point(_)))
        .map(|s| (s, at.sites[s as usize].position))
        .collect();
    let positions: Vec<Vector<D>> = points.iter().map(|p| p.1).collect();
    let around = Around {
        at,
        of_node,
        node_cells,
        material,
        bins: Bins::new(&positions, 2.0 * cloud.spacing),
        points,
    };
    let mut patches = FxHashMap::default();
    let mut sought: Vec<(u32, Vec<u32>)> = wanted.into_iter().map(|c| (c, vec![c])).collect();
    for sharing in [D, 1, 1] {
        around.find(&mut sought, sharing, &mut patches);
    }
    patches
}

/// The centroid of a cell, and the edge of a cube as large as its box is on average.
fn centre_and_size<const D: usize>(at: &Sites<'_, D>, cell: u32) -> (Vector<D>, f64) {
    let (low, high) = at.mesh.bounds_of(at.mesh.cell(cell as usize));
    let centre = at.mesh.centroid(cell as usize);
    (centre, (high - low).norm() / (D as f64).sqrt())
}

/// Surroundings of elements.
struct Around<'a, const D: usize> {
    at: &'a Sites<'a, D>,
    of_node: &'a Transfer,
    node_cells: (&'a [u32], &'a [u32]),
    material: &'a [u16],
    points: Vec<(u32, Vector<D>)>,
    bins: Bins<D>,
}

impl<const D: usize> Around<'_, D> {
    /// Second derivatives in those of the cells sought where the sites in the cells around, of which each brings those found before, determine them.
    fn find(
        &self,
        sought: &mut Vec<(u32, Vec<u32>)>,
        sharing: usize,
        patches: &mut FxHashMap<u32, Patch<D>>,
    ) {
        let places: Vec<(Vec<u32>, FamilyShape<D>)> =
            parallel::map_each(sought.par_iter_mut(), |(cell, cells)| {
                let (centre, size) = centre_and_size(self.at, *cell);
                self.grow(cells, sharing);
                let sites = self.sites_of(cells, &centre, size);
                let data = sites.iter().map(|&s| {
                    let x = self.at.sites[s as usize].position;
                    ((x - centre) / size, 1.0)
                });
                let bonds = data.collect();
                (
                    sites,
                    FamilyShape {
                        bonds,
                        horizon: 1.0,
                    },
                )
            });
        let (sites, shapes): (Vec<_>, Vec<_>) = places.into_iter().unzip();
        let first_alike = first_alike(&shapes);
        let found: Vec<Option<Vec<Vec<f64>>>> = parallel::map(shapes.len(), 1, |k| {
            let data: Vec<Vector<D>> = shapes[k].bonds.iter().map(|b| b.0).collect();
            (first_alike[k] == k)
                .then(|| least_squares_gradient::second_derivatives(&data))
                .flatten()
        });
        let mut k = 0;
        let mut sites = sites.into_iter();
        sought.retain(|(cell, _)| {
            let second = &found[first_alike[k]];
            k += 1;
            let (Some(second), Some(sites)) = (second, sites.next()) else {
                return true;
            };
            let (centre, size) = centre_and_size(self.at, *cell);
            let weights = sites.into_iter().zip(second.iter().cloned()).collect();
            let patch = Patch {
                centre,
                size,
                weights,
            };
            patches.insert(*cell, patch);
            false
        });
    }

    /// Adds the cells of the same material that share at least so many nodes with one of those given.
    fn grow(&self, cells: &mut Vec<u32>, sharing: usize) {
        let mesh = self.at.mesh;
        let (offsets, of_node) = self.node_cells;
        let mut beside = Vec::new();
        for &c in cells.iter() {
            let mut touching: Vec<u32> = mesh
                .cell(c as usize)
                .iter()
                .flat_map(|&n| {
                    let range = offsets[n as usize] as usize..offsets[n as usize + 1] as usize;
                    of_node[range].iter().copied()
                })
                .filter(|&other| self.material[other as usize] == self.material[c as usize])
                .collect();
            touching.sort_unstable();
            for group in touching.chunk_by(|a, b| a == b) {
                if group.len() >= sharing {
                    beside.push(group[0]);
                }
            }
        }
        cells.extend(beside);
        cells.sort_unstable();
        cells.dedup();
    }

    /// The sites in the cells that nothing hides from `centre`: nodes, and points where cells hold such.
    fn sites_of(&self, cells: &[u32], centre: &Vector<D>, size: f64) -> Vec<u32> {
        let mesh = self.at.mesh;
        let mut sites = Vec::new();
        let mut boxes = Vec::new();
        for &c in cells {
            let nodes = mesh.cell(c as usize);
            sites.extend(nodes.iter().filter_map(|&n| self.site_of(n)));
            if self.at.roles[c as usize] == CellRole::Points {
                boxes.push(mesh.bounds_of(nodes));
            }
        }
        let reach = boxes
            .iter()
            .flat_map(|(low, high)| [(low - centre).norm(), (high - centre).norm()])
            .fold(0.0, f64::max);
        if reach > 0.0 {
            let slack = 1e-9 * size;
            sites.extend(self.bins.around(centre, reach).filter_map(|k| {
                let (site, x) = &self.points[k];
                boxes
                    .iter()
                    .any(|(low, high)| {
                        (0..D).all(|a| x[a] >= low[a] - slack && x[a] <= high[a] + slack)
                    })
                    .then_some(*site)
            }));
        }
        sites.sort_unstable();
        sites.dedup();
        let farthest = |s: &u32| (self.at.sites[*s as usize].position - centre).norm();
        let radius = sites.iter().map(farthest).fold(0.0, f64::max);
        if self.at.barriers.near(centre, radius) {
            sites.retain(|&s| {
                let x = &self.at.sites[s as usize].position;
                !self.at.barriers.cuts(centre, x)
            });
        }
        sites
    }

    /// The site that a node is.
    fn site_of(&self, node: u32) -> Option<u32> {
        let mut row = self.of_node.row(node as usize);
        match (row.next(), row.next()) {
            (Some((site, 1.0)), None) => Some(site),
            _ => None,
        }
    }
}
