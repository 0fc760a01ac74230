//! Stresses that fall off faster than families resolve: from a free surface, or from elements beside a seam.

use rustc_hash::FxHashMap;

use crate::observe::report::number;
use crate::observe::warning::{Code, Quantity, Warning};
use crate::run::stress_settings::StressSettings;
use crate::shape::Barrier;
use crate::system::Ranks;
use crate::tensor::{Tensor, Tensor4, Vector, inverse, strain};
use crate::{
    fem,
    model::{Bins, HorizonField, Model, PointSource, SiteKind},
    parallel,
};

use super::slopes::{Slope, Slopes, Teller};
use super::stresses::{principal, von_mises};

/// The share of the largest stress that families may miss without a warning: that of a bent beam whose depth is ten horizons.
const MISSED: f64 = 0.08;

/// Distance of a family's centroid from its point, over the horizon, from which the point is taken to lie at a surface; 0.42 at a plane one of a plate, 3/8 of a solid.
const ONE_SIDED: f64 = 0.2;

/// Error of a stress beside a seam, over the largest one, from which on it is told.
const BENT: f64 = 0.05;

/// Part of the largest stress from which on a stress beside a seam is looked at.
const LARGE: f64 = 0.3;

/// Error of a stress over the difference of an element's own from a linear fit to those around: of peaks at holes, bores and notches on drawn lattices (`bondline verify warnings`) it was 0.39 and 0.45 of it.
const OF_DIFFERENCE: f64 = 0.5;

/// Data for the check of the stresses of a displacement.
pub(super) struct Asked<'a, const D: usize> {
    pub stresses: &'a StressSettings<D>,
    /// The displacement of the sites \[m\].
    pub displacement: &'a [f64],
    /// The part of itself by which a uniform stress is wrong at surfaces.
    pub uniform: f64,
}

