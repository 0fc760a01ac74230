//! The moving system of a scene: what moves, with what mass, from where.

use crate::coupling::motion::{BondBehaviour, ContactBehaviour, Motion, MotionError, masses};
use crate::coupling::{Coupling, Interface, Model, Operator};
use crate::observe::summary::Choice;
use crate::peridynamics::kernel::Kinematics;
use crate::progress::Progress;
use crate::scene::initial::{Initial, InitialKind};
use crate::scene::materials::Fracture;
use crate::scene::run::{self, Rest, RunError};
use crate::scene::spec::BondsSpec;
use crate::solve::explicit::State;
use crate::system::{Dynamic, LinearMotion};

/// What moves, and what it holds.
pub(super) struct Moving<'a> {
    /// The system.
    pub system: Box<dyn Dynamic + 'a>,
    /// Bytes of rows and bonds.
    pub bytes: usize,
    /// Whether its force is linear in the displacement.
    pub is_linear: bool,
}

/// What moves: bonds where they can be passed over, the assembled stiffness where they cannot and nothing breaks.
///
/// # Errors
/// [`RunError::Motion`] for bonds that cannot stretch or break, [`RunError::Fracture`].
pub(super) fn dynamic<'a, const D: usize>(
    model: &'a Model<D>,
    coupling: &dyn Coupling<D>,
    operator: &dyn Operator<D>,
    rest: &Rest<D>,
    choices: &mut Vec<Choice>,
    progress: &dyn Progress,
) -> Result<Moving<'a>, RunError> {
    let breaking = &rest.breaking;
    let critical_stretch = critical_stretch(model, rest)?;
    let (bonds, kinematics) = match breaking.bonds {
        BondsSpec::Exact => ("geometrically exact bonds", Kinematics::Exact),
        BondsSpec::Linear => ("bonds linear in the displacement", Kinematics::Linear),
    };
    let breaks = match (critical_stretch, breaking.fracture) {
        (Some(s), Some(Fracture::Energy(g))) => {
            format!("bonds break at the stretch {s:.3e}, the fracture energy is {g:e}")
        }
        (Some(s), _) => format!("bonds break at the stretch {s:.3e}"),
        (None, _) => "no bond breaks: no fracture-energy, no critical-stretch".to_owned(),
    };
    let density = |material: u16| rest.density[material as usize];
    let can_fail_nowhere = |x: &_| breaking.no_fail.iter().any(|r| r.contains(x, 0.0));
    let is_linear = critical_stretch.is_none()
        && breaking.contact.is_none()
        && breaking.bonds == BondsSpec::Linear;
    let moving = Motion::new(
        model,
        operator,
        coupling.symmetry(),
        density,
        &BondBehaviour {
            kinematics,
            critical_stretch,
            no_fail: &can_fail_nowhere,
            contact: breaking.contact.map(|c| ContactBehaviour {
                approach: c.radius_factor,
                stiffness: c.stiffness_factor,
            }),
        },
    );
    match moving {
        Ok(motion) => {
            if model.body().is_some() {
                let at_seam = match (coupling.interface(), motion.has_seam_bonds()) {
                    _ if is_linear => "",
                    (Interface::Faces, true) => "; those cut at the seam likewise",
                    (Interface::Faces, false) => {
                        "; within two horizons of the seam they are linear and do not break"
                    }
                    _ => "",
                };
                choices.push(Choice {
                    choice: bonds.to_owned(),
                    why: breaks + at_seam,
                });
            }
            Ok(Moving {
                bytes: motion.memory_bytes(),
                system: Box::new(motion),
                is_linear,
            })
        }
        Err(error) if is_linear => {
            let stiffness = model.assemble(operator, progress);
            let symmetry = run::symmetry(coupling, || stiffness.asymmetry(), choices);
            choices.push(Choice {
                choice: "assembled stiffness instead of bonds".to_owned(),
                why: reason(&error),
            });
            Ok(Moving {
                bytes: stiffness.values.len() * 8 + stiffness.columns.len() * 4,
                system: Box::new(LinearMotion {
                    mass: masses(model, density),
                    stiffness,
                    symmetry,
                }),
                is_linear,
            })
        }
        Err(error) => Err(error.into()),
    }
}

/// Why bonds are not passed over, without the remedy: nothing is wrong.
fn reason(error: &MotionError) -> String {
    let text = error.to_string();
    let end = text.find(';').unwrap_or(text.len());
    text[..end].to_owned()
}

/// The stretch at which bonds break, if any do.
fn critical_stretch<const D: usize>(
    model: &Model<D>,
    rest: &Rest<D>,
) -> Result<Option<f64>, RunError> {
    let (Some(fracture), Some(body), Some(p)) =
        (rest.breaking.fracture, model.body(), &model.peridynamics)
    else {
        return Ok(None);
    };
    let energy = match fracture {
        Fracture::Stretch(s) => return Ok(Some(s)),
        Fracture::Energy(energy) => energy,
    };
    let horizon = body.cloud.horizon[0];
    match p.law.bond_energy(horizon) {
        Some(bonds) => Ok(Some(bonds.critical_stretch::<D>(energy, horizon)?)),
        None => Err(MotionError::Law { law: p.law.name() }.into()),
    }
}

/// Displacement and velocity at time zero.
pub(super) fn start<const D: usize>(model: &Model<D>, initial: &[Initial<D>]) -> State {
    let mut state = State::at_rest(model.sites.len() * D);
    for field in initial {
        let values = match field.kind {
            InitialKind::Displacement => &mut state.u,
            InitialKind::Velocity => &mut state.v,
        };
        for (site, s) in model.sites.iter().enumerate() {
            if !field.region.contains(&s.position, 0.0) {
                continue;
            }
            for k in 0..D {
                if let Some(value) = field.components.at(k, &s.position) {
                    values[site * D + k] = value;
                }
            }
        }
    }
    state
}
