//! Several materials in one body: each point has the force state of its own material, and bonds between materials of laws that act bond by bond have the mean of their stiffnesses.

use std::sync::Arc;

use crate::{
    material::LocalLaw,
    peridynamics::{
        Accelerator, BondEnergy, CauchyStress, DeformedFamily, Departure, EnergyDensity, Family,
        ForceState, ForceStateKind, HistoryLayout, Influence, Law, LinearForceState, Linearity,
        Mixture, MomentConditions, Parameters, Past, PdError, PointStress, Present, ShellTarget,
        StatePart, StressFit,
    },
    tensor::{Tensor, Tensor4, Vector},
};

/// The stiffness of a bond between two materials, by those of bonds within each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[schemars(rename = "StiffnessSpec")]
pub enum StiffnessMean {
    /// `2 a b/(a + b)`, as of two halves in series.
    #[default]
    #[serde(rename = "harmonic-mean")]
    Harmonic,
    /// `(a + b)/2`.
    #[serde(rename = "arithmetic-mean")]
    Arithmetic,
}

impl StiffnessMean {
    /// The mean of two stiffnesses over the first.
    fn relative(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Harmonic => 2.0 * b / (a + b),
            Self::Arithmetic => 0.5 * (a + b) / a,
        }
    }
}

/// Refusal of a body of points of two materials that have no bonds with each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the materials {first} and {second} cannot share a body of points: {why}")]
pub struct NoMixture {
    /// Number of the one.
    pub first: u16,
    /// Number of the other.
    pub second: u16,
    /// Reason of the refusal.
    pub why: &'static str,
}

/// Several materials of one kind of law, each with its own constants.
///
/// A law whose points have force states of their own needs no rule: `T_i⟨ξ⟩ − T_j⟨−ξ⟩`, [SAND2015-7998] eq. (2.5), takes each from its own material, and a bond between two materials has half of its stiffness from either.
/// Of a law that acts bond by bond the coefficient `p` of such a bond is a [`StiffnessMean`], the same from both ends.
#[derive(Clone, Debug)]
pub struct Several<const D: usize> {
    laws: Vec<Arc<dyn Law<D>>>,
    used: Vec<u16>,
    /// Stiffness of a bond from the first material to the second over that within the first; row by row.
    relative: Vec<f64>,
    /// Stiffness of the bonds of each material over that of the first in use.
    stiffness: Vec<f64>,
}

/// Distances over the horizon at which kernels are compared.
const COMPARED: usize = 16;

/// Relative difference up to which their ratio counts as constant.
const PROPORTIONAL: f64 = 1e-9;

/// The ratio of two kernels, if it is the same at all distances.
fn ratio_of_kernels<const D: usize>(
    of: &dyn LinearForceState<D>,
    to: &dyn LinearForceState<D>,
) -> Option<f64> {
    let mut ratios = (1..=COMPARED)
        .map(|k| k as f64 / (COMPARED + 1) as f64)
        .map(|r| (of.kernel(r, 1.0), to.kernel(r, 1.0)))
        .filter(|k| *k != (0.0, 0.0))
        .map(|(of, to)| of / to);
    let first = ratios.next()?;
    let is_same = |ratio: f64| (ratio / first - 1.0).abs() <= PROPORTIONAL;
    (first.is_finite() && first > 0.0 && ratios.all(is_same)).then_some(first)
}

/// Returns the reason against two laws in one body; none if there is none.
fn difference<const D: usize>(a: &dyn Law<D>, b: &dyn Law<D>) -> Option<&'static str> {
    let history = |law: &dyn Law<D>| law.force_state().map(|states| states.history());
    if a.name() != b.name() {
        return Some("their laws differ, so that the weights of a lattice do not suit both");
    }
    if a.calibrate().is_some() {
        return Some("the strength of their bonds is calibrated to a lattice of one material");
    }
    if history(a) != history(b) {
        return Some("their points remember different numbers");
    }
    if ratio_of_kernels(a.linearised(), b.linearised()).is_none() {
        return Some(
            "their bonds depend on the distance in different ways, so that the weights of a lattice do not suit both",
        );
    }
    None
}

