//! Bonds between points that stand.

use rustc_hash::FxHashSet;

use super::solution::Solved;
use crate::model::SiteKind;

/// Bonds between points that stand.
pub(super) struct Intact {
    broken: FxHashSet<(u32, u32)>,
    /// Points with a broken bond.
    torn: FxHashSet<u32>,
}

impl Intact {
    pub fn of<const D: usize>(solved: &Solved<'_, D>) -> Self {
        let sites = &solved.model.sites;
        let point = |site: u32| match sites[site as usize].kind {
            SiteKind::Point(p) => Some(p),
            SiteKind::Node(_) => None,
        };
        let broken = solved.moved.broken.iter();
        let broken: FxHashSet<(u32, u32)> = broken
            .filter_map(|&(i, j)| point(i).zip(point(j)))
            .collect();
        Self {
            torn: broken.iter().flat_map(|&(i, j)| [i, j]).collect(),
            broken,
        }
    }

    /// Returns true if no bond of a point is broken.
    pub fn is_whole(&self, point: usize) -> bool {
        !self.torn.contains(&(point as u32))
    }

    pub fn is_intact(&self, i: usize, j: usize) -> bool {
        self.broken.is_empty() || !self.broken.contains(&(i as u32, j as u32))
    }
}
