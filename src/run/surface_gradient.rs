//! Stresses that fall off faster than families resolve: from a free surface, or from elements beside a seam.

use rustc_hash::FxHashMap;

use crate::material::Kinematics;
use crate::observe::report::number;
use crate::observe::warning::{Code, Quantity, Warning};
use crate::shape::Barrier;
use crate::system::Ranks;
use crate::tensor::{Tensor, Tensor4, Vector, inverse, strain};
use crate::{
    fem,
    model::{HorizonField, Model, PointSource, SiteKind},
    parallel,
};

use super::slopes::{Slopes, Teller};
use super::stresses::{principal, von_mises};

/// The share of the largest stress that families may miss without a warning: that of a bent beam whose depth is ten horizons.
const MISSED: f64 = 0.08;

/// Distance of a family's centroid from its point, over the horizon, from which the point is taken to lie at a surface; 0.42 at a plane one of a plate, 3/8 of a solid.
const ONE_SIDED: f64 = 0.2;

/// Error of the largest stress beside a seam from which on it is told.
const BENT: f64 = 0.05;

/// Error of a stress over the difference of an element's own from a linear fit to those around: of peaks at holes, bores and notches on drawn lattices (`bondline verify warnings`) it was 0.39 and 0.45 of it.
const OF_DIFFERENCE: f64 = 0.5;

/// Data for the check of the stresses of a displacement.
pub(super) struct Asked<'a> {
    pub kinematics: Kinematics,
    /// The displacement of the sites \[m\].
    pub displacement: &'a [f64],
    /// The part of itself by which a uniform stress is wrong at surfaces.
    pub uniform: f64,
}

/// The warnings of [`missed_peak`] and [`peak_at_seam`]. Collective where families are spread over processes.
pub(super) fn steep_stresses<const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    asked: &Asked<'_>,
) -> Vec<Warning> {
    if D == 1 || model.body().is_none() {
        return Vec::new();
    }
    let stresses = point_stresses(model, ranks, asked);
    let at_surface = missed_peak(model, ranks, asked, &stresses);
    let at_seam = peak_at_seam(model, ranks, asked, &stresses);
    at_surface.into_iter().chain(at_seam).collect()
}

/// The sites that are points: points within elements complete the families of others, and no output has their stress.
fn shown<const D: usize>(model: &Model<D>) -> impl Iterator<Item = usize> + Clone {
    model.sites.iter().filter_map(|site| match site.kind {
        SiteKind::Point(p) => Some(p as usize),
        SiteKind::Node(_) => None,
    })
}

/// The inverse of the second moment of a family.
fn inverse_moment<const D: usize>(model: &Model<D>, p: usize) -> Option<Tensor<D>> {
    let shape: Tensor<D> = bonds(model, p)
        .map(|(_, xi, v)| xi * xi.transpose() * v)
        .sum();
    inverse(&shape).map(|(inverse, _)| inverse)
}

/// The far point, vector and volume of each bond of a point.
fn bonds<const D: usize>(
    model: &Model<D>,
    p: usize,
) -> impl Iterator<Item = (usize, Vector<D>, f64)> {
    model.body().into_iter().flat_map(move |body| {
        let cloud = &body.cloud;
        let far = body.families.of(p).iter().map(|&j| j as usize);
        far.map(move |j| (j, cloud.position[j] - cloud.position[p], cloud.volume[j]))
    })
}

/// The elastic von Mises stress \[Pa\] of the mean strain of each family.
fn point_stresses<const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    asked: &Asked<'_>,
) -> Vec<f64> {
    let (Some(body), Some(p)) = (model.body(), &model.peridynamics) else {
        return Vec::new();
    };
    let (cloud, tensor) = (&body.cloud, p.law.linearised().tensor());
    let u: Vec<Vector<D>> = (0..cloud.position.len())
        .map(|p| cloud.transfer.displacement(p, asked.displacement))
        .collect();
    let stress_of = |p: usize| Some(size(asked, tensor, &mean_gradient(model, p, |p| u[p])?));
    let points: Vec<u32> = (0..cloud.position.len() as u32).collect();
    model.of_families(ranks, &points, 1, |own| {
        parallel::map(own.len(), 64, |k| stress_of(own[k] as usize).unwrap_or(0.0))
    })
}

/// The mean displacement gradient of a family, from the displacements of its points.
fn mean_gradient<const D: usize>(
    model: &Model<D>,
    p: usize,
    u: impl Fn(usize) -> Vector<D>,
) -> Option<Tensor<D>> {
    let own = u(p);
    let sum: Tensor<D> = bonds(model, p)
        .map(|(j, xi, v)| (u(j) - own) * xi.transpose() * v)
        .sum();
    Some(sum * inverse_moment(model, p)?)
}

