//! The named parts of a scene: materials, regions, conditions, fields at time zero, impactors.

use super::value::{Entries, Value, list};

/// A part whose keys stand in a table named for its kind.
macro_rules! part {
    ($($(#[$doc:meta])* $name:ident;)+) => {$(
        $(#[$doc])*
        #[derive(Clone, Debug)]
        pub struct $name {
            /// Its kind, with the keys of that.
            pub(super) entries: Entries,
            kind: String,
        }

        impl $name {
            /// One of a kind that has no method here, by its key in a scene file.
            pub fn of(kind: &str) -> Self {
                let mut entries = Entries::default();
                entries.set(kind, Entries::default());
                Self { entries, kind: kind.to_owned() }
            }

            /// Sets any of its keys.
            pub fn set(mut self, key: &str, value: impl Into<Value>) -> Self {
                self.entries.set(&format!("{}.{key}", self.kind), value);
                self
            }
        }
    )+};
}

part! {
    /// A material. Kinds without a method are made by [`Material::of`], their constants set by [`Material::set`].
    Material;
    /// A displacement, a velocity or a load. Kinds without a method are made by [`Condition::of`], their keys set by [`Condition::set`].
    Condition;
    /// A displacement or a velocity at time zero.
    Initial;
}

impl Material {
    /// Bonds that act alone; Poisson's ratio is 1/3 in plane stress, 1/4 in plane strain and solids.
    pub fn bond_based(youngs_modulus: f64) -> Self {
        Self::of("bond-based").set("youngs-modulus", youngs_modulus)
    }

    /// A linear peridynamic solid.
    pub fn lps(youngs_modulus: f64, poisson_ratio: f64) -> Self {
        Self::elastic("lps", youngs_modulus, poisson_ratio)
    }

    /// Elastic correspondence.
    pub fn correspondence(youngs_modulus: f64, poisson_ratio: f64) -> Self {
        Self::elastic("correspondence", youngs_modulus, poisson_ratio)
    }

    /// Orthotropic finite elements: Young's moduli E₁, E₂, E₃, Poisson's ratios ν₁₂, ν₁₃, ν₂₃, shear moduli G₁₂, G₁₃, G₂₃. Its axes are set as `angle`, or as `axis-1` and `axis-2`.
    pub fn orthotropic(young: [f64; 3], poisson: [f64; 3], shear: [f64; 3]) -> Self {
        let keys = [
            "e1", "e2", "e3", "nu12", "nu13", "nu23", "g12", "g13", "g23",
        ];
        let values = young.into_iter().chain(poisson).chain(shear);
        (keys.into_iter().zip(values)).fold(Self::of("orthotropic"), |m, (key, x)| m.set(key, x))
    }

    fn elastic(kind: &str, youngs_modulus: f64, poisson_ratio: f64) -> Self {
        Self::of(kind)
            .set("youngs-modulus", youngs_modulus)
            .set("poisson-ratio", poisson_ratio)
    }

    /// Its density ρ.
    pub fn density(self, density: f64) -> Self {
        self.set("density", density)
    }

    /// Energy per area of a new crack.
    pub fn fracture_energy(self, energy: f64) -> Self {
        self.set("fracture-energy", energy)
    }

    /// Stretch at which a bond breaks.
    pub fn critical_stretch(self, stretch: f64) -> Self {
        self.set("critical-stretch", stretch)
    }

    /// The cells that it fills; one of several materials may leave them out.
    pub fn cells(self, region: Region) -> Self {
        self.set("cells", region.entries)
    }
}

/// Sets the place on which a condition acts.
fn place(part: Condition, region: Region) -> Condition {
    match region.set_name {
        Some(name) => part.set("on", name),
        None => part.set("inside", region.entries),
    }
}

impl Condition {
    /// Prescribes displacements on a set of the mesh, or inside a shape.
    pub fn displacement(on: impl Into<Region>) -> Self {
        place(Self::of("displacement"), on.into())
    }

    /// Prescribes velocities on a set of the mesh, or inside a shape.
    pub fn velocity(on: impl Into<Region>) -> Self {
        place(Self::of("velocity"), on.into())
    }

    /// A force per area on a set of facets.
    pub fn traction(on: &str) -> Self {
        Self::of("traction").set("on", on)
    }

    /// A force per volume, everywhere.
    pub fn body_force() -> Self {
        Self::of("body-force")
    }

    /// Acts inside a shape only.
    pub fn inside(self, region: Region) -> Self {
        self.set("inside", region.entries)
    }
}

impl Initial {
    /// Displacements at time zero, everywhere.
    pub fn displacement() -> Self {
        Self::of("displacement")
    }

    /// Velocities at time zero, everywhere.
    pub fn velocity() -> Self {
        Self::of("velocity")
    }

    /// Inside a shape only.
    pub fn inside(self, region: Region) -> Self {
        self.set("inside", region.entries)
    }
}

/// Components of a vector.
macro_rules! components {
    ($($name:ident),+) => {$(
        impl $name {
            /// The component along x.
            pub fn x(self, value: impl Into<Value>) -> Self {
                self.set("x", value)
            }

            /// The component along y.
            pub fn y(self, value: impl Into<Value>) -> Self {
                self.set("y", value)
            }

            /// The component along z.
            pub fn z(self, value: impl Into<Value>) -> Self {
                self.set("z", value)
            }
        }
    )+};
}

components!(Condition, Initial);

/// A rigid body that strikes or presses. Its motion is set by keys: `.set("velocity.y", -10.0)`, `.set("displacement.y", "-0.1 * t")`.
#[derive(Clone, Debug)]
pub struct Impactor {
    pub(super) entries: Entries,
}

impl Impactor {
    fn of(shape: Entries, kind: &str) -> Self {
        let mut entries = Entries::default();
        entries.set(kind, shape);
        Self { entries }
    }

    /// A sphere; a disc in two dimensions.
    pub fn sphere(center: impl Into<Value>, radius: impl Into<Value>) -> Self {
        let mut shape = Entries::default();
        shape.set("center", center);
        shape.set("radius", radius);
        Self::of(shape, "sphere")
    }

    /// A cylinder without ends about an axis, in three dimensions.
    pub fn cylinder(
        point: impl Into<Value>,
        direction: impl Into<Value>,
        radius: impl Into<Value>,
    ) -> Self {
        let mut shape = Entries::default();
        shape.set("point", point);
        shape.set("direction", direction);
        shape.set("radius", radius);
        Self::of(shape, "cylinder")
    }

    /// The half space behind a plane, whose normal points to the body.
    pub fn plane(point: impl Into<Value>, normal: impl Into<Value>) -> Self {
        let mut shape = Entries::default();
        shape.set("point", point);
        shape.set("normal", normal);
        Self::of(shape, "plane")
    }

    /// Lets it move freely, with this mass.
    pub fn mass(self, mass: impl Into<Value>) -> Self {
        self.set("mass", mass)
    }

    /// Sets any of its keys.
    pub fn set(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.entries.set(key, value);
        self
    }
}

/// A part of space, or a set of the mesh.
#[derive(Clone, Debug)]
pub struct Region {
    pub(super) entries: Entries,
    set_name: Option<String>,
}

impl From<&str> for Region {
    /// A set of the mesh.
    fn from(name: &str) -> Self {
        Self::set_of_mesh(name)
    }
}

impl Region {
    fn of(kind: &str, value: impl Into<Value>) -> Self {
        let mut entries = Entries::default();
        entries.set(kind, value);
        Self {
            entries,
            set_name: None,
        }
    }

    fn pair(kind: &str, [first, second]: [&str; 2], a: Value, b: Value) -> Self {
        let mut inner = Entries::default();
        inner.set(first, a);
        inner.set(second, b);
        Self::of(kind, inner)
    }

    /// A set of the mesh, by name.
    pub fn set_of_mesh(name: &str) -> Self {
        Self {
            set_name: Some(name.to_owned()),
            ..Self::of("set", name)
        }
    }

    /// A box along the axes: an interval in 1D, a rectangle in 2D.
    pub fn cuboid<const N: usize>(min: [f64; N], max: [f64; N]) -> Self {
        Self::pair("box", ["min", "max"], min.into(), max.into())
    }

    /// All points within a radius of a centre.
    pub fn ball<const N: usize>(center: [f64; N], radius: f64) -> Self {
        Self::pair("ball", ["center", "radius"], center.into(), radius.into())
    }

    /// A straight line; a crack in 2D.
    pub fn segment<const N: usize>(from: [f64; N], to: [f64; N]) -> Self {
        Self::pair("segment", ["from", "to"], from.into(), to.into())
    }

    /// Straight lines from each point to the next.
    pub fn polyline<const N: usize>(points: &[[f64; N]]) -> Self {
        Self::of("polyline", points.to_vec())
    }

    /// A closed polygon: its area in 2D, a plane surface in 3D.
    pub fn polygon<const N: usize>(points: &[[f64; N]]) -> Self {
        Self::of("polygon", points.to_vec())
    }

    /// The whole body.
    pub fn everywhere() -> Self {
        Self::of("everywhere", true)
    }

    /// All cells within a distance of the nonlocal zone; a transition zone.
    pub fn around(distance: f64) -> Self {
        Self::of("around", distance)
    }

    /// All points within a distance of this shape: a point, a segment, a polyline, a polygon or a box.
    pub fn within(self, distance: f64) -> Self {
        let mut near = self.entries;
        near.set("within", distance);
        Self::of("near", near)
    }

    /// All points of this region or another.
    pub fn or(self, other: Self) -> Self {
        Self::of("any", list(&[self.entries, other.entries]))
    }

    /// This region without another.
    pub fn without(self, other: Self) -> Self {
        let (from, removed) = (self.entries.into(), other.entries.into());
        Self::pair("without", ["from", "removed"], from, removed)
    }
}
