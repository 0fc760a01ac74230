//! The points of a moving model and their bonds.

use std::sync::{Mutex, PoisonError};

use super::heat::PointHeat;
use super::split::Split;
use crate::coupling::semidiscrete::behaviour::{
    BondBehaviour, BondThreshold, CHUNK, NONE, SystemError,
};
use crate::coupling::semidiscrete::pass_input::{
    Holders, PassInput, PointSites, edge_of, passed_families, shift_of,
};
use crate::{
    assembly::{Row, Transfer},
    coupling::{NonlinearSeam, Operator},
    model::{HorizonChange, Model, Peridynamics},
    parallel,
    peridynamics::{
        Accelerator, Families, PdBody,
        bond_force::{BondKinematics, BondPass},
        contact::{Contact, ContactSetup, contact_stiffness},
    },
    shape::Barrier,
    system::{BondChanges, FailureUpdate, Interval, Ranks},
    tensor::Vector,
};

/// The points and their bonds.
pub(super) struct MovingBody<const D: usize> {
    pub pass: Box<dyn BondPass<D>>,
    pub kinematics: BondKinematics,
    pub failure: Option<BondThreshold>,
    /// True if bonds soften before they break.
    pub softens: bool,
    /// Free expansion of bonds that take the temperature into account; none if they do not.
    pub heat: Option<PointHeat<D>>,
    /// True if the law damages bonds.
    pub damages: bool,
    /// Behind a lock because its list of pairs follows the displacements it is asked for; its results do not depend on the list.
    pub contact: Option<Mutex<Contact<D>>>,
    /// The site of each point; `NONE` for a point that follows sites.
    pub site_of_point: Vec<u32>,
    /// The constant difference between the numbers of points and of their sites, if there is one.
    pub shift: Option<usize>,
    /// Interpolation from the sites to points that are none; none where no bond and no contact needs it.
    pub transfer: Option<Transfer>,
    /// For each site the point whose force from the bonds it takes; `NONE` for a site that takes none.
    pub bonds_of_site: Vec<u32>,
    /// The traversed families, where rows keep some bonds of their points to themselves; none if all are traversed.
    passed: Option<Families>,
    /// Points whose force the sites take that they follow: the feet of families.
    pub feet: Vec<u32>,
    /// Sites whose row is that of the body alone.
    pub alone: usize,
    /// Points at the edge of the region where bonds can break; empty if none can, or if the seam reports damage itself.
    pub edge: Vec<u32>,
    pub displacement: Vec<f64>,
    pub force: Vec<f64>,
}

/// The contact of points without a bond, where the scene has it.
fn contact_of<const D: usize>(
    behaviour: &BondBehaviour<'_, D>,
    body: &PdBody<D>,
    own_row: &[bool],
    (spacing, barriers): (f64, &[Barrier<D>]),
) -> Result<Option<Mutex<Contact<D>>>, SystemError> {
    let is_crack = |b: &&Barrier<D>| matches!(b, Barrier::Crack(_));
    let contact = match behaviour.contact {
        Some(c) => Some(Mutex::new(Contact::new(&ContactSetup {
            position: &body.cloud.position,
            volume: &body.cloud.volume,
            rows: own_row,
            spacing,
            approach: c.approach,
            stiffness: c.stiffness / 15.0 * stiffest_contact(body),
            skin: 0.25 * spacing,
            cracks: barriers.iter().filter(is_crack).cloned().collect(),
            horizon: body.cloud.horizon.largest(),
        })?)),
        None => None,
    };
    Ok(contact)
}

/// Returns, for each point, true if it may lose bonds: those with a row of the body, and those that continue a lattice, which lose what the points there would lose.
fn breaking_points<const D: usize>(model: &Model<D>, own_row: &[bool]) -> Vec<bool> {
    let mut breaks = own_row.to_vec();
    for &point in &model.points.continued {
        breaks[point as usize] = true;
    }
    breaks
}

/// The fast pass of the law, if it knows all of the bonds: those of a solid have one weight from both ends.
fn accelerator<const D: usize>(
    p: &Peridynamics<D>,
    behaviour: &BondBehaviour<'_, D>,
    is_dual: bool,
) -> Option<Accelerator> {
    let known = p.accelerator().filter(|_| behaviour.suits_accelerators());
    known.filter(|accelerator| !is_dual || *accelerator == Accelerator::Pairwise)
}

