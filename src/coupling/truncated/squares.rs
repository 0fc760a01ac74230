//! Factors of pieces, and of whole bonds at the seam, that make affine fields exact on any faces: of a pairwise law, and of an LPS as a sum of squares.
//!
//! The energy of an LPS is `½ κ θ² V + ½ α Σ ω e_d² V V'`, with the bulk modulus κ, `α = D (D + 2) μ/m` and the deviatoric extension `e_d = e − θ |ξ|/D`. Let `A` be the stiffness that a point gets of each of its bonds or pieces, with the energy `½ A g²`, where `g = ξ·Δu/s` is `|ξ|` times the extension. The energy is then
//!
//! ```text
//! ½ κ V_i θ_i² + ½ Σ A (g − |ξ|² θ_i/D)² ,    θ_i Σ A |ξ|⁴ = D Σ A |ξ|² g ,    V_i ∝ Σ A |ξ|⁴
//! ```
//!
//! for any `A ≥ 0`, and never negative, whatever Poisson's ratio is. A bond between two points is split between them, a piece that ends on a face belongs to its point; elements keep their classical energy. Affine fields
//! are exact if the third moments `Σ w A ξ⊗ξ⊗ξ` are in balance at every site, as for a pairwise law, and if `Σ A |ξ|² ξ⊗ξ` is isotropic at every point. The forces of the dilatations are then in
//! balance by themselves: they are a trace of the third moments.

use rustc_hash::FxHashMap;

use super::bond_segments::{End, Segments};
use super::feet::{Shift, shifts};
use crate::coupling::truncated::conditions::Conditions;
use crate::coupling::truncated::fit_parts::{
    FLOOR, MET, MOST_TRIPLES, Part, cube, finish, largest_face, loaded_nodes, pair_tensor, parts,
    points_at_seam, rounding, third, triples,
};
use crate::{model::ModelError, tensor::Vector};

/// Pieces shorter than this part of the spacing get less stiffness to begin with, or their `k/s` would make the stable step arbitrarily short. Half a spacing is the shortest piece where faces follow the lattice.
const SHORT: f64 = 0.5;

/// The most operations of a factorisation of the conditions: some ten seconds, and every iteration takes a hundredth of that.
const MOST_OPERATIONS: f64 = 3e11;

/// A stiffness below this part of the largest is round-off.
const NOTHING: f64 = 1e-12;

/// Change of a trace at the cost of doubling a factor.
const SHIFTED: f64 = 0.5;

/// Unknown of the fit: the energy of a part, or the share of it that one of its two ends gets.
struct Column {
    part: usize,
    /// The end that gets it, with its point.
    end: Option<(usize, u32)>,
    /// Its factor before the fit.
    base: f64,
}

/// Fits a pairwise law with one factor for each part, or an LPS with one for each end of a part; returns what is left, relative to the largest traction.
///
/// If that is more than round-off the factors are of no use.
///
/// # Errors
/// [`ModelError::SeamTooLarge`] before anything is factorised.
pub(super) fn fit_factors<const D: usize>(
    segments: &mut Segments<'_, D>,
    is_state: bool,
) -> Result<f64, ModelError> {
    let nodes = loaded_nodes(segments);
    let tensor = pair_tensor(segments);
    let scale = largest_face(segments, &nodes) * tensor.amax();
    let enough = MET + rounding(segments);
    if is_state {
        // what belongs to no point has no dilatation
        let has_point = |end: &End| matches!(end, End::Point(_));
        segments.cut.retain(|s| s.ends.iter().any(has_point));
    }
    let mut left = f64::INFINITY;
    // a lattice with few bonds may need a second layer of points, faces that are small or meet at sharp corners other traces
    for (is_wide, is_shifted) in [(false, false), (true, false), (true, true)] {
        if is_wide && !is_shifted && !segments.widen() {
            continue;
        }
        let parts = parts(segments);
        let columns = columns(segments, &parts, is_state);
        let shifts = match is_shifted {
            true => shifts(segments, &nodes, SHORT * segments.model.spacing()),
            false => Vec::new(),
        };
        let (mut conditions, target) = {
            let traction = |b: &Vector<D>| {
                let mut of = [0.0; MOST_TRIPLES];
                of.iter_mut()
                    .zip(third(b, &tensor))
                    .for_each(|(to, v)| *to = -v);
                of
            };
            system(segments, &parts, &columns, &shifts, &nodes, traction)
        };
        if is_shifted {
            conditions.last();
        }
        let operations = conditions.operations();
        if operations > MOST_OPERATIONS {
            return Err(ModelError::SeamTooLarge {
                conditions: conditions.count(),
                operations,
                most: MOST_OPERATIONS,
            });
        }
        // without the floor first: where even that fails, nothing else has to be tried
        let (mut change, mut rest) = finish(&conditions, &target, f64::NEG_INFINITY);
        if rest <= 1e-3 * scale && change[..columns.len()].iter().any(|&c| c < FLOOR - 1.0) {
            (change, rest) = finish(&conditions, &target, FLOOR - 1.0);
        }
        left = rest / scale;
        if left <= enough {
            adopt(segments, &parts, &columns, &change);
            for (shift, x) in shifts.iter().zip(&change[columns.len()..]) {
                let piece = &mut segments.cut[shift.piece];
                let by = SHIFTED * x / piece.scale;
                if let End::Face(foot) = &mut piece.ends[shift.side] {
                    foot.shift(&shift.weights, by);
                }
            }
            break;
        }
    }
    Ok(left)
}

