//! Settings of a plate, and their combinations.

use super::*;
use bondline::scene::Source;

const PLATE: &str = r#"
kinematics = "plane-stress"
coupling = "splice"
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 40 }, y = { cells = 20 } }
[materials.plate.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05, origin = [0, 0] }
[zones.nonlocal]
box = { min = [0.7, 0.3], max = [1.3, 0.7] }
[conditions.left.displacement]
on = "left"
x = 0
y = 0
[conditions.right.displacement]
on = "right"
x = 0.01
"#;

fn base() -> Base {
    let source = Source::new("plate", PLATE);
    Base::of(&SceneSpec::parse(&source).unwrap())
}

fn admitted(overrides: &[String]) {
    let mut source = Source::new("plate", PLATE);
    for o in overrides {
        source.push_override(o).unwrap();
    }
    if let Err(e) = crate::from_source(&source, std::path::Path::new(""), "plate") {
        panic!("{overrides:?}: {}", e.message());
    }
}

#[test]
fn every_setting_makes_a_scene() {
    let base = base();
    let knobs = base.knobs();
    let names: Vec<&str> = knobs.iter().map(|k| k.name.as_str()).collect();
    assert_eq!(names, ["coupling", "horizon", "m", "elements", "padding"]);
    for setting in knobs.iter().flat_map(|k| &k.settings) {
        let overrides = base.overrides([&setting.change]);
        assert!(!overrides.is_empty(), "{}", setting.label);
        admitted(&overrides);
    }
}

#[test]
fn what_moves_has_knobs_of_its_own() {
    let named = |solve: &str| {
        let mut source = Source::new("plate", PLATE);
        source
            .push_override("materials.plate.bond-based.density=1")
            .unwrap();
        source.push_override(solve).unwrap();
        let knobs = Base::of(&SceneSpec::parse(&source).unwrap()).knobs();
        for setting in knobs.iter().flat_map(|k| &k.settings) {
            if let Change::Keys(keys) = &setting.change {
                admitted(
                    &[
                        &[
                            "materials.plate.bond-based.density=1".to_owned(),
                            solve.to_owned(),
                        ],
                        &keys[..],
                    ]
                    .concat(),
                );
            }
        }
        let more = knobs.into_iter().map(|k| k.name).skip(5);
        more.collect::<Vec<_>>()
    };
    assert_eq!(
        named("solve.explicit.duration=1"),
        ["step-fraction", "precision"]
    );
    assert_eq!(named("solve.quasi-static.steps=2"), ["precision"]);
}

#[test]
fn settings_combine() {
    let base = base();
    let all = [
        Change::Coupling("truncated".to_owned()),
        Change::Horizon(2.0),
        Change::Ratio(6.0),
        Change::Elements(2.0),
        Change::Padding(1.0),
    ];
    let overrides = base.overrides(&all);
    // δ = 0.3, h = 0.05 as before, elements twice as large
    for wanted in [
        "coupling=truncated",
        "peridynamics.horizon=3e-1",
        "mesh.rectangle.x.cells=20",
        "mesh.rectangle.y.cells=10",
    ] {
        assert!(overrides.iter().any(|o| o == wanted), "{overrides:?}");
    }
    assert!(
        overrides
            .iter()
            .any(|o| o.starts_with("peridynamics.points.lattice.origin=[2.5e-2")),
        "{overrides:?}"
    );
    assert!(!overrides.iter().any(|o| o.contains("lattice.spacing")));
    admitted(&overrides);
}

#[test]
fn a_typed_knob_is_a_list() {
    let knob = typed("solver.tolerance=[1e-4, 1e-8]").unwrap();
    assert_eq!(knob.settings.len(), 2);
    assert_eq!(knob.settings[0].label, "tolerance = 0.0001");
    assert!(typed("solver.tolerance").unwrap_err().contains("no `=`"));
    assert!(typed("a=3").unwrap_err().contains("no list"));
    assert!(typed("a=[]").unwrap_err().contains("no values"));
}

/// A transition zone two horizons wide on either side stays so at half the horizon; at four times the horizon it would leave the plate, and stays as it is typed.
#[test]
fn a_transition_zone_keeps_its_width_in_horizons() {
    let mut source = Source::new("plate", PLATE);
    for o in [
        "coupling=blending",
        "zones.transition.box.min=[0.25, -1]",
        "zones.transition.box.max=[1.75, 2]",
        "zones.nonlocal.box.min=[0.75, -1]",
        "zones.nonlocal.box.max=[1.25, 2]",
    ] {
        source.push_override(o).unwrap();
    }
    let base = Base::of(&SceneSpec::parse(&source).unwrap());
    let transition = |factor: f64| {
        let all = base.overrides(&base.scaled(factor));
        let of_zone = |o: &String| o.starts_with("zones.transition");
        all.into_iter().filter(of_zone).collect::<Vec<_>>()
    };
    assert_eq!(
        transition(0.5),
        [
            "zones.transition.box.min=[5e-1, -1e0]",
            "zones.transition.box.max=[1.5e0, 2e0]"
        ]
    );
    assert_eq!(transition(1.0), Vec::<String>::new());
    assert_eq!(transition(4.0), Vec::<String>::new());
    source
        .push_override("zones.transition={ around = 0.3 }")
        .unwrap();
    let base = Base::of(&SceneSpec::parse(&source).unwrap());
    let all = base.overrides(&base.scaled(0.5));
    assert!(
        all.contains(&"zones.transition.around=1.5e-1".to_owned()),
        "{all:?}"
    );
}
