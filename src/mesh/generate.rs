//! Meshes of a line, rectangle or box from coordinates along each axis, with cut-outs, grading and jitter.

use super::error::axis_name;
use super::{CellShape, Mesh, MeshError};
use crate::tensor::Vector;

/// Tolerance of a cut-out's face against a grid line, as a fraction of the axis.
const ON_GRID: f64 = 1e-9;

/// The coordinates of grid lines along one axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Axis {
    /// `cells` cells of equal size.
    Uniform {
        /// First coordinate.
        min: f64,
        /// Last coordinate.
        max: f64,
        /// Number of cells.
        cells: usize,
    },
    /// Cells of size `spacing` within `fine`, growing from there towards both ends.
    Graded {
        /// First coordinate.
        min: f64,
        /// Last coordinate.
        max: f64,
        /// The interval of fine cells; it is hit exactly and must be a whole number of spacings long.
        fine: [f64; 2],
        /// Size of the fine cells. If `fine` starts at a multiple of it, all its coordinates are multiples of it.
        spacing: f64,
        /// Largest size of a cell relative to its finer neighbour, at least 1.
        ratio: f64,
        /// Largest size of any cell.
        largest: f64,
    },
    /// Given coordinates, strictly increasing.
    Coordinates(Vec<f64>),
}

/// Coordinates with a constant `spacing` in the fine interval from `a` to `b`, that grow by a ratio up to the largest size on both sides.
fn graded_coordinates(
    [min, max]: [f64; 2],
    [a, b]: [f64; 2],
    spacing: f64,
    ratio: f64,
    largest: f64,
) -> Result<Vec<f64>, String> {
    check_ends(min, max)?;
    if !(min <= a && a < b && b <= max) {
        return Err(format!(
            "the fine interval [{a}, {b}] must lie within [{min}, {max}] and have a length"
        ));
    }
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Err(format!("spacing = {spacing}; it must be positive"));
    }
    if !(ratio >= 1.0 && ratio.is_finite()) {
        return Err(format!("growth ratio = {ratio}; it must be at least 1"));
    }
    if largest.is_nan() || largest < spacing {
        return Err(format!(
            "the largest size {largest} is below the spacing {spacing}; make it larger"
        ));
    }
    let count = ((b - a) / spacing).round();
    if (count * spacing - (b - a)).abs() > 1e-6 * spacing || count < 1.0 {
        return Err(format!(
            "the fine interval [{a}, {b}] is {:.6} spacings of {spacing} long; make it a whole number",
            (b - a) / spacing
        ));
    }
    let count = count as usize;
    let first = (a / spacing).round();
    let on_multiples = (first * spacing - a).abs() <= 1e-6 * spacing;
    let mut x: Vec<f64> = graded(a - min, spacing, ratio, largest)?
        .into_iter()
        .map(|d| a - d)
        .rev()
        .collect();
    x.push(a);
    x.extend((1..count).map(|i| {
        if on_multiples {
            (first + i as f64) * spacing
        } else {
            between(a, b, i, count)
        }
    }));
    x.push(b);
    x.extend(
        graded(max - b, spacing, ratio, largest)?
            .into_iter()
            .map(|d| b + d),
    );
    let last = x.len() - 1;
    (x[0], x[last]) = (min, max);
    Ok(x)
}

impl Axis {
    /// The coordinates, strictly increasing, with both ends exact.
    ///
    /// # Errors
    /// A text that says which number is wrong and what would be right.
    pub fn coordinates(&self) -> Result<Vec<f64>, String> {
        match self {
            Self::Uniform { min, max, cells } => {
                check_ends(*min, *max)?;
                if *cells == 0 {
                    return Err("0 cells; ask for at least 1".into());
                }
                Ok((0..=*cells)
                    .map(|i| between(*min, *max, i, *cells))
                    .collect())
            }
            Self::Graded {
                min,
                max,
                fine: [a, b],
                spacing,
                ratio,
                largest,
            } => graded_coordinates([*min, *max], [*a, *b], *spacing, *ratio, *largest),
            Self::Coordinates(x) => {
                if x.len() < 2 {
                    return Err(format!("{} coordinates; give at least 2", x.len()));
                }
                if let Some(v) = x.iter().find(|v| !v.is_finite()) {
                    return Err(format!("coordinate {v}; every one must be a finite number"));
                }
                if let Some(w) = x.windows(2).find(|w| w[0] >= w[1]) {
                    return Err(format!(
                        "coordinate {} does not come after {}; sort them and remove repeats",
                        w[1], w[0]
                    ));
                }
                Ok(x.clone())
            }
        }
    }
}

