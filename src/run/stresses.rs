//! Stress of elements and points as outputs show it: less its thermal part, and the numbers made of it.

use super::solution::Solved;
use super::thermal::Thermal;
use crate::fem;
use crate::peridynamics::{ForceState, bond_force::BondKinematics};
use crate::scene::validated::FieldChoice;
use crate::system::{BodyState, PlaceStress};
use crate::tensor::{Tensor, Vector};

/// Name of the field of stresses; see [`Solved::stress_name`].
pub(super) const FIELD: &str = "stress";

/// The displacements of all sites by which a body expands freely, of a scene with a temperature: by a unit rise, and by a unit gradient of it along each axis.
#[derive(Default)]
pub(super) struct Expansions(Vec<Vec<f64>>);

impl Expansions {
    pub fn of<const D: usize>(solved: &Solved<'_, D>) -> Self {
        Self(match solved.thermal() {
            Some(_) => super::thermal::unit_expansions(solved.model),
            None => Vec::new(),
        })
    }

    /// The stress `of` the displacement of free expansion in `parts`.
    fn stress<const D: usize>(&self, parts: &[f64], of: impl Fn(&[f64]) -> Tensor<D>) -> Tensor<D> {
        let each = parts.iter().zip(&self.0);
        each.filter(|(part, _)| **part != 0.0)
            .map(|(part, u)| of(u) * *part)
            .sum()
    }
}

/// The stress of a place \[Pa\]: its components within the body, and the normal one out of the plane, zero but in plane strain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stress<const D: usize> {
    pub tensor: Tensor<D>,
    pub across: f64,
}

impl<const D: usize> Stress<D> {
    /// No stress, where nothing carries one.
    pub fn zero() -> Self {
        Self {
            tensor: Tensor::zeros(),
            across: 0.0,
        }
    }

    /// Three rows of three.
    pub fn rows(&self) -> [[f64; 3]; 3] {
        let mut rows = PlaceStress::new(&self.tensor, None).rows;
        if D == 2 {
            rows[2][2] = self.across;
        }
        rows
    }

    /// Principal stresses, that out of the plane among them, in any order.
    pub fn principal(&self) -> [f64; 3] {
        principal(&self.tensor, self.across)
    }
}

