//! Elements that follow the bonds of the points beside them at any stretch and rotation.

use std::sync::Arc;

use crate::{
    material::LocalLaw,
    model::{Model, ModelError},
    peridynamics::{Accelerator, BondWeights, CauchyBorn, Law, bond_force::BondKinematics},
};

/// Largest difference, over the size of the tensor, between what a family carries and the elements' own stiffness that is taken for round-off.
const ROUND_OFF: f64 = 1e-9;

impl<const D: usize> Model<D> {
    /// Gives the finite elements of the points' materials the Cauchy–Born law of the lattice's whole family, with bonds that deform as `kinematics` says.
    ///
    /// # Errors
    /// [`ModelError::Unsupported`] for points that have no such family in common, and for a law with history variables; [`ModelError::Family`] for a family that is too small.
    pub fn follow_bonds(&mut self, kinematics: BondKinematics) -> Result<(), ModelError> {
        let Some(p) = &self.peridynamics else {
            return Ok(());
        };
        let refused = |what, remedy| Err(ModelError::Unsupported { what, remedy });
        let [(factors, horizon)] = &self.lattices.factors[..] else {
            return refused(
                "elements with the Cauchy–Born law of points that are not there, or of several lattices",
                "draw one nonlocal zone with one horizon, or leave peridynamics.elements out",
            );
        };
        let is_uniform = self
            .body()
            .is_some_and(|body| body.cloud.horizon.uniform().is_some());
        if !factors.is_lattice() || p.weights == BondWeights::Fitted || !is_uniform {
            return refused(
                "elements with the Cauchy–Born law of points whose families differ",
                "give peridynamics.points a lattice, a horizon that is a number, and isotropic or plain weights",
            );
        }
        let of_points: Vec<(u16, &dyn Law<D>)> = match p.law.several() {
            Some(several) => (several.used().iter())
                .map(|&m| (m, several.law(m)))
                .collect(),
            None => vec![(self.peridynamic_material(), p.law.as_ref())],
        };
        let mut laws: Vec<Option<Arc<dyn LocalLaw<D>>>> = vec![None; self.elastic.tensors.len()];
        let mut dilatation = None;
        for (material, law) in of_points {
            let (bonds, carried) = factors.bonds(law.linearised(), *horizon)?;
            // the rows of the elements have this one, so that the law is what they lack of it
            let tangent = self.elastic.tensors[usize::from(material)];
            let mut difference = carried;
            difference.add_scaled(-1.0, &tangent);
            if difference.amax() > ROUND_OFF * tangent.amax() {
                return refused(
                    "elements with the Cauchy–Born law of a lattice that does not carry the typed constants",
                    "use peridynamics.weights = \"plain\", or a horizon of three spacings",
                );
            }
            let own = match p.law.several() {
                Some(_) => material,
                None => 0,
            };
            let Some(law) = CauchyBorn::new(&p.law, own, &bonds, tangent, kinematics) else {
                return refused(
                    "elements with the Cauchy–Born law of a material that remembers, or is for small strains",
                    "use a material without memory, or leave peridynamics.elements out",
                );
            };
            let law = Arc::new(law);
            let is_solid = matches!(p.accelerator(), Some(Accelerator::Solid { .. }));
            if is_solid && p.law.several().is_none() && kinematics == BondKinematics::Exact {
                dilatation = Some(Arc::clone(&law));
            }
            laws[usize::from(material)] = Some(law);
        }
        self.cauchy_born.laws = laws;
        self.cauchy_born.dilatation = dilatation;
        Ok(())
    }

    /// Returns true if elements follow the bonds, [`Model::follow_bonds`].
    pub fn follows_bonds(&self) -> bool {
        !self.cauchy_born.laws.is_empty()
    }

    /// Returns true if the elements of a material, by its number, follow the bonds.
    pub fn follows_bonds_in(&self, material: u16) -> bool {
        let law = self.cauchy_born.laws.get(usize::from(material));
        law.is_some_and(Option::is_some)
    }

    /// The local law of elements of a material by its number: that of the bonds, where [`Model::follow_bonds`] gave one, and otherwise that of those `typed`.
    pub fn local_law<'a>(
        &'a self,
        typed: &'a [Option<Arc<dyn LocalLaw<D>>>],
        material: u16,
    ) -> Option<&'a Arc<dyn LocalLaw<D>>> {
        let of = |laws: &'a [Option<Arc<dyn LocalLaw<D>>>]| laws.get(usize::from(material));
        let own = of(&self.cauchy_born.laws).and_then(Option::as_ref);
        own.or_else(|| of(typed).and_then(Option::as_ref))
    }

    /// The local law of a point, where the stress of its family is that of one.
    pub fn local_law_at(&self, point: usize) -> Option<&dyn LocalLaw<D>> {
        let states = self.peridynamics.as_ref()?.law.force_state()?;
        let material = self.body()?.cloud.material.get(point).copied();
        let own = material.unwrap_or(self.peridynamic_material());
        states.correspondence(Some(own)).map(|point| point.law)
    }

    /// [`Model::local_law`] of every material.
    pub fn local_laws(
        &self,
        typed: &[Option<Arc<dyn LocalLaw<D>>>],
    ) -> Vec<Option<Arc<dyn LocalLaw<D>>>> {
        let materials = 0..self.elastic.tensors.len() as u16;
        materials
            .map(|m| self.local_law(typed, m).cloned())
            .collect()
    }
}
