//! Lattice cells of a patch: the zone, the rim around it, and the faces of the rim.

use std::collections::{BTreeMap, BTreeSet};

use super::{error::PatchError, places::Places, plane_parts};
use crate::{
    mesh::Mesh,
    model::simplex::{Cells, Simplex, simplices_of},
    parallel,
    tensor::Vector,
};

/// Part of a cell's volume below which it is none, and above which less one it is whole.
const PART: f64 = 1e-9;

/// Part of an element's volume in the body that its nodes need to follow no others.
pub(super) const GOOD: f64 = 0.3;

/// Cells around zone and rim of which it is known what lies there: strips of the mesh up to a surface are taken in.
const MARGIN: i32 = 8;

/// Cells of the box around a zone, at most.
const MOST: f64 = 2e8;

/// A cell of the lattice.
pub(super) type Index<const D: usize> = [i32; D];

/// Cells of a patch.
pub(super) struct PatchCells<const D: usize> {
    pub cells: Cells<D>,
    /// Cells that hold points.
    pub zone: BTreeSet<Index<D>>,
    /// Cells of zone and rim.
    pub all: BTreeSet<Index<D>>,
    /// The cells of the mesh that have a part in each cell of the lattice in and around the patch, with its volume.
    pub held: BTreeMap<Index<D>, Vec<(u32, f64)>>,
    /// Cells that were wanted and are not of the zone, since the surface of the body is near.
    pub skin: usize,
    /// Cells that were wanted and are not of the zone, since elements are to lie there.
    pub kept_off: usize,
    /// Nodes whose displacement is prescribed: they follow nothing, and none of Γ carries a multiplier of its own.
    prescribed: BTreeSet<Index<D>>,
    /// Corners of the box of cells of which [`PatchCells::held`] is known.
    limits: (Index<D>, Index<D>),
    /// True as long as no cell beyond was asked for.
    is_known: bool,
    /// True if nodes belong to plane parts by an order of these (`plane_parts.rs`), instead of by their axes.
    orders_parts: bool,
}

/// A face of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Face<const D: usize> {
    pub cell: Index<D>,
    pub axis: usize,
    pub is_upper: bool,
}

impl<const D: usize> Face<D> {
    /// The cell on the other side.
    pub fn neighbour(&self) -> Index<D> {
        let mut other = self.cell;
        other[self.axis] += if self.is_upper { 1 } else { -1 };
        other
    }

    /// Its nodes, the first axis within the face the fastest; node `i` is the lower corner of cell `i`.
    pub fn nodes(&self) -> Vec<Index<D>> {
        let within: Vec<usize> = (0..D).filter(|&k| k != self.axis).collect();
        let mut corner = self.cell;
        corner[self.axis] += i32::from(self.is_upper);
        (0..1usize << within.len())
            .map(|bits| {
                let mut node = corner;
                for (k, &axis) in within.iter().enumerate() {
                    node[axis] += (bits >> k & 1) as i32;
                }
                node
            })
            .collect()
    }
}

