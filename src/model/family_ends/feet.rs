//! Feet: places on the faces of elements at which families end.

use crate::mesh::{Mesh, boundary::BoundaryFacet};
use crate::model::{
    Bins, CellRole, ModelError, Peridynamics, Zone,
    completed_lattice::CompletedLattice,
    point_cloud::{PointCarrier, PointCloud},
};
use crate::peridynamics::{Cloud, Ends, Factors, Families, FamilyEnds, PdBody};
use crate::tensor::{Vector, inverse};

/// Feet farther from a point than this of its horizon are none of its own: the influence function may vanish there.
const FARTHEST: f64 = 0.97;

/// Points nearer to a face than this of the spacing are left out.
const CLOSEST: f64 = 0.2;

/// Spread of a cut bond over the feet around it, over the spacing.
const SPREAD: f64 = 0.5;

/// The least fraction of a bond that counts as the length of its part within the zone.
const SHORTEST: f64 = 0.1;

/// Data of the seam from the whole lattice, continued into the elements.
pub(crate) struct Feet<const D: usize> {
    /// Number of points of the zone, which come first in the cloud.
    pub points: usize,
    /// For each point of the zone, the first weights ω of its bonds to feet, the last ones of its family.
    pub omega: Vec<Vec<f64>>,
    /// Target value of `Σ_p V_p b_pq` \[m^(D−1)\] for each point q of the zone: zero, or near surfaces of the body its value in the whole lattice.
    pub wanted: Vec<Vector<D>>,
    /// For each point, true if its whole family is complete.
    pub is_whole: Vec<bool>,
    /// The faces, seen from the elements.
    pub faces: Vec<BoundaryFacet>,
    /// Points of the lattice in the zone that are none, since they lie too close to a face.
    pub left_out: Vec<Vector<D>>,
    /// Ends of the families at the feet, and the volumes behind the faces.
    pub ends: FamilyEnds,
}

/// Ends the families of the points of a lattice at feet; `whole` is the lattice with the points in elements that complete them.
///
/// # Errors
/// [`ModelError::Unsupported`] for a horizon that varies, [`ModelError::Family`] for a family that cannot carry the law.
pub(crate) fn place<const D: usize>(
    (mesh, roles): (&Mesh<D>, &[CellRole]),
    p: &Peridynamics<D>,
    whole: CompletedLattice<D>,
) -> Result<(CompletedLattice<D>, Feet<D>), ModelError> {
    let Some(horizon) = whole.cloud.horizon.uniform() else {
        return Err(ModelError::Unsupported {
            what: "truncated families of a horizon that varies",
            remedy: "use a constant horizon, or coupling.splice",
        });
    };
    let lattice = Cloud {
        position: whole.cloud.position.clone(),
        volume: whole.cloud.volume.clone(),
        horizon: whole.cloud.horizon.clone(),
        ..Cloud::default()
    };
    let law = p.law.linearised();
    let families = whole.families.clone();
    let body = PdBody::new(lattice, families, law, &Factors::Plain, Ends::Differ)
        .map_err(|e| ModelError::family("the point", e))?;
    let is_points: Vec<bool> = roles.iter().map(|r| *r == CellRole::Points).collect();
    let faces = mesh.interface_facets(&is_points, &false, &true);
    let faces: Vec<BoundaryFacet> = faces.into_iter().map(|f| f.first).collect();
    let h = whole.cloud.spacing;
    let of_face = |face: &BoundaryFacet| (places(mesh, face, h), mesh.facet_normal_area(face));
    let places: Vec<_> = faces.iter().map(of_face).collect();
    let close = TooClose::new(&places, h);
    let in_zone = |i: &u32| whole.cloud.carrier[*i as usize].is_own();
    let in_zone = (0..body.cloud.position.len() as u32).filter(in_zone);
    let (left_out, own): (Vec<u32>, Vec<u32>) =
        in_zone.partition(|&i| close.holds(&whole.cloud.position[i as usize]));
    let left_out = left_out.iter().map(|&i| whole.cloud.position[i as usize]);
    let (sums, is_whole) = sums(&body);
    // what surfaces of the body do to families in elements is nothing to the points
    let is_inside = |j: usize| is_whole[j] || !whole.cloud.carrier[j].is_own();
    let wanted = |i: usize| {
        let mut family = body.families.of(i).iter();
        match is_whole[i] && family.all(|&j| is_inside(j as usize)) {
            true => Vector::zeros(),
            false => sums[i],
        }
    };
    let mut feet = Feet {
        points: own.len(),
        omega: Vec::new(),
        wanted: own.iter().map(|&i| wanted(i as usize)).collect(),
        is_whole: own.iter().map(|&i| is_whole[i as usize]).collect(),
        faces,
        left_out: left_out.collect(),
        ends: ends_of(&body, &own),
    };
    let mut cloud = own_points(&whole.cloud, &own);
    let first = own.len();
    let volume = cloud.spacing.powi(D as i32);
    for (face, (places, _)) in feet.faces.iter().zip(places) {
        for (x, shape) in places {
            let carrier = PointCarrier::Element(face.cell, shape);
            cloud.push(x, volume, Zone::Local, carrier);
        }
    }
    cloud.horizon = p.horizon.of_points(&cloud.position);
    let near = NearFeet::new(&cloud.position[first..], horizon, cloud.spacing);
    let (mut families, omega) = families_with_feet(&body, &own, &near);
    feet.omega = omega;
    let last = families.neighbours.len();
    families.offsets.resize(cloud.position.len() + 1, last);
    let lattice = CompletedLattice {
        cloud,
        families,
        passing: None,
        factors: whole.factors,
        wide: None,
        is_constant: true,
        interaction: None,
        shared: None,
        held: None,
    };
    Ok((lattice, feet))
}

