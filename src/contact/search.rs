//! Facets that each place may touch soon, by cells.

use super::closest;
use super::surface::{FACING, NONE, Surface};
use crate::parallel;
use crate::tensor::Vector;

/// Cosine between outward normals above which surfaces are not listed: they may turn before the next search.
const MAY_FACE: f64 = FACING + 0.3;

/// Lists of the places that may touch.
#[derive(Debug, Default)]
pub(super) struct Near {
    /// Places with any facet on their lists, ascending.
    pub places: Vec<u32>,
    /// Start of the list of each, and their end.
    pub starts: Vec<u32>,
    /// Facets of all lists.
    pub facets: Vec<u32>,
}

impl Near {
    /// The facets on a list.
    pub fn of(&self, number: usize) -> &[u32] {
        &self.facets[self.starts[number] as usize..self.starts[number + 1] as usize]
    }
}

/// A facet, or a place that is a point, in a cell.
type Item = u32;

/// Marks a place among items.
const POINT: u32 = 1 << 31;

/// Lists the facets within reach of each place: its clearance, the depth up to which it is pushed out, and the `skin`. Corners of facets are `at`, points `now`, and a place is where `place_at` says.
pub(super) fn list<const D: usize>(
    surface: &Surface<D>,
    at: &[Vector<D>],
    now: &[Vector<D>],
    place_at: &(dyn Fn(u32) -> Vector<D> + Sync),
    skin: f64,
) -> Near {
    if surface.facets.is_empty() {
        return Near::default();
    }
    let normals: Vec<Vector<D>> =
        parallel::map(surface.facets.len(), 256, |f| surface.normal(f as u32, at));
    let first_point = surface.places.len() - now.len();
    let deepest = surface.deepest;
    let pairs = pairs_in_cells(surface, at, &normals, (now, first_point), skin);
    let meets = |place: u32, facet: u32| {
        let own = &surface.places[place as usize];
        let other = &surface.facets[facet as usize];
        let reach = skin + own.clearance + deepest * own.size.max(other.size);
        let corners = surface.corners_of(facet, at);
        if own.facet == NONE {
            let x = &now[place as usize - first_point];
            return distance(&corners, x) <= reach && !is_held(surface, place, facet);
        }
        let of_own = surface.corners_of(own.facet, at);
        apart(&of_own, &corners) <= reach && !surface.are_neighbours(own.facet, facet)
    };
    let mut found: Vec<(u32, u32)> = parallel::listed(pairs.len(), 256, |k, found| {
        let (item, facet) = pairs[k];
        let mut places = match item & POINT {
            0 => places_of(surface, item),
            _ => {
                let place = (item & !POINT) + first_point as u32;
                place..place + 1
            }
        };
        // places of one facet share its neighbours
        if places.is_empty() || !meets(places.start, facet) {
            return;
        }
        let corners = surface.corners_of(facet, at);
        let other = &surface.facets[facet as usize];
        let is_near = |place: &u32| {
            let own = &surface.places[*place as usize];
            let reach = skin + own.clearance + deepest * own.size.max(other.size);
            distance(&corners, &place_at(*place)) <= reach
        };
        found.extend(places.by_ref().filter(is_near).map(|place| (place, facet)));
    });
    found.sort_unstable();
    let mut near = Near::default();
    for (place, facet) in found {
        if near.places.last() != Some(&place) {
            near.places.push(place);
            near.starts.push(near.facets.len() as u32);
        }
        near.facets.push(facet);
    }
    near.starts.push(near.facets.len() as u32);
    near
}

/// The places on a facet.
fn places_of<const D: usize>(surface: &Surface<D>, facet: u32) -> std::ops::Range<u32> {
    let first = surface.places.partition_point(|p| p.facet < facet);
    let end = surface.places.partition_point(|p| p.facet <= facet);
    first as u32..end as u32
}

/// Returns true if bonds hold a point near a facet of its own body.
fn is_held<const D: usize>(surface: &Surface<D>, place: u32, facet: u32) -> bool {
    let same = surface.places[place as usize].body == surface.facets[facet as usize].body;
    same && {
        let corners = surface.corners_of(facet, &surface.corners);
        distance(&corners, &surface.rest[place as usize]) < surface.horizon
    }
}

fn distance<const D: usize>(corners: &[Vector<D>; D], x: &Vector<D>) -> f64 {
    let weights = closest::nearest(corners, x);
    let place: Vector<D> = corners.iter().zip(weights).map(|(c, w)| c * w).sum();
    (place - x).norm()
}

