//! Finite elements, rows at a seam and bonds that keep to a linearisation, or stay whole, where their material does not.
//!
//! Elements without a local law, and the rows of points at a seam, follow [`crate::peridynamics::Law::linearised`]; neither they nor bonds in `no-fail` regions break, nor any bond of a static scene. What a law does beyond that it says itself ([`Departure`]), and a
//! scene says at which stretch bonds break. Strains are mechanical, those of free expansion taken off: of elements that at their centres, of rows at a seam that which fits their families best.

use serde::{Deserialize, Serialize};

use crate::coupling::semidiscrete::behaviour::BondThreshold;
use crate::observe::report::number;
use crate::observe::warning::{Code, Warning};
use crate::peridynamics::{Departure, largest_extension};
use crate::run::error::RunError;
use crate::run::motion::dynamic_system::failure_criterion;
use crate::run::setup::RunSettings;
use crate::system::Ranks;
use crate::tensor::{Tensor, Vector, inverse, padded, strain};
use crate::{
    coupling::Operator,
    model::{Model, SiteKind},
};
use crate::{fem, parallel};

/// Part of the stress that a law has to lose over a run before a warning names the parts that do not.
const LOST: f64 = 0.01;

/// A limit counts as passed beyond it by more than what is rounded.
const ROUNDED: f64 = 1e-9;

/// Kind of a run: it decides which bonds may break and what places the zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RunKind {
    /// One equilibrium, in which no bond breaks.
    Static,
    /// One after another.
    LoadSteps,
    /// In time.
    Explicit,
}

/// The element or point furthest beyond its limit: part of a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Passing {
    /// Its strain or stretch over the limit.
    factor: f64,
    place: [f64; 3],
    /// Number of elements or points beyond their limits in that state.
    count: u64,
    material: u16,
    /// True if the limit is the stretch at which bonds break.
    breaks: bool,
    step: u64,
    time: f64,
}

/// The worst of a run so far: part of a checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Passed {
    elements: Option<Passing>,
    rows: Option<Passing>,
    bonds: Option<Passing>,
}

/// A finite element that keeps to a linearisation, or cannot break.
struct Element {
    cell: u32,
    /// True if its material is nonlinear where the element follows the linearisation.
    departs: bool,
    /// The stretch at which bonds of its material would break; infinite where none would.
    critical: f64,
}

/// Parts of a model that are linear, or stay whole, whatever their material does.
pub(crate) struct LinearParts<'m, const D: usize> {
    model: &'m Model<D>,
    rest: &'m RunSettings<D>,
    ranks: Option<&'m dyn Ranks>,
    kind: RunKind,
    elements: Vec<Element>,
    /// Points whose rows are not those of their bonds alone, where their law departs from them.
    rows: Vec<u32>,
    /// Points whose bonds cannot break, where others can.
    whole: Vec<u32>,
    critical: Option<BondThreshold>,
}

impl<'m, const D: usize> LinearParts<'m, D> {
    /// Of a model with its rows; `is_exact_seam` where bonds of the seam turn and break like others.
    ///
    /// # Errors
    /// [`RunError::Fracture`] for a fracture energy that gives no stretch.
    pub fn new(
        model: &'m Model<D>,
        operator: &Operator<'_, D>,
        rest: &'m RunSettings<D>,
        (kind, is_exact_seam): (RunKind, bool),
        ranks: Option<&'m dyn Ranks>,
    ) -> Result<Self, RunError> {
        let critical = failure_criterion(model, rest)?;
        let mut parts = Self {
            model,
            rest,
            ranks,
            kind,
            elements: Vec::new(),
            rows: Vec::new(),
            whole: Vec::new(),
            critical,
        };
        parts.find_elements();
        parts.find_points(operator, is_exact_seam);
        Ok(parts)
    }

