use std::sync::Arc;

use nalgebra::DMatrix;

use super::of_model::pieces;
use super::surface::{Facet, Place, Surface, normal};
use super::{ContactLaw, SurfaceContact};
use crate::assembly::Transfer;
use crate::fem::facet_points;
use crate::mesh::{CellShape, Mesh, facet_corners};
use crate::system::{ForceTerm, Interval};
use crate::tensor::Vector;

/// Two unit boxes side by side along the last axis, of `n` and `m` cells along an edge, `gap` apart; sites are their nodes.
fn boxes<const D: usize>(shape: CellShape, [n, m]: [usize; 2], gap: f64) -> Mesh<D> {
    let mut mesh = crate::fem::sample::unit_box::<D>(shape, n, 0.0);
    let other = crate::fem::sample::unit_box::<D>(shape, m, 0.0);
    let first = mesh.nodes.len() as u32;
    mesh.nodes.extend(other.nodes.iter().map(|x| {
        let mut x = *x;
        x[D - 1] += 1.0 + gap;
        x
    }));
    for c in 0..other.cell_count() {
        let nodes: Vec<u32> = other.cell(c).iter().map(|n| n + first).collect();
        mesh.push_cell(other.shapes[c], &nodes);
    }
    mesh
}

/// Contact of the surface of a mesh whose nodes are sites and whose cells are of one material with `C₁₁ = 2`.
fn contact<const D: usize>(mesh: &Mesh<D>, split: u32, law: ContactLaw) -> SurfaceContact<D> {
    let sites = mesh.nodes.len();
    let corner_rows = Transfer::from_rows(sites, (0..sites as u32).map(|n| vec![(n, 1.0)]));
    let (mut facets, mut outward) = (Vec::new(), Vec::new());
    let (mut places, mut rest, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for facet in mesh.outer_facets() {
        let out = mesh.facet_normal_area(&facet);
        let corners = facet_corners::<D>(&facet.nodes);
        let middle = corners.iter().map(|&n| mesh.nodes[n as usize]);
        let middle = middle.sum::<Vector<D>>() / corners.len() as f64;
        let size = 2.0 * (middle - mesh.centroid(facet.cell as usize)).norm();
        let body = u32::from(facet.nodes[0] >= split);
        let first = facets.len() as u32;
        for piece in pieces::<D>(facet.nodes.len()) {
            let mut corners: [u32; D] = std::array::from_fn(|k| facet.nodes[piece[k]]);
            if normal(&corners.map(|c| mesh.nodes[c as usize])).dot(&out) < 0.0 {
                corners.swap(0, 1);
            }
            let stiffness = 2.0 / size;
            facets.push(Facet {
                corners,
                size,
                stiffness,
                body,
            });
            outward.push(out[0].signum());
        }
        facet_points(mesh, &facet.nodes, |p| {
            places.push(Place {
                area: p.weight,
                stiffness: 2.0 / size,
                clearance: 0.0,
                size,
                facet: first,
                body,
            });
            rest.push(p.position);
            rows.push(facet.nodes.iter().copied().zip(p.shape).collect());
        });
    }
    let places = (places, rest, Transfer::from_rows(sites, rows));
    let corners = (mesh.nodes.clone(), corner_rows);
    let limits = (facets.len() as u32, law.deepest);
    let surface = Surface::new(corners, facets, outward, places, limits, 0.0);
    SurfaceContact::of_surface(surface, law, sites)
}

const LAW: ContactLaw = ContactLaw {
    stiffness_factor: 0.5,
    friction: 0.0,
    deepest: 0.5,
    adjust: 0.0,
    counted: 1.0,
};

/// Displacements that move the second box by `shift`, and all nodes a little.
fn motion<const D: usize>(mesh: &Mesh<D>, split: u32, shift: Vector<D>, noise: f64) -> Vec<f64> {
    let move_of = |n: usize| {
        let mut x = Vector::<D>::from_fn(|a, _| noise * crate::fem::sample::noise(n, a));
        if n as u32 >= split {
            x += shift;
        }
        x
    };
    let all = (0..mesh.nodes.len()).map(move_of);
    all.flat_map(|x| x.iter().copied().collect::<Vec<_>>())
        .collect()
}

fn down<const D: usize>(by: f64) -> Vector<D> {
    let mut shift = Vector::zeros();
    shift[D - 1] = -by;
    shift
}

fn force<const D: usize>(contact: &SurfaceContact<D>, u: &[f64]) -> Vec<f64> {
    let mut force = vec![0.0; u.len()];
    contact.add_force(u, &mut force);
    force
}

fn forces_derive_from_the_energy<const D: usize>(shape: CellShape) {
    let mesh = boxes::<D>(shape, [3, 4], 0.05);
    let split = crate::fem::sample::unit_box::<D>(shape, 3, 0.0).nodes.len() as u32;
    let contact = contact(&mesh, split, LAW);
    assert_eq!(contact.energy(&motion(&mesh, split, down(0.02), 0.0)), 0.0);
    let mut shift = down(0.09);
    shift[0] += if D > 1 { 0.1 } else { 0.0 };
    let u = motion(&mesh, split, shift, 0.005);
    let f = force(&contact, &u);
    let energy = contact.energy(&u);
    assert!(energy > 0.0);
    // along a direction the work is the change of energy
    let way: Vec<f64> = (0..u.len())
        .map(|k| ((k * 7 % 11) as f64 - 5.0) / 5.0)
        .collect();
    let moved = |s: f64| -> Vec<f64> { u.iter().zip(&way).map(|(u, d)| u + s * d).collect() };
    let slope = (contact.energy(&moved(1e-6)) - contact.energy(&moved(-1e-6))) / 2e-6;
    let work: f64 = f.iter().zip(&way).map(|(f, d)| f * d).sum();
    assert!((slope - work).abs() < 1e-6 * work.abs(), "{slope} {work}");
    // neither force nor moment in all
    let x = |n: usize| mesh.nodes[n] + Vector::<D>::from_column_slice(&u[n * D..][..D]);
    let largest = f.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    for a in 0..D {
        let total: f64 = f.iter().skip(a).step_by(D).sum();
        assert!(total.abs() < 1e-13 * largest, "{total}");
        for b in 0..a {
            let moment = |n: usize| x(n)[a] * f[n * D + b] - x(n)[b] * f[n * D + a];
            let total: f64 = (0..mesh.nodes.len()).map(moment).sum();
            assert!(total.abs() < 1e-12 * largest, "{total}");
        }
    }
    // the matrix of a solid is large
    if D == 3 {
        return;
    }
    // bounds of eigenvalues, with masses all one, and of row sums
    let n = u.len();
    let columns: Vec<f64> = (0..n)
        .flat_map(|k| {
            let at = |s: f64| {
                let mut u = u.clone();
                u[k] += s;
                force(&contact, &u)
            };
            let (plus, minus) = (at(1e-7), at(-1e-7));
            let each = plus.into_iter().zip(minus);
            each.map(|(p, m)| (p - m) / 2e-7).collect::<Vec<_>>()
        })
        .collect();
    let matrix = DMatrix::from_vec(n, n, columns);
    let largest = ((&matrix + matrix.transpose()) * 0.5)
        .symmetric_eigenvalues()
        .max();
    let bound = contact.rate_bounds(&vec![1.0; n / D]).stiffness;
    assert!(largest > 0.0 && largest < bound, "{largest} {bound}");
    assert!(largest > 0.02 * bound, "{largest} {bound}");
    let mut sums = vec![0.0; n];
    contact.add_row_sums(&mut sums);
    for k in 0..n {
        let sum: f64 = matrix.row(k).iter().map(|k| k.abs()).sum();
        assert!(sum <= sums[k] * (1.0 + 1e-6), "{k}: {sum} {}", sums[k]);
    }
}

#[test]
fn forces_of_edges_derive_from_the_energy() {
    for shape in [CellShape::Tri3, CellShape::Quad4, CellShape::Quad8] {
        forces_derive_from_the_energy::<2>(shape);
    }
    forces_derive_from_the_energy::<1>(CellShape::Line2);
}

#[test]
fn forces_of_faces_derive_from_the_energy() {
    forces_derive_from_the_energy::<3>(CellShape::Tet4);
}

/// A uniform depth gives both faces the consistent forces of a uniform pressure, whether or not nodes match.
#[test]
fn a_uniform_depth_is_a_uniform_pressure_on_both_sides() {
    let mesh = boxes::<3>(CellShape::Hex8, [3, 4], 0.0);
    let split = 64;
    let contact = contact(&mesh, split, LAW);
    let u = motion(&mesh, split, down(0.01), 0.0);
    let f = force(&contact, &u);
    // half of each side's penalty, min(2·3, 2·4) of both
    let pressure = 0.5 * 6.0 * 0.01;
    let mut expected = vec![0.0; u.len()];
    for facet in mesh.outer_facets() {
        let normal = mesh.facet_normal_area(&facet);
        let inside = (mesh.nodes[facet.nodes[0] as usize].z - 1.0).abs() < 1e-9;
        if inside && normal.x.abs() + normal.y.abs() < 1e-9 {
            facet_points(&mesh, &facet.nodes, |p| {
                for (&n, w) in facet.nodes.iter().zip(p.shape) {
                    expected[n as usize * 3 + 2] += pressure * p.weight * w * normal.z.signum();
                }
            });
        }
    }
    let largest = expected.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    let off = f.iter().zip(&expected).map(|(f, e)| (f - e).abs());
    let off = off.fold(0.0, f64::max) / largest;
    // the own places of a side are exact, those of the other fall unevenly on its faces
    assert!(off < 0.07, "{off}");
    let total: f64 = f[..split as usize * 3].iter().skip(2).step_by(3).sum();
    assert!((total - pressure).abs() < 1e-12, "{total} {pressure}");
}

/// Blocks that slide under a pressing force: the force of friction is μ times that, and its work what the drive puts in.
#[test]
fn friction_grips_and_slips() {
    let mesh = boxes::<2>(CellShape::Quad4, [6, 5], 0.0);
    let split = 49;
    let law = ContactLaw {
        friction: 0.3,
        ..LAW
    };
    let contact = Arc::new(contact(&mesh, split, law));
    let at = |along: f64| motion(&mesh, split, Vector::<2>::new(along, -0.01), 0.0);
    let pull = |u: &[f64]| -> [f64; 2] {
        let f = force(&contact, u);
        std::array::from_fn(|a| f[split as usize * 2..].iter().skip(a).step_by(2).sum())
    };
    let mut time = 0.0;
    let mut commit = |u: &[f64]| {
        time += 1.0;
        ForceTerm::commit(
            &*contact,
            u,
            Interval {
                end: time,
                length: 1.0,
            },
        );
    };
    commit(&at(0.0));
    // grips like a spring of the same stiffness
    let [x, y] = pull(&at(0.001));
    assert!((x / -y - 0.1).abs() < 1e-9, "{x} {y}");
    // and slips
    let (mut done, mut last) = (0.0, pull(&at(0.0))[0]);
    for step in 1..=20 {
        let u = at(0.001 * f64::from(step));
        let [x, y] = pull(&u);
        // places under the rim of the other block are pushed out sideways too
        assert!(x <= 0.3 * -y * 1.02, "{x} {y}");
        done += 0.0005 * (x + last);
        last = x;
        commit(&u);
    }
    let [x, y] = pull(&at(0.02));
    assert!((x / -y - 0.3).abs() < 0.02, "{x} {y}");
    let spent = contact.dissipated().unwrap();
    assert!(spent > 0.5 * done && spent < done, "{spent} {done}");
    // a checkpoint goes on with the same bits
    let state = ForceTerm::state(&*contact);
    let other = self::contact(&mesh, split, law);
    assert!(ForceTerm::restore(&other, &state));
    assert_eq!(force(&other, &at(0.021)), force(&contact, &at(0.021)));
    assert!(!ForceTerm::restore(&other, &state[1..]));
}
