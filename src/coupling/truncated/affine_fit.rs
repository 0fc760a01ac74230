//! Seams whose faces cut the lattice anywhere: factors for the energies of pieces, and shares of dilatations, that make affine fields exact again.
//!
//! A piece keeps its form, `c s w(ξ, Δu/s)` with a factor `c`, and so do the whole bonds between the points that have pieces. Under `u = G x` it pulls with `c` times the force of the whole bond,
//! so equilibrium at every site is linear in the factors: the sums of `c k ξ⊗ξ⊗ξ` over the ends at a point vanish, those at a node, weighted with its shape function, equal the traction of the lattice times
//! the integral of the shape function. These are D (D+1) (D+2)/6 conditions per site (the third-order tensor is symmetric). Of all factors that meet them, and stay above a floor so that every energy is positive, those nearest
//! to 1 are taken. What a piece contributes to the dilatations of an LPS is changed in the same way, without a floor: every point's dilatation is tr G, every element's a multiple of it, and their pressures balance
//! at every site.
//!
//! If the seam follows the lattice nothing is missing, and nothing is changed.

use rustc_hash::FxHashMap;

use super::bond_segments::{End, Segments};
use super::corner_correction::EdgeCorrection;
use super::squares::fit_factors;
use crate::coupling::truncated::conditions::Conditions;
use crate::coupling::truncated::fit_parts::{
    FLOOR, MET, Part, cube, finish, largest_face, loaded_nodes, pair_tensor, parts, points_at_seam,
    rounding, third, triples,
};
use crate::coupling::truncated::lps_constants::state_of;
use crate::{model::ModelError, peridynamics::StatePart, tensor::Vector};

/// Missing force on a node, relative to the largest traction of a face, below which a seam follows the lattice.
const FOLLOWS: f64 = 1e-10;

const NONE: u32 = u32::MAX;

/// The conditions on the energies of a seam whose faces cut the lattice anywhere, for an affine field.
#[derive(Clone, Debug, PartialEq)]
pub struct SeamConditions {
    /// Missing amount in each condition.
    pub target: Vec<f64>,
    /// For each energy that may change (pieces, and whole bonds between points at the seam and their neighbours) the conditions in which it counts, and what a change of its factor by 1 adds to them.
    pub columns: Vec<Vec<(usize, f64)>>,
    /// The least change of a factor by which an energy stays positive.
    pub floor: f64,
}

/// Returns the conditions of the pairwise part.
pub(super) fn conditions<const D: usize>(segments: &mut Segments<'_, D>) -> SeamConditions {
    let Missing { missing, .. } = missing(segments);
    segments.widen();
    let parts = parts(segments);
    let (conditions, target) = pair_conditions(segments, &parts, &missing);
    SeamConditions {
        target,
        columns: (0..conditions.changes())
            .map(|k| conditions.column(k).collect())
            .collect(),
        floor: FLOOR - 1.0,
    }
}

/// Unmet conditions before a fit.
struct Missing<const D: usize> {
    /// Integrals of gradients by site, as [`loaded_nodes`] gives them.
    nodes: FxHashMap<u32, Vector<D>>,
    /// Conditions by site.
    missing: FxHashMap<u32, Vec<f64>>,
    /// The largest traction of a face.
    scale: f64,
}

fn missing<const D: usize>(segments: &Segments<'_, D>) -> Missing<D> {
    let nodes = loaded_nodes(segments);
    let tensor = pair_tensor(segments);
    let scale = largest_face(segments, &nodes) * tensor.amax();
    let count = triples::<D>().count();
    let mut row_of_site = vec![NONE; segments.model.sites.len()];
    let mut rows = Vec::with_capacity(nodes.len() * count);
    for (row, (&site, b)) in nodes.iter().enumerate() {
        row_of_site[site as usize] = row as u32;
        rows.extend(third(b, &tensor).map(|v| -v));
    }
    for s in &segments.cut {
        let xi = segments.body.bond(s.i as usize, s.j as usize);
        let cube = cube(&xi, s.stiffness * s.piece.share);
        for (site, w) in segments.difference(s) {
            let row = row_of_site[site as usize];
            if row != NONE {
                let row = &mut rows[row as usize * count..][..count];
                row.iter_mut().zip(&cube).for_each(|(m, c)| *m -= w * c);
            }
        }
    }
    let missing = nodes.keys().copied().zip(rows.chunks_exact(count));
    let missing = missing.map(|(site, row)| (site, row.to_vec())).collect();
    Missing {
        nodes,
        missing,
        scale,
    }
}

