//! Zones that are placed by themselves, and what a scene allocates.

use std::path::Path;

use crate::coupling::semidiscrete::behaviour::{BondBehaviour, BondThreshold};
use crate::peridynamics::bond_force::BondKinematics;
use crate::progress::Silent;
use crate::run::{AnyScene, PlacedScene, setup, solve_with};
use crate::scene::validated::Scene;
use crate::scene::{SceneError, SceneErrorKind, Source};
use crate::{coupling::CoupledSystem, model::Zone};

/// A plate 2 by 1 that is pulled, with cells and points of 0.05 and a horizon of 0.15.
const PLATE: &str = r#"
zones = "auto"
kinematics = "plane-stress"
[mesh.rectangle]
min = [0, 0]
max = [2, 1]
x = { cells = 40 }
y = { cells = 20 }
[materials.plate.bond-based]
youngs-modulus = 1.0
[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05 }
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.displacement]
on = "top"
x = 0
y = 0.01
"#;

/// Leaves what cells are marked to the other criteria.
const LENIENT: &str = "zones.auto.tolerance=0.9";

/// A bar under a body force, whose displacement is a polynomial of the third degree.
const BAR: &str = r#"
zones = "auto"
kinematics = "bar"
[mesh.line]
min = 0
max = 1
x = { cells = 200 }
[materials.rod.bond-based]
youngs-modulus = 3.0
[peridynamics]
horizon = 0.015
points.lattice = { spacing = 0.005 }
[conditions.left.displacement]
on = "left"
x = 0
[conditions.weight.body-force]
x = "x"
"#;

fn load(text: &str, overrides: &[&str]) -> Result<AnyScene, SceneError> {
    let mut source = Source::new("auto.toml", text);
    for o in overrides {
        source.push_override(o).expect("an override");
    }
    AnyScene::from_source(&source, Path::new("."), "auto")
}

fn plate(overrides: &[&str]) -> PlacedScene<2> {
    match load(PLATE, overrides) {
        Ok(AnyScene::Plane(scene)) => *scene,
        other => panic!("{other:?}"),
    }
}

fn bar(overrides: &[&str]) -> PlacedScene<1> {
    match load(BAR, overrides) {
        Ok(AnyScene::Bar(scene)) => *scene,
        other => panic!("{other:?}"),
    }
}

/// The displacement of a static scene, and the names of the stages of its run.
fn solved<const D: usize>(scene: PlacedScene<D>) -> (Vec<f64>, Vec<String>) {
    let mut u = Vec::new();
    let summary = solve_with(scene, &Silent, |_, solved| {
        u = solved.displacement.to_vec();
        Ok(Vec::new())
    })
    .expect("a solution");
    let stages = summary.timings.stages.into_iter().map(|s| s.name);
    (u, stages.collect())
}

/// Cells of the plate that are nonlocal, by their centroids.
fn nonlocal(scene: &Scene<2>) -> Vec<[f64; 2]> {
    (0..scene.mesh.cell_count())
        .filter(|&c| scene.zones[c] == Zone::Nonlocal)
        .map(|c| scene.mesh.centroid(c).into())
        .collect()
}

#[test]
fn a_smooth_scene_is_finite_elements_bit_for_bit() {
    let scene = bar(&[]);
    assert_eq!(scene.coupling.traits().name, "local");
    let placement = scene.placement.clone().expect("a placement");
    assert!(scene.kept.is_some(), "{placement:?}");
    assert!(placement.choice.choice.contains("no peridynamics"));
    let (u, stages) = solved(scene);
    let (local, _) = solved(bar(&["coupling=local"]));
    assert_eq!(u, local);
    assert!(stages.iter().any(|s| s == "placing the zone"), "{stages:?}");
    // u'' = −x/3, u(0) = 0, u'(1) = 0: u(1) = ∫∫ = 1/9, which linear elements hit at nodes
    let tip = u.iter().copied().fold(0.0, f64::max);
    assert!((tip * 9.0 - 1.0).abs() < 1e-9, "{tip}");
}

