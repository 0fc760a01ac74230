//! The peridynamic body: points, families, and the kernel that turns a law's coefficients into stiffness rows and partial stresses.
//!
//! A body may contain points that are no sites (points interpolated from finite elements that complete a family, or Gauss points); its [`Transfer`]
//! expresses all of them through sites.

mod family_ends;
mod point_states;
mod reweigh;

pub(crate) use family_ends::FamilyEnds;
use rayon::prelude::*;

use crate::{
    assembly::{Row, Transfer},
    parallel,
    peridynamics::{
        BondHorizon, Bound, Families, Family, FamilyMaterials, Horizon, LinearForceState, PdError,
        PointError, Reversed, StatePart, collapsed_tensor, moment_fitted_weights,
    },
    tensor::{Tensor, Tensor4, Vector},
};

/// Weights of bonds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "WeightsSpec")]
pub enum BondWeights {
    /// One weight per shell of bonds, so that the lattice carries exactly the typed elastic constants.
    #[default]
    Isotropic,
    /// Volumes as they are, as in the papers; the lattice's stiffness is then not quite the typed one.
    Plain,
    /// Fitted family by family to the typed elastic constants; for points that are no lattice.
    Fitted,
}

/// Positions, volumes and horizons of quadrature points, with what expresses their displacement.
///
/// Shapes: one entry per point in each. Units: \[m\], \[m^D\], \[m\].
#[derive(Clone, Debug, Default)]
pub struct Cloud<const D: usize> {
    /// Positions.
    pub position: Vec<Vector<D>>,
    /// Volumes.
    pub volume: Vec<f64>,
    /// Horizons.
    pub horizon: Horizon,
    /// Displacement of each point through sites.
    pub transfer: Transfer,
    /// The number of each point's material; empty if all have one.
    pub material: Vec<u16>,
    /// Horizon of bonds whose ends have different ones.
    pub bond_horizon: BondHorizon,
}

/// Points with families and the coefficients of one law.
pub struct PdBody<const D: usize> {
    /// The points.
    pub cloud: Cloud<D>,
    /// Families over the cloud; empty for points that only complete the families of others.
    pub families: Families,
    reversed: Option<Reversed>,
    pair: Vec<f64>,
    omega: Vec<f64>,
    state: Vec<Option<StatePart<D>>>,
    pairwise: bool,
    /// Ends of families on the faces of elements, if families end there.
    ends: Option<FamilyEnds>,
    /// True for each point whose family lies with another process; empty where none does.
    elsewhere: Vec<bool>,
}

/// One family, in memory that the next one takes over.
#[derive(Default)]
struct Scratch<const D: usize> {
    bonds: Vec<Vector<D>>,
    volumes: Vec<f64>,
    factors: Vec<f64>,
    materials: Vec<u16>,
    horizons: Vec<f64>,
}

/// Factors of the bonds of a point's family.
pub type FamilyFactors<'a> = dyn Fn(usize) -> Result<Vec<f64>, PdError> + Sync + 'a;

/// The kernel factors of a body's bonds.
pub enum Factors<'a, const D: usize> {
    /// All 1.
    Plain,
    /// A function of both ends and the bond vector.
    Shells(&'a (dyn Fn([usize; 2], &Vector<D>) -> f64 + Sync)),
    /// Fitted to the fourth moments, family by family.
    Fitted,
    /// By a function of the point.
    OfFamily(&'a FamilyFactors<'a>),
}

impl<const D: usize> Scratch<D> {
    /// The bonds of a point, and what the law is told of them.
    fn fill(&mut self, i: usize, cloud: &Cloud<D>, family: &[u32]) {
        for list in [&mut self.volumes, &mut self.horizons] {
            list.clear();
        }
        self.bonds.clear();
        self.materials.clear();
        for j in family.iter().map(|&j| j as usize) {
            self.bonds.push(cloud.position[j] - cloud.position[i]);
            self.volumes.push(cloud.volume[j]);
            if cloud.bond_horizon != BondHorizon::OfCentre {
                let of_bond = cloud.bond_horizon.of([i, j], &cloud.horizon);
                self.horizons.push(of_bond);
            }
            self.materials.extend(cloud.material.get(j));
        }
    }

