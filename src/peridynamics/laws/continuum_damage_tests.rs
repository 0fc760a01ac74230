//! Damage of one family along paths of strain, against closed forms and quadratures that do not use the law.

use super::*;
use crate::peridynamics::{Family, Influence};
use crate::tensor::Tensor;

/// Young's modulus and horizon of a solid on a lattice of the spacing 1.
const YOUNG: f64 = 2.7;
const HORIZON: f64 = 2.3;
const ONSET: f64 = 0.01;
const ETA: f64 = 10.0;

/// A complete family whose coefficients are scaled so that it stores the elastic energy of a dilatation.
struct Point {
    law: Arc<dyn Law<3>>,
    bonds: Vec<Vector<3>>,
    volumes: Vec<f64>,
    pair: Vec<f64>,
    omega: Vec<f64>,
    history: Vec<f64>,
    dissipated: f64,
}

/// Response of a family.
struct Answer {
    force: Vec<Vector<3>>,
    stored: f64,
    dissipated: f64,
}

impl Point {
    fn new(weakness: f64, eta: f64) -> Self {
        let constants = Constants {
            lambda: 0.4 * YOUNG,
            shear: 0.4 * YOUNG,
            influence: Influence::Gaussian,
            micromodulus: crate::peridynamics::Micromodulus::InverseDistance,
            kinematics: Kinematics::Solid,
            density: 1.0,
            is_heated: false,
        };
        // the normal of the weak planes is x
        let values = [ONSET, eta, weakness, 0.0, 0.0];
        let law = <ContinuumDamage<3> as NamedLaw<3>>::build(constants, &values);
        let mut bonds = Vec::new();
        for i in -2..=2 {
            for j in -2..=2 {
                for k in -2..=2 {
                    let xi = Vector::<3>::new(f64::from(i), f64::from(j), f64::from(k));
                    if xi.norm() > 0.0 && xi.norm() <= HORIZON {
                        bonds.push(xi);
                    }
                }
            }
        }
        // volumes that differ, as beside a surface
        let volumes: Vec<f64> = (0..bonds.len()).map(|k| 1.0 - 0.003 * k as f64).collect();
        let mut pair = vec![0.0; bonds.len()];
        let family = Family {
            bonds: &bonds,
            volumes: &volumes,
            factors: &vec![1.0; bonds.len()],
            horizon: HORIZON,
            bond_horizons: &[],
            materials: None,
        };
        law.linearised()
            .coefficients(&family, &mut pair, &mut [])
            .unwrap();
        // ½ Σ p |ξ|⁴ V (θ/3)² = ½ K θ² with K = 2 E/3
        let sum: f64 = (0..bonds.len())
            .map(|k| pair[k] * bonds[k].norm().powi(4) * volumes[k])
            .sum();
        pair.iter_mut().for_each(|p| *p *= 6.0 * YOUNG / sum);
        let kept = law.force_state().unwrap().history().bond.len();
        Self {
            history: vec![0.0; kept * bonds.len()],
            omega: Vec::new(),
            law,
            bonds,
            volumes,
            pair,
            dissipated: 0.0,
        }
    }

    /// Bond lengths under `ξ ↦ (1 + G) ξ`: extensions and directions, exact or linear in G.
    fn stretched(&self, g: &Tensor<3>, exact: bool) -> (Vec<f64>, Vec<Vector<3>>) {
        let each = self.bonds.iter().map(|xi| {
            let (r, y) = (xi.norm(), xi + g * xi);
            match exact {
                true => (y.norm() - r, y / y.norm()),
                false => (xi.dot(&(g * xi)) / r, xi / r),
            }
        });
        each.unzip()
    }

