//! The force of laws whose points have a stress: correspondence without a force state per bond.
//!
//! `T_i⟨ξ⟩ = ω (B_i ξ + q_i η)` with one tensor `B` and one number `q` per point, so that two loops over the bonds are enough: one computes the deformation gradient of each family, after which the local law
//! is evaluated once per point; the other adds up the contributions of the neighbours (`point_loops.rs`). The own part of a force, `B_i Σ ω ξ V + q_i Σ ω η V`, needs no second loop. A drag is part of the same loops
//! (`family_control.rs`).
//! The result is that of [`crate::peridynamics::ForceState::respond`] for such laws, bond by bond (`point_forces_tests.rs`).

use rayon::prelude::*;

use super::{
    BondKinematics,
    carried_deformation::{conjugate, felt},
    family_control::FamilyControl,
    generic::{Generic, History, NONE, Outcome},
    point_loops::{self, Bonds, Moments, Sites},
    point_state::{Intact, PointForces},
};
use crate::{
    material::LocalResponse,
    parallel,
    peridynamics::{
        KeptDamage, StatePart,
        body::split_rows,
        failure::{Flow, tension},
        force_state::PLASTIC_STRAIN,
        shape_tensor::spanned_inverse,
        zero_energy::{ZeroEnergyControl, control_left, excess_length},
    },
    system::Interval,
    tensor::{Tensor, Vector},
};

impl<const D: usize> Generic<D> {
    /// Goes back to a force state per bond, with which this is compared.
    #[cfg(test)]
    pub(super) fn by_bonds(&mut self) {
        self.points = None;
        self.force_state = vec![Vector::zeros(); self.families.neighbours.len()];
    }

    /// Takes up which bonds stand: of all points, or of those of `only`.
    pub(super) fn recall_intact(&mut self, only: Option<&[(u32, usize)]>) {
        let Some(mut points) = self.points.take() else {
            return;
        };
        let omega = |bond: usize| match self.intact[bond] {
            true => self.omega[bond],
            false => 0.0,
        };
        let far = |bond: usize| match self.reverse[bond] {
            NONE => 0.0,
            back => omega(back as usize),
        };
        let volume = |bond: usize| self.volume[self.neighbour(bond)];
        match only {
            None => {
                let bonds = 0..self.intact.len();
                let weights = bonds.clone().map(|b| omega(b) * volume(b));
                points.weight = weights.collect();
                points.back.clear();
                if bonds.clone().any(|b| far(b) != omega(b)) {
                    points.back = bonds.map(|b| far(b) * volume(b)).collect();
                }
            }
            Some(broken) => {
                for &(_, bond) in broken {
                    points.weight[bond] = 0.0;
                }
                let back = broken.iter().map(|b| self.reverse[b.1]);
                let back = back.filter(|b| *b != NONE).map(|b| b as usize);
                if points.back.is_empty() && back.clone().any(|b| self.intact[b]) {
                    // one end alone broke
                    let all = 0..self.intact.len();
                    points.back = all.map(|b| far(b) * volume(b)).collect();
                } else if !points.back.is_empty() {
                    back.for_each(|b| points.back[b] = 0.0);
                }
            }
        }
        let of_point = |i: usize| self.intact_of(i, &points.weight);
        match only {
            None => points.intact = (0..self.position.len()).map(of_point).collect(),
            Some(broken) => {
                for of in broken.chunk_by(|a, b| a.0 == b.0) {
                    points.intact[of[0].0 as usize] = of_point(of[0].0 as usize);
                }
            }
        }
        self.points = Some(points);
    }

    fn intact_of(&self, i: usize, weights: &[f64]) -> Intact<D> {
        let range = self.range(i);
        let is_whole = range.clone().all(|bond| self.intact[bond]);
        let (mut left, mut first) = (Tensor::zeros(), Vector::zeros());
        for bond in range.filter(|&bond| self.intact[bond]) {
            let j = self.neighbour(bond);
            let xi = self.xi(i, j);
            left += xi * xi.transpose() * weights[bond];
            first += xi * weights[bond];
        }
        let whole = self.state[i].as_ref().map(|state| &state.shape);
        Intact {
            inverse: whole.and_then(|whole| spanned_inverse(whole, (!is_whole).then_some(&left))),
            first,
            damage: match is_whole {
                true => 0.0,
                false => self.lost_share(i, |bond| self.intact[bond]),
            },
        }
    }