/// Refuses an axis that does not run from a smaller to a larger number.
fn check_ends(min: f64, max: f64) -> Result<(), String> {
    if min < max && min.is_finite() && max.is_finite() {
        return Ok(());
    }
    Err(format!(
        "runs from {min} to {max}; its end must lie beyond its start"
    ))
}

/// Point `i` of `n` between two ends: exact at both and symmetric about the middle.
fn between(min: f64, max: f64, i: usize, n: usize) -> f64 {
    match i {
        0 => min,
        _ if i == n => max,
        _ => (min * (n - i) as f64 + max * i as f64) / n as f64,
    }
}

/// Distances from the fine part to the grid lines of a stretch of `length` next to it.
///
/// As few cells as `ratio` and `largest` allow; the ratio is then lowered until they fill the stretch, so that no cell
/// exceeds `largest` and the sizes grow smoothly from the first one on.
fn graded(length: f64, spacing: f64, ratio: f64, largest: f64) -> Result<Vec<f64>, String> {
    const MOST: usize = 10_000_000;
    if length <= 0.0 {
        return Ok(Vec::new());
    }
    let (mut cells, mut size, mut sum) = (0usize, spacing, 0.0);
    // a stretch of a whole number of cells must not get one more for round-off
    while sum < length * (1.0 - 1e-12) {
        size = (size * ratio).min(largest);
        sum += size;
        cells += 1;
        if cells > MOST {
            return Err(format!(
                "more than {MOST} cells of {spacing}; make the spacing larger"
            ));
        }
    }
    let lines = |ratio: f64| -> Vec<f64> {
        let (mut size, mut at) = (spacing, 0.0);
        (0..cells)
            .map(|_| {
                size = (size * ratio).min(largest);
                at += size;
                at
            })
            .collect()
    };
    let (mut low, mut high) = (0.0, ratio);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let reached = lines(middle)[cells - 1];
        if reached < length {
            low = middle;
        } else {
            high = middle;
        }
    }
    let mut found = lines(high);
    let scale = length / found[cells - 1];
    found.iter_mut().for_each(|d| *d *= scale);
    Ok(found)
}

/// The sets of facets that every grid has, by axis: the lower side, then the upper.
pub(crate) const SIDES: [&str; 6] = ["left", "right", "bottom", "top", "back", "front"];

/// A named box whose cells are removed.
#[derive(Clone, Debug, PartialEq)]
pub struct CutOut<const D: usize> {
    /// Its name; the facets around it become a facet set of that name.
    pub name: String,
    /// Smallest coordinates, on grid lines or outside the grid.
    pub min: Vector<D>,
    /// Largest coordinates, on grid lines or outside the grid.
    pub max: Vector<D>,
}

/// A tensor-product grid that becomes a mesh.
///
/// Cells are lines, quadrilaterals or hexahedra; after [`Grid::simplices`] triangles (diagonals alternate) or tetrahedra
/// (six about the long diagonal of each box, so that neighbours conform).
///
/// Sets: the cell set `all`; the facet sets `left`, `right` (x), `bottom`, `top` (y), `back`, `front` (z) of the outer
/// boundary, and one for each cut-out.
#[derive(Clone, Debug)]
pub struct Grid<const D: usize> {
    axes: [Axis; D],
    division: Division,
    cut_outs: Vec<CutOut<D>>,
    jitter: Option<(f64, u64)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Division {
    Boxes,
    Simplices,
}

/// A grid on a line.
pub fn line(x: Axis) -> Grid<1> {
    Grid::new([x])
}

/// A grid on a rectangle.
pub fn rectangle(x: Axis, y: Axis) -> Grid<2> {
    Grid::new([x, y])
}

/// A grid in a box.
pub fn cuboid(x: Axis, y: Axis, z: Axis) -> Grid<3> {
    Grid::new([x, y, z])
}

impl<const D: usize> Grid<D> {
    /// A grid with nothing cut out.
    pub fn new(axes: [Axis; D]) -> Self {
        Self {
            axes,
            division: Division::Boxes,
            cut_outs: Vec::new(),
            jitter: None,
        }
    }

    /// Divides each box into triangles or tetrahedra. A line stays a line.
    pub fn simplices(&mut self) -> &mut Self {
        self.division = Division::Simplices;
        self
    }

    /// Removes the cells within a box.
    pub fn cut_out(&mut self, cut_out: CutOut<D>) -> &mut Self {
        self.cut_outs.push(cut_out);
        self
    }

