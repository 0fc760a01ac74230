//! A square plate of cells of edge 1, each with points of one level or none: the grid of a refinement, and the body that it makes.

use crate::{
    enclosed::{Law, MESH},
    meshes::{gmsh, scene},
    typed,
};
use bondline::{
    mesh::generate::{Axis, Grid},
    peridynamics::Micromodulus,
    system::LinearMotion,
    tensor::Vector,
};

/// Parameters that all grids of a plate have in common.
///
/// Density and `C_1111` are 1, and Poisson's ratio that of bonds, so that a wave of pressure has the speed 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Plate {
    /// Half of the edge, in cells.
    pub half: usize,
    /// Points of each level along the edge of a cell, rising from 1.
    pub levels: Vec<u32>,
    /// Horizon over spacing.
    pub m: f64,
    /// Half of the length of a crack along x in the middle, if there is one. It must not reach a layer of elements.
    pub crack: Option<f64>,
}

/// A body: where its sites are, and how they move.
#[derive(Clone, Debug)]
pub struct Body {
    /// Positions of the sites: points, and nodes of the elements between lattices.
    pub positions: Vec<Vector<2>>,
    /// Stiffness and masses.
    pub motion: LinearMotion,
}

impl Plate {
    /// Cells along an edge.
    pub fn cells(&self) -> usize {
        2 * self.half
    }

    /// Distance of neighbouring points of a level.
    pub fn spacing(&self, level: usize) -> f64 {
        1.0 / f64::from(self.levels[level])
    }

    /// The cell about a place, its column first; the nearest one for a place outside.
    pub fn cell_at(&self, x: &Vector<2>) -> [usize; 2] {
        let last = self.cells() - 1;
        std::array::from_fn(|i| ((x[i] + self.half as f64).floor().max(0.0) as usize).min(last))
    }

    /// The number of a cell in lists of levels.
    pub fn index(&self, [i, j]: [usize; 2]) -> usize {
        j * self.cells() + i
    }

