//! Recursive subdivision and sampling, the numerical calculation (PV-NC) of the report.

use bondline::{peridynamics::BoxCell, tensor::Vector};

/// Levels of subdivision in [SAND2015-7998] section 5.5.
pub const SAND_LEVELS: u32 = 6;
/// Samples along each edge of a last subcube there: 64 in a cube, so that six levels amount to 256 along each edge of the cell.
pub const SAND_SAMPLES_PER_EDGE: u32 = 4;

/// Measure of a box's intersection with a ball by recursive subdivision and sampling.
///
/// A box is halved along every axis, `levels` times. A part that lies wholly inside or outside is settled at once; a part of the last level that does
/// not is sampled at the middles of `samples_per_edge^D` equal parts.
///
/// Source: [SAND2015-7998] section 5.5, [`SAND_LEVELS`] and [`SAND_SAMPLES_PER_EDGE`]. Differs from it by: the text does not say where the samples lie.
/// Units: \[m\] → [m^D].
pub fn subdivide_and_sample<const D: usize>(
    cell: &BoxCell<D>,
    centre: &Vector<D>,
    radius: f64,
    levels: u32,
    samples_per_edge: u32,
) -> f64 {
    let (low, high) = cell.corners();
    part(
        &(low - centre),
        &(high - low),
        radius * radius,
        levels,
        samples_per_edge,
    )
}

fn part<const D: usize>(
    low: &Vector<D>,
    edges: &Vector<D>,
    square: f64,
    levels: u32,
    samples: u32,
) -> f64 {
    let (mut nearest, mut farthest) = (0.0, 0.0);
    for a in 0..D {
        let (l, h) = (low[a], low[a] + edges[a]);
        nearest += l.max(-h).max(0.0).powi(2);
        farthest += h.max(-l).powi(2);
    }
    if farthest <= square {
        return edges.product();
    }
    if nearest >= square {
        return 0.0;
    }
    if levels > 0 {
        let half = edges * 0.5;
        return (0..1u32 << D)
            .map(|corner| {
                let shift = Vector::<D>::from_fn(|a, _| f64::from((corner >> a) & 1) * half[a]);
                part(&(low + shift), &half, square, levels - 1, samples)
            })
            .sum();
    }
    let step = edges / f64::from(samples);
    let inside = (0..samples.pow(D as u32))
        .filter(|&s| {
            let distance: f64 = (0..D)
                .map(|a| {
                    let k = s / samples.pow(a as u32) % samples;
                    (low[a] + (f64::from(k) + 0.5) * step[a]).powi(2)
                })
                .sum();
            distance <= square
        })
        .count();
    step.product() * inside as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampling_approaches_the_closed_form() {
        let cell = BoxCell::new(
            Vector::<3>::new(0.2, 0.3, 0.4),
            Vector::<3>::new(0.7, 0.9, 0.8),
        )
        .unwrap();
        let exact = cell.ball_measure(&Vector::zeros(), 0.9);
        let error = |levels| {
            let sampled =
                subdivide_and_sample(&cell, &Vector::zeros(), 0.9, levels, SAND_SAMPLES_PER_EDGE);
            (sampled / exact - 1.0).abs()
        };
        assert!(error(1) > error(5));
        let six = error(SAND_LEVELS);
        assert!(six < 1e-4 && six > 1e-12, "{six:e}");
        // no level at all is plain sampling: 64 points
        let whole = subdivide_and_sample(&cell, &Vector::zeros(), 0.9, 0, SAND_SAMPLES_PER_EDGE);
        assert!(((whole / cell.measure() * 64.0).fract()).abs() < 1e-9);
    }
}
