//! Elements of a mesh that a patch cuts or covers.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    cells::{Face, GOOD, Index, PatchCells},
    error::PatchError,
    moments::PartMoments,
};
use crate::{
    fem,
    mesh::{CellShape, CutCell, Mesh},
    model::simplex::simplices_of,
    parallel,
    tensor::Vector,
};

/// Part of a cell's volume below which nothing is left of it.
pub(super) const NOTHING: f64 = 1e-10;

/// Distance of a corner of a parallelogram from where the others want it, over its shortest side, that rounding leaves.
const ROUNDING: f64 = 1e-10;

/// Mean of a shape function over what is left of a cell, over that in the whole cell, below which that is too little for the node.
const BORNE: f64 = 0.3;

/// The elements that a patch cuts.
pub(super) struct Cuts {
    /// Rules of those of which a part is left; none of those that the patch covers.
    of_cell: BTreeMap<u32, Option<CutCell>>,
    /// Those of which too little is left for all their nodes.
    poor: BTreeSet<u32>,
}

impl Cuts {
    /// The elements that a patch cuts; `has_masses` if every node needs a mass.
    pub fn new<const D: usize>(
        mesh: &Mesh<D>,
        patch: &PatchCells<D>,
        has_masses: bool,
    ) -> Result<Self, PatchError> {
        let mut met: Vec<u32> = (patch.all.iter())
            .flat_map(|index| patch.held[index].iter().map(|part| part.0))
            // also what is divided since it touches the patch
            .chain(mesh.embedded.divided.iter().copied())
            .collect();
        met.sort_unstable();
        met.dedup();
        let found = parallel::map(met.len(), 8, |k| {
            let c = met[k] as usize;
            let (outside, inside) = parts(mesh, patch, c);
            let whole = mesh.cell_volume(c).abs();
            let size: f64 = outside.iter().map(|part| part.size).sum();
            if size <= NOTHING * whole {
                return Ok(Some((met[k], None)));
            }
            if inside <= NOTHING * whole && !mesh.embedded.is_divided(c) {
                return Ok(None);
            }
            let central: Vec<_> = outside.iter().map(PartMoments::central).collect();
            let rule = may_be_cut(mesh, c).then(|| fem::rule_of_parts(mesh, c, &central));
            match rule.flatten() {
                Some(rule) => Ok(Some((met[k], Some(rule)))),
                None => Err(PatchError::Kind {
                    cell: c,
                    shape: mesh.shapes[c],
                    position: mesh.centroid(c).iter().copied().collect(),
                }),
            }
        });
        let mut of_cell = BTreeMap::new();
        for cut in found {
            of_cell.extend(cut?);
        }
        let is_poor = |c: u32, rule: &CutCell| {
            rule.fraction < GOOD || has_masses && least_mean(mesh, c as usize, rule) < BORNE
        };
        let rules = of_cell.iter();
        let poor = rules.filter_map(|(&c, rule)| is_poor(c, rule.as_ref()?).then_some(c));
        Ok(Self {
            poor: poor.collect(),
            of_cell,
        })
    }

    /// Returns true if the patch covers a cell.
    pub fn is_covered(&self, c: u32) -> bool {
        matches!(self.of_cell.get(&c), Some(None))
    }

    /// The rule of a cell that is cut.
    pub fn rule(&self, c: u32) -> Option<&CutCell> {
        self.of_cell.get(&c)?.as_ref()
    }

    /// Returns true if enough is left of a cell for its nodes.
    pub fn is_good(&self, c: u32) -> bool {
        !self.poor.contains(&c) && !self.is_covered(c)
    }

    /// Returns true if the patch covers a cell or a part of it.
    pub fn is_met(&self, c: u32) -> bool {
        self.of_cell.contains_key(&c)
    }

