//! A coupled model that moves: bonds that stretch, and break, beside the rows of finite elements and of the seam.
//!
//! Sites whose row is that of the peridynamic body alone ([`Operator::is_body_row`]) take their force from a pass over the bonds, which may be geometrically exact
//! and break; every other site takes it from its row of the linear stiffness, which those bonds do not enter. At rest both are the operator of the static solve.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use self::{energy::ElementEnergy, rows::SiteRows};
use crate::{
    assembly::{self, Transfer},
    coupling::{Model, Operator, SiteKind},
    fem,
    peridynamics::{
        BondEnergy, PdBody,
        contact::{Contact, ContactError, ContactSetup, contact_stiffness},
        kernel::{
            BondForce, BondPass, BondSetup, CriticalStretch, Failure, KernelError, Kinematics,
            Layout, Storage, bond_pass,
        },
    },
    system::{BlockCsr, Breakage, Dynamic, Symmetry},
    tensor::Vector,
};

mod energy;
mod rows;

#[cfg(test)]
#[path = "motion_tests.rs"]
mod tests;

const NONE: u32 = u32::MAX;

/// Points per task of the copies between sites and points.
const CHUNK: usize = 4096;

/// How the bonds of a moving model behave.
pub struct BondBehaviour<'a, const D: usize> {
    /// Whether bonds turn with the body, or are linear in the displacement.
    pub kinematics: Kinematics,
    /// Critical stretch s_c; none if nothing breaks.
    pub critical_stretch: Option<f64>,
    /// Where bonds never break.
    pub no_fail: &'a (dyn Fn(&Vector<D>) -> bool + Sync),
    /// Contact of points that no bond joins; none if they may pass through each other.
    pub contact: Option<ContactBehaviour>,
}

/// How points that no bond joins keep their distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactBehaviour {
    /// Part of their distance at rest to which two points may approach each other.
    pub approach: f64,
    /// Stiffness of the repulsion relative to a bond as long as the horizon; 15 in EMU.
    pub stiffness: f64,
}

/// Why a model cannot move bond by bond.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The law has no bonds that could stretch or break one by one.
    #[error(
        "bonds of the material {law} are known to first order only: they can neither break nor turn; use bond-based or lps, or leave fracture-energy, critical-stretch and bonds = \"exact\" out"
    )]
    Law {
        /// Its name.
        law: &'static str,
    },
    /// The bonds cannot be passed over.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// The contact cannot be set up.
    #[error(transparent)]
    Contact(#[from] ContactError),
}

/// A coupled model as a system that moves.
pub struct Motion<'a, const D: usize> {
    model: &'a Model<D>,
    symmetry: Symmetry,
    mass: Vec<f64>,
    /// Rows of all sites but those of the body alone; of sites that share the body's bonds, what is left of them.
    linear: SiteRows,
    /// Their products, kept between passes.
    products: Vec<f64>,
    body: Option<MovingBody<D>>,
    energy: ElementEnergy,
}

/// The points and their bonds.
struct MovingBody<const D: usize> {
    pass: Box<dyn BondPass<D>>,
    critical_stretch: Option<f64>,
    /// Behind a lock because its list of pairs follows the displacements it is asked for; its results do not depend on the list.
    contact: Option<Mutex<Contact<D>>>,
    /// The site of each point; `NONE` for a point that follows sites.
    site_of_point: Vec<u32>,
    /// All points follow this many sites later, if they do.
    shift: Option<usize>,
    transfer: Transfer,
    /// For each site the point whose force from the bonds it takes; `NONE` for a site that takes none.
    bonds_of_site: Vec<u32>,
    /// Sites whose row is that of the body alone.
    alone: usize,
    /// Points at the edge of the region where bonds can break, none if nothing can.
    edge: Vec<u32>,
    displacement: Vec<f64>,
    force: Vec<f64>,
}

impl<'a, const D: usize> Motion<'a, D> {
    /// Lays out masses, rows and bonds.
    ///
    /// `density` gives ρ [kg/m^D] of a material's number; `symmetry` is that of the assembled stiffness.
    ///
    /// # Errors
    /// [`MotionError`] if the bonds cannot be passed over: a horizon that varies, fitted weights, a law without a kernel. A model in which nothing breaks moves as
    /// [`crate::system::LinearMotion`] instead.
    pub fn new(
        model: &'a Model<D>,
        operator: &dyn Operator<D>,
        symmetry: Symmetry,
        density: impl Fn(u16) -> f64 + Sync,
        behaviour: &BondBehaviour<'_, D>,
    ) -> Result<Self, MotionError> {
        let sites = model.sites.len();
        let body = MovingBody::new(model, operator, behaviour)?;
        let linear = SiteRows::assemble(
            sites,
            |site| !operator.is_body_row(site),
            |site, row| {
                operator.add_row(site, row);
                if let (true, Some((body, point))) =
                    (operator.has_body_bonds(site), model.point_of(site))
                {
                    // the bonds are passed over anyway
                    row.subtract(|row| body.add_force_row(point, |_| -1.0, row));
                }
            },
        );
        let mass = masses(model, density);
        let energy = ElementEnergy::new(model);
        Ok(Self {
            model,
            symmetry,
            mass,
            linear,
            products: Vec::new(),
            body,
            energy,
        })
    }

