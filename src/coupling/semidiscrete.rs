//! A coupled model in motion: bonds that stretch and break, beside the linear rows of finite elements and of the seam.
//!
//! | file | content |
//! |---|---|
//! | `behaviour.rs` | deformation and failure of bonds, as a run asks for it |
//! | `body_state.rs` | damage, stresses and history variables, as results show them |
//! | `heat.rs`, `heated_forces.rs` | bonds with thermal expansion |
//! | `construction.rs`, `pass_input.rs` | masses, rows and bonds of the model; input of the bond pass |
//! | `body.rs`, `force_states.rs`, `elements.rs` | the points and their bonds, nonlinear force states, nonlinear finite elements |
//! | `rows.rs`, `tangent_pattern.rs` | linear rows of the sites, blocks of the elements' tangent |
//! | `energy.rs`, `stored_energy.rs`, `dissipation.rs` | energies of elements and bonds, dissipation by breaking |
//! | `split.rs`, `shared_work.rs`, `own_steps.rs`, `reached_sites.rs`, `spread_families.rs` | the same on several processes |
//!
//! Sites whose row is that of the peridynamic body alone ([`BondsOfSite::Alone`](crate::coupling::BondsOfSite::Alone)) take their force from a pass over the bonds, which may be geometrically exact
//! and may break. Every other site takes it from its row of the linear stiffness, which does not contain those bonds. At rest both together are the operator of the static solution.
//!
//! If the bonds that a seam cuts are exact or break ([`Term::SeamBonds`](crate::coupling::Term::SeamBonds)), they leave the rows too, and only finite elements remain there.

use std::sync::PoisonError;

use self::{body::MovingBody, elements::LocalElements, energy::ElementEnergy, rows::SiteRows};
use crate::{
    coupling::{ExactStresses, NonlinearSeam},
    model::Model,
    peridynamics::bond_force::HeatedBonds,
    system::{
        BlockCsr, BodyHistory, BodyState, BondChanges, Dissipation, ElementTangent, FailureUpdate,
        Halfway, Interval, RateBounds, SemiDiscrete, SharedSteps, Symmetry, Tangent,
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
mod construction;
mod dissipation;
mod elements;
mod energy;
mod force_states;
mod heat;
mod heated_forces;
mod own_steps;
mod pass_input;
mod reached_sites;
mod rows;
mod shared_work;
mod split;
mod spread_families;
mod stored_energy;
mod tangent_pattern;

/// A coupled model as a semi-discrete system, `M ü = f − F(u)`.
pub struct CoupledSystem<'a, const D: usize> {
    model: &'a Model<D>,
    symmetry: Symmetry,
    /// Lumped mass of each site \[kg\].
    mass: Vec<f64>,
    /// Rows of all sites but those of the body alone, without the bonds that the pass computes.
    linear: SiteRows,
    /// Products of these rows with the displacement, a buffer.
    products: Vec<f64>,
    body: Option<MovingBody<D>>,
    /// Bonds of the seam, if they are exact or break; the rows are then those of the finite elements alone.
    seam: Option<NonlinearSeam<D>>,
    /// Contribution of the partial stresses of exact bonds beyond the rows, where elements follow the bonds.
    stresses: Option<ExactStresses<D>>,
    energy: ElementEnergy,
    /// Elements whose law is not linear, if there are any.
    elements: Option<LocalElements<D>>,
    /// Free thermal expansion, in elements whose law takes it into account; none where nothing expands.
    heat: Option<FreeStretch<D>>,
    /// Distribution of the sites over processes, where several compute them.
    split: Option<split::Split<'a>>,
    /// True if what a run asks of its steps lets each process advance its own sites.
    is_shareable: bool,
    /// Data of steps of which each process takes its own, once these have begun.
    own_steps: Option<own_steps::OwnSteps>,
    /// Dissipation so far, by breaking bonds and by inelastic laws.
    spent: Dissipation,
    /// See [`Tangent::difference_length`].
    difference_length: Option<f64>,
}

/// Lumped mass of every site \[kg\]: that of its part of the body. The sum of all masses and their first moment are those of the body. `density` gives ρ [kg/m^D] of a material's number.
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
    ) -> BondChanges {
        let changes = self.linear_rows_and_bonds_into(u, force, interval, update);
        if let Some(elements) = &mut self.elements {
            elements.add_force(self.model, u, interval, force);
        }
        self.finish(force);
        changes
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

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let beyond = self.elements.as_ref().map(|e| e.stored(self.model, u));
        self.energy_of_linear_elements_and_bonds(u) + beyond.unwrap_or(0.0)
    }

    fn round_off(&self, _u: &[f64]) -> f64 {
        0.0
    }

    fn rate_bounds(&self) -> RateBounds {
        let Some(body) = &self.body else {
            return RateBounds::default();
        };
        // a point that is no site has no row
        let mass = |point: usize| match body.site_of_point[point] {
            NONE => f64::INFINITY,
            site => self.mass[site as usize],
        };
        RateBounds {
            stiffness: self.bound_of_contact(body),
            drag: body.pass.drag_rate(&mass),
        }
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
}

impl<const D: usize> CoupledSystem<'_, D> {
    /// Upper bound of what contact between points may add to the eigenvalues of `M⁻¹ K` \[1/s²\].
    fn bound_of_contact(&self, body: &MovingBody<D>) -> f64 {
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
}

impl<const D: usize> Tangent for CoupledSystem<'_, D> {
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
        // a point that follows sites distributes its column over them: at most by the sum of its weights in absolute values
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

    fn seam_sites(&self) -> Vec<u32> {
        let sites = 0..self.mass.len() as u32;
        sites
            .filter(|&s| self.linear.has(s as usize) && !self.energy.is_inner(s))
            .collect()
    }

    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    fn element_tangent(&self, u: &[f64], interval: Interval) -> Option<ElementTangent> {
        let elements = self.elements.as_ref()?;
        let is_whole = self.body.is_none();
        Some(elements.tangent(self.model, u, interval.length, is_whole))
    }
}

impl<const D: usize> BodyHistory for CoupledSystem<'_, D> {
    fn commit(&mut self) {
        if let Some(body) = &mut self.body {
            self.spent.inelastic += body.pass.commit();
        }
        if let Some(elements) = &mut self.elements {
            self.spent.inelastic += elements.commit();
        }
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
            let spent = [self.spent.energy, self.spent.inelastic];
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
        if let (true, &[energy, ref rest @ ..]) = (fits, spent) {
            self.spent = Dissipation {
                energy: f64::from_bits(energy),
                inelastic: rest.first().map_or(0.0, |bits| f64::from_bits(*bits)),
            };
        }
        fits
    }

    fn body_state(&self) -> Option<&dyn BodyState> {
        Some(self)
    }
}
