//! Deformation that the points of the generic pass carry where their bonds break ([`super::carried_deformation`]).

use super::generic::{Generic, at};
use crate::{
    peridynamics::shape_tensor::spanned_inverse,
    tensor::{Tensor, Vector, inverse},
};

impl<const D: usize> Generic<D> {
    /// C less the identity of a point; none where nothing is carried.
    pub(super) fn carried_of(&self, i: usize) -> Option<&Tensor<D>> {
        let all = self.carried.as_ref()?;
        Some(&all.kept[i]).filter(|c| **c != Tensor::<D>::zeros())
    }

    /// The same before the last break.
    pub(super) fn carried_before(&self, i: usize) -> Option<&Tensor<D>> {
        let all = self.carried.as_ref()?;
        let place = all.before.binary_search_by_key(&(i as u32), |b| b.0);
        let before = place.map_or(&all.kept[i], |k| &all.before[k].1);
        Some(before).filter(|c| **c != Tensor::<D>::zeros())
    }

    /// `F̄ − I` of the intact bonds.
    pub(super) fn intact_gradient(&self, i: usize, u: &[f64]) -> Option<Tensor<D>> {
        let whole = &self.state[i].as_ref()?.shape;
        let (mut left, mut sum) = (Tensor::zeros(), Tensor::zeros());
        let here: Vector<D> = at(u, i);
        for bond in self.range(i).filter(|&bond| self.intact[bond]) {
            let j = self.neighbour(bond);
            let xi = self.xi(i, j).transpose() * (self.omega[bond] * self.volume[j]);
            left += self.xi(i, j) * xi;
            sum += (at::<D>(u, j) - here) * xi;
        }
        Some(sum * spanned_inverse(whole, Some(&left))?)
    }

    /// Returns true if the local law of a point holds for strains of any size.
    pub(super) fn is_finite_strain(&self, i: usize) -> bool {
        let material = self.material.get(i).copied().unwrap_or(0);
        let states = self.law.force_state();
        let point = states.and_then(|states| states.correspondence(Some(material)));
        point.is_some_and(|point| point.law.is_objective())
    }

    /// Breaks the bonds of `self.last`; points that have flowed keep the deformation that they had.
    pub(super) fn break_last(&mut self, u: &[f64]) {
        let Some(mut carried) = self.carried.take() else {
            for &(_, bond) in &self.last {
                self.intact[bond] = false;
            }
            return;
        };
        let (place, kept) = (carried.place, self.layout.point.len());
        let of_points = self.last.chunk_by(|a, b| a.0 == b.0).map(|of| of[0].0);
        let flowed = of_points.filter(|&i| self.past.point[i as usize * kept + place] > 0.0);
        let before: Vec<_> = flowed
            .map(|i| (i, self.intact_gradient(i as usize, u)))
            .collect();
        for &(_, bond) in &self.last {
            self.intact[bond] = false;
        }
        carried.before.clear();
        for (i, before) in before {
            let point = i as usize;
            let c = carried.kept[point];
            carried.before.push((i, c));
            // a family that does not span the space has no stress, and carries nothing on
            let after = self.intact_gradient(point, u);
            carried.kept[point] = match (before, after) {
                (Some(before), Some(after)) if self.is_finite_strain(point) => {
                    let deformed = Tensor::identity() + before;
                    let felt = deformed + deformed * c;
                    let back = inverse(&(Tensor::identity() + after));
                    back.map_or(c, |(back, _)| back * felt - Tensor::identity())
                }
                (Some(before), Some(after)) => before + c - after,
                _ => c,
            };
        }
        self.carried = Some(carried);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        BondKinematics, BondPass, FailureUpdate, ForceStates, Interval,
        point_forces_tests::{CONSTANTS, pass, step},
        reference_force::{Case, H, case, noise},
    };
    use super::*;
    use crate::peridynamics::{ZeroEnergyControl, laws::Named};

