//! Peridynamic points before they are sites: those of the peridynamic region, and those that complete their families.

use rustc_hash::FxHashSet;

use crate::{
    model::{Reach, Zone},
    peridynamics::{Families, Horizon},
    tensor::{Tensor, Vector},
};

/// Volumes of the peridynamic region and of the points in it \[m^D\].
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Volumes {
    /// Sum of the cells that hold points.
    pub region: f64,
    /// Volume of that region that all quadrature points have, including those at its edge that belong to finite elements.
    pub points: f64,
}

/// PointCarrier of the displacement of a point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PointCarrier {
    /// The point is a site.
    Own,
    /// A finite element that interpolates the point (or extrapolates, if it lies in none), with its shape values.
    Element(u32, Vec<f64>),
    /// The points of another lattice, among which it continues its own.
    Lattice,
}

impl PointCarrier {
    /// Returns true if the point is a site.
    pub fn is_own(&self) -> bool {
        *self == Self::Own
    }
}

/// Points before they are sites.
///
/// Shapes: one entry per point in each vector.
#[derive(Clone)]
pub(crate) struct PointCloud<const D: usize> {
    pub position: Vec<Vector<D>>,
    pub volume: Vec<f64>,
    pub horizon: Horizon,
    pub zone: Vec<Zone>,
    pub carrier: Vec<PointCarrier>,
    pub spacing: f64,
    /// The axes of the square or cubic lattice that the points are some of, as columns; none for scattered points.
    pub axes: Option<Tensor<D>>,
    pub volumes: Volumes,
}

/// Which points are needed.
pub(crate) struct Kept {
    /// New number of each point, `u32::MAX` for one that is dropped.
    pub renumbered: Vec<u32>,
    /// For each point (by its old number), true if it needs a family.
    pub active: Vec<bool>,
}

const DROPPED: u32 = u32::MAX;

impl<const D: usize> PointCloud<D> {
    /// Keeps sites, what is in their families, and with [`Reach::Neighbours`] what is in the families of those.
    pub fn prune(&self, families: &Families, reach: Reach) -> Kept {
        let n = self.position.len();
        let mut active: Vec<bool> = self.carrier.iter().map(PointCarrier::is_own).collect();
        if reach == Reach::Neighbours {
            let site = active.clone();
            for i in 0..n {
                let mut sees_site = false;
                for &j in families.of(i) {
                    if site[i] {
                        active[j as usize] = true;
                    }
                    sees_site |= site[j as usize];
                }
                // its force state acts on a site, whatever the site's own horizon
                active[i] |= sees_site;
            }
        }
        let mut used = active.clone();
        for i in (0..n).filter(|&i| active[i]) {
            for &j in families.of(i) {
                used[j as usize] = true;
            }
        }
        let mut next = 0;
        let renumbered = used
            .iter()
            .map(|&used| {
                if used {
                    next += 1;
                    next - 1
                } else {
                    DROPPED
                }
            })
            .collect();
        Kept { renumbered, active }
    }

    /// Keeps also the points from which a bond may pass through the peridynamic region without ending in it, and tells which these are.
    ///
    /// Such a point lies within a horizon of the region, and some site within a cell's diagonal of it.
    pub fn prune_through(&self, families: &Families, reach: Reach) -> (Kept, Vec<bool>) {
        let kept = self.prune(families, reach);
        let largest = self.horizon.largest();
        let size = largest + 2.0 * self.spacing * (D as f64).sqrt();
        let bin =
            |x: &Vector<D>| -> [i64; D] { std::array::from_fn(|i| (x[i] / size).floor() as i64) };
        let mut near = FxHashSet::default();
        let mut centres = FxHashSet::default();
        for (x, carrier) in self.position.iter().zip(&self.carrier) {
            if carrier.is_own() {
                let centre = bin(x);
                if !centres.insert(centre) {
                    continue;
                }
                for index in 0..3usize.pow(D as u32) {
                    let mut rest = index;
                    near.insert(std::array::from_fn(|i| {
                        let k = rest % 3;
                        rest /= 3;
                        centre[i] + k as i64 - 1
                    }));
                }
            }
        }
        let mut next = 0;
        let mut renumbered = kept.renumbered;
        let mut passing = vec![false; renumbered.len()];
        for (i, number) in renumbered.iter_mut().enumerate() {
            passing[i] = !self.carrier[i].is_own() && near.contains(&bin(&self.position[i]));
            if *number != DROPPED || passing[i] {
                *number = next;
                next += 1;
            }
        }
        (
            Kept {
                renumbered,
                active: kept.active,
            },
            passing,
        )
    }

    /// Drops the points that have no new number.
    pub fn retain(&mut self, renumbered: &[u32]) {
        let mut flags = renumbered.iter().map(|&r| r != DROPPED);
        let mut keep = || flags.next().unwrap_or(false);
        self.position.retain(|_| keep());
        retain_by(&mut self.volume, renumbered);
        let mut flags = renumbered.iter().map(|&r| r != DROPPED);
        self.horizon.retain(|| flags.next().unwrap_or(false));
        retain_by(&mut self.zone, renumbered);
        retain_by(&mut self.carrier, renumbered);
    }
}

fn retain_by<T>(values: &mut Vec<T>, renumbered: &[u32]) {
    let mut flags = renumbered.iter().map(|&r| r != DROPPED);
    values.retain(|_| flags.next().unwrap_or(false));
}

impl<const D: usize> PointCloud<D> {
    /// The points that continue a lattice among those of another, ascending.
    pub fn continued(&self) -> Vec<u32> {
        let continues = |i: &u32| self.carrier[*i as usize] == PointCarrier::Lattice;
        (0..self.position.len() as u32).filter(continues).collect()
    }

    /// Returns true if the points are some of a lattice along the coordinate axes.
    pub fn is_axis_parallel(&self) -> bool {
        self.axes == Some(Tensor::identity())
    }

    pub fn empty(spacing: f64, region: f64) -> Self {
        Self {
            position: Vec::new(),
            volume: Vec::new(),
            horizon: Horizon::default(),
            zone: Vec::new(),
            carrier: Vec::new(),
            spacing,
            axes: None,
            volumes: Volumes {
                region,
                points: 0.0,
            },
        }
    }

    /// Appends the points of another cloud, but for their horizons; the spacing becomes the larger one.
    pub fn append(&mut self, other: Self) {
        self.position.extend(other.position);
        self.volume.extend(other.volume);
        self.zone.extend(other.zone);
        self.carrier.extend(other.carrier);
        self.spacing = self.spacing.max(other.spacing);
        self.volumes.region += other.volumes.region;
        self.volumes.points += other.volumes.points;
    }

    pub fn push(&mut self, x: Vector<D>, volume: f64, zone: Zone, carrier: PointCarrier) {
        self.position.push(x);
        self.volume.push(volume);
        self.zone.push(zone);
        self.carrier.push(carrier);
    }
}