    fn respond(&self, g: &Tensor<3>, exact: bool, keeps_damage: bool) -> (Answer, Vec<f64>) {
        let (extension, direction) = self.stretched(g, exact);
        let difference: Vec<Vector<3>> = self.bonds.iter().map(|xi| g * xi).collect();
        let family = DeformedFamily {
            bonds: &self.bonds,
            volumes: &self.volumes,
            pair: &self.pair,
            omega: &self.omega,
            state: None,
            difference: &difference,
            extension: &extension,
            direction: &direction,
            keeps_damage,
            is_whole: true,
            damage: 0.0,
            carried: None,
            material: 0,
            kinematics: crate::peridynamics::bond_force::BondKinematics::Exact,
        };
        let mut present = vec![f64::NAN; self.history.len()];
        let mut force = vec![Vector::zeros(); self.bonds.len()];
        let past = Past {
            point: &[],
            bonds: &self.history,
        };
        let out = Present {
            point: &mut [],
            bonds: &mut present,
            principal_stress: None,
        };
        let states = self.law.force_state().unwrap();
        let energy = states.respond(&family, 0.3, past, out, &mut force);
        assert!(energy.dissipated >= 0.0 && energy.stored >= 0.0);
        let answer = Answer {
            force,
            stored: energy.stored,
            dissipated: energy.dissipated,
        };
        (answer, present)
    }

    /// Takes a step to G.
    fn step(&mut self, g: &Tensor<3>, exact: bool) -> Answer {
        let (answer, present) = self.respond(g, exact, false);
        self.history = present;
        self.dissipated += answer.dissipated;
        answer
    }

    /// Damage of each bond.
    fn damage(&self) -> Vec<f64> {
        let kept = self.history.len() / self.bonds.len();
        self.history.iter().step_by(kept).copied().collect()
    }

    /// `P : H = Σ T·(H ξ) V`, the stress that works along a path of direction H.
    fn stress_along(&self, force: &[Vector<3>], h: &Tensor<3>) -> f64 {
        let each = force.iter().zip(&self.bonds).zip(&self.volumes);
        each.map(|((t, xi), v)| t.dot(&(h * xi)) * v).sum()
    }

    /// Energy of the undamaged family, bond by bond.
    fn elastic(&self, g: &Tensor<3>, exact: bool) -> f64 {
        let (extension, _) = self.stretched(g, exact);
        (0..self.bonds.len())
            .map(|k| {
                0.5 * self.pair[k] * (self.bonds[k].norm() * extension[k]).powi(2) * self.volumes[k]
            })
            .sum()
    }
}

/// Damage that the largest energy so far has left: [SAND2015-7998] eq. (6.23) with S = 0 and μ = τ uniform.
fn damage_of(energy: f64) -> f64 {
    let onset = YOUNG * ONSET * ONSET / 3.0;
    ((energy / onset - 1.0) / ETA).clamp(0.0, 1.0)
}

fn near(found: f64, expected: f64, within: f64, what: &str) {
    let off = (found - expected).abs();
    assert!(
        off <= within * expected.abs().max(1e-300),
        "{what}: {found:e} {expected:e}"
    );
}