    /// The kernel factors of the bonds of a point.
    fn fill_factors(
        &mut self,
        (i, family): (usize, &[u32]),
        factors: &Factors<'_, D>,
        law: &dyn LinearForceState<D>,
        horizon: f64,
    ) -> Result<(), PdError> {
        self.factors.clear();
        match factors {
            Factors::Plain => self.factors.resize(self.bonds.len(), 1.0),
            Factors::Shells(f) => {
                let bonds = family.iter().zip(&self.bonds);
                self.factors
                    .extend(bonds.map(|(&j, xi)| f([i, j as usize], xi)));
            }
            Factors::Fitted => {
                let bonds = self.bonds.iter().copied().zip(self.volumes.iter().copied());
                let bonds: Vec<(Vector<D>, f64)> = bonds.collect();
                self.factors.extend(fitted(law, &bonds, horizon)?);
            }
            Factors::OfFamily(f) => self.factors.extend(f(i)?),
        }
        Ok(())
    }
}

impl<const D: usize> PdBody<D> {
    /// Builds the coefficients of all bonds.
    ///
    /// With [`Ends::Alike`] a pairwise law gives both ends of a bond the same coefficient, so that the row of a point counts its own bonds twice and visits no others.
    ///
    /// # Errors
    /// [`PointError`] with the point whose family is empty, degenerate or cannot be fitted.
    pub fn new(
        cloud: Cloud<D>,
        families: Families,
        law: &dyn LinearForceState<D>,
        factors: &Factors<'_, D>,
        ends: Ends,
    ) -> Result<Self, PointError<D>> {
        let bonds = families.neighbours.len();
        let pairwise = law.is_pairwise();
        let mut pair = vec![0.0; bonds];
        let mut omega = vec![0.0; if pairwise { 0 } else { bonds }];
        let points = cloud.position.len();
        let mut pair_rows = split_rows(&mut pair, &families.offsets);
        let mut omega_rows = if pairwise {
            (0..points).map(|_| &mut [] as &mut [f64]).collect()
        } else {
            split_rows(&mut omega, &families.offsets)
        };
        let rows = pair_rows.par_iter_mut().zip(omega_rows.par_iter_mut());
        let coefficients =
            |of: &mut Scratch<D>,
             (i, (pair, omega)): (usize, (&mut &mut [f64], &mut &mut [f64]))| {
                if pair.is_empty() {
                    return Ok(None);
                }
                let at = |source: PdError| PointError {
                    point: i,
                    position: cloud.position[i],
                    bonds: families.of(i).len(),
                    source,
                };
                let horizon = cloud.horizon.of(i);
                of.fill(i, &cloud, families.of(i));
                of.fill_factors((i, families.of(i)), factors, law, horizon)
                    .map_err(at)?;
                law.coefficients(
                    &Family {
                        bonds: &of.bonds,
                        volumes: &of.volumes,
                        factors: &of.factors,
                        horizon,
                        bond_horizons: &of.horizons,
                        materials: (cloud.material.get(i)).map(|&own| FamilyMaterials {
                            own,
                            far: &of.materials,
                        }),
                    },
                    pair,
                    omega,
                )
                .map_err(at)
            };
        let state = parallel::try_map_with(rows.enumerate(), Scratch::default, coefficients)?;
        let reversed = match ends {
            Ends::Alike if pairwise => None,
            _ => Some(families.reversed(points)),
        };
        Ok(Self {
            cloud,
            families,
            reversed,
            pair,
            omega,
            state,
            pairwise,
            ends: None,
            elsewhere: Vec::new(),
        })
    }

    /// Marks the points whose families lie with other processes: rows of these are refused.
    pub(crate) fn set_elsewhere(&mut self, elsewhere: Vec<bool>) {
        self.elsewhere = elsewhere;
    }

    /// Returns true if bonds join points of different horizons.
    pub fn mixes_horizons(&self) -> bool {
        let horizon = &self.cloud.horizon;
        let differs = |i: usize| {
            let mut family = self.families.of(i).iter();
            family.any(|&j| horizon.of(j as usize) != horizon.of(i))
        };
        horizon.uniform().is_none() && (0..self.families.len()).any(differs)
    }

    /// Number of directed bonds.
    pub fn bond_count(&self) -> usize {
        self.families.neighbours.len()
    }

    /// The bond vector from point `i` to point `j` \[m\].
    #[inline]
    pub fn bond(&self, i: usize, j: usize) -> Vector<D> {
        self.cloud.position[j] - self.cloud.position[i]
    }

    /// The coefficients `p` \[Pa/m^(D+4)\] and `ω` \[1\] (empty for a pairwise law) of the bonds of point `i`, one entry per bond.
    pub fn kernel(&self, i: usize) -> (&[f64], &[f64]) {
        let range = self.families.offsets[i]..self.families.offsets[i + 1];
        (
            &self.pair[range.clone()],
            if self.pairwise {
                &[]
            } else {
                &self.omega[range]
            },
        )
    }

