//! Summary of one run in time: the reason why it ended, its energies, growth without work, rotation.

use std::fmt;

use serde::Serialize;

use super::cracks::CrackSummary;
use super::report::{components, grouped, number};
use super::rezoning_event::{self, Switch};
use super::warning::{Code, Quantity, Warning};
use crate::system::Traffic;

/// Reason why a run in time ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// It reached the end of the scene.
    Finished,
    /// It was interrupted; its checkpoint takes it up again.
    Interrupted,
    /// Damage reached the edge of the nonlocal zone.
    DamageAtEdge,
    /// The motion gained more energy without work than the scene allows.
    EnergyGained,
    /// An element rotated more than the scene allows.
    ElementsRotated,
    /// The body has parted: load steps that are left would move what no longer resists.
    Parted,
}

/// Energy that a motion gained without work: by a coupling of unsymmetric stiffness, or by a step that has become too large for its law.
///
/// Parts are those of the largest energy so far, or of the work where that is larger.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergyGain {
    /// The largest part; negative where energy was only lost.
    pub largest: f64,
    /// The step at which it was found.
    pub step: u64,
    /// The time of that step.
    pub time: f64,
    /// The part at which the run stops.
    pub limit: f64,
    /// Step and time at which it first went beyond 1 %.
    pub first_told: Option<(u64, f64)>,
    /// True if the undeformed body could not gain any: a law that changes with the strain then does.
    pub by_law: bool,
}

impl EnergyGain {
    /// Returns the warning of a summary, from 1 % on.
    pub fn warning(&self) -> Option<Warning> {
        let (step, time) = self.first_told?;
        let cause = match self.by_law {
            true => {
                "the step is too large for what happens within it: a material that stiffens with its strain, bonds that break, or contact; results from there on are not to be trusted: take a smaller solve.explicit.step-fraction"
            }
            false => {
                "the stiffness is not symmetric, and the seam feeds its modes; results from there on are not to be trusted: make the run shorter, or use coupling.truncated"
            }
        };
        Some(Warning::new(Code::EnergyGain, format!(
            "the motion gained {:.1} % of its largest energy without work by step {}, t = {} (1 % at step {step}, t = {}): {cause}",
            100.0 * self.largest,
            self.step,
            number(self.time),
            number(time)
        )).of(Quantity::Energy, self.largest))
    }
}

/// The largest rotation of an element or a point that is for small rotations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rotation {
    /// The angle in degrees.
    pub degrees: f64,
    /// The centre of the element, or the point.
    pub place: Vec<f64>,
    /// Step and time, of a run in time or under a load that grows.
    pub when: Option<(u64, f64)>,
    /// Relative error of lengths by kinematics of small rotations at this angle, `1/cos θ − 1`.
    pub length_error: f64,
    /// That over the stretch at which the bonds beside them break or soften, where it is a tenth or more.
    pub of_failure: Option<f64>,
    /// Energy of the misfit between elements and a zone of exact bonds, as a part of the largest energy of the run; none where bonds are linear as well, or nothing moves.
    pub energy_error: Option<f64>,
    /// Keys of the scene that let it rotate, in words.
    pub remedy: String,
}

impl Rotation {
    /// Returns the warning of a summary.
    pub fn warning(&self) -> Warning {
        let when = self.when.map_or_else(String::new, |(step, time)| {
            format!(" at step {step}, t = {}", number(time))
        });
        let failure = self.of_failure.map_or_else(String::new, |part| {
            format!(
                ", {} of the stretch at which bonds beside them fail",
                number(part)
            )
        });
        let energy = match self.energy_error {
            Some(part) if part < 1.0 => format!(
                "; against the exact bonds of the nonlocal zone that takes an estimated {} % of the energy of the run",
                number(100.0 * part)
            ),
            Some(_) => "; against the exact bonds of the nonlocal zone that takes all of the energy of the run"
                .to_owned(),
            None => String::new(),
        };
        Warning::new(Code::Rotation, format!(
            "the body at ({}) has rotated by {:.1} degrees{when}: what is for small rotations there, elements or points, is {} % too large, and its stress, linear, has turned to first order only, off by that part of its stiffness{failure}{energy}; where that matters use {}",
            components(&self.place),
            self.degrees,
            number(100.0 * self.length_error),
            self.remedy
        )).of(Quantity::Displacement, self.length_error).at(self.place.as_slice())
    }
}

/// Motion and contact force of a rigid impactor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImpactorSummary {
    /// Its name.
    pub name: String,
    /// Its position at the end \[m\].
    pub position: Vec<f64>,
    /// Its velocity at the end \[m/s\].
    pub velocity: Vec<f64>,
    /// Its momentum at the end \[kg m/s\]; none of one whose motion is prescribed.
    pub momentum: Option<Vec<f64>>,
    /// Momentum that it has transferred to the body \[kg m/s\]; none as above.
    pub transferred: Option<Vec<f64>>,
    /// The largest force between it and the body \[N\]; zero if they never touched.
    pub peak_force: f64,
    /// Time of that force \[s\].
    pub peak_time: f64,
    /// Nodes and points that touched it then.
    pub peak_sites: u64,
}

impl ImpactorSummary {
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = format!("impactor {}", self.name);
        match self.peak_force > 0.0 {
            true => write!(
                f,
                "{name:<22} peak force {} at t = {} on {} {}",
                number(self.peak_force),
                number(self.peak_time),
                self.peak_sites,
                if self.peak_sites == 1 {
                    "site"
                } else {
                    "sites"
                }
            )?,
            false => write!(f, "{name:<22} has not touched the body")?,
        }
        match &self.transferred {
            Some(given) => writeln!(f, ", momentum given ({})", components(given)),
            None => writeln!(f),
        }
    }
}

