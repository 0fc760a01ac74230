//! Tests of the Cauchy–Born law of every material, by the bonds of a lattice that they lay out themselves.

use super::*;
use crate::peridynamics::{Family, collapsed_tensor, laws};

/// Spacing over which lengths are measured; nothing depends on it.
const H: f64 = 0.1;

/// All bonds of a lattice within 3.015 spacings, with the coefficients that a law gives them, and their collapsed tensor.
fn lattice<const D: usize>(law: &dyn Law<D>) -> (LatticeBonds<D>, Tensor4<D>) {
    let reach = 3i32;
    let side = 2 * reach + 1;
    let bonds: Vec<Vector<D>> = (0..side.pow(D as u32))
        .map(|n| Vector::from_fn(|a, _| f64::from(n / side.pow(a as u32) % side - reach) * H))
        .filter(|xi: &Vector<D>| xi.norm() > 0.0 && xi.norm() < 3.015 * H)
        .collect();
    let volumes = vec![H.powi(D as i32); bonds.len()];
    let factors = vec![1.0; bonds.len()];
    let family = Family {
        bonds: &bonds,
        volumes: &volumes,
        factors: &factors,
        horizon: 3.0 * H,
        bond_horizons: &[],
        materials: None,
    };
    let (mut pair, mut omega) = (vec![0.0; bonds.len()], vec![0.0; bonds.len()]);
    let state = (law.linearised())
        .coefficients(&family, &mut pair, &mut omega)
        .unwrap();
    let tensor = collapsed_tensor(&family, &pair, state.as_ref());
    let bonds = LatticeBonds {
        bonds,
        volumes,
        pair,
        omega,
        state,
    };
    (bonds, tensor)
}

/// The laws that have a Cauchy–Born law for a way to deform, each with its lattice.
fn all<const D: usize>(
    kinematics: BondKinematics,
) -> Vec<(Arc<dyn Law<D>>, LatticeBonds<D>, CauchyBorn<D>)> {
    let found: Vec<_> = laws::every::<D>()
        .into_iter()
        .filter(|law| law.several().is_none() && law.calibrate().is_none())
        .filter_map(|law| {
            law.force_state()?;
            let (bonds, tensor) = lattice(law.as_ref());
            let own = CauchyBorn::new(&law, 0, &bonds, tensor, kinematics)?;
            Some((law, bonds, own))
        })
        .collect();
    // bond-based of each micromodulus, lps, hardening, pals at least
    assert!(found.len() >= 4, "{D}D: {}", found.len());
    found
}

fn respond<const D: usize>(law: &CauchyBorn<D>, g: &Tensor<D>) -> LocalResponse<D> {
    law.respond(g, 0.0, &[], &mut [])
}

/// A stretch of 1.3 and other strains, rotated by 0.7.
fn large<const D: usize>() -> Tensor<D> {
    let mut stretch = Tensor::<D>::from_fn(|i, j| 0.04 * ((i * 2 + j * 3 + 1) as f64).sin());
    stretch += Tensor::identity();
    stretch[(0, 0)] = 1.3;
    rotation::<D>() * stretch - Tensor::identity()
}

fn rotation<const D: usize>() -> Tensor<D> {
    let mut q = Tensor::<D>::identity();
    if D > 1 {
        let (sin, cos) = 0.7f64.sin_cos();
        (q[(0, 0)], q[(1, 1)]) = (cos, cos);
        (q[(0, 1)], q[(1, 0)]) = (-sin, sin);
    }
    q
}

