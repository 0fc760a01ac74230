//! Input of a bond pass.

use std::sync::Arc;

use super::kinematics::BondKinematics;
use super::softened_bonds::BondSoftening;
use crate::{
    parallel,
    peridynamics::{Families, Law, PdBody, failure::StateCriterion, force_state::PLASTIC_STRAIN},
    system::Ranks,
    tensor::Vector,
};

/// Largest difference of a number of a bond between its ends, in parts of it.
pub(super) const ENDS: f64 = 1e-12;

/// Choice of the pass to build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// The lattice pass where the points fill a lattice, else lists.
    Automatic,
    /// Lists, whatever the points.
    List,
    /// The lattice pass, or an error that says why it cannot be.
    Lattice,
}

/// Storage of the weights of bonds in scenes in time and load steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "PrecisionSpec")]
pub enum Storage {
    /// In eight bytes, or not at all where the points fill a lattice.
    Double,
    /// One by one, in four bytes: forces are off by about 1e-8 of themselves.
    Single,
}

/// A number per bond: of point `i`, the position `k` of the bond in its family, and the bond vector ξ.
pub type BondFunction<'a, const D: usize> = dyn Fn(usize, usize, &Vector<D>) -> f64 + Sync + 'a;

/// The force of a bond.
#[derive(Clone, Copy)]
pub enum BondForce<'a, const D: usize> {
    /// Prototype microelastic brittle (PMB), [SAND2015-7998] eq. (3.1) linearised: both ends together pull with `2 p ξ (ξ·η) V_i V_j`; exact bonds with `2 p r² (1 − r/|ξ+η|) (ξ+η) V_i V_j`,
    /// whose energy `p r² (|ξ+η| − r)² V_i V_j` is quadratic in the extension.
    Pairwise {
        /// `p`, the pairwise coefficient of [`crate::peridynamics::linear_force_state`] \[N/m^(2D+3)\].
        coefficient: &'a BondFunction<'a, D>,
    },
    /// Linear peridynamic solid, [SAND2015-7998] eq. (5.16), (5.17), (5.18), `T = [(D k − (D+2) μ)/m θ ω r + D(D+2) μ/m ω e] M`; the weighted volume `m` is that of the reference family and stays.
    Solid {
        /// `ω`, lattice factors included.
        omega: &'a BondFunction<'a, D>,
        /// Bulk modulus of `D` dimensions, `λ + 2μ/D` \[Pa\].
        bulk: f64,
        /// Shear modulus \[Pa\].
        shear: f64,
    },
    /// Any law, by its force states.
    Law {
        /// The law.
        law: &'a Arc<dyn Law<D>>,
        /// The coefficients of its linearisation, of all bonds of the families and maybe more.
        body: &'a PdBody<D>,
    },
}

/// Threshold at which a bond breaks: a stretch, or a state.
#[derive(Clone, Copy)]
pub enum BondCriterion<'a, const D: usize> {
    /// The same for all bonds.
    Uniform(f64),
    /// A number per bond; the same from both ends.
    PerBond(&'a BondFunction<'a, D>),
    /// No stretch, but a state of points and bonds, which the generic pass alone supports.
    State(&'a dyn StateCriterion),
}

/// Failure criterion of bonds.
#[derive(Clone, Copy)]
pub struct Failure<'a, const D: usize> {
    /// Critical stretch \[1\]; infinite for bonds that only their law damages.
    pub critical: BondCriterion<'a, D>,
    /// Points whose bonds never fail, one entry per point; empty for none.
    pub no_fail: &'a [bool],
    /// Softening of bonds from a smaller stretch on to a larger one, with the energy of a break at the critical stretch; `None` for bonds that break at once.
    pub softening: Option<BondSoftening>,
}

impl<const D: usize> Failure<'_, D> {
    /// Returns true if bonds break by a criterion: not at an infinite stretch, of bonds that their law damages.
    pub(super) fn has_limit(&self) -> bool {
        !matches!(self.critical, BondCriterion::Uniform(f64::INFINITY))
    }
}

/// Families that this process holds, and sizes of the families of all points. Calls of passes that are made with it are collective.
#[derive(Clone, Copy)]
pub struct DistributedRows<'a> {
    /// The processes.
    pub ranks: &'a dyn Ranks,
    /// Points whose families no other process holds as its own, one mark per point.
    pub own: &'a [bool],
    /// Bonds of the family of each point, held here or not.
    pub sizes: &'a [u32],
}

