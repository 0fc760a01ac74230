//! Waves that cross a seam, and their reflection.
//!
//! A pulse `exp(−(x/w)²)` runs towards the seam, from the finite elements or from the points. Once it has passed, what is left on the side it came from is the reflected
//! displacement. A lattice alone leaves something behind too: the starting velocity `−c u′` is that of the continuum, and short waves lag. So the same
//! pulse is run in the pure model of the side that it starts from; that side's sites are the same ones, and the difference of both displacements is what the
//! seam has done. Amplitude: the largest difference, relative to the height of the pulse. Energy: the kinetic energy of the difference, relative to the pulse's.

use std::{collections::BTreeMap, ops::ControlFlow};

use rayon::prelude::*;

use crate::{
    Effort,
    enclosed::{INFLUENCE, Law, Method},
    strip::{Kind, Strip, StripCase},
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
    progress::Progress,
    solve::{
        explicit::{Explicit, ExplicitParams, State, Undriven},
        stable_step,
    },
};

/// Reflected amplitude of the splice at a width of 4 δ.
pub const SPLICE: f64 = 2e-3;
/// Reflected amplitude of the best blending at a width of 4 δ.
pub const BLENDING: f64 = 1.5e-3;

/// Side from which the pulse comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// From the finite elements into the points.
    Elements,
    /// From the points into the finite elements.
    Points,
}

impl Side {
    fn name(self) -> &'static str {
        match self {
            Self::Elements => "FE to PD",
            Self::Points => "PD to FE",
        }
    }

    fn pure(self) -> Kind {
        match self {
            Self::Elements => Kind::Local,
            Self::Points => Kind::Nonlocal,
        }
    }
}

/// Reflection of a pulse, relative to the incident one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflected {
    /// Largest displacement that the seam sent back.
    pub amplitude: f64,
    /// Its kinetic energy.
    pub energy: f64,
    /// Largest displacement that the pure model left behind in the same place.
    pub background: f64,
}

/// A bar with one seam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The method.
    pub method: Method,
    /// The law of the points.
    pub law: Law,
    /// m = δ/h.
    pub ratio: u32,
    /// Width of the transition zone in horizons.
    pub transition: u32,
    /// Width w of the pulse in horizons.
    pub width: u32,
    /// Side from which it comes.
    pub side: Side,
}

/// Displacement and velocity on the side that the pulse came from, by position.
type Left = BTreeMap<i64, (f64, f64)>;

impl Crossing {
    fn case(&self, kind: Kind) -> StripCase {
        let (transition, width) = (self.transition * self.ratio, self.width * self.ratio);
        let side = 11 * width + 6 * self.ratio;
        StripCase {
            kind,
            law: self.law,
            ratio: f64::from(self.ratio),
            edge_ratio: f64::from(self.ratio),
            lengths: [side, transition, side, 0, 0],
            cell: 1,
            across: 1,
        }
    }

    /// Runs the pulse past the seam with steps of a given size.
    fn left_behind(&self, strip: &mut Strip, step: f64) -> Result<Left, String> {
        let delta = f64::from(self.ratio);
        let w = f64::from(self.width) * delta;
        let seam = [strip.borders[0], strip.borders[1]];
        let distance = 5.0 * w + 2.0 * delta;
        let (start, direction) = match self.side {
            Side::Elements => (seam[0] - distance, 1.0),
            Side::Points => (seam[1] + distance, -1.0),
        };
        let u: Vec<f64> = strip
            .x
            .iter()
            .map(|x| (-((x - start) / w).powi(2)).exp())
            .collect();
        let v = strip
            .x
            .iter()
            .zip(&u)
            .map(|(x, u)| direction * 2.0 * (x - start) / (w * w) * u)
            .collect();
        let steps = ((2.0 * distance + seam[1] - seam[0]) / step).round() as u64;
        let params = ExplicitParams::with_step(step);
        let mut run = Explicit::new(&mut strip.motion, &Undriven, params, State::start(u, v))
            .map_err(|e| e.to_string())?;
        run.run(steps, &mut |_| ControlFlow::Continue(()))
            .map_err(|e| e.to_string())?;
        let State { u, v, .. } = run.into_state();
        let margin = 2.0 * delta + 2.0 * w;
        Ok(strip
            .x
            .iter()
            .enumerate()
            .filter(|(_, x)| match self.side {
                Side::Elements => **x < seam[0] - margin,
                Side::Points => **x > seam[1] + margin,
            })
            .map(|(i, x)| (x.round() as i64, (u[i], v[i])))
            .collect())
    }