    /// Moves every inner node by up to `fraction` of the smaller neighbouring spacing along each axis.
    ///
    /// Nodes of the outer boundary and of cut-outs stay. The same `seed` gives the same mesh on every machine.
    pub fn jitter(&mut self, fraction: f64, seed: u64) -> &mut Self {
        self.jitter = Some((fraction, seed));
        self
    }

    /// The mesh.
    ///
    /// # Errors
    /// An axis without coordinates, a cut-out that is not on grid lines or removes nothing or everything, too much jitter.
    pub fn mesh(&self) -> Result<Mesh<D>, MeshError> {
        let mut lines: Vec<Vec<f64>> = Vec::with_capacity(D);
        for (k, axis) in self.axes.iter().enumerate() {
            lines.push(axis.coordinates().map_err(|problem| MeshError::Axis {
                axis: axis_name(k),
                problem,
            })?);
        }
        let cells: [usize; D] = std::array::from_fn(|k| lines[k].len() - 1);
        let total: usize = cells.iter().product();
        let mut ranges = Vec::with_capacity(self.cut_outs.len());
        let mut kept = vec![true; total];
        for cut_out in &self.cut_outs {
            let range = grid_range(cut_out, &lines)?;
            let mut removed = 0;
            for (c, kept) in kept.iter_mut().enumerate() {
                let at = split(c, &cells);
                if (0..D).all(|k| range[k][0] <= at[k] && at[k] < range[k][1]) {
                    removed += 1;
                    *kept = false;
                }
            }
            let remedy = match removed {
                0 => Some("move it into the grid or leave it out"),
                n if n == total => Some("make it smaller than the grid"),
                _ => None,
            };
            if let Some(remedy) = remedy {
                return Err(MeshError::CutOutEmpty {
                    name: cut_out.name.clone(),
                    removed,
                    cells: total,
                    remedy,
                });
            }
            ranges.push(range);
        }
        if !kept.contains(&true) {
            let last = self.cut_outs.last().map_or("", |c| &c.name);
            return Err(MeshError::CutOutEmpty {
                name: last.into(),
                removed: total,
                cells: total,
                remedy: "together with the others it leaves nothing; make them smaller",
            });
        }

        let nodes: [usize; D] = std::array::from_fn(|k| cells[k] + 1);
        let mut mesh = Mesh::default();
        for n in 0..nodes.iter().product() {
            let at = split(n, &nodes);
            mesh.nodes.push(Vector::from_fn(|k, _| lines[k][at[k]]));
        }
        for c in (0..total).filter(|&c| kept[c]) {
            let at = split(c, &cells);
            // corner with bit k set lies one further along axis k
            let corner = |bits: usize| {
                let mut number = 0;
                for k in (0..D).rev() {
                    number = number * nodes[k] + at[k] + (bits >> k & 1);
                }
                number as u32
            };
            push_box(
                &mut mesh,
                self.division,
                at.iter().sum::<usize>() % 2,
                corner,
            );
        }
        self.add_sets(&mut mesh, &nodes, &ranges);
        if let Some((fraction, seed)) = self.jitter {
            self.move_nodes(&mut mesh, &lines, &nodes, fraction, seed)?;
        }
        mesh.drop_unused_nodes();
        Ok(mesh)
    }

    /// Names the cells and the boundary facets, by the grid numbers of their nodes.
    fn add_sets(&self, mesh: &mut Mesh<D>, nodes: &[usize; D], ranges: &[[[usize; 2]; D]]) {
        let all = (0..mesh.cell_count() as u32).collect();
        mesh.cell_sets.insert("all".into(), all);
        for name in &SIDES[..2 * D] {
            mesh.facet_sets.insert((*name).into(), Vec::new());
        }
        for cut_out in &self.cut_outs {
            mesh.facet_sets.entry(cut_out.name.clone()).or_default();
        }
        for facet in mesh.outer_facets() {
            let at: Vec<[usize; D]> = facet
                .nodes
                .iter()
                .map(|&n| split(n as usize, nodes))
                .collect();
            let mut add = |name: &str| {
                if let Some(set) = mesh.facet_sets.get_mut(name) {
                    set.push(facet.nodes.clone());
                }
            };
            for k in 0..D {
                if at.iter().all(|at| at[k] == 0) {
                    add(SIDES[2 * k]);
                }
                if at.iter().all(|at| at[k] == nodes[k] - 1) {
                    add(SIDES[2 * k + 1]);
                }
            }
            for (cut_out, range) in self.cut_outs.iter().zip(ranges) {
                let within =
                    |at: &[usize; D]| (0..D).all(|k| range[k][0] <= at[k] && at[k] <= range[k][1]);
                if at.iter().all(within) {
                    add(&cut_out.name);
                }
            }
        }
    }