    /// The pass over the bonds, if there is a peridynamic body.
    pub fn pass(&self) -> Option<&dyn BondPass<D>> {
        self.body.as_ref().map(|b| b.pass.as_ref())
    }

    /// Bytes held by rows and bonds.
    pub fn memory_bytes(&self) -> usize {
        self.linear.memory_bytes()
            + self.body.as_ref().map_or(0, |b| {
                b.pass.memory_bytes() + (b.displacement.len() + b.force.len()) * 8
            })
    }
}

/// Lumped mass of every site \[kg\]: the integral of a node's shape function or the volume of a point, times the density.
pub fn masses<const D: usize>(model: &Model<D>, density: impl Fn(u16) -> f64) -> Vec<f64> {
    let nodes = fem::lumped_mass(&model.mesh, |c| density(model.material_of_cell(c)));
    let points = density(model.peridynamic_material());
    model
        .sites
        .iter()
        .map(|site| match site.kind {
            SiteKind::Node(n) => nodes[n as usize],
            SiteKind::Point(_) => points * site.volume,
        })
        .collect()
}

impl<const D: usize> MovingBody<D> {
    fn new(
        model: &Model<D>,
        operator: &dyn Operator<D>,
        behaviour: &BondBehaviour<'_, D>,
    ) -> Result<Option<Self>, MotionError> {
        let (Some(body), Some(p)) = (model.body(), model.peridynamics.as_ref()) else {
            return Ok(None);
        };
        let points = body.cloud.position.len();
        let mut site_of_point = vec![NONE; points];
        let mut bonds_of_site = vec![NONE; model.sites.len()];
        let mut own_row = vec![false; points];
        for (site, s) in model.sites.iter().enumerate() {
            if let SiteKind::Point(point) = s.kind {
                site_of_point[point as usize] = site as u32;
                if operator.is_body_row(site) {
                    own_row[point as usize] = true;
                }
                if operator.is_body_row(site) || operator.has_body_bonds(site) {
                    bonds_of_site[site] = point;
                }
            }
        }
        let is_site: Vec<bool> = site_of_point.iter().map(|&s| s != NONE).collect();
        let no_fail: Vec<bool> = (0..points)
            .into_par_iter()
            .map(|i| !own_row[i] || (behaviour.no_fail)(&body.cloud.position[i]))
            .collect();
        let edge = if behaviour.critical_stretch.is_some() {
            (0..points as u32)
                .filter(|&i| {
                    own_row[i as usize]
                        && body
                            .families
                            .of(i as usize)
                            .iter()
                            .any(|&j| !own_row[j as usize])
                })
                .collect()
        } else {
            Vec::new()
        };
        let pair = |i: usize, k: usize, _: &Vector<D>| body.kernel(i).0[k];
        let omega = |i: usize, k: usize, _: &Vector<D>| body.kernel(i).1[k];
        let force = match p.law.bond_energy(body.cloud.horizon[0]) {
            Some(BondEnergy::Pairwise { .. }) => BondForce::Pairwise { coefficient: &pair },
            Some(BondEnergy::Lps { bulk, shear, .. }) => BondForce::Solid {
                omega: &omega,
                bulk,
                shear,
            },
            None => return Err(MotionError::Law { law: p.law.name() }),
        };
        let pass = bond_pass(&BondSetup {
            position: &body.cloud.position,
            volume: &body.cloud.volume,
            families: &body.families,
            rows: &is_site,
            force,
            kinematics: behaviour.kinematics,
            failure: behaviour.critical_stretch.map(|s| Failure {
                critical: CriticalStretch::Uniform(s),
                no_fail: &no_fail,
            }),
            precracked: None,
            layout: Layout::Automatic,
            storage: Storage::Double,
        })?;
        let contact = match behaviour.contact {
            Some(c) => Some(Mutex::new(Contact::new(&ContactSetup {
                position: &body.cloud.position,
                volume: &body.cloud.volume,
                rows: &own_row,
                spacing: model.spacing(),
                approach: c.approach,
                stiffness: c.stiffness / 15.0
                    * contact_stiffness(bond_constant(body), body.cloud.horizon[0]),
                skin: 0.25 * model.spacing(),
            })?)),
            None => None,
        };
        let first = site_of_point.first().copied().unwrap_or(0);
        let shift = site_of_point
            .iter()
            // in 64 bits, since a first point that is no site counts on beyond NONE
            .zip(u64::from(first)..)
            .all(|(&site, wanted)| u64::from(site) == wanted && site != NONE)
            .then_some(first as usize);
        Ok(Some(Self {
            pass,
            critical_stretch: behaviour.critical_stretch,
            contact,
            site_of_point,
            shift,
            transfer: body.cloud.transfer.clone(),
            bonds_of_site,
            alone: own_row.iter().filter(|own| **own).count(),
            edge,
            displacement: vec![0.0; points * D],
            force: vec![0.0; points * D],
        }))
    }

