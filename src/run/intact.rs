//! Bonds between points that stand.

use rustc_hash::FxHashSet;

use super::solution::Solved;
use crate::model::SiteKind;

/// Bonds between points that stand.
pub(super) struct Intact(FxHashSet<(u32, u32)>);

impl Intact {
    pub fn of<const D: usize>(solved: &Solved<'_, D>) -> Self {
        let sites = &solved.model.sites;
        let point = |site: u32| match sites[site as usize].kind {
            SiteKind::Point(p) => Some(p),
            SiteKind::Node(_) => None,
        };
        let broken = solved.moved.broken.iter();
        Self(
            broken
                .filter_map(|&(i, j)| point(i).zip(point(j)))
                .collect(),
        )
    }

    pub fn is_intact(&self, i: usize, j: usize) -> bool {
        self.0.is_empty() || !self.0.contains(&(i as u32, j as u32))
    }
}
