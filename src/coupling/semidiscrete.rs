//! A coupled model that moves: bonds that stretch, and break, beside the rows of finite elements and of the seam.
//!
//! | file | what |
//! |---|---|
//! | `behaviour.rs` | how bonds deform and break, as a run asks for it |
//! | `body_state.rs` | damage, stresses and memory, as results show them |
//! | `heat.rs`, `heated_forces.rs` | bonds that know their temperature |
//! | `body.rs`, `force_states.rs`, `elements.rs` | the points and their bonds, nonlinear force states, nonlinear finite elements |
//! | `rows.rs`, `tangent_pattern.rs` | linear rows of the sites, blocks of the elements' tangent |
//! | `energy.rs`, `stored_energy.rs`, `dissipation.rs` | energies of elements and bonds, what breaking costs |
//! | `split.rs`, `shared_work.rs`, `own_steps.rs`, `reached_sites.rs`, `spread_families.rs` | the same on several processes |
//!
//! Sites whose row is that of the peridynamic body alone ([`Operator::is_body_row`]) take their force from a pass over the bonds, which may be geometrically exact
//! and break; every other site takes it from its row of the linear stiffness, which those bonds do not enter. At rest both are the operator of the static solve.
//!
//! A seam that has bonds of its own ([`Operator::seam_bonds`]) takes those that are exact or break out of the rows too: what is left are finite elements.

use std::sync::{Arc, PoisonError};

use self::{body::MovingBody, elements::LocalElements, energy::ElementEnergy, rows::SiteRows};
use crate::{
    coupling::{ExactStresses, NonlinearSeam, Operator},
    material::LocalLaw,
    model::Model,
    peridynamics::bond_force::{BondKinematics, BondPass, HeatedBonds},
    system::{
        BlockCsr, BodyState, Dissipation, ElementTangent, FailureUpdate, Halfway, Interval, Ranks,
        SemiDiscrete, SharedSteps, Symmetry,
    },
};
use behaviour::NONE;
pub use behaviour::{
    BondBehaviour, BondThreshold, ContactBehaviour, FreeStretch, StretchOfMaterials, SystemError,
};
pub use rows::scale_rows;

pub(crate) mod behaviour;
mod body;
mod body_state;
mod dissipation;
mod elements;
mod energy;
mod force_states;
mod heat;
mod heated_forces;
mod own_steps;
mod reached_sites;
mod rows;
mod shared_work;
mod split;
mod spread_families;
mod stored_energy;
mod tangent_pattern;