/// Stiffness k of the pairwise energy `½ k (ξ·η)²` of the whole bond of a part: the share of one end, or all of it.
fn pair_stiffness<const D: usize>(
    segments: &Segments<'_, D>,
    part: &Part,
    end: Option<usize>,
) -> f64 {
    let (i, j) = part.points(segments);
    let volume = &segments.body.cloud.volume;
    match end {
        None => segments.stiffness(i, j),
        Some(side) => {
            let (own, other) = if side == 0 { (i, j) } else { (j, i) };
            segments.coefficients(own, other).0 * volume[i as usize] * volume[j as usize]
        }
    }
}

fn columns<const D: usize>(
    segments: &Segments<'_, D>,
    parts: &[Part],
    is_state: bool,
) -> Vec<Column> {
    let short = SHORT * segments.model.spacing();
    let mut columns = Vec::with_capacity(2 * parts.len());
    let all: Vec<f64> = parts
        .iter()
        .map(|p| pair_stiffness(segments, p, None))
        .collect();
    let least = NOTHING * all.iter().copied().fold(0.0, f64::max);
    for (part, of) in parts.iter().enumerate() {
        let shape = of.shape(segments);
        let base = (shape.length * shape.xi.norm() / short).min(1.0);
        if !is_state {
            columns.push(Column {
                part,
                end: None,
                base,
            });
            continue;
        }
        let points = [0, 1].map(|side| match of.end(segments, side) {
            End::Point(p) => Some((side, p)),
            End::Face(_) => None,
        });
        let all = all[part];
        if all <= least {
            // at the horizon itself ω vanishes, to round-off, which may be zero for one end alone
            continue;
        }
        for end in points.into_iter().flatten() {
            let own = match points {
                [Some(_), Some(_)] => 1.0,
                // the only point has all of it
                _ => all / pair_stiffness(segments, of, Some(end.0)),
            };
            columns.push(Column {
                part,
                end: Some(end),
                base: base * own,
            });
        }
    }
    columns
}