    /// The state part of point `i`, if its law has one.
    pub fn state(&self, i: usize) -> Option<&StatePart<D>> {
        self.state[i].as_ref()
    }

    /// The collapsed tensor of the family of point `i` \[Pa\], [SAND2015-7998] eq. (2.10).
    pub fn collapsed_tensor(&self, i: usize) -> Tensor4<D> {
        let (xi, volumes): (Vec<_>, Vec<_>) = self
            .families
            .of(i)
            .iter()
            .map(|&j| (self.bond(i, j as usize), self.cloud.volume[j as usize]))
            .unzip();
        let family = Family {
            bonds: &xi,
            volumes: &volumes,
            factors: &[],
            horizon: self.cloud.horizon.of(i),
            bond_horizons: &[],
            materials: None,
        };
        collapsed_tensor(&family, self.kernel(i).0, self.state(i))
    }

    /// Adds the row of the internal force of point `i`, times `−1` (so that `K u = f`), each bond weighted by `weight(j)`.
    ///
    /// Source: [SAND2015-7998] eq. (2.5), as the sum (5.5), times the point's volume: `Σ_j w_ij V_i V_j (T_i⟨ξ⟩ − T_j⟨−ξ⟩)`.
    /// The second sum runs over the points whose families contain `i`, so horizons may differ.
    pub fn add_force_row(&self, i: usize, weight: impl Fn(usize) -> f64, row: &mut Row<D>) {
        self.add_force_row_of_parts(i, |j| [weight(j); 2], row);
    }

    /// As [`PdBody::add_force_row`], with one weight for the pairwise and stabilising parts (`p`, `q`) and another for the state part `𝓜 : Ḡ`.
    pub fn add_force_row_of_parts(
        &self,
        i: usize,
        weights: impl Fn(usize) -> [f64; 2],
        row: &mut Row<D>,
    ) {
        self.add_force_row_of_energies(i, weights, |_| true, row);
    }

    /// As [`PdBody::add_force_row_of_parts`], of a law with a state: the part due to the energies of the points that `counts` names.
    pub fn add_force_row_of_energies(
        &self,
        i: usize,
        weights: impl Fn(usize) -> [f64; 2],
        counts: impl Fn(usize) -> bool,
        row: &mut Row<D>,
    ) {
        row.part(
            || self.cloud.transfer.heaviest(i),
            |row| self.add_bonds_of_row(i, weights, counts, row),
        );
    }

    fn add_bonds_of_row(
        &self,
        i: usize,
        weights: impl Fn(usize) -> [f64; 2],
        counts: impl Fn(usize) -> bool,
        row: &mut Row<D>,
    ) {
        let lies_elsewhere = self.elsewhere.get(i).is_some_and(|is| *is);
        assert!(
            !lies_elsewhere,
            "the family of point {i} lies with another process"
        );
        let transfer = &self.cloud.transfer;
        let volume = self.cloud.volume[i];
        let (pair, omega) = self.kernel(i);
        let both = if self.reversed.is_none() { 2.0 } else { 1.0 };
        let q = self.state(i).map_or(0.0, |s| s.stabilisation);
        let mut own = Tensor::zeros();
        let mut first = Vector::<D>::zeros();
        let deviator = self.state(i).map_or(0.0, |s| s.deviator);
        let mut second = Vector::<D>::zeros();
        let family = if counts(i) { self.families.of(i) } else { &[] };
        for (k, &j) in family.iter().enumerate() {
            let j = j as usize;
            let xi = self.bond(i, j);
            let [vv, of_state] = weights(j).map(|w| volume * self.cloud.volume[j] * w);
            if vv == 0.0 && of_state == 0.0 {
                continue;
            }
            let vv = vv * self.part_of_bond(i, j, row);
            let mut block = xi * xi.transpose() * (both * vv * pair[k]);
            if !self.pairwise {
                block += Tensor::identity() * (q * omega[k] * vv);
                first += xi * (omega[k] * of_state);
                if deviator != 0.0 {
                    second += xi * (pair[k] * xi.norm_squared() * of_state);
                }
            }
            own += block;
            row.gather(transfer, j, &(-block));
        }
        if let Some(state) = self.state(i) {
            // Σ ω ξ V vanishes for a full family, but not at a surface or with a weight that varies in space
            if first.amax() > 1e-15 * volume * state.shape.trace() {
                self.add_weighted_gradient(i, &along(&state.modulus, &first, -1.0), row);
            }
            if deviator != 0.0 {
                self.add_deviators(i, &(first * deviator), &(second * deviator), row);
            }
        }
        if let Some(reversed) = &self.reversed {
            for (j, bond) in reversed.of(i).filter(|(j, _)| counts(*j as usize)) {
                let j = j as usize;
                let xi = self.bond(j, i);
                let [vv, of_state] = weights(j).map(|w| volume * self.cloud.volume[j] * w);
                if vv == 0.0 && of_state == 0.0 {
                    continue;
                }
                let vv = vv * self.part_of_bond(i, j, row);
                let mut block = xi * xi.transpose() * (vv * self.pair[bond]);
                if let Some(state) = self.state(j) {
                    let omega = self.omega[bond];
                    block += Tensor::identity() * (state.stabilisation * omega * vv);
                    let c = along(&state.modulus, &(xi * (omega * of_state)), 1.0);
                    self.add_weighted_gradient(j, &c, row);
                    if state.deviator != 0.0 {
                        let s = self.pair[bond] * xi.norm_squared();
                        let along = xi * (-state.deviator * of_state);
                        self.add_deviators(j, &(along * omega), &(along * s), row);
                    }
                }
                own += block;
                row.gather(transfer, j, &(-block));
            }
        }
        row.gather(transfer, i, &own);
        row.spread(transfer);
    }