    /// Cells of the lattice between the patch and a surface of the body whose elements have too little left for nodes of their own: these would follow elements far along the strip.
    pub fn strips<const D: usize>(
        &self,
        mesh: &Mesh<D>,
        patch: &PatchCells<D>,
        is_held: &dyn Fn(u32) -> bool,
    ) -> Vec<Index<D>> {
        let bears = |c: u32| self.is_good(c) || mesh.cell(c as usize).iter().any(|&n| is_held(n));
        let faces = patch.faces().into_iter();
        let strips = faces.filter_map(|face| {
            let cell = face.neighbour();
            let beyond = Face { cell, ..face }.neighbour();
            let left = patch.held[&cell]
                .iter()
                .filter(|(c, _)| !self.is_covered(*c));
            let is_strip = !patch.is_material(&beyond) && !left.into_iter().any(|(c, _)| bears(*c));
            is_strip.then_some(cell)
        });
        strips.collect()
    }

    /// The cells that are cut.
    pub fn cut(&self) -> impl Iterator<Item = (u32, &CutCell)> {
        (self.of_cell.iter()).filter_map(|(&c, rule)| Some((c, rule.as_ref()?)))
    }
}

/// The least mean of a shape function of a cell, of one of second order those of its corners, over what is left of it, over that in the whole cell.
fn least_mean<const D: usize>(mesh: &Mesh<D>, c: usize, rule: &CutCell) -> f64 {
    let (mut size, mut sums) = (0.0, [0.0; 8]);
    let count = mesh.corners(c).len();
    let linear = fem::reference_cell(mesh.shapes[c].linear());
    for (xi, w) in &rule.mass {
        let shape = match linear.filter(|_| mesh.shapes[c].is_quadratic()) {
            Some(linear) => (linear.values)(xi),
            None => fem::shape_values(mesh, c, &Vector::from_fn(|i, _| xi[i])).0,
        };
        size += w;
        sums.iter_mut()
            .zip(shape)
            .for_each(|(sum, n)| *sum += w * n);
    }
    let least = sums[..count].iter().copied();
    least.fold(f64::INFINITY, f64::min) * count as f64 / size
}

/// The part of a cell outside the patch, of a divided one by its simplices, and the volume inside.
fn parts<const D: usize>(
    mesh: &Mesh<D>,
    patch: &PatchCells<D>,
    c: usize,
) -> (Vec<PartMoments<D>>, f64) {
    let is_divided = mesh.embedded.is_divided(c);
    let mut parts = Vec::new();
    let mut inside = 0.0;
    for simplex in simplices_of(mesh, c) {
        if is_divided || parts.is_empty() {
            parts.push(PartMoments::about(mesh.centroid(c)));
        }
        let outside = parts.last_mut().expect("a part was pushed");

        patch.cells.dice(
            &simplex,
            &|_, _| true,
            &mut |index, part| match patch.all.contains(&index) {
                true => inside += part.size(),
                false => outside.add(part),
            },
        );
    }
    parts.retain(|part| part.size > 0.0);
    (parts, inside)
}

/// Returns true if a cell may be cut: its shape functions are polynomials in space, or in each of its simplices.
fn may_be_cut<const D: usize>(mesh: &Mesh<D>, c: usize) -> bool {
    match mesh.shapes[c] {
        CellShape::Line2 | CellShape::Tri3 | CellShape::Tet4 => true,
        // their sides are straight
        CellShape::Line3 | CellShape::Tri6 | CellShape::Tet10 => true,
        CellShape::Quad4 | CellShape::Hex8 => match mesh.embedded.is_divided(c) {
            true => fem::may_be_divided(mesh, c),
            false => has_constant_jacobian(mesh, c),
        },
        _ => false,
    }
}

/// Returns true if a quadrilateral or a hexahedron is a parallelogram or a parallelepiped.
pub(super) fn has_constant_jacobian<const D: usize>(mesh: &Mesh<D>, c: usize) -> bool {
    match mesh.shapes[c] {
        CellShape::Quad4 => is_parallelogram(mesh, mesh.cell(c)),
        shape => (0..shape.facets().len() as u8)
            .all(|local| is_parallelogram(mesh, &mesh.facet((c as u32, local)).nodes)),
    }
}

/// Returns true if four corners, one after another, are those of a parallelogram.
fn is_parallelogram<const D: usize>(mesh: &Mesh<D>, corners: &[u32]) -> bool {
    let x = |i: usize| mesh.nodes[corners[i] as usize];
    let shortest = (x(1) - x(0)).norm().min((x(3) - x(0)).norm());
    (x(0) - x(1) + x(2) - x(3)).norm() <= ROUNDING * shortest
}