    /// See [`Grid::jitter`].
    fn move_nodes(
        &self,
        mesh: &mut Mesh<D>,
        lines: &[Vec<f64>],
        nodes: &[usize; D],
        fraction: f64,
        seed: u64,
    ) -> Result<(), MeshError> {
        if !(0.0..=0.3).contains(&fraction) {
            return Err(MeshError::Jitter { value: fraction });
        }
        let mut fixed = vec![false; mesh.nodes.len()];
        for &n in mesh.outer_facets().iter().flat_map(|f| &f.nodes) {
            fixed[n as usize] = true;
        }
        for (n, x) in mesh.nodes.iter_mut().enumerate() {
            if fixed[n] {
                continue;
            }
            let at = split(n, nodes);
            for k in 0..D {
                let (i, x_k) = (at[k], &lines[k]);
                if i == 0 || i + 1 == x_k.len() {
                    continue; // the node of a removed cell; it is dropped later
                }
                let room = (x_k[i + 1] - x_k[i]).min(x_k[i] - x_k[i - 1]);
                let key = (n * D + k) as u64;
                x[k] += fraction * room * (2.0 * unit_random(seed, key) - 1.0);
            }
        }
        Ok(())
    }
}

/// The numbers along each axis of entry `n` of a tensor product, the first axis fastest.
fn split<const D: usize>(mut n: usize, counts: &[usize; D]) -> [usize; D] {
    std::array::from_fn(|k| {
        let i = n % counts[k];
        n /= counts[k];
        i
    })
}

/// A number in [0, 1) that depends on `seed` and `key` only (splitmix64).
fn unit_random(seed: u64, key: u64) -> f64 {
    let mut z = (seed ^ key.wrapping_mul(0xd134_2543_de82_ef95))
        .wrapping_add(0x9e37_79b9_7f4a_7c15)
        .wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// The grid lines that a cut-out lies between.
fn grid_range<const D: usize>(
    cut_out: &CutOut<D>,
    lines: &[Vec<f64>],
) -> Result<[[usize; 2]; D], MeshError> {
    let mut range = [[0; 2]; D];
    for k in 0..D {
        let x = &lines[k];
        let last = x.len() - 1;
        let tolerance = ON_GRID * (x[last] - x[0]);
        for (end, value) in [cut_out.min[k], cut_out.max[k]].into_iter().enumerate() {
            let above = x.partition_point(|&line| line < value - tolerance);
            range[k][end] = if above > last {
                last
            } else if above == 0 || (x[above] - value).abs() <= tolerance {
                above
            } else {
                return Err(MeshError::CutOutOffGrid {
                    name: cut_out.name.clone(),
                    axis: axis_name(k),
                    value,
                    below: x[above - 1],
                    above: x[above],
                });
            };
        }
    }
    Ok(range)
}

/// Appends one box of the grid as one or several cells; `corner` numbers its corners by bits, `parity` alternates.
fn push_box<const D: usize>(
    mesh: &mut Mesh<D>,
    division: Division,
    parity: usize,
    corner: impl Fn(usize) -> u32,
) {
    let mut push = |shape, corners: &[usize]| {
        let nodes: Vec<u32> = corners.iter().map(|&bits| corner(bits)).collect();
        mesh.push_cell(shape, &nodes);
    };
    match (D, division) {
        (1, _) => push(CellShape::Line2, &[0, 1]),
        (2, Division::Boxes) => push(CellShape::Quad4, &[0, 1, 3, 2]),
        (2, Division::Simplices) => {
            let halves = [[[0, 1, 3], [0, 3, 2]], [[0, 1, 2], [1, 3, 2]]];
            for half in &halves[parity] {
                push(CellShape::Tri3, half);
            }
        }
        (_, Division::Boxes) => push(CellShape::Hex8, &[0, 1, 3, 2, 4, 5, 7, 6]),
        (_, Division::Simplices) => {
            // one tetrahedron for each order in which the axes can be walked from corner 0 to corner 7
            for [i, j, k, even] in [
                [0, 1, 2, 1],
                [1, 2, 0, 1],
                [2, 0, 1, 1],
                [0, 2, 1, 0],
                [2, 1, 0, 0],
                [1, 0, 2, 0],
            ] {
                debug_assert_eq!(i + j + k, 3);
                let (a, b) = (1 << i, 1 << i | 1 << j);
                let path = if even == 1 {
                    [0, a, b, 7]
                } else {
                    [0, b, a, 7]
                };
                push(CellShape::Tet4, &path);
            }
        }
    }
}

#[cfg(test)]
#[path = "generate_tests.rs"]
mod tests;
