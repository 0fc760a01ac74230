//! Families of points of different horizons: clouds of one horizon each, and factors of bonds between regions.

use crate::{
    model::{
        HorizonChange, ModelError, Peridynamics,
        bond_cutting::LatticeFactors,
        point_cloud::{PointCarrier, PointCloud, Volumes},
    },
    parallel,
    peridynamics::{BondHorizon, Families, Horizon, TIE_TOLERANCE},
    tensor::Vector,
};

impl HorizonChange {
    /// Reaches of the families that are sought of so many points: as far as the largest horizon where bonds may have that of their far end.
    pub(crate) fn reaches<const D: usize>(
        self,
        p: &Peridynamics<D>,
        horizon: &Horizon,
        points: usize,
    ) -> Vec<f64> {
        let of_point = |i: usize| match self {
            Self::MultiHorizon => horizon.largest(),
            Self::Dual | Self::Splice => horizon.of(i),
        };
        (0..points).map(|i| p.reach(of_point(i))).collect()
    }

    /// The clouds that families are sought in, one for each horizon where points continue each as if all had it.
    pub(crate) fn clouds<const D: usize>(
        self,
        cloud: PointCloud<D>,
    ) -> Result<Vec<PointCloud<D>>, ModelError> {
        let own = |i: &usize| cloud.carrier[*i].is_own();
        let of_sites = (0..cloud.position.len()).filter(own);
        let mut values: Vec<f64> = of_sites.map(|i| cloud.horizon.of(i)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        if self == Self::Dual || cloud.horizon.uniform().is_some() {
            return Ok(vec![cloud]);
        }
        if values.len() > Self::MOST_HORIZONS {
            return Err(ModelError::TooManyHorizons {
                rule: self.name(),
                count: values.len(),
                most: Self::MOST_HORIZONS,
            });
        }
        if self == Self::MultiHorizon {
            return Ok(vec![cloud]);
        }
        let of_value = |(l, horizon): (usize, f64)| {
            let mut of_value = cloud.clone();
            for (i, carrier) in of_value.carrier.iter_mut().enumerate() {
                if carrier.is_own() && cloud.horizon.of(i) != horizon {
                    *carrier = PointCarrier::Lattice;
                }
            }
            of_value.horizon = Horizon::Uniform(horizon);
            if l > 0 {
                of_value.volumes = Volumes::default();
            }
            of_value
        };
        Ok(values.into_iter().enumerate().map(of_value).collect())
    }
}

/// The factors α of \[Jenabidehkordi2019\] eq. (7): the part of the bonds of a point into a region of a larger horizon that counts.
///
/// With the kernel `K`, `|ξ|² K ξ` is the pull of a bond under a unit dilatation. All bonds of a point with the horizon δ into the region of a horizon Δ > δ have the one α
/// with which they pull, along the direction n to the nearest point there, as the bonds would that reach there with the horizon δ:
///
/// ```text
/// Σ_{|ξ| ≤ δ} K_δ |ξ|² |ξ·n| V  =  α Σ_{|ξ| ≤ Δ} K_Δ |ξ|² |ξ·n| V
/// ```
///
/// Both sums are those of the points before cracks cut bonds.
pub(crate) struct InteractionFactors {
    /// Of each point by the bits of the larger horizons around it.
    of_point: Vec<Vec<(u64, f64)>>,
}

/// Sums of a point over the points of a larger horizon.
struct Region<const D: usize> {
    horizon: f64,
    nearest: f64,
    normal: Vector<D>,
    own: f64,
    wide: f64,
}

impl InteractionFactors {
    /// Those of a rule that has such, by which the families lose the bonds of which nothing counts.
    pub fn of_rule<const D: usize>(
        p: &Peridynamics<D>,
        cloud: &PointCloud<D>,
        families: &mut Families,
        factors: &LatticeFactors<D>,
    ) -> Option<Self> {
        let mixes = p.horizon_change == HorizonChange::MultiHorizon;
        if !mixes || cloud.horizon.uniform().is_some() {
            return None;
        }
        let found = Self::new(p, cloud, families, factors);
        found.keep(p, cloud, families);
        Some(found)
    }

