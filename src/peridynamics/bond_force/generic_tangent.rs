//! The tangent at rest of the generic pass, [SAND2015-7998] eq. (2.5) with the linear force state of [`crate::peridynamics::linear_force_state`].

use super::generic::{Generic, NONE, at};
use crate::{
    parallel,
    peridynamics::{StatePart, ZeroEnergyControl, body::split_rows},
    tensor::{Tensor, Vector, inverse},
};

impl<const D: usize> Generic<D> {
    /// `y = K x` with the tangent at rest, broken bonds left out.
    pub(super) fn tangent_product(&self, x: &[f64], y: &mut [f64]) {
        let mut states = vec![Vector::<D>::zeros(); self.families.neighbours.len()];
        parallel::for_each_task(
            split_rows(&mut states, &self.families.offsets),
            64,
            |i, states| {
                let start = self.range(i).start;
                let here: Vector<D> = at(x, i);
                let intact = || self.range(i).filter(|&bond| self.intact[bond]);
                let state = self.state[i].as_ref();
                let mut gradient = Tensor::<D>::zeros();
                if state.is_some() {
                    for bond in intact() {
                        let j = self.neighbour(bond);
                        let w = self.omega[bond] * self.volume[j];
                        gradient += (at::<D>(x, j) - here) * self.xi(i, j).transpose() * w;
                    }
                }
                let mut stress = state.map(|s| s.modulus.contract(&gradient));
                let deviator = state.map_or(0.0, |s| s.deviator);
                if let Some(stress) = stress.as_mut().filter(|_| deviator != 0.0) {
                    let product = self.deviatoric_product(i, x, gradient.trace(), deviator);
                    *stress -= Tensor::identity() * (deviator * product);
                }
                for bond in intact() {
                    let j = self.neighbour(bond);
                    let (xi, eta) = (self.xi(i, j), at::<D>(x, j) - here);
                    let mut t = xi * (self.pair[bond] * xi.dot(&eta));
                    if let (Some(state), Some(stress)) = (state, stress) {
                        t += (eta * state.stabilisation + stress * xi) * self.omega[bond];
                        if deviator != 0.0 {
                            let s = self.pair[bond] * xi.norm_squared();
                            t -= xi * (deviator * gradient.trace() * s);
                        }
                        t += self.beyond_linear(state, &gradient, &xi, &eta) * self.omega[bond];
                    }
                    states[bond - start] = t;
                }
            },
        );
        self.gather(&states, y);
    }

    /// Returns the force of a length control at rest beyond the bond force that stands for it in the linearisation: along ξ alone instead of the mean over directions.
    fn beyond_linear(
        &self,
        state: &StatePart<D>,
        weighted: &Tensor<D>,
        xi: &Vector<D>,
        eta: &Vector<D>,
    ) -> Vector<D> {
        let length = (self.points.as_ref()).filter(|p| p.control == ZeroEnergyControl::Length);
        let Some((inverse, _)) = length.and_then(|_| inverse(&state.shape)) else {
            return Vector::zeros();
        };
        let beyond = eta - weighted * inverse * xi;
        xi * (state.control * xi.dot(&beyond) / xi.norm_squared()) - beyond * state.stabilisation
    }

    /// The part of the row sums of a bond that this has, of its own end and of the other: of `M ⊗ M` in a row no more than √D, of a difference 2, of a gradient its derivatives.
    fn beyond_linear_sum(&self, i: usize, xi: &Vector<D>, sums: &[f64; D]) -> f64 {
        let length = (self.points.as_ref()).filter(|p| p.control == ZeroEnergyControl::Length);
        let Some(state) = self.state[i].as_ref().filter(|_| length.is_some()) else {
            return 0.0;
        };
        let Some((inverse, _)) = inverse(&state.shape) else {
            return 0.0;
        };
        let reach = inverse * xi;
        let columns: f64 = reach.iter().zip(sums).map(|(x, sum)| x.abs() * sum).sum();
        (state.control * (D as f64).sqrt() + state.stabilisation) * (2.0 + columns)
    }

    /// `Σ p |ξ|² ξ·η V` over intact bonds, and `d θ Σ p |ξ|⁴ V` over broken ones, whose deviatoric extensions no longer count.
    fn deviatoric_product(&self, i: usize, x: &[f64], theta: f64, deviator: f64) -> f64 {
        let here: Vector<D> = at(x, i);
        let term = |bond: usize| {
            let j = self.neighbour(bond);
            let xi = self.xi(i, j);
            let s = self.pair[bond] * xi.norm_squared() * self.volume[j];
            match self.intact[bond] {
                true => s * xi.dot(&(at::<D>(x, j) - here)),
                false => deviator * theta * s * xi.norm_squared(),
            }
        };
        self.range(i).map(term).sum()
    }

