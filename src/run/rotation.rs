//! Rotation of finite elements and bonds that are linear, and the error that it causes.
//!
//! A linear element that rotates by θ without strain has the strain `(cos θ − 1) I` in the plane of the rotation. Where all of a body is linear, it is free to grow by `1/cos θ − 1` instead, and its
//! lengths are wrong by as much. Where exact bonds keep their lengths in a zone, the elements around it want to be larger than the zone by `e = 1/cos θ − 1`, and both strain each other: a misfit.
//! Its energy in a body with a round zone is that of Eshelby's inclusion [Eshelby1957] in a body of finite size,
//!
//! ```text
//! W = ½ V_z V_e/(V_z + V_e) ε* : C : (ε* − S : ε*),     ε* = e (I − n ⊗ n)
//! ```
//!
//! with the volumes of the zone and of the elements and the axis `n`: `2 K μ/(K + μ) e²` of a plane with `K = λ + μ`, and the sum of its volumetric and deviatoric part in space. It is taken from the motion.

use crate::fem;
use crate::model::{Model, SiteKind};
use crate::observe::summary::Rotation;
use crate::run::setup::RunSettings;
use crate::system::Ranks;
use crate::tensor::{Tensor, Vector, padded};

/// Rotation in degrees from which on it is reported.
pub(crate) const TOLD: f64 = 2.0;

/// Misfit, over the stretch at which bonds fail, from which on a smaller rotation is reported as well.
const TOLD_OF_FAILURE: f64 = 0.1;

/// Points whose rotation is measured, at most: all of a small body, and every so manyth of a large one, which a look would cost as much as a step.
const POINTS: usize = 2000;

/// Linear elements and points of a model, to measure their rotation.
pub(crate) struct Rotations<'m, const D: usize> {
    model: &'m Model<D>,
    cells: Vec<u32>,
    volume: Vec<f64>,
    /// Points with linear bonds.
    points: Vec<u32>,
    /// The processes over which families may be spread.
    ranks: Option<&'m dyn Ranks>,
    /// Energy of a misfit of 1 for each unit of the elements' volume; zero where none arises.
    stiffness: f64,
    /// The stretch at which bonds break or soften; none where no misfit arises or none fails.
    failing: Option<f64>,
    remedy: String,
}

/// The largest rotation of a state.
pub(crate) struct Largest {
    pub degrees: f64,
    pub place: [f64; 3],
    /// Energy of the misfit, as predicted.
    pub energy: f64,
}

impl<'m, const D: usize> Rotations<'m, D> {
    /// Of all elements of a model that are for small strains, and of its points that are too, none in one dimension; `failing` the stretch at which they break or soften.
    pub fn new(
        model: &'m Model<D>,
        rest: &RunSettings<D>,
        failing: Option<f64>,
        ranks: Option<&'m dyn Ranks>,
    ) -> Self {
        let all = 0..model.mesh.cell_count();
        let cells: Vec<u32> = match D {
            1 => Vec::new(),
            _ => all
                .filter(|&c| model.is_element(c) && model.mesh.embedded.has_strain(c))
                .filter(|&c| !rest.is_objective(model, c))
                .map(|c| c as u32)
                .collect(),
        };
        let of_cell = |&c: &u32| fem::cell_volume(&model.mesh, c as usize);
        let volume: Vec<f64> = cells.iter().map(of_cell).collect();
        let elements: f64 = volume.iter().sum();
        let zone: f64 = (model.sites.iter())
            .filter(|s| matches!(s.kind, SiteKind::Point(_)))
            .map(|s| s.volume)
            .sum();
        let linear = |i: &usize| rest.has_linear_point(model, *i);
        let points: Vec<u32> = match model.body().filter(|_| D > 1) {
            Some(body) => {
                let all = body.families.len();
                let has_bonds = |&i: &usize| model.family_size(i) > D;
                let some = (0..all).step_by(all.div_ceil(POINTS).max(1));
                let some = some.filter(has_bonds).filter(linear);
                some.map(|i| i as u32).collect()
            }
            None => Vec::new(),
        };
        let is_linear = model
            .body()
            .is_none_or(|b| (0..b.families.len()).any(|i| linear(&i)));
        let stiffness = match (is_linear, cells.first()) {
            (false, Some(&c)) if zone > 0.0 => {
                misfit_stiffness(model, c as usize) * zone / (zone + elements)
            }
            _ => 0.0,
        };
        let remedy = remedy(model, rest, &cells, &points);
        Self {
            model,
            cells,
            volume,
            points,
            ranks,
            stiffness,
            failing: failing.filter(|_| stiffness > 0.0),
            remedy,
        }
    }

