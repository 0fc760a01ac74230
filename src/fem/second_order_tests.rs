//! Files of Gmsh with cells of second order, in all of its formats.

use std::path::{Path, PathBuf};

use crate::fem;
use crate::mesh::{CellShape, Mesh, Order, quality, read};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

/// `tests/fixtures/ring.geo`: an eighth of a ring of radii 1 and 2, curved sides of second order.
fn is_read<const D: usize>(name: &str, shape: CellShape, cells: usize, outer: usize) {
    let formats = ["22_ascii", "22_binary", "41_ascii", "41_binary"];
    let read_all = |order: Order| -> Vec<Mesh<D>> {
        let path = |format: &str| fixture(&format!("ring_{name}_{format}.msh"));
        (formats.iter())
            .map(|format| {
                read::read_with(
                    &path(format),
                    &read::Options {
                        order,
                        ..read::Options::default()
                    },
                )
                .unwrap()
            })
            .collect()
    };
    let volume = |mesh: &Mesh<D>| -> f64 {
        let cells = 0..mesh.cell_count();
        cells.map(|c| fem::cell_volume(mesh, c)).sum()
    };
    let exact = std::f64::consts::PI / 8.0 * 3.0;
    for mesh in read_all(Order::Kept) {
        quality::check(&mesh).unwrap();
        fem::check(&mesh, |_| true).unwrap();
        assert_eq!((mesh.shapes[0], mesh.cell_count()), (shape, cells));
        // a node in a wrong place of its cell moves the volume by per cents
        assert!(
            (volume(&mesh) / exact - 1.0).abs() < 2e-4,
            "{name}: {}",
            volume(&mesh)
        );
        let facets = &mesh.facet_sets["outer"];
        assert_eq!(facets.len(), outer);
        assert_eq!(mesh.locate_facets(facets).unwrap().len(), outer);
        let area: f64 = facets.iter().map(|f| fem::facet_area(&mesh, f)).sum();
        assert!(
            (area / std::f64::consts::FRAC_PI_2 - 1.0).abs() < 2e-4,
            "{name}: {area}"
        );
        for &n in facets.iter().flatten() {
            let x = mesh.nodes[n as usize];
            assert!((x[0].hypot(x[1]) - 2.0).abs() < 1e-9, "{name}");
        }
        // the other nodes lie between the corners, as far as the arc lets them
        for c in 0..mesh.cell_count() {
            assert!(mesh.bulge(c).amax() < 0.15, "{name}: {}", mesh.bulge(c));
        }
    }
    for mesh in read_all(Order::Linear) {
        quality::check(&mesh).unwrap();
        assert_eq!((mesh.shapes[0], mesh.cell_count()), (shape.linear(), cells));
        let used = mesh.connectivity.iter().copied().max().unwrap() as usize + 1;
        assert_eq!(mesh.nodes.len(), used, "{name}: nodes that no cell has");
        let chord = volume(&mesh);
        assert!(
            chord < 0.98 * exact && chord > 0.9 * exact,
            "{name}: {chord}"
        );
        assert_eq!(
            mesh.locate_facets(&mesh.facet_sets["outer"]).unwrap().len(),
            outer
        );
    }
}

#[test]
fn cells_of_second_order_are_read_in_all_formats_of_gmsh() {
    is_read::<2>("tri6", CellShape::Tri6, 8, 2);
    is_read::<2>("quad8", CellShape::Quad8, 4, 2);
    is_read::<3>("tet10", CellShape::Tet10, 48, 8);
    is_read::<3>("hex20", CellShape::Hex20, 8, 4);
}

#[test]
fn points_of_curved_cells_are_found_and_folds_are_named() {
    use crate::fem::{Locator, reference_cell, shape_values};
    use crate::tensor::Vector;

    fn is_located<const D: usize>(name: &str) {
        let mut mesh: Mesh<D> = read::read(&fixture(&format!("ring_{name}_41_ascii.msh"))).unwrap();
        let locator = Locator::new(&mesh, 0..mesh.cell_count());
        for c in 0..mesh.cell_count() {
            let cell = reference_cell(mesh.shapes[c]).unwrap();
            for node in cell.corners {
                // near the sides, beyond the chords of the outer ones
                let xi = Vector::<D>::from_fn(|i, _| 0.98 * node[i] + 0.02 * cell.centre[i]);
                let (shape, _) = shape_values(&mesh, c, &xi);
                let x: Vector<D> = (mesh.cell(c).iter().zip(&shape))
                    .map(|(&n, w)| mesh.nodes[n as usize] * *w)
                    .sum();
                let found = locator.locate(&mesh, &x, 1e-9).unwrap();
                assert_eq!(found.cell, c, "{name}");
                assert!((found.reference - xi).amax() < 1e-10, "{name}");
            }
        }
        // a node in the middle of an edge moved onto an end folds the cell there
        let side = mesh.mid_sides(1).next().unwrap();
        let [p, q] = side.ends.map(|n| mesh.nodes[n as usize]);
        mesh.nodes[side.node as usize] = p + (p - q) * 0.2;
        let message = fem::check(&mesh, |_| true).unwrap_err().to_string();
        assert!(message.contains("Jacobian"), "{message}");
        let named = (0..mesh.cell_count()).find(|&c| mesh.cell(c).contains(&side.node));
        assert!(
            message.contains(&format!("cell {} ", named.unwrap())),
            "{message}"
        );
    }
    is_located::<2>("tri6");
    is_located::<2>("quad8");
    is_located::<3>("tet10");
    is_located::<3>("hex20");
}
