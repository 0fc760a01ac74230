//! Affine fields through the model of a scene: the balance of each row under a constant stress, and the error of the stress where a row is out of balance.

use super::classes::{Layout, RowClass, Skin, Unbalanced, limits, told};
use super::fields::{boundary_integrals, gradients, nodal_forces, of_stress, volume_of_row};
use super::loads::centre;
use super::patch::{Around, PatchField, StressError, stress_errors};
use super::surface::{self, Boundary, FacetKind, add_tractions};
use crate::observe::proof::Part;
use crate::peridynamics::bond_force::Storage;
use crate::progress::Progress;
use crate::run::error::RunError;
use crate::run::loads::holders;
use crate::scene::conditions::{Condition, Support};
use crate::system::{BlockCsr, Spread};
use crate::tensor::{Tensor, Tensor4, Vector};
use crate::{assembly::Row, parallel};
use crate::{
    coupling::Operator,
    model::{HorizonChange, Model, Site, SiteKind, Zone},
};

/// Most rows whose kind is found out one by one; of more, a sample of the worst.
const CLASSIFIED: usize = 20_000;

/// Relative difference up to which the forces of two rows count as alike.
const ALIKE: f64 = 1.0e-6;

/// Subject of the proof, with data that several of its steps need.
struct Subject<'a, const D: usize> {
    model: &'a Model<D>,
    operator: &'a Operator<'a, D>,
    stiffness: Option<&'a BlockCsr>,
    conditions: &'a [Condition<D>],
    /// The condition that holds each dof.
    holder: Vec<Option<usize>>,
    /// Sites with broken bonds, ascending.
    damaged: Vec<u32>,
    /// True if all sites are points: no row is one of a seam, whatever its columns.
    has_points_alone: bool,
    /// The sites over processes, where families are spread over these.
    spread: Option<Spread<'a>>,
}

/// The tensor that fields are scaled by: that of the points, or of the first cell.
fn reference<const D: usize>(model: &Model<D>) -> Tensor4<D> {
    let own = model.peridynamic_material();
    let cell = (0..model.mesh.cell_count()).find(|&c| model.material_of_cell(c) == own);
    *model.tensor_of_cell(cell.unwrap_or(0))
}

fn affine<const D: usize>(model: &Model<D>, g: &Tensor<D>, centre: &Vector<D>) -> Vec<f64> {
    let mut u = vec![0.0; model.sites.len() * D];
    parallel::for_each_chunk(&mut u, D, 1, |s, u| {
        u.copy_from_slice((g * (model.sites[s].position - centre)).as_slice());
    });
    u
}

/// Applies the rows to every affine field.
///
/// None of a model without points: its rows are those of finite elements.
///
/// # Errors
/// [`RunError::Idle`] for a condition that meets no site.
pub(super) fn part<const D: usize>(
    proved: &super::Subject<'_, D>,
    progress: &dyn Progress,
) -> Result<Option<Part>, RunError> {
    let model = proved.model;
    if model.body().is_none() {
        return Ok(None);
    }
    progress.stage("proof", None);
    let subject = Subject {
        model,
        operator: proved.operator,
        stiffness: proved.stiffness,
        conditions: &proved.rest.conditions,
        holder: holders(model, &proved.rest.conditions)?,
        damaged: (proved.system)
            .and_then(|system| system.body_state())
            .map_or(Vec::new(), |state| state.damaged_sites()),
        has_points_alone: model.sites.iter().all(is_point),
        spread: model.spread(proved.ranks),
    };
    // weights in four bytes are off by as much
    let exact = match (proved.system, proved.rest.breaking.precision) {
        (Some(_), Storage::Single) => limits::EXACT.max(100.0 * f64::from(f32::EPSILON)),
        _ => limits::EXACT,
    };
    Ok(Some(prove(&subject, exact, proved.product)))
}