impl<const D: usize> PatchCells<D> {
    /// The cells whose centre is wanted and lies between two corners, and a rim of so many cells around them; with a skin those alone of whose rim so large a part of each cell is in the body, and none whose rim would not leave a cell of elements at places that it is kept off.
    pub fn new(
        mesh: &Mesh<D>,
        cells: Cells<D>,
        (width, skin, orders_parts): (i32, Option<f64>, bool),
        (low, high): (Vector<D>, Vector<D>),
        places: &Places<'_, D>,
    ) -> Result<Self, PatchError> {
        let (from, to) = cells.range(&low, &high);
        let count: f64 = (0..D)
            .map(|i| f64::from(to[i]) - f64::from(from[i]))
            .product();
        if count > MOST {
            let edge = cells.spacing;
            return Err(PatchError::Large { count, edge });
        }
        let wanted = wanted(&cells, (from, to), places);
        let empty = PatchError::Empty {
            edge: cells.spacing,
        };
        let Some((from, to)) = extent(&wanted) else {
            return Err(empty);
        };
        let limits = (
            from.map(|i| i - width - MARGIN),
            to.map(|i| i + width + MARGIN),
        );
        let held = held(mesh, &cells, limits);
        let mut patch = Self {
            cells,
            zone: BTreeSet::new(),
            all: BTreeSet::new(),
            held,
            skin: 0,
            kept_off: 0,
            prescribed: BTreeSet::new(),
            limits,
            is_known: true,
            orders_parts,
        };
        patch.zone = (wanted.into_iter())
            .filter(|index| patch.is_material(index))
            .collect();
        if let Some(least) = skin {
            let around =
                |index: &Index<D>| block(index.map(|i| i - width), index.map(|i| i + width));
            let is_whole = |index: &Index<D>| {
                !patch.is_cut(index) && around(index).all(|other| patch.part(&other) > least - PART)
            };
            let all = patch.zone.len();
            let inner = patch.zone.iter().filter(|index| is_whole(index));
            patch.zone = inner.copied().collect();
            patch.skin = all - patch.zone.len();
        }
        let off = places.kept_off.iter().map(|x| patch.cells.index(x));
        let beside = grown(off.collect(), width + 1, limits);
        let all = patch.zone.len();
        patch.zone.retain(|index| !beside.contains(index));
        patch.kept_off = all - patch.zone.len();
        if patch.zone.is_empty() {
            return Err(empty);
        }
        patch.prescribe(places);
        for index in patch.zone.clone() {
            for other in block(index.map(|i| i - width), index.map(|i| i + width)) {
                patch.add(other);
            }
        }
        patch.fill();
        match patch.is_known {
            true => Ok(patch),
            false => Err(PatchError::Grown),
        }
    }

    /// Notes the nodes whose displacement is prescribed.
    fn prescribe(&mut self, places: &Places<'_, D>) {
        let Some(holds) = places.holds else { return };
        let cells = self.held.keys();
        let nodes = cells.flat_map(|cell| block(*cell, cell.map(|i| i + 1)));
        let nodes: BTreeSet<Index<D>> = nodes.collect();
        self.prescribed = (nodes.into_iter())
            .filter(|node| holds(&self.node(node)))
            .collect();
    }

    /// Refuses a patch whose cells hold several materials.
    pub fn check_materials(&self, material: &dyn Fn(u32) -> u16) -> Result<(), PatchError> {
        let mut first = None;
        for index in &self.all {
            for &(c, _) in &self.held[index] {
                if *first.get_or_insert_with(|| material(c)) != material(c) {
                    return Err(PatchError::Materials {
                        position: self.cells.centre(index).iter().copied().collect(),
                    });
                }
            }
        }
        Ok(())
    }

    /// Part of a cell that lies in the body.
    pub fn part(&self, index: &Index<D>) -> f64 {
        let volume: f64 = (self.held.get(index)).map_or(0.0, |own| own.iter().map(|p| p.1).sum());
        volume / self.cells.spacing.powi(D as i32)
    }

    /// Returns true if anything of the body lies in a cell.
    pub fn is_material(&self, index: &Index<D>) -> bool {
        self.part(index) > PART
    }

    /// Takes a cell into the patch, if any of it lies in the body.
    fn add(&mut self, index: Index<D>) {
        // what lies beyond a cell has to be known
        let (low, high) = self.limits;
        if (0..D).any(|i| index[i] <= low[i] || index[i] >= high[i]) {
            self.is_known = false;
        } else if self.is_material(&index) {
            self.all.insert(index);
        }
    }

