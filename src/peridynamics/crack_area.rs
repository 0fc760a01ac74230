//! Area of cracks from the bonds that they have broken.
//!
//! A plane cuts `|ξ·n|/V` bonds of the offset ξ per area, V the volume of a cell. The bonds between neighbours one step away along each axis are counted with weights that give planes along the axes and along all their diagonals
//! their area exactly; between these it is at most 8 % (2D) too large. Longer bonds are not counted: beside a crack that branches or roughens some of them break where nothing opens, which costs energy and makes no area.

use std::f64::consts::PI;

use crate::tensor::Vector;

/// Area of the crack that a broken bond stands for.
///
/// Source: the sampling of lines by a grid that Crofton's formula allows, weights fitted to the axes and diagonals. Units: \[m^(D−1)\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrackArea<const D: usize> {
    spacing: f64,
    /// By the number of axes along which a bond makes a step; of a lattice's bonds.
    weights: [f64; 4],
    /// Of each bond up to 1.5 spacings long, where points are no lattice.
    irregular: f64,
}

impl<const D: usize> CrackArea<D> {
    /// For points of a spacing and a horizon. A horizon shorter than the cell's diagonal leaves the bonds along the axes, which measure planes along these only.
    pub fn new(spacing: f64, horizon: f64) -> Self {
        let has_diagonals = horizon >= spacing * (D as f64).sqrt() * (1.0 - 1e-9);
        let face = spacing.powi(D as i32 - 1);
        // planes normal to the sums of one, two and three axes: 2D a + 2 b = 1, 2 a + 2 b = √2; 3D a + 4 b + 4 c = 1, 2 a + 6 b + 4 c = √2, 3 a + 6 b + 6 c = √3
        let weights = match (D, has_diagonals) {
            (2, true) => {
                let a = 2.0_f64.sqrt() - 1.0;
                [0.0, a, 0.5 * (1.0 - a), 0.0]
            }
            (3, true) => {
                let [one, two, three] = [1.0, 0.5_f64.sqrt(), (1.0_f64 / 3.0).sqrt()];
                let b = two - three;
                let c = 0.5 * (one - two - b);
                [0.0, one - 4.0 * (b + c), b, c]
            }
            _ => [0.0, 1.0, 0.0, 0.0],
        };
        // ½ ρ² κ ∫ r dV bonds per area, κ the mean of |cos|
        let (mean, sphere) = [(1.0, 2.0), (2.0 / PI, 2.0 * PI), (0.5, 4.0 * PI)][D - 1];
        let per_area = 0.5 * mean * sphere * 1.5_f64.powi(D as i32 + 1) / (D + 1) as f64;
        Self {
            spacing,
            weights: weights.map(|w| w * face),
            irregular: face / per_area,
        }
    }

    /// The area of a bond, both directions together.
    pub fn of(&self, xi: &Vector<D>) -> f64 {
        let steps = xi / self.spacing;
        let whole = steps.map(f64::round);
        if (steps - whole).amax() < 1e-6 {
            if whole.amax() > 1.5 {
                return 0.0;
            }
            return self.weights[whole.iter().filter(|k| **k != 0.0).count()];
        }
        if steps.norm() <= 1.5 {
            self.irregular
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The area that a plane with the normal `n` through a lattice of unit spacing gets, per true area: each offset is cut |ξ·n| times.
    fn measured<const D: usize>(area: &CrackArea<D>, n: Vector<D>) -> f64 {
        let n = n / n.norm();
        let mut sum = 0.0;
        for k in 0..7_usize.pow(D as u32) {
            let mut rest = k;
            let xi = Vector::<D>::from_fn(|_, _| {
                let step = (rest % 7) as f64 - 3.0;
                rest /= 7;
                step
            });
            sum += 0.5 * area.of(&xi) * xi.dot(&n).abs();
        }
        sum
    }

    #[test]
    fn planes_along_axes_and_diagonals_have_their_area() {
        let one = CrackArea::<1>::new(1.0, 3.0);
        assert!((measured(&one, Vector::<1>::new(1.0)) - 1.0).abs() < 1e-14);
        let two = CrackArea::<2>::new(1.0, 3.0);
        for n in [[1.0, 0.0], [0.0, -1.0], [1.0, 1.0], [1.0, -1.0]] {
            let m = measured(&two, Vector::<2>::from(n));
            assert!((m - 1.0).abs() < 1e-14, "{n:?} {m}");
        }
        let worst = (0..90).map(|degree| {
            let (s, c) = f64::from(degree).to_radians().sin_cos();
            measured(&two, Vector::<2>::new(c, s))
        });
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 1.083, "{worst}");
        let three = CrackArea::<3>::new(1.0, 3.0);
        for n in [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [1.0, -1.0, 1.0]] {
            let m = measured(&three, Vector::<3>::from(n));
            assert!((m - 1.0).abs() < 1e-14, "{n:?} {m}");
        }
        // a horizon of one spacing has no diagonals
        let short = CrackArea::<2>::new(1.0, 1.0);
        assert!((measured(&short, Vector::<2>::new(0.0, 1.0)) - 1.0).abs() < 1e-14);
    }
}