    /// The displacement of every point, from those of the sites.
    fn spread(&self, u: &[f64], points: &mut [f64]) {
        if let Some(shift) = self.shift {
            points.copy_from_slice(&u[shift * D..][..points.len()]);
            return;
        }
        points
            .par_chunks_mut(CHUNK * D)
            .enumerate()
            .for_each(|(chunk, values)| {
                for (k, value) in values.chunks_exact_mut(D).enumerate() {
                    let point = chunk * CHUNK + k;
                    match self.site_of_point[point] {
                        NONE => {
                            let x: Vector<D> = self.transfer.displacement(point, u);
                            value.copy_from_slice(x.as_slice());
                        }
                        site => value.copy_from_slice(&u[site as usize * D..][..D]),
                    }
                }
            });
    }
}

/// `c` of `f = c s`, the largest of the bonds of the point with the most of them.
fn bond_constant<const D: usize>(body: &PdBody<D>) -> f64 {
    let fullest = (0..body.families.len()).max_by_key(|&i| body.families.of(i).len());
    fullest.map_or(0.0, |i| {
        let family = body.families.of(i).iter().zip(body.kernel(i).0);
        family
            .map(|(&j, p)| 2.0 * p * body.bond(i, j as usize).norm().powi(3))
            .fold(0.0, f64::max)
    })
}

