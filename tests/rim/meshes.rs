//! Meshes of simplices whose inner nodes lie anywhere: a grid of boxes, its inner nodes moved at random, each box cut into simplices.

use bondline::CellShape;
use bondline::mesh::MeshParts;

/// Names of the sides of a body, two along each axis.
pub const SIDES: [&str; 6] = ["left", "right", "bottom", "top", "back", "front"];

/// Name of the set of all facets of the surface.
pub const SURFACE: &str = "surface";

/// Random numbers by SplitMix64: the same on every machine.
pub struct Random(u64);

impl Random {
    /// Numbers that a seed stands for.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number between two others.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

/// A body from the origin to `size`, in boxes of about the edge `edge`.
#[derive(Clone, Copy)]
pub struct Body<const D: usize> {
    pub size: [f64; D],
    pub edge: f64,
    pub seed: u64,
}

impl<const D: usize> Body<D> {
    /// Its volume.
    pub fn volume(&self) -> f64 {
        self.size.iter().product()
    }

    /// Its middle.
    pub fn middle(&self) -> [f64; D] {
        self.size.map(|s| 0.5 * s)
    }

    fn counts(&self) -> [usize; D] {
        self.size.map(|s| (s / self.edge).round().max(1.0) as usize)
    }

    /// Nodes of the grid; inner ones are moved by up to a quarter of an edge along each axis, a seventh in solids.
    fn nodes(&self, random: &mut Random) -> Vec<[f64; 3]> {
        let counts = self.counts();
        let reach = [0.25, 0.25, 0.14][D - 1];
        let total = counts.iter().map(|n| n + 1).product();
        let node = |number: usize| {
            let mut rest = number;
            let mut x = [0.0; 3];
            let mut is_inner = true;
            for i in 0..D {
                let k = rest % (counts[i] + 1);
                rest /= counts[i] + 1;
                x[i] = self.size[i] * k as f64 / counts[i] as f64;
                is_inner &= k > 0 && k < counts[i];
            }
            for i in 0..D {
                let moved = random.within(-reach, reach) * self.size[i] / counts[i] as f64;
                x[i] += if is_inner { moved } else { 0.0 };
            }
            x
        };
        (0..total).map(node).collect()
    }

    /// The mesh in simplices, with its sides and its surface as sets of facets.
    pub fn mesh(&self) -> MeshParts {
        let mut random = Random::new(self.seed);
        let points = self.nodes(&mut random);
        let mut cells = Vec::new();
        for number in 0..self.counts().iter().product() {
            // in a plane each box has a diagonal of its own; tetrahedra have to meet
            let is_mirrored = D == 2 && random.unit() < 0.5;
            self.cut_box(number, is_mirrored, &mut cells);
        }
        let (facets, element_sets) = self.sides(&points, &cells);
        let shapes = [CellShape::Line2, CellShape::Tri3, CellShape::Tet4];
        let mut blocks = vec![(shapes[D - 1], cells)];
        if D > 1 {
            blocks.insert(0, (shapes[D - 2], facets));
        }
        let mut point_sets = Vec::new();
        if D == 1 {
            let last = points.len() as u64 - 1;
            point_sets = vec![("left".into(), vec![0]), ("right".into(), vec![last])];
        }
        MeshParts {
            name: "body".into(),
            points,
            blocks,
            element_sets,
            point_sets,
        }
    }

    /// Cuts a box into simplices from its lowest corner to its highest, one for each order of the axes.
    fn cut_box(&self, number: usize, is_mirrored: bool, cells: &mut Vec<u64>) {
        let counts = self.counts();
        let mut rest = number;
        let mut corner = [0; D];
        for i in 0..D {
            corner[i] = rest % counts[i];
            rest /= counts[i];
        }
        let node = |bits: usize| {
            let mut stride = 1;
            let mut sum = 0;
            for i in 0..D {
                let is_upper = bits >> i & 1 == 1;
                let k = usize::from(is_upper != (is_mirrored && i == 0));
                sum += (corner[i] + k) * stride;
                stride *= counts[i] + 1;
            }
            sum as u64
        };
        let orders: &[(&[usize], bool)] = match D {
            1 => &[(&[0], true)],
            2 => &[(&[0, 1], true), (&[1, 0], false)],
            _ => &[
                (&[0, 1, 2], true),
                (&[1, 0, 2], false),
                (&[0, 2, 1], false),
                (&[1, 2, 0], true),
                (&[2, 0, 1], true),
                (&[2, 1, 0], false),
            ],
        };
        for (axes, is_even) in orders {
            let mut bits = 0;
            let mut simplex = vec![node(0)];
            for axis in *axes {
                bits |= 1 << axis;
                simplex.push(node(bits));
            }
            if *is_even == is_mirrored {
                simplex.swap(D - 1, D);
            }
            cells.extend(simplex);
        }
    }

    /// Facets of the surface, and those of each side and of all by their numbers.
    fn sides(&self, points: &[[f64; 3]], cells: &[u64]) -> (Vec<u64>, Vec<(String, Vec<u64>)>) {
        let mut facets = Vec::new();
        let mut of_side = vec![Vec::new(); 2 * D];
        for simplex in cells.chunks_exact(D + 1) {
            for left_out in 0..=D {
                let facet = (0..=D).filter(|&k| k != left_out).map(|k| simplex[k]);
                let facet: Vec<u64> = facet.collect();
                for (side, own) in of_side.iter_mut().enumerate() {
                    let plane = [0.0, self.size[side / 2]][side % 2];
                    let is_on = |n: &u64| (points[*n as usize][side / 2] - plane).abs() < 1e-12;
                    if D > 1 && facet.iter().all(is_on) {
                        own.push((facets.len() / D) as u64);
                        facets.extend(&facet);
                    }
                }
            }
        }
        let all = (0..(facets.len() / D) as u64).collect();
        let sides = SIDES.iter().map(|s| (*s).to_owned()).zip(of_side);
        let sets = sides.chain([(SURFACE.to_owned(), all)]);
        (facets, if D > 1 { sets.collect() } else { Vec::new() })
    }
}
