//! All kernels over a range of N.

use rayon::prelude::*;

use super::{
    norms::{Errors, falls, median, observed_order},
    problem::{Discretisation, Outcome, WeightedVolume, solve},
};
use bondline::{
    peridynamics::{
        Influence, PartialVolume,
        influence::{Alpha, Degree},
    },
    progress::Progress,
};

/// First N of the fitted orders, up to 150; before it the curves of smooth kernels still bend.
pub const FIT_FROM: usize = 110;

/// A quadrature algorithm with the degree of the influence function's polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Quadrature weights.
    pub algorithm: PartialVolume,
    /// Degree of `P_n`.
    pub degree: Degree,
}

impl Kernel {
    /// Its name in the report's letters: FL, FA or FV, PDLAMMPS, HHB, AC.
    pub fn name<const D: usize>(&self, alpha: Alpha) -> String {
        let algorithm = match self.algorithm {
            PartialVolume::Full => ["FL", "FA", "FV"][D - 1],
            PartialVolume::PdLammps => ["PL-PDLAMMPS", "PA-PDLAMMPS", "PV-PDLAMMPS"][D - 1],
            PartialVolume::Hhb => ["PL-HHB", "PA-HHB", "PV-HHB"][D - 1],
            PartialVolume::Exact => ["exact lengths", "exact areas", "exact volumes"][D - 1],
        };
        format!(
            "alpha = {}, {algorithm}, P{}",
            alpha.exponent(),
            self.degree.order()
        )
    }

    /// The discretisation with so many points along an edge.
    pub fn discretisation(&self, points: usize, alpha: Alpha) -> Discretisation {
        Discretisation {
            points,
            algorithm: self.algorithm,
            influence: Influence::Polynomial {
                degree: self.degree,
                alpha,
            },
            weighted_volume: WeightedVolume::Integral,
        }
    }
}

/// Kernels that the report's figures compare: full volumes with P0, P1 (its PWL), P3 (PWC), P5 (PWQ), P7 (PWS), the other algorithms with P0.
pub const KERNELS: [Kernel; 8] = {
    use PartialVolume::{Exact, Full, Hhb, PdLammps};
    const fn kernel(algorithm: PartialVolume, degree: Degree) -> Kernel {
        Kernel { algorithm, degree }
    }
    [
        kernel(Full, Degree::P0),
        kernel(Full, Degree::P1),
        kernel(Full, Degree::P3),
        kernel(Full, Degree::P5),
        kernel(Full, Degree::P7),
        kernel(PdLammps, Degree::P0),
        kernel(Hhb, Degree::P0),
        kernel(Exact, Degree::P0),
    ]
};

/// The norms that errors are measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Norm {
    /// [`Errors::nodal`].
    Nodal,
    /// [`Errors::piecewise`].
    Piecewise,
    /// [`Errors::largest`].
    Largest,
}

impl Norm {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Nodal, Self::Piecewise, Self::Largest];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nodal => "nodal L2",
            Self::Piecewise => "piecewise-constant L2",
            Self::Largest => "max",
        }
    }

    /// The error in it.
    pub fn of(self, errors: &Errors) -> f64 {
        match self {
            Self::Nodal => errors.nodal,
            Self::Piecewise => errors.piecewise,
            Self::Largest => errors.largest,
        }
    }
}

/// A kernel over the numbers of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Quadrature and degree.
    pub kernel: Kernel,
    /// Exponent of the influence function.
    pub alpha: Alpha,
    /// N and its outcome, ascending.
    pub outcomes: Vec<(usize, Outcome)>,
    /// Reason why a size has no outcome.
    pub failure: Option<String>,
}

impl Curve {
    /// Its name in the report's letters.
    pub fn name<const D: usize>(&self) -> String {
        self.kernel.name::<D>(self.alpha)
    }

    /// N and error, from that N on.
    pub fn errors(&self, norm: Norm, from: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.outcomes
            .iter()
            .filter(move |(n, _)| *n >= from)
            .map(move |(n, o)| (*n as f64, norm.of(&o.errors)))
    }

    /// Median of the error over all N.
    pub fn median(&self, norm: Norm) -> f64 {
        median(self.errors(norm, 0).map(|e| e.1))
    }

    /// Largest error over all N.
    pub fn worst(&self, norm: Norm) -> f64 {
        self.errors(norm, 0).map(|e| e.1).fold(0.0, f64::max)
    }

    /// Observed order from [`FIT_FROM`] on.
    pub fn order(&self, norm: Norm) -> f64 {
        observed_order(self.errors(norm, FIT_FROM))
    }

    /// Returns true if the error falls from every N to the next from [`FIT_FROM`] on.
    pub fn is_monotone(&self, norm: Norm) -> bool {
        let errors: Vec<f64> = self.errors(norm, FIT_FROM).map(|e| e.1).collect();
        falls(&errors)
    }
}

/// Every kernel of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// Curves, α = 0 first.
    pub curves: Vec<Curve>,
}

/// The numbers of points along an edge in the figures of the report: every one, or every so many.
pub fn grid_sizes(step: usize) -> Vec<usize> {
    (75..=150).step_by(step).collect()
}

impl Study {
    /// Solves the problem of dimension `D` for every kernel and both exponents.
    pub fn run<const D: usize>(sizes: &[usize], progress: &dyn Progress) -> Self {
        let curve = |alpha: Alpha, kernel: Kernel| {
            let one = |&points: &usize| {
                let outcome = solve::<D>(&kernel.discretisation(points, alpha));
                progress.advance(1);
                (points, outcome)
            };
            // a solid fills memory and cores alone
            let solved: Vec<_> = if D == 3 {
                sizes.iter().map(one).collect()
            } else {
                sizes.par_iter().map(one).collect()
            };
            let mut outcomes = Vec::new();
            let mut failure = None;
            for (n, outcome) in solved {
                match outcome {
                    Ok(o) => outcomes.push((n, o)),
                    Err(e) => failure = Some(format!("N = {n}: {e}")),
                }
            }
            Curve {
                kernel,
                alpha,
                outcomes,
                failure,
            }
        };
        let curves = if sizes.is_empty() {
            Vec::new()
        } else {
            Alpha::ALL
                .into_iter()
                .flat_map(|alpha| KERNELS.map(|kernel| curve(alpha, kernel)))
                .collect()
        };
        Self { curves }
    }

    /// The numbers of points that were solved.
    pub fn sizes(&self) -> Vec<usize> {
        self.curves
            .first()
            .map(|c| c.outcomes.iter().map(|o| o.0).collect())
            .unwrap_or_default()
    }

    /// Returns true if there are enough sizes for an order.
    pub fn fits(&self) -> bool {
        self.sizes().iter().filter(|&&n| n >= FIT_FROM).count() >= 3
    }

    /// The curve of a kernel.
    pub fn curve(&self, alpha: Alpha, algorithm: PartialVolume, degree: Degree) -> Option<&Curve> {
        self.curves.iter().find(|c| {
            c.alpha == alpha && c.kernel == Kernel { algorithm, degree } && c.failure.is_none()
        })
    }
}