/// The volumes of whole families, and what of them is cut.
fn ends_of<const D: usize>(body: &PdBody<D>, own: &[u32]) -> FamilyEnds {
    let volume = |j: &u32| body.cloud.volume[*j as usize];
    let behind = |i: &u32| {
        let cut = body.families.of(*i as usize).iter();
        cut.filter(|j| own.binary_search(j).is_err())
            .map(volume)
            .sum()
    };
    let whole = |i: &u32| body.volume_of_family(*i as usize, &body.cloud.volume);
    FamilyEnds {
        feet: own.len() as u32,
        whole: own.iter().map(whole).collect(),
        behind: own.iter().map(behind).collect(),
    }
}

/// The families of the points of the zone among themselves and with the feet, which come behind them, and for each point the weights ω of its bonds to feet.
fn families_with_feet<const D: usize>(
    body: &PdBody<D>,
    own: &[u32],
    near: &NearFeet<'_, D>,
) -> (Families, Vec<Vec<f64>>) {
    let mut number = vec![u32::MAX; body.cloud.position.len()];
    for (new, &old) in own.iter().enumerate() {
        number[old as usize] = new as u32;
    }
    let mut families = Families {
        offsets: vec![0],
        neighbours: Vec::new(),
    };
    let mut all = Vec::with_capacity(own.len());
    let volume = near.spacing.powi(D as i32);
    for &i in own {
        let at = |j: u32| number[j as usize];
        let family = body.families.of(i as usize).iter();
        let (kept, cut): (Vec<u32>, Vec<u32>) = family.partition(|&&j| at(j) != u32::MAX);
        families.neighbours.extend(kept.iter().map(|&j| at(j)));
        let mut omega = Vec::new();
        if !cut.is_empty() {
            for (foot, weight) in near.weights(&cut, body, i as usize) {
                families.neighbours.push((own.len() + foot) as u32);
                omega.push(weight / volume);
            }
        }
        families.offsets.push(families.neighbours.len());
        all.push(omega);
    }
    (families, all)
}

/// Places on a face, each with shape values, and the normal of the face.
type Places<const D: usize> = (Vec<(Vector<D>, Vec<f64>)>, Vector<D>);