    /// Refuses a rim around one of whose nodes the body is not of one piece: an element of the rim would bridge a slit.
    pub fn check_connected(&self, mesh: &Mesh<D>) -> Result<(), PatchError> {
        let least = PART * self.cells.spacing.powi(D as i32);
        let nodes: BTreeSet<Index<D>> = (self.all.iter().filter(|cell| self.is_rim(cell)))
            .flat_map(|cell| block(*cell, cell.map(|i| i + 1)))
            .collect();
        let nodes: Vec<Index<D>> = nodes.into_iter().collect();
        let torn = parallel::map(nodes.len(), 16, |k| {
            let around = block(nodes[k].map(|i| i - 1), nodes[k]);
            let rim = around.filter(|cell| self.is_rim(cell));
            let held = rim.flat_map(|cell| self.held[&cell].iter());
            let mut cells: Vec<u32> = held
                .filter(|part| part.1 > least)
                .map(|part| part.0)
                .collect();
            cells.sort_unstable();
            cells.dedup();
            !hang_together(mesh, &cells)
        });
        match torn.iter().position(|torn| *torn) {
            None => Ok(()),
            Some(k) => Err(PatchError::Torn {
                position: self.node(&nodes[k]).iter().copied().collect(),
            }),
        }
    }

    /// Takes the cells around a place into the patch, and returns true if there are some that lie in the body.
    pub fn absorb(&mut self, place: &Vector<D>) -> bool {
        let at = self.cells.index(place);
        self.take(block(at.map(|i| i - 1), at.map(|i| i + 1)))
    }

    /// Takes cells into the patch, and returns true if there are some that lie in the body.
    pub fn take(&mut self, cells: impl IntoIterator<Item = Index<D>>) -> bool {
        let before = self.all.len();
        for index in cells {
            self.add(index);
        }
        self.fill();
        self.is_known && self.all.len() > before
    }

    /// Takes in what the patch must have too, until nothing is missing.
    fn fill(&mut self) {
        while self.is_known
            && let Some(missing) = self.missing()
        {
            for index in missing {
                self.add(index);
            }
        }
    }

    /// Returns true if the surface of the body cuts a cell of the patch.
    pub fn is_cut(&self, index: &Index<D>) -> bool {
        self.part(index) < 1.0 - PART
    }

    /// Returns true if a cell is one of the rim.
    pub fn is_rim(&self, index: &Index<D>) -> bool {
        self.all.contains(index) && !self.zone.contains(index)
    }

    /// Returns true if no element of the rim around a node has enough of its volume in the body.
    pub fn is_bad(&self, node: &Index<D>) -> bool {
        let mut around = block(node.map(|i| i - 1), *node);
        !around.any(|cell| self.is_rim(&cell) && self.part(&cell) >= GOOD)
    }

    /// Returns true if a node of Γ may follow the mesh.
    fn may_follow(&self, node: &Index<D>) -> bool {
        !self.is_bad(node) && !self.prescribed.contains(node)
    }

    /// The faces between the patch and the body beyond it.
    pub fn faces(&self) -> Vec<Face<D>> {
        let mut faces = self.outer_faces();
        faces.retain(|face| self.is_material(&face.neighbour()));
        faces
    }

    /// The faces at which the patch ends.
    pub fn outer_faces(&self) -> Vec<Face<D>> {
        let mut faces = Vec::new();
        for &cell in &self.all {
            for axis in 0..D {
                for is_upper in [false, true] {
                    let face = Face {
                        cell,
                        axis,
                        is_upper,
                    };
                    if !self.all.contains(&face.neighbour()) {
                        faces.push(face);
                    }
                }
            }
        }
        faces
    }

    /// The axis of the plane part of Γ that each node of it belongs to: the lowest, unless in 2D a face of another part would keep no node, and those of the lowest keep another.
    pub fn axes(&self, faces: &[Face<D>]) -> BTreeMap<Index<D>, usize> {
        if self.orders_parts {
            let faces: Vec<_> = faces.iter().map(|f| (f.axis, f.nodes())).collect();
            return plane_parts::axes(&faces, |node| self.may_follow(node));
        }
        let mut axes = BTreeMap::new();
        let mut around: BTreeMap<Index<D>, Vec<usize>> = BTreeMap::new();
        for (f, face) in faces.iter().enumerate() {
            for node in face.nodes() {
                let own = axes.entry(node).or_insert(face.axis);
                *own = face.axis.min(*own);
                around.entry(node).or_default().push(f);
            }
        }
        for face in faces {
            // rows of parts that take of one another need not resolve in 3D: there the patch takes the cell in
            if D > 2 || self.kept(face, &axes).next().is_some() {
                continue;
            }
            let nodes = face.nodes();
            let mut free = nodes.iter().filter(|node| {
                let mut of_part = around[*node]
                    .iter()
                    .filter(|f| faces[**f].axis == axes[*node]);
                self.may_follow(node) && of_part.all(|f| self.kept(&faces[*f], &axes).count() > 1)
            });
            if let Some(node) = free.next() {
                axes.insert(*node, face.axis);
            }
        }
        axes
    }