    /// The largest rotation under a displacement; none without anything linear. Collective where families are spread.
    pub fn largest(&self, u: &[f64]) -> Option<Largest> {
        let transfer = &self.model.node_transfer;
        let (mut largest, mut energy) = ((-1.0, Vector::<D>::zeros()), 0.0);
        for (&c, volume) in self.cells.iter().zip(&self.volume) {
            let node = |n: usize| transfer.displacement(n, u);
            let gradient = fem::displacement_gradient_at_centre(&self.model.mesh, c as usize, node);
            let angle = rotation(&gradient);
            if angle > largest.0 {
                largest = (angle, self.model.mesh.centroid(c as usize));
            }
            // beyond 89.5 degrees a linear body has no size
            let misfit = 1.0 / angle.cos().max(0.01) - 1.0;
            energy += self.stiffness * volume * misfit * misfit;
        }
        let of_points = (self.points.iter()).zip(self.angles_of_points(u));
        for (&i, angle) in of_points {
            if let Some(body) = self.model.body().filter(|_| angle > largest.0) {
                largest = (angle, body.cloud.position[i as usize]);
            }
        }
        let (angle, place) = largest;
        (angle >= 0.0).then(|| Largest {
            degrees: angle.to_degrees(),
            place: padded(&place),
            energy,
        })
    }

    /// The angle of the displacement gradient that fits the family of each point best; not a number where none does.
    fn angles_of_points(&self, u: &[f64]) -> Vec<f64> {
        let Some(body) = self.model.body() else {
            return Vec::new();
        };
        let displacement = |p: usize| body.cloud.transfer.displacement(p, u);
        let angle = |&i: &u32| {
            let i = i as usize;
            let (x, at) = (body.cloud.position[i], displacement(i));
            let (mut shape, mut moved) = (Tensor::<D>::zeros(), Tensor::<D>::zeros());
            for &j in body.families.of(i) {
                let xi = body.cloud.position[j as usize] - x;
                shape += xi * xi.transpose();
                moved += (displacement(j as usize) - at) * xi.transpose();
            }
            let inverse = shape.try_inverse();
            inverse.map_or(f64::NAN, |inverse| rotation(&(moved * inverse)))
        };
        let angles = |own: &[u32]| own.iter().map(angle).collect();
        (self.model).of_families(self.ranks, &self.points, 1, angles)
    }

    /// Returns the entry of the summary, from [`TOLD`] or [`TOLD_OF_FAILURE`] on; `scale` is the largest energy of the run, `when` a step with its time.
    pub fn told(
        &self,
        degrees: f64,
        place: [f64; 3],
        energy: f64,
        scale: f64,
        when: Option<(u64, f64)>,
    ) -> Option<Rotation> {
        let length_error = 1.0 / degrees.to_radians().cos().abs().max(0.01) - 1.0;
        let of_failure = self.failing.map(|stretch| length_error / stretch);
        let is_near_failure = of_failure.is_some_and(|part| part >= TOLD_OF_FAILURE);
        (degrees >= TOLD || is_near_failure).then(|| Rotation {
            degrees,
            place: place[..D].to_vec(),
            when,
            length_error,
            of_failure: of_failure.filter(|_| is_near_failure),
            energy_error: (self.stiffness > 0.0 && scale > 0.0).then(|| energy / scale),
            remedy: self.remedy.clone(),
        })
    }
}