/// Results of a scene in time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MotionSummary {
    /// Reason why it ended.
    pub ended: Ended,
    /// Steps since the beginning, those before a checkpoint included.
    pub steps: u64,
    /// Steps to the end of the scene.
    pub of_steps: u64,
    /// Time reached.
    pub time: f64,
    /// The time step.
    pub step: f64,
    /// The largest step that is taken to be stable; none where load steps are solved.
    pub stable_step: Option<f64>,
    /// Kinetic energy at the end.
    pub kinetic_energy: f64,
    /// Energy stored in the bodies at the end.
    pub stored_energy: f64,
    /// Work of loads and supports.
    pub external_work: f64,
    /// Energy at the start and work, less kinetic and stored energy: the energy of broken bonds, and that gained or lost at the seam.
    pub missing_energy: f64,
    /// Energy gained without work; none of a motion whose balance closes by construction.
    pub energy_gain: Option<EnergyGain>,
    /// Energy and area of broken bonds; none where none can break.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cracks: Option<CrackSummary>,
    /// Energy that a law with memory dissipated \[J\].
    pub inelastic_energy: Option<f64>,
    /// Motion and contact force of each rigid impactor.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub impactors: Vec<ImpactorSummary>,
    /// Bonds broken, each once for each direction.
    pub broken_bonds: u64,
    /// Time at which damage reached the edge of the nonlocal zone, and the place.
    pub edge_reached: Option<(f64, Vec<f64>)>,
    /// Steps per second of this run, writing included.
    pub steps_per_second: f64,
    /// Changes of the nonlocal zone, and their cost, of a zone that follows the crack.
    pub switches: Vec<Switch>,
    /// Share of the nonlocal zone in the body's volume at the start, its maximum, and at the end.
    pub nonlocal_share: [f64; 3],
    /// Data that each of several processes exchanged for its steps, by their number; none where each has the numbers of all sites in every step.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub processes: Vec<Traffic>,
}

impl MotionSummary {
    /// Returns the warning of damage at the edge of the zone, if there is any.
    pub fn edge_warning(&self) -> Option<Warning> {
        let (time, place) = self.edge_reached.as_ref()?;
        let message = format!(
            "damage reached the edge of the nonlocal zone at t = {}, ({}): enlarge [zones.nonlocal] there",
            number(*time),
            components(place)
        );
        Some(Warning::new(Code::DamageAtEdge, message).at(place.as_slice()))
    }

    pub(super) fn write(&self, dimension: usize, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = self.stable_step.map_or_else(String::new, |stable| {
            format!(" ({:.1} % of the stable step)", 100.0 * self.step / stable)
        });
        writeln!(
            f,
            "time                   {} after {} of {} steps of {}{share}",
            number(self.time),
            self.steps,
            self.of_steps,
            number(self.step)
        )?;
        writeln!(
            f,
            "speed                  {} steps/s",
            number(self.steps_per_second)
        )?;
        self.write_energies(dimension, f)?;
        self.impactors.iter().try_for_each(|i| i.write(f))?;
        if self.broken_bonds > 0 {
            writeln!(
                f,
                "broken bonds           {}",
                grouped(self.broken_bonds as usize)
            )?;
        }
        rezoning_event::write(&self.switches, self.nonlocal_share, f)?;
        match self.ended {
            Ended::Finished => Ok(()),
            Ended::Interrupted => writeln!(f, "interrupted            go on with --resume"),
            Ended::DamageAtEdge => writeln!(
                f,
                "stopped                where damage reached that edge; zones.damage-at-edge = \"warn\" goes on"
            ),
            Ended::EnergyGained => {
                let limit = self.energy_gain.map_or(0.0, |g| g.limit);
                writeln!(
                    f,
                    "stopped                where energy gained without work passed {} % of the largest; solve.explicit.largest-energy-gain sets the part",
                    number(100.0 * limit)
                )
            }
            Ended::ElementsRotated => writeln!(
                f,
                "stopped                where an element rotated beyond largest-rotation"
            ),
            Ended::Parted => writeln!(
                f,
                "ended                  with the body parted: it stores less than a thousandth of its largest energy, {} load steps are left; solve.quasi-static.when-parted = \"continue\" takes them",
                self.of_steps - self.steps
            ),
        }
    }

    fn write_energies(&self, dimension: usize, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, value) in [
            ("kinetic energy", self.kinetic_energy),
            ("stored energy", self.stored_energy),
            ("external work", self.external_work),
        ] {
            writeln!(f, "{name:<22} {}", number(value))?;
        }
        // of bonds that lose their stiffness by the law, breaking takes nothing more
        let by_law_alone = self.inelastic_energy.is_some();
        let cracks = self.cracks.as_ref();
        if let Some(cracks) = cracks.filter(|c| c.dissipated_energy != 0.0 || !by_law_alone) {
            cracks.write(dimension, f)?;
        }
        if let Some(energy) = self.inelastic_energy {
            writeln!(f, "dissipated by the law  {}", number(energy))?;
        }
        // load steps leave out the motion of what breaks
        let rest = match self.stable_step {
            None if self.cracks.is_some() => "set free by breaking",
            _ => "energy not accounted",
        };
        let dissipated =
            self.cracks.map_or(0.0, |c| c.dissipated_energy) + self.inelastic_energy.unwrap_or(0.0);
        writeln!(f, "{rest:<22} {}", number(self.missing_energy - dissipated))?;
        Ok(())
    }
}
