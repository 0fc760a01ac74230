//! Families that each of several processes holds: those of its own points, and of all points beside elements.
//!
//! Beside elements every process works out the seam as one process does, whose rows, fits and proofs look at the families of several points. That is a layer; inside of it bonds lie with
//! the owner of their point alone.

use super::{Peridynamics, Reach};
use crate::model::HorizonField;
use crate::model::ZoneLayout;
use crate::peridynamics::TIE_TOLERANCE;

/// Depth, in families, of the rows and fits of a seam, by whether the force of a bond takes the states of its ends.
pub(crate) const fn depth_of_seam(is_pairwise: bool) -> usize {
    // a bond that a face cuts, and those that a fit of a second layer changes; a state reaches one family farther, and so do the bonds that carry it
    if is_pairwise { 2 } else { 4 }
}

/// Families that a process holds beside those of its own points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HeldFamilies {
    /// Those of the points in the families of its own, too.
    pub with_neighbours: bool,
    /// Those of all points that are no farther from an element beside the points \[m\].
    pub depth: f64,
    /// Bonds of a family that lacks none.
    pub full: usize,
    /// Distance of neighbouring points \[m\].
    pub spacing: f64,
}

impl HeldFamilies {
    /// By the coupling; none where it needs those of all points, or where families are not alike.
    pub fn of<const D: usize>(
        coupling: &dyn ZoneLayout<D>,
        p: &Peridynamics<D>,
        reach: Reach,
        spacing: f64,
    ) -> Option<Self> {
        let HorizonField::Uniform(horizon) = p.horizon else {
            return None;
        };
        let law = p.law.linearised();
        let families = coupling.families_of_all(law)?;
        let longest = p.reach(horizon);
        Some(Self {
            with_neighbours: reach == Reach::Neighbours || !law.is_pairwise(),
            depth: families as f64 * longest * (1.0 + TIE_TOLERANCE),
            full: places_within::<D>(longest / spacing * (1.0 + TIE_TOLERANCE)),
            spacing,
        })
    }
}

/// Places of a cubic lattice of spacing 1 within a distance of one of them, without that one.
fn places_within<const D: usize>(distance: f64) -> usize {
    let reach = distance.clamp(0.0, 1e3) as i64;
    let side = 2 * reach + 1;
    let is_within = |n: &i64| {
        let mut rest = *n;
        let square: i64 = (0..D)
            .map(|_| {
                let k = rest % side - reach;
                rest /= side;
                k * k
            })
            .sum();
        square > 0 && (square as f64).sqrt() <= distance
    };
    (0..side.pow(D as u32)).filter(is_within).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn families_that_lack_nothing() {
        assert_eq!(places_within::<1>(3.0), 6);
        assert_eq!(places_within::<2>(3.0), 28);
        assert_eq!(places_within::<3>(3.0), 122);
    }
}