/// A lower bound of the distance of two facets, by the balls around them.
fn apart<const D: usize>(a: &[Vector<D>; D], b: &[Vector<D>; D]) -> f64 {
    let ball = |corners: &[Vector<D>; D]| {
        let middle = corners.iter().sum::<Vector<D>>() / D as f64;
        let radius = corners.iter().map(|c| (c - middle).norm());
        (middle, radius.fold(0.0, f64::max))
    };
    let ((p, r), (q, s)) = (ball(a), ball(b));
    (p - q).norm() - r - s
}

/// Length of a piece of a crack, over that at rest, beyond which its points have parted.
const TORN: f64 = 3.0;

/// Largest extent of a facet at rest along an axis.
fn extents_at_rest<const D: usize>(surface: &Surface<D>, facet: usize) -> f64 {
    let corners = surface.corners_of(facet as u32, &surface.corners);
    let each = corners.iter().map(|c| (c - corners[0]).amax());
    each.fold(0.0, f64::max)
}

/// Pairs of an item and a facet that it may face of which boxes meet the same cell, each once.
fn pairs_in_cells<const D: usize>(
    surface: &Surface<D>,
    at: &[Vector<D>],
    normals: &[Vector<D>],
    (now, first_point): (&[Vector<D>], usize),
    skin: f64,
) -> Vec<(Item, u32)> {
    let points = surface.places[first_point..].iter();
    let of_points = points.map(|p| p.clearance + surface.deepest * p.size);
    let of_points = of_points.fold(0.0, f64::max);
    let boxes: Vec<(Vector<D>, Vector<D>)> = parallel::map(surface.facets.len(), 256, |f| {
        let corners = surface.corners_of(f as u32, at);
        let reach = skin + of_points.max(surface.deepest * surface.facets[f].size);
        let fold = |of: fn(f64, f64) -> f64| {
            let rest = corners[1..].iter();
            rest.fold(corners[0], |sum, c| sum.zip_map(c, of))
        };
        (
            fold(f64::min).add_scalar(-reach),
            fold(f64::max).add_scalar(reach),
        )
    });
    // cells as wide as the mean box: large facets lie in many
    let widths = boxes.iter().map(|(low, high)| (high - low).amax());
    let width = widths.sum::<f64>() / boxes.len() as f64;
    let cell =
        |x: &Vector<D>| -> [i32; D] { std::array::from_fn(|a| (x[a] / width).floor() as i32) };
    let mut cells: Vec<([i32; D], Item)> = Vec::new();
    let finite = |x: &Vector<D>| x.iter().all(|x| x.is_finite());
    for (f, (low, high)) in boxes.iter().enumerate() {
        let (extent, rest) = ((high - low).amax(), extents_at_rest(surface, f));
        // a face of a crack whose points have flown apart is none
        let is_torn = f >= surface.cracks_from as usize && extent > TORN * (rest + width);
        if finite(low) && finite(high) && !is_torn {
            let (low, high) = (cell(low), cell(high));
            let counts: [usize; D] = std::array::from_fn(|a| (high[a] - low[a] + 1) as usize);
            for index in 0..counts.iter().product() {
                let mut rest = index;
                let key = std::array::from_fn(|a| {
                    let k = rest % counts[a];
                    rest /= counts[a];
                    low[a] + k as i32
                });
                cells.push((key, f as u32));
            }
        }
    }
    let is_asked =
        |p: usize, x: &Vector<D>| finite(x) && surface.places[first_point + p].area > 0.0;
    // the boxes of facets hold the reach of points
    let own = |(p, x): (usize, &Vector<D>)| (cell(x), p as u32 | POINT);
    let points = now.iter().enumerate().filter(|(p, x)| is_asked(*p, x));
    cells.extend(points.map(own));
    cells.sort_unstable();
    let mut pairs = Vec::new();
    for cell in cells.chunk_by(|a, b| a.0 == b.0) {
        let end = cell.partition_point(|(_, item)| item & POINT == 0);
        for &(_, facet) in &cell[..end] {
            let faces = |item: &Item| {
                *item & POINT != 0
                    || normals[*item as usize].dot(&normals[facet as usize]) <= MAY_FACE
            };
            let others = cell.iter().map(|(_, item)| *item).filter(faces);
            pairs.extend(others.map(|item| (item, facet)));
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
