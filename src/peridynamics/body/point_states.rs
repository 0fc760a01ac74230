//! Partial stress and energy density of a point under a displacement, from its bonds.

use super::PdBody;
use crate::peridynamics::{CauchyStress, ForceState, MemorylessFamily};
use crate::tensor::{Tensor, Vector};

impl<const D: usize> PdBody<D> {
    /// `Σ p |ξ|² ξ ⊗ ξ V` over the neighbours that `stands` names.
    fn second_moment(&self, j: usize, stands: impl Fn(usize) -> bool) -> Tensor<D> {
        let (pair, _) = self.kernel(j);
        let family = self.families.of(j).iter().map(|&l| l as usize).zip(pair);
        let standing = family.filter(|(l, _)| stands(*l));
        standing.fold(Tensor::zeros(), |sum, (l, pair)| {
            let xi = self.bond(j, l);
            sum + xi * xi.transpose() * (pair * xi.norm_squared() * self.cloud.volume[l])
        })
    }

    /// The partial stress of point `j` under displacements `u` of the sites.
    pub fn partial_stress(&self, j: usize, u: &[f64]) -> Tensor<D> {
        self.partial_stress_under(j, self.differences(j, u))
    }

    /// The partial stress of point `j` where the displacement of its neighbour `l` differs from its own by `difference(l)`.
    pub fn partial_stress_under(
        &self,
        j: usize,
        difference: impl Fn(usize) -> Vector<D>,
    ) -> Tensor<D> {
        let shape = self.state(j).map(|s| s.shape);
        self.stress_of(j, difference, |_| true, shape)
    }

    /// The displacements of neighbours of point `j` less its own, under displacements `u` of the sites.
    fn differences(&self, j: usize, u: &[f64]) -> impl Fn(usize) -> Vector<D> {
        let transfer = &self.cloud.transfer;
        let here: Vector<D> = transfer.displacement(j, u);
        move |l| transfer.displacement::<D>(l, u) - here
    }

    /// The partial stress of point `j` by the bonds to neighbours that `stands` names, zero without any: force states keep the weights of the whole family, as in motion.
    pub fn partial_stress_of(
        &self,
        j: usize,
        u: &[f64],
        is_intact: impl Fn(usize) -> bool,
    ) -> Tensor<D> {
        let (_, omega) = self.kernel(j);
        let shape = (!self.pairwise).then(|| {
            let family = self.families.of(j).iter().map(|&l| l as usize);
            let standing = family.zip(omega).filter(|(l, _)| is_intact(*l));
            standing.fold(Tensor::zeros(), |shape, (l, omega)| {
                let xi = self.bond(j, l);
                shape + xi * xi.transpose() * (omega * self.cloud.volume[l])
            })
        });
        self.stress_of(j, self.differences(j, u), is_intact, shape)
    }

    /// The Cauchy stress \[Pa\] and the stored energy density \[J/m^D\] of point `j` by its exact bonds to neighbours that `stands` names, of a law without memory; points expand freely by the stretch `free`.
    pub fn exact_response(
        &self,
        j: usize,
        law: &dyn ForceState<D>,
        u: &[f64],
        stands: impl Fn(usize) -> bool,
        free: impl Fn(usize) -> f64,
    ) -> (CauchyStress<D>, f64) {
        let (pair, omega) = self.kernel(j);
        let family = self.families.of(j).iter().map(|&l| l as usize);
        let volume = |l: usize| self.cloud.volume[l];
        let (standing, lost): (Vec<_>, Vec<_>) = family.enumerate().partition(|&(_, l)| stands(l));
        let of = |list: &[f64]| -> Vec<f64> {
            let kept = standing.iter().filter_map(|&(k, _)| list.get(k).copied());
            kept.collect()
        };
        let differ = self.differences(j, u);
        let bonds: Vec<Vector<D>> = standing.iter().map(|&(_, l)| self.bond(j, l)).collect();
        let volumes: Vec<f64> = standing.iter().map(|&(_, l)| volume(l)).collect();
        let difference: Vec<Vector<D>> = standing.iter().map(|&(_, l)| differ(l)).collect();
        let here = free(j);
        let expansion = |&(_, l): &(usize, usize)| 0.5 * (here + free(l));
        let expansion: Vec<f64> = standing.iter().map(expansion).collect();
        let lost: f64 = lost.iter().map(|&(_, l)| volume(l)).sum();
        let kept: f64 = volumes.iter().sum();
        let family = MemorylessFamily {
            bonds: &bonds,
            volumes: &volumes,
            pair: &of(pair),
            omega: &of(omega),
            state: self.state(j),
            material: self.cloud.material.get(j).copied().unwrap_or(0),
            damage: if lost > 0.0 {
                lost / (lost + kept)
            } else {
                0.0
            },
        };
        family.cauchy_stress(law, &difference, &expansion)
    }