/// Faces beside which a point is left out: little of its cell lies in the zone, and bonds to feet would be short and stiff.
struct TooClose<const D: usize> {
    places: Vec<(Vector<D>, Vector<D>)>,
    bins: Bins<D>,
    spacing: f64,
}

impl<const D: usize> TooClose<D> {
    fn new(faces: &[Places<D>], spacing: f64) -> Self {
        let of_face = |(places, normal): &Places<D>| {
            let normal = normal.normalize();
            places
                .iter()
                .map(move |(x, _)| (*x, normal))
                .collect::<Vec<_>>()
        };
        let places: Vec<_> = faces.iter().flat_map(of_face).collect();
        let positions: Vec<Vector<D>> = places.iter().map(|p| p.0).collect();
        Self {
            bins: Bins::new(&positions, spacing),
            places,
            spacing,
        }
    }

    fn holds(&self, x: &Vector<D>) -> bool {
        self.bins.around(x, self.spacing).any(|f| {
            let (foot, normal) = &self.places[f];
            let to = x - foot;
            let across = to.dot(normal).abs();
            across < CLOSEST * self.spacing
                && (to.norm_squared() - across * across).sqrt() < 0.75 * self.spacing
        })
    }
}

/// The points that are sites.
fn own_points<const D: usize>(whole: &PointCloud<D>, own: &[u32]) -> PointCloud<D> {
    let mut cloud = PointCloud::empty(whole.spacing, whole.volumes.region);
    cloud.volumes = whole.volumes;
    cloud.axes = whole.axes;
    for &i in own {
        let i = i as usize;
        cloud.push(
            whole.position[i],
            whole.volume[i],
            whole.zone[i],
            PointCarrier::Own,
        );
    }
    cloud
}

/// `Σ_p V_p b_pq` of every point q, and which points have a family that lacks nothing: its first moment vanishes.
fn sums<const D: usize>(body: &PdBody<D>) -> (Vec<Vector<D>>, Vec<bool>) {
    let points = body.cloud.position.len();
    let mut sums = vec![Vector::zeros(); points];
    let mut is_whole = vec![false; points];
    for i in 0..points {
        let Some(state) = body.state(i) else { continue };
        let Some((inverse, _)) = inverse(&state.shape) else {
            continue;
        };
        let (family, omega) = (body.families.of(i), body.kernel(i).1);
        let mut first = Vector::<D>::zeros();
        for (&j, omega) in family.iter().zip(omega) {
            let xi = body.bond(i, j as usize) * (omega * body.cloud.volume[j as usize]);
            first += xi;
            sums[j as usize] += inverse * xi * body.cloud.volume[i];
        }
        sums[i] -= inverse * first * body.cloud.volume[i];
        is_whole[i] = first.norm() < 1e-6 * state.shape.trace() / body.cloud.horizon.of(i);
    }
    (sums, is_whole)
}