    /// The nodes of a face, by their numbers within it, that belong to its plane part and follow the mesh.
    pub fn kept(
        &self,
        face: &Face<D>,
        axes: &BTreeMap<Index<D>, usize>,
    ) -> impl Iterator<Item = usize> {
        let is_kept = |node: &Index<D>| axes[node] == face.axis && self.may_follow(node);
        let nodes = face.nodes();
        let kept: Vec<usize> = (0..nodes.len()).filter(|&i| is_kept(&nodes[i])).collect();
        kept.into_iter()
    }

    /// Cells that the patch must have too: beside faces none of whose nodes belongs to their plane part, and where it touches itself along less than a face.
    fn missing(&self) -> Option<BTreeSet<Index<D>>> {
        let faces = self.faces();
        let axes = self.axes(&faces);
        let mut missing = BTreeSet::new();
        for face in &faces {
            if self.kept(face, &axes).next().is_none() {
                missing.insert(face.neighbour());
            }
        }
        for node in axes.keys() {
            let cells: Vec<Index<D>> = block(node.map(|i| i - 1), *node).collect();
            let (own, others): (Vec<_>, Vec<_>) =
                cells.into_iter().partition(|c| self.all.contains(c));
            if !is_connected(&own) || !is_connected(&others) {
                missing.extend(others.into_iter().filter(|c| self.is_material(c)));
            }
        }
        (!missing.is_empty()).then_some(missing)
    }

    /// The part of a cell in the body, as simplices.
    pub fn pieces(&self, mesh: &Mesh<D>, index: &Index<D>) -> Vec<Simplex<D>> {
        let mut pieces = Vec::new();
        for &(c, _) in &self.held[index] {
            let is_here = |low: &Index<D>, high: &Index<D>| {
                (0..D).all(|i| low[i] <= index[i] && high[i] >= index[i])
            };
            for simplex in simplices_of(mesh, c as usize) {
                self.cells.dice(&simplex, &is_here, &mut |at, part| {
                    if at == *index {
                        pieces.push(*part);
                    }
                });
            }
        }
        pieces
    }

    /// Position of a node of the lattice's cells.
    pub fn node(&self, index: &Index<D>) -> Vector<D> {
        self.cells.centre(index) - Vector::repeat(0.5 * self.cells.spacing)
    }
}

/// Returns true if cells of the mesh hang together by nodes.
fn hang_together<const D: usize>(mesh: &Mesh<D>, cells: &[u32]) -> bool {
    let mut rest: Vec<u32> = cells.to_vec();
    let mut reached: Vec<u32> = rest.pop().into_iter().collect();
    let mut k = 0;
    while k < reached.len() {
        let own = mesh.corners(reached[k] as usize);
        rest.retain(|&c| {
            let touches = mesh.corners(c as usize).iter().any(|n| own.contains(n));
            if touches {
                reached.push(c);
            }
            !touches
        });
        k += 1;
    }
    rest.is_empty()
}

/// Returns true if the cells around a node hang together by faces.
fn is_connected<const D: usize>(cells: &[Index<D>]) -> bool {
    let mut reached: Vec<Index<D>> = cells.iter().take(1).copied().collect();
    let mut k = 0;
    while k < reached.len() {
        for other in cells {
            let apart: i32 = (0..D).map(|i| (other[i] - reached[k][i]).abs()).sum();
            if apart == 1 && !reached.contains(other) {
                reached.push(*other);
            }
        }
        k += 1;
    }
    reached.len() == cells.len()
}