    /// The energy density of point `j` under displacements `u` of the sites, by the bonds to neighbours that `stands` names: that whose derivative the linear force state is \[J/m^D\].
    pub fn energy_density(&self, j: usize, u: &[f64], stands: impl Fn(usize) -> bool) -> f64 {
        let transfer = &self.cloud.transfer;
        let (pair, omega) = self.kernel(j);
        let here: Vector<D> = transfer.displacement(j, u);
        let (mut pairs, mut squares, mut product) = (0.0, 0.0, 0.0);
        let mut gradient = Tensor::zeros();
        for (k, &l) in self.families.of(j).iter().enumerate() {
            let l = l as usize;
            if !stands(l) {
                continue;
            }
            let xi = self.bond(j, l);
            let eta = transfer.displacement::<D>(l, u) - here;
            let (along, v) = (xi.dot(&eta), self.cloud.volume[l]);
            pairs += pair[k] * along * along * v;
            if !self.pairwise {
                squares += omega[k] * eta.norm_squared() * v;
                gradient += eta * xi.transpose() * (omega[k] * v);
                product += pair[k] * xi.norm_squared() * along * v;
            }
        }
        let Some(state) = self.state(j) else {
            return 0.5 * pairs;
        };
        let mut of_state = gradient.dot(&state.modulus.contract(&gradient));
        if state.deviator != 0.0 {
            let (d, theta) = (state.deviator, gradient.trace());
            let lost = state.second.trace() - self.second_moment(j, stands).trace();
            of_state -= d * theta * (2.0 * product + d * lost * theta);
        }
        0.5 * (pairs + state.stabilisation * squares + of_state)
    }

    fn stress_of(
        &self,
        j: usize,
        difference: impl Fn(usize) -> Vector<D>,
        stands: impl Fn(usize) -> bool,
        shape: Option<Tensor<D>>,
    ) -> Tensor<D> {
        let (pair, omega) = self.kernel(j);
        let mut stress = Tensor::zeros();
        let mut gradient = Tensor::zeros();
        for (k, &l) in self.families.of(j).iter().enumerate() {
            let l = l as usize;
            if !stands(l) {
                continue;
            }
            let xi = self.bond(j, l);
            let eta = difference(l);
            let v = self.cloud.volume[l];
            stress += xi * xi.transpose() * (pair[k] * xi.dot(&eta) * v);
            if !self.pairwise {
                gradient += eta * xi.transpose() * (omega[k] * v);
            }
        }
        let stress_of_pairs = stress;
        if let (Some(state), Some(shape)) = (self.state(j), shape) {
            stress += gradient * state.stabilisation + state.modulus.contract(&gradient) * shape;
            if state.deviator != 0.0 {
                // of the deviatoric extensions those of broken bonds are left out
                let d = state.deviator;
                let second = self.second_moment(j, &stands);
                let lost = state.second.trace() - second.trace();
                let (theta, product) = (gradient.trace(), stress_of_pairs.trace());
                stress -= (shape * (product + d * lost * theta) + second * theta) * d;
            }
        }
        stress
    }
}
