//! Second gradients of a displacement over the elements around a cell.

use crate::mesh::CellShape;
use crate::parallel;
use crate::tensor::{Tensor, Vector};

const NONE: u32 = u32::MAX;

/// Radius over which strains are averaged, in sizes of a cell, unless a horizon is less. A wider mean costs more and rounds corners; a narrower one takes the noise of the mesh for a gradient.
const AVERAGED_OVER: f64 = 2.5;

/// Least radius, in sizes of a cell, with which a cell has neighbours.
const AT_LEAST: f64 = 1.5;

/// Tolerance on the offset of centres from their places in a regular mesh, relative to the size of a cell.
const ALIKE: f64 = 1e-12;

pub(super) fn is_simplex(shape: CellShape) -> bool {
    matches!(shape.linear(), CellShape::Tri3 | CellShape::Tet4)
}

pub(super) fn cells_of((offsets, cells): &(Vec<u32>, Vec<u32>), node: u32) -> &[u32] {
    &cells[offsets[node as usize] as usize..offsets[node as usize + 1] as usize]
}

/// For each cell a number that it shares with the cell before it if neighbours, their centres and its volume lie alike, the numbers of cells shifted by one.
pub(super) fn kinds<const D: usize>(
    neighbours: &[[u32; 6]],
    centre: &[Vector<D>],
    volume: &[f64],
) -> Vec<u32> {
    let is_alike = |c: usize| {
        let size = volume[c].powf(1.0 / D as f64);
        let of = |n: u32, c: usize| centre[n as usize] - centre[c];
        (volume[c] - volume[c - 1]).abs() <= ALIKE * volume[c]
            && neighbours[c]
                .iter()
                .zip(&neighbours[c - 1])
                .all(|(&n, &m)| match (n, m) {
                    (NONE, NONE) => true,
                    (NONE, _) | (_, NONE) => false,
                    (n, m) => n == m + 1 && (of(n, c) - of(m, c - 1)).amax() <= ALIKE * size,
                })
    };
    let new: Vec<bool> = parallel::map(neighbours.len(), 1, |c| c == 0 || !is_alike(c));
    let mut number = 0;
    let count = |is_new: bool| {
        number += u32::from(is_new);
        number
    };
    new.into_iter().map(count).collect()
}

/// The strains around a cell.
pub(super) struct Around<'a, const D: usize> {
    /// Horizon of each cell \[m\].
    pub horizon: &'a [f64],
    /// Kind of each cell, which it shares with the cells before it that are alike, [`kinds`].
    pub kind: Vec<u32>,
    pub neighbours: &'a [[u32; 6]],
    pub strains: &'a [Tensor<D>],
    pub centre: &'a [Vector<D>],
    pub volume: &'a [f64],
}

/// Cells that have been reached from a cell, with their weights in `∇²ε` there, and for each cell of the mesh from which cell it was reached last.
pub(super) struct Reached {
    /// That cell; `NONE` for none yet.
    pub from: u32,
    pub radius: f64,
    pub cells: Vec<u32>,
    /// Empty where there is no gradient.
    pub weights: Vec<f64>,
    pub stamp: Vec<u32>,
}

impl Reached {
    /// Returns true if a cell reaches the same cells, shifted, with the same weights: then all that are reached lie like those reached before.
    pub fn serves(&self, c: usize, radius: f64, kind: &[u32]) -> bool {
        if self.from == NONE || (radius - self.radius).abs() > ALIKE * radius {
            return false;
        }
        let shift = c - self.from as usize;
        let is_alike = |&k: &u32| kind.get(k as usize + shift) == Some(&kind[k as usize]);
        self.cells.iter().all(is_alike)
    }
}

impl<const D: usize> Around<'_, D> {
    /// `∇²ε` at the centre of cell `c`, not before those that `reached` has seen.
    pub fn second_gradient(&self, c: usize, reached: &mut Reached) -> Tensor<D> {
        let size = self.volume[c].powf(1.0 / D as f64);
        let radius = (AVERAGED_OVER * size)
            .min(self.horizon[c])
            .max(AT_LEAST * size)
            * (1.0 + 1e-9);
        if !reached.serves(c, radius, &self.kind) {
            self.reach(c, radius, reached);
        }
        let shift = c - reached.from as usize;
        let own = self.strains[c];
        let mut sum = Tensor::zeros();
        for (&k, &weight) in reached.cells.iter().zip(&reached.weights) {
            sum += (self.strains[k as usize + shift] - own) * weight;
        }
        sum
    }

    /// The cells that a path of candidates within a small ball joins to cell `c`, so that no mean passes over a slit, and their weights.
    pub fn reach(&self, c: usize, radius: f64, reached: &mut Reached) {
        let x = self.centre[c];
        (reached.from, reached.radius) = (c as u32, radius);
        reached.cells.clear();
        reached.cells.push(c as u32);
        reached.stamp[c] = c as u32;
        let mut next = 0;
        while let Some(&at) = reached.cells.get(next) {
            next += 1;
            for &k in self.neighbours[at as usize].iter().filter(|k| **k != NONE) {
                if reached.stamp[k as usize] != c as u32
                    && (self.centre[k as usize] - x).norm() <= radius
                {
                    reached.stamp[k as usize] = c as u32;
                    reached.cells.push(k);
                }
            }
        }
        let places = reached
            .cells
            .iter()
            .map(|&k| (self.centre[k as usize] - x, self.volume[k as usize]));
        let (mut second, mut weight) = (0.0, 0.0);
        for (x, v) in places.clone() {
            second += v * x.norm_squared();
            weight += v;
        }
        level(places, &mut reached.weights);
        // the mean of ½ x·H·x over the ball is ½ ⟨x₁²⟩ tr H
        let factor = match second > 0.0 {
            true => 2.0 * D as f64 * weight / second,
            false => 0.0,
        };
        reached.weights.iter_mut().for_each(|w| *w *= factor);
    }
}

/// Weights of values in the value at zero of the plane that fits them best; in their mean where they do not determine a plane. None without weight.
///
/// Shapes: position and weight of each. A plane loses what a one-sided mean makes of a constant gradient.
pub(super) fn level<const D: usize>(
    data: impl Iterator<Item = (Vector<D>, f64)> + Clone,
    weights: &mut Vec<f64>,
) {
    weights.clear();
    let (mut weight, mut first) = (0.0, Vector::<D>::zeros());
    for (x, w) in data.clone() {
        weight += w;
        first += x * w;
    }
    if weight <= 0.0 {
        return;
    }
    first /= weight;
    let mut second = Tensor::<D>::zeros();
    for (x, w) in data.clone() {
        let x = x - first;
        second += x * x.transpose() * (w / weight);
    }
    let scale = second.trace();
    let slope = match crate::tensor::inverse(&second) {
        Some((inverse, determinant)) if determinant > 1e-6 * scale.powi(D as i32) => {
            inverse * first
        }
        _ => Vector::zeros(),
    };
    weights.extend(data.map(|(x, w)| w / weight * (1.0 - slope.dot(&(x - first)))));
}
