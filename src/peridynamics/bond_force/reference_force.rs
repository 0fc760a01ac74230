//! For tests: clouds with cuts and ghosts, and textbook formulas in a plain double loop.

use super::*;
use crate::{
    peridynamics::{Families, TIE_TOLERANCE},
    tensor::Vector,
};

/// Reproducible numbers in [-1, 1).
pub(super) fn random(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

pub(super) fn noise(n: usize, scale: f64, seed: u64) -> Vec<f64> {
    let mut state = seed;
    (0..n).map(|_| scale * random(&mut state)).collect()
}

/// A cloud with families, some bonds cut, some points without a row, some of those without a family.
pub(super) struct Case<const D: usize> {
    pub(super) position: Vec<Vector<D>>,
    pub(super) volume: Vec<f64>,
    pub(super) families: Families,
    pub(super) rows: Vec<bool>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Law {
    Pmb,
    Solid,
}

pub(super) const H: f64 = 0.1;
pub(super) const BULK: f64 = 3.0;
pub(super) const SHEAR: f64 = 1.3;

pub(super) fn coefficient<const D: usize>(_: usize, _: usize, xi: &Vector<D>) -> f64 {
    1.0 / xi.norm()
}

pub(super) fn omega<const D: usize>(_: usize, _: usize, xi: &Vector<D>) -> f64 {
    1.0 - 0.5 * xi.norm() / (3.0 * H)
}

/// A lattice with a hole, a cut and halved volumes at its lower sides; `jitter` in spacings moves the points.
pub(super) fn case<const D: usize>(counts: [usize; D], jitter: f64, ghosts: bool) -> Case<D> {
    let n: usize = counts.iter().product();
    let (mut position, mut volume) = (Vec::new(), Vec::new());
    let mut state = 17;
    for k in 0..n {
        let mut rest = k;
        let index: [usize; D] = std::array::from_fn(|a| {
            let i = rest % counts[a];
            rest /= counts[a];
            i
        });
        if D > 1 && index.iter().all(|&i| i == 4) {
            continue;
        }
        position.push(Vector::<D>::from_fn(|a, _| {
            0.37 + H * (index[a] as f64 + jitter * random(&mut state))
        }));
        volume.push(
            H.powi(D as i32)
                * index
                    .iter()
                    .map(|&i| if i == 0 { 0.5 } else { 1.0 })
                    .product::<f64>(),
        );
    }
    let points = position.len();
    let mut families = Families::search(&position, &vec![3.0 * H; points], TIE_TOLERANCE).unwrap();
    let side = |i: usize| position[i][D - 1] > 0.37 + 2.5 * H && position[i][0] < 0.37 + 2.6 * H;
    families.retain(|i, j| side(i) == side(j as usize));
    let mut rows = vec![true; points];
    if ghosts {
        let far = |i: usize| position[i][0] > 0.37 + H * (counts[0] as f64 - 6.5);
        let farther = |i: usize| position[i][0] > 0.37 + H * (counts[0] as f64 - 3.5);
        rows = (0..points).map(|i| !far(i)).collect();
        // those beyond have no family, and nobody with a row sees them but through dilatations
        families.retain(|i, _| !farther(i));
    }
    Case {
        position,
        volume,
        families,
        rows,
    }
}

pub(super) fn with<const D: usize, T>(
    case: &Case<D>,
    law: Law,
    kinematics: BondKinematics,
    failure: Option<Failure<'_, D>>,
    layout: Layout,
    run: impl FnOnce(Box<dyn BondPass<D>>) -> T,
) -> T {
    let setup = BondSetup {
        position: &case.position,
        volume: &case.volume,
        families: &case.families,
        rows: &case.rows,
        without_energy: &[],
        force: match law {
            Law::Pmb => BondForce::Pairwise {
                coefficient: &coefficient,
            },
            Law::Solid => BondForce::Solid {
                omega: &omega,
                bulk: BULK,
                shear: SHEAR,
            },
        },
        kinematics,
        failure,
        precracked: None,
        layout,
        storage: Storage::Double,
        shared: None,
    };
    run(bond_pass(&setup).unwrap())
}

/// Textbook formulas in a double loop; `intact(i, j)` is true for the bonds of the families that count.
pub(super) fn naive<const D: usize>(
    case: &Case<D>,
    law: Law,
    kinematics: BondKinematics,
    u: &[f64],
    intact: &dyn Fn(usize, usize) -> bool,
) -> (Vec<f64>, f64) {
    let left = |i: usize, j: usize| [f64::from(u8::from(intact(i, j))); 2];
    naive_of_parts(case, law, kinematics, u, &left)
}

/// The same where bonds have the parts `left(i, j)` of their stiffness, of the pair force and of the dilatation.
pub(super) fn naive_of_parts<const D: usize>(
    case: &Case<D>,
    law: Law,
    kinematics: BondKinematics,
    u: &[f64],
    left: &dyn Fn(usize, usize) -> [f64; 2],
) -> (Vec<f64>, f64) {
    let points = case.position.len();
    let d = D as f64;
    let at = |i: usize| Vector::<D>::from_fn(|a, _| u[i * D + a]);
    let geometry = |i: usize, j: usize| {
        let xi = case.position[j] - case.position[i];
        let eta = at(j) - at(i);
        match kinematics {
            BondKinematics::Exact => {
                let y = xi + eta;
                (xi, y.norm() - xi.norm(), y / y.norm())
            }
            BondKinematics::Linear => (xi, xi.dot(&eta) / xi.norm(), xi / xi.norm()),
        }
    };
    let (mut m, mut theta) = (vec![0.0; points], vec![0.0; points]);
    for i in 0..points {
        for &j in case.families.of(i) {
            let j = j as usize;
            let (xi, e, _) = geometry(i, j);
            let w = omega(i, 0, &xi) * case.volume[j];
            m[i] += w * xi.norm_squared();
            theta[i] += left(i, j)[1] * w * xi.norm() * e;
        }
        if m[i] > 0.0 {
            theta[i] *= d / m[i];
        }
    }
    let state = |i: usize, j: usize| {
        let (xi, e, _) = geometry(i, j);
        let [pair, of_state] = left(i, j);
        match law {
            Law::Pmb => pair * coefficient(i, 0, &xi) * xi.norm_squared() * e,
            Law::Solid if m[i] == 0.0 => 0.0,
            Law::Solid => {
                omega(i, 0, &xi) / m[i]
                    * (of_state * (d * BULK - (d + 2.0) * SHEAR) * theta[i] * xi.norm()
                        + pair * d * (d + 2.0) * SHEAR * e)
            }
        }
    };
    let (mut force, mut energy) = (vec![0.0; points * D], 0.0);
    for i in (0..points).filter(|&i| case.rows[i]) {
        for &j in case.families.of(i) {
            let j = j as usize;
            let (xi, e, direction) = geometry(i, j);
            let vv = case.volume[i] * case.volume[j];
            let f = direction * ((state(i, j) + state(j, i)) * vv);
            for a in 0..D {
                force[i * D + a] -= f[a];
            }
            energy += left(i, j)[0]
                * match law {
                    Law::Pmb => 0.5 * coefficient(i, 0, &xi) * xi.norm_squared() * e * e * vv,
                    Law::Solid => {
                        0.5 * d * (d + 2.0) * SHEAR / m[i] * omega(i, 0, &xi) * e * e * vv
                    }
                };
        }
        if law == Law::Solid {
            energy += 0.5 * (BULK - (d + 2.0) / d * SHEAR) * theta[i] * theta[i] * case.volume[i];
        }
    }
    (force, energy)
}

pub(super) fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

pub(super) fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()))
}