/// Points, families and law of a bond pass. One horizon for all points.
#[derive(Clone, Copy)]
pub struct BondSetup<'a, const D: usize> {
    /// Positions of all points, sites or not \[m\].
    pub position: &'a [Vector<D>],
    /// Their volumes \[m^D\].
    pub volume: &'a [f64],
    /// The reference families, one row per point, cut where voids and surfaces cut them; empty for points that only complete the families of others.
    pub families: &'a Families,
    /// Points whose force is computed; the rest of the points with families only pass on their dilatation. Empty: all points with a family.
    pub rows: &'a [bool],
    /// Points of a state-based law without an energy of their own: of their force only what their neighbours' energies make is computed, the rest is someone else's. Empty: none.
    pub without_energy: &'a [bool],
    /// The law.
    pub force: BondForce<'a, D>,
    /// Kinematics of the bonds.
    pub kinematics: BondKinematics,
    /// Failure of bonds; `None` for never.
    pub failure: Option<Failure<'a, D>>,
    /// Bonds `(i, j)` of the reference families that are broken from the start and count as damage: pre-cracks. Symmetric in its arguments.
    pub precracked: Option<&'a (dyn Fn(usize, usize) -> bool + Sync)>,
    /// Choice of the pass.
    pub layout: Layout,
    /// Storage of weights in lists.
    pub storage: Storage,
    /// Distribution of the families over processes; none where all are here.
    pub shared: Option<DistributedRows<'a>>,
}

/// Error in the construction of a bond pass.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KernelError {
    /// Lists that belong together differ in length.
    #[error("bond pass: {what} has {length} entries for {points} points; give one per point")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Its length.
        length: usize,
        /// Number of points.
        points: usize,
    },
    /// Bond `(i, j)` stands in one family only.
    #[error(
        "bond pass: point {i} has a bond to point {j}, whose family lacks it; give both the same horizon (bond passes take constant horizons only)"
    )]
    OneSided {
        /// The point with the bond.
        i: usize,
        /// The point without it.
        j: usize,
    },
    /// A number of a bond differs between its ends.
    #[error(
        "bond pass: the bond of points {i} and {j} has {what} {there} from one end and {back} from the other; use plain or isotropic weights, fitted ones differ at the ends of a bond"
    )]
    Ends {
        /// Weight or critical stretch.
        what: &'static str,
        /// The lower point.
        i: usize,
        /// The higher point.
        j: usize,
        /// Seen from `i`.
        there: f64,
        /// Seen from `j`.
        back: f64,
    },
    /// A family of a state-based law without weight.
    #[error(
        "bond pass: the family of point {point} has the weighted volume {weighted_volume}; widen the horizon or remove the point"
    )]
    Family {
        /// Number of the point.
        point: usize,
        /// Its weighted volume.
        weighted_volume: f64,
    },
    /// A law without force states.
    #[error(
        "bond pass: {law} is known to first order only, so that its bonds neither rotate nor break"
    )]
    FirstOrder {
        /// Its name.
        law: &'static str,
    },
    /// Bonds of a law with force states soften by that law.
    #[error(
        "bond pass: bonds of {law} do not soften beyond a stretch one by one; softening is for bond-based and lps"
    )]
    Softening {
        /// Its name.
        law: &'static str,
    },
    /// A criterion of plastic flow for a law that does not flow.
    #[error(
        "bond pass: points of this law remember no plastic strain, by which bonds are to break; give a critical stretch"
    )]
    NoFlow,
    /// The lattice pass was asked for where there is none.
    #[error("bond pass: no lattice pass, {why}; choose the automatic layout")]
    NoLattice {
        /// Reason against it.
        why: String,
    },
}