    /// Of the points of a cloud, whose `families` reach as far as the largest horizon does.
    fn new<const D: usize>(
        p: &Peridynamics<D>,
        cloud: &PointCloud<D>,
        families: &Families,
        factors: &LatticeFactors<D>,
    ) -> Self {
        let law = p.law.linearised();
        let of_point = parallel::map(cloud.position.len(), 64, |i| {
            let mut regions: Vec<Region<D>> = Vec::new();
            let own = cloud.horizon.of(i);
            let bonds = |region: f64| {
                let far = families.of(i).iter().map(|&j| j as usize);
                far.filter(move |&j| cloud.horizon.of(j) == region)
                    .map(move |j| (cloud.position[j] - cloud.position[i], cloud.volume[j]))
            };
            for &j in families.of(i) {
                let horizon = cloud.horizon.of(j as usize);
                if horizon > own && regions.iter().all(|r| r.horizon != horizon) {
                    regions.push(Region::around(horizon, bonds(horizon)));
                }
            }
            let pull = |xi: &Vector<D>, horizon: f64| match reaches(p, horizon, xi.norm()) {
                true => {
                    let weight = factors.factor(horizon, xi).unwrap_or(1.0);
                    weight * law.kernel(xi.norm(), horizon) * xi.norm_squared()
                }
                false => 0.0,
            };
            for region in &mut regions {
                for (xi, volume) in bonds(region.horizon) {
                    let along = xi.dot(&region.normal).abs() * volume;
                    region.own += pull(&xi, own) * along;
                    region.wide += pull(&xi, region.horizon) * along;
                }
            }
            let alpha = |r: Region<D>| match r.wide > 0.0 {
                true => (r.horizon.to_bits(), r.own / r.wide),
                false => (r.horizon.to_bits(), 0.0),
            };
            regions.into_iter().map(alpha).collect()
        });
        Self { of_point }
    }

    /// The factor of a bond between two points: 1 within a horizon.
    pub fn of(&self, [i, j]: [usize; 2], horizon: &Horizon) -> f64 {
        let (fine, wide) = match horizon.of(i) < horizon.of(j) {
            true => (i, horizon.of(j)),
            false => (j, horizon.of(i)),
        };
        let known = self.of_point[fine].iter();
        let mut known = known.filter(|(bits, _)| *bits == wide.to_bits());
        match horizon.of(fine) == wide {
            true => 1.0,
            false => known.next().map_or(0.0, |(_, alpha)| *alpha),
        }
    }

    /// Removes the bonds beyond the horizon that they have, and those of which nothing counts.
    fn keep<const D: usize>(
        &self,
        p: &Peridynamics<D>,
        cloud: &PointCloud<D>,
        families: &mut Families,
    ) {
        families.retain(|i, j| {
            let ends = [i, j as usize];
            let horizon = BondHorizon::Larger.of(ends, &cloud.horizon);
            let length = (cloud.position[ends[1]] - cloud.position[i]).norm();
            reaches(p, horizon, length) && self.of(ends, &cloud.horizon) > 0.0
        });
    }

    /// Renumbers points, `u32::MAX` for those that are dropped.
    pub fn retain(&mut self, renumbered: &[u32]) {
        let mut kept = renumbered.iter().map(|&r| r != u32::MAX);
        self.of_point.retain(|_| kept.next().unwrap_or(false));
    }
}

/// Returns true if a family of that horizon holds a bond of that length.
fn reaches<const D: usize>(p: &Peridynamics<D>, horizon: f64, length: f64) -> bool {
    length <= p.reach(horizon) * (1.0 + TIE_TOLERANCE)
}

impl<const D: usize> Region<D> {
    /// The region of a horizon around a point, seen along its bonds.
    fn around(horizon: f64, bonds: impl Iterator<Item = (Vector<D>, f64)>) -> Self {
        let mut region = Self {
            horizon,
            nearest: f64::INFINITY,
            normal: Vector::zeros(),
            own: 0.0,
            wide: 0.0,
        };
        for (xi, _) in bonds {
            let length = xi.norm();
            if length < region.nearest * (1.0 - TIE_TOLERANCE) {
                (region.nearest, region.normal) = (length, xi / length);
            }
        }
        region
    }
}