fn conforms<const D: usize>() {
    for kinematics in [BondKinematics::Exact, BondKinematics::Linear] {
        for (law, _, own) in all::<D>(kinematics) {
            let name = format!("{D}D {} {kinematics:?}", law.name());
            let scale = own.tangent.0.iter().flatten().map(|t| t.amax());
            let scale = scale.fold(0.0, f64::max);
            let at_rest = respond(&own, &Tensor::zeros());
            assert_eq!((at_rest.stress.amax(), at_rest.stored), (0.0, 0.0));
            // what is linear leaves the differences of it no error of their own
            let g = large::<D>();
            let stress = respond(&own, &g).stress;
            let step = 1e-5;
            for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
                let mut e = Tensor::<D>::zeros();
                e[(k, l)] = step;
                let energy = |g: Tensor<D>| respond(&own, &g).stored;
                let slope = (energy(g + e) - energy(g - e)) / (2.0 * step);
                let off = (slope - stress[(k, l)]).abs() / scale;
                assert!(off < 1e-9, "{name}: stress {k}{l} off by {off:e}");
                let by = e * 1e-2;
                let change = (respond(&own, &by).stress - respond(&own, &-by).stress) / 2e-2 / step;
                let tangent = Tensor::<D>::from_fn(|i, j| own.tangent.get(i, j, k, l));
                let off = (change - tangent).amax() / scale;
                assert!(off < 1e-9, "{name}: tangent {k}{l} off by {off:e}");
                let change = (respond(&own, &(g + e)).stress - respond(&own, &(g - e)).stress)
                    / (2.0 * step);
                let algorithmic = own.algorithmic_tangent(&g, 0.0, &[]);
                for (i, j) in (0..D).flat_map(|i| (0..D).map(move |j| (i, j))) {
                    let found = algorithmic.get(i, j, k, l);
                    let off = (change[(i, j)] - found).abs() / scale;
                    assert!(
                        off < 1e-6,
                        "{name}: tangent far from rest {i}{j}{k}{l} off by {off:e}"
                    );
                    let skew = (found - algorithmic.get(k, l, i, j)).abs() / scale;
                    assert!(skew < 1e-6, "{name}: not symmetric, {skew:e}");
                }
            }
            if kinematics == BondKinematics::Exact {
                let (f, q) = (Tensor::identity() + g, rotation::<D>());
                let turned = respond(&own, &(q * f - Tensor::identity()));
                let off = (turned.stress - q * stress).amax() / scale;
                assert!(off < 1e-14, "{name}: rotation {off:e}");
                let alone = respond(&own, &(q - Tensor::identity()));
                let off = alone.stress.amax() / scale;
                assert!(off < 1e-15, "{name}: rotation alone {off:e}");
                assert!(alone.stored / scale < 1e-30, "{name}");
                let kirchhoff = stress * f.transpose();
                let off = (kirchhoff - kirchhoff.transpose()).amax() / scale;
                assert!(off < 1e-15, "{name}: angular momentum {off:e}");
            }
        }
    }
}

#[test]
fn stress_energy_and_tangent_of_every_law_belong_together() {
    conforms::<1>();
    conforms::<2>();
    conforms::<3>();
}

fn is_accelerated<const D: usize>() {
    for (law, _, own) in all::<D>(BondKinematics::Exact) {
        if own.fast.is_none() {
            continue;
        }
        let slow = CauchyBorn {
            fast: None,
            ..own.clone()
        };
        for g in [large::<D>(), large::<D>() * 1e-7] {
            let (fast, slow) = (respond(&own, &g), respond(&slow, &g));
            let off = (fast.stress - slow.stress).amax() / slow.stress.amax();
            assert!(off < 1e-13, "{D}D {}: {off:e}", law.name());
            let off = (fast.stored / slow.stored - 1.0).abs();
            assert!(off < 1e-13, "{D}D {}: energy {off:e}", law.name());
        }
    }
}

#[test]
fn fast_sums_are_those_of_the_law() {
    is_accelerated::<1>();
    is_accelerated::<2>();
    is_accelerated::<3>();
}

/// By the printed equations, over all bonds and with lengths as they are: \[SAND2015-7998\] eq. (3.1) with a geometrically exact stretch, and (5.16)–(5.18).
fn printed<const D: usize>(
    bonds: &LatticeBonds<D>,
    (bulk, shear): (f64, f64),
    influence: impl Fn(f64) -> f64,
    f: &Tensor<D>,
) -> Tensor<D> {
    let d = D as f64;
    let (mut m, mut theta) = (0.0, 0.0);
    for (xi, volume) in bonds.bonds.iter().zip(&bonds.volumes) {
        let (r, now) = (xi.norm(), (f * xi).norm());
        m += influence(r) * r * r * volume;
        theta += influence(r) * r * (now - r) * volume;
    }
    theta *= d / m;
    let mut stress = Tensor::zeros();
    for (xi, volume) in bonds.bonds.iter().zip(&bonds.volumes) {
        let (r, y) = (xi.norm(), f * xi);
        let e = y.norm() - r;
        let t = (d * bulk - (d + 2.0) * shear) / m * influence(r) * r * theta
            + d * (d + 2.0) * shear / m * influence(r) * e;
        stress += y / y.norm() * xi.transpose() * (t * volume);
    }
    stress
}

