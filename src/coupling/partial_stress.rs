//! Meshfree partial stress: the force on a transition point is the divergence of the peridynamic partial stress.

use std::sync::Arc;

use crate::{
    assembly::Row,
    coupling::{BodyBonds, Definiteness, Operator, PartialStresses, Term, uncoupled::own_elements},
    mesh::Mesh,
    model::{
        CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout,
        held_families::depth_of_seam,
    },
    parallel,
    peridynamics::{Influence, LinearForceState, PdBody},
    system::Symmetry,
    tensor::{Tensor, Vector},
};

/// Partial stress with a meshfree divergence, and a control of its zero-energy modes.
///
/// Source: [SAND2015-7998] eq. (2.29), with the divergence (2.20) of the partial stress (2.19) as in section 7.2: the force density in the transition zone is
/// `L(x) = ∇·ν^ps = Σ ω {ν(x′) − ν(x)} K⁻¹ ξ V′`, with `K = Σ ω ξ⊗ξ V′`. The nonlocal zone is peridynamic, the local zone consists of finite elements.
/// The horizon may vary in the transition zone.
///
/// Differs from it by: the control of \[Silling2017\], with the gradient `F = Σ ω η⊗ξ V′ K⁻¹` of the displacement at either end of a bond,
///
/// ```text
///   + Σ c (2η − {F(x) + F(x′)} ξ) V′ ,     c = κ C₁₁₁₁ ω D / Σ ω |ξ|² V′ ,     κ = 0.1 .
/// ```
///
/// Stress and divergence are both central differences, with the symbol `Σ ω ξ sin(k·ξ)` for the wave vector k. For waves of a few spacings their symbols vanish or have opposite signs. The symbol of the product is then
/// indefinite (−0.015 of that of the nearest neighbours), and short standing waves meet no resistance. The control vanishes for affine fields on any family and for cubic fields on whole families of a
/// lattice. Its symbol is nowhere negative: `(Σ ω ξ sin)ᵀ K⁻¹ (Σ ω ξ sin) ≤ Σ ω sin² ≤ 2 Σ ω (1 − cos)`.
#[derive(Clone, Copy, Debug)]
pub struct PartialStressMeshfree {
    /// ω of the divergence and of the control.
    pub influence: Influence,
}

impl<const D: usize> ZoneLayout<D> for PartialStressMeshfree {
    fn name(&self) -> &'static str {
        "partial stress (meshfree)"
    }

    fn interface(&self) -> Interface {
        Interface::OVERLAP
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Unsymmetric
    }

    fn roles(&self, _mesh: &Mesh<D>, zones: &[Zone], _largest_horizon: f64) -> Vec<CellRole> {
        zones
            .iter()
            .map(|zone| match zone {
                Zone::Local => CellRole::Element,
                Zone::Transition | Zone::Nonlocal => CellRole::Points,
            })
            .collect()
    }

    fn reach(&self, _law: &dyn LinearForceState<D>) -> Reach {
        Reach::Neighbours
    }

    fn takes_deviators(&self) -> bool {
        true
    }

    fn families_of_all(&self, law: &dyn LinearForceState<D>) -> Option<usize> {
        Some(depth_of_seam(law.is_pairwise()))
    }
}

coupling_by_rows!(PartialStressMeshfree);

impl PartialStressMeshfree {
    fn rows<'a, const D: usize>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
        let modulus = (model.peridynamics.as_ref())
            .map_or(0.0, |p| p.law.linearised().tensor().get(0, 0, 0, 0));
        let points = model.body().map_or(0, |body| body.families.len());
        let mut rows = Meshfree {
            model,
            influence: self.influence,
            control: CONTROL * modulus,
            shapes: Vec::new(),
        };
        rows.shapes = parallel::map(points, CHUNK, |i| rows.shape(i));
        Ok(rows.operator())
    }
}

/// Strength κ of the control \[1\].
///
/// The least eigenvalue of the symbol over that of the nearest neighbours, bond-based with `1/|ξ|` and the Gaussian divergence: in the plane at m = 3 it is −0.010, 0.012 and 0.024 with κ = 0, 0.05 and
/// 0.1, at m = 6 −0.007, 0.003 and 0.006, in space at m = 2 −0.017, 0.015 and 0.037. A long wave is stiffer by `κ (kδ)²/7` in a bar, where bonds make it softer by `(kδ)²/24`.
const CONTROL: f64 = 0.1;

/// Points whose shape tensors are computed by one thread at a time.
const CHUNK: usize = 256;

struct Meshfree<'a, const D: usize> {
    model: &'a Model<D>,
    influence: Influence,
    /// κ C₁₁₁₁ \[Pa\].
    control: f64,
    /// `K⁻¹` and the trace of `K` for each point; none where K is singular.
    shapes: Vec<Option<(Tensor<D>, f64)>>,
}