impl<const D: usize> Several<D> {
    /// The materials `used` of a list of laws, and the rule for bonds between two of them.
    ///
    /// # Errors
    /// [`NoMixture`] with the first two whose laws or kernels differ.
    ///
    /// # Panics
    /// If `used` is empty, or names no law of the list.
    pub fn new(
        laws: Vec<Arc<dyn Law<D>>>,
        used: &[u16],
        mean: impl Fn(u16, u16) -> StiffnessMean,
    ) -> Result<Self, NoMixture> {
        let (count, first) = (laws.len(), used[0]);
        let law = |m: u16| laws[usize::from(m)].as_ref();
        let mut stiffness = vec![1.0; count];
        for &second in used.iter().filter(|m| **m != first) {
            if let Some(why) = difference(law(first), law(second)) {
                return Err(NoMixture { first, second, why });
            }
            let ratio = ratio_of_kernels(law(second).linearised(), law(first).linearised());
            stiffness[usize::from(second)] = ratio.unwrap_or(1.0);
        }
        let mut relative = vec![1.0; count * count];
        for &a in used {
            for &b in used.iter().filter(|b| **b != a) {
                let of = |m: u16| stiffness[usize::from(m)];
                relative[usize::from(a) * count + usize::from(b)] =
                    mean(a, b).relative(of(a), of(b));
            }
        }
        Ok(Self {
            laws,
            used: used.to_vec(),
            relative,
            stiffness,
        })
    }

    fn first(&self) -> &dyn Law<D> {
        self.law(self.used[0])
    }

    fn in_use(&self) -> impl Iterator<Item = &dyn Law<D>> {
        self.used.iter().map(|&m| self.law(m))
    }

    fn states(&self, material: u16) -> Option<&dyn ForceState<D>> {
        self.laws.get(usize::from(material))?.force_state()
    }
}

impl<const D: usize> Mixture<D> for Several<D> {
    fn used(&self) -> &[u16] {
        &self.used
    }

    fn law(&self, material: u16) -> &dyn Law<D> {
        self.laws[usize::from(material)].as_ref()
    }

    fn relative(&self, own: u16, far: u16) -> f64 {
        match self.first().linearised().is_pairwise() {
            true => self.relative[usize::from(own) * self.laws.len() + usize::from(far)],
            false => 1.0,
        }
    }

    fn scale(&self, own: u16, far: u16) -> f64 {
        self.stiffness[usize::from(own)] * self.relative(own, far)
    }
}

impl<const D: usize> Law<D> for Several<D> {
    fn name(&self) -> &'static str {
        self.first().name()
    }

    fn linearised(&self) -> &dyn LinearForceState<D> {
        self
    }

    fn force_state(&self) -> Option<&dyn ForceState<D>> {
        self.in_use()
            .all(|law| law.force_state().is_some())
            .then_some(self)
    }

    fn accelerator(&self) -> Option<Accelerator> {
        let first = self.first().accelerator();
        // a pass that takes coefficients bond by bond takes those of any material; any other has constants of its own
        self.in_use()
            .all(|law| law.accelerator() == first)
            .then_some(first)?
    }

    fn local_law(&self) -> Option<Arc<dyn LocalLaw<D>>> {
        None
    }

    fn linearity(&self) -> Linearity {
        let all = |of: fn(&dyn Law<D>) -> bool| self.in_use().all(of);
        match (
            all(|law| law.is_linear()),
            all(|law| law.is_linear_until_damaged()),
        ) {
            (true, _) => Linearity::Always,
            (false, true) => Linearity::UntilDamaged,
            (false, false) => Linearity::AtRest,
        }
    }

    /// Of the material that departs the furthest.
    fn departure(&self, strain: &Tensor<D>, time: f64) -> Departure {
        let size = |departure: &Departure| match departure {
            Departure::None => 0.0,
            Departure::AtStrain { factor, .. } => *factor,
            Departure::WithTime { lost, .. } => *lost,
        };
        let all = self.in_use().map(|law| law.departure(strain, time));
        let largest = all.max_by(|a, b| size(a).total_cmp(&size(b)));
        largest.unwrap_or(Departure::None)
    }

    fn has_breakable_bonds(&self) -> bool {
        self.in_use().all(|law| law.has_breakable_bonds())
    }

    fn parameters(&self) -> Parameters<'_, D> {
        Parameters::OfMaterials(self)
    }

    fn bond_energy(&self, _horizon: f64) -> Option<BondEnergy> {
        // each of them has its own
        None
    }
}