impl<const D: usize> Solved<'_, D> {
    pub(super) fn thermal(&self) -> Option<(&Thermal<D>, f64)> {
        let (settings, t) = self.stresses;
        settings.thermal.as_ref().map(|thermal| (thermal, t))
    }

    /// Stress of an element at its centre, where the displacement has the gradient `gradient`: the mean Cauchy stress where its law is not linear, the linear stress of another.
    pub(super) fn cell_stress(
        &self,
        c: usize,
        gradient: &Tensor<D>,
        expansions: &Expansions,
    ) -> Stress<D> {
        let thermal = |(thermal, t): (&Thermal<D>, f64)| thermal.cell_gradient(self.model, c, t);
        self.stress_of_element(c, self.model.mesh.centroid(c), expansions, || {
            self.thermal()
                .map_or(*gradient, |at| gradient - thermal(at))
        })
    }

    /// Stress of an element at reference coordinates `xi`, where the displacement has the gradient `known`, if that is known; the mean of the cell where its law is not linear, or its stress the partial stress of bonds.
    pub(super) fn stress_in(
        &self,
        c: usize,
        xi: &[f64; 3],
        known: Option<Tensor<D>>,
        expansions: &Expansions,
    ) -> Stress<D> {
        let model = self.model;
        let x = fem::position_in(&model.mesh, c, xi);
        self.stress_of_element(c, x, expansions, || {
            let gradient = known.unwrap_or_else(|| self.gradient_in(c, xi));
            let thermal = |(thermal, t): (&Thermal<D>, f64)| thermal.gradient_in(model, c, xi, t);
            self.thermal().map_or(gradient, |at| gradient - thermal(at))
        })
    }

    /// Stress of an element at `x`, where the mechanical part of the displacement gradient is `gradient`.
    fn stress_of_element(
        &self,
        c: usize,
        x: Vector<D>,
        expansions: &Expansions,
        gradient: impl FnOnce() -> Tensor<D>,
    ) -> Stress<D> {
        let model = self.model;
        let material = model.material_of_cell(c);
        let told = (self.state()).and_then(|state| state.stress_of_cell(c, self.displacement));
        if let Some(told) = told {
            return self.complete(told.tensor(), told.across, material, (&x, &x));
        }
        let own = |u: &[f64]| self.operator.cell_stress(c, u);
        let tensor = match own(self.displacement) {
            Some(stress) => {
                let of = |u: &[f64]| own(u).unwrap_or_else(Tensor::zeros);
                let thermal = self.thermal().map(|(thermal, t)| {
                    let parts = thermal.parts(material, &model.mesh.centroid(c), t);
                    expansions.stress(&parts, of)
                });
                stress - thermal.unwrap_or_else(Tensor::zeros)
            }
            None => model.tensor_of_cell(c).contract(&gradient()),
        };
        self.complete(tensor, None, material, (&x, &model.mesh.centroid(c)))
    }

    /// Stress of a point over the bonds of its family that stand: the Cauchy stress of exact bonds, of a nonlinear law and of one with memory, the linear stress of others. These change by `beyond`, a change of the displacement gradient away from the point.
    pub(super) fn point_stress(
        &self,
        site: usize,
        beyond: Option<Tensor<D>>,
        stands: impl Fn(usize, usize) -> bool,
        expansions: &Expansions,
    ) -> Stress<D> {
        let model = self.model;
        let Some((body, p)) = model.point_of(site) else {
            return Stress::zero();
        };
        let x = model.sites[site].position;
        let material_of = |p: usize| {
            let material = body.cloud.material.get(p).copied();
            material.unwrap_or(model.peridynamic_material())
        };
        let material = material_of(p);
        let u = self.displacement;
        if let Some(told) = self.state().and_then(|state| state.stress_of_site(site, u)) {
            return self.complete(told.tensor(), told.across, material, (&x, &x));
        }
        if let Some(law) = self.exact_law() {
            let free = |j: usize| {
                let at = |(thermal, t): (&Thermal<D>, f64)| {
                    thermal.stretch_at(&body.cloud.position[j], material_of(j), t)
                };
                self.thermal().map_or(0.0, at)
            };
            let (told, _) = body.exact_response(p, law, u, |j| stands(p, j), free);
            return self.complete(told.tensor, told.across, material, (&x, &x));
        }
        let of = |u: &[f64]| body.partial_stress_of(p, u, |j| stands(p, j));
        let thermal = self.thermal().map(|(thermal, t)| {
            let parts = thermal.parts(material, &x, t);
            expansions.stress(&parts, of)
        });
        let mut tensor = of(u) - thermal.unwrap_or_else(Tensor::zeros);
        let law = model.peridynamics.as_ref().map(|p| &p.law);
        if let (Some(beyond), Some(law)) = (beyond, law)
            && thermal.is_none()
            && body.cloud.material.is_empty()
        {
            tensor += law.linearised().tensor().contract(&beyond);
        }
        self.complete(tensor, None, material, (&x, &x))
    }

    /// The state of what has forces that are not linear.
    pub(super) fn state(&self) -> Option<&dyn BodyState> {
        self.system?.body_state()
    }

    /// The fields that the scene asks for.
    pub(super) fn choice(&self) -> &FieldChoice {
        &self.stresses.0.output
    }

    /// The name of the field of stresses: linear ones, which a rotation turns to first order only, are called so where there are no others.
    pub(super) fn stress_name(&self) -> &'static str {
        match self.has_cauchy_stresses() {
            true => FIELD,
            false => "linear_stress",
        }
    }

    /// Returns true if stresses of points or of elements turn with the body.
    pub(super) fn has_cauchy_stresses(&self) -> bool {
        let model = self.model;
        let mut materials = 0..self.stresses.0.elastic.len() as u16;
        let elements = materials.any(|m| self.is_objective(m));
        let points = model.body().is_some_and(|_| self.has_exact_bonds());
        elements || points
    }

    /// Returns true if bonds are geometrically exact.
    fn has_exact_bonds(&self) -> bool {
        self.stresses.0.bonds == BondKinematics::Exact
    }

    /// Returns true if elements of a material follow a law for strains and rotations of any size.
    fn is_objective(&self, material: u16) -> bool {
        let law = (self.model).local_law(&self.stresses.0.local_laws, material);
        law.is_some_and(|law| law.is_objective())
    }

    /// 1 where the stress of an element is a Cauchy stress, 0 where it is the linear one.
    pub(super) fn measure_of_cell(&self, c: usize) -> u8 {
        self.is_objective(self.model.material_of_cell(c)).into()
    }

    /// The same of a point.
    pub(super) fn measure_of_point(&self, p: usize) -> u8 {
        let turns = match self.model.local_law_at(p) {
            Some(law) => law.is_objective(),
            None => self.has_exact_bonds(),
        };
        turns.into()
    }

    /// The force states of exact bonds whose stress follows from the displacement alone.
    pub(super) fn exact_law(&self) -> Option<&dyn ForceState<D>> {
        let law = &self.model.peridynamics.as_ref()?.law;
        let states = law.force_state()?;
        let is_exact = self.has_exact_bonds() && states.is_objective();
        (is_exact && states.history().is_empty()).then_some(states)
    }

    /// A stress with the one out of the plane: in plane strain, where the law does not tell it, that of an elastic body at the temperature of `x`, whose axes are those at `axes_at`.
    fn complete(
        &self,
        tensor: Tensor<D>,
        told: Option<f64>,
        material: u16,
        (x, axes_at): (&Vector<D>, &Vector<D>),
    ) -> Stress<D> {
        let (settings, t) = self.stresses;
        let elastic = || {
            let rise = settings.thermal.as_ref().map_or(0.0, |th| th.rise_at(x, t));
            settings.across(material, axes_at, &tensor, rise)
        };
        Stress {
            tensor,
            across: match settings.output.across {
                true => told.unwrap_or_else(elastic),
                false => 0.0,
            },
        }
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
