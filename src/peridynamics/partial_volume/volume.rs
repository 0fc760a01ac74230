//! Exact volumes in 3D: a ball about the origin and a box along the axes.
//!
//! A box is eight corner boxes `[0, a] × [0, b] × [0, c]` with signs, and a corner box whose far corner lies outside the ball is an octant less
//! three caps plus the three wedges in which two caps overlap. So the only integral is that of a wedge,
//!
//! ```text
//! ∫∫_{x ≥ a, y ≥ b} √(R² − x² − y²) dy dx = ½ [ ⅔R³ atan2(Rw, ab) − (R²a − a³/3) atan2(w, b) − (R²b − b³/3) atan2(w, a) + ⅔ abw ],
//! w = √(R² − a² − b²).
//! ```

use std::f64::consts::PI;

/// Volume of the ball's part with `x ≥ a, y ≥ b, z ≥ 0`, for `a, b ≥ 0`.
fn wedge(a: f64, b: f64, radius: f64) -> f64 {
    let square = radius * radius;
    let w = square - a * a - b * b;
    if w <= 0.0 {
        return 0.0;
    }
    let w = w.sqrt();
    let part = |c: f64| c * (square - c * c / 3.0);
    0.5 * (2.0 / 3.0 * square * radius * (radius * w).atan2(a * b)
        - part(a) * w.atan2(b)
        - part(b) * w.atan2(a)
        + 2.0 / 3.0 * a * b * w)
}

/// Volume of the ball's part with `x ≥ a, y ≥ 0, z ≥ 0`, for `0 ≤ a ≤ R`: a quarter of a cap.
fn quarter_cap(a: f64, radius: f64) -> f64 {
    PI / 12.0 * (radius - a).powi(2) * (2.0 * radius + a)
}

/// Volume of the ball's part in `[0, a] × [0, b] × [0, c]`, odd in each.
fn octant(a: f64, b: f64, c: f64, radius: f64) -> f64 {
    let sign = a.signum() * b.signum() * c.signum();
    let [a, b, c] = [a, b, c].map(|e| e.abs().min(radius));
    if a * a + b * b + c * c <= radius * radius {
        return sign * a * b * c;
    }
    let caps = quarter_cap(a, radius) + quarter_cap(b, radius) + quarter_cap(c, radius);
    let wedges = wedge(a, b, radius) + wedge(b, c, radius) + wedge(c, a, radius);
    sign * (PI / 6.0 * radius.powi(3) - caps + wedges)
}

/// Volume of the ball's part in a box.
pub(super) fn cuboid(low: [f64; 3], high: [f64; 3], radius: f64) -> f64 {
    let column = |y: f64, z: f64| octant(high[0], y, z, radius) - octant(low[0], y, z, radius);
    let slab = |z: f64| column(high[1], z) - column(low[1], z);
    (slab(high[2]) - slab(low[2])).max(0.0)
}