/// A coupled model as a system that moves.
pub struct CoupledSystem<'a, const D: usize> {
    model: &'a Model<D>,
    symmetry: Symmetry,
    mass: Vec<f64>,
    /// Rows of all sites but those of the body alone; of sites that share the body's bonds, what is left of them.
    linear: SiteRows,
    /// Their products, kept between passes.
    products: Vec<f64>,
    body: Option<MovingBody<D>>,
    /// Bonds of the seam, if they are exact or break; the rows are those of the finite elements alone then.
    seam: Option<NonlinearSeam<D>>,
    /// Contribution of the partial stresses of exact bonds beyond the rows, where elements follow the bonds.
    stresses: Option<ExactStresses<D>>,
    energy: ElementEnergy,
    /// Elements whose law is not linear, if there are any.
    elements: Option<LocalElements<D>>,
    /// Free expansion of elements whose law expands by itself; none where nothing expands.
    heat: Option<FreeStretch<D>>,
    /// Distribution of the sites over processes, where several compute them.
    split: Option<split::Split<'a>>,
    /// True if what a run asks of its steps lets each process advance its own sites.
    is_shareable: bool,
    /// Data of steps of which each process takes its own, once these have begun.
    own_steps: Option<own_steps::OwnSteps>,
    /// Dissipation by breaking bonds so far.
    spent: Dissipation,
    /// See [`SemiDiscrete::difference_length`].
    difference_length: Option<f64>,
}

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
        operator: &dyn Operator<D>,
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
        operator: &dyn Operator<D>,
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
        let of_seam = (!is_linear && follows).then(|| operator.seam_bonds());
        let (mut seam, add_rest) = match of_seam.flatten() {
            Some(of_seam) => (Some(of_seam.bonds), Some(of_seam.add_rest)),
            None => (None, None),
        };
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
                seam.let_break(model, body, critical, never);
            }
        }
        let mixed = operator.mixed_rows();
        let linear = SiteRows::assemble(
            sites,
            |site| match seam {
                Some(_) => model.point_of(site).is_none(),
                None => !operator.is_body_row(site),
            },
            |site, row| match (&add_rest, mixed) {
                (Some(add_rest), _) => add_rest(site, row),
                (None, Some(mixed)) if mixed.has_body_bonds(site) => {
                    mixed.add_row_beside_bonds(site, row);
                }
                _ => operator.add_row(site, row),
            },
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
            stresses: match behaviour.kinematics {
                BondKinematics::Exact if model.follows_bonds() => operator.exact_stresses(),
                _ => None,
            },
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

    /// Returns true if the bonds that a seam cuts turn, stretch and break like others.
    pub fn has_seam_bonds(&self) -> bool {
        self.seam.is_some()
    }

    /// Returns true if bonds can break.
    fn breaks(&self) -> bool {
        let body = self.body.as_ref();
        body.is_some_and(|b| b.failure.is_some() || b.damages)
    }

    /// Returns true if the law has history variables.
    fn remembers(&self) -> bool {
        let elements = self.elements.as_ref();
        self.body.as_ref().is_some_and(|b| b.pass.remembers())
            || elements.is_some_and(|e| e.remembers())
    }

    /// Puts the bonds of a state back; false, and nothing changed, if they are those of another model.
    fn restore_bonds(&mut self, state: &[u64]) -> bool {
        let Some(body) = &mut self.body else {
            return state.is_empty();
        };
        let Some(seam) = &mut self.seam else {
            return body.pass.restore_damage(state);
        };
        let of_pass = body.pass.damage_state().len();
        let Some((of_pass, of_seam)) = state.split_at_checked(of_pass) else {
            return false;
        };
        let held = seam.damage_state();
        if !seam.restore_damage(of_seam) {
            return false;
        }
        let fits = body.pass.restore_damage(of_pass);
        if !fits {
            // nothing is changed by a state that does not belong here
            seam.restore_damage(&held);
        }
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

/// Lumped mass of every site \[kg\]: that of its part of the body. All masses add up to that of the body, their first moment too.
pub fn masses<const D: usize>(model: &Model<D>, density: impl Fn(u16) -> f64) -> Vec<f64> {
    let own = model.peridynamic_material();
    model.tributary().masses(own, density)
}

impl<const D: usize> SemiDiscrete for CoupledSystem<'_, D> {
    fn block(&self) -> usize {
        D
    }

    fn mass(&self) -> &[f64] {
        &self.mass
    }

    fn internal_force_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        interval: Interval,
        update: FailureUpdate,
    ) -> u64 {
        let broken = self.linear_rows_and_bonds_into(u, force, interval, update);
        if let Some(elements) = &mut self.elements {
            elements.add_force(self.model, u, interval, force);
        }
        self.finish(force);
        broken
    }

    fn shared_steps(&mut self) -> Option<&mut dyn SharedSteps> {
        let may_share = || self.split.is_some() && self.may_share_steps();
        match self.own_steps.is_some() || may_share() {
            true => Some(self),
            false => None,
        }
    }

    fn sites_reached(&self, own: &[bool]) -> Option<Vec<bool>> {
        self.may_share_steps().then(|| self.reached_from(own).sites)
    }

    fn element_tangent(&self, u: &[f64], interval: Interval) -> Option<ElementTangent> {
        let elements = self.elements.as_ref()?;
        let is_whole = self.body.is_none();
        Some(elements.tangent(self.model, u, interval.length, is_whole))
    }

    fn force_beside_elements_into(&mut self, u: &[f64], force: &mut [f64], interval: Interval) {
        self.linear_rows_and_bonds_into(u, force, interval, FailureUpdate::Frozen);
        self.finish(force);
    }

    fn take_heat_work(&mut self) -> f64 {
        let pass = self.body.as_mut().and_then(|body| body.pass.heated());
        pass.map_or(0.0, HeatedBonds::take_heat_work)
    }

    fn force_of_heating_into(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        from: Option<f64>,
        to: f64,
    ) -> bool {
        self.extrapolate_heating(u, force, from, to)
    }

    fn commit(&mut self) {
        if let Some(body) = &mut self.body {
            self.spent.inelastic += body.pass.commit();
        }
        if let Some(elements) = &mut self.elements {
            self.spent.inelastic += elements.commit();
        }
    }

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let Some(body) = &self.body else {
            self.linear.multiply_into::<D>(x, None, &mut Vec::new(), y);
            self.finish(y);
            return;
        };
        let mut points = vec![0.0; body.displacement.len()];
        let mut force = points.clone();
        body.spread(x, &mut points);
        body.pass.tangent_into(&points, &mut force);
        let bonds = Some((&body.bonds_of_site[..], &force[..]));
        self.linear.multiply_into::<D>(x, bonds, &mut Vec::new(), y);
        body.add_feet(&force, y);
        if let Some(seam) = &self.seam {
            seam.add_tangent(x, y);
        }
        self.finish(y);
    }

    fn difference_length(&self) -> Option<f64> {
        self.difference_length
    }

    fn row_sums(&self) -> Vec<f64> {
        let mut sums = self.linear.row_sums::<D>();
        let Some(body) = &self.body else { return sums };
        let points = body.pass.row_sums();
        // a point that follows sites spreads its column over them: at most the sum of its weights' sizes
        let spread = (0..body.site_of_point.len())
            .map(|p| match &body.transfer {
                Some(transfer) => transfer.row(p).map(|(_, w)| w.abs()).sum::<f64>(),
                None => 0.0,
            })
            .fold(1.0, f64::max);
        let contact = body
            .contact
            .as_ref()
            .map(|c| c.lock().unwrap_or_else(PoisonError::into_inner));
        for (sums, &point) in sums.chunks_exact_mut(D).zip(&body.bonds_of_site) {
            if point == NONE {
                continue;
            }
            let point = point as usize;
            let touching = contact.as_ref().map_or(0.0, |c| c.row_sum(point));
            for (sum, of_bonds) in sums.iter_mut().zip(&points[point * D..]) {
                *sum += of_bonds * spread + touching;
            }
        }
        body.add_row_sums_of_feet(&points, spread, &mut sums);
        if let Some(seam) = &self.seam {
            seam.add_row_sums(&mut sums);
        }
        scale_rows(self.model, &mut sums);
        sums
    }

    fn contact_frequency_bound(&self) -> f64 {
        let Some(body) = &self.body else { return 0.0 };
        let Some(contact) = &body.contact else {
            return 0.0;
        };
        let contact = contact.lock().unwrap_or_else(PoisonError::into_inner);
        let scale = self.model.row_scale();
        let factor = |site: usize| scale.map_or(1.0, |scale| scale[site]);
        body.bonds_of_site
            .iter()
            .zip(&self.mass)
            .enumerate()
            .filter(|(_, (point, _))| **point != NONE)
            .map(|(site, (&point, mass))| factor(site) * contact.stiffest(point as usize) / mass)
            .fold(0.0, f64::max)
    }

    fn drag_rate_bound(&self) -> f64 {
        let Some(body) = &self.body else { return 0.0 };
        // a point that is no site has no row
        let mass = |point: usize| match body.site_of_point[point] {
            NONE => f64::INFINITY,
            site => self.mass[site as usize],
        };
        body.pass.drag_rate(&mass)
    }

    fn tangent_is_constant(&self) -> Vec<bool> {
        let breaks = self.breaks();
        let at_seam = |site: usize| self.seam.as_ref().is_some_and(|s| s.touches(site));
        let bends = |site: usize| {
            let elements = self.elements.as_ref();
            elements.is_some_and(|e| e.touches(self.model, site))
        };
        (0..self.mass.len())
            .map(|site| (!breaks || (self.linear.has(site) && !at_seam(site))) && !bends(site))
            .collect()
    }

    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr {
        self.rows_at(sites)
    }

    fn rows_that_expand(&self, sites: &[u32]) -> BlockCsr {
        match self.has_heated_bonds() {
            true => self.rows_beside_heated_bonds(sites),
            false => self.rows_at(sites),
        }
    }

    fn seam_sites(&self) -> Vec<u32> {
        let sites = 0..self.mass.len() as u32;
        sites
            .filter(|&s| self.linear.has(s as usize) && !self.energy.is_inner(s))
            .collect()
    }

    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let beyond = self.elements.as_ref().map(|e| e.stored(self.model, u));
        self.energy_of_linear_elements_and_bonds(u) + beyond.unwrap_or(0.0)
    }

    fn dissipation(&self) -> Option<Dissipation> {
        (self.breaks() || self.remembers()).then_some(self.spent)
    }

    fn set_dissipation(&mut self, dissipation: Dissipation) {
        self.spent = dissipation;
    }

    fn account_for_breaks(&mut self, at: &Halfway<'_>) {
        let spent = self.of_last_breaks(at);
        self.spent.energy += spent.energy;
        self.spent.area += spent.area;
    }

    fn body_state(&self) -> Option<&dyn BodyState> {
        Some(self)
    }

    fn damage_state(&self) -> Vec<u64> {
        let mut state = self
            .body
            .as_ref()
            .map_or_else(Vec::new, |b| b.pass.damage_state());
        if let Some(seam) = &self.seam {
            state.extend(seam.damage_state());
        }
        if let Some(elements) = &self.elements {
            state.extend(elements.state());
        }
        if self.spends() > 0 {
            let spent = [self.spent.energy, self.spent.area, self.spent.inelastic];
            state.extend(&spent.map(f64::to_bits)[..self.spends()]);
        }
        state
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        let Some(bonds) = state.len().checked_sub(self.spends()) else {
            return false;
        };
        let (bonds, spent) = state.split_at(bonds);
        let words = self.elements.as_ref().map_or(0, LocalElements::words);
        let Some(of_bonds) = bonds.len().checked_sub(words) else {
            return false;
        };
        let (bonds, of_elements) = bonds.split_at(of_bonds);
        let fits = self.restore_bonds(bonds);
        if let (true, Some(elements)) = (fits, &mut self.elements) {
            elements.restore(of_elements);
        }
        if let (true, &[energy, area, ref rest @ ..]) = (fits, spent) {
            self.spent = Dissipation {
                energy: f64::from_bits(energy),
                area: f64::from_bits(area),
                inelastic: rest.first().map_or(0.0, |bits| f64::from_bits(*bits)),
            };
        }
        fits
    }
}
