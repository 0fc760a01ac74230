//! Which bonds of a seam break: those whose two ends have moved too far apart, whatever their pieces do.
//!
//! A piece may be shorter than the spacing, and the trace at its end may follow nodes and points around: its own stretch is not that of its bond. An end in the zone moves with its point, one in an element with the shape functions
//! there. Of a bond that leaves the mesh, the part within it counts.

use rayon::prelude::*;

use super::{CHUNK, NonlinearSeam};
use crate::{
    assembly::Transfer,
    coupling::{Model, SiteKind},
    fem::Locator,
    peridynamics::{PdBody, bond_force::Kinematics},
    tensor::Vector,
};

use super::super::bond_kinematics::Part;

/// How many places of a bond are tried, from an end outside of the mesh on.
const PLACES: u32 = 16;

/// What moves a place: sites and weights.
type Carrier = Vec<(u32, f64)>;

/// When bonds break.
pub(super) struct Breaking<const D: usize> {
    /// The value of t at the critical stretch of each bond.
    limit: Vec<f64>,
    never: Vec<bool>,
    /// What counts of each bond, as one part.
    part: Vec<Part<D>>,
    /// Difference of displacement over each of them.
    difference: Transfer,
}

impl<const D: usize> Breaking<D> {
    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.part.len() * (size_of::<Part<D>>() + 17) + self.difference.weight_count() * 12
    }
}

impl<const D: usize> NonlinearSeam<D> {
    /// Lets bonds break: by the numbers of its points at which stretch, and of a point whether its bonds never do.
    pub(in crate::coupling) fn let_break(
        &mut self,
        model: &Model<D>,
        body: &PdBody<D>,
        critical: impl Fn([u32; 2]) -> f64,
        never: impl Fn(u32) -> bool,
    ) {
        let own = &self.bonds[..self.own];
        let carriers = Carriers::new(model, body);
        let (part, rows): (Vec<_>, Vec<_>) = (own.par_iter().enumerate())
            .map(|(bond, [i, j])| {
                let xi = body.bond(*i as usize, *j as usize);
                let counted = carriers.of_bond(*i, *j, &xi);
                let (length, row) = counted.unwrap_or_else(|| self.longest_piece(bond));
                let part = Part {
                    xi: xi.into(),
                    stiffness: 0.0,
                    length,
                    bond: bond as u32,
                };
                (part, row)
            })
            .unzip();
        self.breaks = Some(Breaking {
            limit: own
                .iter()
                .map(|bond| self.kinematics.limit(critical(*bond)))
                .collect(),
            never: own
                .iter()
                .map(|bond| bond.iter().any(|&p| never(p)))
                .collect(),
            part,
            difference: Transfer::from_rows(rows),
        });
    }

    fn longest_piece(&self, bond: usize) -> (f64, Carrier) {
        let parts = self.first[bond] as usize..self.first[bond + 1] as usize;
        let length = |p: &usize| self.parts[*p].length;
        let longest = parts.max_by(|p, q| length(p).total_cmp(&length(q)));
        let longest = longest.expect("a bond of a seam has a piece");
        (length(&longest), self.difference.row(longest).collect())
    }

    /// Breaks the bonds that are over the limit; returns how many, each counted once for each direction.
    pub(super) fn break_bonds(&mut self, u: &[f64]) -> u64 {
        let Some(breaks) = &self.breaks else { return 0 };
        let is_over = |bond: usize| {
            let difference = breaks.difference.displacement(bond, u);
            let strained = match self.kinematics {
                Kinematics::Exact => breaks.part[bond].strained::<true>(&difference),
                Kinematics::Linear => breaks.part[bond].strained::<false>(&difference),
            };
            strained.excess > breaks.limit[bond] * strained.square
        };
        let bonds = (0..self.own).into_par_iter().with_min_len(CHUNK);
        let may = bonds.filter(|&bond| self.stands(bond as u32) && !breaks.never[bond]);
        let over: Vec<usize> = may.filter(|&bond| is_over(bond)).collect();
        for &bond in &over {
            self.intact[bond / 8] &= !(1 << (bond % 8));
            self.last.push(bond as u32);
        }
        2 * over.len() as u64
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
