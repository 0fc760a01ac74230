//! The smallest change of weights that balances every uniform stress at the seam.

use super::feet::Feet;
use super::least_squares::{Columns, Metric, least_squares};
use crate::assembly::Transfer;
use crate::fem;
use crate::mesh::Mesh;
use crate::model::ModelError;
use crate::peridynamics::{LinearForceState, PdBody, PointError};
use crate::tensor::{Vector, inverse};

/// Damping of the changes where faces of the zone meet surfaces, over the area of a point's cell: such rows need not have a common solution.
const DAMPING: f64 = 0.1;

/// Adjusts the weights of the families beside the feet.
///
/// # Errors
/// [`ModelError::Family`] for a family that cannot carry the law.
pub(crate) fn balance<const D: usize>(
    (mesh, of_node, spacing): (&Mesh<D>, &Transfer, f64),
    feet: &Feet<D>,
    law: &dyn LinearForceState<D>,
    body: &mut PdBody<D>,
) -> Result<(), ModelError> {
    let failed = |e: PointError<D>| ModelError::family("the point", e);
    let mut factors: Vec<Vec<f64>> = (0..feet.points)
        .map(|i| first_factors(feet, body, i))
        .collect();
    for (i, factors) in factors.iter().enumerate().filter(|(_, f)| !f.is_empty()) {
        body.reweigh(law, i, factors).map_err(failed)?;
    }
    let fit = Fit::new((mesh, of_node, spacing), feet, body);
    let fitted = fit.factors();
    let (of_bonds, of_volumes) = fitted.split_at(fit.bonds.len());
    let mut grown = vec![1.0; body.cloud.position.len()];
    for (&i, factor) in fit.volumes.iter().zip(of_volumes) {
        grown[i as usize] = *factor;
    }
    for (&(i, k), factor) in fit.bonds.iter().zip(of_bonds) {
        let (i, k) = (i as usize, k as usize);
        if factors[i].is_empty() {
            factors[i] = vec![1.0; body.families.of(i).len()];
        }
        factors[i][k] *= factor / grown[i];
    }
    // a volume is that of an energy; what the point weighs in other families stays
    for (i, factors) in factors.iter_mut().enumerate() {
        let family = body.families.of(i);
        let changed = |j: &u32| grown[*j as usize] != 1.0;
        if factors.is_empty() && family.iter().any(changed) {
            *factors = vec![1.0; family.len()];
        }
        for (factor, &j) in factors.iter_mut().zip(family) {
            *factor /= grown[j as usize];
        }
    }
    for (volume, grown) in body.cloud.volume.iter_mut().zip(&grown) {
        *volume *= grown;
    }
    for (i, factors) in factors.iter().enumerate().filter(|(_, f)| !f.is_empty()) {
        body.reweigh(law, i, factors).map_err(failed)?;
    }
    Ok(())
}

/// The factors of the bonds of a point before the fit, over the plain weights that the body has; none without feet.
fn first_factors<const D: usize>(feet: &Feet<D>, body: &PdBody<D>, i: usize) -> Vec<f64> {
    let wanted = &feet.omega[i];
    if wanted.is_empty() {
        return Vec::new();
    }
    let plain = body.kernel(i).1;
    let kept = plain.len() - wanted.len();
    let mut factors = vec![1.0; plain.len()];
    for ((factor, wanted), plain) in factors[kept..].iter_mut().zip(wanted).zip(&plain[kept..]) {
        *factor = wanted / plain;
    }
    factors
}

/// Steps of Newton's method for all conditions, and at most for those that have to be met.
const DAMPED: usize = 3;
const STRICT: usize = 20;

/// Relative tolerance on the equations of a step: the next one takes what is left.
const ROUGH: f64 = 1e-3;

/// Conditions of which so many steps leave more than this part cannot be met by positive weights.
const STALLED: (usize, f64) = (4, 0.9);

/// Least factor of a weight in a step, and after all steps.
const SMALLEST: f64 = 0.1;
const LEAST: f64 = 0.01;

/// Conditions shorter than this, over the damping, give way to others.
const SMALL_ROW: f64 = 0.5;

/// Iterations of a step that the metric of an earlier step may take, and at most.
const SLOW: usize = 20;
const LONGEST: usize = 4000;

/// Tolerance on the residual of a condition, over the damping.
const ENOUGH: f64 = 1e-13;

/// Conditions on the changes of weights.
struct Fit {
    /// Point and place in its family, of each weight that changes.
    bonds: Vec<(u32, u32)>,
    /// Points whose volume changes, in the columns behind those of the bonds.
    volumes: Vec<u32>,
    conditions: Columns,
    /// Residual of each condition.
    lacks: Vec<f64>,
    /// For each condition, true if it has to be met.
    is_strict: Vec<bool>,
    damping: f64,
}

const NONE: u32 = u32::MAX;

