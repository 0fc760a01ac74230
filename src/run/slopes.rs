//! Strain and stress between the places that carry them: a linear fit to those around.
//!
//! An element of first order tells one strain, that of its centre, and a point the mean of its family. With the tellers `k` around the own one, `0`,
//!
//! ```text
//! G(x) = Σ_k s_k G_k ,    s_k = w_k/W + (x − x̄) · A⁻¹ (x_k − x̄) w_k ,    A = Σ_k w_k (x_k − x̄) ⊗ (x_k − x̄) ,    w_k = 1/(|x_k − x_0|² + l²)
//! ```
//!
//! is the least-squares fit, linear in the place, as in patch recovery \[ZienkiewiczZhu1992\], where the own strain is one of many: in simplices, `l` being half of the mean distance, and where too little is left of an element. Points and the centres of other elements are better than those around:
//! `w_0` is infinite, and the fit goes through them. It is exact for linear fields: at the surface of a bent body, too, where the value of the cell is off by half of what it changes across it. Directions in which nothing lies around have no slope.

use std::borrow::Cow;

use nalgebra::{DMatrix, SymmetricEigen};
use rustc_hash::FxHashMap;

use super::intact::Intact;
use super::solution::Solved;
use crate::fem;
use crate::mesh::CellShape;
use crate::model::{Bins, Carrier, Model, SiteKind};
use crate::shape::Barriers;
use crate::tensor::Vector;

/// Distance, in spacings, up to which points lie around one.
const AROUND: f64 = 1.6;

/// Distance, in edges of its cells, up to which a patch lies around an element that it cuts.
const BEYOND: f64 = 1.5;

/// Part of the largest eigenvalue of `A` below which nothing lies around in a direction.
const FLAT: f64 = 0.02;

/// An element, by its cell, or a point, by its site, that tells a strain and a stress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Teller {
    Element(usize),
    Point(usize),
}

/// Value at a place, of the one that carries it and of those around, with weights that add up to one; the own one first.
#[derive(Clone, Debug)]
pub(super) struct Slope(Vec<(Teller, f64)>);

impl Slope {
    /// All that tell of it.
    pub fn tellers(&self) -> impl Iterator<Item = Teller> + '_ {
        self.0.iter().map(|own| own.0)
    }

    /// The value at the place, from those of its tellers.
    pub fn value<T>(&self, of: impl Fn(Teller) -> T) -> T
    where
        T: std::iter::Sum<T> + std::ops::Mul<f64, Output = T>,
    {
        self.0.iter().map(|&(teller, s)| of(teller) * s).sum()
    }

    /// The same where no bond of a point of it is broken; that of the carrier alone elsewhere.
    pub fn of_whole<const D: usize>(&self, model: &Model<D>, intact: &Intact) -> Cow<'_, Self> {
        let is_whole = |teller| match teller {
            Teller::Element(_) => true,
            Teller::Point(site) => {
                let point = model.point_of(site);
                point.is_some_and(|(_, p)| intact.is_whole(p))
            }
        };
        match self.tellers().all(is_whole) {
            true => Cow::Borrowed(self),
            false => Cow::Owned(Self(vec![(self.0[0].0, 1.0)])),
        }
    }
}

/// Elements and points around places of a model.
pub(super) struct Slopes<'m, const D: usize> {
    model: &'m Model<D>,
    barriers: Barriers<D>,
    sites: Vec<usize>,
    points: Bins<D>,
    /// The first material with the constants of each.
    alike: FxHashMap<u16, u16>,
    /// Elements of the rim of a patch.
    rim: Vec<usize>,
    of_rim: Bins<D>,
}

