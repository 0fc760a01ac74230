//! Conditions of a validated scene.

#![deny(clippy::wildcard_enum_match_arm)]

use std::sync::Arc;

pub use super::components::Components;
use super::condition_at::ConditionAt;
use super::load::{Domain, Load};
pub use super::places::Support;
use crate::model::Model;
use crate::system::ForceTerm;
use crate::tensor::Vector;

/// A displacement given by a function: another solution, say. A program sets it; a scene file has expressions.
#[derive(Clone)]
pub struct Field<const D: usize>(FieldFunction<D>);

type FieldFunction<const D: usize> = Arc<dyn Fn(&Vector<D>) -> Option<Vector<D>> + Send + Sync>;

impl<const D: usize> Field<D> {
    /// Prescribes `function(x)` at every site where it has a value.
    pub fn new(function: impl Fn(&Vector<D>) -> Option<Vector<D>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(function))
    }

    /// The displacement at `x`, if it is prescribed there.
    pub fn at(&self, x: &Vector<D>) -> Option<Vector<D>> {
        (self.0)(x)
    }
}

impl<const D: usize> std::fmt::Debug for Field<D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Field")
    }
}

impl<const D: usize> PartialEq for Field<D> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// Quantity that a condition prescribes.
#[derive(Clone, Debug)]
pub enum Prescribed<const D: usize> {
    /// Displacement.
    Displacement(Support<D>),
    /// Velocity, in a scene that moves; the displacement begins with the one at time zero.
    Velocity(Support<D>),
    /// Displacement as a function of position; the components of the condition are not used.
    Field(Field<D>),
    /// A load, of which the components are the values.
    Load(Load<D>),
    /// A force that depends on the displacement; the components of the condition are not used.
    Term(Arc<dyn ConditionTerm<D>>),
}

impl<const D: usize> PartialEq for Prescribed<D> {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Displacement(a), Self::Displacement(b)) => a == b,
            (Self::Velocity(a), Self::Velocity(b)) => a == b,
            (Self::Field(a), Self::Field(b)) => a == b,
            (Self::Load(a), Self::Load(b)) => a == b,
            (Self::Term(a), Self::Term(b)) => Arc::ptr_eq(a, b),
            (
                Self::Displacement(_)
                | Self::Velocity(_)
                | Self::Field(_)
                | Self::Load(_)
                | Self::Term(_),
                _,
            ) => false,
        }
    }
}

/// A force of a condition that depends on the displacement.
pub trait ConditionTerm<const D: usize>: std::fmt::Debug + Send + Sync {
    /// The nodes of each facet that it acts on.
    fn facets(&self) -> Vec<&[u32]>;

    /// Returns true if the force is linear in the displacement and stores what it takes, so that it may hold a body at rest.
    fn holds_at_rest(&self) -> bool;

    /// The term on the sites of a model; none if it meets none.
    fn on_model(&self, model: &Model<D>) -> Option<Arc<dyn ForceTerm>>;
}

impl<const D: usize> Condition<D> {
    /// The sites that the condition holds, if it prescribes how they move.
    pub fn support(&self) -> Option<&Support<D>> {
        match &self.prescribed {
            Prescribed::Displacement(support) | Prescribed::Velocity(support) => Some(support),
            Prescribed::Field(_) | Prescribed::Load(_) | Prescribed::Term(_) => None,
        }
    }

    /// The load, if the condition is one.
    pub fn load(&self) -> Option<&Load<D>> {
        match &self.prescribed {
            Prescribed::Load(load) => Some(load),
            Prescribed::Displacement(_)
            | Prescribed::Velocity(_)
            | Prescribed::Field(_)
            | Prescribed::Term(_) => None,
        }
    }

    /// The force that depends on the displacement, if the condition is one.
    pub fn term(&self) -> Option<&dyn ConditionTerm<D>> {
        match &self.prescribed {
            Prescribed::Term(term) => Some(term.as_ref()),
            Prescribed::Displacement(_)
            | Prescribed::Velocity(_)
            | Prescribed::Field(_)
            | Prescribed::Load(_) => None,
        }
    }

    /// Returns true if the condition prescribes how sites move.
    pub fn holds(&self) -> bool {
        match &self.prescribed {
            Prescribed::Displacement(_) | Prescribed::Velocity(_) | Prescribed::Field(_) => true,
            Prescribed::Load(_) | Prescribed::Term(_) => false,
        }
    }

    /// The force per area or volume of a load at `x` with the outward unit normal `n`, at time `t`; zero of what is no load.
    pub fn force_density(&self, x: &Vector<D>, n: &Vector<D>, t: f64) -> Vector<D> {
        let of = |load: &Load<D>| (load.density)(&self.components.vector(x, t), n);
        self.load().map_or_else(Vector::zeros, of)
    }

    /// The force per area or volume of a unit of one component, where the outward unit normal is `n`.
    pub fn unit_density(&self, component: usize, n: &Vector<D>) -> Vector<D> {
        let unit = Vector::from_fn(|k, _| f64::from(u8::from(k == component)));
        let of = |load: &Load<D>| (load.density)(&unit, n);
        self.load().map_or_else(Vector::zeros, of)
    }

    /// Hands the force per area or volume at the time `t`, as [`Condition::force_density`] has it, to `pass`: as [`Components::visit`].
    pub fn visit<T>(
        &self,
        t: f64,
        mut pass: impl FnMut(&dyn Fn(&Vector<D>, &Vector<D>) -> Vector<D>) -> T,
    ) -> T {
        let load = self.load();
        self.components.visit(t, |field| {
            pass(&|x, n| load.map_or_else(Vector::zeros, |load| (load.density)(&field(x), n)))
        })
    }

    /// Returns true if the force of a load differs from place to place.
    pub fn varies_in_space(&self) -> bool {
        let on_surface = |load: &Load<D>| matches!(load.on, Domain::Surface(_));
        self.load().is_some_and(on_surface) || self.components.depends_on_position()
    }

    /// A displacement given by a function.
    pub fn field(name: &str, field: Field<D>) -> Self {
        Self {
            name: name.to_owned(),
            prescribed: Prescribed::Field(field),
            components: Components(std::array::from_fn(|_| None)),
        }
    }
}

impl<const D: usize> ConditionAt<'_, D> {
    /// The condition of that name.
    pub fn prescribes(&self, prescribed: Prescribed<D>, components: Components<D>) -> Condition<D> {
        Condition {
            name: self.name.value.clone(),
            prescribed,
            components,
        }
    }
}

/// A condition of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition<const D: usize> {
    /// Its name.
    pub name: String,
    /// The prescribed quantity and its place.
    pub prescribed: Prescribed<D>,
    /// Its components.
    pub components: Components<D>,
}
