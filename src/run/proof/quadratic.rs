//! The force of quadratic fields beside the seam, against the constant force density that balances them.
//!
//! A seam that carries affine fields may still err under quadratic ones: displacements that are interpolated between nodes, families of Gauss points that are not symmetric.
//! A density that is wrong by the fraction `ε` of `C : ∇∇u` in a layer of the thickness `δ` moves the stress by `ε δ C ∇∇u`, a stress that is wrong by `ℓ C ∇∇u` does so at once; over a zone of the size L,
//! in which the strain changes by `L ∇∇u`, the error of the strain is `ε δ/L` or `ℓ/L` of that change. It is of first order in δ, where classical elasticity beside a right seam is met with second order.

use super::Subject;
use crate::model::{CellRole, PointSource, SiteKind};
use crate::observe::proof::{Figure, Finding, Part, Severity};
use crate::observe::warning::{Code, Warning};
use crate::peridynamics::PdBody;
use crate::run::error::RunError;
use crate::tensor::{Tensor, Tensor4, Vector};
use crate::{assembly::Row, parallel};

/// Error of the strain over its change across the zone, as this check predicts it, from which on it is warned of: elements of two spacings beside a right seam err as much.
const WARNED: f64 = 0.01;

/// The same from which on a run is refused.
const REFUSED: f64 = 0.5;

/// Most rows and cells that are looked at where rows are not there yet.
const MOST: usize = 300;

/// Families are whole if the sum of their bonds is below this fraction of the sum of lengths.
const WHOLE: f64 = 1e-6;

/// Errors of the force density beside the seam, over `C_1111` times the second gradient.
struct Density {
    largest: f64,
    mean: f64,
    /// The error and the point where it is largest.
    worst: (f64, usize),
}

impl Density {
    /// Of second moments of the forces, by volume, of the sites of a seam.
    fn of<const D: usize>(
        moments: &[(f64, Vec<Tensor<D>>)],
        seam: &[(usize, usize)],
        stiffness: f64,
    ) -> Self {
        let first = seam[0].0;
        let volume: f64 = moments.iter().map(|m| m.0).sum();
        let mut largest = 0.0f64;
        let mut mean = vec![Tensor::<D>::zeros(); pairs::<D>().count()];
        let mut worst = (0.0, first);
        for ((v, sums), &(point, _)) in moments.iter().zip(seam).filter(|(m, _)| m.0 > 0.0) {
            for (m, s) in mean.iter_mut().zip(sums) {
                *m += s / (volume * stiffness);
                let here = s.amax() / (v * stiffness);
                largest = largest.max(here);
                if here > worst.0 {
                    worst = (here, point);
                }
            }
        }
        let density = mean.iter().map(|m| m.amax()).fold(0.0, f64::max);
        Self {
            largest,
            mean: density,
            worst,
        }
    }
}

/// Returns the finding for an error that is too large.
fn finding(predicted: f64, place: Vec<f64>) -> Finding {
    let (severity, limit) = match predicted > REFUSED {
        true => (Severity::Refusal, REFUSED),
        false => (Severity::Warning, WARNED),
    };
    Finding {
        severity,
        value: predicted,
        limit,
        warning: Warning::new(Code::SeamGradient, format!(
            "the seam errs under quadratic fields, most at ({}): where the strain varies across the nonlocal zone, about {:.0} % of that change is wrong, and halves with the horizon only; use elements as small as the spacing of the points there, put a point of the lattice on a corner of the mesh, or use coupling.truncated",
            place
                .iter()
                .map(|x| format!("{x:.4}"))
                .collect::<Vec<_>>()
                .join(", "),
            100.0 * predicted
        ))
        .at(place)
        .remedy(["coupling=truncated"]),
    }
}