impl<const D: usize> BondSetup<'_, D> {
    /// Returns true if points have a plastic strain in their history.
    pub(super) fn flows(&self) -> bool {
        let BondForce::Law { law, .. } = self.force else {
            return false;
        };
        let states = law.force_state();
        states.is_some_and(|s| s.history().point.contains(&PLASTIC_STRAIN))
    }

    /// `ξ` of the bond from `i` to `j`.
    pub(super) fn bond(&self, i: usize, j: usize) -> Vector<D> {
        self.position[j] - self.position[i]
    }

    /// Returns true if the force of point `i` is computed.
    pub(super) fn row(&self, i: usize) -> bool {
        self.has_family(i) && self.rows.get(i).copied().unwrap_or(true)
    }

    /// The number that a law gives to a bond: `2 p r²` (pairwise) or `ω` (state-based).
    pub(super) fn weight(&self, i: usize, k: usize, xi: &Vector<D>) -> f64 {
        match self.force {
            BondForce::Pairwise { coefficient } => 2.0 * coefficient(i, k, xi) * xi.norm_squared(),
            BondForce::Solid { omega, .. } => omega(i, k, xi),
            // ends may differ: each end has a force state of its own
            BondForce::Law { .. } => 0.0,
        }
    }

    /// The value of `t` beyond which a bond breaks, or begins to soften; infinite for never.
    pub(super) fn limit(&self, i: usize, k: usize, xi: &Vector<D>) -> f64 {
        let Some(failure) = self.failure else {
            return f64::INFINITY;
        };
        let s = match failure.critical {
            BondCriterion::Uniform(s) => s,
            BondCriterion::PerBond(f) => f(i, k, xi),
            BondCriterion::State(_) => return f64::INFINITY,
        };
        let handed_over = failure.softening.map_or(s, |softening| softening.limit(s));
        self.kinematics.limit(handed_over)
    }

    /// Returns true if bonds of point `i` never fail.
    pub(super) fn no_fail(&self, i: usize) -> bool {
        self.failure
            .is_some_and(|f| f.no_fail.get(i).copied().unwrap_or(false))
    }

    /// Returns true if point `i` has no energy of its own.
    pub(super) fn has_no_energy(&self, i: usize) -> bool {
        self.without_energy.get(i).copied().unwrap_or(false)
    }

    /// `m = Σ w |ξ|² V` of the reference family of point `i`; zero, which stands for no energy, if it has none.
    pub(super) fn weighted_volume(&self, i: usize) -> f64 {
        if self.has_no_energy(i) {
            return 0.0;
        }
        let family = self.families.of(i).iter().enumerate();
        family
            .map(|(k, &j)| {
                let xi = self.bond(i, j as usize);
                self.weight(i, k, &xi) * xi.norm_squared() * self.volume[j as usize]
            })
            .sum()
    }

    /// Checks that lists belong together and families have weight.
    pub(super) fn check_lists(&self) -> Result<(), KernelError> {
        let points = self.position.len();
        let no_fail = self.failure.map_or(&[][..], |f| f.no_fail);
        for (what, length, may_be_empty) in [
            ("volume", self.volume.len(), false),
            ("families", self.families.len(), false),
            ("rows", self.rows.len(), true),
            ("without_energy", self.without_energy.len(), true),
            ("no_fail", no_fail.len(), true),
        ] {
            if length != points && !(may_be_empty && length == 0) {
                return Err(KernelError::Length {
                    what,
                    length,
                    points,
                });
            }
        }
        if let Some(&j) = self.families.neighbours.iter().max()
            && j as usize >= points
        {
            return Err(KernelError::Length {
                what: "a family",
                length: j as usize,
                points,
            });
        }
        let BondForce::Solid { .. } = self.force else {
            return Ok(());
        };
        let without_weight = |point: usize| {
            let weighted_volume = self.weighted_volume(point);
            let is_wanted = !self.families.of(point).is_empty() && !self.has_no_energy(point);
            (is_wanted && (weighted_volume.is_nan() || weighted_volume <= 0.0)).then_some(
                KernelError::Family {
                    point,
                    weighted_volume,
                },
            )
        };
        self.first_fault(without_weight)
    }

    /// Checks that every bond between two families has its reverse, with the same weight and critical stretch.
    pub(super) fn check_bonds(&self) -> Result<(), KernelError> {
        self.first_fault(|i| self.fault(i))
    }

    fn first_fault(
        &self,
        fault: impl Fn(usize) -> Option<KernelError> + Sync + Send,
    ) -> Result<(), KernelError> {
        parallel::find_first(self.position.len(), 256, fault).map_or(Ok(()), Err)
    }

    fn fault(&self, i: usize) -> Option<KernelError> {
        for (k, &j) in self.families.of(i).iter().enumerate() {
            let j = j as usize;
            let other = self.families.of(j);
            if other.is_empty() || j < i {
                if !other.is_empty() && other.binary_search(&(i as u32)).is_err() {
                    return Some(KernelError::OneSided { i, j });
                }
                continue;
            }
            let Ok(back) = other.binary_search(&(i as u32)) else {
                return Some(KernelError::OneSided { i, j });
            };
            let xi = self.bond(i, j);
            let pairs = [
                ("weight", self.weight(i, k, &xi), self.weight(j, back, &-xi)),
                (
                    "critical stretch",
                    self.limit(i, k, &xi),
                    self.limit(j, back, &-xi),
                ),
            ];
            for (what, there, back) in pairs {
                if there != back && (there - back).abs() > ENDS * there.abs() {
                    return Some(KernelError::Ends {
                        what,
                        i,
                        j,
                        there,
                        back,
                    });
                }
            }
        }
        None
    }
}