    /// Cells with a corner in common with a cell, itself among them.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        let n = self.cells();
        let range = move |k: usize| k.saturating_sub(1)..(k + 2).min(n);
        range(cell / n).flat_map(move |j| range(cell % n).map(move |i| self.index([i, j])))
    }

    /// Returns true if a cell is an element: it touches one of a finer level.
    pub fn is_layer(&self, levels: &[u8], cell: usize) -> bool {
        self.around(cell).any(|c| levels[c] > levels[cell])
    }

    /// Levels for the places where the wave is: level k within `padding` horizons of level k − 1 of any marked cell.
    pub fn levels_about(&self, marked: &[usize], padding: f64) -> Vec<u8> {
        let n = self.cells();
        let mut levels = vec![0; n * n];
        for level in 1..self.levels.len() {
            let reach = padding * self.m * self.spacing(level - 1);
            let steps = reach.ceil() as usize;
            for &cell in marked {
                let (i, j) = (cell % n, cell / n);
                let range = |k: usize| k.saturating_sub(steps)..(k + steps + 1).min(n);
                for b in range(j) {
                    for a in range(i) {
                        let square = (a.abs_diff(i).pow(2) + b.abs_diff(j).pow(2)) as f64;
                        if square <= reach * reach * (1.0 + 1e-9) {
                            levels[self.index([a, b])] = level as u8;
                        }
                    }
                }
            }
        }
        levels
    }

    /// The body of cells of these levels, from a scene: levels and the layers between them are drawn by sets of cells.
    ///
    /// # Errors
    /// The reason why the scene or its model is refused, as text.
    pub fn body(&self, levels: &[u8]) -> Result<Body, String> {
        let half = self.half as f64;
        // a level whose cells are all elements has no lattice
        let mut used: Vec<u8> = (0..levels.len())
            .filter(|&c| !self.is_layer(levels, c))
            .map(|c| levels[c])
            .collect();
        used.sort_unstable();
        used.dedup();
        let sizes: Vec<[f64; 2]> = used
            .iter()
            .map(|&level| self.spacing(usize::from(level)))
            .map(|spacing| [spacing, self.m * spacing])
            .collect();
        let [spacing, horizon] = sizes[0];
        let names: Vec<String> = used.iter().map(|level| format!("level-{level}")).collect();
        let (coupling, mesh, zones, file) = match used[..] {
            [_] => {
                let mesh = typed::grid([-half; 2], [half; 2], [self.cells(); 2]);
                ("nonlocal", mesh, String::new(), None)
            }
            _ => {
                let sets: Vec<String> = (names.iter())
                    .map(|name| format!("{{ set = \"{name}\" }}"))
                    .collect();
                let mut zones = format!("[zones]\nnonlocal.any = [{}]\n", sets.join(", "));
                for ((name, set), [spacing, horizon]) in names.iter().zip(&sets).zip(&sizes).skip(1)
                {
                    zones += &format!(
                        "[zones.bodies.{name}]\ninside = {set}\nspacing = {spacing:?}\nhorizon = {horizon:?}\n"
                    );
                }
                let mesh = format!("[mesh.file]\npath = \"{MESH}\"\n");
                ("truncated", mesh, zones, Some(self.file(levels, &used)?))
            }
        };
        let crack = self.crack.map_or(String::new(), |half| {
            format!(
                "[cracks.c]\nsegment = {{ from = [{:?}, 0], to = [{half:?}, 0] }}\n",
                -half
            )
        });
        // C_1111 = 1 where λ = μ
        let material = typed::material(
            Law::BondBased(Micromodulus::InverseDistance),
            5.0 / 6.0,
            0.25,
        );
        let text = format!(
            "kinematics = \"plane-strain\"\ncoupling = \"{coupling}\"\n{mesh}{material}[peridynamics]\nhorizon = {horizon:?}\npoints.lattice = {{ spacing = {spacing:?}, origin = {} }}\n{zones}{crack}{}",
            typed::place([0.5 * spacing; 2]),
            typed::FREE
        );
        let files: Vec<(&str, &str)> = file.iter().map(|f| (MESH, f.as_str())).collect();
        let laid = scene::model::<2>(&text, &files).map_err(|e| e.to_string())?;
        Ok(Body {
            positions: laid.model.sites.iter().map(|s| s.position).collect(),
            motion: laid.motion().map_err(|e| e.to_string())?,
        })
    }

    /// The mesh, with a set for the points of each level that is used.
    fn file(&self, levels: &[u8], used: &[u8]) -> Result<String, String> {
        let half = self.half as f64;
        let grid = Grid::<2>::new(std::array::from_fn(|_| Axis::Uniform {
            min: -half,
            max: half,
            cells: self.cells(),
        }));
        let mesh = grid.mesh().map_err(|e| e.to_string())?;
        let names: Vec<String> = used.iter().map(|level| format!("level-{level}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        Ok(gmsh::of_mesh(&mesh, &names, |c| {
            let cell = self.index(self.cell_at(&mesh.centroid(c)));
            match self.is_layer(levels, cell) {
                true => None,
                false => used.iter().position(|&level| level == levels[cell]),
            }
        }))
    }
}

impl Body {
    /// Elastic and kinetic energy of each site; bonds give half of theirs to either end.
    ///
    /// Shapes: `u`, `v` have two entries per site. Their sum is `½ uᵀKu + ½ vᵀMv`, since the rows of K add up to zero.
    pub fn energies(&self, u: &[f64], v: &[f64]) -> Vec<f64> {
        let at = |i: usize| Vector::<2>::new(u[2 * i], u[2 * i + 1]);
        (0..self.positions.len())
            .map(|i| {
                let here = at(i);
                let (columns, blocks) = self.motion.stiffness.row(i);
                let mut elastic = 0.0;
                for (&j, k) in columns.iter().zip(blocks.chunks_exact(4)) {
                    let d = at(j as usize) - here;
                    elastic -=
                        d[0] * (k[0] * d[0] + k[1] * d[1]) + d[1] * (k[2] * d[0] + k[3] * d[1]);
                }
                let speed = v[2 * i] * v[2 * i] + v[2 * i + 1] * v[2 * i + 1];
                0.25 * elastic + 0.5 * self.motion.mass[i] * speed
            })
            .collect()
    }

