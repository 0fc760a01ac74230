//! Finite elements of a coupled model whose laws are not linear.

use std::sync::{Arc, OnceLock};

use super::behaviour::{CHUNK, FreeStretch};
use super::tangent_pattern::TangentPattern;
use crate::{
    fem::{CellBandError, NonlinearElements},
    material::LocalLaw,
    model::{CellRole, Model, SiteKind},
    parallel,
    system::{ElementTangent, Interval, PlaceStress, Symmetry},
    tensor::Vector,
};

/// The elements around the nodes that are sites, as their rows have them.
pub(super) struct LocalElements<const D: usize> {
    elements: NonlinearElements<D>,
    /// Sparsity pattern of their tangent; computed with the first one.
    pattern: OnceLock<TangentPattern>,
    /// Free expansion; none of elements that do not expand.
    heat: Option<ElementHeat<D>>,
}

/// Free expansion of elements, and the time that they have it of.
struct ElementHeat<const D: usize> {
    stretch: FreeStretch<D>,
    /// None where they have not that of a time.
    time: Option<f64>,
    /// True while they keep what they have.
    is_held: bool,
}

impl<const D: usize> LocalElements<D> {
    /// The elements among the rows of nodes whose material has a law that is not linear; none if there are none.
    ///
    /// # Errors
    /// [`CellBandError`] for an element in which a law that softens would not take its fracture energy.
    pub fn new(
        model: &Model<D>,
        laws: &[Option<Arc<dyn LocalLaw<D>>>],
        heat: Option<&FreeStretch<D>>,
    ) -> Result<Option<Self>, CellBandError> {
        if laws.iter().all(Option::is_none) {
            return Ok(None);
        }
        // where elements follow the bonds, those with partial stresses have the stress of the bonds under their own gradient
        let takes =
            |cell: usize| model.roles[cell] != CellRole::StressElement || model.follows_bonds();
        let mut in_rows = vec![false; model.mesh.cell_count()];
        for site in 0..model.sites.len() {
            for (cell, _) in model.cells_of_site(site) {
                in_rows[cell] |= takes(cell) && model.node_takes(cell);
            }
        }
        for (cell, in_rows) in in_rows.iter_mut().enumerate() {
            // all nodes may follow points: it has an energy
            *in_rows |= takes(cell) && model.roles[cell] == CellRole::StressElement;
        }
        let cells = (0..in_rows.len()).filter(|&c| in_rows[c]);
        let cells = cells.map(|c| (c, model.is_element(c)));
        let law = |c| laws[model.material_of_cell(c) as usize].clone();
        let elements = NonlinearElements::new(&model.mesh, cells, law)?;
        Ok(elements.map(|elements| Self {
            elements,
            pattern: OnceLock::new(),
            heat: heat.map(|stretch| ElementHeat {
                stretch: stretch.clone(),
                time: None,
                is_held: false,
            }),
        }))
    }

    /// Gives them the temperature at a time (none: that without stress) and `part` of the change until another, until they are released.
    pub fn hold_between(&mut self, model: &Model<D>, (from, to, part): (Option<f64>, f64, f64)) {
        if let Some(heat) = &mut self.heat {
            (heat.time, heat.is_held) = (None, true);
        }
        self.expand(model, from, (to, part));
    }

    /// Lets them follow the time of each force again.
    pub fn release(&mut self) {
        if let Some(heat) = &mut self.heat {
            heat.is_held = false;
        }
    }

    fn expand(&mut self, model: &Model<D>, from: Option<f64>, (to, part): (f64, f64)) {
        let Some(ElementHeat { stretch, .. }) = &self.heat else {
            return;
        };
        self.elements.expand(&model.mesh, |cell| {
            let mut nodes = (stretch.of_cell)(model, cell, to);
            if part != 1.0 {
                let before = from.map(|t| (stretch.of_cell)(model, cell, t));
                for (k, node) in nodes.iter_mut().enumerate() {
                    let before = before.as_ref().map_or(Vector::zeros(), |b| b[k]);
                    *node = before + (*node - before) * part;
                }
            }
            let material = usize::from(model.material_of_cell(cell));
            (nodes, stretch.solid[material])
        });
    }

    /// Gives them the temperature at a time, unless they have it.
    fn follow(&mut self, model: &Model<D>, end: f64) {
        let Some(heat) = self.heat.as_mut().filter(|heat| !heat.is_held) else {
            return;
        };
        let is_there = |time: f64| time == end || !heat.stretch.varies_in_time;
        if !heat.time.is_some_and(is_there) {
            heat.time = Some(end);
            self.expand(model, None, (end, 1.0));
        }
    }