    /// Measures what the seam reflects.
    ///
    /// # Errors
    /// The reason why a bar cannot be built or moved.
    pub fn measure(&self) -> Result<Reflected, String> {
        let build = |kind| Strip::new::<1>(&self.case(kind));
        let (mut coupled, mut pure) =
            (build(Kind::Coupled(self.method))?, build(self.side.pure())?);
        let limit = |s: &Strip| {
            stable_step::stable_step(&s.motion, &[])
                .map(|l| l.stable)
                .map_err(|e| e.to_string())
        };
        let step = 0.95 * limit(&coupled)?.min(limit(&pure)?);
        let ours = self.left_behind(&mut coupled, step)?;
        let alone = self.left_behind(&mut pure, step)?;
        let (mut amplitude, mut background, mut energy) = (0.0_f64, 0.0_f64, 0.0);
        for (x, (u, v)) in &ours {
            let (pure_u, pure_v) = alone.get(x).copied().unwrap_or((0.0, 0.0));
            amplitude = amplitude.max((u - pure_u).abs());
            background = background.max(pure_u.abs());
            energy += (v - pure_v).powi(2);
        }
        // ∫ (u′)² of the pulse
        let w = f64::from(self.width * self.ratio);
        let incident = (0.5 * std::f64::consts::PI).sqrt() / w;
        Ok(Reflected {
            amplitude,
            energy: energy / incident,
            background,
        })
    }
}

fn limit(crossing: &Crossing) -> Option<f64> {
    if crossing.width != 4 {
        return None;
    }
    match crossing.method {
        Method::Splice => Some(SPLICE),
        _ => None,
    }
}

fn name_of(crossing: &Crossing, law: &str) -> String {
    let zone = if crossing.method.has_transition() {
        format!(" over {} delta", crossing.transition)
    } else {
        String::new()
    };
    format!(
        "{}{zone}, {law}, m={}, {}",
        crossing.method.name(),
        crossing.ratio,
        crossing.side.name()
    )
}

/// Runs the suite.
pub fn run(effort: Effort, _progress: &dyn Progress) -> Vec<Table> {
    let laws = [
        (
            "inverse distance",
            Law::BondBased(Micromodulus::InverseDistance),
        ),
        ("LPS P1/r", Law::StateBased(INFLUENCE)),
    ];
    let (ratios, widths): (&[u32], &[u32]) = match effort {
        Effort::Quick => (&[3], &[2, 4, 8]),
        Effort::Full => (&[3, 4, 6], &[1, 2, 4, 8, 16]),
    };
    let mut cases = Vec::new();
    for (law_name, law) in laws {
        for &ratio in ratios {
            for side in [Side::Elements, Side::Points] {
                for method in Method::ALL {
                    let zones: &[u32] = match method {
                        Method::Blending(_) => &[1, 2, 4, 6],
                        _ => &[2],
                    };
                    for &transition in zones {
                        for &width in widths {
                            cases.push((
                                law_name,
                                Crossing {
                                    method,
                                    law,
                                    ratio,
                                    transition,
                                    width,
                                    side,
                                },
                            ));
                        }
                    }
                }
            }
        }
    }
    let measured: Vec<Result<Reflected, String>> =
        cases.par_iter().map(|(_, c)| c.measure()).collect();
    let mut amplitude = Table::new(
        "reflected displacement by width of the pulse, relative to its height; the pure model's own is taken off",
        Columns::ByQuantity,
    );
    let mut energy = Table::new(
        "reflected energy by width of the pulse, relative to its energy",
        Columns::ByQuantity,
    );
    let mut background = Table::new(
        "what the pure model leaves behind in the same place, relative to the height of the pulse",
        Columns::ByQuantity,
    );
    for ((law, crossing), found) in cases.iter().zip(&measured) {
        let (name, width) = (
            name_of(crossing, law),
            format!("w={} delta", crossing.width),
        );
        match found {
            Err(reason) => amplitude.push(TableRow::refused(&name, &width, reason)),
            Ok(r) => {
                amplitude.push(match limit(crossing) {
                    Some(limit) => TableRow::at_most(&name, &width, r.amplitude, limit),
                    None => TableRow::info(&name, &width, r.amplitude),
                });
                energy.push(TableRow::info(&name, &width, r.energy));
                if crossing.method == Method::Splice {
                    let name = format!(
                        "{}, {law}, m={}",
                        crossing.side.pure().name(),
                        crossing.ratio
                    );
                    background.push(TableRow::info(name, &width, r.background));
                }
            }
        }
    }
    vec![amplitude, best(&cases, &measured), energy, background]
}