    fn find_elements(&mut self) {
        let (model, rest) = (self.model, self.rest);
        let materials = 0..rest.materials.len() as u16;
        let of_material: Vec<(bool, f64)> = materials
            .map(|m| {
                let follows = model.local_law(&rest.local_laws, m).is_some();
                (!follows && self.departs(m), self.critical_of(m))
            })
            .collect();
        let never = |x: &Vector<D>| rest.breaking.no_fail.iter().any(|r| r.contains(x, 0.0));
        for c in (0..model.mesh.cell_count()).filter(|&c| model.is_element(c)) {
            let (departs, mut critical) = of_material[usize::from(model.material_of_cell(c))];
            if critical.is_finite() && never(&model.mesh.centroid(c)) {
                critical = f64::INFINITY;
            }
            if departs || critical.is_finite() {
                self.elements.push(Element {
                    cell: c as u32,
                    departs,
                    critical,
                });
            }
        }
    }

    fn find_points(&mut self, operator: &Operator<'_, D>, is_exact_seam: bool) {
        let (model, rest) = (self.model, self.rest);
        let breaks = self.critical.is_some();
        for (site, s) in model.sites.iter().enumerate() {
            let SiteKind::Point(p) = s.kind else {
                continue;
            };
            let is_own = is_exact_seam || operator.is_body_row(site);
            let never = || {
                rest.breaking
                    .no_fail
                    .iter()
                    .any(|r| r.contains(&s.position, 0.0))
            };
            if !is_own && self.departs(self.material_at(p as usize)) {
                self.rows.push(p);
            }
            if breaks && (!is_own || self.kind == RunKind::Static || never()) {
                self.whole.push(p);
            }
        }
    }

    /// Returns true if a material ever departs from its linearisation.
    fn departs(&self, material: u16) -> bool {
        self.departure(material, &small_shear(), 0.0) != Departure::None
    }

    fn departure(&self, material: u16, strain: &Tensor<D>, time: f64) -> Departure {
        let law = &self.rest.materials[usize::from(material)].law;
        (law.as_ref()).map_or(Departure::None, |law| law.departure(strain, time))
    }

    fn material_at(&self, point: usize) -> u16 {
        let of_point = self.model.body().and_then(|b| b.cloud.material.get(point));
        of_point
            .copied()
            .unwrap_or(self.model.peridynamic_material())
    }

    /// The stretch at which bonds of a material would break, those of the longest horizon; infinite where none would, or none is known.
    fn critical_of(&self, material: u16) -> f64 {
        let stuff = &self.rest.materials[usize::from(material)];
        if material == self.model.peridynamic_material() || self.model.several().is_some() {
            match &self.critical {
                Some(BondThreshold::ByMaterials(of)) => return of.at(material, material),
                Some(BondThreshold::PerLattice(list)) => {
                    return list.iter().copied().fold(f64::INFINITY, f64::min);
                }
                Some(BondThreshold::Uniform(s)) => return *s,
                Some(BondThreshold::State(_)) | None => {}
            }
        }
        // without points there is no horizon that an energy would give a stretch with
        let unknown = |_energy| Err(());
        let typed = stuff
            .fracture
            .and_then(|f| f.stretch(unknown).ok().flatten());
        typed.unwrap_or(f64::INFINITY)
    }

    /// Looks at a state for what is beyond its limit further than anything before. Collective where families are spread.
    pub fn look(&self, u: &[f64], (step, time): (u64, f64), passed: &mut Passed) {
        let (model, mesh) = (self.model, &self.model.mesh);
        let found = parallel::map(self.elements.len(), 256, |k| self.of_element(k, u, time));
        let of = |k: usize| {
            let cell = self.elements[k].cell as usize;
            (mesh.centroid(cell), model.material_of_cell(cell))
        };
        renew(&mut passed.elements, &found, of, (step, time));
        let Some(body) = model.body() else {
            return;
        };
        let at = |list: &[u32], k: usize| {
            let p = list[k] as usize;
            (body.cloud.position[p], self.material_at(p))
        };
        if !self.rows.is_empty() {
            let factors = model.of_families(self.ranks, &self.rows, 1, |own| {
                parallel::map(own.len(), 64, |k| self.of_row(own[k] as usize, u, time))
            });
            let found: Vec<_> = factors.into_iter().map(|f| (f, false)).collect();
            renew(
                &mut passed.rows,
                &found,
                |k| at(&self.rows, k),
                (step, time),
            );
        }
        if !self.whole.is_empty() {
            let factors = model.of_families(self.ranks, &self.whole, 1, |own| {
                parallel::map(own.len(), 64, |k| self.of_bonds(own[k] as usize, u, time))
            });
            let found: Vec<_> = factors.into_iter().map(|f| (f, true)).collect();
            renew(
                &mut passed.bonds,
                &found,
                |k| at(&self.whole, k),
                (step, time),
            );
        }
    }

