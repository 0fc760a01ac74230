//! VTU files of scenes with a rim: they show of each element what is left of it, as another program reads them.

use std::path::Path;

use bondline::mesh::MeshParts;
use bondline::run::Frame;
use bondline::{Condition, Initial, Material, Region, SceneBuilder, Silent, Solution};
use vtkio::model::{Attribute, DataSet, Vtk};

use super::meshes::{Body, Random};
use super::{Drawn, affine, scene, zone};

/// Labels of the rim and of elements that it cuts in the field `model`.
const RIM: f64 = 3.0;
const CUT: f64 = 4.0;

const HOLED: Body<2> = Body {
    size: [18.0, 16.0],
    edge: 1.7,
    seed: 1000,
};

const SOLID: Body<3> = Body {
    size: [9.0, 8.0, 8.0],
    edge: 2.3,
    seed: 1010,
};

/// A cell of a file: its type, its corners, and its values of `model` and `volume`.
struct Cell {
    kind: u8,
    corners: Vec<[f64; 3]>,
    model: f64,
    volume: f64,
}

impl Cell {
    /// Length, area or volume by its corners; simplices in the wrong order have a negative one.
    fn size(&self) -> f64 {
        let x = &self.corners;
        let e = |i: usize| std::array::from_fn(|k| x[i][k] - x[0][k]);
        let cross = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|k| {
                a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]
            })
        };
        match self.kind {
            1 => 0.0,
            3 => e(1)[0],
            5 => 0.5 * cross(e(1), e(2))[2],
            9 => 0.5 * (cross(e(1), e(2))[2] + cross(e(2), e(3))[2]),
            10 => (0..3).map(|k| cross(e(1), e(2))[k] * e(3)[k]).sum::<f64>() / 6.0,
            // of a rim: a box along the axes
            12 => e(1)[0] * e(3)[1] * e(4)[2],
            kind => panic!("a cell of type {kind}"),
        }
    }

    /// True if it lies beyond one of the sides of a box.
    fn is_beyond(&self, low: &[f64; 3], high: &[f64; 3], dimension: usize) -> bool {
        (0..dimension).any(|i| {
            let mut along = self.corners.iter().map(|x| x[i]);
            along.clone().all(|x| x <= low[i] + 1e-9) || along.all(|x| x >= high[i] - 1e-9)
        })
    }
}

/// The cells of the file that a frame makes.
fn cells(frame: &Frame) -> Vec<Cell> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shown.vtu");
    frame.write_vtu(&path).unwrap();
    read(&path)
}

fn read(path: &Path) -> Vec<Cell> {
    let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(path).unwrap().data else {
        panic!("no cells");
    };
    let mut pieces = pieces.into_iter();
    let piece = pieces.next().unwrap();
    let piece = piece.into_loaded_piece_data(Some(path)).unwrap();
    let points: Vec<f64> = piece.points.cast_into().unwrap();
    let field = |name: &str| -> Vec<f64> {
        let mut arrays = piece
            .data
            .cell
            .iter()
            .filter_map(|attribute| match attribute {
                Attribute::DataArray(array) if array.name == name => Some(array.data.clone()),
                _ => None,
            });
        arrays.next().unwrap().cast_into().unwrap()
    };
    let (model, volume) = (field("model"), field("volume"));
    let kinds: Vec<u8> = piece.cells.types.iter().map(|&t| t as u8).collect();
    let (nodes, ends) = piece.cells.cell_verts.into_xml();
    let mut start = 0;
    let mut cells = Vec::new();
    for (c, end) in ends.into_iter().enumerate() {
        let own = nodes[start..end as usize].iter();
        let corner = |&n: &u64| std::array::from_fn(|k| points[3 * n as usize + k]);
        cells.push(Cell {
            kind: kinds[c],
            corners: own.map(corner).collect(),
            model: model[c],
            volume: volume[c],
        });
        start = end as usize;
    }
    cells
}