/// Applies the rows beside the seam to every quadratic field.
///
/// # Errors
/// None.
pub(super) fn part<const D: usize>(subject: &Subject<'_, D>) -> Result<Option<Part>, RunError> {
    let model = subject.model;
    let Some(body) = model.body() else {
        return Ok(None);
    };
    let places = body.cloud.transfer.len();
    let is_site = |p: usize| body.cloud.transfer.row(p).map(|(_, w)| w).eq([1.0]);
    // bonds that end on faces see no place beyond, and pure peridynamics has none
    if model.faces_cut_bonds() || (0..places).all(is_site) {
        return Ok(None);
    }
    let whole: Vec<bool> = parallel::map(places, 1, |i| {
        is_whole(body, i) && is_of_material(body, i, model.peridynamic_material())
    });
    let seam = seam_sites(subject, body, &whole);
    let Some(&(first, _)) = seam.first() else {
        return Ok(None);
    };
    let tensor = body.collapsed_tensor(first);
    let stiffness = tensor.get(0, 0, 0, 0);
    let moments: Vec<(f64, Vec<Tensor<D>>)> = parallel::map_with(
        seam.len(),
        1,
        || Row::<D>::new(model.sites.len()),
        |row, k| {
            let (point, site) = seam[k];
            // assembled rows are scaled to the part of the body that a site stands for
            let scale = match subject.stiffness {
                Some(_) => model.row_scale().map_or(1.0, |scale| scale[site]),
                None => 1.0,
            };
            let volume = body.cloud.volume[point] * scale;
            let mut sums = second_moments(subject, site, row);
            for (sum, (b, d)) in sums.iter_mut().zip(pairs::<D>()) {
                *sum += density(&tensor, b, d) * volume;
            }
            (volume, sums)
        },
    );
    let Density {
        largest,
        mean,
        worst,
    } = Density::of(&moments, &seam, stiffness);
    let horizon = body.cloud.horizon.of(first);
    let length = zone_size(subject);
    let by_points = mean * horizon / length;
    let by_elements = stress_error(subject, &tensor) / length;
    let predicted = by_points.max(by_elements);
    let mut findings = Vec::new();
    if predicted > WARNED {
        let place = body.cloud.position[worst.1].iter().copied().collect();
        findings.push(finding(predicted, place));
    }
    findings.extend(small_stress_elements(subject));
    let figure = |name: &str, value| Figure {
        name: name.to_owned(),
        value,
    };
    Ok(Some(Part {
        name: "quadratic",
        line: match predicted > WARNED {
            false => format!(
                "{} rows beside the seam carry quadratic fields: strain wrong by {:.1e} of its change across the zone",
                seam.len(),
                predicted
            ),
            true => format!("strain wrong by {predicted:.1e} of its change across the zone"),
        },
        figures: vec![
            figure("largest error of the force density", largest),
            figure("mean error of the force density", mean),
            figure("predicted by points", by_points),
            figure("predicted by stress in elements", by_elements),
        ],
        findings,
    }))
}

/// The pairs `b ≤ d` of quadratic monomials.
fn pairs<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|b| (b..D).map(move |d| (b, d)))
}

/// The Taylor monomial `x_b x_d`, halved on the diagonal.
fn monomial<const D: usize>(x: &Vector<D>, b: usize, d: usize) -> f64 {
    let share = if b == d { 0.5 } else { 1.0 };
    share * x[b] * x[d]
}

/// `f_a = Σ C_ajcl ∂_j ∂_l u_c` for `u_c` the monomial of `b` and `d`: entry (a, c).
fn density<const D: usize>(tensor: &Tensor4<D>, b: usize, d: usize) -> Tensor<D> {
    Tensor::from_fn(|a, c| {
        let once = tensor.get(a, b, c, d);
        if b == d {
            once
        } else {
            once + tensor.get(a, d, c, b)
        }
    })
}

/// Returns true if no bond is missing from a family, as far as symmetry shows.
fn is_whole<const D: usize>(body: &PdBody<D>, i: usize) -> bool {
    let (mut sum, mut size) = (Vector::<D>::zeros(), 0.0);
    for &j in body.families.of(i) {
        let xi = body.bond(i, j as usize);
        sum += xi * body.cloud.volume[j as usize];
        size += xi.norm() * body.cloud.volume[j as usize];
    }
    size > 0.0 && sum.norm() <= WHOLE * size
}