    /// Part of a bond that counts in a row.
    #[inline]
    fn part_of_bond(&self, i: usize, j: usize, row: &Row<D>) -> f64 {
        let material = |p: usize| self.cloud.material.get(p);
        row.part_between([material(i), material(j)])
    }

    /// Gathers the row of `A : Ḡ_j`, where `a[b]` is the block that multiplies column `b` of `Ḡ_j = Σ ω η ⊗ ξ V`.
    fn add_weighted_gradient(&self, j: usize, a: &[Tensor<D>; D], row: &mut Row<D>) {
        let add = |row: &mut Row<D>| {
            let (_, omega) = self.kernel(j);
            let mut own = Tensor::zeros();
            for (k, &l) in self.families.of(j).iter().enumerate() {
                let l = l as usize;
                let volume = self.cloud.volume[l] * self.part_of_bond(j, l, row);
                let xi = self.bond(j, l) * (omega[k] * volume);
                let mut block = Tensor::zeros();
                for b in 0..D {
                    block += a[b] * xi[b];
                }
                own -= block;
                row.gather(&self.cloud.transfer, l, &block);
            }
            row.gather(&self.cloud.transfer, j, &own);
        };
        row.part(|| self.cloud.transfer.heaviest(j), add);
    }

    /// Gathers the row of `a Σ p |ξ|² ξ·η V + b tr Ḡ_j`, [`StatePart::deviator`].
    fn add_deviators(&self, j: usize, a: &Vector<D>, b: &Vector<D>, row: &mut Row<D>) {
        let add = |row: &mut Row<D>| {
            let (pair, omega) = self.kernel(j);
            let mut own = Tensor::zeros();
            for (k, &l) in self.families.of(j).iter().enumerate() {
                let l = l as usize;
                let xi = self.bond(j, l);
                let v = self.cloud.volume[l] * self.part_of_bond(j, l, row);
                let weighted = a * (pair[k] * xi.norm_squared() * v) + b * (omega[k] * v);
                let block = weighted * xi.transpose();
                own -= block;
                row.gather(&self.cloud.transfer, l, &block);
            }
            row.gather(&self.cloud.transfer, j, &own);
        };
        row.part(|| self.cloud.transfer.heaviest(j), add);
    }

    /// The coefficients that the far end of bond `k` of point `i` gives it.
    pub fn far_coefficients(&self, i: usize, k: usize) -> (f64, f64) {
        match self.reversed {
            // both ends alike
            None => (self.kernel(i).0[k], 0.0),
            Some(_) => self.coefficients(self.families.of(i)[k] as usize, i as u32),
        }
    }

    /// The coefficients `p` and `ω` (0 for a pairwise law) that point `i` gives its bond to point `j`; zero if its family does not hold that.
    pub fn coefficients(&self, i: usize, j: u32) -> (f64, f64) {
        let (pair, omega) = self.kernel(i);
        match self.families.of(i).binary_search(&j) {
            Ok(k) => (pair[k], omega.get(k).copied().unwrap_or(0.0)),
            Err(_) => (0.0, 0.0),
        }
    }