/// The von Mises stress \[Pa\] of a displacement gradient.
fn size<const D: usize>(asked: &Asked<'_>, tensor: &Tensor4<D>, gradient: &Tensor<D>) -> f64 {
    let stress = tensor.contract(&strain(gradient));
    let across = stress_across(asked.kinematics, tensor, &stress);
    von_mises(&principal(&stress, across))
}

/// Warns of the largest stress of points where it lies at a free surface and changes within a family, by more than the part `uniform` of itself by which a uniform stress is wrong there: less may be the law's own surface effect.
///
/// The deformation that a family measures is a mean, that at its centroid, for fields that are linear over it. At a free surface the centroid lies inside by 0.42 of a horizon in plates and 3/8 in solids, so that a stress that falls off into the body,
/// as beside a hole or in bending, is wrong by its gradient times that distance, too low by correspondence; by an LPS, which strains more at surfaces, it may be too high. The gradient of the points is one of means, too, so that this is a lower bound: Kirsch's peak at a hole whose radius
/// is 3.3 horizons is 24 % above that of points by correspondence, of which 10 to 11 % are reported (`tests/loads/stresses.rs`). Cracks are left out: their stress has no bound that a mesh could resolve.
///
/// Collective where families are spread over processes.
fn missed_peak<const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    asked: &Asked<'_>,
    stresses: &[f64],
) -> Option<Warning> {
    let cloud = &model.body()?.cloud;
    let largest = shown(model).map(|p| stresses[p]).fold(0.0, f64::max);
    // stress at the surface beyond that of the point, for a stress that is linear over the family
    let beyond = |p: usize| {
        // a face of elements is no surface of the body
        if bonds(model, p).any(|(j, _, _)| model.is_foot(j as u32)) {
            return None;
        }
        let volume: f64 = bonds(model, p).map(|(_, _, v)| v).sum();
        let centroid = bonds(model, p).map(|(_, xi, v)| xi * v).sum::<Vector<D>>() / volume;
        if centroid.norm() < ONE_SIDED * cloud.horizon.of(p) || near_crack(model, p) {
            return None;
        }
        let slopes = bonds(model, p).map(|(j, xi, v)| xi * (v * (stresses[j] - stresses[p])));
        let slope = inverse_moment(model, p)? * slopes.sum::<Vector<D>>();
        Some(-slope.dot(&centroid))
    };
    let near_largest = shown(model).filter(|&p| stresses[p] > (1.0 - MISSED) * largest);
    let near_largest: Vec<u32> = near_largest.map(|p| p as u32).collect();
    let missed = model.of_families(ranks, &near_largest, 1, |own| {
        let beyond = |&p: &u32| beyond(p as usize).unwrap_or(f64::NAN);
        own.iter().map(beyond).collect()
    });
    let found = near_largest.iter().map(|&p| p as usize).zip(missed);
    let found = found.filter(|(_, missed)| !missed.is_nan());
    let (p, missed) = found.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (missed > asked.uniform.max(MISSED) * stresses[p]).then(|| {
        let place: Vec<String> = cloud.position[p].iter().map(|x| number(*x)).collect();
        finer(Warning::new(Code::SurfacePeak, format!(
            "the largest stress of the points lies at a free surface, at ({}), and falls off within a family: points have means over families, which do not resolve its peak: that of outputs may be wrong by {:.0} % and more; take a smaller horizon there, or let elements carry the surface and what lies within two horizons of it",
            place.join(", "),
            100.0 * missed / stresses[p]
        )).of(Quantity::Stress, -missed / stresses[p]).at(cloud.position[p].as_slice()), model)
    })
}

