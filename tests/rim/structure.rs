//! Symmetry, rigid motions, masses and energies of models with a rim.

use bondline::run::SceneModel;
use bondline::system::LinearMotion;
use bondline::tensor::padded;
use bondline::{Condition, Function, Initial, Material, Region, SceneBuilder, Silent};

use super::meshes::{Body, Random};
use super::{Drawn, scene, zone};

const DENSITY: f64 = 2.5;

/// Time in which the stable step fits 20000 times.
const DURATION: f64 = 30000.0;

/// Part of the largest diagonal entry above which all eigenvalues but those of rigid motions lie.
const STIFF: f64 = 1e-4;

pub fn truncated<const D: usize>(body: &Body<D>, material: Material, shape: Drawn) -> SceneBuilder {
    let mut random = Random::new(body.seed);
    let radius = if D == 2 { 2.4 } else { 1.8 };
    scene(body, &mut random)
        .nonlocal(zone(shape, body, radius, &mut random))
        .material("body", material.density(DENSITY))
        .horizon(2.0)
        .coupling("truncated")
}

/// A scene as matrices.
pub struct LinearModel {
    pub motion: LinearMotion,
    /// Place of each site \[m\], padded with zeros.
    position: Vec<[f64; 3]>,
}

/// The matrices of a scene; its supports are left out of them.
pub fn matrices<const D: usize>(scene: &SceneBuilder) -> LinearModel {
    let scene = scene.scene().unwrap().of_dimension::<D>().unwrap();
    let laid = SceneModel::new(scene).unwrap();
    LinearModel {
        motion: laid.motion().unwrap(),
        position: (laid.model.sites.iter().map(|s| padded(&s.position))).collect(),
    }
}

/// The same of a scene without supports, which has to be held to be one.
fn model<const D: usize>(scene: &SceneBuilder) -> LinearModel {
    let held = Condition::displacement("left").x(0.0);
    matrices::<D>(&scene.clone().condition("held", held))
}

/// The stiffness in full, row by row.
fn dense(model: &LinearModel) -> Vec<Vec<f64>> {
    let k = &model.motion.stiffness;
    let d = k.block;
    let mut full = vec![vec![0.0; k.dofs()]; k.dofs()];
    for site in 0..k.rows() {
        let (columns, blocks) = k.row(site);
        for (&column, block) in columns.iter().zip(blocks.chunks_exact(d * d)) {
            for (e, value) in block.iter().enumerate() {
                full[site * d + e / d][column as usize * d + e % d] += value;
            }
        }
    }
    full
}

/// Rigid motions of the sites, orthonormal: translations, then rotations in each plane of two axes.
fn rigid<const D: usize>(model: &LinearModel) -> Vec<Vec<f64>> {
    let mut motions: Vec<Vec<f64>> = Vec::new();
    let translations = (0..D).map(|i| (i, i));
    let rotations = (0..D).flat_map(|i| (i + 1..D).map(move |j| (i, j)));
    for (i, j) in translations.chain(rotations) {
        let of_site = |x: &[f64; 3]| {
            let mut u = [0.0; D];
            (u[i], u[j]) = if i == j { (1.0, 1.0) } else { (-x[j], x[i]) };
            u
        };
        let mut motion: Vec<f64> = model.position.iter().flat_map(of_site).collect();
        for other in &motions {
            let part: f64 = motion.iter().zip(other).map(|(a, b)| a * b).sum();
            motion
                .iter_mut()
                .zip(other)
                .for_each(|(a, b)| *a -= part * b);
        }
        let norm = motion.iter().map(|a| a * a).sum::<f64>().sqrt();
        motions.push(motion.iter().map(|a| a / norm).collect());
    }
    motions
}

/// Returns true if Cholesky's factorisation of a symmetric matrix exists.
fn is_definite(mut a: Vec<Vec<f64>>) -> bool {
    for j in 0..a.len() {
        let (above, below) = a.split_at_mut(j + 1);
        let pivot = &mut above[j];
        let square = pivot[j] - pivot[..j].iter().map(|l| l * l).sum::<f64>();
        if square <= 0.0 {
            return false;
        }
        pivot[j] = square.sqrt();
        for row in below {
            let known: f64 = row[..j].iter().zip(&pivot[..j]).map(|(a, b)| a * b).sum();
            row[j] = (row[j] - known) / pivot[j];
        }
    }
    true
}