/// Elements are as large as the file says, and with points they fill a body of a volume.
fn assert_filled(cells: &[Cell], volume: f64) {
    let mut all = 0.0;
    for cell in cells {
        let size = cell.size();
        assert!(size > 0.0 || cell.kind == 1, "{size:e}");
        if cell.kind != 1 {
            assert!((cell.volume - size).abs() < 1e-12, "{} {size}", cell.volume);
        }
        all += if cell.kind == 1 { cell.volume } else { size };
    }
    println!("{} cells, {:e}", cells.len(), all / volume - 1.0);
    assert!((all / volume - 1.0).abs() < 1e-12, "{all} {volume}");
}

/// No element that a rim cuts reaches into it or the zone, which fill a box; returns the size of this.
fn assert_outside(cells: &[Cell], dimension: usize) -> f64 {
    let of = |label: f64| cells.iter().filter(move |cell| cell.model == label);
    let corners = || of(RIM).flat_map(|cell| &cell.corners);
    let low = corners().fold([f64::MAX; 3], |m, x| {
        std::array::from_fn(|i| m[i].min(x[i]))
    });
    let high = corners().fold([f64::MIN; 3], |m, x| {
        std::array::from_fn(|i| m[i].max(x[i]))
    });
    assert!(of(CUT).count() > 10);
    for cell in of(CUT) {
        let beyond = cell.is_beyond(&low, &high, dimension);
        assert!(beyond, "{:?} {low:?} {high:?}", cell.corners);
    }
    (0..dimension).map(|i| high[i] - low[i]).product()
}

