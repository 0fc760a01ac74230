//! Scenes made by a program: the content of a scene file, in Rust.
//!
//! A [`SceneBuilder`] collects the keys of a scene (`docs/scene.md` has them all) and makes a [`Source`] of them. The same types read it that read a file, and the same
//! checks follow, so every key and every message of a scene file is one of the builder too; messages name keys as places. Common keys have methods, [`SceneBuilder::set`] sets any other.
//! Numbers that may vary are [`Value`]s: numbers, expressions as text, or [`Function`]s.
//!
//! | file | content |
//! |---|---|
//! | `value.rs` | values and tables of them |
//! | `parts.rs` | materials, regions, conditions, fields at time zero, impactors |

mod parts;
mod value;

pub use parts::{Condition, Impactor, Initial, Material, Region};
pub use value::{Entries, Value};

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::function::Function;
use super::source::Source;
use crate::mesh::MeshParts;

/// A scene that is put together by a program.
///
/// Methods take whatever a scene file takes and check nothing: [`SceneBuilder::scene`] does, and its error names the key at fault.
#[derive(Clone, Debug)]
pub struct SceneBuilder {
    name: String,
    directory: PathBuf,
    keys: Entries,
    mesh: Option<Arc<MeshParts>>,
}

impl SceneBuilder {
    fn new(kinematics: &str, name: &str) -> Self {
        let mut keys = Entries::default();
        keys.set("kinematics", kinematics);
        Self {
            name: name.to_owned(),
            directory: PathBuf::new(),
            keys,
            mesh: None,
        }
    }

    /// A bar: one dimension, uniaxial stress. Files are called `name`.
    pub fn bar(name: &str) -> Self {
        Self::new("bar", name)
    }

    /// A thin plate. Files are called `name`.
    pub fn plane_stress(name: &str) -> Self {
        Self::new("plane-stress", name)
    }

    /// A long body. Files are called `name`.
    pub fn plane_strain(name: &str) -> Self {
        Self::new("plane-strain", name)
    }

    /// A solid. Files are called `name`.
    pub fn solid(name: &str) -> Self {
        Self::new("solid", name)
    }

    /// Sets any key of a scene file, with dots between tables: `"solver.tolerance"`. A value that stands there is replaced.
    pub fn set(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.keys.set(key, value);
        self
    }

    /// Folder from which relative paths start; the working directory if left out.
    pub fn directory(mut self, directory: impl AsRef<Path>) -> Self {
        directory.as_ref().clone_into(&mut self.directory);
        self
    }

    /// A line from `min` to `max` in equal cells, with the facet sets `left` and `right`.
    pub fn line(self, min: f64, max: f64, cells: usize) -> Self {
        self.grid("mesh.line", &[min], &[max], &[cells])
    }

    /// A rectangle in equal cells along each axis, with the facet sets `left`, `right`, `bottom` and `top`.
    pub fn rectangle(self, min: [f64; 2], max: [f64; 2], cells: [usize; 2]) -> Self {
        self.grid("mesh.rectangle", &min, &max, &cells)
    }

    /// A box in equal cells along each axis, with the facet sets `left`, `right`, `bottom`, `top`, `back` and `front`.
    pub fn cuboid(self, min: [f64; 3], max: [f64; 3], cells: [usize; 3]) -> Self {
        self.grid("mesh.box", &min, &max, &cells)
    }

    fn grid(mut self, key: &str, min: &[f64], max: &[f64], cells: &[usize]) -> Self {
        self.keys.set(&format!("{key}.min"), min.to_vec());
        self.keys.set(&format!("{key}.max"), max.to_vec());
        for (axis, &n) in ["x", "y", "z"].iter().zip(cells) {
            self.keys.set(&format!("{key}.{axis}.cells"), n);
        }
        self
    }

    /// A mesh from a file of Gmsh, Abaqus, CalculiX or VTK.
    pub fn mesh_file(self, path: &str) -> Self {
        self.set("mesh.file.path", path)
    }

