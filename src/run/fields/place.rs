//! Places of a solution that fields have values at.

use std::cell::OnceCell;

use crate::fem;
use crate::model::{Carrier, Zone};
use crate::peridynamics::PdBody;
use crate::run::intact::Intact;
use crate::run::slopes::{Slope, Teller};
use crate::run::solution::Solved;
use crate::run::stresses::{Expansions, Stress};
use crate::tensor::{Tensor, Vector};

/// Bonds that stand and free expansions, once for all places of a solution.
pub(in crate::run) struct Shared {
    pub intact: Intact,
    pub expansions: Expansions,
}

impl Shared {
    /// Of a solution.
    pub fn of<const D: usize>(solved: &Solved<'_, D>) -> Self {
        Self {
            intact: Intact::of(solved),
            expansions: Expansions::of(solved),
        }
    }
}

/// Node, element or point at a place.
#[derive(Clone, Copy, Debug)]
pub(in crate::run) enum Spot {
    /// A node of elements, and its site if it is one.
    Node { node: usize, site: Option<usize> },
    /// The whole of an element.
    Element(usize),
    /// A part of an element that is cut, with its volume.
    Part(usize, f64),
    /// Reference coordinates in an element.
    InElement(usize, [f64; 3]),
    /// A peridynamic point, by its site.
    Point(usize),
}

impl From<Carrier> for Spot {
    fn from(carrier: Carrier) -> Self {
        match carrier {
            Carrier::Element(c, xi) => Self::InElement(c, xi),
            Carrier::Point(site) => Self::Point(site),
        }
    }
}

/// A place of a solution; gradient and stress are computed once, where a field asks for them.
pub(in crate::run) struct Place<'a, const D: usize> {
    pub solved: &'a Solved<'a, D>,
    pub shared: &'a Shared,
    pub spot: Spot,
    position: Option<Vector<D>>,
    displacement: Option<Vector<D>>,
    /// Those that tell strain and stress between them, where not one alone does.
    slope: Option<&'a Slope>,
    gradient: OnceCell<Tensor<D>>,
    /// Displacement gradient of the carrier.
    of_carrier: OnceCell<Tensor<D>>,
    stress: OnceCell<Stress<D>>,
}

impl<'a, const D: usize> Place<'a, D> {
    /// A node, an element or a point.
    pub fn new(solved: &'a Solved<'a, D>, shared: &'a Shared, spot: Spot) -> Self {
        Self {
            solved,
            shared,
            spot,
            position: None,
            displacement: None,
            slope: None,
            gradient: OnceCell::new(),
            of_carrier: OnceCell::new(),
            stress: OnceCell::new(),
        }
    }

    /// A position with the displacement there, if that is of its sites; gradients where they are known already: that at the place, and that of its carrier.
    pub fn of_position(
        solved: &'a Solved<'a, D>,
        shared: &'a Shared,
        (x, carrier, displacement): (&Vector<D>, Carrier, Option<Vector<D>>),
        slope: Option<&'a Slope>,
        gradients: Option<[Tensor<D>; 2]>,
    ) -> Self {
        let known = |k: usize| gradients.map_or_else(OnceCell::new, |g| OnceCell::from(g[k]));
        Self {
            position: Some(*x),
            displacement,
            slope,
            gradient: known(0),
            of_carrier: known(1),
            ..Self::new(solved, shared, carrier.into())
        }
    }

    /// Position \[m\]; of a whole element, or of its part, its centroid.
    pub fn position(&self) -> Vector<D> {
        let model = self.solved.model;
        self.position.unwrap_or_else(|| match self.spot {
            Spot::Node { node, .. } => model.mesh.nodes[node],
            Spot::Point(site) => model.sites[site].position,
            Spot::InElement(c, xi) => fem::place_in(&model.mesh, c, &xi),
            Spot::Element(c) | Spot::Part(c, _) => model.mesh.centroid(c),
        })
    }

    /// Site, of a point and of a node that is one.
    pub fn site(&self) -> Option<usize> {
        match self.spot {
            Spot::Node { site, .. } => site,
            Spot::Point(site) => Some(site),
            Spot::Element(_) | Spot::Part(..) | Spot::InElement(..) => None,
        }
    }

    /// Element.
    pub fn cell(&self) -> Option<usize> {
        match self.spot {
            Spot::Element(c) | Spot::Part(c, _) | Spot::InElement(c, _) => Some(c),
            Spot::Node { .. } | Spot::Point(_) => None,
        }
    }