/// The blending that reflects least, for each law, m and side.
fn best(cases: &[(&str, Crossing)], measured: &[Result<Reflected, String>]) -> Table {
    let mut table = Table::new(
        "reflected displacement of the best blending at a width of 4 delta",
        Columns::Full,
    );
    let mut groups: Vec<(String, String, f64)> = Vec::new();
    for ((law, c), found) in cases.iter().zip(measured) {
        let (Method::Blending(_), 4, Ok(found)) = (c.method, c.width, found) else {
            continue;
        };
        let group = format!("{law}, m={}, {}", c.ratio, c.side.name());
        let form = name_of(c, law);
        match groups.iter_mut().find(|g| g.0 == group) {
            Some(g) if g.2 <= found.amplitude => {}
            Some(g) => (g.1, g.2) = (form, found.amplitude),
            None => groups.push((group, form, found.amplitude)),
        }
    }
    for (group, form, amplitude) in groups {
        table.push(TableRow::at_most(group, form, amplitude, BLENDING));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::coupling::BlendingFunction;

    #[test]
    fn a_seam_reflects_less_than_its_limit_and_a_contrast_what_theory_says() {
        let crossing = Crossing {
            method: Method::Splice,
            law: Law::BondBased(Micromodulus::InverseDistance),
            ratio: 3,
            transition: 2,
            width: 4,
            side: Side::Elements,
        };
        let found = crossing.measure().expect("runs");
        assert!(
            found.amplitude < SPLICE && found.amplitude > 1e-5,
            "{found:?}"
        );
        // density 4 times larger beyond the seam: impedance Z = 2, reflected (1 − Z)/(1 + Z) = −1/3
        let mut strip = Strip::new::<1>(&crossing.case(Kind::Local)).expect("builds");
        let mut alone = Strip::new::<1>(&crossing.case(Kind::Local)).expect("builds");
        for (m, x) in strip.motion.mass.iter_mut().zip(&strip.x) {
            if *x > strip.borders[0] {
                *m *= 4.0;
            }
        }
        let ours = crossing.left_behind(&mut strip, 0.9).expect("runs");
        let pure = crossing.left_behind(&mut alone, 0.9).expect("runs");
        let largest = ours
            .iter()
            .map(|(x, (u, _))| (u - pure[x].0).abs())
            .fold(0.0, f64::max);
        assert!((largest - 1.0 / 3.0).abs() < 2e-2, "{largest}");
        let smooth = Crossing {
            method: Method::Blending(BlendingFunction::Smooth),
            width: 8,
            side: Side::Points,
            ..crossing
        };
        let found = smooth.measure().expect("runs");
        assert!(found.amplitude < SPLICE && found.energy < 1e-5, "{found:?}");
    }
}