/// Compares the rows with the nodal forces of the fields; `apply` overwrites its last argument with the internal force under a field.
fn prove<const D: usize>(
    subject: &Subject<'_, D>,
    exact: f64,
    apply: impl Fn(&[f64], &mut [f64]),
) -> Part {
    let model = subject.model;
    let (tensor, centre) = (reference(model), centre(model));
    let list = gradients(&tensor);
    let integrals = boundary_integrals(model);
    let mut site_of_node = vec![u32::MAX; model.mesh.nodes.len()];
    for (site, s) in model.sites.iter().enumerate() {
        if let SiteKind::Node(n) = s.kind {
            site_of_node[n as usize] = site as u32;
        }
    }
    let sites = model.sites.len();
    let mut force = vec![0.0; sites * D];
    let mut wanted = vec![0.0; sites * D];
    let mut worst = vec![0.0; sites];
    // stiffer materials make larger forces of the same field
    let largest = (0..model.mesh.cell_count()).map(|c| model.tensor_of_cell(c).amax());
    let scale = largest.fold(tensor.amax(), f64::max);
    for g in &list {
        let u = affine(model, g, &centre);
        apply(&u, &mut force);
        nodal_forces(model, &integrals, &site_of_node, g, &mut wanted);
        parallel::for_each_mut(&mut worst, 1, |s, worst| {
            let v = volume_of_row(model, s);
            let h = v.powf(1.0 / D as f64);
            let difference = (s * D..(s + 1) * D).map(|k| (force[k] - wanted[k]).abs());
            let density = difference.fold(0.0, f64::max) / (v / h * scale);
            // not a number is never in balance
            if density.is_nan() || density > *worst {
                *worst = density;
            }
        });
    }
    let is_off = |r: f64| r.is_nan() || r > exact;
    let rest = worst.iter().copied().filter(|&r| !is_off(r));
    let residual = rest.fold(0.0, f64::max);
    let mut off: Vec<u32> = (0..sites as u32)
        .filter(|&s| is_off(worst[s as usize]))
        .collect();
    let total = off.len();
    if total > CLASSIFIED {
        off.sort_by(|a, b| worst[*b as usize].total_cmp(&worst[*a as usize]));
        off.truncate(CLASSIFIED);
        off.sort_unstable();
    }
    let nodal = |g: &Tensor<D>, force: &mut [f64]| {
        nodal_forces(model, &integrals, &site_of_node, g, force);
    };
    let unbalanced = if off.is_empty() {
        Vec::new()
    } else {
        unbalanced(subject, &off, &worst, &tensor, &nodal)
    };
    told(
        list.len(),
        residual,
        total,
        &unbalanced,
        Layout {
            is_lattice: model.is_lattice(),
            is_truncated: model.faces_cut_bonds(),
            takes_splice: takes_splice(model),
            skin: match unbalanced.is_empty() {
                true => Skin::Possible,
                false => surface::skin(model),
            },
        },
    )
}

/// Returns true if a splice of the horizons of the points is offered.
fn takes_splice<const D: usize>(model: &Model<D>) -> bool {
    let horizons = model.body().map(|body| body.cloud.horizon.values().len());
    let is_few = horizons.is_some_and(|count| count <= HorizonChange::MOST_HORIZONS);
    is_few
        && model
            .peridynamics
            .as_ref()
            .is_some_and(|p| p.accelerator().is_some())
}

fn is_point<const D: usize>(site: &Site<D>) -> bool {
    matches!(site.kind, SiteKind::Point(_))
}

/// Returns the distance from the boundary within which rows may lack bonds \[m\].
fn reach<const D: usize>(model: &Model<D>) -> f64 {
    let largest = model.body().map_or(0.0, |b| b.cloud.horizon.largest());
    let alone = model
        .peridynamics
        .as_ref()
        .is_some_and(|p| p.law.linearised().is_pairwise())
        && !model.zones.contains(&Zone::Transition);
    // points on the boundary itself have half a cell, so that a family lacks as much that only touches it
    (if alone { 1.0 } else { 2.0 }) * largest * (1.0 + 1e-6)
}