#[test]
fn an_lps_has_the_stress_of_the_printed_equations() {
    use crate::peridynamics::{Influence, LinearPeridynamicSolid};
    fn check<const D: usize>() {
        let (lambda, shear) = (1.7, 0.9);
        let law = LinearPeridynamicSolid::<D>::new(Influence::Gaussian, lambda, shear);
        let law: Arc<dyn Law<D>> = Arc::new(law);
        let (bonds, tensor) = lattice(law.as_ref());
        let own = CauchyBorn::new(&law, 0, &bonds, tensor, BondKinematics::Exact).unwrap();
        let g = large::<D>();
        let bulk = lambda + 2.0 * shear / D as f64;
        let omega = |r: f64| Influence::Gaussian.value(r, 3.0 * H);
        let wanted = printed(&bonds, (bulk, shear), omega, &(Tensor::identity() + g));
        let off = (respond(&own, &g).stress - wanted).amax() / wanted.amax();
        assert!(off < 1e-13, "{D}D: {off:e}");
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn the_dilatation_of_an_lps_is_that_of_the_printed_equation_and_has_its_slope() {
    use crate::peridynamics::{Influence, LinearPeridynamicSolid};
    fn check<const D: usize>() {
        let law = LinearPeridynamicSolid::<D>::new(Influence::Gaussian, 1.7, 0.9);
        let law: Arc<dyn Law<D>> = Arc::new(law);
        let (bonds, tensor) = lattice(law.as_ref());
        let own = CauchyBorn::new(&law, 0, &bonds, tensor, BondKinematics::Exact).unwrap();
        let g = large::<D>();
        let f = Tensor::identity() + g;
        let (mut m, mut sum) = (0.0, 0.0);
        for (xi, volume) in bonds.bonds.iter().zip(&bonds.volumes) {
            let omega = Influence::Gaussian.value(xi.norm(), 3.0 * H);
            m += omega * xi.norm_squared() * volume;
            sum += omega * xi.norm() * ((f * xi).norm() - xi.norm()) * volume;
        }
        let (theta, slope) = own.dilatation(&g);
        assert!((theta - D as f64 / m * sum).abs() < 1e-13 * theta.abs());
        for (k, l) in (0..D).flat_map(|k| (0..D).map(move |l| (k, l))) {
            let mut e = Tensor::<D>::zeros();
            e[(k, l)] = 1e-5;
            let found = (own.dilatation(&(g + e)).0 - own.dilatation(&(g - e)).0) / 2e-5;
            assert!((found - slope[(k, l)]).abs() < 1e-9, "{D}D {k}{l}");
        }
        let turned = own.dilatation(&(rotation::<D>() - Tensor::identity()));
        assert!(turned.0.abs() < 1e-15, "{D}D: {:e}", turned.0);
        // at rest the trace
        let small = g * 1e-9;
        assert!((own.dilatation(&small).0 - small.trace()).abs() < 1e-16);
    }
    check::<1>();
    check::<2>();
    check::<3>();
}

#[test]
fn laws_that_remember_have_none() {
    let every = laws::every::<2>().into_iter();
    let memories = every.filter(|law| {
        let states = law.force_state();
        states.is_some_and(|states| !states.history().is_empty()) && law.calibrate().is_none()
    });
    let mut count = 0;
    for law in memories {
        let (bonds, tensor) = lattice(law.as_ref());
        assert!(CauchyBorn::new(&law, 0, &bonds, tensor, BondKinematics::Linear).is_none());
        count += 1;
    }
    assert!(count > 0);
}