    /// Momentum of the sites right of the middle.
    pub fn momentum_of_right_half(&self, v: &[f64]) -> Vector<2> {
        let mut sum = Vector::zeros();
        for ((x, m), v) in self
            .positions
            .iter()
            .zip(&self.motion.mass)
            .zip(v.chunks_exact(2))
        {
            if x[0] > 0.0 {
                sum += *m * Vector::<2>::new(v[0], v[1]);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plate() -> Plate {
        Plate {
            half: 9,
            levels: vec![1, 2, 4],
            m: 2.0,
            crack: None,
        }
    }

    #[test]
    fn levels_are_nested_by_the_horizon_that_is_refined() {
        let plate = plate();
        // one cell; two horizons of level 0 are 4 cells, of level 1 two
        let middle = plate.index([9, 9]);
        let levels = plate.levels_about(&[middle], 2.0);
        for (offset, level) in [(0, 2), (2, 2), (3, 1), (4, 1), (5, 0)] {
            assert_eq!(levels[plate.index([9 + offset, 9])], level, "{offset}");
            assert_eq!(levels[plate.index([9, 9 - offset])], level, "{offset}");
        }
        // 3² + 3² is beyond 4², so level 0, and next to level 1 an element
        let corner = plate.index([12, 12]);
        assert!(levels[corner] == 0 && plate.is_layer(&levels, corner));
        assert!(!plate.is_layer(&levels, plate.index([17, 9])));
    }

    #[test]
    fn nested_lattices_are_exact_for_affine_fields_and_symmetric() {
        let plate = plate();
        let middle = [plate.index([8, 8]), plate.index([10, 9])];
        let body = plate.body(&plate.levels_about(&middle, 1.5)).unwrap();
        assert!(body.motion.stiffness.asymmetry() < 1e-14);
        // the masses are those of the cells
        let mass: f64 = body.motion.mass.iter().sum();
        assert!((mass - 18.0 * 18.0).abs() < 1e-9, "{mass}");
        let u: Vec<f64> = body
            .positions
            .iter()
            .flat_map(|x| [0.3 * x[0] - 0.2 * x[1], 0.1 * x[0] + 0.7 * x[1]])
            .collect();
        let force = body.motion.stiffness.multiply(&u);
        let mut inside = 0;
        for (x, f) in body.positions.iter().zip(force.chunks_exact(2)) {
            if x.amax() < 7.0 {
                assert!(f[0].abs().max(f[1].abs()) < 1e-12, "{x} {f:?}");
                inside += 1;
            }
        }
        assert!(inside > 300);
    }

    #[test]
    fn energies_of_sites_add_up_to_that_of_the_body() {
        let plate = plate();
        let body = plate
            .body(&plate.levels_about(&[plate.index([9, 9])], 1.5))
            .unwrap();
        let field = |a: f64, b: f64| -> Vec<f64> {
            body.positions
                .iter()
                .flat_map(|x| [(a * x[0]).sin(), (b * x[1] + x[0]).cos()])
                .collect()
        };
        let (u, v) = (field(0.3, 0.2), field(0.5, -0.4));
        let mut wanted = bondline::system::SemiDiscrete::stored_energy(&body.motion, &u);
        for (m, v) in body.motion.mass.iter().zip(v.chunks_exact(2)) {
            wanted += 0.5 * m * (v[0] * v[0] + v[1] * v[1]);
        }
        let sum: f64 = body.energies(&u, &v).iter().sum();
        assert!((sum / wanted - 1.0).abs() < 1e-12, "{sum} {wanted}");
    }
}