    /// The local response of a point whose intact bonds have the displacement gradient `gradient`, the gradient at which the law was evaluated, and whether it is one for strains of any size; none if its family has no response.
    fn local_response(
        &self,
        i: usize,
        gradient: &Tensor<D>,
        damage: f64,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> Option<(LocalResponse<D>, Tensor<D>, bool)> {
        let material = self.material.get(i).copied().unwrap_or(0);
        let states = self.law.force_state()?;
        let stress = states.correspondence(Some(material))?;
        let law = match stress.keeping.filter(|_| self.no_fail[i]) {
            Some(keeping) => keeping,
            None => stress.law,
        };
        let objective = law.is_objective();
        let felt = felt(gradient, self.carried_of(i), objective);
        let found = law.respond(&felt, step, past, present);
        if damage > 0.0 && !found.stored.is_finite() {
            // what is left of the family is turned inside out
            present.copy_from_slice(past);
            return None;
        }
        Some((found, felt, objective))
    }

    /// Stress and history of all points at the end of a step.
    pub(super) fn respond_points(
        &mut self,
        points: &mut PointForces<D>,
        u: &[f64],
        interval: Interval,
    ) {
        let mut present = std::mem::take(&mut self.present);
        let mut outcome = std::mem::take(&mut self.outcome);
        let kept = self.layout.point.len();
        let offsets: Vec<usize> = (0..=outcome.len()).map(|i| i * kept).collect();
        let histories = split_rows(&mut present.point, &offsets);
        let velocity = points.drag.as_mut().map(|drag| drag.moved(u, interval));
        points.sites.set(&self.position, u, velocity);
        let PointForces {
            weight,
            intact,
            given,
            strength,
            gradient,
            own,
            sites,
            ..
        } = points;
        let flows = self.layout.point.iter().position(|n| *n == PLASTIC_STRAIN);
        let flows = flows.filter(|_| self.failure.reads().flow);
        let all = given.by_points(D).zip(strength).zip(gradient).zip(own);
        let all = all.zip(histories).zip(&mut outcome).enumerate();
        parallel::for_each(all.with_min_len(16), |(i, point)| {
            let (((((given, strength), gradient), own), present), outcome) = point;
            given.fill(0.0);
            (*strength, *own, *outcome) = (0.0, Vector::zeros(), Outcome::default());
            let past = &self.past.point[i * kept..(i + 1) * kept];
            present.copy_from_slice(past);
            let (Some(inverse), Some(state)) = (intact[i].inverse, &self.state[i]) else {
                return;
            };
            let moments = self.moments(i, weight, sites);
            *gradient = moments.displacement * inverse;
            let damage = intact[i].damage;
            let Some((found, felt, objective)) =
                self.local_response(i, gradient, damage, interval.length, past, present)
            else {
                return;
            };
            let left = 1.0 - damage;
            outcome.dissipated = left * found.dissipated * self.volume[i];
            // the control of a point that is damaged fades from step to step
            let (fade, faded) = self.fades(past, present);
            if faded < fade {
                let squares = self.control_squares(i, points.control, state, weight, gradient, u);
                outcome.dissipated += 0.5 * (fade - faded) * squares * self.volume[i];
            }
            if let Some(place) = flows {
                let tension = || tension(&found.principal_stresses(&felt, objective));
                outcome.flow = Flow::new([past[place], present[place]], tension);
            }
            let through = conjugate(&found.stress, self.carried_of(i), objective) * inverse * left;
            let first = &intact[i].first;
            let control = match points.control {
                ZeroEnergyControl::BondForce => {
                    FamilyControl::bond_force(&moments, first, gradient, fade * state.stabilisation)
                }
                ZeroEnergyControl::Length => FamilyControl::by_pairs(fade * state.control),
                ZeroEnergyControl::Drag => {
                    FamilyControl::drag(&moments, first, self.kinematics, fade * state.control)
                }
            };
            outcome.dissipated += control.power * interval.length * self.volume[i];
            *strength = control.strength;
            *own = through * first + control.own;
            control.give(&through, given);
        });
        self.present = present;
        self.outcome = outcome;
    }

    /// The sums over a family.
    fn moments(&self, i: usize, weights: &[f64], sites: &Sites) -> Moments<D> {
        let is_small = self.kinematics == BondKinematics::Linear;
        point_loops::moments(self.bonds_of(i, weights), sites, is_small)
    }

    fn bonds_of<'a>(&'a self, i: usize, weights: &'a [f64]) -> Bonds<'a> {
        let range = self.range(i);
        Bonds {
            point: i,
            far: &self.families.neighbours[range.clone()],
            weights: &weights[range],
        }
    }

    /// Goes over a family's bonds: far point, weight, ξ and η of each.
    #[inline(always)]
    pub(super) fn each_bond(
        &self,
        i: usize,
        weights: &[f64],
        u: &[f64],
        mut f: impl FnMut(usize, f64, &[f64; D], &[f64; D]),
    ) {
        let range = self.range(i);
        let here: [f64; D] = self.position[i].into();
        let moved: [f64; D] = std::array::from_fn(|a| u[i * D + a]);
        let far = self.families.neighbours[range.clone()].iter();
        for (&j, &weight) in far.zip(&weights[range]) {
            let j = j as usize;
            let (there, far) = (&self.position[j], &u[j * D..(j + 1) * D]);
            let xi = std::array::from_fn(|a| there[a] - here[a]);
            let eta = std::array::from_fn(|a| far[a] - moved[a]);
            f(j, weight, &xi, &eta);
        }
    }

    /// `−V_i Σ V_j (T_i⟨ξ⟩ − T_j⟨−ξ⟩)` of the points with rows.
    pub(super) fn gather_points(&self, points: &PointForces<D>, u: &[f64], force: &mut [f64]) {
        parallel::for_each_chunk(force, D, 64, |i, force| {
            force.fill(0.0);
            if !self.row[i] {
                return;
            }
            let mut sum: [f64; D] = points.own[i].into();
            let far = self.bonds_of(i, points.back());
            let given = point_loops::taken::<D>(far, &points.sites, &points.given);
            sum.iter_mut()
                .zip(given)
                .for_each(|(sum, given)| *sum += given);
            if points.control == ZeroEnergyControl::Length {
                self.add_lengths(points, i, u, &mut sum);
            }
            for (force, sum) in force.iter_mut().zip(sum) {
                *force = -self.volume[i] * sum;
            }
        });
    }

    /// Adds the force states of the length control of both ends.
    fn add_lengths(&self, points: &PointForces<D>, i: usize, u: &[f64], sum: &mut [f64; D]) {
        let start = self.range(i).start;
        let mut bond = start;
        let back = points.back();
        self.each_bond(i, &points.weight, u, |j, own, xi, eta| {
            let (xi, eta) = (Vector::from(*xi), Vector::from(*eta));
            let of = |p: usize| {
                let strength = points.strength[p];
                strength * excess_length(&xi, &eta, &points.gradient[p], self.kinematics)
            };
            let along = match self.kinematics {
                BondKinematics::Exact => xi + eta,
                BondKinematics::Linear => xi,
            };
            let size = (own * of(i) + back[bond] * of(j)) / along.norm();
            if size != 0.0 {
                (0..D).for_each(|a| sum[a] += size * along[a]);
            }
            bond += 1;
        });
    }

    /// Energy that a point stores \[J\], with the history `past` and without letting time pass; `sites` have the displacements `u`.
    pub(super) fn point_energy(
        &self,
        points: &PointForces<D>,
        i: usize,
        (u, sites): (&[f64], &Sites),
        past: &History,
        present: &mut Vec<f64>,
    ) -> f64 {
        let Intact {
            inverse, damage, ..
        } = &points.intact[i];
        let (Some(inverse), Some(state)) = (inverse, &self.state[i]) else {
            return 0.0;
        };
        let kept = self.layout.point.len();
        let past = &past.point[i * kept..(i + 1) * kept];
        present.clear();
        present.extend(past);
        let gradient = self.moments(i, &points.weight, sites).displacement * inverse;
        let Some((found, ..)) = self.local_response(i, &gradient, *damage, 0.0, past, present)
        else {
            return 0.0;
        };
        let (control, weights) = (points.control, &points.weight);
        let squares = self.control_squares(i, control, state, weights, &gradient, u);
        let fade = self.fades(past, past).0;
        ((1.0 - damage) * found.stored + 0.5 * fade * squares) * self.volume[i]
    }

    /// Returns the remaining share of the control of a point over a step, and after it ([`control_left`]).
    fn fades(&self, past: &[f64], present: &[f64]) -> (f64, f64) {
        match self.layout.damage {
            Some(KeptDamage::Point(place)) => {
                (control_left(past[place]), control_left(present[place]))
            }
            _ => (1.0, 1.0),
        }
    }

    /// Twice the energy density of the control of a point that is undamaged \[J/m^D\].
    fn control_squares(
        &self,
        i: usize,
        control: ZeroEnergyControl,
        state: &StatePart<D>,
        weights: &[f64],
        gradient: &Tensor<D>,
        u: &[f64],
    ) -> f64 {
        let mut squares = 0.0;
        self.each_bond(i, weights, u, |_, w, xi, eta| {
            let (xi, eta) = (Vector::from(*xi), Vector::from(*eta));
            squares += w * match control {
                ZeroEnergyControl::BondForce => {
                    state.stabilisation * (eta - gradient * xi).norm_squared()
                }
                ZeroEnergyControl::Length => {
                    let excess = excess_length(&xi, &eta, gradient, self.kinematics);
                    state.control * excess * excess
                }
                ZeroEnergyControl::Drag => 0.0,
            };
        });
        squares
    }
}