impl<'m, const D: usize> Slopes<'m, D> {
    /// Sorts the points of a model.
    pub fn new(model: &'m Model<D>) -> Self {
        let sites = model.sites.iter().enumerate();
        let sites: Vec<usize> = sites
            .filter(|(_, site)| matches!(site.kind, SiteKind::Point(_)))
            .map(|(s, _)| s)
            .collect();
        let positions: Vec<Vector<D>> = sites.iter().map(|&s| model.sites[s].position).collect();
        let barriers = model.peridynamics.as_ref();
        let mesh = &model.mesh;
        let of_patch = 0..mesh.cell_count().min(mesh.embedded.covered.cells.len());
        let rim: Vec<usize> = of_patch
            .filter(|&c| model.is_element(c) && mesh.embedded.has_strain(c))
            .collect();
        let centres: Vec<Vector<D>> = rim.iter().map(|&c| mesh.centroid(c)).collect();
        Self {
            alike: alike(model),
            of_rim: Bins::new(&centres, mesh.embedded.covered.edge),
            rim,
            model,
            barriers: Barriers::new(barriers.map_or(Vec::new(), |p| p.barriers.clone())),
            points: Bins::new(&positions, model.spacing().max(f64::MIN_POSITIVE)),
            sites,
        }
    }

    /// The slope at `x`; none in an element of second order, whose own strain is linear.
    pub fn at(&self, x: &Vector<D>, carrier: Carrier) -> Option<Slope> {
        let embedded = &self.model.mesh.embedded;
        let is_best = match carrier {
            Carrier::Point(_) => true,
            Carrier::Element(c, _) => {
                let shape = self.model.mesh.shapes[c];
                let is_simplex = matches!(shape, CellShape::Tri3 | CellShape::Tet4);
                embedded.has_strain(c) && !is_simplex
            }
        };
        self.fit(x, carrier, is_best)
    }

    /// As [`Slopes::at`], at the centre of an element, whose own strain is one of many.
    pub fn evened_out(&self, c: usize) -> Option<Slope> {
        self.fit(&self.centre(c), Carrier::Element(c, [0.0; 3]), false)
    }

    fn fit(&self, x: &Vector<D>, carrier: Carrier, is_best: bool) -> Option<Slope> {
        let mesh = &self.model.mesh;
        let (own, around) = match carrier {
            Carrier::Element(c, _) => match mesh.embedded.shown_by(c) {
                c if mesh.shapes[c].is_quadratic() => return None,
                c => (Teller::Element(c), self.around_cell(c)),
            },
            Carrier::Point(site) => (Teller::Point(site), self.around_point(site)),
        };
        let centre = self.position(own);
        let arms: Vec<Vector<D>> = around.iter().map(|k| self.position(*k) - centre).collect();
        let weights = weights(&(x - centre), &arms, is_best);
        let own_weight = 1.0 - weights.iter().sum::<f64>();
        let others = around.into_iter().zip(weights);
        Some(Slope(
            std::iter::once((own, own_weight)).chain(others).collect(),
        ))
    }

    fn position(&self, teller: Teller) -> Vector<D> {
        match teller {
            Teller::Element(c) => self.centre(c),
            Teller::Point(site) => self.model.sites[site].position,
        }
    }

    /// The place that the strain of an element belongs to: the centroid of what is left of it where its strain is the same everywhere.
    fn centre(&self, c: usize) -> Vector<D> {
        let mesh = &self.model.mesh;
        if mesh.embedded.cut_cell(c).is_none() || mesh.embedded.is_of_patch(c) {
            return mesh.centroid(c);
        }
        let (mut size, mut moment) = (0.0, Vector::zeros());
        fem::for_each_point(mesh, c, fem::Rule::Mass, |p| {
            size += p.weight;
            moment += p.position * p.weight;
        });
        moment / size
    }

    /// Elements and points of a patch around what is left of an element that it cuts: no node joins them.
    fn beyond_cut(&self, c: usize) -> Vec<Teller> {
        let embedded = &self.model.mesh.embedded;
        if embedded.cut_cell(c).is_none() || embedded.is_of_patch(c) {
            return Vec::new();
        }
        let (x, reach) = (self.centre(c), BEYOND * embedded.covered.edge);
        let is_near = |teller: &Teller| (self.position(*teller) - x).norm() <= reach;
        let rim = self
            .of_rim
            .around(&x, reach)
            .map(|k| Teller::Element(self.rim[k]));
        let points = self
            .points
            .around(&x, reach)
            .map(|k| Teller::Point(self.sites[k]));
        rim.chain(points).filter(is_near).collect()
    }