/// Fits the seam unless it follows the lattice; returns true if it has.
///
/// # Errors
/// [`ModelError::Seam`] with what is left if no positive factors meet the conditions, [`ModelError::SeamTooLarge`] if they are too many.
pub(super) fn fit<const D: usize>(
    segments: &mut Segments<'_, D>,
    strings: &EdgeCorrection<D>,
) -> Result<bool, ModelError> {
    let Missing {
        nodes,
        missing,
        scale,
    } = missing(segments);
    let rounding = rounding(segments);
    let follows = |missing: &FxHashMap<u32, Vec<f64>>| {
        missing.iter().all(|(site, m)| {
            strings.holds(*site) || m.iter().all(|m| m.abs() <= (FOLLOWS + rounding) * scale)
        })
    };
    let state = state_of(segments)?;
    let is_negative = state.is_some_and(|s| s.modulus.get(0, 0, 0, 0) < 0.0);
    // the faces of a zone with a rim of its own are those of lattice cells; what is missing there is the surface of the body
    let follows = segments.model.mesh.embedded.has_patch() || follows(&missing);
    if state.is_some_and(|s| s.deviator != 0.0) {
        // the fit is for a law with one dilatation
        return match follows {
            true => Ok(false),
            false => Err(ModelError::TwoDilatations),
        };
    }
    if follows && (!is_negative || segments.passing.whole.len() > 1) {
        return Ok(false);
    }
    if segments.passing.whole.len() > 1 {
        return Err(ModelError::Unsupported {
            what: "several lattices with faces that do not follow them",
            remedy: "let the faces follow the lattices (element edges a whole number of spacings long), or use one lattice",
        });
    }
    let mut trial = segments.clone();
    let mut left = fit_factors(&mut trial, state.is_some())?;
    if left <= MET + rounding {
        trial.is_squares = state.is_some();
        *segments = trial;
        return Ok(true);
    }
    if follows {
        return Ok(false);
    }
    let Some(state) = state else {
        return Err(ModelError::Seam {
            what: "positive factors",
            residual: left,
        });
    };
    // the pairwise part by itself, and shares of dilatations for it
    let mut trial = segments.clone();
    left = fit_factors(&mut trial, false)?;
    if left <= MET + rounding {
        let parts = parts(&trial);
        let rest = state_change(&mut trial, &parts, &nodes, state);
        if rest > MET + rounding {
            return Err(ModelError::Seam {
                what: "shares of the dilatation",
                residual: rest,
            });
        }
        *segments = trial;
        return Ok(true);
    }
    Err(ModelError::Seam {
        what: "positive factors",
        residual: left,
    })
}

/// The conditions on changes of the factors, and what is missing.
fn pair_conditions<const D: usize>(
    segments: &Segments<'_, D>,
    parts: &[Part],
    missing: &FxHashMap<u32, Vec<f64>>,
) -> (Conditions, Vec<f64>) {
    let count = triples::<D>().count();
    let mut rows: FxHashMap<u32, usize> = FxHashMap::default();
    let mut sites: Vec<u32> = missing.keys().copied().collect();
    sites.extend(points_at_seam(segments).map(|p| segments.site[p as usize]));
    sites.sort_unstable();
    for &site in &sites {
        let next = rows.len();
        rows.insert(site, next);
    }
    let mut conditions = Conditions::new(rows.len() * count);
    for part in parts {
        let (i, j) = part.points(segments);
        let shape = part.shape(segments);
        let cube = cube(&shape.xi, segments.stiffness(i, j) * shape.share);
        for (site, w) in shape.difference {
            if let Some(&row) = rows.get(&site) {
                for (c, v) in cube.iter().take(count).enumerate() {
                    conditions.add(row * count + c, w * v);
                }
            }
        }
        conditions.close();
    }
    let mut target = vec![0.0; rows.len() * count];
    for (site, m) in missing {
        target[rows[site] * count..][..count].copy_from_slice(m);
    }
    (conditions, target)
}

/// The rows of the conditions on the contributions of parts to dilatations.
struct StateRows {
    /// The second moments of each point.
    points: FxHashMap<u32, usize>,
    /// The forces on each site.
    sites: FxHashMap<u32, usize>,
    /// The second moments of each element.
    cells: FxHashMap<u32, usize>,
    /// Nodes, ascending.
    order: Vec<u32>,
    /// First row whose target is not zero: those of nodes and elements.
    closed: usize,
    count: usize,
}

