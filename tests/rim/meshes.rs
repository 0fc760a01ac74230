//! Meshes whose inner nodes lie anywhere: a grid of boxes, its inner nodes moved at random, each box cut into simplices or left as it is.

use std::collections::BTreeMap;

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

    /// Nodes of the grid; inner ones are moved by up to a part of an edge along each axis.
    fn nodes(&self, reach: f64, random: &mut Random) -> Vec<[f64; 3]> {
        let counts = self.counts();
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

    /// The mesh in simplices, with its sides and its surface as sets of facets; inner nodes are moved by up to a quarter of an edge, a seventh in solids.
    pub fn mesh(&self) -> MeshParts {
        let mut random = Random::new(self.seed);
        let points = self.nodes([0.25, 0.25, 0.14][D - 1], &mut random);
        let mut cells = Vec::new();
        for number in 0..self.counts().iter().product() {
            // in a plane each box has a diagonal of its own; tetrahedra have to meet
            let is_mirrored = D == 2 && random.unit() < 0.5;
            self.cut_box(number, is_mirrored, &mut cells);
        }
        let (facets, element_sets) = self.sides(&points, &facets_of(&cells, &left_out::<D>()));
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

    /// The mesh in quadrilaterals or hexahedra, of which a part is cut into triangles, with its sides and its surface as sets of facets, inner nodes moved by up to `reach` of an edge.
    pub fn boxes(&self, reach: f64, triangles: f64) -> MeshParts {
        let mut random = Random::new(self.seed);
        let points = self.nodes(reach, &mut random);
        let (mut whole, mut cut) = (Vec::new(), Vec::new());
        for number in 0..self.counts().iter().product() {
            match random.unit() < triangles {
                true => self.cut_box(number, false, &mut cut),
                false => {
                    let corners = [0, 1, 3, 2, 4, 5, 7, 6].into_iter().take(1 << D);
                    whole.extend(corners.map(|bits| self.corner(number, bits)));
                }
            }
        }
        let around: &[&[usize]] = match D {
            2 => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
            _ => &[
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
                &[0, 1, 5, 4],
                &[1, 2, 6, 5],
                &[2, 3, 7, 6],
                &[3, 0, 4, 7],
            ],
        };
        let around: Vec<Vec<usize>> = around.iter().map(|facet| facet.to_vec()).collect();
        let mut all: Vec<Vec<u64>> = (whole.chunks_exact(1 << D))
            .flat_map(|cell| facets_of(cell, &around))
            .collect();
        all.extend(facets_of(&cut, &left_out::<D>()));
        let (facets, element_sets) = self.sides(&points, &all);
        let shapes = match D {
            2 => [CellShape::Line2, CellShape::Quad4, CellShape::Tri3],
            _ => [CellShape::Quad4, CellShape::Hex8, CellShape::Tet4],
        };
        let blocks = shapes.into_iter().zip([facets, whole, cut]);
        MeshParts {
            name: "body".into(),
            points,
            blocks: blocks.filter(|block| !block.1.is_empty()).collect(),
            element_sets,
            point_sets: Vec::new(),
        }
    }

    /// The node at a corner of a box, whose bits say on which side of the box it lies along each axis.
    fn corner(&self, number: usize, bits: usize) -> u64 {
        let counts = self.counts();
        let (mut rest, mut stride, mut node) = (number, 1, 0);
        for (i, count) in counts.into_iter().enumerate() {
            node += (rest % count + (bits >> i & 1)) * stride;
            rest /= count;
            stride *= count + 1;
        }
        node as u64
    }

    /// Cuts a box into simplices from its lowest corner to its highest, one for each order of the axes.
    fn cut_box(&self, number: usize, is_mirrored: bool, cells: &mut Vec<u64>) {
        let node = |bits: usize| self.corner(number, bits ^ usize::from(is_mirrored));
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
    fn sides(&self, points: &[[f64; 3]], all: &[Vec<u64>]) -> (Vec<u64>, Vec<(String, Vec<u64>)>) {
        let (mut facets, mut count) = (Vec::new(), 0);
        let mut of_side = vec![Vec::new(); 2 * D];
        for facet in all {
            for (side, own) in of_side.iter_mut().enumerate() {
                let plane = [0.0, self.size[side / 2]][side % 2];
                let is_on = |n: &u64| (points[*n as usize][side / 2] - plane).abs() < 1e-12;
                if D > 1 && facet.iter().all(is_on) {
                    own.push(count);
                    facets.extend(facet);
                    count += 1;
                }
            }
        }
        let sides = SIDES.iter().map(|s| (*s).to_owned()).zip(of_side);
        let sets = sides.chain([(SURFACE.to_owned(), (0..count).collect())]);
        (facets, if D > 1 { sets.collect() } else { Vec::new() })
    }
}

/// The places of all nodes of a simplex but one, for each.
fn left_out<const D: usize>() -> Vec<Vec<usize>> {
    (0..=D)
        .map(|out| (0..=D).filter(|&k| k != out).collect())
        .collect()
}

/// Facets of cells of one shape, by the places of their nodes.
fn facets_of(cells: &[u64], places: &[Vec<usize>]) -> Vec<Vec<u64>> {
    let nodes = 1 + places.iter().flatten().max().copied().unwrap_or(0);
    (cells.chunks_exact(nodes))
        .flat_map(|cell| {
            let facet = |places: &Vec<usize>| places.iter().map(|&k| cell[k]).collect();
            places.iter().map(facet).collect::<Vec<Vec<u64>>>()
        })
        .collect()
}

/// The mesh with a node in the middle of each side of its cells and facets; in the plane inner ones lie beside the middle by up to `reach` of the side.
pub fn raised(mesh: MeshParts, reach: f64, random: &mut Random) -> MeshParts {
    let outer: Vec<[u64; 2]> = (mesh.blocks[0].1.chunks_exact(2))
        .map(|side| [side[0].min(side[1]), side[0].max(side[1])])
        .collect();
    let mut points = mesh.points;
    let mut middle: BTreeMap<[u64; 2], u64> = BTreeMap::new();
    let mut blocks = Vec::new();
    for (shape, nodes) in &mesh.blocks {
        let raised = shape.quadratic();
        let mut all = Vec::new();
        for cell in nodes.chunks_exact(shape.node_count()) {
            all.extend(cell);
            for &[p, q] in raised.mid_sides() {
                let (p, q) = (cell[p], cell[q]);
                let ends = [p.min(q), p.max(q)];
                all.push(*middle.entry(ends).or_insert_with(|| {
                    let [a, b] = ends.map(|n| points[n as usize]);
                    let off = if outer.contains(&ends) { 0.0 } else { reach };
                    let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
                    let [s, t] = [(); 2].map(|()| off * random.within(-1.0, 1.0));
                    points.push([
                        0.5 * (a[0] + b[0]) + s * dx - t * dy,
                        0.5 * (a[1] + b[1]) + s * dy + t * dx,
                        0.5 * (a[2] + b[2]),
                    ]);
                    points.len() as u64 - 1
                }));
            }
        }
        blocks.push((raised, all));
    }
    MeshParts {
        points,
        blocks,
        ..mesh
    }
}