    /// A pass over points of J2 plasticity that have flowed; bonds that are long at `u` have then broken.
    fn torn(
        case: &Case<3>,
        yield_stress: f64,
        strains: f64,
        control: ZeroEnergyControl,
        u: &[f64],
    ) -> (Generic<3>, Vec<[Tensor<3>; 2]>, f64) {
        let place = control as usize as f64;
        let values = [yield_stress, 0.4, 0.0, 0.0, 0.7, strains, place];
        let law = Named::PlasticCorrespondence.build(CONSTANTS, &values);
        let kinematics = match strains > 0.0 {
            true => BondKinematics::Exact,
            false => BondKinematics::Linear,
        };
        let mut pass = pass(case, &law, kinematics, Some(0.15));
        step(&mut pass, u, 0.0);
        pass.commit();
        let kept = pass.layout.point.len();
        for strain in pass.past.point.iter_mut().skip(kept - 1).step_by(kept) {
            *strain = strain.max(0.1);
        }
        let points = 0..case.position.len();
        let stress = |pass: &Generic<3>, i| pass.stress(i, &|j| at(u, j)).tensor;
        let before: Vec<_> = points.clone().map(|i| stress(&pass, i)).collect();
        let stored = pass.stored_energy(u);
        let mut force = vec![0.0; u.len()];
        let changes = pass.force_into(u, &mut force, Interval::AT_ONCE, FailureUpdate::Update);
        let broken = changes.broken;
        assert!(broken > 50, "{broken}");
        let both = points.map(|i| [before[i], stress(&pass, i)]);
        let both = both.collect();
        let released = stored - pass.stored_energy(u);
        (pass, both, released)
    }

    fn cases() -> impl Iterator<Item = (f64, f64, ZeroEnergyControl)> {
        let controls = [ZeroEnergyControl::BondForce, ZeroEnergyControl::Length];
        let strains = [0.0, 1.0].into_iter();
        strains.flat_map(move |large| {
            [0.02, 100.0]
                .into_iter()
                .flat_map(move |yields| controls.map(|c| (yields, large, c)))
        })
    }

    #[test]
    fn the_stress_of_a_point_that_has_flowed_falls_with_its_damage_alone() {
        let case = case([9, 7, 8], 0.2, false);
        let u = noise(case.position.len() * 3, 0.1 * H, 3);
        for (yields, large, control) in cases() {
            let (pass, stresses, released) = torn(&case, yields, large, control, &u);
            let mut torn = 0;
            let lacks = pass.points_without_response(&u) > 0;
            for (i, [before, after]) in stresses.iter().enumerate() {
                let damage = pass.damage_of_point(i);
                let gone = lacks && after.norm() == 0.0;
                if damage == 0.0 || gone {
                    continue;
                }
                torn += 1;
                let off = (after - before * (1.0 - damage)).norm() / before.norm();
                assert!(
                    off < 1e-11,
                    "{yields} {large} {control:?} point {i}: {off:e}"
                );
            }
            assert!(torn > 50, "{torn}");
            let told = pass.lost_energy(&|j| at::<3>(&u, j).into());
            assert!(
                (told - released).abs() < 1e-12 * released.abs(),
                "{told} {released}"
            );
        }
    }

    #[test]
    fn forces_are_the_derivatives_of_the_energy_with_what_is_carried() {
        let case = case([9, 7, 8], 0.2, false);
        let n = case.position.len() * 3;
        let u = noise(n, 0.1 * H, 3);
        // the length control is the force state of the report, which no energy has
        let elastic =
            |c: &(f64, f64, ZeroEnergyControl)| c.0 > 1.0 && c.2 == ZeroEnergyControl::BondForce;
        for (_, large, control) in cases().filter(elastic) {
            let (mut pass, ..) = torn(&case, 100.0, large, control, &u);
            let state = pass.damage_state();
            let direction = noise(n, H, 5);
            let moved = |s: f64| -> Vec<f64> { (0..n).map(|k| u[k] + s * direction[k]).collect() };
            let force = step(&mut pass, &u, 0.0);
            let power: f64 = force.iter().zip(&direction).map(|(f, d)| f * d).sum();
            let slope = |s: f64| {
                (pass.stored_energy(&moved(s)) - pass.stored_energy(&moved(-s))) / (2.0 * s)
            };
            // a difference of fourth order
            let slope = (4.0 * slope(1e-4) - slope(2e-4)) / 3.0;
            // the pass gives what the points exert on their bonds
            let off = (slope - power).abs() / power.abs();
            assert!(off < 1e-8, "{large} {control:?}: {off:e}");
            // the same bits after a restart
            let place = control as usize as f64;
            let law = Named::PlasticCorrespondence
                .build(CONSTANTS, &[100.0, 0.4, 0.0, 0.0, 0.7, large, place]);
            let mut again =
                super::super::point_forces_tests::pass(&case, &law, pass.kinematics, Some(0.15));
            assert!(again.restore_damage(&state));
            assert_eq!(step(&mut again, &u, 0.0), force);
        }
    }
}
