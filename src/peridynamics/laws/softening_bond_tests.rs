use super::*;
use crate::peridynamics::{Family, plane_energy};

const SHEAR: f64 = 1.3;

/// Young's modulus of `D` dimensions: with `C₁₁ = 3 μ`, `C₁₂ = μ`.
fn young<const D: usize>() -> f64 {
    [3.0, 3.0 - 1.0 / 3.0, 3.0 - 2.0 / 4.0][D - 1] * SHEAR
}

fn law<const D: usize>(strength: f64, energy: f64, shape: f64) -> SofteningBond<D> {
    SofteningBond {
        linear: BondBased::new(Micromodulus::InverseDistance, SHEAR),
        typed: Softening {
            strength,
            energy,
            is_exponential: shape == 1.0,
        },
        calibration: None,
    }
}

/// A point of a lattice with its coefficients.
struct Point<const D: usize> {
    bonds: Vec<Vector<D>>,
    volumes: Vec<f64>,
    pair: Vec<f64>,
    plane_energy: f64,
    horizon: f64,
}

fn point<const D: usize>(spacing: f64, m: i32) -> Point<D> {
    let (horizon, volume) = (f64::from(m) * spacing, spacing.powi(D as i32));
    let side = 2 * m + 1;
    let offsets = (0..side.pow(D as u32))
        .map(|n| std::array::from_fn::<i32, D, _>(|a| n / side.pow(a as u32) % side - m));
    let offsets: Vec<[i32; D]> = offsets
        .filter(|k| (1..=m * m).contains(&k.iter().map(|k| k * k).sum::<i32>()))
        .collect();
    let vector = |k: &[i32; D]| Vector::from_fn(|a, _| f64::from(k[a]) * spacing);
    let bonds: Vec<Vector<D>> = offsets.iter().map(vector).collect();
    let volumes = vec![volume; bonds.len()];
    let mut pair = vec![0.0; bonds.len()];
    let family = Family {
        bonds: &bonds,
        volumes: &volumes,
        factors: &vec![1.0; bonds.len()],
        horizon,
        bond_horizons: &[],
        materials: None,
    };
    let linear = BondBased::<D>::new(Micromodulus::InverseDistance, SHEAR);
    let state = linear.coefficients(&family, &mut pair, &mut []).unwrap();
    assert!(state.is_none());
    let planes = offsets.iter().zip(&pair).map(|(k, p)| (*k, (*p, 0.0)));
    Point {
        plane_energy: plane_energy(spacing, &planes.collect::<Vec<_>>(), 0.0, 0.0),
        bonds,
        volumes,
        pair,
        horizon,
    }
}

impl<const D: usize> Point<D> {
    fn calibrate(&self, typed: Softening) -> Result<Calibration, CalibrationError> {
        let bonds = (self.bonds.iter().zip(&self.volumes)).zip(&self.pair);
        let bonds: Vec<_> = bonds.map(|((xi, v), p)| (*xi, p * v)).collect();
        typed.calibrate(&RegularFamily {
            bonds: &bonds,
            plane_energy: self.plane_energy,
            horizon: self.horizon,
        })
    }

    /// The largest horizon of a strength and an energy, as the refusal of a horizon beyond it names it: nothing else has to be found for that.
    fn largest_horizon(&self, strength: f64, energy: f64) -> f64 {
        match self.calibrate(Softening {
            strength,
            energy,
            is_exponential: false,
        }) {
            Err(CalibrationError::SnapBack { largest, .. }) => largest,
            other => panic!("{other:?}"),
        }
    }

    /// Force states under extensions, with the history before and after; and the energies.
    fn respond(
        &self,
        law: &SofteningBond<D>,
        extension: &[f64],
        past: &[f64],
    ) -> (Vec<Vector<D>>, Vec<f64>, EnergyDensity) {
        let direction: Vec<_> = self.bonds.iter().map(|xi| xi / xi.norm()).collect();
        let family = DeformedFamily {
            bonds: &self.bonds,
            volumes: &self.volumes,
            pair: &self.pair,
            omega: &[],
            state: None,
            difference: &[],
            extension,
            direction: &direction,
            is_whole: true,
            damage: 0.0,
            carried: None,
            keeps_damage: false,
            material: 0,
            kinematics: crate::peridynamics::bond_force::BondKinematics::Exact,
        };
        let mut force = vec![Vector::zeros(); self.bonds.len()];
        let mut after = past.to_vec();
        let past = Past {
            point: &[],
            bonds: past,
        };
        let present = Present {
            point: &mut [],
            bonds: &mut after,
            principal_stress: None,
        };
        let energy = law.respond(&family, 0.0, past, present, &mut force);
        (force, after, energy)
    }

    /// Stress along and across the first axis.
    fn stress(&self, force: &[Vector<D>]) -> [f64; 2] {
        let each = (force.iter().zip(&self.bonds)).zip(&self.volumes);
        each.fold([0.0; 2], |sum, ((t, xi), v)| {
            let along = t[0] * xi[0] * v;
            [sum[0] + along, sum[1] + t.dot(xi) * v - along]
        })
    }

