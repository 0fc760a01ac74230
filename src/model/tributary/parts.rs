//! A region of the peridynamic zone, or of its surface, in parts that each follow sites.

use std::cell::OnceCell;

use super::found::{Detail, Found, FoundCells};
use super::{
    around::{Around, centroid_sites},
    grid::{Beyond, Follows, Grid},
    marks::Marks,
};
use crate::{
    fem,
    mesh::boundary::{BoundaryFacet, normal_area},
    model::{
        Model, PointSource, SiteKind,
        simplex::{Cells, Simplex, box_quadrature, facet_simplices, moments_of_cells},
    },
    parallel,
    shape::Shape,
    tensor::{Tensor, Vector},
};

/// Parts of a region with the sites that they follow.
///
/// A part is a cell of the lattice as far as it lies in the region (with points at centroids a cell of the mesh). Its place, the centre, is `Σ w x` of sites; the weights add up to one. The force on a part goes to its sites by the
/// weights, its moment about the centre by their gradients: the sites get its total and its first moment, since weights reproduce affine fields.
#[derive(Clone, Debug, Default)]
pub struct Parts<const D: usize> {
    /// Length, area or volume \[m^(D−1)\] or [m^D].
    size: Vec<f64>,
    centre: Vec<Vector<D>>,
    offsets: Vec<usize>,
    follows: Vec<Follows<D>>,
    quadrature_offsets: Vec<usize>,
    quadrature: Vec<(Vector<D>, f64)>,
    /// Of parts of a surface, the outward unit normal at each quadrature point.
    normals: Vec<Vector<D>>,
}

/// The cells of a lattice that the edge of a region or a void cuts, and the corners of the box around the region.
fn marked<const D: usize>(
    model: &Model<D>,
    mine: &[bool],
    cells: Cells<D>,
    voids: &[Shape<D>],
) -> (Marks<D>, [Vector<D>; 2]) {
    let mesh = &model.mesh;
    let own = || (0..mesh.cell_count()).filter(|&c| mine[c]);
    let mut nodes: Vec<u32> = own().flat_map(|c| mesh.cell(c).iter().copied()).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let (low, high) = mesh.bounds_of(&nodes);
    let mut marks = Marks::new(cells, &low, &high);
    for facet in mesh.boundary_facets(own().map(|c| c as u32)) {
        let (low, high) = mesh.bounds_of(&facet.nodes);
        marks.mark(&low, &high);
    }
    for &c in mesh.embedded.pieces.keys().filter(|&&c| mine[c as usize]) {
        let (low, high) = mesh.bounds_of(mesh.cell(c as usize));
        marks.mark(&low, &high);
    }
    marks.mark_voids(voids);
    (marks, [low, high])
}

/// Parts of the cells of a lattice that the edge of the region cuts, from the elements `own` of the region.
fn pieces_of<const D: usize>(
    model: &Model<D>,
    own: Vec<usize>,
    marks: &Marks<D>,
    voids: &[Shape<D>],
    detail: Detail,
) -> FoundCells<D> {
    let pieces: Vec<Vec<([i32; D], Found<D>)>> =
        parallel::map_slice(&own, |&c| marks.pieces(model, c, voids, detail));
    let mut found = FoundCells::default();
    for (index, piece) in pieces.into_iter().flatten() {
        found.entry(index).or_default().take_in(piece);
    }
    found
}

impl<const D: usize> Parts<D> {
    /// The parts of some cells that hold points; `counts` has one entry per cell of the mesh.
    pub fn of_cells(model: &Model<D>, counts: &[bool], detail: Detail) -> Self {
        let mut parts = Self::default();
        parts.close();
        let Some(p) = &model.peridynamics else {
            return parts;
        };
        match &p.points {
            PointSource::Cells => parts.add_centroids(model, counts, detail),
            PointSource::Lattice { .. } if model.nodes_are_points() => {
                parts.add_cubes(model, counts, detail);
            }
            _ => {
                for (number, cells) in lattices(model) {
                    let mine: Vec<bool> = (0..counts.len())
                        .map(|c| counts[c] && model.lattice_of_cell(c) == Some(number))
                        .collect();
                    if mine.contains(&true) {
                        parts.add_lattice(model, number, cells, &mine, Beyond::Follows, detail);
                    }
                }
            }
        }
        parts
    }