#[test]
fn a_crack_is_padded_by_two_horizons() {
    let crack = "cracks.slit.segment={from=[0.8,0.5],to=[1.2,0.5]}";
    let scene = plate(&[crack, LENIENT]);
    let cells = nonlocal(&scene);
    let share = cells.len() as f64 / 800.0;
    assert!(share > 0.2 && share < 0.7, "{share}");
    for c in 0..scene.mesh.cell_count() {
        let x = scene.mesh.centroid(c);
        let beyond = (0.8 - x[0]).max(x[0] - 1.2).max(0.0);
        if beyond <= 0.3 && (x[1] - 0.5).abs() <= 0.3 {
            assert_eq!(scene.zones[c], Zone::Nonlocal, "{x}");
        }
    }
    assert!(
        scene
            .placement
            .as_ref()
            .is_some_and(|p| { scene.kept.is_some() && p.choice.why.contains("cracks mark") })
    );
    assert_eq!(scene.coupling.traits().name, "truncated");
    let (u, _) = solved(scene);
    assert!(u.iter().all(|u| u.is_finite()));
    // a method that needs a transition zone gets one; this body has no room for it beyond the zone
    let wide = [
        "mesh.rectangle.min=[-4,-4]",
        "mesh.rectangle.max=[6,5]",
        "mesh.rectangle.x.cells=200",
        "mesh.rectangle.y.cells=180",
    ];
    let blended = plate(&[&wide[..], &[crack, LENIENT, "coupling=blending"]].concat());
    let width = |zone| blended.zones.iter().filter(|z| **z == zone).count();
    assert!(width(Zone::Transition) > width(Zone::Nonlocal));
    assert!(width(Zone::Local) > width(Zone::Transition));
}

#[test]
fn a_zone_around_a_crack_grows_by_what_the_elements_beyond_it_ask_for() {
    let with = |tolerance: &str| {
        let tolerance = format!("zones.auto.tolerance={tolerance}");
        let crack = "cracks.slit.segment={from=[0.8,0.5],to=[1.2,0.5]}";
        let body = "conditions.pull.body-force={y=\"if(x>1.7, -100, 0) * sin(20*x)\"}";
        plate(&[crack, body, &tolerance])
    };
    let (wide, narrow) = (nonlocal(&with("0.01")), nonlocal(&with("0.9")));
    assert!(narrow.iter().all(|x| wide.contains(x)));
    assert!(wide.len() > narrow.len(), "{}", wide.len());
    // what the force bends lies far from the crack
    assert!(wide.iter().any(|x| x[0] > 1.7));
    assert!(narrow.iter().all(|x| x[0] < 1.6));
}

#[test]
fn stretch_marks_cells_where_bonds_break() {
    let notched = [
        LENIENT,
        "mesh.rectangle.cutouts.notch={min=[0,0.45],max=[0.5,0.55]}",
        "solve.quasi-static={steps=5}",
        "conditions.top.displacement.y=0.01*t",
    ];
    let with = |stretch: &str| {
        let fracture = format!("materials.plate.bond-based.critical-stretch={stretch}");
        let all = [&notched[..], &[fracture.as_str()]].concat();
        plate(&all)
    };
    // far below half of the critical stretch: the notch alone, whose corners lie at x = 0 and 0.5
    let notch = with("10");
    assert!(nonlocal(&notch).iter().all(|x| x[0] < 0.9));
    assert!(!nonlocal(&notch).is_empty());
    // the mean strain is 0.01 or more: every cell that carries is beyond half of 0.015
    let whole = with("0.015");
    assert!(nonlocal(&whole).len() > 2 * nonlocal(&notch).len());
    let part = with("0.03");
    let why = &part.placement.as_ref().expect("a placement").choice.why;
    assert!(
        why.contains("beyond 0.5 of the critical stretch at the end"),
        "{why}"
    );
    assert!(nonlocal(&part).len() >= nonlocal(&notch).len());
    assert!(nonlocal(&part).len() < nonlocal(&whole).len());
}

#[test]
fn a_corner_is_marked_until_the_rest_is_within_the_tolerance() {
    let cutout = "mesh.rectangle.cutouts.slit={min=[0.8,0.45],max=[1.2,0.55]}";
    let fine = plate(&[cutout, "zones.auto.tolerance=0.03"]);
    let coarse = plate(&[cutout, "zones.auto.tolerance=0.3"]);
    assert!(nonlocal(&coarse).is_empty());
    let cells = nonlocal(&fine);
    assert!(!cells.is_empty());
    // the notches were a guess that held: the solution with it is the run's, bit for bit
    let mut drawn = fine.clone();
    assert!(drawn.kept.take().is_some());
    let (kept, stages) = solved(fine);
    assert_eq!(stages.iter().filter(|s| *s == "factorisation").count(), 1);
    assert_eq!(kept, solved(drawn).0);
    // each corner is within a cell that is marked
    for corner in [[0.8, 0.45], [1.2, 0.45], [0.8, 0.55], [1.2, 0.55]] {
        let near = |x: &&[f64; 2]| (x[0] - corner[0]).hypot(x[1] - corner[1]) < 0.04;
        assert!(cells.iter().any(|x| near(&x)), "{corner:?}");
    }
}

