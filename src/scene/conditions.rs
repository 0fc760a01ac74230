//! Conditions of a validated scene.

use std::sync::Arc;

pub use super::components::Components;
use super::load::{Domain, Load};
pub use super::places::Support;
use super::region::Region;
use crate::mesh::Facet;
use crate::mesh::boundary::BoundaryFacet;
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

/// What is prescribed.
#[derive(Clone, Debug, PartialEq)]
pub enum Prescribed<const D: usize> {
    /// Displacement.
    Displacement(Support<D>),
    /// Velocity, in a scene that moves; the displacement begins with the one at time zero.
    Velocity(Support<D>),
    /// Displacement as a function of position; the components of the condition are not used.
    Field(Field<D>),
    /// A load, of which the components are the values.
    Load(Load<D>),
    /// Springs to the ground; the components of the condition are not used.
    Spring(Bedding<D>),
}

/// What springs hold, and how stiff they are.
#[derive(Clone, Debug, PartialEq)]
pub enum Bedding<const D: usize> {
    /// Facets.
    Axes {
        /// The facets.
        facets: Vec<Facet>,
        /// Force per area and displacement along each axis \[N/m³\].
        stiffness: Vector<D>,
    },
    /// Facets at the boundary of the mesh, along their normals.
    Normal {
        /// The facets.
        facets: Vec<BoundaryFacet>,
        /// Force per area and displacement \[N/m³\].
        stiffness: f64,
    },
    /// Cells whose centroid lies in a region.
    Inside {
        /// The region.
        region: Region<D>,
        /// Force per volume and displacement along each axis \[N/m⁴\].
        stiffness: Vector<D>,
    },
}

impl<const D: usize> Condition<D> {
    /// The sites that the condition holds, if it prescribes how they move.
    pub fn support(&self) -> Option<&Support<D>> {
        match &self.prescribed {
            Prescribed::Displacement(support) | Prescribed::Velocity(support) => Some(support),
            Prescribed::Field(_) | Prescribed::Load(_) | Prescribed::Spring(_) => None,
        }
    }

    /// The load, if the condition is one.
    pub fn load(&self) -> Option<&Load<D>> {
        match &self.prescribed {
            Prescribed::Load(load) => Some(load),
            Prescribed::Displacement(_)
            | Prescribed::Velocity(_)
            | Prescribed::Field(_)
            | Prescribed::Spring(_) => None,
        }
    }

    /// The springs, if the condition is some.
    pub fn springs(&self) -> Option<&Bedding<D>> {
        match &self.prescribed {
            Prescribed::Spring(bedding) => Some(bedding),
            Prescribed::Displacement(_)
            | Prescribed::Velocity(_)
            | Prescribed::Field(_)
            | Prescribed::Load(_) => None,
        }
    }

    /// Whether the condition prescribes how sites move.
    pub fn holds(&self) -> bool {
        match &self.prescribed {
            Prescribed::Displacement(_) | Prescribed::Velocity(_) | Prescribed::Field(_) => true,
            Prescribed::Load(_) | Prescribed::Spring(_) => false,
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

    /// Whether the force of a load differs from place to place.
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

/// A condition of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition<const D: usize> {
    /// Its name.
    pub name: String,
    /// What and where.
    pub prescribed: Prescribed<D>,
    /// How much.
    pub components: Components<D>,
}