/// A symmetric stiffness whose kernel is that of rigid motions.
///
/// With K R = 0 for orthonormal rigid motions R, `K + c R Rᵀ − STIFF c I` is definite only if every other eigenvalue is above `STIFF c`.
pub fn assert_symmetric_and_stiff<const D: usize>(scene: &SceneBuilder, case: &str) {
    let model = model::<D>(scene);
    let mut k = dense(&model);
    let n = k.len();
    let largest = (0..n).map(|i| k[i][i].abs()).fold(0.0, f64::max);
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let off = pairs
        .map(|(i, j)| (k[i][j] - k[j][i]).abs())
        .fold(0.0, f64::max);
    assert!(off < 1e-13 * largest, "{case}: {:e}", off / largest);
    let motions = rigid::<D>(&model);
    assert_eq!(motions.len(), D * (D + 1) / 2);
    for motion in &motions {
        let force = model.motion.stiffness.multiply(motion);
        let force = force.iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        assert!(force < 1e-13 * largest, "{case}: {:e}", force / largest);
    }
    let sign = k[0][0].signum();
    for (i, row) in k.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let shift: f64 = motions.iter().map(|motion| motion[i] * motion[j]).sum();
            *entry = sign * *entry + largest * shift;
        }
        row[i] -= STIFF * largest;
    }
    println!("{case}: {n} unknowns, {off:e}");
    assert!(is_definite(k), "{case}");
}

#[test]
fn truncated_bonds_are_symmetric_with_the_rigid_motions_alone_free() {
    let laws = [
        ("bonds", Material::bond_based(1.0)),
        ("0.05", Material::lps(1.0, 0.05)),
        ("0.45", Material::lps(1.0, 0.45)),
    ];
    for (k, (name, law)) in laws.into_iter().enumerate() {
        let plate = Body::<2> {
            size: [12.0, 11.0],
            edge: [2.5, 1.0, 3.7][k],
            seed: 600 + k as u64,
        };
        let shape = [Drawn::Angle, Drawn::Ball, Drawn::Polygon][k];
        assert_symmetric_and_stiff::<2>(
            &truncated(&plate, law.clone(), shape),
            &format!("plate {name}"),
        );
        let solid = Body::<3> {
            size: [8.0; 3],
            edge: 2.7,
            seed: 610 + k as u64,
        };
        if k < 2 {
            assert_symmetric_and_stiff::<3>(
                &truncated(&solid, law, Drawn::Ball),
                &format!("solid {name}"),
            );
        }
    }
}

#[test]
fn solids_whose_surface_cuts_the_zone_off_the_lattice_turn_without_force() {
    for (name, law) in [
        ("bonds", Material::bond_based(1.0)),
        ("0.3", Material::lps(1.0, 0.3)),
    ] {
        let solid = Body::<3> {
            size: [8.0; 3],
            edge: 2.7,
            seed: 614,
        };
        let zone = Region::cuboid([2.3, 2.3, 4.9], [5.7, 5.7, 9.0]);
        let scene = truncated(&solid, law, Drawn::Box).nonlocal(zone);
        assert_symmetric_and_stiff::<3>(&scene, &format!("cut solid {name}"));
        assert_masses(&scene, &solid);
    }
}

/// Mass is that of the body, and positive.
pub fn assert_mass<const D: usize>(scene: &SceneBuilder, body: &Body<D>) -> LinearModel {
    let model = model::<D>(scene);
    let wanted = DENSITY * body.volume();
    let total: f64 = model.motion.mass.iter().sum();
    println!("{D}D mass {:e}", total / wanted - 1.0);
    assert!((total / wanted - 1.0).abs() < 1e-13, "{total} {wanted}");
    assert!(model.motion.mass.iter().all(|m| *m > 0.0));
    model
}

