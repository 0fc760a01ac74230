//! Stresses that fall off from a free surface faster than families resolve.

use crate::material::Kinematics;
use crate::observe::report::number;
use crate::shape::Barrier;
use crate::system::Ranks;
use crate::tensor::{Tensor, Tensor4, Vector, inverse};
use crate::{
    coupling::{Model, SiteKind},
    parallel,
};

use super::stresses::{principal, von_mises};

/// The share of the largest stress that families may miss before it is told: that of a bent beam whose depth is ten horizons.
const MISSED: f64 = 0.08;

/// Distance of a family's centroid from its point, over the horizon, from which the point is taken to lie at a surface; 0.42 at a plane one of a plate, 3/8 of a solid.
const ONE_SIDED: f64 = 0.2;

/// Tells of the largest stress of points where it lies at a free surface and changes within a family, by more than the part `uniform` of itself by which a uniform stress is wrong there: less may be the law's own surface effect.
///
/// What a family knows of a deformation is its mean, that at its centroid, for fields that are linear over it. At a free surface the centroid lies inside by 0.42 of a horizon in plates and 3/8 in solids, so that a stress that falls off into the body,
/// as beside a hole or in bending, is wrong by its gradient times that distance, too low by correspondence; by an LPS, which strains more at surfaces, it may be too high. The gradient of the points is one of means, too, so that this is a lower bound: Kirsch's peak at a hole whose radius
/// is 3.3 horizons is 24 % above that of points by correspondence, of which 10 to 11 % are told (`tests/loads/stresses.rs`). Cracks are left out: their stress has no bound that a mesh could resolve. `elements` says what elements can do instead.
///
/// Collective where families are spread over processes.
pub(super) fn missed_peak<const D: usize>(
    model: &Model<D>,
    ranks: Option<&dyn Ranks>,
    kinematics: Kinematics,
    displacement: &[f64],
    uniform: f64,
    elements: &str,
) -> Option<String> {
    let (body, law) = (model.body()?, &model.peridynamics.as_ref()?.law);
    if D == 1 {
        return None;
    }
    let cloud = &body.cloud;
    let u: Vec<Vector<D>> = (0..cloud.position.len())
        .map(|p| cloud.transfer.displacement(p, displacement))
        .collect();
    let bonds = |p: usize| {
        let far = body.families.of(p).iter().map(|&j| j as usize);
        far.map(move |j| (j, cloud.position[j] - cloud.position[p], cloud.volume[j]))
    };
    let moment = |p: usize| {
        let shape: Tensor<D> = bonds(p).map(|(_, xi, v)| xi * xi.transpose() * v).sum();
        inverse(&shape).map(|(inverse, _)| inverse)
    };
    let tensor = law.linearised().tensor();
    let stress_of = |p: usize| {
        let sum: Tensor<D> = bonds(p)
            .map(|(j, xi, v)| (u[j] - u[p]) * xi.transpose() * v)
            .sum();
        let strain = sum * moment(p)?;
        let stress = tensor.contract(&(0.5 * (strain + strain.transpose())));
        let across = stress_across(kinematics, tensor, &stress);
        Some(von_mises(&principal(&stress, across)))
    };
    let points: Vec<u32> = (0..u.len() as u32).collect();
    let stresses = model.of_families(ranks, &points, 1, |own| {
        parallel::map(own.len(), 64, |k| stress_of(own[k] as usize).unwrap_or(0.0))
    });
    // points within elements complete the families of others, and no output has their stress
    let shown = model.sites.iter().filter_map(|site| match site.kind {
        SiteKind::Point(p) => Some(p as usize),
        SiteKind::Node(_) => None,
    });
    let largest = shown.clone().map(|p| stresses[p]).fold(0.0, f64::max);
    // stress at the surface beyond that of the point, for a stress that is linear over the family
    let beyond = |p: usize| {
        // a face of elements is no surface of the body
        if bonds(p).any(|(j, _, _)| model.is_foot(j as u32)) {
            return None;
        }
        let volume: f64 = bonds(p).map(|(_, _, v)| v).sum();
        let centroid = bonds(p).map(|(_, xi, v)| xi * v).sum::<Vector<D>>() / volume;
        if centroid.norm() < ONE_SIDED * cloud.horizon.of(p) || near_crack(model, p) {
            return None;
        }
        let slopes = bonds(p).map(|(j, xi, v)| xi * (v * (stresses[j] - stresses[p])));
        let slope = moment(p)? * slopes.sum::<Vector<D>>();
        Some(-slope.dot(&centroid))
    };
    let near_largest = shown.filter(|&p| stresses[p] > (1.0 - MISSED) * largest);
    let near_largest: Vec<u32> = near_largest.map(|p| p as u32).collect();
    let missed = model.of_families(ranks, &near_largest, 1, |own| {
        let beyond = |&p: &u32| beyond(p as usize).unwrap_or(f64::NAN);
        own.iter().map(beyond).collect()
    });
    let found = near_largest.iter().map(|&p| p as usize).zip(missed);
    let found = found.filter(|(_, missed)| !missed.is_nan());
    let (p, missed) = found.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (missed > uniform.max(MISSED) * stresses[p]).then(|| {
        let place: Vec<String> = cloud.position[p].iter().map(|x| number(*x)).collect();
        format!(
            "the largest stress of the points lies at a free surface, at ({}), and falls off within a family: points have means over families, which do not resolve its peak: that of outputs may be wrong by {:.0} % and more; take a smaller horizon there, or let elements {elements}",
            place.join(", "),
            100.0 * missed / stresses[p]
        )
    })
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

/// Whether a point lies within a horizon of a crack.
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