/// Returns the reach beyond a family of those bonds whose ends on faces are carried in part by a node \[m\].
fn cut_bonds_reach<const D: usize>(model: &Model<D>, site: u32) -> f64 {
    if !model.faces_cut_bonds() || model.point_of(site as usize).is_some() {
        return 0.0;
    }
    let extent = |(c, _): (usize, usize)| {
        let (low, high) = model.mesh.bounds_of(model.mesh.cell(c));
        (high - low).norm()
    };
    model
        .cells_of_site(site as usize)
        .map(extent)
        .fold(0.0, f64::max)
}

/// The class of a row, the facet that it lies at, and true if no other surface is near.
type Class = (RowClass, Option<usize>, bool);

/// A class as numbers, for other processes.
fn numbers_of_class((class, facet, is_alone): &Class) -> [f64; 3] {
    let facet = facet.map_or(-1.0, |f| f as f64);
    [class.number(), facet, f64::from(u8::from(*is_alone))]
}

/// Back from [`numbers_of_class`].
fn class_of_numbers(numbers: &[f64]) -> Class {
    let facet = (numbers[1] >= 0.0).then_some(numbers[1] as usize);
    (RowClass::numbered(numbers[0]), facet, numbers[2] == 1.0)
}

/// The rows that are out of balance by their classes, and the data by which the stress at them is predicted.
struct Classified<'a, const D: usize> {
    subject: &'a Subject<'a, D>,
    around: &'a Around<'a, D>,
    tensor: &'a Tensor4<D>,
    nodal: &'a dyn Fn(&Tensor<D>, &mut [f64]),
    /// Rows out of balance, with the class of each.
    rows: Vec<(u32, Class)>,
    /// Imbalance of each row.
    worst: &'a [f64],
}

impl<const D: usize> Classified<'_, D> {
    /// Returns the imbalance of a row; not a number counts as the largest.
    fn size(&self, s: u32) -> f64 {
        match self.worst[s as usize] {
            r if r.is_nan() => f64::INFINITY,
            r => r,
        }
    }

    /// The worst row of a class, and unless that `is_told` by another class, the error of the stress there.
    fn of_class(&self, class: RowClass, is_told: bool) -> Option<Unbalanced> {
        let own = self.rows.iter().filter(move |(_, c)| c.0 == class);
        // of rows that are alike but for rounding, the first
        let first_of = |counts: &dyn Fn(bool) -> bool| {
            let mut counted = own.clone().filter(|(_, c)| counts(c.2));
            let most = counted
                .clone()
                .map(|(s, _)| self.size(*s))
                .fold(0.0, f64::max);
            counted.find(|(s, _)| self.size(*s) >= most * (1.0 - ALIKE))
        };
        let &(largest, _) = first_of(&|_| true)?;
        // where one surface alone lies near, if anywhere: at a corner no uniform stress leaves both sides free
        let &(place, (_, facet, _)) =
            first_of(&|is_alone| is_alone).or_else(|| first_of(&|_| true))?;
        let mut found = Unbalanced {
            class,
            rows: own.count(),
            residual: self.size(largest),
            at: self.subject.model.sites[largest as usize]
                .position
                .iter()
                .copied()
                .collect(),
            stress_error: None,
            is_unpredictable: false,
            stress_at: Vec::new(),
        };
        if is_told || found.residual < limits::NEGLIGIBLE {
            return Some(found);
        }
        match predicted(
            self.subject,
            self.around,
            self.tensor,
            (class, place, facet),
            self.nodal,
        ) {
            Predicted::NotAsked => {}
            Predicted::Unknown => found.is_unpredictable = true,
            Predicted::Error(e) => {
                found.stress_error = Some(e.relative);
                found.stress_at = e.at.iter().copied().collect();
            }
        }
        Some(found)
    }
}

