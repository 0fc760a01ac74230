//! The axes of a lattice, found from its points: centroids of square cells may be those of a lattice that is rotated.

use crate::tensor::{Tensor, Vector};

/// Tolerance on the offset of a point from its place in the lattice, in spacings, and on the relative difference of its volume from that of a cell.
const OFF: f64 = 1e-6;

/// The axes of the square or cubic lattice of spacing `h` that all points are some of, as columns; none if they are scattered, or their volumes differ.
///
/// The axes are those of the coordinates where these serve. Else the first axis is the direction to the nearest neighbour of the first point, corrected by the
/// farthest point, so that files with six digits do.
pub(crate) fn lattice_axes<const D: usize>(
    position: &[Vector<D>],
    volume: &[f64],
    h: f64,
) -> Option<Tensor<D>> {
    let (first, rest) = position.split_first()?;
    let cell = h.powi(D as i32);
    if !volume.iter().all(|v| (v / cell - 1.0).abs() < OFF) {
        return None;
    }
    let serves = |axes: &Tensor<D>| {
        rest.iter().all(|x| {
            let k = axes.tr_mul(&(x - first)) / h;
            k.iter().all(|k| (k - k.round()).abs() < OFF)
        })
    };
    let upright = Tensor::identity();
    if serves(&upright) {
        return Some(upright);
    }
    if D == 1 {
        return None;
    }
    let nearest = |wanted: &dyn Fn(&Vector<D>) -> bool| -> Option<Vector<D>> {
        let bonds = rest.iter().map(|x| x - first);
        let length = |xi: &Vector<D>| xi.norm();
        let found = bonds.filter(|xi| (length(xi) / h - 1.0).abs() < 1e-3 && wanted(xi));
        found
            .min_by(|a, b| length(a).total_cmp(&length(b)))
            .map(|xi| xi.normalize())
    };
    let mut axes = Tensor::<D>::zeros();
    let one = nearest(&|_| true)?;
    axes.set_column(0, &one);
    if D == 2 {
        axes.set_column(1, &Vector::from_fn(|i, _| [-one[1], one[0]][i]));
    } else {
        let two = nearest(&|xi| xi.dot(&one).abs() < 1e-3 * h)?;
        let two = (two - one * one.dot(&two)).normalize();
        let three = |i: usize| {
            let (a, b) = ((i + 1) % 3, (i + 2) % 3);
            one[a] * two[b] - one[b] * two[a]
        };
        axes.set_column(1, &two);
        axes.set_column(2, &Vector::from_fn(|i, _| three(i)));
    }
    let farthest = rest
        .iter()
        .map(|x| x - first)
        .max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
    let wanted = axes.tr_mul(&farthest).map(|k| (k / h).round());
    let axes = aligning(&(axes * wanted).normalize(), &farthest.normalize()) * axes;
    serves(&axes).then_some(axes)
}

/// The smallest rotation that turns the unit vector `a` into `b`, which is near to it.
///
/// `R = 1 + W + W²/(1 + a·b)` with `W = b aᵀ − a bᵀ` in the plane of both.
fn aligning<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> Tensor<D> {
    let w = b * a.transpose() - a * b.transpose();
    Tensor::identity() + w + w * w / (1.0 + a.dot(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rotation(degrees: f64) -> Tensor<2> {
        let (s, c) = degrees.to_radians().sin_cos();
        Tensor::<2>::new(c, -s, s, c)
    }

    /// Points of a plane lattice, with coordinates rounded to so many digits.
    fn points(axes: &Tensor<2>, h: f64, digits: i32) -> Vec<Vector<2>> {
        let unit = 10f64.powi(-digits);
        let at = |k: usize| Vector::<2>::new((k % 31) as f64 + 0.5, (k / 31) as f64 + 0.5);
        (0..31 * 17)
            .map(|k| (axes * at(k) * h).map(|x| (x / unit).round() * unit))
            .collect()
    }

    #[test]
    fn axes_of_a_rotated_lattice_are_found() {
        let h = 0.05;
        for degrees in [0.0, 30.0, 45.0, -17.3] {
            for digits in [15, 8] {
                let axes = rotation(degrees);
                let x = points(&axes, h, digits);
                let found = lattice_axes(&x, &vec![h * h; x.len()], h).expect("a lattice");
                // any of the four quarter turns
                let turned = found.transpose() * axes;
                let whole = turned.map(|t| (t - t.round()).abs()).max();
                assert!(whole < 1e-6, "{degrees}: {found}");
                assert_eq!(found == Tensor::<2>::identity(), degrees == 0.0);
            }
        }
        let rotated = aligning(&Vector::<3>::x(), &Vector::<3>::new(0.6, 0.0, 0.8));
        let right = rotated * rotated.transpose() - Tensor::<3>::identity();
        assert!(right.amax() < 1e-15 && (rotated * Vector::<3>::x())[2] == 0.8);
    }

    #[test]
    fn a_rotated_lattice_in_space_and_scattered_points_are_told_apart() {
        let axes = aligning(&Vector::<3>::z(), &Vector::<3>::new(0.48, 0.6, 0.64));
        let mut x: Vec<Vector<3>> = (0..125)
            .map(|k| axes * Vector::<3>::new((k % 5) as f64, (k / 5 % 5) as f64, (k / 25) as f64))
            .collect();
        let volume = vec![1.0; x.len()];
        assert!(lattice_axes(&x, &volume, 1.0).is_some());
        x[63][1] += 1e-4;
        assert!(lattice_axes(&x, &volume, 1.0).is_none());
        let mut uneven = volume;
        uneven[7] = 1.01;
        x[63][1] -= 1e-4;
        assert!(lattice_axes(&x, &uneven, 1.0).is_none());
    }
}
