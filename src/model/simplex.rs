//! Simplices and boxes diced by the planes between the cells of a lattice.

use crate::{
    fem,
    mesh::{CellShape, Mesh, facet_corners},
    tensor::Vector,
};

/// A simplex of any dimension up to `D`.
///
/// Shapes: `corners` beyond `count`, its dimension plus one, have no meaning.
#[derive(Clone, Copy, Debug)]
pub(in crate::model) struct Simplex<const D: usize> {
    pub corners: [Vector<D>; 4],
    pub count: usize,
}

/// Abscissae and weights of the three-point Gauss rule on [0, 1].
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_31, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

impl<const D: usize> Simplex<D> {
    pub fn of(corners: &[Vector<D>]) -> Self {
        Self {
            corners: std::array::from_fn(|i| corners[i.min(corners.len() - 1)]),
            count: corners.len(),
        }
    }

    /// Length, area or volume; 1 of a point.
    pub fn size(&self) -> f64 {
        let e = |i: usize| self.corners[i] - self.corners[0];
        match (self.count, D) {
            (2, _) => e(1).norm(),
            (3, 2) => 0.5 * (e(1)[0] * e(2)[1] - e(1)[1] * e(2)[0]).abs(),
            (3, _) => 0.5 * cross(&e(1), &e(2)).norm(),
            (4, _) => cross(&e(1), &e(2)).dot(&e(3)).abs() / 6.0,
            _ => 1.0,
        }
    }

    /// Mean of its corners.
    pub fn centre(&self) -> Vector<D> {
        self.corners[..self.count].iter().sum::<Vector<D>>() / self.count as f64
    }

    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> (Vector<D>, Vector<D>) {
        let own = self.corners[..self.count].iter();
        own.fold((self.corners[0], self.corners[0]), |(low, high), x| {
            (low.inf(x), high.sup(x))
        })
    }

    /// Visits the points of a rule that is exact to degree 3: three Gauss points along each edge of a collapsed cube.
    pub fn quadrature(&self, mut visit: impl FnMut(Vector<D>, f64)) {
        let dimension = self.count - 1;
        let size = self.size();
        for index in 0..3usize.pow(dimension as u32) {
            let mut rest = index;
            let (mut x, mut weight) = (self.corners[0], size);
            // each coordinate draws the point towards the next corner; the face shrinks with the powers of what is left
            for k in 1..=dimension {
                let (s, w) = GAUSS[rest % 3];
                rest /= 3;
                x = x * (1.0 - s) + self.corners[k] * s;
                // the simplex of k + 1 corners from that of k: k (1 − s)^(k − 1) ds, its mass near the old ones
                weight *= w * k as f64 * (1.0 - s).powi(k as i32 - 1);
            }
            visit(x, weight);
        }
    }

    /// Its section by the plane `x[axis] = at`, of one dimension less: one simplex, or two where the plane parts its corners two and two.
    pub fn section(&self, axis: usize, at: f64) -> Vec<Self> {
        let height = |i: usize| self.corners[i][axis] - at;
        let (below, above): (Vec<usize>, Vec<usize>) =
            (0..self.count).partition(|&i| height(i) < 0.0);
        let between = |p: usize, q: usize| {
            let t = height(p) / (height(p) - height(q));
            let mut x = self.corners[p] + (self.corners[q] - self.corners[p]) * t;
            x[axis] = at;
            x
        };
        let all: Vec<Vector<D>> = (below.iter())
            .flat_map(|&p| above.iter().map(move |&q| between(p, q)))
            .collect();
        match (all.len(), self.count) {
            (0, _) => Vec::new(),
            // two edges from each of two corners: neighbours share a corner
            (4, 4) => vec![
                Self::of(&[all[0], all[1], all[2]]),
                Self::of(&[all[1], all[2], all[3]]),
            ],
            _ => vec![Self::of(&all)],
        }
    }

    /// The same with one coordinate of all corners.
    pub fn moved_to(&self, axis: usize, at: f64) -> Self {
        let mut moved = *self;
        moved.corners.iter_mut().for_each(|x| x[axis] = at);
        moved
    }

    /// The same at another place.
    pub fn shifted(&self, by: &Vector<D>) -> Self {
        let mut moved = *self;
        moved.corners.iter_mut().for_each(|x| *x += by);
        moved
    }

    /// Its two halves, cut at the middle of the longest edge.
    pub fn halves(&self) -> [Self; 2] {
        let pairs = (0..self.count).flat_map(|i| (0..i).map(move |j| (i, j)));
        let length = |(i, j): (usize, usize)| (self.corners[i] - self.corners[j]).norm();
        let longest = pairs.max_by(|&a, &b| length(a).total_cmp(&length(b)));
        let (i, j) = longest.unwrap_or((0, 0));
        let middle = (self.corners[i] + self.corners[j]) / 2.0;
        [i, j].map(|k| {
            let mut half = *self;
            half.corners[k] = middle;
            half
        })
    }

