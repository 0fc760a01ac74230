//! Points of bodies that couplings lay out.

use std::path::Path;

use crate::{
    coupling::{Nonlocal, Splice},
    fem,
    mesh::{
        Mesh,
        generate::{Axis, CutOut, rectangle},
        read,
    },
    model::{
        ElasticCells, Model, Peridynamics, PointSource, Surfaces, Zone, ZoneLayout, ZonedBody,
    },
    peridynamics::{BondBased, BondWeights, Micromodulus, PartialVolume},
    progress::Silent,
    shape::Shape,
    tensor::{Tensor4, Vector},
};

fn model(
    mesh: Mesh<2>,
    zones: Vec<Zone>,
    points: PointSource<2>,
    horizon: f64,
    voids: Vec<Shape<2>>,
) -> Model<2> {
    let cells = mesh.cell_count();
    let coupling: &dyn ZoneLayout<2> = match zones.contains(&Zone::Local) {
        true => &Splice,
        false => &Nonlocal,
    };
    let body = ZonedBody {
        mesh,
        zones,
        elastic: ElasticCells {
            tensors: vec![Tensor4::isotropic(1.0, 1.0)],
            material: vec![0; cells],
            of_points: 0,
            turned: Default::default(),
        },
        peridynamics: Some(Peridynamics {
            law: std::sync::Arc::new(BondBased::new(Micromodulus::InverseDistance, 1.0)),
            horizon: crate::model::HorizonField::Uniform(horizon),
            horizon_change: crate::model::HorizonChange::default(),
            points,
            weights: BondWeights::Plain,
            volumes: PartialVolume::Full,
            barriers: Vec::new(),
            voids,
            surfaces: Surfaces::Uncut,
        }),
    };
    Model::new(body, coupling, None, &Silent).expect("a model")
}

/// Volumes of the region and of its points.
fn volumes(mesh: Mesh<2>, zones: Vec<Zone>, points: PointSource<2>, horizon: f64) -> [f64; 2] {
    let v = model(mesh, zones, points, horizon, Vec::new()).volumes();
    [v.region, v.points]
}

fn holed_plate() -> Mesh<2> {
    let axis = || Axis::Uniform {
        min: -1.0,
        max: 1.0,
        cells: 20,
    };
    rectangle(axis(), axis())
        .cut_out(CutOut {
            name: "hole".into(),
            min: Vector::<2>::new(-0.3, -0.1),
            max: Vector::<2>::new(0.3, 0.1),
        })
        .mesh()
        .expect("a mesh")
}

#[test]
fn volumes_add_up_to_the_zone() {
    let exact = 4.0 - 0.12;
    for points in [
        PointSource::Cells,
        PointSource::Lattice {
            spacing: 0.1,
            origin: Vector::zeros(),
        },
        PointSource::Lattice {
            spacing: 0.1,
            origin: Vector::repeat(0.05),
        },
    ] {
        let mesh = holed_plate();
        let zones = vec![Zone::Nonlocal; mesh.cell_count()];
        let [region, sum] = volumes(mesh, zones, points.clone(), 0.3);
        assert!(
            (region - exact).abs() < 1e-12 && (sum - exact).abs() < 1e-12,
            "{points:?}: {sum}"
        );
        // half of the plate: points on the seam belong to elements, half of their cells to the zone
        let mesh = holed_plate();
        let zones = (0..mesh.cell_count())
            .map(|c| {
                if mesh.centroid(c)[0] < 0.0 {
                    Zone::Nonlocal
                } else {
                    Zone::Local
                }
            })
            .collect();
        let [region, sum] = volumes(mesh, zones, points.clone(), 0.3);
        assert!(
            (region - exact / 2.0).abs() < 1e-12 && (sum - exact / 2.0).abs() < 1e-12,
            "{points:?}: {sum}"
        );
    }
}

#[test]
fn a_void_leaves_the_volumes_of_points_that_stay() {
    // points on the edges of the mesh have half a cell, with a void in the middle, or at an edge, or without
    let spacing = 0.1;
    let of = |voids: Vec<Shape<2>>| {
        let axis = || Axis::Uniform {
            min: -1.0,
            max: 1.0,
            cells: 20,
        };
        let mesh = rectangle(axis(), axis()).mesh().expect("a mesh");
        let zones = vec![Zone::Nonlocal; mesh.cell_count()];
        let origin = Vector::zeros();
        let points = PointSource::Lattice { spacing, origin };
        model(mesh, zones, points, 0.3, voids)
    };
    let whole = of(Vec::new());
    let key = |x: &Vector<2>| ((x / spacing).map(f64::round)).map(|k| k as i64);
    let cloud = |m: &Model<2>| {
        let cloud = &m.body().expect("points").cloud;
        let each = cloud.position.iter().map(key).zip(cloud.volume.clone());
        each.collect::<Vec<_>>()
    };
    for (low, high) in [([-0.43, -0.23], [0.17, 0.37]), ([0.57, -0.33], [2.0, 0.33])] {
        let void = Shape::Box {
            min: low.into(),
            max: high.into(),
        };
        let holed = of(vec![void.clone()]);
        let before = cloud(&whole);
        let after = cloud(&holed);
        assert!(after.len() < before.len());
        for (at, volume) in after {
            let x = at.map(|k| k as f64 * spacing);
            let (_, old) = before.iter().find(|(b, _)| *b == at).expect("stays");
            // but where the void cuts the half cell of a point at the edge
            if void.signed_distance(&x) > spacing {
                assert!((volume / old - 1.0).abs() < 1e-12, "{at}: {volume} {old}");
            }
        }
    }
}

#[test]
fn volumes_add_up_on_a_mesh_with_curved_edges() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/lug.msh");
    let mesh: Mesh<2> = read::read(&path).expect("the lug");
    let exact: f64 = (0..mesh.cell_count())
        .map(|c| fem::cell_volume(&mesh, c))
        .sum();
    let (low, high) = mesh.bounds();
    let spacing = (high - low).amax() / 60.0;
    let zones = vec![Zone::Nonlocal; mesh.cell_count()];
    let points = PointSource::Lattice {
        spacing,
        origin: low,
    };
    let [region, sum] = volumes(mesh, zones, points, 3.0 * spacing);
    assert!((region / exact - 1.0).abs() < 1e-12);
    assert!((sum / exact - 1.0).abs() < 1e-12, "{}", sum / exact - 1.0);
}