impl<const D: usize> MovingBody<D> {
    pub fn new(
        model: &Model<D>,
        operator: &Operator<'_, D>,
        behaviour: &BondBehaviour<'_, D>,
        seam: Option<&NonlinearSeam<D>>,
        ranks: Option<&dyn Ranks>,
    ) -> Result<Option<Self>, SystemError> {
        let (Some(body), Some(p)) = (model.body(), model.peridynamics.as_ref()) else {
            return Ok(None);
        };
        let points = body.cloud.position.len();
        let PointSites {
            site_of_point,
            bonds_of_site,
            own_row,
        } = PointSites::of(model, operator, points, seam.is_some());
        let is_site: Vec<bool> = site_of_point.iter().map(|&s| s != NONE).collect();
        let mut has_force = is_site.clone();
        for &foot in &model.points.feet {
            has_force[foot as usize] = true;
        }
        let breaks = breaking_points(model, &own_row);
        let no_fail: Vec<bool> = parallel::map(points, 1, |i| {
            !breaks[i] || (behaviour.no_fail)(&body.cloud.position[i])
        });
        let is_dual = p.horizon_change == HorizonChange::Dual && body.mixes_horizons();
        let passed = match seam {
            None => passed_families(model, operator, body, &own_row, is_dual),
            Some(_) => None,
        };
        let families = match (seam, &passed) {
            (Some(seam), _) => seam.families(),
            (None, Some(passed)) => passed,
            (None, None) => &body.families,
        };
        let all_pass = seam.is_none() && passed.is_none();
        let may_break = behaviour.failure.is_some() || p.law.damages();
        let has_edge = may_break && seam.is_none();
        let edge = has_edge.then(|| edge_of(body, &own_row, &breaks));
        let holders = Holders::of(model, families, ranks);
        let mut pass = PassInput {
            body,
            law: &p.law,
            accelerator: accelerator(p, behaviour, is_dual),
            is_dual,
            families,
            is_whole: all_pass,
            rows: &has_force,
            no_fail: &no_fail,
            seam,
            behaviour,
            shared: holders.as_ref().map(Holders::rows),
        }
        .pass()?;
        let known = (model.peridynamic_material(), p.law.name());
        let heat = PointHeat::of(behaviour.heat.as_ref(), body, known, pass.as_mut())?;
        let contact = contact_of(behaviour, body, &own_row, (model.spacing(), &p.barriers))?;
        let asks = |i: usize| families.of(i).iter().any(|&j| !is_site[j as usize]);
        let is_asked = contact.is_some() || (0..points).any(|i| is_site[i] && asks(i));
        let shift = shift_of(&site_of_point);
        Ok(Some(Self {
            pass,
            kinematics: behaviour.kinematics,
            heat,
            failure: behaviour.failure.clone(),
            softens: behaviour.softening.is_some(),
            damages: p.law.damages(),
            contact,
            site_of_point,
            shift,
            transfer: is_asked.then(|| body.cloud.transfer.clone()),
            bonds_of_site,
            feet: model.points.feet.clone(),
            passed,
            alone: own_row.iter().filter(|own| **own).count(),
            edge: edge.unwrap_or_default(),
            displacement: vec![0.0; points * D],
            force: vec![0.0; points * D],
        }))
    }

    /// The families that the pass traverses, where no seam has bonds of its own.
    pub fn traversed<'a>(&'a self, body: &'a PdBody<D>) -> &'a Families {
        self.passed.as_ref().unwrap_or(&body.families)
    }

    /// Returns true if the pass traverses the bond between two points, where no seam has bonds of its own.
    pub fn is_passed_over(&self, i: usize, j: u32) -> bool {
        let passed = self.passed.as_ref();
        passed.is_none_or(|families| families.of(i).binary_search(&j).is_ok())
    }

    /// Returns true if every point that is a site takes a force from the traversed bonds.
    pub fn takes_all_points(&self) -> bool {
        let mut sites = self.site_of_point.iter().filter(|site| **site != NONE);
        sites.all(|&site| self.bonds_of_site[site as usize] != NONE)
    }

    /// Overwrites the forces of the points with those of bonds and contact at the displacement `u` of the sites; returns how many bonds broke and softened.
    ///
    /// Of points that are `split` among processes, the forces of others are left open, and what they broke is broken here too.
    pub fn respond(
        &mut self,
        u: &[f64],
        interval: Interval,
        update: FailureUpdate,
        split: Option<&Split<'_>>,
    ) -> BondChanges {
        let mut points = std::mem::take(&mut self.displacement);
        self.spread(u, &mut points);
        if let Some(heat) = &mut self.heat {
            heat.follow(interval.end, self.pass.as_mut());
        }
        let mut changes = (self.pass).force_into(&points, &mut self.force, interval, update);
        if let Some(split) = split {
            changes.broken = split.exchange_breaks(self.pass.as_mut(), changes.broken, update);
        }
        if let Some(contact) = &self.contact {
            let pass = &self.pass;
            contact
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .add_force(&points, &|i, j| pass.bonded(i, j), &mut self.force);
        }
        self.displacement = points;
        changes
    }