    /// Cuts it by the plane `x[axis] = at`; hands what is below and above to `visit`, as simplices.
    pub fn cut(&self, axis: usize, at: f64, tolerance: f64, visit: &mut dyn FnMut(bool, &Self)) {
        self.cut_by(&|x| x[axis] - at, &|x| x[axis] = at, tolerance, visit);
    }

    /// Cuts it by the plane whose distance from a position is a `height`; `settle` moves what rounding leaves beside the plane onto it.
    pub fn cut_by(
        &self,
        height: &impl Fn(&Vector<D>) -> f64,
        settle: &impl Fn(&mut Vector<D>),
        tolerance: f64,
        visit: &mut dyn FnMut(bool, &Self),
    ) {
        let heights = self.corners.map(|x| height(&x));
        let below = (0..self.count).find(|&i| heights[i] < -tolerance);
        let above = (0..self.count).find(|&i| heights[i] > tolerance);
        let (Some(p), Some(q)) = (below, above) else {
            visit(above.is_some(), self);
            return;
        };
        let t = heights[p] / (heights[p] - heights[q]);
        let mut x = self.corners[p] + (self.corners[q] - self.corners[p]) * t;
        settle(&mut x);
        for replaced in [p, q] {
            let mut part = *self;
            part.corners[replaced] = x;
            part.cut_by(height, settle, tolerance, visit);
        }
    }
}

fn cross<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> Vector<D> {
    Vector::from_fn(|k, _| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i.min(D - 1)] * b[j.min(D - 1)] - a[j.min(D - 1)] * b[i.min(D - 1)]
    })
}

/// The cells of a lattice, by planes half a spacing off its points.
#[derive(Clone, Copy, Debug)]
pub(in crate::model) struct Cells<const D: usize> {
    pub origin: Vector<D>,
    pub spacing: f64,
}

impl<const D: usize> Cells<D> {
    /// The cell that holds a position.
    pub fn index(&self, x: &Vector<D>) -> [i32; D] {
        std::array::from_fn(|i| ((x[i] - self.origin[i]) / self.spacing).round() as i32)
    }

    /// The middle of a cell.
    pub fn centre(&self, index: &[i32; D]) -> Vector<D> {
        self.origin + Vector::from_fn(|i, _| f64::from(index[i]) * self.spacing)
    }

    /// The cells that a box meets with more than a face.
    pub fn range(&self, low: &Vector<D>, high: &Vector<D>) -> ([i32; D], [i32; D]) {
        let slack = 1e-9;
        (
            std::array::from_fn(|i| {
                ((low[i] - self.origin[i]) / self.spacing - 0.5 + slack).ceil() as i32
            }),
            std::array::from_fn(|i| {
                ((high[i] - self.origin[i]) / self.spacing + 0.5 - slack).floor() as i32
            }),
        )
    }

    /// The cells that a simplex meets; an extent of no size lies between two cells: the one that holds its middle.
    pub fn range_of(&self, simplex: &Simplex<D>) -> ([i32; D], [i32; D]) {
        let (low, high) = simplex.bounds();
        let (from, to) = self.range(&low, &high);
        let middle = self.index(&simplex.centre());
        (
            std::array::from_fn(|i| from[i].min(middle[i])),
            std::array::from_fn(|i| to[i].max(middle[i])),
        )
    }

    /// The plane between a layer of cells across an axis and the next, and the distance from it that is none.
    pub fn plane_above(&self, axis: usize, layer: i32) -> (f64, f64) {
        let plane = self.origin[axis] + (f64::from(layer) + 0.5) * self.spacing;
        (plane, 1e-10 * self.spacing)
    }

    /// Dices a simplex; hands each part with its cell to `visit`. Parts in cells that `wanted` refuses, by ranges, may be left out.
    pub fn dice(
        &self,
        simplex: &Simplex<D>,
        wanted: &dyn Fn(&[i32; D], &[i32; D]) -> bool,
        visit: &mut dyn FnMut([i32; D], &Simplex<D>),
    ) {
        let (low, high) = simplex.bounds();
        let middle = self.index(&simplex.centre());
        let (from, to) = self.range_of(simplex);
        if !wanted(&from, &to) {
            return;
        }
        let longest = (0..D).max_by_key(|&i| to[i] - from[i]).unwrap_or(0);
        if to[longest] == from[longest] {
            visit(middle, simplex);
            return;
        }
        let half = from[longest] + (to[longest] - from[longest] - 1) / 2;
        let (plane, tolerance) = self.plane_above(longest, half);
        let straddles = low[longest] < plane - tolerance && high[longest] > plane + tolerance;
        if !straddles {
            visit(middle, simplex);
            return;
        }
        simplex.cut(longest, plane, tolerance, &mut |_, part| {
            self.dice(part, wanted, visit);
        });
    }
}