    /// The parts of cells as if the lattice of points went on in the elements among them; what its points there have is left out.
    pub fn of_continued_lattice(model: &Model<D>, counts: &[bool]) -> Self {
        let mut parts = Self::default();
        parts.close();
        if let [(number, cells)] = lattices(model)[..] {
            let beyond = Beyond::IsPoint;
            parts.add_lattice(model, number, cells, counts, beyond, Detail::Centre);
        }
        parts
    }

    /// The parts of facets of cells that hold points.
    pub fn of_facets(model: &Model<D>, facets: &[BoundaryFacet], detail: Detail) -> Self {
        let mut parts = Self::default();
        parts.close();
        let Some(p) = &model.peridynamics else {
            return parts;
        };
        if facets.is_empty() {
            return parts;
        }
        if p.points == PointSource::Cells {
            let own = centroid_sites(model);
            let around = Around::new(model);
            for facet in facets {
                let mut found = Found::default();
                for simplex in facet_simplices(&model.mesh, &facet.nodes) {
                    let normal = outward(model, facet, &simplex);
                    found.add_facet(&simplex, &Vector::zeros(), &normal, detail);
                }
                if found.size > 0.0 {
                    let x = found.moment / found.size;
                    let follows = own[facet.cell as usize].map(|s| around.place(model, s, &x));
                    parts.push(found, x, follows.unwrap_or_default(), detail);
                }
            }
            return parts;
        }
        for (number, cells) in lattices(model) {
            let mine = |f: &&BoundaryFacet| model.lattice_of_cell(f.cell as usize) == Some(number);
            let mine: Vec<&BoundaryFacet> = facets.iter().filter(mine).collect();
            if mine.is_empty() {
                continue;
            }
            let mut found = FoundCells::default();
            for facet in mine {
                let normal = model.mesh.facet_normal_area(facet);
                // of two cells between which a facet lies, the inner one
                let inwards = normal * (-1e-6 * cells.spacing / normal.norm());
                for simplex in facet_simplices(&model.mesh, &facet.nodes) {
                    let out = outward(model, facet, &simplex);
                    cells.dice(&simplex, &|_, _| true, &mut |_, part| {
                        let index = cells.index(&(part.centre() + inwards));
                        let middle = cells.centre(&index);
                        let piece = found.entry(index).or_default();
                        piece.add_facet(part, &middle, &out, detail);
                    });
                }
            }
            let grid = Grid::new(model, number, cells, Beyond::Follows, |_| true);
            parts.add_found(&grid, found, detail, f64::INFINITY);
        }
        parts
    }

