//! Construction of a moving model: masses, rows and bonds.

use super::CoupledSystem;
use super::behaviour::{BondBehaviour, SystemError};
use crate::{
    coupling::{
        ExactStresses, NonlinearSeam, Operator, Term,
        semidiscrete::{
            body::MovingBody, elements::LocalElements, energy::ElementEnergy, masses,
            rows::SiteRows,
        },
    },
    material::LocalLaw,
    model::Model,
    peridynamics::bond_force::{BondKinematics, BondPass},
    system::{Dissipation, Ranks, Symmetry},
};
use std::sync::Arc;

/// The displacement over which forces are differenced, over the spacing of the points: differences of the lengths of bonds keep nine digits then, and forces change by no more than
/// that from what is linear.
const DIFFERENCED: f64 = 1e-7;

impl<'a, const D: usize> CoupledSystem<'a, D> {
    /// Lays out masses, rows and bonds.
    ///
    /// `density` gives ρ [kg/m^D] of a material's number; `symmetry` is that of the assembled stiffness.
    ///
    /// # Errors
    /// [`SystemError`] if the bonds cannot be traversed: a horizon that varies, a law without a kernel. A model in which nothing breaks moves as
    /// [`crate::system::LinearMotion`] instead.
    pub fn new(
        model: &'a Model<D>,
        operator: &Operator<'_, D>,
        symmetry: Symmetry,
        density: impl Fn(u16) -> f64 + Sync,
        behaviour: &BondBehaviour<'_, D>,
    ) -> Result<Self, SystemError> {
        Self::of_processes(model, operator, symmetry, density, behaviour, None)
    }

    /// As [`CoupledSystem::new`]; collective, where the families of the model are spread over `ranks`.
    ///
    /// # Errors
    /// As [`CoupledSystem::new`].
    pub fn of_processes(
        model: &'a Model<D>,
        operator: &Operator<'_, D>,
        symmetry: Symmetry,
        density: impl Fn(u16) -> f64 + Sync,
        behaviour: &BondBehaviour<'_, D>,
        ranks: Option<&dyn Ranks>,
    ) -> Result<Self, SystemError> {
        let sites = model.sites.len();
        let law = model.peridynamics.as_ref().map(|p| &p.law);
        let is_linear = behaviour.failure.is_none()
            && behaviour.kinematics == BondKinematics::Linear
            && law.is_none_or(|law| law.is_linear());
        // the pieces of bonds that a seam cuts follow the laws that have accelerators; of any other they stay linear, as where they expand or a state breaks bonds
        let follows = behaviour.suits_accelerators()
            && (model.peridynamics.as_ref()).is_some_and(|p| p.accelerator().is_some());
        let (mut seam, mut stresses) = (None, None);
        for term in &operator.terms {
            match term {
                Term::SeamBonds(bonds) if !is_linear && follows => seam = Some((bonds.in_motion)()),
                Term::Stresses(term)
                    if behaviour.kinematics == BondKinematics::Exact && model.follows_bonds() =>
                {
                    stresses = ExactStresses::new(term);
                }
                Term::Rows(_) | Term::Bonds(_) | Term::SeamBonds(_) | Term::Stresses(_) => {}
            }
        }
        let body = MovingBody::new(model, operator, behaviour, seam.as_ref(), ranks)?;
        if let (Some(seam), Some(body)) = (&mut seam, model.body()) {
            let cloud = &body.cloud;
            seam.follow_motion(behaviour.kinematics);
            if let Some(critical) = &behaviour.failure {
                let material = |p: u32| cloud.material.get(p as usize).copied().unwrap_or(0);
                let critical = |[i, j]: [u32; 2]| {
                    let lattice = cloud.horizon.lattice_of(i as usize);
                    critical.at(lattice, [material(i), material(j)])
                };
                let never = |p: u32| (behaviour.no_fail)(&cloud.position[p as usize]);
                seam.let_break(model, body, (critical, behaviour.softening), never);
            }
        }
        let is_exact_seam = seam.is_some();
        let linear = SiteRows::assemble(
            sites,
            |site| match is_exact_seam {
                true => model.point_of(site).is_none(),
                false => !operator.is_body_row(site),
            },
            |site, row| operator.add_row_beside_bonds(site, is_exact_seam, row),
        );
        let mass = masses(model, density);
        let energy = ElementEnergy::new(model);
        let is_linear_unless_broken = behaviour.kinematics == BondKinematics::Linear
            && behaviour.contact.is_none()
            && law.is_none_or(|law| law.is_linear());
        Ok(Self {
            difference_length: (body.is_some() && !is_linear_unless_broken)
                .then(|| DIFFERENCED * model.spacing()),
            model,
            symmetry,
            mass,
            linear,
            products: Vec::new(),
            body,
            seam,
            stresses,
            energy,
            elements: None,
            heat: behaviour.heat.clone(),
            split: None,
            is_shareable: false,
            own_steps: None,
            spent: Dissipation::default(),
        })
    }

