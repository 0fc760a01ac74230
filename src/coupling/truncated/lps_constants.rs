//! Constants of the dilatations of an LPS beside a seam.

use super::bond_segments::Segments;
use crate::model::ModelError;
use crate::peridynamics::StatePart;
use crate::tensor::Vector;
use crate::{
    coupling::truncated::bond_segments::{End, Segment},
    tensor::Tensor,
};

/// Constants that all dilatations of a model have in common.
pub(super) struct LpsConstants {
    /// Normalisation of the dilatations of each lattice.
    pub over_m: Vec<Normal>,
    /// `K′ = λ − μ` of the material, not its bulk modulus \[Pa\]; the same for all lattices.
    pub bulk: f64,
    /// c of a position-aware solid, see `dilatation.rs`; none of an LPS.
    pub deviatoric: Option<f64>,
}

/// Normalisation of dilatations, as factors of sums over a whole family.
pub(super) struct Normal {
    /// `D/m`.
    pub volumetric: f64,
    /// `D/S`.
    pub deviatoric: f64,
}

/// The influence function of a dilatation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Volumetric,
    Deviatoric,
}

impl LpsConstants {
    /// That of a model; none of a pairwise law.
    ///
    /// # Errors
    /// [`ModelError::Unsupported`] for a law whose state is more than a dilatation.
    pub fn new<const D: usize>(segments: &Segments<'_, D>) -> Result<Option<Self>, ModelError> {
        let Some(reference) = state_of(segments)? else {
            return Ok(None);
        };
        let whole = segments.passing.whole.iter();
        let over = |tensor: Option<&Tensor<D>>| D as f64 / tensor.map_or(f64::NAN, |t| t.trace());
        let over_m: Vec<Normal> = whole
            .map(|w| Normal {
                volumetric: over(w.state.as_ref().map(|s| &s.shape)),
                deviatoric: over(w.state.as_ref().map(|s| &s.second)),
            })
            .collect();
        let modulus = reference.modulus.get(0, 0, 0, 0) / over_m[0].volumetric.powi(2);
        let deviatoric = deviatoric_of(reference);
        Ok(Some(Self {
            over_m,
            bulk: modulus - 2.0 * deviatoric.unwrap_or(0.0),
            deviatoric,
        }))
    }

    /// Returns true if the law has two dilatations.
    pub fn has_two_dilatations(&self) -> bool {
        self.deviatoric.is_some()
    }

    /// Visits the dilatations at the ends of a piece, each with its factor of the piece's elongation `ξ·Δu`.
    pub fn shares<const D: usize>(
        &self,
        segments: &Segments<'_, D>,
        s: &Segment,
        visit: impl FnMut(Carrier, f64),
    ) {
        self.shares_of(Kernel::Volumetric, segments, s, visit);
    }

    /// As [`LpsConstants::shares`], of the dilatation with this influence function.
    pub fn shares_of<const D: usize>(
        &self,
        kernel: Kernel,
        segments: &Segments<'_, D>,
        s: &Segment,
        mut visit: impl FnMut(Carrier, f64),
    ) {
        let body = segments.body;
        let volume = &body.cloud.volume;
        let (i, j) = (s.i as usize, s.j as usize);
        for (side, (end, weight)) in s.ends.iter().zip(s.hands).enumerate() {
            if weight == 0.0 {
                continue;
            }
            let weight = weight * s.piece.share;
            let (own, other) = if side == 0 { (s.i, s.j) } else { (s.j, s.i) };
            match end {
                End::Point(p) => {
                    let xi = body.bond(i, j);
                    let omega = kernel.of_bond(segments.coefficients(own, other), &xi);
                    let omega = omega * kernel.of_point(body.state(own as usize));
                    visit(Carrier::Point(*p), weight * omega * volume[other as usize]);
                }
                End::Face(foot) => {
                    let xi = body.bond(i, j);
                    let omega = kernel.of_bond(segments.passing.whole_of(s.i).of(&xi), &xi);
                    let over_m = &self.over_m[usize::from(segments.passing.of_point[i])];
                    let over_m = match kernel {
                        Kernel::Volumetric => over_m.volumetric,
                        Kernel::Deviatoric => over_m.deviatoric,
                    };
                    let share =
                        weight * over_m * omega * volume[i] * volume[j] / foot.cells.len() as f64;
                    for &cell in &foot.cells {
                        visit(Carrier::Cell(cell), share);
                    }
                }
            }
        }
    }
}

impl Kernel {
    /// The weight of a bond of these coefficients.
    pub fn of_bond<const D: usize>(self, (pair, omega): (f64, f64), xi: &Vector<D>) -> f64 {
        match self {
            Self::Volumetric => omega,
            Self::Deviatoric => pair * xi.norm_squared(),
        }
    }

    /// Returns the factor of the sum of a point: the stiffness of the volumetric dilatation refers to the sum as it is.
    pub fn of_point<const D: usize>(self, state: Option<&StatePart<D>>) -> f64 {
        match self {
            Self::Volumetric => 1.0,
            Self::Deviatoric => state.map_or(0.0, |s| D as f64 / s.second.trace()),
        }
    }
}

/// c of a family, if its law has two dilatations.
pub(super) fn deviatoric_of<const D: usize>(state: &StatePart<D>) -> Option<f64> {
    (state.deviator != 0.0).then(|| state.second.trace() / (D * D) as f64)
}

/// Stiffness of the dilatation of a point, as the factor of `½ (Σ ω ξ·η V)²`.
pub(super) fn stiffness_of_point<const D: usize>(segments: &Segments<'_, D>, i: u32) -> f64 {
    let body = segments.body;
    let state = body.state(i as usize);
    let changed = segments.volume.get(&i).copied().unwrap_or(1.0);
    state.map_or(0.0, |s| s.modulus.get(0, 0, 0, 0)) * body.cloud.volume[i as usize] / changed
}

/// The state of the law, if it has one.
///
/// # Errors
/// [`ModelError::Unsupported`] for a law whose state is more than a dilatation.
pub(super) fn state_of<'a, const D: usize>(
    segments: &Segments<'a, D>,
) -> Result<Option<&'a StatePart<D>>, ModelError> {
    let first = segments.passing.whole.first();
    match first.and_then(|w| w.state.as_ref()) {
        Some(state) if !is_volumetric(state) => Err(ModelError::Unsupported {
            what: "a seam of truncated bonds for a law with a state beyond its dilatation",
            remedy: "use an lps or bond-based material, or couple by splice or blending",
        }),
        state => Ok(state),
    }
}

/// Returns true if the state of a law is its dilatation alone: `𝓜 ∝ I ⊗ I`, no stabilisation.
pub(super) fn is_volumetric<const D: usize>(state: &StatePart<D>) -> bool {
    let factor = state.modulus.get(0, 0, 0, 0);
    state.stabilisation == 0.0
        && (0..D).all(|i| {
            (0..D).all(|j| {
                let expected = if i == j {
                    Tensor::identity() * factor
                } else {
                    Tensor::zeros()
                };
                (state.modulus.0[i][j] - expected).amax() <= 1e-14 * factor.abs()
            })
        })
}

/// Owner of a dilatation: a point, or an element behind a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Carrier {
    Point(u32),
    Cell(u32),
}