    /// The strain of an element over its limit, and whether that is the stretch at which bonds break.
    fn of_element(&self, k: usize, u: &[f64], time: f64) -> (f64, bool) {
        let element = &self.elements[k];
        let (model, cell) = (self.model, element.cell as usize);
        let node = |n: usize| model.node_transfer.displacement(n, u);
        let gradient = fem::displacement_gradient_at_centre(&model.mesh, cell, node);
        let free = match &self.rest.stresses.thermal {
            Some(thermal) => strain(&thermal.cell_gradient(model, cell, time)),
            None => Tensor::zeros(),
        };
        let strain = mechanical(&gradient, &free);
        let broken = largest_extension(&strain) / element.critical;
        let departed = match element.departs {
            true => self.factor(model.material_of_cell(cell), &strain),
            false => 0.0,
        };
        (broken.max(departed), broken >= departed)
    }

    /// A strain over that from which on a material departs from its linearisation.
    fn factor(&self, material: u16, strain: &Tensor<D>) -> f64 {
        match self.departure(material, strain, 0.0) {
            Departure::AtStrain { factor, .. } => factor,
            Departure::WithTime { .. } | Departure::None => 0.0,
        }
    }

    /// The same of the strain that fits the family of a point best.
    fn of_row(&self, i: usize, u: &[f64], time: f64) -> f64 {
        let Some(body) = self.model.body() else {
            return 0.0;
        };
        let displacement = |p: usize| body.cloud.transfer.displacement(p, u);
        let (x, at) = (body.cloud.position[i], displacement(i));
        let (mut shape, mut moved) = (Tensor::<D>::zeros(), Tensor::<D>::zeros());
        for &j in body.families.of(i) {
            let xi = body.cloud.position[j as usize] - x;
            shape += xi * xi.transpose();
            moved += (displacement(j as usize) - at) * xi.transpose();
        }
        let Some((inverse, _)) = inverse(&shape) else {
            return 0.0;
        };
        let free = Tensor::identity() * self.expansion(i, &x, time);
        self.factor(self.material_at(i), &mechanical(&(moved * inverse), &free))
    }

    /// The largest stretch of a bond of a point over that at which it would break.
    fn of_bonds(&self, i: usize, u: &[f64], time: f64) -> f64 {
        let (Some(body), Some(critical)) = (self.model.body(), &self.critical) else {
            return 0.0;
        };
        let cloud = &body.cloud;
        let (x, at) = (cloud.position[i], cloud.transfer.displacement(i, u));
        let free = self.expansion(i, &x, time);
        let of_bond = |&j: &u32| {
            let j = j as usize;
            let (xi, eta) = (
                cloud.position[j] - x,
                cloud.transfer.displacement(j, u) - at,
            );
            let square = xi.norm_squared();
            let linear = xi.dot(&eta) / square;
            // s = (2ξ·η + η·η) / (|ξ| (|ξ+η| + |ξ|)); one of the two is wrong where the body turns
            let exact = (2.0 * xi.dot(&eta) + eta.norm_squared())
                / (square + square.sqrt() * (xi + eta).norm());
            let materials = [self.material_at(i), self.material_at(j)];
            let limit = critical.at(cloud.horizon.lattice_of(i), materials);
            (linear.min(exact) - free) / limit
        };
        let family = body.families.of(i).iter();
        family.map(of_bond).fold(0.0, f64::max)
    }

    /// Strain of free expansion at a point.
    fn expansion(&self, point: usize, x: &Vector<D>, time: f64) -> f64 {
        let thermal = self.rest.stresses.thermal.as_ref();
        thermal.map_or(0.0, |thermal| {
            thermal.stretch_at(x, self.material_at(point), time)
        })
    }