    /// Elements of its material that share a node with one, and the points in cells that do: through the material, as nodes are.
    fn around_cell(&self, c: usize) -> Vec<Teller> {
        let model = self.model;
        let (offsets, cells) = model.node_cells();
        let mut ring: Vec<u32> = (model.mesh.corners(c).iter())
            .flat_map(|&n| &cells[offsets[n as usize] as usize..offsets[n as usize + 1] as usize])
            .copied()
            .collect();
        ring.sort_unstable();
        ring.dedup();
        let material = |c: usize| self.alike[&model.material_of_cell(c)];
        let is_alike = |other: usize| material(other) == material(c);
        let mut found = self.beyond_cut(c);
        for other in ring.into_iter().map(|other| other as usize) {
            if other == c || !is_alike(other) {
                continue;
            }
            if model.is_element(other) {
                let has_strain = model.mesh.embedded.has_strain(other);
                found.extend(has_strain.then_some(Teller::Element(other)));
                continue;
            }
            let (low, high) = model.mesh.bounds_of(model.mesh.corners(other));
            let is_in = |x: &Vector<D>| (0..D).all(|i| x[i] >= low[i] && x[i] < high[i]);
            let points = self.points.in_box(low, high).map(|k| self.sites[k]);
            let points = points.filter(|&s| is_in(&model.sites[s].position));
            found.extend(points.map(Teller::Point));
        }
        self.seen(&model.mesh.centroid(c), found)
    }

    /// Points of its material around one, as far as bonds join them to it.
    fn around_point(&self, site: usize) -> Vec<Teller> {
        let model = self.model;
        let x = model.sites[site].position;
        let reach = AROUND * model.spacing();
        let Some((body, own)) = model.point_of(site) else {
            return Vec::new();
        };
        // of a family that another process holds what lies around must do
        let family = body.families.of(own);
        let is_joined = |p: usize| family.is_empty() || family.contains(&(p as u32));
        let material = |p: usize| {
            let number = body.cloud.material.get(p);
            number.map(|m| self.alike.get(m).unwrap_or(m))
        };
        let near = self.points.around(&x, reach).map(|k| self.sites[k]);
        let near = near.filter(|&s| {
            let is_near = (model.sites[s].position - x).norm() <= reach;
            let point = model.point_of(s).filter(|_| s != site && is_near);
            point.is_some_and(|(_, p)| is_joined(p) && material(p) == material(own))
        });
        self.seen(&x, near.map(Teller::Point).collect())
    }

    /// Those that no crack and no void hides from a place.
    fn seen(&self, x: &Vector<D>, mut tellers: Vec<Teller>) -> Vec<Teller> {
        if !self.barriers.is_empty() {
            tellers.retain(|teller| !self.barriers.cuts(x, &self.position(*teller)));
        }
        tellers
    }
}

/// The first material with the constants of each that cells have.
fn alike<const D: usize>(model: &Model<D>) -> FxHashMap<u16, u16> {
    let mut alike: FxHashMap<u16, u16> = FxHashMap::default();
    let mut known: Vec<(u16, usize)> = Vec::new();
    for c in 0..model.mesh.cell_count() {
        let material = model.material_of_cell(c);
        alike.entry(material).or_insert_with(|| {
            let tensor = model.tensor_of_cell(c);
            known.push((material, c));
            let first = known.iter().find(|of| model.tensor_of_cell(of.1) == tensor);
            first.map_or(material, |of| of.0)
        });
    }
    alike
}

