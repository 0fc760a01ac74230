//! The internal force of a coupled model as a sum of terms, `f(u) = Σ_k R_k F_k(T u)`.
//!
//! T is the transfer of the model ([`crate::assembly::Transfer`]): displacements of all places, from those of the sites. Each [`Term`] is one `R_k F_k` by the rows of the sites that feel it: with
//! `R = Tᵀ` for energy methods, 0 or 1 for a splice, or weights within the bonds for a blending. Statics take the rows of all terms; in motion and at finite strains
//! each kind of term is what it is there: rows that stay, bonds that the pass over the bonds computes, bonds of a seam, stresses of exact bonds.

use super::{NonlinearSeam, PartialStresses};
use crate::{assembly::Row, model::Model, tensor::Tensor};

/// Adds to the row of a site, minus the force there.
pub type AddRow<'a, const D: usize> = Box<dyn Fn(usize, &mut Row<D>) + Send + Sync + 'a>;

/// Evidence that the energy behind symmetric rows is never negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Definiteness {
    /// It is a sum of squares, whatever the model is.
    SumOfSquares,
    /// It is one but for small terms of either sign, along the edges of a nonlocal zone in 3D or where two influence functions of a law differ. They cancel under affine fields; the matrix at hand decides about others.
    EdgeTerms,
    /// Terms of the seam are negative: a run factorises the matrix before it trusts it.
    NegativeTerms,
}

/// The bonds of the body in the row of a site, ascending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BondsOfSite {
    /// None: bonds of its own coefficients, weighted bonds and stresses belong to other terms.
    None,
    /// Some, or all, among other terms.
    Among,
    /// All bonds of a point, whole, and nothing else: only there may bonds break.
    Alone,
}

/// Bonds of the body between points, as the law has them.
pub struct BodyBonds<'a, const D: usize> {
    /// The bonds in the row of a site.
    pub at: Box<dyn Fn(usize) -> BondsOfSite + Send + Sync + 'a>,
    /// Returns true if the bond between two points, the first of a site that has bonds [`BondsOfSite::Among`] other terms, is one of those. A bond that the seam cuts is not: as one of the body it would pull at its point as it rotates, and at the finite elements as if it did not.
    pub holds: Box<dyn Fn(usize, usize) -> bool + Send + Sync + 'a>,
    /// For each site the feet of families that follow it, with their weights: it takes their forces. Empty where the body has none.
    pub feet: Vec<Vec<(u32, f64)>>,
}

impl<'a, const D: usize> BodyBonds<'a, D> {
    /// All bonds of the points that are `alone`, a predicate of sites, and none elsewhere.
    pub fn alone(is_alone: impl Fn(usize) -> bool + Send + Sync + 'a) -> Self {
        Self {
            at: Box::new(move |site| match is_alone(site) {
                true => BondsOfSite::Alone,
                false => BondsOfSite::None,
            }),
            holds: Box::new(|_, _| true),
            feet: Vec::new(),
        }
    }

    fn add_row(&self, model: &Model<D>, site: usize, row: &mut Row<D>) {
        match ((self.at)(site), model.point_of(site)) {
            (BondsOfSite::None, _) => {}
            (BondsOfSite::Alone, Some((body, i))) => body.add_force_row(i, |_| 1.0, row),
            (BondsOfSite::Among, Some((body, i))) => {
                body.add_force_row(i, |j| f64::from((self.holds)(i, j)), row);
            }
            (BondsOfSite::Alone | BondsOfSite::Among, None) => {
                let feet = self.feet.get(site).into_iter().flatten();
                for (body, &(foot, weight)) in feet.filter_map(|foot| model.body().zip(Some(foot)))
                {
                    body.add_force_row(foot as usize, |_| weight, row);
                }
            }
        }
    }
}

/// Bonds that a seam cuts, which turn, stretch and break like others.
pub struct SeamBonds<'a, const D: usize> {
    /// Adds the row of a site at rest.
    pub add_row: AddRow<'a, D>,
    /// The same bonds, geometrically exact, or breaking; with them the whole bonds of the points at the seam, which leave [`BodyBonds`].
    pub in_motion: Box<dyn Fn() -> NonlinearSeam<D> + Send + Sync + 'a>,
    /// Adds what the row of a node has beside those.
    pub add_beside: AddRow<'a, D>,
}