/// The error of elements in a field grows with the length over which bonds weigh it: the micromodulus of the scene's law decides, no other.
#[test]
fn bonds_that_weigh_their_far_ends_more_show_a_larger_error() {
    let error = |micromodulus: &str| -> f64 {
        let cutout = "mesh.rectangle.cutouts.slit={min=[0.8,0.45],max=[1.2,0.55]}";
        let law = format!("materials.plate.bond-based.micromodulus={micromodulus}");
        let scene = plate(&[cutout, LENIENT, &law]);
        let why = scene
            .placement
            .as_ref()
            .expect("a placement")
            .choice
            .why
            .clone();
        let told = why.split_once("errs by ").expect("an error").1;
        told.split(' ').next().unwrap().parse().expect("a number")
    };
    // ∫ λ r⁷ dr over ∫ λ r⁵ dr in 2D: 3/5, 4/6 and 6/8 of δ²
    let least = error("inverse-distance");
    for (micromodulus, ratio) in [("inverted-triangular", 4.0 / 3.6), ("uniform", 6.0 / 4.8)] {
        let found = error(micromodulus) / least;
        assert!(
            (found / ratio - 1.0).abs() < 0.02,
            "{micromodulus}: {found} {ratio}"
        );
    }
}

#[test]
fn wrong_zones_are_refused_with_the_key_and_the_remedy() {
    let error = |text: &str, overrides: &[&str]| load(text, overrides).expect_err("wrong");
    let without = PLATE.replace(
        "[peridynamics]\nhorizon = 0.15\npoints.lattice = { spacing = 0.05 }\n",
        "",
    );
    let missing = error(&without, &[]);
    assert_eq!(missing.kind(), SceneErrorKind::Missing);
    assert!(missing.to_string().contains("zones.auto"), "{missing}");
    let both = error(PLATE, &["zones.nonlocal.everywhere=true"]);
    assert_eq!(both.kind(), SceneErrorKind::Conflict);
    for key in ["padding=0.5", "tolerance=0", "stretch=1.5"] {
        let wrong = error(PLATE, &[&format!("zones.auto.{key}")]);
        assert_eq!(wrong.kind(), SceneErrorKind::WrongValue, "{key}");
        assert!(wrong.to_string().contains("zones.auto."), "{wrong}");
    }
    // held along y only: free to move along x
    let loose = PLATE.replacen("x = 0\ny = 0\n", "y = 0\n", 1);
    let loose = loose.replacen("x = 0\ny = 0.01", "y = 0.01", 1);
    let unsolved = error(&loose, &[]);
    assert!(
        unsolved.to_string().contains("elements alone"),
        "{unsolved}"
    );
    // the name replaces zones that were drawn
    let drawn = PLATE.replace("zones = \"auto\"\n", "") + "[zones.nonlocal]\neverywhere = true\n";
    let replaced = load(&drawn, &["zones=auto"]).expect("a scene");
    assert!(matches!(replaced, AnyScene::Plane(s) if s.placement.is_some()));
}

#[test]
fn a_scene_allocates_what_it_needs() {
    // no bond and no point where all is local
    let (problem, _) = setup::problem(bar(&[]).scene);
    let (model, coupling) = problem.lay_out(None, &Silent).expect("a model");
    assert!(model.body().is_none());
    assert_eq!(model.spacing(), 0.0);
    // one component per site in one dimension
    let (u, _) = solved(bar(&[]));
    assert_eq!(u.len(), 201);
    assert_eq!(std::mem::size_of_val(&model.sites[0].position), 8);
    let operator = coupling.operator(&model).expect("rows");
    let stiffness = model.assemble(&operator, &Silent);
    assert_eq!((stiffness.block, stiffness.dofs()), (1, 201));
    // of a lattice that moves, bits of damage where bonds can break and none where they cannot
    let crack = "cracks.slit.segment={from=[0.8,0.5],to=[1.2,0.5]}";
    let (problem, _) = setup::problem(plate(&[crack, LENIENT]).scene);
    let (model, coupling) = problem.lay_out(None, &Silent).expect("a model");
    let operator = coupling.operator(&model).expect("rows");
    let bits = |critical_stretch: Option<f64>| {
        let behaviour = BondBehaviour {
            kinematics: BondKinematics::Linear,
            failure: critical_stretch.map(BondThreshold::Uniform),
            softening: None,
            no_fail: &|_| false,
            contact: None,
            storage: crate::peridynamics::bond_force::Storage::Double,
            broken: None,
            heat: None,
        };
        let symmetry = coupling.symmetry();
        CoupledSystem::new(&model, &operator, symmetry, |_| 1.0, &behaviour)
            .expect("a motion")
            .pass()
            .expect("bonds")
            .damage_state()
            .len()
    };
    assert_eq!(bits(None), 0);
    let directed = model.body().map_or(0, |b| b.bond_count());
    assert!(bits(Some(0.1)) * 64 >= directed);
}