    /// Peridynamic body, and the number of the point in it.
    pub fn point(&self) -> Option<(&'a PdBody<D>, usize)> {
        match self.spot {
            Spot::Point(site) => self.solved.model.point_of(site),
            Spot::Node { .. } | Spot::Element(_) | Spot::Part(..) | Spot::InElement(..) => None,
        }
    }

    /// A number of each site here, interpolated in elements; zero at nodes that are no sites.
    pub fn scalar(&self, of: impl Fn(usize) -> f64) -> f64 {
        self.solved.scalar_at(self.spot, of)
    }

    /// `D` numbers of each site as a vector here, interpolated in elements and at nodes that are no sites.
    pub fn vector(&self, values: &[f64]) -> Vector<D> {
        match self.spot {
            Spot::Node { node, .. } => self.solved.model.node_transfer.displacement(node, values),
            Spot::Point(site) => Vector::from_column_slice(&values[site * D..][..D]),
            Spot::InElement(c, xi) => {
                let of = |site: usize| Vector::from_column_slice(&values[site * D..][..D]);
                let sites = self.solved.sites_in(c, xi);
                sites.map(|(site, w)| of(site) * w).sum()
            }
            Spot::Element(_) | Spot::Part(..) => Vector::zeros(),
        }
    }

    /// Displacement \[m\].
    pub fn displacement(&self) -> Vector<D> {
        let of_sites = || self.vector(self.solved.displacement);
        self.displacement.unwrap_or_else(of_sites)
    }

    /// Displacement gradient: of an element at its centre or at the place, of a point that of its nearest bonds.
    pub fn gradient(&self) -> Tensor<D> {
        let of = |teller| self.solved.gradient_of(teller, &self.shared.intact);
        *self.gradient.get_or_init(|| match self.spot {
            Spot::Element(c) | Spot::Part(c, _) => self.solved.element_gradient(c),
            Spot::InElement(c, xi) => match self.slope {
                Some(slope) => slope.value(of),
                None => self.solved.gradient_in(c, &xi),
            },
            Spot::Point(site) => match self.slope {
                Some(slope) => slope.value(of),
                None => of(Teller::Point(site)),
            },
            Spot::Node { .. } => Tensor::zeros(),
        })
    }

    /// Stress \[Pa\], without its thermal part; zero at nodes.
    pub fn stress(&self) -> Stress<D> {
        let (solved, Shared { intact, expansions }) = (self.solved, self.shared);
        *self.stress.get_or_init(|| match self.spot {
            Spot::Element(c) | Spot::Part(c, _) => {
                solved.cell_stress(c, &self.gradient(), expansions)
            }
            Spot::InElement(c, xi) => {
                let slope = self.slope.map(|_| self.gradient());
                solved.stress_in(c, &xi, slope, expansions)
            }
            Spot::Point(site) => {
                let own = || solved.gradient_of(Teller::Point(site), intact);
                let beyond = self
                    .slope
                    .map(|_| self.gradient() - self.of_carrier.get_or_init(own));
                solved.point_stress(site, beyond, |p, j| intact.is_intact(p, j), expansions)
            }
            Spot::Node { .. } => Stress::zero(),
        })
    }

    /// Zone.
    pub fn zone(&self) -> Zone {
        match self.spot {
            Spot::Element(c) | Spot::Part(c, _) | Spot::InElement(c, _) => {
                self.solved.model.zones[c]
            }
            Spot::Point(site) => self.solved.zone_of_site[site],
            Spot::Node { site, .. } => {
                site.map_or(Zone::Local, |site| self.solved.zone_of_site[site])
            }
        }
    }
}

impl<const D: usize> Solved<'_, D> {
    /// The sites that the displacement at reference coordinates in an element follows, with their weights.
    fn sites_in(&self, c: usize, xi: [f64; 3]) -> impl Iterator<Item = (usize, f64)> {
        let (model, xi) = (self.model, Vector::from_fn(|i, _| xi[i]));
        let (shape, count) = fem::shape_values(&model.mesh, c, &xi);
        let nodes = model.mesh.cell(c)[..count].iter().zip(shape);
        nodes.flat_map(move |(&n, w)| {
            let row = model.node_transfer.row(n as usize);
            row.map(move |(site, v)| (site as usize, v * w))
        })
    }

    /// A number of each site at a place, interpolated in elements; zero at nodes that are no sites.
    pub(in crate::run) fn scalar_at(&self, spot: Spot, of: impl Fn(usize) -> f64) -> f64 {
        match spot {
            Spot::Node { site, .. } => site.map_or(0.0, of),
            Spot::Point(site) => of(site),
            Spot::InElement(c, xi) => self.sites_in(c, xi).map(|(site, w)| of(site) * w).sum(),
            Spot::Element(_) | Spot::Part(..) => 0.0,
        }
    }
}
