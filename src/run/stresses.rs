//! Stress of elements and points as outputs show it: less its thermal part, and the numbers made of it.

use rustc_hash::FxHashMap;

use super::solution::Solved;
use super::stress_settings::StressSettings;
use super::thermal::Thermal;
use crate::fem;
use crate::material::Kinematics;
use crate::scene::spec::StressSpec;
use crate::tensor::{Tensor, Vector};

/// The names of the columns of a stress: its components, then the numbers that are `asked` for.
pub(super) fn names<const D: usize>(asked: &[StressSpec]) -> Vec<String> {
    let mut names = Vec::new();
    for (i, first) in AXES[..D].iter().enumerate() {
        names.extend(AXES[i..D].iter().map(|second| format!("s{first}{second}")));
    }
    names.extend(asked.iter().map(|s| name(s).replace('-', "_")));
    names
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// The name of a number made of a stress.
fn name(asked: &StressSpec) -> &'static str {
    match asked {
        StressSpec::VonMises => "von-mises",
        StressSpec::MaxPrincipal => "max-principal",
        StressSpec::MinPrincipal => "min-principal",
    }
}

/// What a stress belongs to.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    Cell(usize),
    /// A cell, and reference coordinates in it.
    Within(usize, [f64; 3]),
    Point(usize),
}

/// Stresses that laws which are not linear tell of themselves, by cell and by site.
#[derive(Default)]
pub(super) struct KnownStresses {
    cells: FxHashMap<u32, [[f64; 3]; 3]>,
    points: FxHashMap<u32, [[f64; 3]; 3]>,
    /// Of a scene with a temperature, the displacements of all sites by which a body expands freely: by a unit rise, and by a unit gradient of it along each axis.
    expansions: Vec<Vec<f64>>,
}

impl KnownStresses {
    pub fn of<const D: usize>(solved: &Solved<'_, D>) -> Self {
        let u = solved.displacement;
        let system = solved.system;
        let cells = system.map(|s| s.cell_stresses(u)).unwrap_or_default();
        let points = system.map(|s| s.stresses(u)).unwrap_or_default();
        Self {
            cells: cells.into_iter().collect(),
            points: points.into_iter().collect(),
            expansions: match solved.thermal() {
                Some(_) => super::thermal::unit_expansions(solved.model),
                None => Vec::new(),
            },
        }
    }
}

impl KnownStresses {
    /// The stress `of` the displacement of free expansion in `parts`.
    fn expanded<const D: usize>(
        &self,
        parts: &[f64],
        of: impl Fn(&[f64]) -> Tensor<D>,
    ) -> Tensor<D> {
        let each = parts.iter().zip(&self.expansions);
        each.filter(|(part, _)| **part != 0.0)
            .map(|(part, u)| of(u) * *part)
            .sum()
    }
}