/// The classes of rows out of balance; collective where families are spread.
fn classes<const D: usize>(
    subject: &Subject<'_, D>,
    boundary: &Boundary<'_, D>,
    reach: f64,
    off: &[u32],
) -> Vec<Class> {
    let model = subject.model;
    let classes_of = |sites: &[u32]| -> Vec<Class> {
        let new = || Row::<D>::new(model.sites.len());
        parallel::map_with(sites.len(), 1, new, |row, k| {
            class(subject, boundary, reach, sites[k], row)
        })
    };
    match &subject.spread {
        // a row takes families that its own process holds
        Some(spread) => {
            let told = spread.of_sites(off, 3, |own| {
                classes_of(own).iter().flat_map(numbers_of_class).collect()
            });
            told.chunks_exact(3).map(class_of_numbers).collect()
        }
        None => classes_of(off),
    }
}

/// Sorts the rows that are out of balance, and predicts the error of the stress at the worst of each class.
fn unbalanced<const D: usize>(
    subject: &Subject<'_, D>,
    off: &[u32],
    worst: &[f64],
    tensor: &Tensor4<D>,
    nodal: &dyn Fn(&Tensor<D>, &mut [f64]),
) -> Vec<Unbalanced> {
    let model = subject.model;
    let position = |s: u32| &model.sites[s as usize].position;
    let reach = reach(model);
    let (mut low, mut high) = (*position(off[0]), *position(off[0]));
    for &s in off {
        low = low.inf(position(s));
        high = high.sup(position(s));
    }
    let widest = off
        .iter()
        .map(|&s| cut_bonds_reach(model, s))
        .fold(0.0, f64::max);
    let widest = reach + widest + model.spacing();
    let boundary = Boundary::new(model, subject.conditions, widest, (low, high));
    let classified = classes(subject, &boundary, reach, off);
    let held: Vec<bool> = subject.holder.iter().map(Option::is_some).collect();
    let around = Around {
        model,
        operator: subject.operator,
        stiffness: subject.stiffness,
        boundary: &boundary,
        held: &held,
        reach,
        centre: centre(model),
        spread: subject.spread,
    };
    let classified = Classified {
        subject,
        around: &around,
        tensor,
        nodal,
        rows: off.iter().copied().zip(classified).collect(),
        worst,
    };
    let of_class = |class, is_told| classified.of_class(class, is_told);
    let mut classes: Vec<RowClass> = classified.rows.iter().map(|(_, c)| c.0).collect();
    classes.sort_unstable();
    classes.dedup();
    // each prediction costs a factorisation: free sides stand for loaded ones, and a surface for where the seam meets it
    let has = |class: RowClass| classes.contains(&class);
    let is_told = |class: RowClass| match class {
        RowClass::LoadedSurface => has(RowClass::FreeSurface) || has(RowClass::Transition),
        RowClass::FreeSurface => has(RowClass::Transition),
        _ => false,
    };
    let mut found: Vec<Unbalanced> = Vec::new();
    let (seam, others): (Vec<RowClass>, Vec<RowClass>) =
        classes.iter().partition(|c| **c == RowClass::SeamAtSurface);
    found.extend(others.iter().filter_map(|&c| of_class(c, is_told(c))));
    // unless the surface shows nothing
    let is_told = found.iter().any(|other| {
        let is_surface = matches!(
            other.class,
            RowClass::FreeSurface
                | RowClass::Support
                | RowClass::LoadedSurface
                | RowClass::Transition
        );
        let is_warned = other
            .stress_error
            .is_some_and(|e| e.abs() >= limits::WARN_SURFACE);
        is_surface && is_warned
    });
    found.extend(seam.iter().filter_map(|&c| of_class(c, is_told)));
    found
}

