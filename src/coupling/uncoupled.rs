//! One model everywhere: finite elements alone and peridynamics alone, as couplings.

use crate::{
    coupling::{BodyBonds, Coupling, Definiteness, Operator, Term},
    dimension,
    mesh::Mesh,
    model::{CellRole, Interface, Model, ModelError, Reach, Zone, ZoneLayout},
    peridynamics::LinearForceState,
    system::Symmetry,
};

/// Finite elements everywhere.
#[derive(Clone, Copy, Debug, Default)]
pub struct Local;

/// Peridynamics everywhere.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nonlocal;

/// Implements a coupling whose cells all have one role.
macro_rules! everywhere {
    ($method:ident, $name:literal, $role:ident { $($more:tt)* }) => {
        impl<const D: usize> ZoneLayout<D> for $method {
            fn name(&self) -> &'static str {
                $name
            }

            fn interface(&self) -> Interface {
                Interface::OVERLAP
            }

            fn symmetry(&self) -> Symmetry {
                Symmetry::Symmetric
            }

            fn roles(&self, mesh: &Mesh<D>, _zones: &[Zone], _horizon: f64) -> Vec<CellRole> {
                vec![CellRole::$role; mesh.cell_count()]
            }

            fn reach(&self, law: &dyn LinearForceState<D>) -> Reach {
                Reach::of_bond_forces(law)
            }

            fn takes_deviators(&self) -> bool {
                true
            }

            $($more)*
        }

        impl<const D: usize> Coupling<D> for $method {
            fn operator<'a>(&self, model: &'a Model<D>) -> Result<Operator<'a, D>, ModelError> {
                Ok(own_model(model))
            }
        }
    };
}

everywhere!(Local, "local", Element {});

everywhere! {
    Nonlocal, "nonlocal", Points {
        fn families_of_all(&self, _law: &dyn LinearForceState<D>) -> Option<usize> {
            Some(0)
        }

        fn moves_with_own_families(&self) -> bool {
            true
        }
    }
}

type Own<const D: usize> = for<'a> fn(&'a Model<D>) -> Operator<'a, D>;

/// A model of which each site takes the equation of its own model, `R` 1 for its own term and 0 for others, [SAND2015-7998] eq. (2.30): `L^pd` of eq. (2.5) at points, `L⁰` of (2.11) at nodes.
pub(crate) fn own_model<const D: usize>(model: &Model<D>) -> Operator<'_, D> {
    fn terms<const D: usize>(model: &Model<D>) -> Operator<'_, D> {
        let is_point = |site: usize| model.point_of(site).is_some();
        Operator {
            model,
            terms: vec![own_elements(model), Term::Bonds(BodyBonds::alone(is_point))],
            beta: Box::new(move |site| f64::from(u8::from(is_point(site)))),
            counts_materials: true,
            definiteness: Definiteness::SumOfSquares,
        }
    }
    static OWN: (Own<1>, Own<2>, Own<3>) = (terms, terms, terms);
    dimension::of::<Own<D>>(&OWN)(model)
}

/// The finite elements around nodes, all but those whose stress is a partial stress.
pub(super) fn own_elements<const D: usize>(model: &Model<D>) -> Term<'_, D> {
    Term::Rows(Box::new(|site, row| {
        if model.point_of(site).is_none() {
            model.add_element_rows(site, row);
        }
    }))
}