    /// Adds to the force of each site what its elements have beyond the linear ones.
    pub fn add_force(
        &mut self,
        model: &Model<D>,
        u: &[f64],
        interval: Interval,
        force: &mut [f64],
    ) {
        self.follow(model, interval.end);
        let nodes = |n: u32| model.node_transfer.displacement(n as usize, u);
        self.elements.respond(&model.mesh, nodes, interval.length);
        parallel::for_each_chunk(force, CHUNK * D, 1, |chunk, force| {
            for (k, force) in force.chunks_exact_mut(D).enumerate() {
                if let SiteKind::Node(n) = model.sites[chunk * CHUNK + k].kind {
                    let mut own: Vector<D> = self.elements.force(n);
                    for &(tied, weight) in model.ties.followers(n) {
                        own += self.elements.force(tied) * weight;
                    }
                    force.iter_mut().zip(own.iter()).for_each(|(f, x)| *f += x);
                }
            }
        });
    }

    /// Returns the tangent of the elements beyond that of the linear ones, in the rows and columns of the sites; with `is_whole` all else is linear.
    pub fn tangent(
        &self,
        model: &Model<D>,
        u: &[f64],
        step: f64,
        is_whole: bool,
    ) -> ElementTangent {
        let pattern = (self.pattern).get_or_init(|| TangentPattern::new(model, &self.elements));
        let nodes = |n: u32| model.node_transfer.displacement(n as usize, u);
        let mut excess = pattern.zeros::<D>();
        (self.elements).tangents(&model.mesh, nodes, step, |cell, blocks| {
            pattern.add(model, cell, blocks, &mut excess);
        });
        if let Some(scale) = model.row_scale() {
            let rows = excess.row_offsets.windows(2).zip(scale);
            for (ends, factor) in rows.filter(|(_, factor)| **factor != 1.0) {
                let own = &mut excess.values[ends[0] * D * D..ends[1] * D * D];
                own.iter_mut().for_each(|k| *k *= factor);
            }
        }
        ElementTangent {
            excess,
            symmetry: match self.elements.has_symmetric_tangent() {
                true => Symmetry::Symmetric,
                false => Symmetry::Unsymmetric,
            },
            is_whole,
        }
    }

    /// Returns true if a site is a node of such an element, so that its tangent changes.
    pub fn touches(&self, model: &Model<D>, site: usize) -> bool {
        matches!(model.sites[site].kind, SiteKind::Node(n) if self.elements.is_around(n))
    }

    /// See [`NonlinearElements::stored`].
    pub fn stored(&self, model: &Model<D>, u: &[f64]) -> f64 {
        let nodes = |n: u32| model.node_transfer.displacement(n as usize, u);
        self.elements.stored(&model.mesh, nodes)
    }

    /// The mean Cauchy stress of a cell, if it is among them; bonds of a plane, which it may follow, know nothing of the stress out of it.
    pub fn stress(&self, model: &Model<D>, cell: usize, u: &[f64]) -> Option<PlaceStress> {
        let nodes = |n: u32| model.node_transfer.displacement(n as usize, u);
        let (stress, across) = self.elements.stress(&model.mesh, cell, nodes)?;
        let is_known = !model.follows_bonds_in(model.material_of_cell(cell));
        Some(PlaceStress::new(&stress, is_known.then_some(across)))
    }

    /// The mean stored energy density of a cell, if it is among them.
    pub fn energy(&self, model: &Model<D>, cell: usize, u: &[f64]) -> Option<f64> {
        let nodes = |n: u32| model.node_transfer.displacement(n as usize, u);
        self.elements.energy_density(&model.mesh, cell, nodes)
    }

    /// See [`NonlinearElements::remembered`].
    pub fn remembered(&self, model: &Model<D>) -> Vec<(&'static str, Vec<(u32, f64)>)> {
        self.elements.remembered(&model.mesh)
    }

    pub fn remembers(&self) -> bool {
        self.elements.remembers()
    }

    pub fn commit(&mut self) -> f64 {
        self.elements.commit()
    }

    pub fn memory_bytes(&self) -> usize {
        self.elements.memory_bytes()
    }

    pub fn words(&self) -> usize {
        self.elements.words()
    }

    pub fn state(&self) -> impl Iterator<Item = u64> + '_ {
        self.elements.state()
    }

    pub fn restore(&mut self, state: &[u64]) {
        self.elements.restore(state);
    }
}