/// A force `R F(T u)` of a coupled model.
pub enum Term<'a, const D: usize> {
    /// Linear in the displacement, whatever bonds do: finite elements by their elastic tensor, weighted bonds, controls, cut bonds that stay whole.
    Rows(AddRow<'a, D>),
    /// Bonds of the body.
    Bonds(BodyBonds<'a, D>),
    /// Bonds that a seam cuts.
    SeamBonds(SeamBonds<'a, D>),
    /// Partial stresses of peridynamic points.
    Stresses(PartialStresses<'a, D>),
}

/// A coupled model: the sum of its terms, and the facts that a run asks for. Every part is required.
pub struct Operator<'a, const D: usize> {
    /// Sites, points and the transfer.
    pub model: &'a Model<D>,
    /// The terms, in the order in which their rows are added.
    pub terms: Vec<Term<'a, D>>,
    /// The blending function β of a site: 1 where it is peridynamic, 0 where it is local.
    pub beta: Box<dyn Fn(usize) -> f64 + Send + Sync + 'a>,
    /// True if rows count elements and bonds by their materials, [`Row::count_only`]: only then do materials expand differently at the seam.
    pub counts_materials: bool,
    /// Evidence that the energy behind symmetric rows is never negative. Rows that are not symmetric have no such energy, and no run relies on it.
    pub definiteness: Definiteness,
}

impl<const D: usize> Operator<'_, D> {
    /// Adds the internal force of a site at rest, times −1 (`K u = f`).
    pub fn add_row(&self, site: usize, row: &mut Row<D>) {
        for term in &self.terms {
            match term {
                Term::Rows(add_row) => add_row(site, row),
                Term::Bonds(bonds) => bonds.add_row(self.model, site, row),
                Term::SeamBonds(bonds) => (bonds.add_row)(site, row),
                Term::Stresses(stresses) => stresses.add_row(site, row),
            }
        }
    }

    /// Adds the part of that row that the bonds of the body do not have; `is_exact_seam` where those of the seam move by themselves too.
    pub fn add_row_beside_bonds(&self, site: usize, is_exact_seam: bool, row: &mut Row<D>) {
        for term in &self.terms {
            match term {
                Term::Rows(add_row) => add_row(site, row),
                Term::Bonds(_) => {}
                Term::SeamBonds(bonds) if is_exact_seam => (bonds.add_beside)(site, row),
                Term::SeamBonds(bonds) => (bonds.add_row)(site, row),
                Term::Stresses(stresses) => stresses.add_row(site, row),
            }
        }
    }

    /// The bonds of the body in the row of a site.
    pub fn bonds_of_site(&self, site: usize) -> BondsOfSite {
        let of_term = |bonds: &BodyBonds<'_, D>| (bonds.at)(site);
        self.bonds().map(of_term).max().unwrap_or(BondsOfSite::None)
    }

    /// Returns true if the row of a site is that of the peridynamic body alone, all of its bonds whole.
    pub fn is_body_row(&self, site: usize) -> bool {
        self.bonds_of_site(site) == BondsOfSite::Alone
    }

    /// Returns true if rows hold the bond between two points, see [`BodyBonds::holds`].
    pub fn holds_bond(&self, i: usize, j: usize) -> bool {
        self.bonds().any(|bonds| (bonds.holds)(i, j))
    }

    fn bonds(&self) -> impl Iterator<Item = &BodyBonds<'_, D>> {
        self.terms.iter().filter_map(|term| match term {
            Term::Bonds(bonds) => Some(bonds),
            Term::Rows(_) | Term::SeamBonds(_) | Term::Stresses(_) => None,
        })
    }

    fn stresses(&self) -> impl Iterator<Item = &PartialStresses<'_, D>> {
        self.terms.iter().filter_map(|term| match term {
            Term::Stresses(stresses) => Some(stresses),
            Term::Rows(_) | Term::Bonds(_) | Term::SeamBonds(_) => None,
        })
    }

    /// Number of directed bonds beside those of the peridynamic body (Gauss points).
    pub fn additional_bonds(&self) -> usize {
        self.stresses().map(PartialStresses::additional_bonds).sum()
    }

    /// The mean partial stress of a cell; none of a cell whose stress is that of its own law.
    pub fn cell_stress(&self, cell: usize, u: &[f64]) -> Option<Tensor<D>> {
        (self.stresses()).find_map(|stresses| stresses.cell_stress(cell, u))
    }

    /// The sum of [`Operator::cell_stress`] over cells, for displacements that have one component: entry `[f][c]` is that of `u_c` = field `f`, the others zero.
    ///
    /// Shapes: each field has one number per site. One pass over the families does for all fields.
    pub fn sums_of_cell_stress(&self, cells: &[usize], fields: &[Vec<f64>]) -> Vec<[Tensor<D>; D]> {
        let mut sums = vec![[Tensor::zeros(); D]; fields.len()];
        for stresses in self.stresses() {
            stresses.add_cell_stresses(cells, fields, &mut sums);
        }
        sums
    }
}