impl<const D: usize> LinearForceState<D> for Several<D> {
    fn kind(&self) -> ForceStateKind {
        self.first().linearised().kind()
    }

    fn fitted_to(&self, _stress: StressFit) -> Option<Box<dyn LinearForceState<D> + '_>> {
        None
    }

    fn divergence(&self) -> Influence {
        self.first().linearised().divergence()
    }

    fn tensor(&self) -> &Tensor4<D> {
        self.first().linearised().tensor()
    }

    fn kernel(&self, r: f64, horizon: f64) -> f64 {
        self.first().linearised().kernel(r, horizon)
    }

    // weights are relative to the kernel, and kernels are proportional: those of one material are those of all

    fn shell_target(&self) -> Option<ShellTarget> {
        self.first().linearised().shell_target()
    }

    fn moment_conditions(
        &self,
        bonds: &[(Vector<D>, f64)],
        horizon: f64,
    ) -> Option<(Vec<f64>, MomentConditions<D>)> {
        self.first().linearised().moment_conditions(bonds, horizon)
    }

    fn coefficients(
        &self,
        family: &Family<'_, D>,
        pair: &mut [f64],
        omega: &mut [f64],
    ) -> Result<Option<StatePart<D>>, PdError> {
        let own = family.materials.map_or(self.used[0], |m| m.own);
        let law = self.law(own).linearised();
        let state = law.coefficients(family, pair, omega)?;
        if let (Some(materials), true) = (family.materials, law.is_pairwise()) {
            for (p, &far) in pair.iter_mut().zip(materials.far) {
                *p *= self.relative(own, far);
            }
        }
        Ok(state)
    }
}

impl<const D: usize> ForceState<D> for Several<D> {
    fn history(&self) -> HistoryLayout {
        let states = self.first().force_state();
        states.map_or(HistoryLayout::NONE, |states| states.history())
    }

    fn respond(
        &self,
        family: &DeformedFamily<'_, D>,
        step: f64,
        past: Past<'_>,
        present: Present<'_>,
        force: &mut [Vector<D>],
    ) -> EnergyDensity {
        let states = self.states(family.material);
        states.map_or_else(EnergyDensity::default, |states| {
            states.respond(family, step, past, present, force)
        })
    }

    fn stress(
        &self,
        family: &DeformedFamily<'_, D>,
        past: Past<'_>,
        force: &[Vector<D>],
    ) -> CauchyStress<D> {
        let states = self.states(family.material);
        states.map_or_else(CauchyStress::zero, |states| {
            states.stress(family, past, force)
        })
    }