/// The forces at the displacement `u` add up to zero; of exact bonds so do their moments about the deformed places.
pub(super) fn balances<const D: usize>(
    case: &Case<D>,
    u: &[f64],
    force: &[f64],
    kinematics: BondKinematics,
    name: &str,
) {
    let n = force.len();
    let scale = largest(force) * n as f64;
    for a in 0..D {
        let total: f64 = force.iter().skip(a).step_by(D).sum();
        assert!(total.abs() < 1e-15 * scale, "{name}: momentum {total:e}");
        for b in (0..a).filter(|_| kinematics == BondKinematics::Exact) {
            let y = |i: usize, a: usize| case.position[i][a] + u[i * D + a];
            let moment: f64 = (0..n / D)
                .map(|i| y(i, a) * force[i * D + b] - y(i, b) * force[i * D + a])
                .sum();
            assert!(moment.abs() < 1e-14 * scale, "{name}: moment {moment:e}");
        }
    }
}

/// Row sums bound the rows of the tangent, and not by far; `n` unknowns.
pub(super) fn row_sums_bound_rows<const D: usize>(pass: &dyn BondPass<D>, n: usize, name: &str) {
    let sums = pass.row_sums();
    let (mut unit, mut column) = (vec![0.0; n], vec![0.0; n]);
    let rows = [0, n / 2, n - 1];
    let mut found = [0.0; 3];
    for c in 0..n {
        unit[c] = 1.0;
        pass.tangent_into(&unit, &mut column);
        unit[c] = 0.0;
        for (found, &row) in found.iter_mut().zip(&rows) {
            *found += column[row].abs();
        }
    }
    for (sum, row) in found.into_iter().zip(rows) {
        assert!(
            sum <= sums[row] * (1.0 + 1e-12) && sum > 0.2 * sums[row],
            "{name}: row sums {sum} {}",
            sums[row]
        );
    }
}