    /// A mesh in memory.
    pub fn mesh(mut self, mesh: MeshParts) -> Self {
        self.mesh = Some(Arc::new(mesh));
        self
    }

    /// A material.
    pub fn material(mut self, name: &str, material: Material) -> Self {
        self.keys.insert("materials", name, material.entries);
        self
    }

    /// The horizon of the peridynamic points.
    pub fn horizon(self, horizon: impl Into<Value>) -> Self {
        self.set("peridynamics.horizon", horizon)
    }

    /// The distance of neighbouring points of a lattice.
    pub fn spacing(self, spacing: impl Into<Value>) -> Self {
        self.set("peridynamics.points.lattice.spacing", spacing)
    }

    /// Sets the nonlocal zone, in which the body is peridynamic; elsewhere it is of finite elements.
    pub fn nonlocal(self, region: Region) -> Self {
        self.set("zones.nonlocal", region.entries)
    }

    /// Sets the transition zone, in which both models overlap.
    pub fn transition(self, region: Region) -> Self {
        self.set("zones.transition", region.entries)
    }

    /// Leaves the nonlocal zone to the program.
    pub fn automatic_zone(self) -> Self {
        self.set("zones", "auto")
    }

    /// Sets the coupling of the models by name: `"splice"`, `"truncated"`, … Options of a coupling are keys, `.set("coupling.blending.beta", "smooth")`.
    pub fn coupling(self, name: &str) -> Self {
        self.set("coupling", name)
    }

    /// A surface without thickness that cuts the bonds across it.
    pub fn crack(mut self, name: &str, region: Region) -> Self {
        self.keys.insert("cracks", name, region.entries);
        self
    }

    /// An empty region.
    pub fn void(mut self, name: &str, region: Region) -> Self {
        let mut void = Entries::default();
        void.set("inside", region.entries);
        self.keys.insert("voids", name, void);
        self
    }

    /// A region in which no bond breaks.
    pub fn no_fail(mut self, name: &str, region: Region) -> Self {
        self.keys.insert("no-fail", name, region.entries);
        self
    }

    /// A displacement, a velocity or a load.
    pub fn condition(mut self, name: &str, condition: Condition) -> Self {
        self.keys.insert("conditions", name, condition.entries);
        self
    }

    /// A displacement or a velocity at time zero.
    pub fn initial(mut self, name: &str, initial: Initial) -> Self {
        self.keys.insert("initial", name, initial.entries);
        self
    }

    /// A rigid body that strikes or presses.
    pub fn impactor(mut self, name: &str, impactor: Impactor) -> Self {
        self.keys.insert("impactors", name, impactor.entries);
        self
    }

    /// Computes a motion of this duration by explicit steps.
    pub fn explicit(self, duration: f64) -> Self {
        self.set("solve.explicit.duration", duration)
    }

    /// Computes states of equilibrium under a load that grows in so many steps, while t goes from 0 to 1.
    pub fn load_steps(self, steps: usize) -> Self {
        self.set("solve.quasi-static.steps", steps)
    }

    /// Adds a point at which the solution is written: the table `probes`, or columns of the history.
    pub fn probe(mut self, name: &str, at: impl Into<Value>) -> Self {
        let mut probe = Entries::default();
        probe.set("at", at);
        self.keys.insert("output.probes", name, probe);
        self
    }

    /// Returns the name of the scene.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The folder from which relative paths start.
    pub fn folder(&self) -> &Path {
        &self.directory
    }

    /// The scene as the library reads it: its keys as one table, with its functions and its mesh in memory.
    pub fn source(&self) -> Source {
        let mut functions: Vec<Function> = Vec::new();
        let table = self.keys.table(&mut functions);
        let source = Source::built(self.name.clone(), &table, functions);
        match &self.mesh {
            Some(mesh) => source.with_mesh(Arc::clone(mesh)),
            None => source,
        }
    }
}