    /// Per unknown an upper bound of `Σ |K_ab|` of that tangent.
    pub(super) fn tangent_row_sums(&self) -> Vec<f64> {
        let points = self.position.len();
        let sums: Vec<[f64; D]> = match self.omega.is_empty() {
            true => Vec::new(),
            false => parallel::map(points, 1, |i| self.gradient_sums(i)),
        };
        let mut result = vec![0.0; points * D];
        parallel::for_each_chunk(&mut result, D, 64, |i, row| {
            if !self.row[i] {
                return;
            }
            let mut own = Tensor::<D>::zeros();
            let mut first = Vector::<D>::zeros();
            let mut second = Vector::<D>::zeros();
            for bond in self.range(i).filter(|&bond| self.intact[bond]) {
                let j = self.neighbour(bond);
                let xi = self.xi(i, j);
                let vv = self.volume[i] * self.volume[j];
                let both = |of: &[f64], part: &dyn Fn(usize) -> f64| {
                    let back = match self.reverse[bond] {
                        NONE if self.law.linearised().is_pairwise() => of[bond] * part(i),
                        NONE => 0.0,
                        back => of[back as usize] * part(j),
                    };
                    of[bond] * part(i) + back
                };
                let mut block = xi * xi.transpose() * (both(&self.pair, &|_| 1.0) * vv);
                if !sums.is_empty() {
                    let q = |p: usize| self.state[p].as_ref().map_or(0.0, |s| s.stabilisation);
                    block += Tensor::identity() * (both(&self.omega, &q) * vv);
                    let beyond = |p: usize| self.beyond_linear_sum(p, &xi, &sums[p]);
                    let beyond = both(&self.omega, &beyond) * vv;
                    row.iter_mut().for_each(|row| *row += beyond);
                    first += xi * (self.omega[bond] * vv);
                    second += xi * (self.pair[bond] * xi.norm_squared() * vv);
                    if self.reverse[bond] != NONE {
                        let omega = self.omega[self.reverse[bond] as usize];
                        let s = self.pair[self.reverse[bond] as usize] * xi.norm_squared();
                        let weighted = [xi * (omega * vv), xi * (s * vv)];
                        self.add_state_sums(j, &weighted, &sums[j], row);
                    }
                }
                own += block;
                for (a, row) in row.iter_mut().enumerate() {
                    *row += block.row(a).iter().map(|k| k.abs()).sum::<f64>();
                }
            }
            for (a, row) in row.iter_mut().enumerate() {
                *row += own.row(a).iter().map(|k| k.abs()).sum::<f64>();
            }
            if !sums.is_empty() {
                self.add_state_sums(i, &[first, second], &sums[i], row);
            }
        });
        result
    }

    /// `Ḡ`-derivatives of a family, summed by column of `Ḡ`: `Σ_l |∂Ḡ_kb/∂u_k(l)|`.
    fn gradient_sums(&self, i: usize) -> [f64; D] {
        let (mut own, mut others) = (Vector::<D>::zeros(), [0.0; D]);
        for bond in self.range(i).filter(|&bond| self.intact[bond]) {
            let j = self.neighbour(bond);
            let x = self.xi(i, j) * (self.omega[bond] * self.volume[j]);
            own += x;
            for b in 0..D {
                others[b] += x[b].abs();
            }
        }
        std::array::from_fn(|b| others[b] + own[b].abs())
    }

    /// Adds to the row sums of one point what the state part of point `j` gives along `v`, or of a law with a deviator along `v` and `w`.
    fn add_state_sums(&self, j: usize, [v, w]: &[Vector<D>; 2], sums: &[f64; D], row: &mut [f64]) {
        let Some(state) = &self.state[j] else { return };
        if state.deviator != 0.0 {
            self.add_deviator_sums(j, v, w, row);
            return;
        }
        for (i, row) in row.iter_mut().enumerate() {
            for k in 0..D {
                for b in 0..D {
                    let of: f64 = (0..D).map(|a| state.modulus.get(i, a, k, b) * v[a]).sum();
                    *row += of.abs() * sums[b];
                }
            }
        }
    }

    /// As [`Self::add_state_sums`] of a law with a deviator, `v` weighted by ω and `w` by `p |ξ|²`: dilatation and deviatoric products of a bond cancel in part, so that bonds are added up one by one.
    fn add_deviator_sums(&self, j: usize, v: &Vector<D>, w: &Vector<D>, row: &mut [f64]) {
        let Some(state) = &self.state[j] else { return };
        let d = state.deviator;
        let weighted = |bond: usize| {
            let l = self.neighbour(bond);
            let xi = self.xi(j, l);
            (xi, self.pair[bond] * xi.norm_squared(), self.volume[l])
        };
        let broken = self.range(j).filter(|&bond| !self.intact[bond]);
        let lost: f64 = broken
            .map(|bond| {
                let (xi, s, volume) = weighted(bond);
                s * xi.norm_squared() * volume
            })
            .sum();
        let modulus = state.modulus.get(0, 0, 0, 0) - d * d * lost;
        let mut own = Tensor::<D>::zeros();
        for bond in self.range(j).filter(|&bond| self.intact[bond]) {
            let (xi, s, volume) = weighted(bond);
            let omega = self.omega[bond];
            let along = (v * (modulus * omega - d * s) - w * (d * omega)) * volume;
            own += along * xi.transpose();
            let reach: f64 = xi.iter().map(|x| x.abs()).sum();
            for (row, along) in row.iter_mut().zip(along.iter()) {
                *row += along.abs() * reach;
            }
        }
        for (a, row) in row.iter_mut().enumerate() {
            *row += own.row(a).iter().map(|k| k.abs()).sum::<f64>();
        }
    }
}
