//! Exact areas in 2D: a disc about the origin and a rectangle along the axes.

/// Area of the disc's part in `[0, a] × [0, b]`, odd in `a` and in `b`.
fn quadrant(a: f64, b: f64, radius: f64) -> f64 {
    let sign = a.signum() * b.signum();
    let (a, b) = (a.abs().min(radius), b.abs().min(radius));
    if a * a + b * b <= radius * radius {
        return sign * a * b;
    }
    // the rectangle's corner lies outside: two triangles and the sector between them
    let chord = |c: f64| ((radius - c) * (radius + c)).sqrt();
    let (at, bt) = (chord(a), chord(b));
    let sector = radius * radius * (a.atan2(at) - bt.atan2(b));
    sign * 0.5 * (sector + a * at + b * bt)
}

/// Area of the disc's part in a rectangle, `[low[0], high[0]] × [low[1], high[1]]`.
///
/// Source: elementary; in the place of the case table of [Seleson2014], which [SAND2015-7998] section 5.4 calls PA-AC.
pub(super) fn rectangle(low: [f64; 2], high: [f64; 2], radius: f64) -> f64 {
    let strip = |y: f64| quadrant(high[0], y, radius) - quadrant(low[0], y, radius);
    (strip(high[1]) - strip(low[1])).max(0.0)
}
