//! Input of the bond pass of a moving body: families, rows, criterion and accelerator.

use crate::model::Model;
use crate::{
    coupling::{
        BondsOfSite, NonlinearSeam, Operator,
        semidiscrete::behaviour::{BondBehaviour, BondThreshold, NONE, SystemError},
    },
    model::SiteKind,
    peridynamics::{
        Accelerator, BondHorizon, Families, Law, PdBody,
        bond_force::{
            BondCriterion, BondForce, BondPass, BondSetup, DistributedRows, Failure, Layout,
            Storage, bond_pass,
        },
    },
    system::Ranks,
    tensor::Vector,
};
use std::sync::Arc;

/// Input from which the pass over the bonds of a body is made.
pub(super) struct PassInput<'a, const D: usize> {
    pub body: &'a PdBody<D>,
    pub law: &'a Arc<dyn Law<D>>,
    /// The fast pass that the law and its weights have.
    pub accelerator: Option<Accelerator>,
    /// True if points of different horizons have bonds that act at both ends by what either end gives them, [`crate::model::HorizonChange::Dual`].
    pub is_dual: bool,
    pub families: &'a Families,
    /// True if the families are those of the body.
    pub is_whole: bool,
    /// For each point, true if the force on it counts.
    pub rows: &'a [bool],
    pub no_fail: &'a [bool],
    pub seam: Option<&'a NonlinearSeam<D>>,
    pub behaviour: &'a BondBehaviour<'a, D>,
    /// Distribution of the families, where they are spread over processes.
    pub shared: Option<DistributedRows<'a>>,
}

impl<const D: usize> PassInput<'_, D> {
    /// The pass: pairwise, of a solid, or of the law.
    ///
    /// # Errors
    /// [`SystemError`] for a law without a force state, or bonds that cannot stretch.
    pub fn pass(&self) -> Result<Box<dyn BondPass<D>>, SystemError> {
        let Self {
            body,
            law,
            families,
            seam,
            behaviour,
            ..
        } = *self;
        // a seam leaves some of the body's bonds out: those that stay keep their coefficients
        let is_all_of =
            |i: usize| self.is_whole || families.of(i).len() == body.families.of(i).len();
        let pair = |i: usize, k: usize, _: &Vector<D>| match is_all_of(i) {
            true => body.kernel(i).0[k],
            false => body.coefficients(i, families.of(i)[k]).0,
        };
        let mean = |i: usize, k: usize, _: &Vector<D>| 0.5 * self.ends(i, k).iter().sum::<f64>();
        let omega = |i: usize, k: usize, _: &Vector<D>| match is_all_of(i) {
            true => body.kernel(i).1[k],
            false => body.coefficients(i, families.of(i)[k]).1,
        };
        let force = match (self.accelerator, law.force_state()) {
            (Some(Accelerator::Pairwise), _) if self.is_dual => {
                BondForce::Pairwise { coefficient: &mean }
            }
            (Some(Accelerator::Pairwise), _) => BondForce::Pairwise { coefficient: &pair },
            (Some(Accelerator::Solid { bulk, shear }), _) => BondForce::Solid {
                omega: &omega,
                bulk,
                shear,
            },
            (None, Some(_)) => BondForce::Law { law, body },
            (None, None) => return Err(SystemError::Law { law: law.name() }),
        };
        let by_bond = |i: usize, k: usize, _: &Vector<D>| self.threshold(i, k);
        let broken = behaviour
            .broken
            .filter(|b| !b.is_empty())
            .map(|b| b.among(&body.cloud.position));
        let pass = bond_pass(&BondSetup {
            position: &body.cloud.position,
            volume: &body.cloud.volume,
            families,
            rows: self.rows,
            without_energy: seam.map_or(&[], NonlinearSeam::without_energy),
            force,
            kinematics: behaviour.kinematics,
            failure: match &behaviour.failure {
                None if law.damages() => Some(BondCriterion::Uniform(f64::INFINITY)),
                None => None,
                Some(BondThreshold::Uniform(s)) => Some(BondCriterion::Uniform(*s)),
                Some(BondThreshold::PerLattice(_) | BondThreshold::ByMaterials(_)) => {
                    Some(BondCriterion::PerBond(&by_bond))
                }
                Some(BondThreshold::State(state)) => Some(BondCriterion::State(&**state)),
            }
            .map(|critical| Failure {
                critical,
                no_fail: self.no_fail,
                softening: behaviour.softening,
            }),
            precracked: broken.as_ref().map(|b| b as _),
            layout: match behaviour.storage {
                Storage::Double => Layout::Automatic,
                Storage::Single => Layout::List,
            },
            storage: behaviour.storage,
            shared: self.shared,
        })?;
        Ok(pass)
    }

    /// Parts that the two ends give a bond, the own one first: a bond that acts alone has the mean of both. One behind which no family is, is the same from there.
    fn ends(&self, i: usize, k: usize) -> [f64; 2] {
        let j = self.families.of(i)[k];
        let own = self.body.coefficients(i, j).0;
        match self.families.of(j as usize).is_empty() {
            true => [own; 2],
            false => [own, self.body.coefficients(j as usize, i as u32).0],
        }
    }

    /// The stretch that breaks a bond; infinite where none does.
    fn threshold(&self, i: usize, k: usize) -> f64 {
        let cloud = &self.body.cloud;
        let j = self.families.of(i)[k] as usize;
        let material = |p: usize| cloud.material.get(p).copied().unwrap_or(0);
        let at = |end: usize| {
            let lattice = cloud.horizon.lattice_of(end);
            let of_lattice = |c: &BondThreshold| c.at(lattice, [material(i), material(j)]);
            (self.behaviour.failure.as_ref()).map_or(f64::INFINITY, of_lattice)
        };
        match cloud.bond_horizon {
            BondHorizon::Larger if cloud.horizon.of(j) > cloud.horizon.of(i) => at(j),
            _ if self.is_dual => dual_stretch([at(i), at(j)], self.ends(i, k)),
            BondHorizon::Larger | BondHorizon::OfCentre => at(i),
        }
    }
}