/// So is its first moment.
pub fn assert_masses<const D: usize>(scene: &SceneBuilder, body: &Body<D>) {
    let model = assert_mass(scene, body);
    let wanted = DENSITY * body.volume();
    for (i, middle) in body.middle().into_iter().enumerate() {
        let sites = model.motion.mass.iter().zip(&model.position);
        let moment: f64 = sites.map(|(m, x)| m * x[i]).sum();
        assert!((moment / (wanted * middle) - 1.0).abs() < 1e-13, "{moment}");
    }
}

#[test]
fn masses_are_those_of_the_body() {
    for (k, edge) in [0.5, 1.0, 2.5, 5.0].into_iter().enumerate() {
        let body = Body::<2> {
            size: [16.0, 15.0],
            edge,
            seed: 620 + k as u64,
        };
        let shape = [Drawn::Box, Drawn::Angle, Drawn::Polygon, Drawn::Ball][k];
        let scene = truncated(&body, Material::bond_based(1.0), shape);
        assert_masses(&scene, &body);
        // a motion has cells of two spacings in its rim, for elements that are no smaller
        if edge > 2.0 {
            assert_masses(&scene.explicit(1.0), &body);
        }
    }
    let body = Body::<3> {
        size: [8.0; 3],
        edge: 2.7,
        seed: 630,
    };
    assert_masses(
        &truncated(&body, Material::bond_based(1.0), Drawn::Ball),
        &body,
    );
}

#[test]
fn a_plate_that_swings_freely_keeps_momentum_and_energy() {
    let body = Body::<2> {
        size: [14.0, 13.0],
        edge: 2.5,
        seed: 640,
    };
    // no rotation, which would grow with time and with it the rounding of forces
    let velocity = |x: &[f64; 3]| {
        [
            0.003 * x[0] + 0.0005 * x[1] - 0.02424,
            0.0005 * x[0] - 0.002 * x[1] + 0.00951,
        ]
    };
    let component = |i: usize| Function::of_position(move |x| velocity(x)[i]);
    let solution = truncated(&body, Material::lps(1.0, 0.2), Drawn::Angle)
        .explicit(DURATION)
        .initial("pull", Initial::velocity().x(component(0)).y(component(1)))
        .solve(&Silent)
        .unwrap();
    let steps = solution.history("step").unwrap();
    let energy = solution.history("discrete_energy").unwrap();
    let off = energy
        .iter()
        .map(|e| (e / energy[0] - 1.0).abs())
        .fold(0.0, f64::max);
    println!("{} steps, energy {off:e}", steps.last().unwrap());
    assert!(*steps.last().unwrap() >= 20000.0);
    assert!(off < 1e-9, "{off:e}");
    let mass = DENSITY * body.volume();
    let [x, y] = body.middle();
    let wanted = velocity(&[x, y, 0.0]).map(|v| mass * v);
    for (column, wanted) in ["momentum_x", "momentum_y"].into_iter().zip(wanted) {
        let momentum = solution.history(column).unwrap();
        let off = momentum
            .iter()
            .map(|p| (p - wanted).abs())
            .fold(0.0, f64::max);
        let off = off / (mass * 0.02);
        println!("{column} {off:e}");
        assert!(off < 1e-9, "{column}: {off:e}");
    }
}

/// The facets of the surface are those of the body: neither the faces of the rim nor what cells have lost the neighbour of.
fn assert_surface<const D: usize>(body: &Body<D>, area: f64) {
    let held = Condition::displacement("left").x(0.0);
    let scene = truncated(body, Material::bond_based(1.0), Drawn::Angle).condition("held", held);
    let mesh = scene.scene().unwrap().of_dimension::<D>().unwrap().mesh;
    assert!(!mesh.embedded.cut.is_empty());
    let facets = mesh.outer_facets();
    let found: f64 = facets.iter().map(|f| mesh.facet_area(&f.nodes)).sum();
    assert!((found / area - 1.0).abs() < 1e-13, "{found} {area}");
}

#[test]
fn the_surface_stays_that_of_the_body() {
    let plate = Body::<2> {
        size: [14.0, 13.0],
        edge: 2.5,
        seed: 650,
    };
    assert_surface(&plate, 54.0);
    let solid = Body::<3> {
        size: [8.0; 3],
        edge: 2.7,
        seed: 651,
    };
    assert_surface(&solid, 384.0);
}
