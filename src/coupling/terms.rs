//! The internal force of a coupled model as a sum of terms, `f(u) = Σ_k R_k F_k(T u)`.
//!
//! At rest `f = K u`, the negative of the force density `L` of `docs/methods.md` times a volume. The transfer T ([`crate::assembly::Transfer`]) gives the displacements of all places (points in elements, Gauss points) from those `u` of the sites.
//! Each [`Term`] is one `R_k F_k`. R distributes its forces to the rows of the sites: `R = Tᵀ` for an energy, 0 or 1 for a splice, weights within the bonds for a blending. Linear statics assemble the rows of all terms. In motion and at finite strains
//! linear rows stay as they are, and the forces of bonds, of bonds that a seam cuts and of partial stresses are computed from the deformation.

use super::{NonlinearSeam, PartialStresses};
use crate::{assembly::Row, model::Model, tensor::Tensor};

/// Adds to the row of a site in `K`: minus the force that its material exerts there.
pub type AddRow<'a, const D: usize> = Box<dyn Fn(usize, &mut Row<D>) + Send + Sync + 'a>;

/// Evidence that the energy behind symmetric rows is never negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Definiteness {
    /// It is a sum of squares, whatever the model is.
    SumOfSquares,
    /// It is one but for small terms of either sign, along the edges of a nonlocal zone in 3D or where two influence functions of a law differ. These cancel under affine fields; for other fields the matrix has to be examined.
    EdgeTerms,
    /// Terms of the seam are negative: a run factorises the matrix first.
    NegativeTerms,
}

/// The bonds of the body in the row of a site, ascending.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BondsOfSite {
    /// None: weighted bonds, bonds with coefficients of their own and stresses belong to other terms.
    None,
    /// Some, or all, among other terms.
    Among,
    /// All bonds of a point, whole, and nothing else. Bonds may break there; elsewhere only with [`SeamBonds`] in motion.
    Alone,
}

/// Bonds of the body between points, as the law has them.
pub struct BodyBonds<'a, const D: usize> {
    /// The bonds in the row of a site.
    pub at: Box<dyn Fn(usize) -> BondsOfSite + Send + Sync + 'a>,
    /// Returns true if the bond between two points, the first of a site that has bonds [`BondsOfSite::Among`] other terms, is one of those. A bond that the seam cuts is not: as a bond of the body its force would rotate at the point, and not at the finite elements.
    pub holds: Box<dyn Fn(usize, usize) -> bool + Send + Sync + 'a>,
    /// For each site the feet of families that follow it (see [`TruncatedFamilies`](super::TruncatedFamilies)), with their weights: the site takes their forces. Empty where the body has none.
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

/// Bonds that a seam cuts, which rotate, stretch and break like others.
pub struct SeamBonds<'a, const D: usize> {
    /// Adds the row of a site at rest.
    pub add_row: AddRow<'a, D>,
    /// The same bonds, geometrically exact, or breaking; with them the whole bonds of the points at the seam, which leave [`BodyBonds`].
    pub in_motion: Box<dyn Fn() -> NonlinearSeam<D> + Send + Sync + 'a>,
    /// Adds the part of the row of a node that the bonds in motion leave to the matrix.
    pub add_beside: AddRow<'a, D>,
}

/// A force `R F(T u)` of a coupled model.
pub enum Term<'a, const D: usize> {
    /// Linear in the displacement: finite elements by their elastic tensor, weighted bonds, controls, cut bonds that neither rotate nor break.
    Rows(AddRow<'a, D>),
    /// Bonds of the body.
    Bonds(BodyBonds<'a, D>),
    /// Bonds that a seam cuts.
    SeamBonds(SeamBonds<'a, D>),
    /// Partial stresses of peridynamic points.
    Stresses(PartialStresses<'a, D>),
}

/// A coupled model: the sum of its terms, and its properties. Every part is required.
pub struct Operator<'a, const D: usize> {
    /// Sites, points and the transfer.
    pub model: &'a Model<D>,
    /// The terms, in the order in which their rows are added.
    pub terms: Vec<Term<'a, D>>,
    /// The blending function β of a site: 1 where it is peridynamic, 0 where it is local, ½ at transition points of meshfree partial stress.
    pub beta: Box<dyn Fn(usize) -> f64 + Send + Sync + 'a>,
    /// True if rows count elements and bonds by their materials, [`Row::count_only`]: only then do materials expand differently at the seam.
    pub counts_materials: bool,
    /// Evidence that the energy behind symmetric rows is never negative. Rows that are not symmetric have no such energy, and no run relies on it.
    pub definiteness: Definiteness,
}

impl<const D: usize> Operator<'_, D> {
    /// Adds the row of a site at rest, in the sense of `K u = f` with the external force f.
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

    /// Adds that row without the bonds of the body; with `is_exact_seam` also without those of the seam that move ([`SeamBonds::in_motion`]).
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

    /// Number of directed bonds in the families of Gauss points, beside those of the peridynamic body.
    pub fn additional_bonds(&self) -> usize {
        self.stresses().map(PartialStresses::additional_bonds).sum()
    }

    /// The mean partial stress of a cell \[Pa\] under the displacements `u` \[m\], D per site; none of a cell whose stress is that of its own law.
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