/// Places on a face about half a spacing apart, each with the shape values of the nodes of the element behind it.
fn places<const D: usize>(
    mesh: &Mesh<D>,
    face: &BoundaryFacet,
    spacing: f64,
) -> Vec<(Vector<D>, Vec<f64>)> {
    let x = |k: usize| mesh.nodes[face.nodes[k] as usize];
    let parts =
        |a: usize, b: usize| ((x(b) - x(a)).norm() / spacing * 2.0).round().max(1.0) as usize;
    let shapes: Vec<Vec<f64>> = match face.nodes.len() {
        1 => vec![vec![1.0]],
        2 => {
            let n = parts(0, 1);
            let along = |k: usize| (k as f64 + 0.5) / n as f64;
            (0..n).map(|k| vec![1.0 - along(k), along(k)]).collect()
        }
        3 => {
            let n = parts(0, 1).max(parts(1, 2)).max(parts(2, 0));
            triangle(n)
        }
        _ => {
            let n = [parts(0, 1).max(parts(3, 2)), parts(1, 2).max(parts(0, 3))];
            let at = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
            let pairs = (0..n[0]).flat_map(|i| (0..n[1]).map(move |j| (i, j)));
            pairs
                .map(|(i, j)| {
                    let (s, t) = (at(i, n[0]), at(j, n[1]));
                    vec![(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]
                })
                .collect()
        }
    };
    let nodes = mesh.cell(face.cell as usize);
    let of_cell = |shape: &Vec<f64>| {
        let value = |n: &u32| {
            face.nodes
                .iter()
                .position(|m| m == n)
                .map_or(0.0, |k| shape[k])
        };
        nodes.iter().map(value).collect()
    };
    let position = |shape: &Vec<f64>| (shape.iter().enumerate()).map(|(k, n)| x(k) * *n).sum();
    shapes.iter().map(|s| (position(s), of_cell(s))).collect()
}

/// Centroids of the `n²` triangles of a triangle, as shape values.
fn triangle(n: usize) -> Vec<Vec<f64>> {
    let mut all = Vec::new();
    let at = |i: f64, j: f64| {
        let (s, t) = (i / n as f64, j / n as f64);
        vec![1.0 - s - t, s, t]
    };
    for i in 0..n {
        for j in 0..n - i {
            all.push(at(i as f64 + 1.0 / 3.0, j as f64 + 1.0 / 3.0));
            if i + j + 1 < n {
                all.push(at(i as f64 + 2.0 / 3.0, j as f64 + 2.0 / 3.0));
            }
        }
    }
    all
}

/// Feet by the bins that hold them.
struct NearFeet<'a, const D: usize> {
    feet: &'a [Vector<D>],
    bins: Bins<D>,
    reach: f64,
    spacing: f64,
}

impl<'a, const D: usize> NearFeet<'a, D> {
    fn new(feet: &'a [Vector<D>], horizon: f64, spacing: f64) -> Self {
        Self {
            feet,
            bins: Bins::new(feet, horizon),
            reach: FARTHEST * horizon,
            spacing,
        }
    }

    /// The feet of a point, ascending, with the weights ω V of their bonds: each bond of the whole family that is `cut`, at about a fraction s of its length, gives `2 ω V / s` to the feet beside it.
    ///
    /// The force of a pair of bonds is `2 ω V ξ`, and that of one that ends at s ξ is to be the same.
    fn weights(&self, cut: &[u32], body: &PdBody<D>, i: usize) -> Vec<(usize, f64)> {
        let here = &body.cloud.position[i];
        let mut found: Vec<usize> = self.bins.around(here, self.reach).collect();
        found.retain(|&f| (self.feet[f] - here).norm() <= self.reach);
        found.sort_unstable();
        let mut weights = vec![0.0; found.len()];
        let (family, omega) = (body.families.of(i), body.kernel(i).1);
        let mut shares = vec![0.0; found.len()];
        for &j in cut {
            let Ok(k) = family.binary_search(&j) else {
                continue;
            };
            let xi = body.bond(i, j as usize);
            let length = xi.norm();
            let beside = |f: usize| {
                let to = self.feet[f] - here;
                let along = (to.dot(&xi) / length).clamp(0.0, length);
                (to - xi * (along / length)).norm() / (SPREAD * self.spacing)
            };
            let nearest = found
                .iter()
                .map(|&f| beside(f))
                .fold(f64::INFINITY, f64::min);
            for (share, &f) in shares.iter_mut().zip(&found) {
                let d = beside(f);
                *share = (nearest * nearest - d * d).exp();
                if *share < 1e-3 {
                    *share = 0.0;
                }
            }
            let sum: f64 = shares.iter().sum();
            let weight = 2.0 * omega[k] * body.cloud.volume[j as usize] / sum;
            for ((w, share), &f) in weights.iter_mut().zip(&shares).zip(&found) {
                let part = (self.feet[f] - here).norm() / length;
                *w += weight * share / part.clamp(SHORTEST, 1.0);
            }
        }
        let all = found.into_iter().zip(weights);
        all.filter(|(_, w)| *w > 0.0).collect()
    }
}