/// The corners of a cell of a mesh as simplices: a quadrilateral as two triangles, a hexahedron with plane faces as six tetrahedra around its diagonal. A divided quadrilateral, and any other solid, is divided from its centre, a bent face from
/// its own: the volume of a trilinear hexahedron is that of these 24 tetrahedra [Grandy 1997, UCRL-ID-128886], and neighbours divide their face alike.
pub(in crate::model) fn simplices_of<const D: usize>(mesh: &Mesh<D>, c: usize) -> Vec<Simplex<D>> {
    match mesh.embedded.pieces.get(&(c as u32)) {
        Some(pieces) => pieces.iter().map(|x| Simplex::of(&x[..=D])).collect(),
        None => whole_simplices(mesh, c),
    }
}

/// As [`simplices_of`], of a cell as if it were whole.
pub(in crate::model) fn whole_simplices<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
) -> Vec<Simplex<D>> {
    let x: Vec<Vector<D>> = mesh
        .corners(c)
        .iter()
        .map(|&n| mesh.nodes[n as usize])
        .collect();
    let of = |corners: &[usize]| {
        let corners: Vec<Vector<D>> = corners.iter().map(|&i| x[i]).collect();
        Simplex::of(&corners)
    };
    match mesh.shapes[c].linear() {
        CellShape::Vertex => Vec::new(),
        CellShape::Line2 | CellShape::Tri3 | CellShape::Tet4 => vec![Simplex::of(&x)],
        CellShape::Quad4 if mesh.embedded.is_divided(c) => around_middle(&x),
        CellShape::Quad4 => {
            let parts = [of(&[0, 1, 2]), of(&[0, 2, 3])];
            let others = [of(&[1, 2, 3]), of(&[1, 3, 0])];
            // where a corner points inwards, only one of the diagonals lies within
            let sum = |s: &[Simplex<D>; 2]| s[0].size() + s[1].size();
            match sum(&parts) <= sum(&others) * (1.0 + 1e-12) {
                true => parts.to_vec(),
                false => others.to_vec(),
            }
        }
        CellShape::Hex8 if !mesh.embedded.is_divided(c) && has_plane_faces(CellShape::Hex8, &x) => {
            [
                [0, 1, 2, 6],
                [0, 2, 3, 6],
                [0, 3, 7, 6],
                [0, 7, 4, 6],
                [0, 4, 5, 6],
                [0, 5, 1, 6],
            ]
            .iter()
            .map(|corners| of(corners))
            .collect()
        }
        solid => {
            let centre = x.iter().sum::<Vector<D>>() / x.len() as f64;
            let faces = solid.facets().iter();
            let triangles = faces.flat_map(|face| {
                let corners: Vec<Vector<D>> = face.iter().map(|&i| x[i]).collect();
                let middle = corners.iter().sum::<Vector<D>>() / corners.len() as f64;
                match corners.len() {
                    3 => vec![[corners[0], corners[1], corners[2]]],
                    n => (0..n)
                        .map(|i| [corners[i], corners[(i + 1) % n], middle])
                        .collect(),
                }
            });
            triangles
                .map(|[a, b, c]| Simplex::of(&[a, b, c, centre]))
                .collect()
        }
    }
}

/// Returns true if all corners of each face of a cell lie in one plane.
fn has_plane_faces<const D: usize>(shape: CellShape, x: &[Vector<D>]) -> bool {
    shape.facets().iter().all(|face| {
        let e = |i: usize| x[face[i]] - x[face[0]];
        face.len() < 4 || {
            let normal = cross(&e(1), &e(2));
            normal.dot(&e(3)).abs() <= 1e-12 * normal.norm() * e(3).norm()
        }
    })
}

/// A quadrilateral as four triangles around the mean of its corners.
pub(in crate::model) fn around_middle<const D: usize>(x: &[Vector<D>]) -> Vec<Simplex<D>> {
    let middle = x.iter().sum::<Vector<D>>() / x.len() as f64;
    let triangle = |a: usize| Simplex::of(&[x[a], x[(a + 1) % x.len()], middle]);
    (0..x.len()).map(triangle).collect()
}

/// A facet as simplices: a quadrilateral as two triangles.
pub(in crate::model) fn facet_simplices<const D: usize>(
    mesh: &Mesh<D>,
    facet: &[u32],
) -> Vec<Simplex<D>> {
    let facet = facet_corners::<D>(facet).iter();
    let x: Vec<Vector<D>> = facet.map(|&n| mesh.nodes[n as usize]).collect();
    match x.len() {
        0 => Vec::new(),
        4 => vec![
            Simplex::of(&[x[0], x[1], x[2]]),
            Simplex::of(&[x[0], x[2], x[3]]),
        ],
        _ => vec![Simplex::of(&x)],
    }
}