/// A plate in triangles with a hole of those around a node, and its area.
fn holed() -> (MeshParts, f64, [f64; 2]) {
    let mut mesh = HOLED.mesh();
    let wanted = [12.3, 8.1];
    let far = |x: &[f64; 3]| (x[0] - wanted[0]).hypot(x[1] - wanted[1]);
    let numbers = 0..mesh.points.len();
    let middle = numbers.min_by(|&a, &b| far(&mesh.points[a]).total_cmp(&far(&mesh.points[b])));
    let middle = middle.unwrap() as u64;
    let triangles = &mut mesh.blocks[1].1;
    let kept = (triangles.chunks_exact(3)).filter(|cell| !cell.contains(&middle));
    *triangles = kept.flatten().copied().collect();
    let area = triangles.chunks_exact(3).map(|cell| {
        let [a, b, c] = [0, 1, 2].map(|k| mesh.points[cell[k] as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    });
    let area = area.sum();
    // no cell has the node any more
    let at = mesh.points.remove(middle as usize);
    for (_, nodes) in &mut mesh.blocks {
        nodes
            .iter_mut()
            .filter(|n| **n > middle)
            .for_each(|n| *n -= 1);
    }
    (mesh, area, [at[0], at[1]])
}

/// A scene of a body under the affine field on all of its surface.
fn stretched<const D: usize>(body: &Body<D>, zone: Region, coupling: &str) -> SceneBuilder {
    scene(body, &mut Random::new(body.seed))
        .nonlocal(zone)
        .material("body", Material::bond_based(1.0).density(1.0))
        .horizon(2.0)
        .coupling(coupling)
        .condition("held", affine::held::<D>())
}

fn solved(scene: &SceneBuilder) -> Solution {
    scene.solve(&Silent).unwrap()
}

#[test]
fn a_plate_with_a_hole_in_its_rim_is_filled() {
    let (mesh, area, hole) = holed();
    // the rim ends in the hole
    let zone = Region::cuboid([4.0, 5.0], [hole[0] - 1.5, 11.0]);
    let scene = stretched(&HOLED, zone, "truncated").mesh(mesh);
    let cells = cells(&solved(&scene));
    let cut = |cell: &&Cell| cell.model == RIM && cell.kind == 5;
    assert!(cells.iter().filter(cut).count() > 3);
    assert_filled(&cells, area);
}

#[test]
fn elements_end_where_the_rim_begins() {
    let body = Body::<2> { edge: 2.5, ..HOLED };
    let mut random = Random::new(1001);
    let drawn = zone(Drawn::Box, &body, 3.0, &mut random);
    let solution = solved(&stretched(&body, drawn, "truncated"));
    let shown = cells(&solution);
    assert_filled(&shown, body.volume());
    let patch = assert_outside(&shown, 2);
    // the rim and the points of the zone, and nothing else, are the box
    let own = |cell: &&Cell| cell.model == RIM || cell.model == 2.0;
    let all: f64 = shown.iter().filter(own).map(|cell| cell.volume).sum();
    assert!((all / patch - 1.0).abs() < 1e-12, "{all} {patch}");
    let off = affine::error(&solution, affine::field::<2>);
    println!("affine {off:e}");
    assert!(off < 1e-12, "{off:e}");
}

#[test]
fn so_do_tetrahedra_and_lines() {
    let drawn = Region::cuboid([3.2, 2.9, 3.1], [5.4, 4.8, 5.2]);
    let solution = solved(&stretched(&SOLID, drawn, "truncated"));
    let shown = cells(&solution);
    assert_filled(&shown, SOLID.volume());
    assert_outside(&shown, 3);
    let off = affine::error(&solution, affine::field::<3>);
    println!("affine {off:e}");
    assert!(off < 1e-12, "{off:e}");
    let body = Body::<1> {
        size: [30.0],
        edge: 2.7,
        seed: 1020,
    };
    let bar = scene(&body, &mut Random::new(body.seed))
        .nonlocal(Region::cuboid([11.0], [19.0]))
        .material("body", Material::bond_based(1.0))
        .horizon(2.0)
        .coupling("truncated")
        .condition("left", Condition::displacement("left").x(0.0))
        .condition("right", Condition::displacement("right").x(0.3));
    assert_filled(&cells(&solved(&bar)), 30.0);
}

#[test]
fn a_rim_that_the_surface_cuts_in_a_solid_is_shown_up_to_it() {
    // its rim reaches through the plane of the top and, with its edge, that of a side
    let drawn = Region::cuboid([5.2, 2.9, 5.1], [8.2, 4.8, 7.2]);
    let scene = scene(&SOLID, &mut Random::new(SOLID.seed))
        .nonlocal(drawn)
        .material("body", Material::bond_based(1.0))
        .horizon(2.0)
        .coupling("truncated")
        .set("peridynamics.points.lattice.origin", [0.8, 0.8, 0.8])
        .condition("held", Condition::displacement("left").x(0.0).y(0.0).z(0.0))
        .condition("weight", Condition::of("body-force").set("x", 0.01));
    let solution = solved(&scene);
    let shown = cells(&solution);
    let cut = |cell: &&Cell| cell.model == RIM && cell.kind == 10;
    let (rim, count) = (
        shown.iter().filter(|cell| cell.model == RIM).count(),
        shown.iter().filter(cut).count(),
    );
    println!("{count} of {rim} in the rim");
    assert!(count > 30);
    // the cells of the mesh before would give many more
    assert!(count < 700, "{count}");
    assert_filled(&shown, SOLID.volume());
    let within = |x: &[f64; 3]| (0..3).all(|i| x[i] < SOLID.size[i] + 1e-9);
    let elements = shown.iter().filter(|cell| cell.kind != 1);
    assert!(elements.flat_map(|cell| &cell.corners).all(within));
}

#[test]
fn velocities_at_the_ends_of_elements_are_those_of_the_elements() {
    let body = Body::<2> { edge: 2.5, ..HOLED };
    let drawn = zone(Drawn::Ball, &body, 3.0, &mut Random::new(1002));
    let start = Initial::velocity()
        .x("0.002 * x - 0.001 * y")
        .y("0.003 * y + 0.0005 * x");
    let motion = scene(&body, &mut Random::new(body.seed))
        .nonlocal(drawn)
        .material("body", Material::bond_based(1.0).density(1.0))
        .horizon(2.0)
        .coupling("truncated")
        .initial("start", start)
        .explicit(1.0)
        .solve(&Silent)
        .unwrap();
    let first = motion.frames().next().unwrap();
    let velocity = first.vectors("velocity").unwrap();
    for (x, v) in first.points().iter().zip(velocity) {
        let wanted = [
            0.002 * x[0] - 0.001 * x[1],
            0.003 * x[1] + 0.0005 * x[0],
            0.0,
        ];
        let off = (0..3).map(|i| (v[i] - wanted[i]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12 * 0.05, "{x:?} {v:?} {wanted:?}");
    }
    assert_filled(&cells(first), body.volume());
}