    /// Extensions under the strains along and across the first axis.
    fn strained(&self, along: f64, across: f64) -> Vec<f64> {
        let of = |xi: &Vector<D>| {
            let (square, first) = (xi.norm_squared(), xi[0] * xi[0]);
            (along * first + across * (square - first)) / square.sqrt()
        };
        self.bonds.iter().map(of).collect()
    }
}

fn calibrated<const D: usize>(point: &Point<D>, law: SofteningBond<D>) -> SofteningBond<D> {
    SofteningBond {
        calibration: Some(point.calibrate(law.typed).unwrap()),
        ..law
    }
}

/// A path in uniaxial stress, followed step by step with the law's own memory.
#[derive(Clone)]
struct Path {
    strain: f64,
    across: f64,
    past: Vec<f64>,
    stress: f64,
}

impl Path {
    fn step<const D: usize>(&mut self, point: &Point<D>, law: &SofteningBond<D>, growth: f64) {
        self.strain *= growth;
        let strain = self.strain;
        let rest = |x: f64| {
            let (force, ..) = point.respond(law, &point.strained(strain, x), &self.past);
            point.stress(&force)[1]
        };
        if D > 1 {
            let (mut low, mut high) = (self.across - 0.1 * strain, self.across + 0.1 * strain);
            for _ in 0..45 {
                let middle = 0.5 * (low + high);
                match rest(middle) > 0.0 {
                    true => high = middle,
                    false => low = middle,
                }
            }
            self.across = 0.5 * (low + high);
        }
        let strained = point.strained(strain, self.across);
        let (force, after, _) = point.respond(law, &strained, &self.past);
        self.stress = point.stress(&force)[0];
        self.past = after;
    }
}

/// The largest stress of such a path: in coarse steps, and then in fine ones from a little before it.
fn largest_stress<const D: usize>(point: &Point<D>, law: &SofteningBond<D>) -> f64 {
    const COARSE: f64 = 1e-3;
    const FINE: usize = 4000;
    let envelope = law.calibration.unwrap().envelope;
    let mut path = Path {
        strain: 0.9 * envelope.onset,
        across: -0.3 * envelope.onset,
        past: vec![0.0; 2 * point.bonds.len()],
        stress: 0.0,
    };
    let mut before = [path.clone(), path.clone()];
    let (mut largest, mut from) = (0.0, path.clone());
    while path.strain < 4.0 * envelope.end && path.stress > 0.9 * largest || largest == 0.0 {
        path.step(point, law, 1.0 + COARSE);
        if path.stress > largest {
            (largest, from) = (path.stress, before[0].clone());
        }
        before = [before[1].clone(), path.clone()];
    }
    for _ in 0..FINE {
        from.step(point, law, 1.0 + 4.0 * COARSE / FINE as f64);
        largest = largest.max(from.stress);
    }
    largest
}

fn has_its_strength<const D: usize>(m: i32) {
    let point = point::<D>(0.1, m);
    let largest = point.largest_horizon(1.0, 1e-9) / 1e-9;
    for shape in [0.0, 1.0] {
        // from nearly brittle to soft
        for softness in [1.3, 10.0] {
            let strength = 0.1;
            let energy = softness * point.horizon / largest * strength * strength;
            let law = calibrated(&point, law::<D>(strength, energy, shape));
            let found = largest_stress(&point, &law) / strength;
            assert!(
                (found - 1.0).abs() < 1e-6,
                "{D}D {shape} {softness}: {found}"
            );
        }
    }
}

#[test]
fn the_largest_stress_in_uniaxial_tension_is_the_strength() {
    has_its_strength::<1>(3);
    has_its_strength::<2>(3);
    has_its_strength::<3>(2);
}

/// The work of opening the plane between two layers, by the forces of its bonds, over the fracture energy.
fn work_of_opening<const D: usize>(m: i32, shape: f64) -> f64 {
    let spacing = 0.1;
    let point = point::<D>(spacing, m);
    let energy = 0.02;
    let law = calibrated(&point, law::<D>(0.1, energy, shape));
    let end = law.calibration.unwrap().envelope.end;
    // a bond of length r breaks at the opening end · r²/ξ₁
    let far = end * point.horizon * point.horizon / spacing * 1.01;
    const STEPS: usize = 20_000;
    let (mut past, mut work) = (vec![0.0; 2 * point.bonds.len()], 0.0);
    let mut before = 0.0;
    for step in 1..=STEPS {
        let opening = far * step as f64 / STEPS as f64;
        let of = |xi: &Vector<D>| (opening * xi[0] / xi.norm()).max(0.0);
        let extension: Vec<f64> = point.bonds.iter().map(of).collect();
        let (force, after, _) = point.respond(&law, &extension, &past);
        past = after;
        // ξ₁/h parallels of a bond cross the plane per face of a cell; both ends pull
        let pull = (force.iter().zip(&point.bonds)).zip(&point.volumes);
        let traction: f64 = pull
            .filter(|((_, xi), _)| xi[0] > 0.0)
            .map(|((t, xi), v)| 2.0 * t[0] * v * xi[0])
            .sum();
        work += 0.5 * (before + traction) * far / STEPS as f64;
        before = traction;
    }
    assert!(before == 0.0);
    work / energy
}