/// Returns true if a point and its family have the material `own`, where points may have several.
fn is_of_material<const D: usize>(body: &PdBody<D>, i: usize, own: u16) -> bool {
    let material = &body.cloud.material;
    let mut family = body.families.of(i).iter();
    material.is_empty() || material[i] == own && family.all(|&j| material[j as usize] == own)
}

/// Points (with their sites) that see places in elements and whose families lack nothing, nor do those of their neighbours where these enter; some of them where rows are not there yet.
fn seam_sites<const D: usize>(
    subject: &Subject<'_, D>,
    body: &PdBody<D>,
    whole: &[bool],
) -> Vec<(usize, usize)> {
    let is_seen = |j: &u32| {
        let mut row = body.cloud.transfer.row(*j as usize);
        let first = row.next().map(|(s, _)| s as usize);
        first.is_some_and(|s| matches!(subject.model.sites[s].kind, SiteKind::Node(_)))
            || row.next().is_some()
    };
    let mut seam: Vec<(usize, usize)> = (0..subject.model.sites.len())
        .filter_map(|s| match subject.model.sites[s].kind {
            SiteKind::Point(p) => Some((p as usize, s)),
            SiteKind::Node(_) => None,
        })
        .filter(|&(p, _)| {
            let family = body.families.of(p);
            // a neighbour without a family of its own enters by its place only
            let counts = |j: u32| !body.families.of(j as usize).is_empty();
            whole[p]
                && family.iter().any(is_seen)
                && family.iter().all(|&j| whole[j as usize] || !counts(j))
        })
        .collect();
    if subject.system.is_some() && seam.len() > MOST {
        let step = seam.len().div_ceil(MOST);
        seam = seam.into_iter().step_by(step).collect();
    }
    seam
}

/// Applies the row of a site to each quadratic field about it: entry (a, c) is the force along a of `u_c`.
fn second_moments<const D: usize>(
    subject: &Subject<'_, D>,
    site: usize,
    row: &mut Row<D>,
) -> Vec<Tensor<D>> {
    let sites = &subject.model.sites;
    let centre = sites[site].position;
    let mut sums = vec![Tensor::<D>::zeros(); pairs::<D>().count()];
    let mut add = |column: u32, block: Tensor<D>| {
        let x = sites[column as usize].position - centre;
        for (sum, (b, d)) in sums.iter_mut().zip(pairs::<D>()) {
            *sum += block * monomial(&x, b, d);
        }
    };
    match subject.stiffness {
        Some(matrix) => {
            let (columns, values) = matrix.row(site);
            for (&column, block) in columns.iter().zip(values.chunks(D * D)) {
                add(column, Tensor::from_row_slice(block));
            }
        }
        None => {
            subject.operator.add_row(site, row);
            row.take_blocks(|column, block| add(column, *block));
        }
    }
    sums
}

/// The smallest extent of the points that are sites \[m\].
fn zone_size<const D: usize>(subject: &Subject<'_, D>) -> f64 {
    let mut low = Vector::<D>::repeat(f64::MAX);
    let mut high = -low;
    for site in &subject.model.sites {
        if matches!(site.kind, SiteKind::Point(_)) {
            low = low.inf(&site.position);
            high = high.sup(&site.position);
        }
    }
    ((high - low).min()).max(subject.model.spacing())
}

/// Size of elements that carry the partial stress over the spacing of points from which on their strains stay smooth wherever the lattice lies.
///
/// Tip of a cantilever over the exact one (1/32 = h, m = 3), lattice off the nodes by 0, 0.1, 0.25, 0.3, 0.4 and 0.5 h: 1.000, 1.000, −0.06, 0.39, 1.28, 1.000 with elements of h; 1.000 with those of 2 h and 0.999 with those of 3 h.
/// The short-wave stiffness of such elements is near zero, and the unlike families of the Gauss points take it below; no affine or quadratic field shows the places where it does so.
const SMOOTH: f64 = 1.5;