impl Fit {
    fn new<const D: usize>(
        (mesh, of_node, spacing): (&Mesh<D>, &Transfer, f64),
        feet: &Feet<D>,
        body: &PdBody<D>,
    ) -> Self {
        let ends = |i: usize| !feet.omega[i].is_empty();
        let is_near = |i: usize| {
            let family = body.families.of(i).iter().map(|&j| j as usize);
            ends(i) || family.filter(|&j| j < feet.points).any(ends)
        };
        let near: Vec<bool> = (0..feet.points).map(is_near).collect();
        let rows = RowNumbers::new(feet, body, &near);
        let cell = spacing.powi(D as i32 - 1);
        let mut fit = Self {
            bonds: Vec::new(),
            volumes: Vec::new(),
            conditions: Columns::new(),
            lacks: vec![0.0; rows.count],
            is_strict: vec![true; rows.count],
            damping: DAMPING * cell,
        };
        fit.conditions.rows = rows.count;
        rows.demand((mesh, of_node), feet, &mut fit);
        for i in 0..feet.points {
            let Some(state) = body.state(i) else { continue };
            let Some((inverse, _)) = inverse(&state.shape) else {
                continue;
            };
            let (family, omega) = (body.families.of(i), body.kernel(i).1);
            for (k, (&j, omega)) in family.iter().zip(omega).enumerate() {
                let xi = body.bond(i, j as usize);
                let weight = omega * body.cloud.volume[j as usize];
                let b = inverse * xi * (weight * body.cloud.volume[i]);
                let mut on = Vec::new();
                rows.add(body, j as usize, &b, &mut on);
                rows.add(body, i, &-b, &mut on);
                for &(row, value) in &on {
                    fit.lacks[row as usize] -= value;
                }
                if near[i] {
                    // K stays what it is, but for the part by which the volume changes
                    let scale = cell * weight / state.shape.trace();
                    let first = rows.shapes[i];
                    let pairs = (0..D).flat_map(|a| (a..D).map(move |b| (a, b)));
                    on.extend(
                        (first..)
                            .zip(pairs)
                            .map(|(row, (a, b))| (row, scale * xi[a] * xi[b])),
                    );
                    fit.conditions.entries.append(&mut on);
                    fit.conditions.end();
                    fit.bonds.push((i as u32, k as u32));
                }
            }
        }
        for i in (0..feet.points).filter(|&i| near[i]) {
            let Some(state) = body.state(i) else { continue };
            let scale = cell / state.shape.trace();
            let pairs = (0..D).flat_map(|a| (a..D).map(move |b| (a, b)));
            let entries = (rows.shapes[i]..).zip(pairs);
            let entries = entries.map(|(row, (a, b))| (row, -scale * state.shape[(a, b)]));
            fit.conditions.entries.extend(entries);
            fit.conditions.end();
            fit.volumes.push(i as u32);
        }
        fit.conditions.finish();
        rows.relax(feet, body, &mut fit.is_strict);
        fit
    }

    /// Factors of weights and volumes: of all that meet the conditions positive ones: each step changes a weight by a part of itself.
    fn factors(&self) -> Vec<f64> {
        let mut factors = vec![1.0; self.bonds.len() + self.volumes.len()];
        let all = vec![true; self.lacks.len()];
        let mut metric = None;
        for _ in 0..DAMPED {
            self.step((&all, &mut metric), (self.damping, ROUGH), &mut factors);
        }
        metric = None;
        let (mut least, mut stalled) = (f64::INFINITY, 0);
        for _ in 0..STRICT {
            let how = (&self.is_strict[..], &mut metric);
            let lacks = self.step(how, (0.0, ROUGH), &mut factors);
            stalled = if lacks < STALLED.1 * least {
                0
            } else {
                stalled + 1
            };
            if lacks < ENOUGH * self.damping || stalled == STALLED.0 {
                break;
            }
            least = least.min(lacks);
        }
        factors
    }

    /// A step of Newton's method for the rows that count; returns the largest of what they lacked. The metric of one step serves the next, as long as it leads there.
    fn step(
        &self,
        (counts, metric): (&[bool], &mut Option<Metric>),
        how: (f64, f64),
        factors: &mut [f64],
    ) -> f64 {
        let mut lacks = self.lacks.clone();
        let minus: Vec<f64> = factors.iter().map(|f| 1.0 - f).collect();
        let changed = self.conditions.product(&minus, counts);
        for ((lacks, changed), counts) in lacks.iter_mut().zip(&changed).zip(counts) {
            *lacks = if *counts { *lacks + changed } else { 0.0 };
        }
        // one that became too small stays where it is
        let root = |f: &f64| if *f > LEAST { f.sqrt() } else { 0.0 };
        let roots: Vec<f64> = factors.iter().map(root).collect();
        let smallest = SMALL_ROW * self.damping;
        let new = || Metric::new(&self.conditions, &roots, counts, (how.0, smallest));
        let solve = |metric: &Metric, most: usize| {
            let system = (&self.conditions, metric);
            least_squares(system, &roots, &lacks, counts, (how.0, how.1, most))
        };
        // the metric of weights that have changed much leads nowhere
        let kept = metric.as_ref().map(|metric| solve(metric, SLOW));
        let changes = match kept.filter(|(_, iterations)| *iterations < SLOW) {
            Some((changes, _)) => changes,
            None => solve(metric.insert(new()), LONGEST).0,
        };
        for ((factor, root), change) in factors.iter_mut().zip(&roots).zip(&changes) {
            if *root > 0.0 {
                *factor *= (1.0 + change / root).max(SMALLEST);
                *factor = factor.max(LEAST);
            }
        }
        lacks.iter().fold(0.0, |most: f64, l| most.max(l.abs()))
    }
}