impl<const D: usize> Dynamic for Motion<'_, D> {
    fn block(&self) -> usize {
        D
    }

    fn mass(&self) -> &[f64] {
        &self.mass
    }

    fn internal_force_into(&mut self, u: &[f64], force: &mut [f64], breakage: Breakage) -> u64 {
        let Some(body) = &mut self.body else {
            self.linear
                .multiply_into::<D>(u, None, &mut self.products, force);
            return 0;
        };
        let mut points = std::mem::take(&mut body.displacement);
        body.spread(u, &mut points);
        let broken = body.pass.force_into(&points, &mut body.force, breakage);
        if let Some(contact) = &body.contact {
            let pass = &body.pass;
            contact
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .add_force(&points, &|i, j| pass.bonded(i, j), &mut body.force);
        }
        body.displacement = points;
        let bonds = Some((&body.bonds_of_site[..], &body.force[..]));
        self.linear
            .multiply_into::<D>(u, bonds, &mut self.products, force);
        broken
    }

    fn tangent_into(&self, x: &[f64], y: &mut [f64]) {
        let Some(body) = &self.body else {
            self.linear.multiply_into::<D>(x, None, &mut Vec::new(), y);
            return;
        };
        let mut points = vec![0.0; body.displacement.len()];
        let mut force = points.clone();
        body.spread(x, &mut points);
        body.pass.tangent_into(&points, &mut force);
        let bonds = Some((&body.bonds_of_site[..], &force[..]));
        self.linear.multiply_into::<D>(x, bonds, &mut Vec::new(), y);
    }

    fn row_sums(&self) -> Vec<f64> {
        let mut sums = self.linear.row_sums::<D>();
        let Some(body) = &self.body else { return sums };
        let points = body.pass.row_sums();
        // a point that follows sites spreads its column over them: at most the sum of its weights' sizes
        let spread = (0..body.site_of_point.len())
            .map(|p| body.transfer.row(p).map(|(_, w)| w.abs()).sum::<f64>())
            .fold(1.0, f64::max);
        let contact = body
            .contact
            .as_ref()
            .map(|c| c.lock().unwrap_or_else(PoisonError::into_inner));
        for (sums, &point) in sums.chunks_exact_mut(D).zip(&body.bonds_of_site) {
            if point == NONE {
                continue;
            }
            let point = point as usize;
            let touching = contact.as_ref().map_or(0.0, |c| c.row_sum(point));
            for (sum, of_bonds) in sums.iter_mut().zip(&points[point * D..]) {
                *sum += of_bonds * spread + touching;
            }
        }
        sums
    }

    fn hidden_rate(&self) -> f64 {
        let Some(body) = &self.body else { return 0.0 };
        let Some(contact) = &body.contact else {
            return 0.0;
        };
        let contact = contact.lock().unwrap_or_else(PoisonError::into_inner);
        body.bonds_of_site
            .iter()
            .zip(&self.mass)
            .filter(|(point, _)| **point != NONE)
            .map(|(&point, mass)| contact.stiffest(point as usize) / mass)
            .fold(0.0, f64::max)
    }

    fn unbreakable(&self) -> Vec<bool> {
        let breaks = self
            .body
            .as_ref()
            .is_some_and(|b| b.critical_stretch.is_some());
        (0..self.mass.len())
            .map(|site| !breaks || self.linear.has(site))
            .collect()
    }

    fn tangent_rows(&self, sites: &[u32]) -> BlockCsr {
        assembly::assemble_rows(
            sites.len(),
            self.mass.len(),
            |_| (),
            |r, row| {
                let site = sites[r] as usize;
                self.linear.add_row(site, row);
                if let (Some(moving), Some(body)) = (&self.body, self.model.body())
                    && moving.bonds_of_site[site] != NONE
                {
                    body.add_force_row(moving.bonds_of_site[site] as usize, |_| 1.0, row);
                }
            },
        )
    }

    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    fn stored_energy(&self, u: &[f64]) -> f64 {
        let is_body_alone = self
            .body
            .as_ref()
            .is_some_and(|b| b.alone == self.mass.len());
        if self.symmetry == Symmetry::Symmetric && !is_body_alone {
            // a seam that has an energy: that of the whole, to first order in the stretch of exact bonds
            let mut force = vec![0.0; u.len()];
            self.tangent_into(u, &mut force);
            let products: Vec<f64> = u
                .par_chunks(CHUNK)
                .zip(force.par_chunks(CHUNK))
                .map(|(u, f)| u.iter().zip(f).map(|(u, f)| u * f).sum())
                .collect();
            return 0.5 * products.iter().sum::<f64>();
        }
        let elements = self
            .energy
            .of::<D>(&self.linear, &self.model.node_transfer, u);
        let bonds = self.body.as_ref().map_or(0.0, |body| {
            let mut points = vec![0.0; body.displacement.len()];
            body.spread(u, &mut points);
            let contact = body.contact.as_ref().map_or(0.0, |contact| {
                contact
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .energy(&points, &|i, j| body.pass.bonded(i, j))
            });
            body.pass.stored_energy(&points) + contact
        });
        elements + bonds
    }

    fn dissipated_energy(&self) -> Option<f64> {
        let moving = self.body.as_ref()?;
        let s = moving.critical_stretch?;
        let body = self.model.body()?;
        if moving.pass.broken() == 0 {
            return Some(0.0);
        }
        let cloud = &body.cloud;
        let mut damage = vec![0.0; cloud.position.len()];
        moving.pass.damage_into(&mut damage);
        // each end of a bond has half of p r² (r s_c)² V_i V_j; of an LPS the pairwise part, its dilatation has no energy of single bonds
        let energies: Vec<f64> = (0..damage.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                if damage[i] == 0.0 || moving.site_of_point[i] == NONE {
                    return 0.0;
                }
                let pair = body.kernel(i).0;
                let family = body.families.of(i).iter().zip(pair);
                family
                    .filter(|&(&j, _)| !moving.pass.bonded(i, j as usize))
                    .map(|(&j, p)| {
                        let r2 = body.bond(i, j as usize).norm_squared();
                        0.5 * p * r2 * r2 * s * s * cloud.volume[i] * cloud.volume[j as usize]
                    })
                    .sum()
            })
            .collect();
        Some(energies.iter().sum())
    }

    fn damage(&self) -> Option<Vec<f64>> {
        let body = self.body.as_ref()?;
        let mut points = vec![0.0; body.site_of_point.len()];
        body.pass.damage_into(&mut points);
        let mut damage = vec![0.0; self.mass.len()];
        for (point, &site) in body.site_of_point.iter().enumerate() {
            if site != NONE {
                damage[site as usize] = points[point];
            }
        }
        Some(damage)
    }

    fn damage_at_edge(&self) -> Option<usize> {
        let body = self.body.as_ref()?;
        // asked for after every pass that broke a bond: only the points at the edge are looked at
        body.edge
            .iter()
            .find(|&&p| body.pass.is_damaged(p as usize))
            .map(|&p| body.site_of_point[p as usize] as usize)
    }

    fn damage_state(&self) -> Vec<u64> {
        self.body
            .as_ref()
            .map_or_else(Vec::new, |b| b.pass.damage_state())
    }

    fn restore_damage(&mut self, state: &[u64]) -> bool {
        match &mut self.body {
            Some(body) => body.pass.restore_damage(state),
            None => state.is_empty(),
        }
    }
}