/// The conditions on changes of the factors, relative to those before the fit, and what is missing.
fn system<const D: usize>(
    segments: &Segments<'_, D>,
    parts: &[Part],
    columns: &[Column],
    shifts: &[Shift],
    nodes: &FxHashMap<u32, Vector<D>>,
    traction: impl Fn(&Vector<D>) -> [f64; MOST_TRIPLES],
) -> (Conditions, Vec<f64>) {
    let count = triples::<D>().count();
    let even = D * (D + 1) / 2 - 1;
    let points: Vec<u32> = points_at_seam(segments).collect();
    let mut sites: Vec<u32> = nodes.keys().copied().collect();
    sites.extend(points.iter().map(|&p| segments.site[p as usize]));
    sites.sort_unstable();
    let rows: FxHashMap<u32, usize> = sites.iter().copied().zip((0..).step_by(count)).collect();
    let first = sites.len() * count;
    let is_state = columns.iter().any(|c| c.end.is_some());
    let carriers: FxHashMap<u32, usize> = match is_state {
        true => points
            .iter()
            .copied()
            .zip((first..).step_by(even.max(1)))
            .collect(),
        false => FxHashMap::default(),
    };
    let size = first + carriers.len() * even;
    let mut conditions = Conditions::new(size);
    let mut target = vec![0.0; size];
    for (site, b) in nodes {
        target[rows[site]..][..count].copy_from_slice(&traction(b)[..count]);
    }
    let spacing = segments.model.spacing();
    for (number, column) in columns.iter().enumerate() {
        let part = &parts[column.part];
        let shape = part.shape(segments);
        let end = column.end.map(|e| e.0);
        let own = pair_stiffness(segments, part, end) * shape.share;
        // points keep what their whole bonds had
        let is_first = number == 0 || columns[number - 1].part != column.part;
        let all = match is_first {
            true => pair_stiffness(segments, part, None) * shape.share,
            false => 0.0,
        };
        let cube = cube(&shape.xi, 1.0);
        for &(site, w) in &shape.difference {
            let Some(&row) = rows.get(&site) else {
                continue;
            };
            let kept = if nodes.contains_key(&site) { 0.0 } else { all };
            for (c, v) in cube.iter().take(count).enumerate() {
                conditions.add(row + c, column.base * own * w * v);
                target[row + c] += (kept - column.base * own) * w * v;
            }
        }
        if let Some((_, point)) = column.end
            && let Some(&row) = carriers.get(&point)
        {
            let xx = shape.xi * shape.xi.transpose();
            let size = own * shape.xi.norm_squared() / spacing;
            let mut c = row;
            for a in 0..D {
                for b in a.max(1)..D {
                    // off the diagonal, and the diagonal's deviation from its first
                    let first = if a == b { xx[(0, 0)] } else { 0.0 };
                    let v = size * (xx[(a, b)] - first);
                    conditions.add(c, column.base * shape.length * v);
                    target[c] += (1.0 - column.base * shape.length) * v;
                    c += 1;
                }
            }
        }
        conditions.close();
    }
    conditions.free_from_here();
    add_shifts(&mut conditions, segments, shifts, &rows, count);
    (conditions, target)
}
/// Adds the columns of shifts along faces.
fn add_shifts<const D: usize>(
    conditions: &mut Conditions,
    segments: &Segments<'_, D>,
    shifts: &[Shift],
    rows: &FxHashMap<u32, usize>,
    count: usize,
) {
    for shift in shifts {
        let part = Part::Piece(shift.piece);
        let shape = part.shape(segments);
        let sign = [-SHIFTED, SHIFTED][shift.side];
        let size = sign * pair_stiffness(segments, &part, None) * shape.share;
        let cube = cube(&shape.xi, size);
        for &(site, w) in &shift.weights {
            let Some(&row) = rows.get(&site) else {
                continue;
            };
            for (c, v) in cube.iter().take(count).enumerate() {
                conditions.add(row + c, w * v);
            }
        }
        conditions.close();
    }
}

/// Gives the parts their factors.
fn adopt<const D: usize>(
    segments: &mut Segments<'_, D>,
    parts: &[Part],
    columns: &[Column],
    change: &[f64],
) {
    let mut volumes: FxHashMap<u32, f64> = FxHashMap::default();
    for of in columns
        .iter()
        .zip(change)
        .collect::<Vec<_>>()
        .chunk_by(|a, b| a.0.part == b.0.part)
    {
        let part = &parts[of[0].0.part];
        let (i, j) = part.points(segments);
        let shape = part.shape(segments);
        let all = pair_stiffness(segments, part, None);
        let (mut scale, mut hands) = (0.0, [0.0; 2]);
        for (column, x) in of {
            let factor = column.base * (1.0 + **x);
            let own = pair_stiffness(segments, part, column.end.map(|e| e.0));
            scale += factor * own / all;
            let Some((side, point)) = column.end else {
                continue;
            };
            hands[side] = factor;
            let (own, other) = if side == 0 { (i, j) } else { (j, i) };
            let state = segments.body.state(point as usize);
            let m = state.map_or(f64::INFINITY, |s| s.shape.trace());
            let far = segments.coefficients(own, other).1
                * segments.body.cloud.volume[other as usize]
                * shape.xi.norm_squared();
            *volumes.entry(point).or_insert(1.0) +=
                (factor * shape.length - 1.0) * shape.share * far / m;
        }
        let is_state = of[0].0.end.is_some();
        match *part {
            Part::Piece(k) => {
                segments.cut[k].scale = scale;
                if is_state {
                    segments.cut[k].hands = hands;
                }
            }
            Part::Bond(i, j) => {
                let changed = segments.changed.entry((i, j)).or_default();
                changed.scale = scale - 1.0;
                if is_state {
                    changed.hands = hands.map(|h| h - 1.0);
                }
            }
        }
    }
    segments.volume = volumes;
}