    /// The warnings of a run that ends at a time.
    pub fn told(&self, passed: &Passed, time: f64) -> impl Iterator<Item = Warning> {
        let beyond =
            |p: &Passing, message| Warning::new(Code::BeyondRange, message).at(&p.place[..D]);
        let all = [
            passed
                .elements
                .map(|p| beyond(&p, self.elements_passed(&p))),
            passed.rows.map(|p| beyond(&p, self.rows_passed(&p))),
            passed.bonds.map(|p| beyond(&p, self.bonds_passed(&p))),
            self.not_relaxed(time),
        ];
        all.into_iter().flatten()
    }

    fn name(&self, material: u16) -> &str {
        &self.rest.materials[usize::from(material)].name
    }

    /// "at (x, y), at t = …".
    fn place(&self, p: &Passing) -> String {
        let place: Vec<String> = p.place[..D].iter().map(|x| number(*x)).collect();
        let when = match self.kind {
            RunKind::Static => String::new(),
            RunKind::LoadSteps | RunKind::Explicit => format!(", at t = {}", number(p.time)),
        };
        format!("at ({}){when}", place.join(", "))
    }

    /// Returns the nonlinearity that begins at a strain in a material, and the key that lets elements follow it.
    fn beginning(&self, material: u16) -> (&'static str, Option<&'static str>) {
        match self.departure(material, &small_shear(), 0.0) {
            Departure::AtStrain {
                begins,
                in_elements,
                ..
            } => (begins, in_elements),
            Departure::WithTime { in_elements, .. } => ("it relaxes", in_elements),
            Departure::None => ("", None),
        }
    }

    fn elements_passed(&self, p: &Passing) -> String {
        let Passing { count, factor, .. } = *p;
        let (name, place) = (self.name(p.material), self.place(p));
        let (factor, elements) = (number(factor), plural(count, "finite element"));
        if p.breaks {
            let placed = match (self.kind, &self.rest.follow, &self.rest.placed) {
                (_, Some(_), _) => {
                    ", or let it follow earlier: zones.follow.stretch, zones.follow.padding"
                }
                (_, _, Some(_)) => ", or place it for smaller strains: zones.auto.stretch",
                (RunKind::Static | RunKind::LoadSteps, None, None) => {
                    ", or have it placed: zones = \"auto\""
                }
                (RunKind::Explicit, None, None) => {
                    ", or let it follow what is stretched: zones.follow"
                }
            };
            return format!(
                "{elements} strained beyond the stretch at which bonds of the material {name} break, up to {factor} times {place}: elements do not break; let the nonlocal zone hold this place, zones.nonlocal{placed}"
            );
        }
        let (begins, instead) = self.beginning(p.material);
        let instead = instead.map_or(String::new(), |key| format!(", or take {key}"));
        format!(
            "{elements} strained beyond where the material {name} is linear ({begins}), up to {factor} times {place}: elements of it stay linear; let the nonlocal zone hold this place, zones.nonlocal{instead}"
        )
    }

    fn rows_passed(&self, p: &Passing) -> String {
        let (begins, _) = self.beginning(p.material);
        format!(
            "{} at the seam strained beyond where the material {} is linear ({begins}), up to {} times {}: their rows stay linear; let the zone reach two horizons further, zones.nonlocal",
            plural(p.count, "point"),
            self.name(p.material),
            number(p.factor),
            self.place(p)
        )
    }

    fn bonds_passed(&self, p: &Passing) -> String {
        let why = match self.kind {
            RunKind::Static => {
                "no bond breaks in a static scene; take load steps, solve.quasi-static"
            }
            RunKind::LoadSteps | RunKind::Explicit if self.is_held(p) => {
                "no bond breaks in the regions no-fail; make them smaller, or see to it that what they hold does not matter"
            }
            RunKind::LoadSteps | RunKind::Explicit => {
                "bonds at the seam do not break; let the zone reach two horizons further, zones.nonlocal"
            }
        };
        format!(
            "the bonds of {} are stretched beyond where those of the material {} break, up to {} times {}: {why}",
            counted(p.count, "point"),
            self.name(p.material),
            number(p.factor),
            self.place(p)
        )
    }

    /// Returns true if the place lies in a region in which the scene lets nothing break.
    fn is_held(&self, p: &Passing) -> bool {
        let x = Vector::<D>::from_column_slice(&p.place[..D]);
        let regions = &self.rest.breaking.no_fail;
        regions.iter().any(|r| r.contains(&x, 0.0))
    }