/// The share of each value, at the ends of `arms`, in that at the end of `arm`; the rest is the own value, which the fit goes through if it `is_best`.
fn weights<const D: usize>(arm: &Vector<D>, arms: &[Vector<D>], is_best: bool) -> Vec<f64> {
    if arms.is_empty() {
        return Vec::new();
    }
    let mean = arms.iter().map(|d| d.norm()).sum::<f64>() / arms.len() as f64;
    let near = if is_best { 0.0 } else { (0.5 * mean).powi(2) };
    let w: Vec<f64> = arms
        .iter()
        .map(|d| 1.0 / (d.norm_squared() + near))
        .collect();
    let whole = w.iter().sum::<f64>() + 1.0 / near;
    let middle = arms.iter().zip(&w).map(|(d, w)| d * *w).sum::<Vector<D>>() / whole;
    let mut sum = DMatrix::<f64>::zeros(D, D);
    let mut add = |d: Vector<D>, w: f64| {
        for i in 0..D {
            for k in 0..D {
                sum[(i, k)] += w * d[i] * d[k];
            }
        }
    };
    arms.iter().zip(&w).for_each(|(d, w)| add(d - middle, *w));
    if !is_best {
        add(-middle, 1.0 / near);
    }
    let SymmetricEigen {
        eigenvectors,
        eigenvalues,
    } = sum.symmetric_eigen();
    let largest = eigenvalues.amax();
    // A⁻¹ (x − x̄) in the directions in which something lies around
    let mut along = Vector::<D>::zeros();
    for (value, axis) in eigenvalues.iter().zip(eigenvectors.column_iter()) {
        if *value > FLAT * largest {
            let axis = Vector::<D>::from_fn(|i, _| axis[i]);
            along += axis * (axis.dot(&(arm - middle)) / value);
        }
    }
    let each = arms.iter().zip(&w);
    each.map(|(d, w)| w / whole + along.dot(&(d - middle)) * w)
        .collect()
}

impl<const D: usize> Solved<'_, D> {
    /// The slope of an element or a point, if its strain is linear around it as far as is known: not in elements whose stress is no function of their strain alone, nor beside a temperature.
    pub(super) fn has_slope(&self, carrier: Carrier) -> bool {
        match carrier {
            Carrier::Point(_) => true,
            Carrier::Element(c, _) => {
                let u = self.displacement;
                let told = self.state().and_then(|state| state.stress_of_cell(c, u));
                let is_own = self.operator.cell_stress(c, u).is_some();
                told.is_none() && !is_own && self.thermal().is_none()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_is_exact_for_linear_values_and_has_no_slope_where_nothing_lies() {
        let slope = Vector::<3>::new(2.0, -3.0, 0.7);
        let arms = [
            [1.0, 0.1, 0.0],
            [-0.8, 0.3, 0.2],
            [0.1, -2.0, 0.4],
            [0.2, 0.3, -0.9],
        ];
        let arms = arms.map(|d| Vector::<3>::from_column_slice(&d));
        let flat = arms.map(|d| Vector::<3>::new(d[0], d[1], 0.0));
        let at = Vector::<3>::new(0.4, -1.3, 0.8);
        for is_best in [false, true] {
            let told = |at: &Vector<3>, arms: &[Vector<3>], own: f64| -> f64 {
                let weights = weights(at, arms, is_best);
                let others = weights.iter().zip(arms);
                let others: f64 = others.map(|(s, d)| s * (5.0 + slope.dot(d))).sum();
                others + own * (1.0 - weights.iter().sum::<f64>())
            };
            assert!((told(&at, &arms, 5.0) - 5.0 - slope.dot(&at)).abs() < 1e-12);
            // all in a plane: what lies along its normal is that of the plane
            let wanted = 5.0 + 2.0 * 0.4 + 3.0 * 1.3;
            assert!((told(&at, &flat, 5.0) - wanted).abs() < 1e-12);
            // an own value beside the others is kept at its place, or evened out
            let kept = (told(&Vector::zeros(), &arms, 7.0) - 7.0).abs();
            assert_eq!(kept < 1e-12, is_best, "{kept}");
            assert!(weights(&at, &[], is_best).is_empty());
        }
    }
}