    fn correspondence(&self, material: Option<u16>) -> Option<PointStress<'_, D>> {
        let of = |m: u16| self.states(m)?.correspondence(Some(m));
        let first = of(material.unwrap_or(self.used[0]))?;
        let is_alike = |m: &u16| of(*m).is_some_and(|s| s.control == first.control);
        match material {
            Some(_) => Some(first),
            None => self.used.iter().all(is_alike).then_some(first),
        }
    }

    fn responds(&self, family: &DeformedFamily<'_, D>) -> bool {
        let states = self.states(family.material);
        states.is_some_and(|states| states.responds(family))
    }

    fn is_objective(&self) -> bool {
        let mut states = self.in_use().filter_map(Law::force_state);
        states.all(ForceState::is_objective)
    }

    fn energy_ratio(&self, s: f64) -> f64 {
        let states = self.first().force_state();
        states.map_or(1.0, |states| states.energy_ratio(s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peridynamics::{BondBased, FamilyMaterials, LinearPeridynamicSolid, Micromodulus};

    fn bonds(strength: f64) -> Arc<dyn Law<2>> {
        Arc::new(BondBased::new(Micromodulus::InverseDistance, strength))
    }

    fn solid(lambda: f64, shear: f64) -> Arc<dyn Law<2>> {
        let law = LinearPeridynamicSolid::new(Influence::Gaussian, lambda, shear);
        Arc::new(law)
    }

    fn family() -> (Vec<Vector<2>>, Vec<f64>) {
        let bonds = [
            [1.0, 0.0],
            [0.0, 1.0],
            [-1.0, 0.5],
            [1.5, -1.0],
            [-0.5, -1.5],
        ];
        (
            bonds.map(Vector::from).to_vec(),
            vec![1.0, 0.9, 1.1, 1.0, 0.7],
        )
    }

    /// `p` and ω of a family of the material `own` whose far points have the materials `far`.
    fn coefficients(law: &dyn Law<2>, own: u16, far: &[u16]) -> (Vec<f64>, Vec<f64>) {
        let (bonds, volumes) = family();
        let (mut pair, mut omega) = (vec![0.0; bonds.len()], vec![0.0; bonds.len()]);
        let family = Family {
            bonds: &bonds,
            volumes: &volumes,
            factors: &vec![1.0; bonds.len()],
            horizon: 2.0,
            bond_horizons: &[],
            materials: Some(FamilyMaterials { own, far }),
        };
        (law.linearised()
            .coefficients(&family, &mut pair, &mut omega))
        .unwrap();
        (pair, omega)
    }

    #[test]
    fn bonds_between_two_materials_have_the_mean_from_both_ends() {
        // stiffnesses 2 and 6: 3 in series, 4 in the mean
        for (mean, stiffness) in [
            (StiffnessMean::Harmonic, 3.0),
            (StiffnessMean::Arithmetic, 4.0),
        ] {
            let law = Several::new(vec![bonds(2.0), bonds(6.0)], &[0, 1], |_, _| mean).unwrap();
            let one = coefficients(bonds(1.0).as_ref(), 0, &[0; 5]).0;
            let from_first = coefficients(&law, 0, &[0, 1, 1, 0, 1]).0;
            let from_second = coefficients(&law, 1, &[0, 1, 1, 0, 1]).0;
            for (k, far) in [0, 1, 1, 0, 1].into_iter().enumerate() {
                let expected = [
                    if far == 0 { 2.0 } else { stiffness },
                    if far == 1 { 6.0 } else { stiffness },
                ];
                let found = [from_first[k] / one[k], from_second[k] / one[k]];
                for (found, expected) in found.iter().zip(expected) {
                    assert!(
                        (found - expected).abs() < 1e-14 * expected,
                        "{mean:?} {found}"
                    );
                }
            }
            assert!((law.scale(0, 1) - 0.5 * stiffness).abs() < 1e-14);
            assert!((law.scale(1, 0) - 0.5 * stiffness).abs() < 1e-14);
        }
    }

    #[test]
    fn points_of_a_solid_have_the_coefficients_of_their_own_material() {
        let laws = [solid(1.7, 1.3), solid(0.4, 2.9)];
        let law = Several::new(laws.to_vec(), &[1, 0], |_, _| StiffnessMean::Harmonic).unwrap();
        for own in [0, 1] {
            let found = coefficients(&law, own, &[0, 1, 0, 1, 1]);
            assert_eq!(
                found,
                coefficients(laws[usize::from(own)].as_ref(), 0, &[0; 5])
            );
            assert_eq!(law.relative(own, 1 - own), 1.0);
        }
        // constants that differ have no common fast pass, and equal ones have
        assert_eq!(law.accelerator(), None);
        let alike = vec![solid(1.7, 1.3), solid(1.7, 1.3)];
        let alike = Several::new(alike, &[0, 1], |_, _| StiffnessMean::Harmonic).unwrap();
        assert_eq!(alike.accelerator(), laws[0].accelerator());
    }

    #[test]
    fn laws_and_kernels_that_differ_do_not_mix() {
        let constant: Arc<dyn Law<2>> = Arc::new(BondBased::new(Micromodulus::Constant, 1.0));
        for (other, why) in [
            (solid(1.0, 1.0), "laws differ"),
            (constant, "on the distance"),
        ] {
            let mixed = Several::new(vec![bonds(1.0), bonds(2.0), other], &[0, 1, 2], |_, _| {
                StiffnessMean::Harmonic
            });
            let no = mixed.unwrap_err();
            assert_eq!((no.first, no.second), (0, 2));
            assert!(no.why.contains(why), "{no}");
        }
    }
}