/// Warns of the largest stress of a model where it lies in an element of first order within a horizon of points, and its error is more than [`BENT`]: rows of a seam balance a uniform stress, and one that is linear to the order of the elements. The error is taken from the difference
/// of the element's own strain from a linear fit to those around, as in \[ZienkiewiczZhu1992\].
///
/// Collective where families are spread over processes.
fn peak_at_seam<const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    asked: &Asked<'_>,
    stresses: &[f64],
) -> Option<Warning> {
    let (mesh, cloud) = (&model.mesh, &model.body()?.cloud);
    let gradient_of = |c: usize| {
        let node = |n: usize| model.node_transfer.displacement(n, asked.displacement);
        fem::displacement_gradient_at_centre(mesh, c, node)
    };
    let of_cell = |c: usize| size(asked, model.tensor_of_cell(c), &gradient_of(c));
    let cells: Vec<usize> = (0..mesh.cell_count())
        .filter(|&c| model.is_element(c) && mesh.embedded.has_strain(c))
        .collect();
    let of_cells = parallel::map(cells.len(), 64, |k| of_cell(cells[k]));
    let elements = cells.iter().copied().zip(of_cells);
    let (cell, largest) = elements.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let place = mesh.centroid(cell);
    let horizon = model.peridynamics.as_ref()?.horizon.at(&place);
    let is_near = |x: &Vector<D>| (x - place).norm() < horizon * (1.0 + 1e-9);
    let mut points = shown(model).map(|p| (cloud.position[p], stresses[p]));
    if points.clone().any(|(_, stress)| stress > largest) || !points.any(|(x, _)| is_near(&x)) {
        return None;
    }
    let u = |p: usize| cloud.transfer.displacement(p, asked.displacement);
    let slope = Slopes::new(model).evened_out(cell)?;
    let points = slope.tellers().filter_map(|teller| match teller {
        Teller::Element(_) => None,
        Teller::Point(site) => model.point_of(site).map(|(_, p)| p as u32),
    });
    let points: Vec<u32> = points.collect();
    let of_points = model.of_families(ranks, &points, D * D, |own| {
        let of = |&p: &u32| mean_gradient(model, p as usize, u).unwrap_or_else(Tensor::zeros);
        own.iter()
            .flat_map(|p| of(p).iter().copied().collect::<Vec<f64>>())
            .collect()
    });
    let of_points = of_points.chunks_exact(D * D).map(Tensor::from_column_slice);
    let of_points: FxHashMap<u32, Tensor<D>> = points.iter().copied().zip(of_points).collect();
    let fitted: Tensor<D> = slope.value(|teller| match teller {
        Teller::Element(c) => gradient_of(c),
        Teller::Point(site) => {
            let point = model.point_of(site).map(|(_, p)| p as u32);
            point.map_or_else(Tensor::zeros, |p| of_points[&p])
        }
    });
    let fitted = size(asked, model.tensor_of_cell(cell), &fitted);
    let off = OF_DIFFERENCE * (fitted / largest - 1.0).abs();
    (off > BENT).then(|| {
        let at = place;
        let place: Vec<String> = place.iter().map(|x| number(*x)).collect();
        finer(Warning::new(Code::SeamPeak, format!(
            "the largest stress lies in an element beside the seam, at ({}), where strains are not linear from one place to the next: it may be wrong by {:.0} %; let elements carry what lies within two horizons of this place, or take a smaller horizon and spacing",
            place.join(", "),
            100.0 * off
        )).of(Quantity::Stress, off).at(at.as_slice()), model)
    })
}

/// With a remedy: bonds that end on faces where the coupling is by forces, whose rows know of no surface; else half the horizon and spacing, of points on one lattice.
fn finer<const D: usize>(warning: Warning, model: &Model<D>) -> Warning {
    let has_elements = (0..model.mesh.cell_count()).any(|c| model.is_element(c));
    if has_elements && !model.faces_cut_bonds() {
        return warning.remedy(["coupling=truncated"]);
    }
    let of = model.peridynamics.as_ref().map(|p| (&p.horizon, &p.points));
    let Some((HorizonField::Uniform(horizon), PointSource::Lattice { spacing, .. })) = of else {
        return warning;
    };
    let horizon = format!("peridynamics.horizon={}", 0.5 * horizon);
    let points = format!("peridynamics.points.lattice.spacing={}", 0.5 * spacing);
    warning.remedy([&horizon, &points])
}

/// The stress across the plane of a plate.
fn stress_across<const D: usize>(
    kinematics: Kinematics,
    tensor: &Tensor4<D>,
    stress: &Tensor<D>,
) -> f64 {
    match kinematics {
        // ν = λ/(2 (λ + μ)), and σ_zz = ν (σ_xx + σ_yy)
        Kinematics::PlaneStrain => {
            let [axial, lateral] = [tensor.get(0, 0, 0, 0), tensor.get(0, 0, 1, 1)];
            stress.trace() * lateral / (axial + lateral)
        }
        _ => 0.0,
    }
}

/// Returns true if a point lies within a horizon of a crack.
fn near_crack<const D: usize>(model: &Model<D>, p: usize) -> bool {
    let (Some(body), Some(peridynamics)) = (model.body(), &model.peridynamics) else {
        return false;
    };
    let (x, horizon) = (&body.cloud.position[p], body.cloud.horizon.of(p));
    let cracks = peridynamics.barriers.iter();
    cracks
        .filter(|barrier| matches!(barrier, Barrier::Crack(_)))
        .any(|crack| crack.shape().signed_distance(x) <= horizon)
}