    /// Single positions in the zone, as places without a size.
    pub fn of_places(model: &Model<D>, positions: &[Vector<D>]) -> Self {
        let mut parts = Self::default();
        parts.close();
        let lattices = lattices(model);
        // of several lattices nobody knows which one a position is of: the first that has points around
        let grids: Vec<Grid<'_, D>> = match positions {
            [] => Vec::new(),
            _ => lattices
                .into_iter()
                .map(|(number, cells)| Grid::new(model, number, cells, Beyond::Follows, |_| true))
                .collect(),
        };
        for x in positions {
            let follows = grids
                .iter()
                .map(|grid| grid.place(x, Detail::Centre))
                .next();
            parts.push(
                Found::default(),
                *x,
                follows.unwrap_or_default(),
                Detail::Quadrature,
            );
        }
        parts
    }

    /// Adds what the force of a field does to each site; `detail` has to suit the field.
    ///
    /// `field` is given the place and, of a part of a surface taken at its quadrature points, the outward unit normal there; else zero.
    pub fn each(
        &self,
        detail: Detail,
        field: impl Fn(&Vector<D>, &Vector<D>) -> Vector<D>,
        mut add: impl FnMut(usize, Vector<D>),
    ) {
        let none = Vector::zeros();
        for k in 0..self.size.len() {
            let follows = &self.follows[self.offsets[k]..self.offsets[k + 1]];
            if detail == Detail::Centre {
                let force = field(&self.centre[k], &none) * self.size[k];
                for (site, w, _) in follows {
                    if *w != 0.0 {
                        add(*site as usize, force * *w);
                    }
                }
                continue;
            }
            let (mut force, mut moment) = (Vector::zeros(), Tensor::zeros());
            let points = self.quadrature_offsets[k]..self.quadrature_offsets[k + 1];
            for q in points {
                let (x, weight) = &self.quadrature[q];
                let f = field(x, self.normals.get(q).unwrap_or(&none)) * *weight;
                force += f;
                moment += f * (x - self.centre[k]).transpose();
            }
            for (site, w, gradient) in follows {
                add(*site as usize, force * *w + moment * gradient);
            }
        }
    }

    /// Hands each point of the quadratures to `visit`: its place, its weight, the outward unit normal (zero but on a surface), and the sites that it follows with their weights.
    ///
    /// Parts have to be laid out with [`Detail::Quadrature`].
    pub fn each_point(&self, mut visit: impl FnMut(&Vector<D>, f64, &Vector<D>, &[(u32, f64)])) {
        let none = Vector::zeros();
        for k in 0..self.size.len() {
            let follows = &self.follows[self.offsets[k]..self.offsets[k + 1]];
            for q in self.quadrature_offsets[k]..self.quadrature_offsets[k + 1] {
                let (x, weight) = &self.quadrature[q];
                let arm = x - self.centre[k];
                let sites = follows.iter();
                let sites: Vec<(u32, f64)> = sites
                    .map(|(site, w, gradient)| (*site, w + gradient.dot(&arm)))
                    .collect();
                visit(x, *weight, self.normals.get(q).unwrap_or(&none), &sites);
            }
        }
    }

    /// Adds to each site what it has of the size of the parts.
    pub fn add_sizes(&self, sizes: &mut [f64]) {
        for k in 0..self.size.len() {
            for (site, w, _) in &self.follows[self.offsets[k]..self.offsets[k + 1]] {
                sizes[*site as usize] += w * self.size[k];
            }
        }
    }

    /// Sum of the sizes.
    pub fn total(&self) -> f64 {
        self.size.iter().sum()
    }

    /// Returns true if there are no parts.
    pub fn is_empty(&self) -> bool {
        self.size.is_empty()
    }

    /// The centre of each part, and the sites that it follows.
    pub fn places(&self) -> impl Iterator<Item = (&Vector<D>, &[Follows<D>])> {
        let follows = self.offsets.windows(2).map(|w| &self.follows[w[0]..w[1]]);
        self.centre.iter().zip(follows)
    }

    fn close(&mut self) {
        self.offsets.push(self.follows.len());
        self.quadrature_offsets.push(self.quadrature.len());
    }

    fn push(
        &mut self,
        found: Found<D>,
        centre: Vector<D>,
        follows: Vec<Follows<D>>,
        detail: Detail,
    ) {
        self.size.push(found.size);
        self.centre.push(centre);
        let needed = |f: &Follows<D>| detail == Detail::Quadrature || f.1 != 0.0;
        self.follows.extend(follows.into_iter().filter(needed));
        self.quadrature.extend(found.quadrature);
        self.normals.extend(found.normals);
        self.close();
    }

    /// Cells of the mesh, each with the point at its centroid.
    fn add_centroids(&mut self, model: &Model<D>, counts: &[bool], detail: Detail) {
        let own = centroid_sites(model);
        let around = OnceCell::new();
        let around = || around.get_or_init(|| Around::new(model));
        for c in (0..counts.len()).filter(|&c| counts[c]) {
            let Some(site) = own[c] else { continue };
            let mut found = Found::default();
            fem::for_each_point(&model.mesh, c, fem::Rule::Mass, |p| {
                found.size += p.weight;
                found.moment += p.position * p.weight;
                if detail == Detail::Quadrature {
                    found.quadrature.push((p.position, p.weight));
                }
            });
            // the mean of the nodes of a distorted cell is not quite its centre of gravity
            let x = found.moment / found.size;
            let off = (x - model.sites[site as usize].position).norm();
            let is_own = detail == Detail::Centre && off <= 1e-9 * model.spacing();
            let follows = match is_own {
                true => vec![(site, 1.0, Vector::zeros())],
                false => around().place(model, site, &x),
            };
            self.push(found, x, follows, detail);
        }
    }

    /// Cells of the mesh whose corners are neighbouring points of the lattice: each follows its corners, as an element does.
    fn add_cubes(&mut self, model: &Model<D>, counts: &[bool], detail: Detail) {
        for (number, cells) in lattices(model) {
            let grid = Grid::new(model, number, cells, Beyond::Follows, |_| true);
            let own: Vec<usize> = (0..counts.len()).filter(|&c| counts[c]).collect();
            let placed = parallel::map_slice(&own, |&c| {
                let x = model.mesh.centroid(c);
                (x, grid.place(&x, detail))
            });
            let half = Vector::repeat(0.5 * cells.spacing);
            for (x, follows) in placed {
                let mut found = Found {
                    size: cells.spacing.powi(D as i32),
                    ..Found::default()
                };
                if detail == Detail::Quadrature {
                    box_quadrature(&(x - half), &(x + half), |x, w| {
                        found.quadrature.push((x, w));
                    });
                }
                self.push(found, x, follows, detail);
            }
        }
    }

    /// Cells of one lattice.
    fn add_lattice(
        &mut self,
        model: &Model<D>,
        number: usize,
        cells: Cells<D>,
        mine: &[bool],
        beyond: Beyond,
        detail: Detail,
    ) {
        let mesh = &model.mesh;
        let voids: &[Shape<D>] = model.peridynamics.as_ref().map_or(&[], |p| &p.voids);
        let own = || (0..mesh.cell_count()).filter(|&c| mine[c]);
        let (marks, [low, high]) = marked(model, mine, cells, voids);
        let is_cut = |index: &[i32; D]| marks.is_marked(index);
        let whole = cells.spacing.powi(D as i32);
        let mut found = pieces_of(model, own().collect(), &marks, voids, detail);
        let near = marks.near_marked();
        let grid = Grid::new(model, number, cells, beyond, |index| {
            detail == Detail::Quadrature || marks.number(index).is_some_and(|n| near[n])
        });
        // whole cells have their own point, where the region holds it
        let limits = marks.limits();
        let all = model.holds_all_points(mine);
        let inside = OnceCell::new();
        let holds = |x: &Vector<D>| {
            let locator = inside.get_or_init(|| fem::Locator::new(mesh, own()));
            locator.holds(mesh, x, 1e-9)
        };
        for (s, site) in model.sites.iter().enumerate() {
            let SiteKind::Point(p) = site.kind else {
                continue;
            };
            let index = cells.index(&site.position);
            let is_own = model.lattice_of_point(p) == number;
            let is_inside = (0..D).all(|i| index[i] >= limits.0[i] && index[i] <= limits.1[i]);
            if !is_own || !is_inside || is_cut(&index) {
                continue;
            }
            if !all && !holds(&site.position) {
                continue;
            }
            let mut full = Found {
                size: whole,
                ..Found::default()
            };
            let x = cells.centre(&index);
            let follows = match detail {
                Detail::Centre => vec![(s as u32, 1.0, Vector::zeros())],
                Detail::Quadrature => {
                    let half = Vector::repeat(0.5 * cells.spacing);
                    box_quadrature(&(x - half), &(x + half), |x, w| {
                        full.quadrature.push((x, w));
                    });
                    grid.own(&index, s as u32)
                }
            };
            self.push(full, x, follows, detail);
        }
        if voids.is_empty() && beyond == Beyond::Follows {
            let middle = (low + high) / 2.0;
            close_gap(
                self,
                &mut found,
                &cells,
                moments_of_cells(mesh, own(), &middle),
                middle,
            );
        }
        self.add_found(&grid, found, detail, whole);
    }

    /// Adds parts of cells of a lattice, in the order of the cells; one that is as large as a whole cell has its own point, if there is one.
    fn add_found(&mut self, grid: &Grid<'_, D>, found: FoundCells<D>, detail: Detail, whole: f64) {
        let mut order: Vec<[i32; D]> = found.keys().copied().collect();
        order.sort_unstable();
        let h = grid.cells.spacing;
        let mut found = found;
        let places: Vec<(Vector<D>, Vec<Follows<D>>)> = parallel::map_slice(&order, |index| {
            let piece = &found[index];
            let offset = piece.moment / piece.size.max(f64::MIN_POSITIVE);
            let middle = grid.cells.centre(index);
            let is_whole = (piece.size / whole - 1.0).abs() < 1e-12;
            match grid.site(index) {
                Some(site) if is_whole && offset.norm() < 1e-10 * h => {
                    (middle, grid.own(index, site))
                }
                _ => (middle + offset, grid.place(&(middle + offset), detail)),
            }
        });
        for (index, (x, follows)) in order.iter().zip(places) {
            if let Some(piece) = found.remove(index)
                && piece.size > 0.0
            {
                self.push(piece, x, follows, detail);
            }
        }
    }
}