fn diagonal(x: f64, y: f64, z: f64) -> Tensor<3> {
    Tensor::<3>::new(x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
}

fn shear() -> Tensor<3> {
    Tensor::<3>::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
}

#[test]
fn onset_peak_and_end_of_proportional_paths_are_those_of_their_closed_form() {
    let paths = [
        ("uniaxial tension", diagonal(1.0, 0.0, 0.0)),
        ("uniaxial compression", diagonal(-1.0, 0.0, 0.0)),
        ("equibiaxial", diagonal(1.0, 1.0, 0.0)),
        ("simple shear", shear()),
        ("volumetric", diagonal(1.0, 1.0, 1.0)),
    ];
    for (name, h) in paths {
        let fresh = Point::new(1.0, ETA);
        let energy = fresh.elastic(&h, false);
        // W₀ = energy a², φ = (a²/b² − 1)/η
        let b = (YOUNG * ONSET * ONSET / 3.0 / energy).sqrt();
        if name == "volumetric" {
            near(3.0 * b, ONSET, 1e-12, "dilatation at the onset");
        }
        let (peak, end) = (b * ((1.0 + ETA) / 3.0).sqrt(), b * (1.0 + ETA).sqrt());
        let stress = |a: f64| 2.0 * energy * a * (1.0 - damage_of(energy * a * a));
        for steps in [1, 7] {
            let mut point = Point::new(1.0, ETA);
            let mut last = 0.0;
            let marks = [
                0.999 * b,
                b,
                1.001 * b,
                peak,
                0.5 * (peak + end),
                end,
                1.3 * end,
            ];
            for a in marks {
                let mut answer = None;
                for k in 1..=steps {
                    let at = last + (a - last) * f64::from(k) / f64::from(steps);
                    answer = Some(point.step(&(h * at), false));
                }
                last = a;
                let answer = answer.unwrap();
                let damage = point.damage();
                assert!(damage.iter().all(|d| *d == damage[0]), "{name}");
                let expected = damage_of(energy * a * a);
                assert!(
                    (damage[0] - expected).abs() < 1e-12,
                    "{name} {a}: {} {expected}",
                    damage[0]
                );
                let found = point.stress_along(&answer.force, &h);
                let scale = 2.0 * energy * b;
                assert!(
                    (found - stress(a)).abs() < 1e-10 * scale,
                    "{name} {a}: {found:e} {:e}",
                    stress(a)
                );
            }
            // the peak is one
            assert!(stress(0.999 * peak) < stress(peak) && stress(1.001 * peak) < stress(peak));
            near(
                stress(peak),
                4.0 / 3.0 * energy * peak * (1.0 + ETA) / ETA,
                1e-12,
                name,
            );
            assert_eq!(point.damage()[0], 1.0);
            near(
                point.dissipated,
                YOUNG * ONSET * ONSET / 3.0 * (1.0 + 0.5 * ETA),
                1e-12,
                name,
            );
        }
    }
}

#[test]
fn damage_remembers_the_largest_energy_through_unloading_turning_and_cycles() {
    let (x, s) = (diagonal(1.0, 0.0, 0.0), shear());
    let fresh = Point::new(1.0, ETA);
    let [a, c] = [&x, &s].map(|h| (YOUNG * ONSET * ONSET / 3.0 / fresh.elastic(h, false)).sqrt());
    let reload = [1.8, 0.0, -0.9, 1.2, 1.8, 2.4].map(|f| x * (f * a));
    let turned = [
        x * (1.7 * a),
        x * (1.7 * a) + s * (0.4 * c),
        s * (1.5 * c),
        s * (2.2 * c),
        s * (-2.9 * c),
    ];
    let cycles: Vec<Tensor<3>> = (1..=60)
        .map(|k| x * (0.05 * f64::from(k) * a * (0.7 * f64::from(k)).sin()))
        .collect();
    for (name, path) in [
        ("reload", &reload[..]),
        ("turned", &turned[..]),
        ("cycles", &cycles[..]),
    ] {
        let mut point = Point::new(1.0, ETA);
        let mut largest: f64 = 0.0;
        for g in path {
            let answer = point.step(g, false);
            largest = largest.max(point.elastic(g, false));
            let damage = damage_of(largest);
            assert!((point.damage()[0] - damage).abs() < 1e-12, "{name}");
            let expected = (1.0 - damage) * point.elastic(g, false);
            assert!((answer.stored - expected).abs() < 1e-12 * largest, "{name}");
            let spent = YOUNG * ONSET * ONSET / 3.0 * damage * (1.0 + 0.5 * ETA * damage);
            assert!((point.dissipated - spent).abs() < 1e-12 * largest, "{name}");
        }
        assert!(damage_of(largest) > 0.2, "{name}");
    }
}

/// `∫ f` by 5 Gauss points in each of `parts`.
fn integral(from: f64, to: f64, parts: u32, f: &dyn Fn(f64) -> f64) -> f64 {
    const X: [f64; 3] = [0.0, 0.538_469_310_105_683_1, 0.906_179_845_938_664];
    const W: [f64; 3] = [
        0.568_888_888_888_888_9,
        0.478_628_670_499_366_5,
        0.236_926_885_056_189_08,
    ];
    let half = 0.5 * (to - from) / f64::from(parts);
    (0..parts)
        .map(|k| {
            let mid = from + half * f64::from(2 * k + 1);
            let pairs = (1..3).map(|i| W[i] * (f(mid - half * X[i]) + f(mid + half * X[i])));
            half * (W[0] * f(mid) + pairs.sum::<f64>())
        })
        .sum()
}

#[test]
fn exact_bonds_follow_the_quadrature_of_their_extension() {
    // large enough strains for the extension not to be linear
    let h = diagonal(1.0, 0.0, 0.0) + shear() * 0.8;
    let mut point = Point::new(1.0, ETA);
    let fresh = Point::new(1.0, ETA);
    // P : H from forces of single bonds, with the damage of the energy
    let stress = |a: f64| -> f64 {
        let damage = damage_of(fresh.elastic(&(h * a), true));
        let bonds = fresh.bonds.iter().enumerate();
        bonds
            .map(|(k, xi)| {
                let (r, y) = (xi.norm(), xi + h * xi * a);
                let pull = fresh.pair[k] * r * r * (y.norm() - r) * (1.0 - damage);
                pull * y.dot(&(h * xi)) / y.norm() * fresh.volumes[k]
            })
            .sum()
    };
    // where damage begins and ends, by bisection: the work is integrated piece by piece
    let reaches = |damage: f64| {
        let wanted = YOUNG * ONSET * ONSET / 3.0 * (1.0 + ETA * damage);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..200 {
            let mid = 0.5 * (low + high);
            match fresh.elastic(&(h * mid), true) < wanted {
                true => low = mid,
                false => high = mid,
            }
        }
        low
    };
    let (begin, end) = (reaches(0.0), reaches(1.0));
    let mut last = Answer {
        force: Vec::new(),
        stored: 0.0,
        dissipated: 0.0,
    };
    for f in [0.3, 0.45, 0.5, 0.77, 0.93] {
        let a = f * end;
        last = point.step(&(h * a), true);
        near(
            point.stress_along(&last.force, &h),
            stress(a),
            1e-10,
            "stress",
        );
        assert!((point.damage()[0] - damage_of(fresh.elastic(&(h * a), true))).abs() < 1e-12);
    }
    let work = integral(0.0, begin, 20, &stress) + integral(begin, 0.93 * end, 60, &stress);
    near(last.stored + point.dissipated, work, 1e-10, "work");
}

/// `V₀ μ` of weak planes of the normal x.
fn rates(point: &Point, weakness: f64) -> Vec<f64> {
    let m = point
        .bonds
        .iter()
        .map(|xi| 1.0 + (weakness - 1.0) * xi[0] * xi[0] / xi.norm_squared());
    let m: Vec<f64> = m.collect();
    let sum: f64 = m.iter().zip(&point.volumes).map(|(m, v)| m * v).sum();
    let volume: f64 = point.volumes.iter().sum();
    m.iter().map(|m| m * volume / sum).collect()
}

#[test]
fn weak_planes_grow_by_the_equation_of_evolution_until_they_are_through() {
    let weakness = 5.0;
    for (name, h) in [
        ("across", diagonal(1.0, 0.0, 0.0)),
        ("along", diagonal(0.0, 1.0, 0.3)),
        ("shear", shear()),
    ] {
        let mut point = Point::new(weakness, ETA);
        let rate = rates(&point, weakness);
        let volume: f64 = point.volumes.iter().sum();
        let onset = YOUNG * ONSET * ONSET / 3.0;
        let unit: Vec<f64> = {
            let (extension, _) = point.stretched(&h, false);
            (0..rate.len())
                .map(|k| 0.5 * point.pair[k] * (point.bonds[k].norm() * extension[k]).powi(2))
                .collect()
        };
        let sum = |of: &dyn Fn(usize) -> f64| {
            (0..rate.len())
                .map(|k| of(k) * point.volumes[k])
                .sum::<f64>()
        };
        let drive = sum(&|k| rate[k] * unit[k]);
        // until half of the bonds are through: eq. (6.26) with μ in the numerator and capped bonds left out of τ • μ, in small steps of a²
        let (steps, top) = (40_000, 0.93 * onset * (1.0 + ETA) / drive);
        let mut phi = vec![0.0f64; rate.len()];
        let mut spent = 0.0;
        for k in 0..steps {
            let square = top * f64::from(k) / f64::from(steps);
            if drive * square < onset {
                continue;
            }
            let free = |k: usize| if phi[k] < 1.0 { rate[k] } else { 0.0 };
            let growing = sum(&free) / volume;
            let lambda = drive * top / f64::from(steps) / (onset * ETA * growing);
            let before = phi.clone();
            phi.iter_mut()
                .zip(&rate)
                .for_each(|(p, r)| *p = (*p + lambda * r).min(1.0));
            spent += sum(&|k| (phi[k] - before[k]) * unit[k] * square);
        }
        // in one step, and in nine
        let mut at_once = Point::new(weakness, ETA);
        at_once.step(&(h * top.sqrt()), false);
        for k in 1..=9 {
            point.step(&(h * (top * f64::from(k) / 9.0).sqrt()), false);
        }
        let through = phi.iter().filter(|p| **p == 1.0).count();
        assert!(through > 3 && through < phi.len(), "{name}: {through}");
        for ((a, b), c) in point.damage().iter().zip(at_once.damage()).zip(&phi) {
            assert!(
                (a - b).abs() < 1e-12 && (a - c).abs() < 2e-3,
                "{name}: {a} {b} {c}"
            );
        }
        near(point.dissipated, at_once.dissipated, 1e-12, name);
        near(point.dissipated, spent, 2e-3, name);
        // S = 0 at the end
        let damage: Vec<f64> = point.damage();
        let mean = (0..damage.len())
            .map(|k| damage[k] * point.volumes[k])
            .sum::<f64>()
            / volume;
        near(drive * top, onset * (1.0 + ETA * mean), 1e-12, name);
        // and all is through beyond
        point.step(&(h * (1.2 * top).sqrt()), false);
        assert!(point.damage().iter().all(|d| *d == 1.0), "{name}");
    }
}

#[test]
fn without_weakness_the_evolution_is_the_closed_form_and_kept_damage_stays() {
    let h = diagonal(1.0, -0.3, 0.2) + shear() * 0.5;
    let mut alike = Point::new(1.0, ETA);
    let mut point = Point::new(2.0, ETA);
    let weak = ContinuumDamage::<3> {
        linear: BondBased::new(Micromodulus::InverseDistance, 0.4 * YOUNG),
        onset: YOUNG * ONSET * ONSET / 3.0,
        hardening: ETA,
        weak: Some((1.0, Vector::<3>::x())),
    };
    point.law = Arc::new(weak);
    let b = (YOUNG * ONSET * ONSET / 3.0 / alike.elastic(&h, false)).sqrt();
    for f in [0.8, 1.4, 1.1, 2.3, -0.5, 3.0, 3.4, 1.0] {
        let g = h * (f * b);
        let (one, other) = (alike.step(&g, false), point.step(&g, false));
        for (a, b) in one.force.iter().zip(&other.force) {
            assert!((a - b).norm() < 1e-12 * YOUNG * ONSET);
        }
        for (a, b) in alike.damage().iter().zip(point.damage()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
    near(point.dissipated, alike.dissipated, 1e-12, "dissipated");
    // a point that keeps its damage is elastic, and forgets nothing
    let mut kept = Point::new(1.0, ETA);
    kept.step(&(h * (1.5 * b)), false);
    let before = kept.damage();
    let g = h * (5.0 * b);
    let (answer, present) = kept.respond(&g, false, true);
    assert_eq!(present, before);
    assert_eq!(answer.dissipated, 0.0);
    near(
        answer.stored,
        (1.0 - before[0]) * kept.elastic(&g, false),
        1e-12,
        "kept",
    );
}
