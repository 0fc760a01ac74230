//! Families that end on the faces of elements, and what lies behind these.

use super::PdBody;

/// Families that end at *feet*, places on the faces of elements, which are the last points of the cloud.
///
/// Feet stand for what the body has behind a face: their volumes, times weights, are parts of sums, but no part of the body.
#[derive(Clone, Debug)]
pub(crate) struct FamilyEnds {
    /// The first foot.
    pub feet: u32,
    /// For each point before the feet the volume of its whole family, the point itself included, in a body of points alone \[m^D\].
    pub whole: Vec<f64>,
    /// For each point before the feet the volume of what its family has behind faces \[m^D\].
    pub behind: Vec<f64>,
}

impl<const D: usize> PdBody<D> {
    /// Says where families end.
    pub(crate) fn set_ends(&mut self, ends: FamilyEnds) {
        self.ends = Some(ends);
    }

    /// Returns true if point `i` of the cloud is a foot.
    pub(crate) fn is_foot(&self, i: usize) -> bool {
        self.ends.as_ref().is_some_and(|e| i >= e.feet as usize)
    }

    /// The volume of the whole family of point `i`, the point itself included, by this `volume` of each.
    pub(crate) fn volume_of_family(&self, i: usize, volume: &[f64]) -> f64 {
        match self.ends.as_ref().and_then(|e| e.whole.get(i)) {
            Some(whole) => *whole,
            None => {
                let far = self.families.of(i).iter();
                volume[i] + far.map(|j| volume[*j as usize]).sum::<f64>()
            }
        }
    }

    /// The volume of what the family of point `i` has behind the faces at which it ends.
    pub(crate) fn volume_behind(&self, i: usize) -> f64 {
        let behind = self.ends.as_ref().and_then(|e| e.behind.get(i));
        behind.copied().unwrap_or(0.0)
    }
}