impl StateRows {
    /// Of the points, nodes and elements at a seam.
    fn of<const D: usize>(segments: &Segments<'_, D>, nodes: &FxHashMap<u32, Vector<D>>) -> Self {
        let mut count = 0;
        let mut rows = |size: usize| {
            count += size;
            count - size
        };
        let moments = D * (D + 1) / 2;
        let mut points: FxHashMap<u32, usize> = FxHashMap::default();
        let mut sites: FxHashMap<u32, usize> = FxHashMap::default();
        for p in points_at_seam(segments) {
            points.insert(p, rows(moments));
            sites.insert(segments.site[p as usize], rows(D));
        }
        let closed = rows(0);
        let mut order: Vec<u32> = nodes.keys().copied().collect();
        order.sort_unstable();
        for &site in &order {
            sites.insert(site, rows(D));
        }
        let mut cells: FxHashMap<u32, usize> = FxHashMap::default();
        for s in &segments.cut {
            for end in &s.ends {
                if let End::Face(foot) = end {
                    for &c in &foot.cells {
                        cells.entry(c).or_insert_with(|| rows(moments - 1));
                    }
                }
            }
        }
        Self {
            points,
            sites,
            cells,
            order,
            closed,
            count,
        }
    }
}

/// Changes the contributions of parts to dilatations; returns the largest relative residual.
///
/// Conditions: the second moments of the contributions to a point keep their values, those to an element become isotropic. The forces of a uniform pressure on a point stay in balance; those on a node become its share of the
/// pressure of the zone. Moments are per volume of a cell of the lattice, forces per area of its face, so that all are of the size of 1.
fn state_change<const D: usize>(
    segments: &mut Segments<'_, D>,
    parts: &[Part],
    nodes: &FxHashMap<u32, Vector<D>>,
    reference: &StatePart<D>,
) -> f64 {
    let volume = segments.model.typical_volume();
    let area = segments.model.spacing().powi(D as i32 - 1);
    let over_m = D as f64 / reference.shape.trace();
    let StateRows {
        points,
        sites,
        cells,
        order,
        closed,
        count,
    } = StateRows::of(segments, nodes);
    let mut conditions = Conditions::new(count);
    let mut hands = Vec::with_capacity(2 * parts.len());
    for part in parts {
        let (i, j) = part.points(segments);
        let shape = part.shape(segments);
        let xx = shape.xi * shape.xi.transpose();
        let now = part.hands(segments);
        for side in 0..2 {
            let (own, other) = if side == 0 { (i, j) } else { (j, i) };
            let strength =
                over_m * segments.coefficients(own, other).1 * volume * volume * shape.share;
            let per_volume = strength * shape.length / volume;
            match part.end(segments, side) {
                End::Point(p) => {
                    let all = (0..D).flat_map(|a| (a..D).map(move |b| (a, b)));
                    for (c, (a, b)) in all.enumerate() {
                        conditions.add(points[&p] + c, per_volume * xx[(a, b)]);
                    }
                }
                End::Face(foot) => {
                    let per_cell = per_volume / foot.cells.len() as f64;
                    for cell in &foot.cells {
                        let mut row = cells[cell];
                        for a in 0..D {
                            for b in a.max(1)..D {
                                // off the diagonal, and the diagonal's deviation from its first
                                let first = if a == b { xx[(0, 0)] } else { 0.0 };
                                conditions.add(row, per_cell * (xx[(a, b)] - first));
                                row += 1;
                            }
                        }
                    }
                }
            }
            for &(site, w) in &shape.difference {
                if let Some(&row) = sites.get(&site) {
                    for a in 0..D {
                        conditions.add(row + a, strength * w * shape.xi[a] / area);
                    }
                }
            }
            conditions.close();
            hands.push(now[side]);
        }
    }
    let mut target = vec![0.0; count];
    for site in &order {
        for a in 0..D {
            target[sites[site] + a] = -nodes[site][a] / area;
        }
    }
    for (t, now) in target.iter_mut().zip(conditions.sum(&hands)).skip(closed) {
        *t -= now;
    }
    let (change, left) = finish(&conditions, &target, f64::NEG_INFINITY);
    for (part, c) in parts.iter().zip(change.chunks_exact(2)) {
        part.add_hands(segments, [c[0], c[1]]);
    }
    left
}