/// The corners of a cell that is a box along the axes, if it is one.
pub(in crate::model) fn as_box<const D: usize>(
    mesh: &Mesh<D>,
    c: usize,
) -> Option<(Vector<D>, Vector<D>)> {
    if mesh.embedded.cut_cell(c).is_some() {
        return None;
    }
    let nodes = mesh.corners(c);
    let (low, high) = mesh.bounds_of(nodes);
    let at_corner = |x: &Vector<D>| (0..D).all(|i| x[i] == low[i] || x[i] == high[i]);
    let fills = nodes.len() == 1 << D && nodes.iter().all(|&n| at_corner(&mesh.nodes[n as usize]));
    fills.then_some((low, high))
}

/// Visits the two Gauss points along each axis of a box, with their weights: exact to degree 3 in each coordinate.
pub(in crate::model) fn box_quadrature<const D: usize>(
    low: &Vector<D>,
    high: &Vector<D>,
    mut visit: impl FnMut(Vector<D>, f64),
) {
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let weight = (high - low).product() / f64::from(1 << D);
    for index in 0..1usize << D {
        let x = Vector::<D>::from_fn(|i, _| {
            let sign = if index >> i & 1 == 1 { 1.0 } else { -1.0 };
            middle[i] + sign * half[i] / 3f64.sqrt()
        });
        visit(x, weight);
    }
}

/// Volume and first moment of the cells of a mesh, by their own quadrature.
pub(in crate::model) fn moments_of_cells<const D: usize>(
    mesh: &Mesh<D>,
    cells: impl Iterator<Item = usize>,
    about: &Vector<D>,
) -> (f64, Vector<D>) {
    let (mut volume, mut moment) = (0.0, Vector::zeros());
    for c in cells {
        fem::for_each_point(mesh, c, fem::Rule::Mass, |p| {
            volume += p.weight;
            moment += (p.position - about) * p.weight;
        });
    }
    (volume, moment)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::sample::{boxes, noise};

    fn random<const D: usize>(seed: usize) -> Simplex<D> {
        let corners: Vec<Vector<D>> = (0..=D)
            .map(|i| Vector::from_fn(|k, _| 3.0 * noise(seed * 7 + i, k)))
            .collect();
        Simplex::of(&corners)
    }

    fn diced<const D: usize>() {
        let cells = Cells {
            origin: Vector::<D>::repeat(0.13),
            spacing: 0.7,
        };
        for seed in 0..20 {
            let simplex = random::<D>(seed);
            let (mut size, mut moment) = (0.0, Vector::<D>::zeros());
            cells.dice(&simplex, &|_, _| true, &mut |index, part| {
                let (low, high) = part.bounds();
                let away = (low - cells.centre(&index))
                    .abs()
                    .max()
                    .max((high - cells.centre(&index)).abs().max());
                assert!(away < 0.35 + 1e-8, "{away}");
                size += part.size();
                moment += part.centre() * part.size();
            });
            assert!((size - simplex.size()).abs() < 1e-14 * 9.0);
            assert!((moment - simplex.centre() * simplex.size()).amax() < 1e-13);
        }
    }

    #[test]
    fn parts_add_up_and_stay_in_their_cells() {
        diced::<1>();
        diced::<2>();
        diced::<3>();
    }

    #[test]
    fn rules_are_exact_to_degree_three() {
        // Dirichlet's integral of x^a y^b z^c over the unit simplex
        let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
        let mut corners = vec![Vector::<3>::zeros()];
        corners.extend((0..3).map(|k| Vector::<3>::from_fn(|i, _| f64::from(u8::from(i == k)))));
        let simplex = Simplex::of(&corners);
        for (a, b, c) in [(0, 0, 0), (1, 0, 0), (0, 2, 1), (1, 1, 1), (0, 0, 3)] {
            let exact = factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 3);
            let mut sum = 0.0;
            simplex.quadrature(|x, w| sum += w * x[0].powi(a) * x[1].powi(b) * x[2].powi(c));
            assert!((sum - exact).abs() < 1e-15, "{a} {b} {c}: {sum} {exact}");
        }
    }

    fn whole<const D: usize>() {
        for mesh in boxes::<D>(3, 0.2) {
            for c in 0..mesh.cell_count() {
                let size: f64 = simplices_of(&mesh, c).iter().map(Simplex::size).sum();
                let exact = fem::cell_volume(&mesh, c);
                assert!((size - exact).abs() < 1e-14, "{size} {exact}");
            }
        }
    }

    #[test]
    fn simplices_fill_their_cell() {
        whole::<1>();
        whole::<2>();
        whole::<3>();
    }
}
