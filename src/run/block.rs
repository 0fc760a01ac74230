//! A block whose peridynamic core is enclosed by elements, from a scene, for unit tests.

use std::path::Path;

use super::{AnyScene, SceneModel};
use crate::mesh::generate::{Axis, Grid};
use crate::scene::Source;

/// Spacing of the lattice \[m\].
const SPACING: f64 = 0.01;

/// Definition of a test block; lengths in spacings.
pub struct Block<'a> {
    /// As a scene types it.
    pub coupling: &'a str,
    /// The kind of material, and its further keys.
    pub material: [&'a str; 2],
    /// A line of `[peridynamics]`.
    pub influence: &'a str,
    /// Size of the elements.
    pub size: u32,
    /// Triangles whose inner nodes are moved by up to a tenth of their size, instead of boxes.
    pub has_triangles: bool,
    /// Half the core, width of the transition zone, width of the elements outside.
    pub widths: [u32; 3],
    /// m.
    pub ratio: u32,
    /// The point of the lattice next to the middle.
    pub origin: f64,
}

impl Block<'_> {
    /// Its model; it asserts that the scene is right.
    pub fn model<const D: usize>(&self) -> SceneModel<D> {
        let [core, transition, local] = self.widths;
        let total = core + transition + local;
        let length = |spacings: f64| spacings * SPACING;
        let half = length(f64::from(total));
        let cells = (2 * total).div_ceil(self.size) as usize;
        let cube = |spacings: u32| {
            let edge = length(f64::from(spacings));
            format!(
                "{{ box = {{ min = {:?}, max = {:?} }} }}",
                [-edge; D], [edge; D]
            )
        };
        let axes: String = (["x", "y", "z"].iter().take(D))
            .map(|axis| format!("{axis}.cells = {cells}\n"))
            .collect();
        let around = match transition {
            0 => String::new(),
            _ => format!("transition = {}\n", cube(core + transition)),
        };
        let [law, keys] = self.material;
        let text = format!(
            "kinematics = \"{}\"\ncoupling = {}\n[mesh.{}]\nmin = {:?}\nmax = {:?}\n{axes}{}[materials.m.{law}]\nyoungs-modulus = 2e11\ndensity = 1\n{keys}[peridynamics]\nhorizon = {:?}\npoints.lattice = {{ spacing = {SPACING}, origin = {:?} }}\n{}[zones]\nnonlocal = {}\n{around}[solve.explicit]\nduration = 1\n",
            ["bar", "plane-strain", "solid"][D - 1],
            self.coupling,
            ["line", "rectangle", "box"][D - 1],
            [-half; D],
            [half; D],
            if self.has_triangles {
                "cell = \"tri3\"\n"
            } else {
                ""
            },
            length(f64::from(self.ratio)),
            [length(self.origin); D],
            self.influence,
            cube(core),
        );
        let scene =
            AnyScene::from_source(&Source::new("block.toml", text), Path::new("."), "block")
                .expect("a scene");
        let mut scene = scene.of_dimension::<D>().expect("of this dimension");
        if self.has_triangles {
            let mut grid = Grid::<D>::new(std::array::from_fn(|_| Axis::Uniform {
                min: -half,
                max: half,
                cells,
            }));
            let grid = grid.simplices().jitter(0.1, 7);
            scene.mesh = grid.mesh().expect("a mesh");
        }
        SceneModel::new(scene).expect("a model")
    }
}