/// The rows of conditions: of points and sites `D` each, of a family `D (D + 1) / 2`.
struct RowNumbers {
    /// The first row of each point of the zone.
    points: Vec<u32>,
    /// The first row of each site that feet follow.
    sites: Vec<u32>,
    /// The first row of the shape tensor of each point whose weights change.
    shapes: Vec<u32>,
    count: usize,
}

impl RowNumbers {
    fn new<const D: usize>(feet: &Feet<D>, body: &PdBody<D>, near: &[bool]) -> Self {
        let mut touched = near.to_vec();
        for i in (0..feet.points).filter(|&i| near[i]) {
            for &j in body.families.of(i) {
                if let Some(touched) = touched.get_mut(j as usize) {
                    *touched = true;
                }
            }
        }
        let mut count = 0;
        let mut number = |wanted: bool, rows: usize| match wanted {
            true => {
                count += rows;
                (count - rows) as u32
            }
            false => NONE,
        };
        let points = touched.iter().map(|t| number(*t, D)).collect();
        let at_feet = feet.points..body.cloud.position.len();
        let of_feet = at_feet.flat_map(|foot| body.cloud.transfer.row(foot));
        let of_feet: Vec<usize> = of_feet.map(|(site, _)| site as usize).collect();
        let mut followed = vec![false; of_feet.iter().max().map_or(0, |last| last + 1)];
        of_feet.iter().for_each(|&site| followed[site] = true);
        let sites = followed.iter().map(|f| number(*f, D)).collect();
        let shapes = near.iter().map(|n| number(*n, D * (D + 1) / 2)).collect();
        Self {
            points,
            sites,
            shapes,
            count,
        }
    }

    /// Adds the entries of `b` on a point of the cloud, through what it follows.
    fn add<const D: usize>(
        &self,
        body: &PdBody<D>,
        q: usize,
        b: &Vector<D>,
        on: &mut Vec<(u32, f64)>,
    ) {
        let mut push = |first: u32, weight: f64| {
            if first != NONE {
                on.extend((first..).zip(b.iter()).map(|(row, x)| (row, x * weight)));
            }
        };
        match self.points.get(q) {
            Some(&first) => push(first, 1.0),
            None => {
                for (site, weight) in body.cloud.transfer.row(q) {
                    push(self.sites[site as usize], weight);
                }
            }
        }
    }

    /// Leaves those conditions of sites open a little whose feet lie beside a surface of the body.
    fn relax<const D: usize>(&self, feet: &Feet<D>, body: &PdBody<D>, is_strict: &mut [bool]) {
        let beside = (0..feet.points).filter(|&i| !feet.is_whole[i]);
        let feet = beside.flat_map(|i| {
            let family = body.families.of(i).iter().map(|&j| j as usize);
            family.filter(|&j| j >= feet.points)
        });
        for (site, _) in feet.flat_map(|foot| body.cloud.transfer.row(foot)) {
            let first = self.sites[site as usize] as usize;
            is_strict[first..first + D].fill(false);
        }
    }

    /// Sets the target values of the sums, and which of them must be met: far from surfaces all of them.
    fn demand<const D: usize>(
        &self,
        (mesh, of_node): (&Mesh<D>, &Transfer),
        feet: &Feet<D>,
        fit: &mut Fit,
    ) {
        for (q, &first) in self.points.iter().enumerate().filter(|(_, f)| **f != NONE) {
            for (a, wanted) in feet.wanted[q].iter().enumerate() {
                fit.lacks[first as usize + a] = *wanted;
                fit.is_strict[first as usize + a] = feet.is_whole[q];
            }
        }
        for face in &feet.faces {
            let mut add = |node: u32, normal: Vector<D>| {
                for (site, weight) in of_node.row(node as usize) {
                    let first = self.sites.get(site as usize).copied().unwrap_or(NONE);
                    if first != NONE {
                        for (a, n) in normal.iter().enumerate() {
                            fit.lacks[first as usize + a] -= n * weight;
                        }
                    }
                }
            };
            // what the elements lack of the traction that goes through their face
            fem::outward_points(mesh, face, |point| {
                for (&node, shape) in face.nodes.iter().zip(&point.shape) {
                    add(node, point.normal * (shape * point.weight));
                }
            });
        }
    }
}