/// The class of a row, the nearest facet where families lack points, and whether no other surface is near.
fn class<const D: usize>(
    subject: &Subject<'_, D>,
    boundary: &Boundary<'_, D>,
    reach: f64,
    site: u32,
    row: &mut Row<D>,
) -> Class {
    let model = subject.model;
    let x = &model.sites[site as usize].position;
    let reach = reach + cut_bonds_reach(model, site);
    let varies = (model.body()).is_some_and(|body| body.cloud.horizon.uniform().is_none());
    let taken;
    let columns: &[u32] = match subject.stiffness {
        Some(stiffness) => stiffness.row(site as usize).0,
        // a row of a state-based law costs as much as a thousand bonds
        None if subject.has_points_alone && subject.damaged.is_empty() && !varies => &[],
        None => {
            subject.operator.add_row(site as usize, row);
            taken = row.take_columns();
            &taken
        }
    };
    let points = columns
        .iter()
        .filter(|&&c| is_point(&model.sites[c as usize]))
        .count();
    let is_seam = points > 0 && points < columns.len();
    // where a surface cuts the lattice, points of the last layer stand for more or less than their cells
    let near: Vec<(usize, f64)> = boundary.near(x, reach + model.spacing()).collect();
    // of equal distances, the first
    let nearest = near.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let is_alone = nearest.is_some_and(|(m, _)| {
        let n = &boundary.normals[*m];
        let mut others = near.iter();
        others.all(|(f, _)| boundary.normals[*f].dot(n) > surface::PLANE)
    });
    let facet = nearest.map(|(f, _)| *f);
    // rows that broken bonds are missing from, or in whose families they are missing
    let is_broken = columns
        .iter()
        .any(|c| subject.damaged.binary_search(c).is_ok());
    let is_cracked = is_broken || boundary.is_near_crack(x, reach);
    let class = match (is_seam, facet, is_cracked) {
        _ if boundary.is_near_border(x, reach) => RowClass::Border,
        (true, None, false) => RowClass::Seam,
        (true, ..) => RowClass::SeamAtSurface,
        (false, _, true) => RowClass::Crack,
        (false, None, _) if varies && joins_horizons(model, site, columns) => {
            RowClass::HorizonChange
        }
        (false, None, _) => RowClass::Points,
        (false, Some(_), _)
            if model.zones.contains(&Zone::Transition)
                && !subject.operator.is_body_row(site as usize) =>
        {
            RowClass::Transition
        }
        (false, Some(f), _) => match boundary.kinds[f] {
            FacetKind::Free => RowClass::FreeSurface,
            FacetKind::Held => RowClass::Support,
            FacetKind::Loaded => RowClass::LoadedSurface,
        },
    };
    (class, facet, is_alone)
}

/// Returns true if the row of a site has points of other horizons than its own.
fn joins_horizons<const D: usize>(model: &Model<D>, site: u32, columns: &[u32]) -> bool {
    let of = |site: u32| {
        let (body, point) = model.point_of(site as usize)?;
        Some(body.cloud.horizon.of(point))
    };
    let own = of(site);
    let mut others = columns.iter().filter_map(|&column| of(column));
    others.any(|other| Some(other) != own)
}

/// Prediction of the error of the stress around a row.
enum Predicted<const D: usize> {
    /// There is no field to predict it with.
    NotAsked,
    /// The patch gives no prediction.
    Unknown,
    Error(StressError<D>),
}

