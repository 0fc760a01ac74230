//! Weights and limits of the bonds of a lattice, by their steps.

use super::{BondSetup, force_problem::ENDS, shared_rows::Known};
use crate::{parallel, peridynamics::offset_table::OffsetTable};

/// Largest distance of a weight from that of its offset, in parts of it.
const TOLERANCE: f64 = 1e-9;

/// Steps of the box around the longest bond above which lists are better.
const MOST_STEPS: f64 = 1e6;

/// Points of which a task looks at the bonds, at least, and tasks at most: each has a table.
const POINTS: usize = 1024;
const TASKS: usize = 64;

/// Part of [`ENDS`] by which like bonds may differ for their ends to be known alike without a look at each: a bond and its reverse are five comparisons apart.
const ALIKE: f64 = 0.2 * ENDS;

/// Part of the largest weight below which a weight is measured by that: what rounding leaves of an influence function that vanishes at the horizon is no difference.
const SMALL: f64 = 1e-3;

/// Returns true if weights or limits of two bonds differ by more than a part of them; `largest` is the largest weight around.
fn differs((w, l): (f64, f64), (weight, limit): (f64, f64), part: f64, largest: f64) -> bool {
    (w - weight).abs() > part * w.abs().max(SMALL * largest)
        || (l != limit && (l - limit).abs() > part * l.abs())
}

/// The largest weight of a table.
fn largest<const D: usize>(found: &OffsetTable<Known, D>) -> f64 {
    let weights = found.known().map(|(_, ((weight, _), ..))| weight.abs());
    weights.fold(0.0, f64::max)
}

/// Weights and limits of the bonds of a lattice.
pub(super) struct Numbers<const D: usize> {
    pub by_steps: OffsetTable<(f64, f64), D>,
    /// True if all of them differ so little that no bond differs between its ends.
    pub are_alike: bool,
}

/// Weight and limit of each bond that occurs, by its steps; or why bonds of the same steps differ.
pub(super) fn numbers<const D: usize>(
    setup: &BondSetup<'_, D>,
    points: usize,
    step: impl Fn(usize, u32) -> [i32; D] + Sync,
) -> Result<Numbers<D>, String> {
    let reaches = parallel::map(points.div_ceil(POINTS), 1, |task| {
        let points = task * POINTS..((task + 1) * POINTS).min(points);
        let bonds = points.flat_map(|i| setup.families.of(i).iter().map(move |&j| (i, j)));
        let farthest = |(i, j)| step(i, j).into_iter().map(i32::abs).max();
        bonds.filter_map(farthest).max().unwrap_or(0)
    });
    let reach = reaches.into_iter().max().unwrap_or(0);
    let known = first_bonds(setup, points, reach, step);
    let (all, mut are_alike) = match (setup.shared, known) {
        (None, known) => known?,
        (Some(shared), known) => {
            let merged = shared.merged(known.as_ref().ok().map(|(found, _)| found));
            let (found, mut are_alike) = known?;
            let all = merged.ok_or("other processes have found none")?;
            // those of other processes may differ from the own ones
            let mut is_like = true;
            let largest = largest(&all);
            for (steps, (own, ..)) in found.known() {
                if let Some((known, ..)) = all.of(&steps) {
                    is_like &= !differs(known, own, TOLERANCE, largest);
                    are_alike &= !differs(known, own, ALIKE, largest);
                }
            }
            if !setup.holds_on_all(is_like) {
                return Err("bonds weigh other than their like elsewhere".into());
            }
            (all, are_alike)
        }
    };
    let largest = largest(&all);
    let all = all.map(|(numbers, ..)| numbers);
    let back = |steps: &[i32; D]| all.of(&steps.map(|s| -s));
    are_alike &= all
        .known()
        .all(|(steps, own)| back(&steps).is_none_or(|other| !differs(other, own, ALIKE, largest)));
    Ok(Numbers {
        by_steps: all,
        are_alike,
    })
}

/// The first bond of each that occurs, by its steps, with its weight and limit, and whether all of the same steps are alike; or why they differ.
fn first_bonds<const D: usize>(
    setup: &BondSetup<'_, D>,
    points: usize,
    reach: i32,
    step: impl Fn(usize, u32) -> [i32; D] + Sync,
) -> Result<(OffsetTable<Known, D>, bool), String> {
    if f64::from(2 * reach + 1).powi(D as i32) > MOST_STEPS {
        return Err(format!("a bond takes {reach} steps of it"));
    }
    let fault = |i: usize, j: u32| {
        format!("the bond of points {i} and {j} weighs other than its like elsewhere")
    };
    // tasks of fixed size, joined in order: the first point with a bond gives its numbers, for any number of threads
    let size = POINTS.max(points.div_ceil(TASKS));
    let parts: Vec<(OffsetTable<Known, D>, bool)> =
        parallel::try_map(points.div_ceil(size), 1, |task| {
            let points = task * size..((task + 1) * size).min(points);
            // every family has bonds of the largest weight, unless it is cut off
            let first = points.clone().find(|&i| !setup.families.of(i).is_empty());
            let largest = first.map_or(0.0, |i| {
                let weight =
                    |(k, &j): (usize, &u32)| setup.weight(i, k, &setup.bond(i, j as usize)).abs();
                let family = setup.families.of(i).iter().enumerate();
                family.map(weight).fold(0.0, f64::max)
            });
            let (mut found, mut are_alike) = (OffsetTable::empty(reach), true);
            for i in points {
                for (k, &j) in setup.families.of(i).iter().enumerate() {
                    let xi = setup.bond(i, j as usize);
                    let own = (setup.weight(i, k, &xi), setup.limit(i, k, &xi));
                    let Some(known) = found.slot(&step(i, j)) else {
                        continue;
                    };
                    let (known, ..) = *known.get_or_insert((own, i, j));
                    if differs(known, own, TOLERANCE, largest) {
                        return Err(fault(i, j));
                    }
                    are_alike &= !differs(known, own, ALIKE, largest);
                }
            }
            Ok((found, are_alike))
        })?;
    let (mut all, mut are_alike) = (OffsetTable::empty(reach), true);
    let most = parts.iter().map(|(part, _)| largest(part));
    let most = most.fold(0.0, f64::max);
    for (part, are) in parts {
        are_alike &= are;
        for (steps, (own, i, j)) in part.known() {
            let Some(known) = all.slot(&steps) else {
                continue;
            };
            let (known, ..) = *known.get_or_insert((own, i, j));
            if differs(known, own, TOLERANCE, most) {
                return Err(fault(i, j));
            }
            are_alike &= !differs(known, own, ALIKE, most);
        }
    }
    Ok((all, are_alike))
}