    /// Adds the forces of feet to the sites that they follow, of `points` with `D` numbers each.
    pub fn add_feet(&self, points: &[f64], force: &mut [f64]) {
        let Some(transfer) = &self.transfer else {
            return;
        };
        for &foot in &self.feet {
            let of_foot = &points[foot as usize * D..][..D];
            for (site, weight) in transfer.row(foot as usize) {
                let to = &mut force[site as usize * D..][..D];
                to.iter_mut()
                    .zip(of_foot)
                    .for_each(|(f, x)| *f += weight * x);
            }
        }
    }

    /// Adds row sums of feet to the sites that they follow, each times `spread`.
    pub fn add_row_sums_of_feet(&self, points: &[f64], spread: f64, sums: &mut [f64]) {
        let sized: Vec<f64> = points.iter().map(|s| s * spread).collect();
        self.add_feet(&sized, sums);
    }

    /// Adds the tangent rows of the feet that follow a site.
    pub fn add_rows_of_feet(&self, body: &PdBody<D>, site: u32, row: &mut Row<D>) {
        let Some(transfer) = &self.transfer else {
            return;
        };
        for &foot in &self.feet {
            let mut of_foot = transfer.row(foot as usize);
            if let Some((_, weight)) = of_foot.find(|(s, _)| *s == site) {
                body.add_force_row(foot as usize, |_| weight, row);
            }
        }
    }

    /// Sets the displacements of some points by those of the sites, where points do not simply follow one another among these.
    pub fn spread_some(&mut self, u: &[f64], points: &[u32]) {
        if self.shift.is_some() {
            return;
        }
        for &point in points {
            let point = point as usize;
            let to = &mut self.displacement[point * D..][..D];
            match (self.site_of_point[point], &self.transfer) {
                (NONE, None) => {}
                (NONE, Some(transfer)) => {
                    let x: Vector<D> = transfer.displacement(point, u);
                    to.copy_from_slice(x.as_slice());
                }
                (site, _) => to.copy_from_slice(&u[site as usize * D..][..D]),
            }
        }
    }

    /// The displacement of every point, from those of the sites.
    pub fn spread(&self, u: &[f64], points: &mut [f64]) {
        if let Some(shift) = self.shift {
            points.copy_from_slice(&u[shift * D..][..points.len()]);
            return;
        }
        parallel::for_each_chunk(points, CHUNK * D, 1, |chunk, values| {
            for (k, value) in values.chunks_exact_mut(D).enumerate() {
                let point = chunk * CHUNK + k;
                match self.site_of_point[point] {
                    NONE => {
                        if let Some(transfer) = &self.transfer {
                            let x: Vector<D> = transfer.displacement(point, u);
                            value.copy_from_slice(x.as_slice());
                        }
                    }
                    site => value.copy_from_slice(&u[site as usize * D..][..D]),
                }
            }
        });
    }
}

/// The stiffness of contact, [`contact_stiffness`]: of each lattice that of the point with the most bonds. The stiffest lattice or material keeps all apart.
fn stiffest_contact<const D: usize>(body: &PdBody<D>) -> f64 {
    // `c` of `f = c s`, the largest of the bonds of a point
    let bond_constant = |i: usize| {
        let family = body.families.of(i).iter().zip(body.kernel(i).0);
        family
            .map(|(&j, p)| 2.0 * p * body.bond(i, j as usize).norm().powi(3))
            .fold(0.0, f64::max)
    };
    let of_point = |i: usize| contact_stiffness(bond_constant(i), body.cloud.horizon.of(i));
    let points = 0..body.families.len();
    if !body.cloud.material.is_empty() {
        return points.map(of_point).fold(0.0, f64::max);
    }
    let mut fullest: Vec<Option<usize>> = Vec::new();
    for i in points {
        let lattice = body.cloud.horizon.lattice_of(i);
        if fullest.len() <= lattice {
            fullest.resize(lattice + 1, None);
        }
        let size = |i: usize| body.families.of(i).len();
        if fullest[lattice].is_none_or(|other| size(i) >= size(other)) {
            fullest[lattice] = Some(i);
        }
    }
    let fullest = fullest.into_iter().flatten();
    fullest.map(of_point).fold(0.0, f64::max)
}

/// Volume that the bonds of a point reach.
pub(super) fn reached<const D: usize>(body: &PdBody<D>, families: &Families, point: u32) -> f64 {
    let family = families.of(point as usize).iter();
    family.map(|&j| body.cloud.volume[j as usize]).sum()
}
