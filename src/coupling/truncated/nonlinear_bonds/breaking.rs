//! Breaking of the bonds of a seam, by the stretch of whole bonds, not of their pieces.
//!
//! A piece may be shorter than the spacing, and the trace at its end may follow nodes and points around: its own stretch is not that of its bond. An end in the zone moves with its point, one in an element with the shape functions
//! there. Of a bond that leaves the mesh, the part within it counts.

use crate::{
    assembly::Transfer,
    fem::Locator,
    model::{Model, SiteKind},
    parallel,
    peridynamics::{PdBody, bond_force::BondKinematics},
    tensor::Vector,
};

use super::super::bond_kinematics::{Part, Strained};

/// Bonds per task.
const CHUNK: usize = 1024;

/// Number of places of a bond that are tried, from an end outside of the mesh on.
const PLACES: u32 = 16;

/// Sites that move a place, with their weights.
pub(super) type Carrier = Vec<(u32, f64)>;

/// When bonds break.
pub(super) struct Breaking<const D: usize> {
    /// The value of t at which each bond breaks, or begins to soften.
    limit: Vec<f64>,
    never: Vec<bool>,
    /// Part of each bond that counts for its stretch.
    part: Vec<Part<D>>,
    /// Difference of displacement over each of them.
    difference: Transfer,
}

impl<const D: usize> Breaking<D> {
    /// For bonds by the numbers of their points: at which stretch one breaks, of a point whether its bonds never do, and the longest piece of a bond, its length and difference of displacement, which counts where its ends are not found.
    pub fn new(
        (model, body): (&Model<D>, &PdBody<D>),
        bonds: &[[u32; 2]],
        limit: impl Fn([u32; 2]) -> f64,
        never: impl Fn(u32) -> bool,
        longest_piece: impl Fn(usize) -> (f64, Carrier) + Sync,
    ) -> Self {
        let carriers = Carriers::new(model, body);
        let parts = parallel::map(bonds.len(), 1, |bond| {
            let [i, j] = bonds[bond];
            let xi = body.bond(i as usize, j as usize);
            let counted = carriers.of_bond(i, j, &xi);
            let (length, row) = counted.unwrap_or_else(|| longest_piece(bond));
            let part = Part {
                xi: xi.into(),
                stiffness: 0.0,
                length,
                bond: bond as u32,
            };
            (part, row)
        });
        let (part, rows): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let fails = |bond: &[u32; 2]| bond.iter().any(|&p| never(p));
        Self {
            limit: bonds.iter().map(|bond| limit(*bond)).collect(),
            never: bonds.iter().map(fails).collect(),
            part,
            difference: Transfer::from_rows(model.sites.len(), rows),
        }
    }

    /// The bonds that still stand and are over the limit.
    pub fn over(
        &self,
        kinematics: BondKinematics,
        stands: impl Fn(usize) -> bool + Sync,
        u: &[f64],
    ) -> Vec<usize> {
        let is_over = |bond: usize| {
            let strained = self.strained(kinematics, bond, u);
            strained.excess > self.limit[bond] * strained.square
        };
        parallel::filter_map(self.part.len(), CHUNK, |bond| {
            (stands(bond) && !self.never[bond] && is_over(bond)).then_some(bond)
        })
    }

    fn strained(&self, kinematics: BondKinematics, bond: usize, u: &[f64]) -> Strained<D> {
        let difference = self.difference.displacement(bond, u);
        match kinematics {
            BondKinematics::Exact => self.part[bond].strained::<true>(&difference),
            BondKinematics::Linear => self.part[bond].strained::<false>(&difference),
        }
    }

    /// Stretch of a bond \[1\].
    pub fn stretch(&self, kinematics: BondKinematics, bond: usize, u: &[f64]) -> f64 {
        let strained = self.strained(kinematics, bond, u);
        strained.elongation / (self.part[bond].length * strained.square)
    }

    /// The value of t at which a bond breaks, or begins to soften.
    pub fn limit(&self, bond: usize) -> f64 {
        self.limit[bond]
    }

    /// Returns the sites that move the ends of a bond, with their weights in the difference of displacement.
    pub fn carrier(&self, bond: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.difference.row(bond)
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.part.len() * (size_of::<Part<D>>() + 17) + self.difference.matrix().nnz() * 12
    }
}

/// Finds what moves the ends of bonds.
struct Carriers<'a, const D: usize> {
    model: &'a Model<D>,
    body: &'a PdBody<D>,
    /// Site of each point of the cloud that is one.
    site: Vec<Option<u32>>,
    elements: Locator<D>,
}

impl<'a, const D: usize> Carriers<'a, D> {
    fn new(model: &'a Model<D>, body: &'a PdBody<D>) -> Self {
        let mut site = vec![None; body.cloud.position.len()];
        for (s, of) in model.sites.iter().enumerate() {
            if let SiteKind::Point(p) = of.kind {
                site[p as usize] = Some(s as u32);
            }
        }
        let cells = 0..model.mesh.cell_count();
        Self {
            model,
            body,
            site,
            elements: Locator::new(&model.mesh, cells.filter(|&c| model.is_element(c))),
        }
    }

    /// The part of a bond that lies within the mesh, and the difference of displacement over it; none if the elements at its ends are too thin to be found.
    fn of_bond(&self, i: u32, j: u32, xi: &Vector<D>) -> Option<(f64, Carrier)> {
        let ((near, from), (far, to)) = (self.end(i, xi)?, self.end(j, &-xi)?);
        let difference = from.into_iter().map(|(site, w)| (site, -w)).chain(to);
        (near + far < 1.0).then(|| (1.0 - near - far, difference.collect()))
    }

    /// The place within the mesh next to the end of a bond, as a part of it from that end on, and what moves it.
    fn end(&self, point: u32, xi: &Vector<D>) -> Option<(f64, Carrier)> {
        if let Some(site) = self.site[point as usize] {
            return Some((0.0, vec![(site, 1.0)]));
        }
        let from = &self.body.cloud.position[point as usize];
        let mut places = (0..PLACES).map(|k| f64::from(k) / f64::from(PLACES));
        places.find_map(|part| Some((part, self.in_element(&(from + xi * part))?)))
    }

    fn in_element(&self, x: &Vector<D>) -> Option<Carrier> {
        let mesh = &self.model.mesh;
        let found = self.elements.locate(mesh, x, 1e-9)?;
        let nodes = mesh.cell(found.cell).iter().zip(&found.shape);
        let of_node = |(&n, &shape): (&u32, &f64)| {
            let row = self.model.node_transfer.row(n as usize);
            row.map(move |(site, w)| (site, w * shape))
                .collect::<Vec<_>>()
        };
        Some(nodes.flat_map(of_node).collect())
    }
}