/// Returns the keys of a scene that let its linear elements and points rotate.
fn remedy<const D: usize>(
    model: &Model<D>,
    rest: &RunSettings<D>,
    cells: &[u32],
    points: &[u32],
) -> String {
    let has_law = |c: &u32| {
        let material = model.material_of_cell(*c as usize);
        model.local_law(&rest.local_laws, material).is_some()
    };
    let is_correspondence = |i: &u32| model.local_law_at(*i as usize).is_some();
    let bonds = points.iter().any(|i| !is_correspondence(i));
    let elements = cells.iter().any(|c| !has_law(c));
    let laws = cells.iter().any(has_law) || points.iter().any(is_correspondence);
    let remedies = [
        (bonds, "bonds = \"exact\" in [peridynamics]"),
        (
            elements,
            "for elements elements = \"cauchy-born\", or coupling = \"nonlocal\" with exact bonds",
        ),
        (
            laws,
            "strains = \"large\" in a material that has it, or a hyperelastic one",
        ),
    ];
    let remedies = remedies.into_iter().filter(|(holds, _)| *holds);
    let remedies: Vec<&str> = remedies.map(|(_, what)| what).collect();
    remedies.join(", ")
}

/// `½ ε* : C : (ε* − S : ε*)` for a misfit of 1.
fn misfit_stiffness<const D: usize>(model: &Model<D>, cell: usize) -> f64 {
    let c = model.tensor_of_cell(cell);
    let (lambda, mu) = c.isotropic_part();
    if D == 2 {
        let bulk = lambda + mu;
        return 2.0 * bulk * mu / (bulk + mu);
    }
    let bulk = lambda + 2.0 / 3.0 * mu;
    // Eshelby's tensor of a sphere: parts of a volumetric and of a deviatoric strain that remain
    let volumetric = 3.0 * bulk / (3.0 * bulk + 4.0 * mu);
    let deviatoric = 1.2 * (bulk + 2.0 * mu) / (3.0 * bulk + 4.0 * mu);
    // (1, 1, 0) has the trace 2 and the deviatoric square 2/3
    0.5 * (bulk * 4.0 * (1.0 - volumetric) + 2.0 * mu * 2.0 / 3.0 * (1.0 - deviatoric))
}

/// Angle of rotation of `F = I + ∇u` in radians; exact without strain, and to first order of it otherwise.
fn rotation<const D: usize>(gradient: &Tensor<D>) -> f64 {
    let trace: f64 = (0..D).map(|i| 1.0 + gradient[(i, i)]).sum();
    let half = |i: usize, j: usize| 0.5 * (gradient[(j, i)] - gradient[(i, j)]);
    if D == 2 {
        return half(0, 1).abs().atan2(0.5 * trace);
    }
    let axis = half(1, 2).hypot(half(2, 0)).hypot(half(0, 1));
    axis.atan2(0.5 * (trace - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_is_that_of_the_matrix() {
        for degrees in [0.5_f64, 5.0, 80.0, 120.0, 179.0] {
            let angle = degrees.to_radians();
            let plane = nalgebra::Rotation2::new(-angle).into_inner();
            assert!((rotation::<2>(&(plane - Tensor::<2>::identity())) - angle).abs() < 1e-12);
            let axis = nalgebra::Unit::new_normalize(nalgebra::Vector3::new(1.0, -2.0, 0.5));
            let space = nalgebra::Rotation3::from_axis_angle(&axis, angle).into_inner();
            assert!((rotation::<3>(&(space - Tensor::<3>::identity())) - angle).abs() < 1e-12);
            // a strain changes it to second order only, and a stretch not at all
            let stretched = plane * 1.1 - Tensor::<2>::identity();
            assert!((rotation::<2>(&stretched) - angle).abs() < 1e-12);
        }
    }
}