impl<'a, const D: usize> Meshfree<'a, D> {
    /// Finite elements, the bonds of the nonlocal zone, and in the transition zone the divergence of partial stresses and the control.
    fn operator(self) -> Operator<'a, D> {
        let model = self.model;
        let point = |site: usize, is_nonlocal: bool| {
            let is_zone = |i: usize| (model.zone_of_point(i) == Zone::Nonlocal) == is_nonlocal;
            model.point_of(site).filter(|(_, i)| is_zone(*i))
        };
        let rows = Arc::new(self);
        let on_site = {
            let rows = Arc::clone(&rows);
            move |site| point(site, false).map_or(Vec::new(), |(body, i)| rows.divergence(body, i))
        };
        Operator {
            model,
            terms: vec![
                own_elements(model),
                Term::Bonds(BodyBonds::alone(move |site| point(site, true).is_some())),
                Term::Stresses(PartialStresses {
                    model,
                    body: None,
                    on_site: Box::new(on_site),
                    first_of_cell: Vec::new(),
                }),
                Term::Rows(Box::new(move |site, row| {
                    if let Some((body, i)) = point(site, false) {
                        rows.add_control(body, i, row);
                    }
                })),
            ],
            beta: Box::new(move |site| match model.point_of(site) {
                Some(_) if point(site, true).is_some() => 1.0,
                Some(_) => 0.5,
                None => 0.0,
            }),
            counts_materials: false,
            definiteness: Definiteness::SumOfSquares,
        }
    }
}

impl<const D: usize> Meshfree<'_, D> {
    /// The bonds of a point with `ω V′`.
    fn bonds<'b>(
        &'b self,
        body: &'b PdBody<D>,
        i: usize,
    ) -> impl Iterator<Item = (usize, Vector<D>, f64)> + 'b {
        let horizon = body.cloud.horizon.of(i);
        body.families.of(i).iter().map(move |&j| {
            let xi = body.bond(i, j as usize);
            let omega = self.influence.value(xi.norm(), horizon);
            (j as usize, xi, omega * body.cloud.volume[j as usize])
        })
    }

    /// `K⁻¹` and the trace of `K = Σ ω ξ⊗ξ V`.
    fn shape(&self, i: usize) -> Option<(Tensor<D>, f64)> {
        let body = self.model.body()?;
        let mut shape = Tensor::<D>::zeros();
        for (_, xi, weight) in self.bonds(body, i) {
            shape += xi * xi.transpose() * weight;
        }
        Some((shape.try_inverse()?, shape.trace()))
    }

    /// Returns the points whose stresses enter the divergence at a transition point, with their weights \[m^(D−1)\]: `−V ∇·ν^ps` of [SAND2015-7998] eq. (2.20), as section 7.2 discretises it.
    fn divergence(&self, body: &PdBody<D>, i: usize) -> Vec<(usize, Vector<D>)> {
        // a point whose bonds do not span the space has a singular K, and no divergence
        let Some((inverse, _)) = self.shapes[i] else {
            return Vec::new();
        };
        let mut own = Vector::zeros();
        let mut on: Vec<(usize, Vector<D>)> = Vec::new();
        for (j, xi, weight) in self.bonds(body, i) {
            // K u = f is minus the internal force
            let a = inverse * xi * (-weight * body.cloud.volume[i]);
            own -= a;
            on.push((j, a));
        }
        if own.amax() > 1e-15 * body.cloud.volume[i] / body.cloud.horizon.of(i) {
            on.push((i, own));
        }
        on
    }

    /// Adds the row of the control: minus its force on the point.
    fn add_control(&self, body: &PdBody<D>, i: usize, row: &mut Row<D>) {
        let Some((_, trace)) = self.shapes[i] else {
            return;
        };
        let strength = self.control * D as f64 / trace * body.cloud.volume[i];
        let transfer = &body.cloud.transfer;
        let (mut own, mut first) = (0.0, Vector::<D>::zeros());
        for (j, xi, weight) in self.bonds(body, i) {
            let c = strength * weight;
            own += 2.0 * c;
            first += xi * c;
            row.gather(transfer, j, &(Tensor::identity() * (-2.0 * c)));
            self.add_gradient(body, j, &(xi * c), row);
        }
        row.gather(transfer, i, &(Tensor::identity() * own));
        // a whole family has Σ ω ξ V = 0
        if first.amax() > 1e-15 * own * body.cloud.horizon.of(i) {
            self.add_gradient(body, i, &first, row);
        }
        row.spread(transfer);
    }

    /// Gathers the row of `F a` at point `j`, F the gradient of the displacement there.
    fn add_gradient(&self, body: &PdBody<D>, j: usize, a: &Vector<D>, row: &mut Row<D>) {
        let Some((inverse, _)) = self.shapes[j] else {
            return;
        };
        let along = inverse * a;
        let mut own = 0.0;
        for (l, xi, weight) in self.bonds(body, j) {
            let w = xi.dot(&along) * weight;
            own -= w;
            row.gather(&body.cloud.transfer, l, &(Tensor::identity() * w));
        }
        row.gather(&body.cloud.transfer, j, &(Tensor::identity() * own));
    }
}