/// The stretch that breaks a bond whose ends have different horizons: its energy is then that at which its halves `p` would break at the stretches of either end.
fn dual_stretch([s, t]: [f64; 2], [p, q]: [f64; 2]) -> f64 {
    if s == t || p + q <= 0.0 {
        return s.min(t);
    }
    // the lower one first: both ends have the same number
    let (a, b) = (p * s * s, q * t * t);
    ((a.min(b) + a.max(b)) / (p + q)).sqrt()
}

/// Distribution of the traversed families, where they are spread over processes: the points that this process reports, and the number of bonds of each point.
pub(super) struct Holders<'a> {
    pub ranks: &'a dyn Ranks,
    pub own: Vec<bool>,
    pub sizes: Vec<u32>,
}

impl<'a> Holders<'a> {
    /// Collective.
    pub fn of<const D: usize>(
        model: &Model<D>,
        families: &Families,
        ranks: Option<&'a dyn Ranks>,
    ) -> Option<Self> {
        let (shared, ranks) = (model.shared_families()?, ranks?);
        Some(Self {
            ranks,
            own: shared.own(),
            sizes: shared.sizes_of(ranks, families),
        })
    }

    pub fn rows(&self) -> DistributedRows<'_> {
        DistributedRows {
            ranks: self.ranks,
            own: &self.own,
            sizes: &self.sizes,
        }
    }
}

/// The traversed families, where rows keep some bonds of their points to themselves, or where either end of a bond has its own horizon: such a bond stands in both families then.
pub(super) fn passed_families<const D: usize>(
    model: &Model<D>,
    operator: &Operator<'_, D>,
    body: &PdBody<D>,
    own_row: &[bool],
    is_dual: bool,
) -> Option<Families> {
    let has_bonds = |site: usize| operator.bonds_of_site(site) == BondsOfSite::Among;
    let lacks_some = (0..model.sites.len()).any(has_bonds);
    (lacks_some || is_dual).then(|| {
        let mut passed = match is_dual {
            true => body.families.completed(),
            false => body.families.clone(),
        };
        if lacks_some {
            passed.retain_of(|i| !own_row[i], |i, j| operator.holds_bond(i, j as usize));
        }
        passed.mirrored(&model.points.feet)
    })
}

/// Points with a row of the body whose families reach beyond the points that lose bonds.
pub(super) fn edge_of<const D: usize>(
    body: &PdBody<D>,
    own_row: &[bool],
    breaks: &[bool],
) -> Vec<u32> {
    let leaves = |i: usize| {
        let mut family = body.families.of(i).iter();
        family.any(|&j| !breaks[j as usize])
    };
    let all = 0..own_row.len() as u32;
    all.filter(|&i| own_row[i as usize] && leaves(i as usize))
        .collect()
}

/// The constant difference between the numbers of points and of their sites, if there is one.
pub(super) fn shift_of(site_of_point: &[u32]) -> Option<usize> {
    let first = site_of_point.first().copied().unwrap_or(0);
    site_of_point
        .iter()
        // in 64 bits, since a first point that is no site counts on beyond NONE
        .zip(u64::from(first)..)
        .all(|(&site, wanted)| u64::from(site) == wanted && site != NONE)
        .then_some(first as usize)
}

/// Sites of the points, and points whose row is that of the body.
pub(super) struct PointSites {
    pub site_of_point: Vec<u32>,
    pub bonds_of_site: Vec<u32>,
    /// Points whose row is that of the body.
    pub own_row: Vec<bool>,
}

impl PointSites {
    pub fn of<const D: usize>(
        model: &Model<D>,
        operator: &Operator<'_, D>,
        points: usize,
        is_seam: bool,
    ) -> Self {
        let mut site_of_point = vec![NONE; points];
        let mut bonds_of_site = vec![NONE; model.sites.len()];
        let mut own_row = vec![false; points];
        for (site, s) in model.sites.iter().enumerate() {
            if let SiteKind::Point(point) = s.kind {
                site_of_point[point as usize] = site as u32;
                let bonds = operator.bonds_of_site(site);
                own_row[point as usize] = is_seam || bonds == BondsOfSite::Alone;
                if is_seam || bonds != BondsOfSite::None {
                    bonds_of_site[site] = point;
                }
            }
        }
        Self {
            site_of_point,
            bonds_of_site,
            own_row,
        }
    }
}