    /// Returns the state part of the force of point `i` in the bond `xi`, of these coefficients, under a uniform gradient of displacement: the blocks that multiply `∂_b u`.
    pub fn state_force_of_gradient(
        &self,
        i: usize,
        xi: &Vector<D>,
        (pair, omega): (f64, f64),
    ) -> [Tensor<D>; D] {
        let Some(state) = self.state(i) else {
            return [Tensor::zeros(); D];
        };
        let of_gradient = along(&state.modulus, &(xi * omega), 1.0);
        let products = state.second * omega + state.shape * (pair * xi.norm_squared());
        std::array::from_fn(|b| {
            let block: Tensor<D> = (0..D).map(|g| of_gradient[g] * state.shape[(b, g)]).sum();
            block - xi * products.row(b) * state.deviator
        })
    }

    /// Adds the row of `Σ ν^ps(x_j) · a`, the partial stresses of points `j` on directions (or shape-function gradients) `a`.
    ///
    /// Source: [SAND2015-7998] eq. (2.19), `ν^ps = Σ T⟨ξ⟩ ⊗ ξ V`.
    pub fn add_partial_stresses(
        &self,
        on: impl IntoIterator<Item = (usize, Vector<D>)>,
        row: &mut Row<D>,
    ) {
        for (j, a) in on {
            row.part(
                || self.cloud.transfer.heaviest(j),
                |row| self.add_partial_stress(j, &a, row),
            );
        }
        row.spread(&self.cloud.transfer);
    }

    fn add_partial_stress(&self, j: usize, a: &Vector<D>, row: &mut Row<D>) {
        let (pair, omega) = self.kernel(j);
        let state = self.state(j);
        let mut own = Tensor::zeros();
        for (k, &l) in self.families.of(j).iter().enumerate() {
            let l = l as usize;
            let xi = self.bond(j, l);
            let s = xi.dot(a) * self.cloud.volume[l];
            let mut block = xi * xi.transpose() * (pair[k] * s);
            if let Some(state) = state {
                block += Tensor::identity() * (state.stabilisation * omega[k] * s);
            }
            own -= block;
            row.gather(&self.cloud.transfer, l, &block);
        }
        row.gather(&self.cloud.transfer, j, &own);
        if let Some(state) = state {
            self.add_weighted_gradient(j, &along(&state.modulus, &(state.shape * a), 1.0), row);
            if state.deviator != 0.0 {
                let [first, second] = [state.shape, state.second].map(|t| t * a * -state.deviator);
                self.add_deviators(j, &first, &second, row);
            }
        }
    }
}

/// Agreement of the two ends of a bond on its coefficient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// One horizon, one spacing: equal, for a pairwise law.
    Alike,
    /// They may differ.
    Differ,
}

/// `a[b]_ce = s Σ_a 𝓜_caeb x_a`: contracts the second index of a modulus with a vector.
fn along<const D: usize>(modulus: &Tensor4<D>, x: &Vector<D>, s: f64) -> [Tensor<D>; D] {
    std::array::from_fn(|b| {
        Tensor::from_fn(|c, e| s * (0..D).map(|a| modulus.get(c, a, e, b) * x[a]).sum::<f64>())
    })
}

/// The factors of one irregular family: not negative where the moments allow it, else of any sign.
fn fitted<const D: usize>(
    law: &dyn LinearForceState<D>,
    bonds: &[(Vector<D>, f64)],
    horizon: f64,
) -> Result<Vec<f64>, PdError> {
    let Some((base, conditions)) = law.moment_conditions(bonds, horizon) else {
        return Ok(vec![1.0; bonds.len()]);
    };
    let fit = moment_fitted_weights::fit(bonds, &base, &conditions, Bound::AtLeast(0.0))
        .or_else(|_| moment_fitted_weights::fit(bonds, &base, &conditions, Bound::Free))?;
    Ok(fit
        .values
        .iter()
        .zip(&base)
        .map(|(g, b)| if *b > 0.0 { g / b } else { 1.0 })
        .collect())
}

/// One list as rows.
pub(super) fn split_rows<'a, T>(mut values: &'a mut [T], offsets: &[usize]) -> Vec<&'a mut [T]> {
    let mut rows = Vec::with_capacity(offsets.len().saturating_sub(1));
    for pair in offsets.windows(2) {
        let (head, tail) = values.split_at_mut(pair[1] - pair[0]);
        rows.push(head);
        values = tail;
    }
    rows
}