/// Refuses or warns of elements that carry the partial stress of points between their nodes and are as small as the spacing.
fn small_stress_elements<const D: usize>(subject: &Subject<'_, D>) -> Option<Finding> {
    let model = subject.model;
    if !model.has_places_between_nodes() {
        return None;
    }
    let size = |c: usize| crate::fem::cell_volume(&model.mesh, c).powf(1.0 / D as f64);
    let (cell, size) = (0..model.mesh.cell_count())
        .filter(|&c| model.roles[c] == CellRole::StressElement)
        .map(|c| (c, size(c)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let value = size / model.spacing();
    let place: Vec<f64> = model.mesh.centroid(cell).iter().copied().collect();
    // a point in the middle of every element: strains stay smooth there too, as on the nodes
    let centroid = model.mesh.centroid(cell);
    let points = model.peridynamics.as_ref().map(|p| &p.points);
    let is_halfway = match points {
        Some(PointSource::Lattice { spacing, origin }) => (0..D).all(|k| {
            let place = (centroid[k] - origin[k]) / spacing;
            (place - place.round()).abs() < 1e-6
        }),
        Some(PointSource::Cells) => true,
        _ => false,
    };
    (value < SMOOTH).then(|| Finding {
        severity: if is_halfway {
            Severity::Warning
        } else {
            Severity::Refusal
        },
        value,
        limit: SMOOTH,
        warning: Warning::new(Code::SeamGradient, format!(
            "elements that carry the partial stress are {value:.2} spacings of the points wide (at {}), and the lattice lies between their nodes: their strains may alternate, and displacements be wrong by any amount; use elements of two spacings there, put the lattice on their nodes, or use coupling.splice",
            place.iter().map(|x| format!("{x:.4}")).collect::<Vec<_>>().join(", ")
        ))
        .at(place)
        .remedy(["coupling=splice"]),
    })
}

/// The mean error of the stress in elements that carry the partial stress, over `C ∇∇u` \[m\]; 0 where there are none.
fn stress_error<const D: usize>(subject: &Subject<'_, D>, tensor: &Tensor4<D>) -> f64 {
    let model = subject.model;
    let carries = |c: &usize| model.roles[*c] == CellRole::StressElement;
    let cells: Vec<usize> = (0..model.mesh.cell_count()).filter(carries).collect();
    if cells.is_empty() {
        return 0.0;
    }
    let cells: Vec<usize> = cells
        .iter()
        .copied()
        .step_by(cells.len().div_ceil(MOST))
        .collect();
    let centre = model.mesh.centroid(cells[0]);
    let fields: Vec<Vec<f64>> = pairs::<D>()
        .map(|(b, d)| {
            let at = |site: &crate::model::Site<D>| monomial(&(site.position - centre), b, d);
            model.sites.iter().map(at).collect()
        })
        .collect();
    // of the exact stress the places of the cells are needed only: the gradient of a quadratic field is linear
    let (mut points, mut place) = (Vec::new(), Vector::<D>::zeros());
    for &cell in &cells {
        crate::fem::quadrature(&model.mesh, cell, &mut points);
        let volume: f64 = points.iter().map(|p| p.weight).sum();
        for p in &points {
            place += (p.position - centre) * (p.weight / volume);
        }
    }
    let mut largest = 0.0f64;
    let sums = subject.operator.sums_of_cell_stress(&cells, &fields);
    for ((b, d), stresses) in pairs::<D>().zip(sums) {
        for (c, stress) in stresses.iter().enumerate() {
            let mut gradient = Tensor::<D>::zeros();
            gradient[(c, b)] = place[d];
            gradient[(c, d)] = place[b];
            let error = stress - tensor.contract(&gradient);
            largest = largest.max(error.amax() / (cells.len() as f64 * tensor.get(0, 0, 0, 0)));
        }
    }
    largest
}