#[test]
fn opening_a_plane_takes_the_fracture_energy() {
    for shape in [0.0, 1.0] {
        let found = [
            work_of_opening::<1>(3, shape),
            work_of_opening::<2>(3, shape),
            work_of_opening::<3>(2, shape),
        ];
        for of in found {
            assert!((of - 1.0).abs() < 2e-5, "{shape}: {found:?}");
        }
    }
}

#[test]
fn a_bar_has_the_closed_form() {
    let point = point::<1>(0.1, 3);
    let (strength, energy) = (0.1, 0.02);
    let envelope = calibrated(&point, law::<1>(strength, energy, 0.0))
        .calibration
        .unwrap()
        .envelope;
    // all bonds of a bar are stretched alike, and its modulus is that of the sum over three bonds
    let direct: f64 = (0..point.bonds.len())
        .map(|k| point.pair[k] * point.bonds[k][0].powi(4) * point.volumes[k])
        .sum();
    assert!((envelope.onset * direct / strength - 1.0).abs() < 1e-8);
    let product = envelope.onset * envelope.end * point.plane_energy;
    assert!((product / energy - 1.0).abs() < 1e-12, "{product}");
}

#[test]
fn the_largest_horizon_tends_to_that_of_a_continuous_family() {
    // in units of E G/σ²
    let bar = point::<1>(0.01, 400).largest_horizon(0.1, 1e-6) / (young::<1>() * 1e-4);
    assert!((bar / 3.0 - 1.0).abs() < 0.01, "{bar}");
    let plane = point::<2>(0.01, 40).largest_horizon(0.1, 1e-6) / (young::<2>() * 1e-4);
    let exact = 4.0 * std::f64::consts::PI / 9.0;
    assert!((plane / exact - 1.0).abs() < 0.03, "{plane} {exact}");
    let solid = point::<3>(0.01, 12).largest_horizon(0.1, 1e-6) / (young::<3>() * 1e-4);
    assert!((solid * 1.2 - 1.0).abs() < 0.05, "{solid}");
}

#[test]
fn a_horizon_beyond_the_largest_is_refused_and_one_below_is_not() {
    let point = point::<2>(0.1, 3);
    let with = |energy: f64| {
        point.calibrate(Softening {
            strength: 0.1,
            energy,
            is_exponential: true,
        })
    };
    let largest = with(1.0).unwrap().largest_horizon;
    let just = point.horizon / largest;
    assert!(with(1.001 * just).is_ok());
    match with(0.999 * just).unwrap_err() {
        CalibrationError::SnapBack {
            horizon, largest, ..
        } => {
            assert!((largest / horizon / 0.999 - 1.0).abs() < 1e-6);
        }
        other => panic!("{other}"),
    }
}

#[test]
fn what_is_spent_depends_on_the_largest_stretch_alone_and_cracks_close() {
    let point = point::<1>(0.1, 1);
    for shape in [0.0, 1.0] {
        let law = calibrated(&point, law::<1>(0.1, 0.02, shape));
        let envelope = law.calibration.unwrap().envelope;
        let largest = 0.5 * (envelope.onset + envelope.end);
        let (mut past, mut spent, mut work) = (vec![0.0; 4], 0.0, 0.0);
        let mut last = (0.0, 0.0);
        let mut stored = 0.0;
        // up, back into compression, and up beyond
        let way = [0.7 * largest, -0.5 * largest, largest, 0.2 * largest];
        let mut at = 0.0;
        for goal in way {
            const STEPS: usize = 20_000;
            let from = at;
            for step in 1..=STEPS {
                at = from + (goal - from) * step as f64 / STEPS as f64;
                let (force, after, energy) = point.respond(&law, &[at * 0.1, at * 0.1], &past);
                let stress = point.stress(&force)[0];
                assert!(energy.dissipated >= 0.0);
                if at < 0.0 {
                    let modulus = stress / at;
                    let whole = 2.0 * point.pair[0] * 1e-4 * point.volumes[0];
                    assert!((modulus / whole - 1.0).abs() < 1e-12);
                }
                work += 0.5 * (stress + last.1) * (at - last.0);
                last = (at, stress);
                spent += energy.dissipated;
                stored = energy.stored;
                past = after;
            }
        }
        // what the trapezoidal rule leaves
        assert!(
            ((stored + spent) / work - 1.0).abs() < 1e-6,
            "{stored} {spent} {work}"
        );
        let whole = 2.0 * point.pair[0] * 1e-4 * point.volumes[0];
        assert!((spent / (whole * envelope.spent(largest)) - 1.0).abs() < 1e-12);
    }
}