/// The warnings of [`missed_peak`] and [`peak_at_seam`]. Collective where families are spread over processes.
pub(super) fn steep_stresses<const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    asked: &Asked<'_, D>,
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
    asked: &Asked<'_, D>,
) -> Vec<f64> {
    let (Some(body), Some(p)) = (model.body(), &model.peridynamics) else {
        return Vec::new();
    };
    let (cloud, tensor) = (&body.cloud, p.law.linearised().tensor());
    let u: Vec<Vector<D>> = (0..cloud.position.len())
        .map(|p| cloud.transfer.displacement(p, asked.displacement))
        .collect();
    let stress_of = |p: usize| {
        let at = (model.peridynamic_material(), &cloud.position[p]);
        Some(size(asked, tensor, at, &mean_gradient(model, p, |p| u[p])?))
    };
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

/// The von Mises stress \[Pa\] of a displacement gradient in a material at a place.
fn size<const D: usize>(
    asked: &Asked<'_, D>,
    tensor: &Tensor4<D>,
    (material, x): (u16, &Vector<D>),
    gradient: &Tensor<D>,
) -> f64 {
    let stress = tensor.contract(&strain(gradient));
    let across = asked.stresses.across(material, x, &stress, 0.0);
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
    asked: &Asked<'_, D>,
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

/// Warns of large stresses in elements of first order within a horizon of points, where their error is more than [`BENT`] of the largest one: rows of a seam balance a uniform stress, and one that is linear to the order of the elements. The error is taken from the difference
/// of an element's own strain from a linear fit to those around, as in \[ZienkiewiczZhu1992\].
///
/// Collective where families are spread over processes.
fn peak_at_seam<const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    asked: &Asked<'_, D>,
    stresses: &[f64],
) -> Option<Warning> {
    let mesh = &model.mesh;
    let gradient_of = |c: usize| {
        let node = |n: usize| model.node_transfer.displacement(n, asked.displacement);
        fem::displacement_gradient_at_centre(mesh, c, node)
    };
    let of = |c: usize, gradient: &Tensor<D>| {
        let at = (model.material_of_cell(c), &mesh.centroid(c));
        size(asked, model.tensor_of_cell(c), at, gradient)
    };
    let cells: Vec<usize> = (0..mesh.cell_count())
        .filter(|&c| model.is_element(c) && mesh.embedded.has_strain(c))
        .collect();
    let of_cells = parallel::map(cells.len(), 64, |k| {
        let c = cells[k];
        of(c, &gradient_of(c))
    });
    let of_points = shown(model).map(|p| stresses[p]);
    let largest = of_points
        .chain(of_cells.iter().copied())
        .fold(0.0, f64::max);
    let elements = cells.into_iter().zip(of_cells);
    let large = elements.filter(|(_, stress)| *stress > LARGE * largest);
    let large: Vec<(usize, f64)> = beside_points(model, large.collect());
    let slopes = Slopes::new(model);
    let slopes: Vec<_> = parallel::map(large.len(), 8, |k| slopes.evened_out(large[k].0));
    let of_points = mean_gradients(model, ranks, asked, slopes.iter().flatten());
    let found = large
        .iter()
        .zip(&slopes)
        .filter_map(|(&(cell, own), slope)| {
            let fitted: Tensor<D> = slope.as_ref()?.value(|teller| match teller {
                Teller::Element(c) => gradient_of(c),
                Teller::Point(site) => {
                    let point = model.point_of(site).map(|(_, p)| p as u32);
                    point.map_or_else(Tensor::zeros, |p| of_points[&p])
                }
            });
            let fitted = of(cell, &fitted);
            Some((cell, own, OF_DIFFERENCE * (fitted - own).abs()))
        });
    let (cell, own, off) = found.max_by(|a, b| a.2.total_cmp(&b.2))?;
    (off > BENT * largest).then(|| {
        let at = mesh.centroid(cell);
        let place: Vec<String> = at.iter().map(|x| number(*x)).collect();
        finer(Warning::new(Code::SeamPeak, format!(
            "strains in elements beside the seam are not linear from one place to the next near ({}), where the stress is {:.0} % of the largest: it may be wrong by {:.0} % of itself; let elements carry what lies within two horizons of this place, or take a smaller horizon and spacing",
            place.join(", "),
            100.0 * own / largest,
            100.0 * off / own
        )).of(Quantity::Stress, off / own).at(at.as_slice()), model)
    })
}

/// Those of some elements, each with a number, that lie within a horizon of a point.
fn beside_points<const D: usize>(model: &Model<D>, cells: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    let (Some(body), Some(peridynamics)) = (model.body(), &model.peridynamics) else {
        return Vec::new();
    };
    let points: Vec<Vector<D>> = shown(model).map(|p| body.cloud.position[p]).collect();
    let reach = |x: &Vector<D>| peridynamics.horizon.at(x) * (1.0 + 1e-9);
    let widest = cells.iter().map(|(c, _)| reach(&model.mesh.centroid(*c)));
    let bins = Bins::new(&points, widest.fold(f64::MIN_POSITIVE, f64::max));
    let is_near = |(c, _): &(usize, f64)| {
        let x = model.mesh.centroid(*c);
        bins.around(&x, reach(&x))
            .any(|p| (points[p] - x).norm() < reach(&x))
    };
    cells.into_iter().filter(is_near).collect()
}

/// The mean displacement gradients of the families of all points that tell of some slopes, by the point.
///
/// Collective where families are spread over processes.
fn mean_gradients<'s, const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    asked: &Asked<'_, D>,
    slopes: impl Iterator<Item = &'s Slope>,
) -> FxHashMap<u32, Tensor<D>> {
    let Some(cloud) = model.body().map(|body| &body.cloud) else {
        return FxHashMap::default();
    };
    let u = |p: usize| cloud.transfer.displacement(p, asked.displacement);
    let points = slopes
        .flat_map(Slope::tellers)
        .filter_map(|teller| match teller {
            Teller::Element(_) => None,
            Teller::Point(site) => model.point_of(site).map(|(_, p)| p as u32),
        });
    let mut points: Vec<u32> = points.collect();
    points.sort_unstable();
    points.dedup();
    let found = model.of_families(ranks, &points, D * D, |own| {
        let of = |&p: &u32| mean_gradient(model, p as usize, u).unwrap_or_else(Tensor::zeros);
        own.iter()
            .flat_map(|p| of(p).iter().copied().collect::<Vec<f64>>())
            .collect()
    });
    let found = found.chunks_exact(D * D).map(Tensor::from_column_slice);
    points.iter().copied().zip(found).collect()
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