    /// Elements and rows that are elastic where their material loses stress with the time.
    fn not_relaxed(&self, time: f64) -> Option<Warning> {
        let of = |material: u16| match self.departure(material, &small_shear(), time) {
            Departure::WithTime { lost, in_elements } => (lost, in_elements),
            Departure::AtStrain { .. } | Departure::None => (0.0, None),
        };
        let materials = 0..self.rest.materials.len() as u16;
        let of_material: Vec<_> = materials.map(of).collect();
        let elements = self.elements.iter().filter(|e| e.departs);
        let elements = elements.map(|e| self.model.material_of_cell(e.cell as usize));
        let rows = self.rows.iter().map(|&p| self.material_at(p as usize));
        let relaxing = |m: &u16| of_material[usize::from(*m)].0 > LOST;
        let (elements, rows): (Vec<u16>, Vec<u16>) = (
            elements.filter(relaxing).collect(),
            rows.filter(relaxing).collect(),
        );
        let lost = |m: &u16| of_material[usize::from(*m)].0;
        let all = elements.iter().chain(&rows);
        let worst = *all.max_by(|a, b| lost(a).total_cmp(&lost(b)))?;
        let (share, instead) = of_material[usize::from(worst)];
        let instead = instead.filter(|_| !elements.is_empty());
        let instead = instead.map_or(String::new(), |key| format!(", or take {key}"));
        let counts = [(elements.len(), "finite element"), (rows.len(), "point")];
        let counts = counts.into_iter().filter(|(n, _)| *n > 0);
        let counts: Vec<String> = counts.map(|(n, what)| counted(n as u64, what)).collect();
        let at_seam = if rows.is_empty() { "" } else { " at the seam" };
        Some(Warning::new(
            Code::Relaxation,
            format!(
                "{}{at_seam} stay elastic, where the material {} would lose {:.0} % of a stress that is held until the end: let the nonlocal zone hold what relaxes, zones.nonlocal, or couple by nonlocal{instead}",
                counts.join(" and "),
                self.name(worst),
                100.0 * share
            ),
        ))
    }
}

/// Puts what is furthest beyond its limit in the place of what was before, if it is further; `found` holds strains over their limits, and whether these are of bonds that break.
fn renew<const D: usize>(
    worst: &mut Option<Passing>,
    found: &[(f64, bool)],
    of: impl Fn(usize) -> (Vector<D>, u16),
    (step, time): (u64, f64),
) {
    let beyond = found.iter().enumerate();
    let beyond = beyond.filter(|(_, (factor, _))| *factor > 1.0 + ROUNDED);
    let count = beyond.clone().count() as u64;
    let Some((k, &(factor, breaks))) = beyond.max_by(|a, b| a.1.0.total_cmp(&b.1.0)) else {
        return;
    };
    if worst.is_none_or(|worst| factor > worst.factor) {
        let (place, material) = of(k);
        *worst = Some(Passing {
            factor,
            place: padded(&place),
            count,
            material,
            breaks,
            step,
            time,
        });
    }
}

/// The strain of a displacement gradient less that of free expansion: of the linear one and of Green's the smaller, since a rotation alone makes one of them wrong.
fn mechanical<const D: usize>(gradient: &Tensor<D>, free: &Tensor<D>) -> Tensor<D> {
    let linear = strain(gradient) - free;
    let green = linear + gradient.transpose() * gradient * 0.5;
    match green.norm() < linear.norm() {
        true => green,
        false => linear,
    }
}

/// A small strain along one axis that keeps the volume, where there is another.
fn small_shear<const D: usize>() -> Tensor<D> {
    let signs = [1.0, -1.0, 0.0];
    Tensor::from_diagonal(&Vector::from_fn(|k, _| 1e-6 * signs[k]))
}

/// "1 point is", "2 points are".
fn plural(count: u64, what: &str) -> String {
    let verb = if count == 1 { "is" } else { "are" };
    format!("{} {verb}", counted(count, what))
}

/// "1 point", "2 points".
fn counted(count: u64, what: &str) -> String {
    match count {
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}
