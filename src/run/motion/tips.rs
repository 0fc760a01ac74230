//! Position of a crack tip.

use crate::scene::validated::Tip;
use crate::tensor::Vector;

/// The damaged site that lies farthest along the direction of a tip; of several, the first.
pub(super) fn farthest<const D: usize>(
    tip: &Tip<D>,
    damage: &[f64],
    positions: impl Fn(usize) -> Vector<D>,
) -> Option<usize> {
    let mut best: Option<(f64, usize)> = None;
    for (site, _) in damage
        .iter()
        .enumerate()
        .filter(|(_, d)| **d >= tip.threshold)
    {
        let x = positions(site);
        let reach = tip.direction.dot(&x);
        if best.is_none_or(|(b, _)| reach > b) && tip.inside.contains(&x, 0.0) {
            best = Some((reach, site));
        }
    }
    best.map(|(_, site)| site)
}