/// The error of the stress around one row.
fn predicted<const D: usize>(
    subject: &Subject<'_, D>,
    around: &Around<'_, D>,
    tensor: &Tensor4<D>,
    (class, site, facet): (RowClass, u32, Option<usize>),
    nodal: &dyn Fn(&Tensor<D>, &mut [f64]),
) -> Predicted<D> {
    let model = around.model;
    let place = model.sites[site as usize].position;
    let (main, list) = match (class, facet) {
        // what a crack does to the stress is what it is there for
        (RowClass::Crack | RowClass::Border, _) | (RowClass::SeamAtSurface, None) => {
            return Predicted::NotAsked;
        }
        (RowClass::Seam | RowClass::Points | RowClass::HorizonChange, _) | (_, None) => {
            (None, gradients(tensor))
        }
        (_, Some(f)) => {
            let n = around.boundary.normals[f];
            let mut stresses: Vec<Tensor<D>> =
                tangents(&n).iter().map(|t| t * t.transpose()).collect();
            if around.boundary.kinds[f] == FacetKind::Held {
                stresses.push(n * n.transpose());
            }
            let fields = stresses.iter().map(|s| of_stress(tensor, s));
            (Some(f), fields.collect())
        }
    };
    let surface = main.map(|f| around.boundary.smooth_surface(f));
    let curved = main.zip(surface.as_deref());
    let bent = curved.map(|(f, surface)| around.boundary.bent_parts(f, surface));
    let of_field = |g: &Tensor<D>| {
        let mut force = vec![0.0; model.sites.len() * D];
        nodal(g, &mut force);
        if let Some(parts) = &bent {
            add_tractions(parts, &tensor.contract(g), &mut force);
        }
        force
    };
    let forces: Vec<Vec<f64>> = list.iter().map(of_field).collect();
    let mismatches: Vec<_> = list
        .iter()
        .map(|g| move |dof: usize| mismatch(subject, around.boundary, g, dof))
        .collect();
    let fields: Vec<PatchField<'_, D>> = list
        .iter()
        .zip(&forces)
        .zip(&mismatches)
        .map(|((gradient, forces), mismatch)| PatchField {
            gradient: *gradient,
            forces,
            mismatch,
        })
        .collect();
    if fields.is_empty() {
        return Predicted::NotAsked;
    }
    let Some(errors) = stress_errors(around, &place, curved, &fields) else {
        return Predicted::Unknown;
    };
    let size = |e: &StressError<D>| e.relative.abs();
    errors
        .into_iter()
        .max_by(|a, b| size(a).total_cmp(&size(b)))
        .map_or(Predicted::NotAsked, Predicted::Error)
}

/// Returns the difference of the displacement that a support prescribes at a point off its facets from that of a field which the facets keep: points of the first layer lie up
/// to half a spacing inside, and take the value of the facet all the same.
fn mismatch<const D: usize>(
    subject: &Subject<'_, D>,
    boundary: &Boundary<'_, D>,
    gradient: &Tensor<D>,
    dof: usize,
) -> f64 {
    let site = &subject.model.sites[dof / D];
    let holder = subject.holder[dof].map(|h| &subject.conditions[h]);
    let on_set = |c: &&Condition<D>| matches!(c.support(), Some(Support::Set { .. }));
    let Some(condition) = holder.filter(on_set) else {
        return 0.0;
    };
    let value = condition.components.0[dof % D].as_ref();
    if matches!(site.kind, SiteKind::Node(_)) || value.is_none_or(|e| e.depends_on_position()) {
        return 0.0;
    }
    let facets = boundary.near(&site.position, f64::INFINITY);
    let held = facets.filter(|(f, _)| boundary.kinds[*f] == FacetKind::Held);
    let nearest = held.min_by(|a, b| a.1.total_cmp(&b.1));
    nearest.map_or(0.0, |(f, distance)| {
        (gradient * boundary.normals[f] * distance)[dof % D]
    })
}

/// Unit vectors that span the plane across `n`.
fn tangents<const D: usize>(n: &Vector<D>) -> Vec<Vector<D>> {
    let mut list: Vec<Vector<D>> = Vec::new();
    for axis in 0..D {
        let mut t = Vector::<D>::zeros();
        t[axis] = 1.0;
        t -= n * n[axis];
        for known in &list {
            t -= known * known.dot(&t);
        }
        if t.norm() > 0.3 && list.len() + 1 < D {
            list.push(t.normalize());
        }
    }
    list
}