    /// Lets finite elements follow the local laws of their materials, by the number of a material; those that are linear, or that only other rows hold, stay as they are.
    ///
    /// # Errors
    /// [`SystemError::Band`] for an element in which a law that softens would not take its fracture energy.
    pub fn with_local_laws(
        mut self,
        laws: &[Option<Arc<dyn LocalLaw<D>>>],
    ) -> Result<Self, SystemError> {
        self.elements = LocalElements::new(self.model, laws, self.heat.as_ref())?;
        if self.elements.is_some() && self.difference_length.is_none() {
            // there may be no points, and no spacing
            let mesh = &self.model.mesh;
            let cells = 0..mesh.cell_count();
            let volume: f64 = cells.map(|c| mesh.cell_volume(c).abs()).sum();
            let size = (volume / mesh.cell_count() as f64).powf(1.0 / D as f64);
            self.difference_length = Some(DIFFERENCED * size);
        }
        Ok(self)
    }

    /// The pass over the bonds, if there is a peridynamic body.
    pub fn pass(&self) -> Option<&dyn BondPass<D>> {
        self.body.as_ref().map(|b| b.pass.as_ref())
    }

    /// Returns true if bonds soften before they break.
    pub fn softens(&self) -> bool {
        self.body.as_ref().is_some_and(|body| body.softens)
    }

    /// Returns true if the bonds that a seam cuts turn, stretch and break like others.
    pub fn has_seam_bonds(&self) -> bool {
        self.seam.is_some()
    }

    /// Returns true if bonds can break.
    pub(super) fn breaks(&self) -> bool {
        let body = self.body.as_ref();
        body.is_some_and(|b| b.failure.is_some() || b.damages)
    }

    /// Returns true if the law has history variables.
    pub(super) fn remembers(&self) -> bool {
        let elements = self.elements.as_ref();
        self.body.as_ref().is_some_and(|b| b.pass.remembers())
            || elements.is_some_and(|e| e.remembers())
    }

    /// Puts the bonds of a state back; false, and nothing changed, if they are those of another model.
    pub(super) fn restore_bonds(&mut self, state: &[u64]) -> bool {
        let Some(body) = &mut self.body else {
            return state.is_empty();
        };
        let Some(seam) = &mut self.seam else {
            return body.pass.restore_damage(state);
        };
        let held = seam.damage_state();
        let Some((of_pass, of_seam)) = seam.split_state(state) else {
            return false;
        };
        if !seam.restore_damage(of_seam) {
            return false;
        }
        let fits = body.pass.restore_damage(of_pass);
        if !fits {
            // nothing is changed by a state that does not belong here
            seam.restore_damage(&held);
        }
        seam.recall(body.pass.as_ref());
        fits
    }

    /// Bytes held by rows and bonds.
    pub fn memory_bytes(&self) -> usize {
        self.linear.memory_bytes()
            + self.body.as_ref().map_or(0, |b| {
                b.pass.memory_bytes() + (b.displacement.len() + b.force.len()) * 8
            })
            + self.seam.as_ref().map_or(0, NonlinearSeam::memory_bytes)
            + (self.stresses.as_ref()).map_or(0, ExactStresses::memory_bytes)
            + self
                .elements
                .as_ref()
                .map_or(0, LocalElements::memory_bytes)
    }
}
