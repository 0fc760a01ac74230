//! The load at which a long straight crack grows: points around its tip, loaded by the K-field of a crack in a plane.
//!
//! The energy release rate is that of the lattice itself, by the energies of the same points with cracks of other lengths that do not grow; the length of a crack that has grown is
//! that of the straight crack of the same energy. So neither the size of the disc nor a rule for the tip enters.

use crate::Effort;
use crate::observed::run_scene;
use crate::specimens;
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Progress,
};
use rayon::prelude::*;

/// Bounds of the load at growth over √(G0 E′), by the points to a horizon.
const BOUNDS: [(u32, f64, f64); 2] = [(3, 0.98, 1.06), (4, 0.98, 1.04)];

/// Half the side of the square, in spacings; its frame of two horizons is moved.
const HALF: f64 = 24.0;

/// Lengths by which cracks of the calibration are longer than the first.
const LONGER: [f64; 9] = [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

/// Growth from which on it is steady, and at which it ends, in spacings.
const STEADY: [f64; 2] = [1.0, 4.0];

/// G0 with spacing, Young's modulus and thickness 1.
const ENERGY: f64 = 1e-6;

/// A crack in a lattice.
#[derive(Clone, Debug)]
struct Crack {
    /// Kind of material with its keys, but the modulus and what breaks it.
    material: String,
    kinematics: &'static str,
    /// Poisson's ratio.
    ratio: f64,
    /// Points to a horizon.
    m: u32,
    /// Angle to the lattice in degrees.
    angle: f64,
    /// Height within a cell.
    height: f64,
    /// `softening`.
    softening: f64,
}

impl Crack {
    /// E′ over E.
    fn plane_modulus(&self) -> f64 {
        match self.kinematics {
            "plane-strain" => 1.0 / (1.0 - self.ratio * self.ratio),
            _ => 1.0,
        }
    }

    /// Displacements of the K-field with K = √(G0 E′), about the origin of the crack.
    fn field(&self) -> [String; 2] {
        let kappa = match self.kinematics {
            "plane-strain" => 3.0 - 4.0 * self.ratio,
            _ => (3.0 - self.ratio) / (1.0 + self.ratio),
        };
        let shear = 0.5 / (1.0 + self.ratio);
        let size = (ENERGY * self.plane_modulus() / std::f64::consts::TAU).sqrt() / (2.0 * shear);
        let (sin, cos) = self.angle.to_radians().sin_cos();
        let [x, y] = self.origin();
        let along = format!("({cos} * (x - {x}) + {sin} * (y - {y}))");
        let across = format!("({cos} * (y - {y}) - {sin} * (x - {x}))");
        let r = format!("hypot({along}, {across})");
        // √r cos θ/2, √r sin θ/2 and cos θ
        let even = format!("sqrt(({r} + {along}) / 2)");
        let odd = format!("sign({across}) * sqrt(max(0, {r} - {along}) / 2)");
        let cosine = format!("{along} / {r}");
        let of_along = format!("{even} * ({kappa} - ({cosine}))");
        let of_across = format!("{odd} * ({kappa} - ({cosine}))");
        [
            format!("{size} * t * ({cos} * {of_along} - {sin} * {of_across})"),
            format!("{size} * t * ({sin} * {of_along} + {cos} * {of_across})"),
        ]
    }

    fn origin(&self) -> [f64; 2] {
        let (sin, cos) = self.angle.to_radians().sin_cos();
        [-sin * self.height, cos * self.height]
    }

    /// The scene, with a crack that is `longer`, bonds that take so much `energy`, and its load steps.
    fn scene(&self, longer: f64, energy: f64, softening: f64, steps: &str) -> String {
        let (sin, cos) = self.angle.to_radians().sin_cos();
        let [x, y] = self.origin();
        let far = 2.0 * HALF;
        let inner = HALF - 2.0 * f64::from(self.m);
        let [ux, uy] = self.field();
        let strips = [
            ("left", [-HALF, -HALF], [-inner, HALF]),
            ("right", [inner, -HALF], [HALF, HALF]),
            ("below", [-inner, -HALF], [inner, -inner]),
            ("above", [-inner, inner], [inner, HALF]),
        ];
        let held: String = strips
            .iter()
            .map(|(name, min, max)| {
                format!(
                    "[conditions.{name}.displacement]\ninside.box = {{ min = {min:?}, max = {max:?} }}\nx = \"{ux}\"\ny = \"{uy}\"\n"
                )
            })
            .collect();
        format!(
            "kinematics = \"{}\"\ncoupling = \"nonlocal\"\n[mesh.rectangle]\nmin = [-{HALF}, -{HALF}]\nmax = [{HALF}, {HALF}]\nx = {{ spacing = 1 }}\ny = {{ spacing = 1 }}\n\
             [materials.m.{}\nyoungs-modulus = 1\nfracture-energy = {energy:e}\nsoftening = {softening}\n[peridynamics]\nhorizon = {}\npoints.lattice = {{ spacing = 1, origin = [0.5, 0.5] }}\n\
             [cracks.long]\nsegment = {{ from = [{}, {}], to = [{}, {}] }}\n{held}\
             [solve.quasi-static]\nsteps = {steps}\n[output]\nvtu = false\n",
            self.kinematics,
            self.material,
            self.m,
            x - far * cos,
            y - far * sin,
            x + longer * cos,
            y + longer * sin,
        )
    }

    /// Load over √(G0 E′) at growth: the largest and the mean of the states that hold.
    fn growth(&self) -> Result<[f64; 2], String> {
        // energies at K = √(G0 E′) of cracks that do not grow
        let energies: Result<Vec<f64>, String> = LONGER
            .par_iter()
            .map(|longer| {
                let seen = run_scene(&self.scene(*longer, 1e6, 1.0, "[1]"))?;
                let rows = seen.columns("history", ["stored_energy"]);
                rows.last().map(|row| row[0]).ok_or("no rows".to_owned())
            })
            .collect();
        let of_length = Quadratic::through(&LONGER, &energies?);
        let (first, count) = match self.softening > 1.0 {
            true => (0.9, 35),
            false => (1.05, 45),
        };
        let steps: Vec<f64> = (0..=count).map(|k| first + 0.01 * f64::from(k)).collect();
        let seen = run_scene(&self.scene(0.0, ENERGY, self.softening, &format!("{steps:?}")))?;
        let rows = seen.columns("history", ["time", "stored_energy"]);
        let mut loads = Vec::new();
        for [t, stored] in rows {
            let length = of_length.inverse(stored / (t * t));
            if t > 0.0 && (STEADY[0]..=STEADY[1]).contains(&length) {
                let rate = -t * t * of_length.slope(length);
                loads.push((rate / ENERGY).sqrt());
            }
        }
        if loads.is_empty() {
            return Err("it has not grown steadily".to_owned());
        }
        let largest = loads.iter().copied().fold(0.0, f64::max);
        Ok([largest, loads.iter().sum::<f64>() / loads.len() as f64])
    }

    fn name(&self) -> String {
        let law = self.material.split(']').next().unwrap_or_default();
        format!(
            "{law}, nu = {:.2}, {}, m = {}, {} degrees, height {}, s_c/s_e = {}",
            self.ratio, self.kinematics, self.m, self.angle, self.height, self.softening
        )
    }
}

/// `a + b x + c x²` by least squares.
struct Quadratic([f64; 3]);

impl Quadratic {
    fn through(x: &[f64], y: &[f64]) -> Self {
        use nalgebra::{Matrix3, Vector3};
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (x, y) in x.iter().zip(y) {
            let row = Vector3::new(1.0, *x, x * x);
            normal += row * row.transpose();
            right += row * *y;
        }
        let found = normal.lu().solve(&right).unwrap_or_else(Vector3::zeros);
        Self(found.into())
    }

    fn slope(&self, x: f64) -> f64 {
        self.0[1] + 2.0 * self.0[2] * x
    }

    /// Argument of a value, of a function that falls.
    fn inverse(&self, y: f64) -> f64 {
        let (mut low, mut high) = (-10.0, 20.0);
        for _ in 0..60 {
            let x: f64 = 0.5 * (low + high);
            match self.0[0] + self.0[1] * x + self.0[2] * x * x > y {
                true => low = x,
                false => high = x,
            }
        }
        0.5 * (low + high)
    }
}

/// Angles, heights and points to a horizon of the cracks of one law; all of them in plane stress with three points, fewer beside.
fn directions(effort: Effort, kinematics: &str, m: u32) -> Vec<[f64; 2]> {
    let of = |angles: &[f64], heights: &[f64]| {
        let each = |angle: &f64| {
            heights
                .iter()
                .map(|height| [*angle, *height])
                .collect::<Vec<_>>()
        };
        angles.iter().flat_map(each).collect()
    };
    match (effort, kinematics, m) {
        (Effort::Quick, ..) => of(&[0.0], &[0.1]),
        (Effort::Full, "plane-stress", 3) => of(
            &[0.0, 5.0, 10.0, 15.0, 22.5, 30.0, 37.5, 45.0],
            &[0.1, 0.27, 0.41],
        ),
        (Effort::Full, ..) => of(&[0.0, 22.5, 45.0], &[0.1]),
    }
}

fn cracks(effort: Effort) -> Vec<Crack> {
    let mut all = Vec::new();
    let lps = |ratio: f64| (format!("lps]\npoisson-ratio = {ratio}"), ratio);
    let (ratios, cases): (&[f64], &[(&str, u32)]) = match effort {
        Effort::Quick => (&[0.2], &[("plane-stress", 3)]),
        Effort::Full => (
            &[0.1, 0.2, 0.3, 0.4],
            &[
                ("plane-stress", 3),
                ("plane-strain", 3),
                ("plane-stress", 4),
            ],
        ),
    };
    for &(kinematics, m) in cases {
        let pairwise = match kinematics {
            "plane-strain" => 0.25,
            _ => 1.0 / 3.0,
        };
        let laws = std::iter::once(("bond-based]".to_owned(), pairwise));
        for (material, ratio) in laws.chain(ratios.iter().copied().map(lps)) {
            for [angle, height] in directions(effort, kinematics, m) {
                all.push(Crack {
                    material: material.clone(),
                    kinematics,
                    ratio,
                    m,
                    angle,
                    height,
                    softening: 3.0,
                });
            }
        }
    }
    all
}

/// The suite `growth`.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut cases = cracks(effort);
    // beside them, bonds that break at once
    let brittle: Vec<Crack> = (cases.iter())
        .filter(|crack| crack.angle == 0.0 && crack.height == 0.1)
        .map(|crack| Crack {
            softening: 1.0,
            ..crack.clone()
        })
        .collect();
    cases.extend(brittle);
    progress.stage("cracks that grow", Some(cases.len() as u64));
    let rows: Vec<Vec<TableRow>> = cases
        .par_iter()
        .map(|crack| {
            let (name, found) = (crack.name(), crack.growth());
            progress.advance(1);
            let quantity = "load at growth over sqrt(G0 E')";
            match found {
                Ok([largest, mean]) => {
                    let bounds = BOUNDS.iter().find(|b| b.0 == crack.m);
                    let row = match bounds.filter(|_| crack.softening > 1.0) {
                        Some((_, low, high)) => {
                            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
                            TableRow::within(&name, quantity, largest, middle, half)
                        }
                        None => TableRow::info(&name, quantity, largest),
                    };
                    vec![
                        row,
                        TableRow::info(&name, "its mean as the crack grows", mean),
                    ]
                }
                Err(why) => vec![TableRow::refused(&name, quantity, why)],
            }
        })
        .collect();
    progress.finish();
    let mut table = Table::new(
        "Long straight cracks under the K-field: load at growth, bonds that soften and bonds that break at once",
        Columns::Full,
    );
    table.rows.extend(rows.into_iter().flatten());
    vec![table, specimens::table(effort, progress)]
}