/// The outward unit normal of a simplex of a facet; zero of one without an area.
fn outward<const D: usize>(
    model: &Model<D>,
    facet: &BoundaryFacet,
    simplex: &Simplex<D>,
) -> Vector<D> {
    let area = match D {
        1 => model.mesh.facet_normal_area(facet),
        _ => normal_area(&simplex.corners[..simplex.count]),
    };
    area.try_normalize(0.0).unwrap_or_else(Vector::zeros)
}

/// Spreads what parts miss of the region's volume and first moment over those that its edge cuts.
///
/// Round-off where faces are plane; where those of hexahedra are warped, what tetrahedra do not fill.
fn close_gap<const D: usize>(
    parts: &Parts<D>,
    found: &mut FoundCells<D>,
    cells: &Cells<D>,
    (volume, moment): (f64, Vector<D>),
    about: Vector<D>,
) {
    let mut order: Vec<[i32; D]> = found.keys().copied().collect();
    order.sort_unstable();
    let (mut missing, mut turned) = (volume, moment);
    for (size, x) in parts.size.iter().zip(&parts.centre) {
        missing -= size;
        turned -= (x - about) * *size;
    }
    // Σ and second moments of the parts that may change
    let (mut sum, mut first) = (0.0, Vector::<D>::zeros());
    for index in &order {
        let piece = &found[index];
        let from_middle = cells.centre(index) - about;
        let own = from_middle * piece.size + piece.moment;
        missing -= piece.size;
        turned -= own;
        sum += piece.size;
        first += own;
    }
    let reach = cells.spacing + (volume / cells.spacing).abs();
    let is_closed =
        missing.abs() <= 1e-13 * volume && turned.amax() <= 1e-13 * volume * reach.max(1.0);
    if sum <= 0.0 || is_closed || missing.abs() > 0.5 * sum {
        return;
    }
    let mean = first / sum;
    let mut second = Tensor::<D>::zeros();
    for index in &order {
        let piece = &found[index];
        let x = cells.centre(index) - about + piece.moment / piece.size - mean;
        second += x * x.transpose() * piece.size;
    }
    let slope = second
        .try_inverse()
        .map_or(Vector::zeros(), |i| i * (turned - mean * missing));
    let factor = |x: &Vector<D>| 1.0 + missing / sum + slope.dot(&(x - about - mean));
    for index in &order {
        if let Some(piece) = found.get_mut(index) {
            let x = cells.centre(index) + piece.moment / piece.size;
            let by = factor(&x);
            piece.size *= by;
            piece.moment *= by;
            for (_, w) in &mut piece.quadrature {
                *w *= by;
            }
        }
    }
}

/// The lattices of a model by their numbers.
fn lattices<const D: usize>(model: &Model<D>) -> Vec<(usize, Cells<D>)> {
    let Some(p) = &model.peridynamics else {
        return Vec::new();
    };
    match &p.points {
        PointSource::Cells => Vec::new(),
        &PointSource::Lattice { spacing, origin } => vec![(0, Cells { origin, spacing })],
        PointSource::Lattices { lattices, .. } => lattices
            .iter()
            .map(|l| Cells {
                origin: l.origin,
                spacing: l.spacing,
            })
            .enumerate()
            .collect(),
    }
}