impl<const D: usize> Solved<'_, D> {
    fn thermal(&self) -> Option<(&Thermal<D>, f64)> {
        let (settings, t) = self.stresses?;
        settings.thermal.as_ref().map(|thermal| (thermal, t))
    }

    /// The numbers made of the stress that are asked for.
    pub(super) fn asked(&self) -> &[StressSpec] {
        self.stresses.map_or(&[][..], |(s, _)| &s.asked)
    }

    /// Whether numbers made of the stress are asked for.
    pub(super) fn has_derived(&self) -> bool {
        !self.asked().is_empty()
    }

    /// The names of their fields.
    pub(super) fn derived_names(&self) -> Vec<&'static str> {
        self.asked().iter().map(name).collect()
    }

    /// Stress of an element at its centre, where the displacement has the gradient `gradient`.
    pub(super) fn cell_stress(
        &self,
        c: usize,
        gradient: &Tensor<D>,
        known: &KnownStresses,
    ) -> Tensor<D> {
        if let Some(own) = self.own_cell_stress(c, known) {
            return own;
        }
        let model = self.model;
        match self.thermal() {
            Some((thermal, t)) => {
                let mechanical = gradient - thermal.cell_gradient(model, c, t);
                model.tensor_of_cell(c).contract(&mechanical)
            }
            None => model.tensor_of_cell(c).contract(gradient),
        }
    }

    /// Stress of an element at reference coordinates `xi`; the mean of the cell where its law is not linear, or its stress the partial stress of bonds.
    pub(super) fn stress_in(&self, c: usize, xi: &[f64; 3], known: &KnownStresses) -> Tensor<D> {
        if let Some(own) = self.own_cell_stress(c, known) {
            return own;
        }
        let model = self.model;
        let mut gradient = self.gradient_in(c, xi);
        if let Some((thermal, t)) = self.thermal() {
            gradient -= thermal.gradient_in(model, c, xi, t);
        }
        model.tensor_of_cell(c).contract(&gradient)
    }

    /// The mean stress of an element that is no product of a tensor with the displacement gradient; none of other elements.
    fn own_cell_stress(&self, c: usize, known: &KnownStresses) -> Option<Tensor<D>> {
        if let Some(rows) = known.cells.get(&(c as u32)) {
            return Some(Tensor::from_fn(|i, j| rows[i][j]));
        }
        let (model, operator) = (self.model, self.operator);
        let own = operator.cell_stress(c, self.displacement)?;
        let Some((thermal, t)) = self.thermal() else {
            return Some(own);
        };
        let of = |u: &[f64]| operator.cell_stress(c, u).unwrap_or_else(Tensor::zeros);
        let parts = thermal.parts(model.material_of_cell(c), &model.mesh.centroid(c), t);
        Some(own - known.expanded(&parts, of))
    }

    /// Stress of a point over the bonds of its family that stand.
    pub(super) fn point_stress(
        &self,
        site: usize,
        stands: impl Fn(usize, usize) -> bool,
        known: &KnownStresses,
    ) -> Tensor<D> {
        if let Some(rows) = known.points.get(&(site as u32)) {
            return Tensor::from_fn(|i, j| rows[i][j]);
        }
        let Some((body, p)) = self.model.point_of(site) else {
            return Tensor::zeros();
        };
        let stress = body.partial_stress_of(p, self.displacement, |j| stands(p, j));
        match self.thermal() {
            Some((thermal, t)) => {
                let of = |u: &[f64]| body.partial_stress_of(p, u, |j| stands(p, j));
                let material = self.model.peridynamic_material();
                let parts = thermal.parts(material, &self.model.sites[site].position, t);
                stress - known.expanded(&parts, of)
            }
            None => stress,
        }
    }

    /// The numbers made of a stress, in the order of their names.
    pub(super) fn derived(&self, stress: &Tensor<D>, place: Place) -> Vec<f64> {
        let Some((settings, t)) = self.stresses else {
            return Vec::new();
        };
        let across = self.stress_out_of_plane(settings, t, stress, place);
        let principal = principal(stress, across);
        let of = |s: &StressSpec| match s {
            StressSpec::VonMises => von_mises(&principal),
            StressSpec::MaxPrincipal => principal.into_iter().fold(f64::NEG_INFINITY, f64::max),
            StressSpec::MinPrincipal => principal.into_iter().fold(f64::INFINITY, f64::min),
        };
        settings.asked.iter().map(of).collect()
    }

    /// Stress out of the plane: zero but in plane strain, where it is `ν (σ_xx + σ_yy) − E α ΔT`.
    fn stress_out_of_plane(
        &self,
        settings: &StressSettings<D>,
        t: f64,
        stress: &Tensor<D>,
        place: Place,
    ) -> f64 {
        if settings.kinematics != Kinematics::PlaneStrain {
            return 0.0;
        }
        let model = self.model;
        let (material, x): (u16, Vector<D>) = match place {
            Place::Cell(c) => (model.material_of_cell(c), model.mesh.centroid(c)),
            Place::Within(c, xi) => (
                model.material_of_cell(c),
                fem::position_in(&model.mesh, c, &xi),
            ),
            Place::Point(site) => {
                let material = model
                    .point_of(site)
                    .and_then(|(body, p)| body.cloud.material.get(p));
                let own = material.copied().unwrap_or(model.peridynamic_material());
                (own, model.sites[site].position)
            }
        };
        let (ratio, per_degree) = settings.constants[usize::from(material)];
        let rise = settings
            .thermal
            .as_ref()
            .map_or(0.0, |th| th.rise_at(&x, t));
        ratio * stress.trace() - per_degree * rise
    }
}

/// The von Mises stress of principal stresses \[Pa\].
pub(super) fn von_mises([a, b, c]: &[f64; 3]) -> f64 {
    (0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2))).sqrt()
}

/// Principal stresses of a tensor and a stress `across` its plane.
pub(super) fn principal<const D: usize>(stress: &Tensor<D>, across: f64) -> [f64; 3] {
    let entry = |i: usize, j: usize| match (i < D && j < D, i == j) {
        (true, _) => 0.5 * (stress[(i, j)] + stress[(j, i)]),
        (false, true) if D == 2 => across,
        _ => 0.0,
    };
    let full = Tensor::<3>::from_fn(entry);
    let values = full.symmetric_eigenvalues();
    [values[0], values[1], values[2]]
}
