//! The end of load steps in which a body parts.

use crate::solve::quasi_static::LoadStep;

/// Part of the largest stored energy below which a body has parted. The energy of a cantilever whose crack grows hardly falls; that of one piece that hangs on by single bonds is below.
const PARTED: f64 = 1e-3;

/// Returns true if displacements alone load the body, bonds have broken, and hardly any energy is stored at displacements that are no smaller than those of the largest. Keeps that energy \[J\], with the norm of the
/// prescribed displacements \[m\].
pub(super) fn has_parted(
    seen: &LoadStep<'_>,
    prescribed: &[u32],
    largest: &mut (f64, f64),
) -> bool {
    let of = |k: &u32| seen.state.u[*k as usize].powi(2);
    let moved = prescribed.iter().map(of).sum::<f64>().sqrt();
    let stored = seen.system.stored_energy(&seen.state.u);
    if stored >= largest.0 {
        *largest = (stored, moved);
    }
    let is_loaded = seen.load.iter().any(|f| *f != 0.0);
    let has_none = stored < PARTED * largest.0 && moved >= largest.1;
    has_none && !is_loaded && seen.state.broken > 0
}