/// The cells from one corner to another, both included.
pub(super) fn block<const D: usize>(
    from: Index<D>,
    to: Index<D>,
) -> impl Iterator<Item = Index<D>> {
    let counts: [usize; D] = std::array::from_fn(|i| (to[i] - from[i] + 1).max(0) as usize);
    (0..counts.iter().product::<usize>()).map(move |number| {
        let mut rest = number;
        std::array::from_fn(|i| {
            let k = rest % counts[i];
            rest /= counts[i];
            from[i] + k as i32
        })
    })
}

/// The cells from one corner to another whose centre is wanted.
fn wanted<const D: usize>(
    cells: &Cells<D>,
    (from, to): (Index<D>, Index<D>),
    places: &Places<'_, D>,
) -> BTreeSet<Index<D>> {
    let layers = (to[0] - from[0] + 1).max(0) as usize;
    let of_layer = |k: usize| -> Vec<Index<D>> {
        let (mut low, mut high) = (from, to);
        low[0] += k as i32;
        high[0] = low[0];
        let all = block(low, high);
        all.filter(|index| (places.is_wanted)(&cells.centre(index)))
            .collect()
    };
    parallel::map(layers, 1, of_layer)
        .concat()
        .into_iter()
        .collect()
}

/// Cells with all around them up to a number of cells along each axis, of those between two corners.
fn grown<const D: usize>(
    mut cells: BTreeSet<Index<D>>,
    by: i32,
    (low, high): (Index<D>, Index<D>),
) -> BTreeSet<Index<D>> {
    for axis in 0..D {
        let along = |index: &Index<D>| {
            let (from, to) = (index[axis] - by, index[axis] + by);
            let mut index = *index;
            (from.max(low[axis])..=to.min(high[axis])).map(move |i| {
                index[axis] = i;
                index
            })
        };
        cells = cells.iter().flat_map(along).collect();
    }
    cells
}

/// The corners of the box around cells.
fn extent<const D: usize>(cells: &BTreeSet<Index<D>>) -> Option<(Index<D>, Index<D>)> {
    let first = *cells.first()?;
    Some(cells.iter().fold((first, first), |(low, high), index| {
        (
            std::array::from_fn(|i| low[i].min(index[i])),
            std::array::from_fn(|i| high[i].max(index[i])),
        )
    }))
}

/// The cells of the mesh in each cell of the lattice between two corners, with the volume of the part there.
fn held<const D: usize>(
    mesh: &Mesh<D>,
    cells: &Cells<D>,
    limits: (Index<D>, Index<D>),
) -> BTreeMap<Index<D>, Vec<(u32, f64)>> {
    let mut held: BTreeMap<Index<D>, Vec<(u32, f64)>> = BTreeMap::new();
    let each = parallel::map(mesh.cell_count(), 64, |c| parts(mesh, cells, limits, c));
    for (c, parts) in each.into_iter().enumerate() {
        for (index, volume) in parts {
            held.entry(index).or_default().push((c as u32, volume));
        }
    }
    held
}

/// Volumes of the parts of a cell of the mesh in cells of the lattice between two corners.
fn parts<const D: usize>(
    mesh: &Mesh<D>,
    cells: &Cells<D>,
    (from, to): (Index<D>, Index<D>),
    c: usize,
) -> BTreeMap<Index<D>, f64> {
    let meets =
        |low: &Index<D>, high: &Index<D>| (0..D).all(|i| low[i] <= to[i] && high[i] >= from[i]);
    let mut parts: BTreeMap<Index<D>, f64> = BTreeMap::new();
    let (low, high) = mesh.bounds_of(mesh.corners(c));
    let (low, high) = cells.range(&low, &high);
    if meets(&low, &high) {
        for simplex in simplices_of(mesh, c) {
            cells.dice(&simplex, &meets, &mut |index, part| {
                *parts.entry(index).or_insert(0.0) += part.size();
            });
        }
    }
    parts
}
