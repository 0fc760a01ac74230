//! Load steps before a motion: equilibrium that stays one, waves of what is let go or strikes, and what is carried over.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use bondline::observe::summary::Ended;
use bondline::progress::{Progress, Silent};
use bondline::run::AnyScene;
use bondline::run::motion::{RunOptions, StartFrom};
use bondline::scene::Source;

use super::{Done, refused, run};

/// A bar of length 1 and wave speed 5 that is held at its left end and pulled at its right one.
const BAR: &str = r#"
kinematics = "bar"
coupling = "local"
solve = ["load", "impact"]
mesh.line = { min = 0, max = 1, x = { cells = 400 } }
materials.m.lps = { youngs-modulus = 50, poisson-ratio = 0, density = 2 }
conditions.held.displacement = { on = "left", x = 0 }
conditions.pull.traction = { on = "right", x = "0.5 * t" }
stages.load.quasi-static.steps = 2
stages.impact.explicit = { duration = 0.3, outputs = 1, history-interval = 0.001 }
[output]
vtu = false
probes.tip.at = 1
probes.middle.at = 0.5
"#;

/// Stress over modulus of the pulled bar.
const STRAIN: f64 = 0.01;
/// Wave speed of the bar.
const SPEED: f64 = 5.0;

const LOAD: &str = "scene_load_history.csv";
const MOTION: &str = "scene_history.csv";

/// The largest kinetic energy of the motion over the energy stored when it began.
fn unrest(done: &Done) -> f64 {
    let kinetic = done.column(MOTION, "kinetic_energy");
    let largest = kinetic.iter().fold(0.0, |most: f64, k| most.max(*k));
    let stored = done.column(MOTION, "stored_energy")[0];
    assert!(kinetic.len() > 20 && stored > 0.0, "{stored}");
    largest / stored
}

/// Plates with every kind of seam and bonds, elements of second order, a temperature, springs and a body force; bodies that flow.
#[test]
fn a_body_that_is_left_in_peace_stays_at_rest() {
    let plate = r#"
kinematics = "plane-stress"
solve = ["load", "impact"]
mesh.rectangle = { min = [0, 0], max = [2, 1], x = { cells = 20 }, y = { cells = 10 } }
conditions.held.displacement = { on = "left", x = 0, y = 0 }
conditions.pull.traction = { on = "right", x = "2e-3 * t", y = "1e-3 * t" }
conditions.weight.body-force = { y = "-1e-3 * x" }
conditions.bed.spring = { on = "bottom", normal = 0.1 }
stages.load.quasi-static.steps = 2
stages.impact.explicit = { duration = 5, outputs = 1, history-interval = 0.1 }
output.vtu = false
[materials.m.lps]
youngs-modulus = 1
poisson-ratio = 0.3
density = 1
"#;
    let zone = "zones.nonlocal={box={min=[0.7,0.2],max=[1.3,0.8]}}";
    let points = "peridynamics={horizon=0.21,bonds=\"exact\",points={lattice={spacing=0.1}}}";
    let linear = "peridynamics={horizon=0.21,points={lattice={spacing=0.1}}}";
    let breaking = "materials.m.lps.critical-stretch=0.5";
    let heat = "temperature={value=\"2*x\",reference=0}";
    let expands = "materials.m.lps.thermal-expansion=1e-3";
    let softens = "materials.m.lps.fracture-energy=5e-6";
    let tough = "materials.m.lps.fracture-energy=7e-3";
    let slowly = "conditions.pull={displacement={on=\"right\",x=\"6e-3 * t\"}}";
    let pressed = "conditions.pull={displacement={on=\"right\",x=\"-6e-3 * t\"}}";
    let slit = "cracks={c={segment={from=[0.75,0],to=[0.75,1]}}}";
    let j2 = "materials.m={plastic-correspondence={youngs-modulus=1,poisson-ratio=0.3,density=1,yield-stress=2e-3,hardening-modulus=0.1}}";
    for overrides in [
        &["coupling=\"local\""][..],
        &["coupling=\"local\"", "mesh.rectangle.cell=\"quad8\""],
        &["coupling=\"local\"", heat, expands],
        &["coupling=\"local\"", j2],
        &["coupling=\"nonlocal\"", points],
        &["coupling=\"nonlocal\"", points, heat, expands, breaking],
        &["coupling=\"nonlocal\"", points, softens, slowly],
        &[
            "coupling=\"nonlocal\"",
            points,
            tough,
            slit,
            pressed,
            "contact={friction=0.3}",
        ],
        &["coupling=\"truncated\"", linear, zone],
        &["coupling=\"truncated\"", points, zone, breaking],
        &["coupling=\"splice\"", points, zone, breaking],
        &["coupling=\"splice\"", linear, zone, j2],
        &[
            "coupling=\"blending\"",
            linear,
            zone,
            "zones.transition={around=0.2}",
        ],
    ] {
        let done = run(plate, overrides);
        let rest = unrest(&done);
        if overrides.contains(&softens) {
            assert!(done.column(MOTION, "dissipated_energy")[0] > 0.0);
        }
        println!("{overrides:?}: {rest:.1e}");
        // velocities below 1e-11 of those that the load would give if it came at once; measured 1e-13 at most
        assert!(rest < 1e-22, "{overrides:?}: {rest:e}");
    }
}

#[test]
fn rows_of_the_motion_go_on_where_those_of_the_load_end() {
    let done = run(BAR, &[]);
    for column in [
        "stored_energy",
        "external_work",
        "tip_ux",
        "middle_ux",
        "held_reaction_x",
    ] {
        let (before, after) = (done.column(LOAD, column), done.column(MOTION, column));
        let (last, first) = (*before.last().unwrap(), after[0]);
        assert!(
            (last - first).abs() <= 1e-12 * last.abs(),
            "{column}: {last} {first}"
        );
        assert!(last != 0.0, "{column}");
    }
    let stored = done.column(MOTION, "stored_energy")[0];
    assert!((stored - 0.5 * 50.0 * STRAIN * STRAIN).abs() < 1e-9 * stored);
    let momentum = done.column(MOTION, "momentum_x");
    assert!(momentum.iter().all(|p| p.abs() < 1e-10), "{momentum:?}");
    let [stage] = &done.summary.stages[..] else {
        panic!("{:?}", done.summary.stages)
    };
    assert_eq!((stage.stage.as_str(), stage.motion.steps), ("load", 2));
    assert!((stage.applied[0].force[0] - 0.5).abs() < 1e-12);
    assert!((stage.reactions[0].force[0] + 0.5).abs() < 1e-9);
}

/// The pulled end is let go: a wave of unloading with the particle velocity −c ε runs in, and all energy of the strain is kinetic when it arrives at the other.
#[test]
fn an_end_that_is_let_go_sends_a_wave_of_unloading() {
    let done = run(BAR, &["conditions.pull.traction.stages=[\"load\"]"]);
    let (t, stored) = (
        done.column(MOTION, "time"),
        done.column(MOTION, "stored_energy"),
    );
    let (kinetic, tip) = (
        done.column(MOTION, "kinetic_energy"),
        done.column(MOTION, "tip_ux"),
    );
    let middle = done.column(MOTION, "middle_ux");
    for k in 0..t.len() {
        // u at the free end falls with the velocity −c ε until the wave comes back from the held one
        let (exact, half) = match t[k] < 2.0 / SPEED {
            true => (
                STRAIN * (1.0 - SPEED * t[k]),
                STRAIN * (0.5 - (SPEED * t[k] - 0.5).clamp(0.0, 1.0)),
            ),
            false => continue,
        };
        assert!(
            (tip[k] - exact).abs() < 0.004 * STRAIN,
            "{}: {} {exact}",
            t[k],
            tip[k]
        );
        assert!(
            (middle[k] - half).abs() < 0.004 * STRAIN,
            "{}: {} {half}",
            t[k],
            middle[k]
        );
        let energy = kinetic[k] + stored[k];
        assert!(
            (energy / stored[0] - 1.0).abs() < 0.01,
            "{}: {energy}",
            t[k]
        );
    }
    let at = t
        .iter()
        .position(|t| (t - 1.0 / SPEED).abs() < 6e-4)
        .unwrap();
    assert!(
        (kinetic[at] / stored[0] - 1.0).abs() < 0.02,
        "{}",
        kinetic[at] / stored[0]
    );
}

/// A pulled bar whose held end is then struck moves as one without stress that is struck, d'Alembert's solution, added to what it has.
#[test]
fn a_blow_on_a_pulled_bar_adds_to_its_stress() {
    let coupled = [
        "coupling=\"truncated\"",
        "materials={m={bond-based={youngs-modulus=50,density=2}}}",
        "peridynamics={horizon=0.0075,points={lattice={spacing=0.0025}}}",
        "zones.nonlocal={box={min=0.3,max=0.4}}",
    ];
    let blow = "conditions.blow={velocity={on=\"left\",x=\"0.02 * sin(min(1, t / 0.08) * pi)^2\"}}";
    let free = "conditions.held.displacement.stages=[\"load\"]";
    for coupling in [&coupled[..1], &coupled] {
        let coupling = if coupling.len() == 1 {
            &[][..]
        } else {
            coupling
        };
        let done = run(BAR, &[coupling, &[blow, free]].concat());
        let (t, middle) = (
            done.column(MOTION, "time"),
            done.column(MOTION, "middle_ux"),
        );
        let mut largest = 0.0f64;
        for (t, u) in t.iter().zip(middle).filter(|(t, _)| **t < 1.5 / SPEED) {
            let s = (t - 0.5 / SPEED).clamp(0.0, 0.08);
            // the integral of the velocity over the time since it has arrived
            let way = 0.02
                * (s / 2.0
                    - 0.08 / (4.0 * std::f64::consts::PI)
                        * (2.0 * std::f64::consts::PI * s / 0.08).sin());
            largest = largest.max((u - STRAIN * 0.5 - way).abs());
        }
        let most = 0.02 * 0.04;
        println!("{coupling:?}: {:.1e}", largest / most);
        assert!(largest < 2e-3 * most, "{coupling:?}: {largest} of {most}");
    }
}

/// Plastic strain and its dissipation last, and so does what has broken.
#[test]
fn history_lasts_through_the_stages() {
    let flows = "materials={m={plastic-correspondence={youngs-modulus=50,poisson-ratio=0,density=2,yield-stress=0.3,hardening-modulus=10}}}";
    let done = run(
        BAR,
        &[
            flows,
            "conditions.pull.traction.stages=[\"load\"]",
            "stages.impact.explicit.duration=4",
            "mesh.line.x.cells=100",
        ],
    );
    let (before, after) = (
        done.column(LOAD, "dissipated_energy"),
        done.column(MOTION, "dissipated_energy"),
    );
    // plastic strain (σ − σ_y)/H; with linear hardening the work beyond σ_y is stored
    let flow = 0.2 / 10.0;
    let exact = 0.3 * flow;
    let last = *before.last().unwrap();
    assert!((last / exact - 1.0).abs() < 1e-6, "{last} {exact}");
    assert_eq!(last, after[0]);
    // it swings about the strain that is left
    let tip = done.column(MOTION, "tip_ux");
    let mean = tip.iter().sum::<f64>() / tip.len() as f64;
    assert!((mean / flow - 1.0).abs() < 0.05, "{mean} {flow}");
}

#[test]
fn bonds_that_broke_under_the_load_stay_broken() {
    let done = run(
        BAR,
        &[
            "coupling=\"nonlocal\"",
            "mesh.line.x.cells=100",
            "peridynamics={horizon=0.03,points={lattice={spacing=0.01}}}",
            "materials.m.lps.critical-stretch=0.005",
            "no-fail.left={box={min=0,max=0.8}}",
            "conditions.pull={displacement={on=\"right\",x=\"0.01 * t\"}}",
        ],
    );
    let (before, after) = (
        done.column(LOAD, "broken_bonds"),
        done.column(MOTION, "broken_bonds"),
    );
    let last = *before.last().unwrap();
    assert!(last > 0.0, "{before:?}");
    assert!(after.iter().all(|n| *n == last), "{last} {after:?}");
}

/// A rigid mass that strikes the stretched bar slows as on one without stress: `v₀ exp(−ρ c t/M)` until the echo returns.
#[test]
fn a_rigid_mass_meets_a_bar_where_its_load_has_left_it() {
    let ram = "impactors.ram={plane={point=1.01001,normal=-1},mass=1,velocity={x=-0.01}}";
    let done = run(BAR, &[ram]);
    let (t, v) = (done.column(MOTION, "time"), done.column(MOTION, "ram_vx"));
    let energy = done.column(MOTION, "kinetic_energy")[0];
    assert!((energy - 0.5 * 0.01f64.powi(2)).abs() < 1e-15, "{energy}");
    let mut largest = 0.0f64;
    for (t, v) in t.iter().zip(v) {
        let since = (t - 1e-5 / 0.01).max(0.0);
        let exact = -0.01 * (-2.0 * SPEED * since).exp();
        largest = largest.max((v - exact).abs() / 0.01);
    }
    println!("{largest:.1e}");
    assert!(largest < 0.02, "{largest}");
    // where the load leaves no room
    let inside = super::read(
        BAR,
        &[
            &ram.replace("1.01001", "1.005"),
            "output.directory=\"unused\"",
        ],
    );
    let error = inside.unwrap().solve(&Silent).unwrap_err().to_string();
    assert!(error.contains("ram"), "{error}");
}

/// Asks a run to end after so many advances within a stage of its work.
struct EndsAt {
    stage: &'static str,
    at: u64,
    counts: AtomicBool,
    seen: AtomicU64,
    asked: AtomicBool,
}

impl Progress for EndsAt {
    fn stage(&self, name: &str, _: Option<u64>) {
        self.counts.store(name == self.stage, Ordering::Relaxed);
    }
    fn advance(&self, by: u64) {
        let counts = self.counts.load(Ordering::Relaxed);
        if counts && self.seen.fetch_add(by, Ordering::Relaxed) + by >= self.at {
            self.asked.store(true, Ordering::Relaxed);
        }
    }
    fn finish(&self) {}
}

#[test]
fn a_run_that_stops_in_either_stage_resumes_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    // a velocity goes on from where the load has left the body
    let text = BAR
        .replace("vtu = false", "vtu = true")
        .replace("steps = 2", "steps = 4")
        .replace(
            "\"0.5 * t\" }",
            "\"0.5 * t\", stages = [\"load\"] }\nconditions.grip.velocity = { on = \"right\", x = \"0.01 * sin(20 * t)\" }",
        );
    let go = |name: &str, start: StartFrom, stage: &'static str, at: u64| {
        let source = Source::new("scene.toml", &text);
        let mut scene = AnyScene::from_source(&source, Path::new("."), "scene").unwrap();
        scene.set_output_directory(folder.path().join(name));
        let ends = EndsAt {
            stage,
            at,
            counts: AtomicBool::new(false),
            seen: AtomicU64::new(0),
            asked: AtomicBool::new(false),
        };
        let options = RunOptions {
            start,
            interrupt: Some(&ends.asked),
            ..RunOptions::default()
        };
        scene.run_with(&options, &ends).unwrap()
    };
    go("whole", StartFrom::Beginning, "", 0);
    for (name, stage, at) in [("load", "load steps", 1), ("motion", "steps", 200)] {
        let part = go(name, StartFrom::Beginning, stage, at);
        assert_eq!(
            part.motion.as_ref().map(|m| m.ended),
            Some(Ended::Interrupted),
            "{name}"
        );
        assert_eq!(part.stages.len(), usize::from(name == "motion"));
        let rest = go(name, StartFrom::Checkpoint, "", 0);
        assert_eq!(
            rest.motion.map(|m| m.ended),
            Some(Ended::Finished),
            "{name}"
        );
        for file in [
            LOAD,
            MOTION,
            "scene_load.pvd",
            "scene.pvd",
            "scene_load_0004.vtu",
            "scene_0001.vtu",
        ] {
            let [a, b] = ["whole", name]
                .map(|run| std::fs::read(folder.path().join(run).join(file)).unwrap());
            assert!(a == b, "{name}: {file} differs");
        }
    }
}

/// Rows of both stages, each by its name.
#[test]
fn a_program_has_the_tables_of_both_stages() {
    let source = Source::new("scene.toml", BAR);
    let scene = AnyScene::from_source(&source, Path::new("."), "scene").unwrap();
    let solution = scene.solve(&Silent).unwrap();
    assert_eq!(solution.table("load_history").unwrap().rows.len(), 3);
    assert!(solution.history("tip_ux").unwrap().len() > 100);
}

#[test]
fn a_condition_that_begins_elsewhere_than_the_body_is_refused() {
    let jump = "conditions.grip={displacement={on=\"right\",x=0,stages=[\"impact\"]}}";
    let scene = super::read(BAR, &[jump, "output.directory=\"unused\""]).unwrap();
    let error = scene.solve(&Silent).unwrap_err().to_string();
    for part in [
        "`conditions.grip` prescribes the x displacement 0",
        "1.000000e-2",
        "prescribe a velocity",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
    // a velocity goes on from there
    let grip = "conditions.grip={velocity={on=\"right\",x=0}}";
    let done = run(BAR, &[grip, "conditions.pull.traction.stages=[\"load\"]"]);
    assert!(unrest(&done) < 1e-20);
}

#[test]
fn what_is_no_order_of_stages_is_refused_by_name() {
    for (overrides, parts) in [
        (
            &["solve=[\"load\",\"impct\"]"][..],
            &["`solve` names the stage `impct`", "did you mean `impact`?"][..],
        ),
        (
            &["solve=[\"load\"]"],
            &["`stages.impact` is typed, and `solve` does not list it"],
        ),
        (&["solve=[]"], &["`solve` does not list it"]),
        (&["solve=[\"load\",\"load\"]"], &["lists `load` twice"]),
        (
            &["solve=[\"impact\",\"load\"]"],
            &[
                "the stage `impact` is a motion, and others follow it",
                "load steps first",
            ],
        ),
        (
            &["stages.load={static={}}"],
            &[
                "`stages.load` is neither load steps nor a motion",
                "quasi-static with steps = 1",
            ],
        ),
        (
            &["stages.impact={quasi-static={steps=2}}"],
            &[
                "`load` and `impact` are both load steps",
                "one quasi-static stage",
            ],
        ),
        (
            &["stages.third={explicit={duration=1}}"],
            &["`stages.third` is typed, and `solve` does not list it"],
        ),
        (
            &["solve={explicit={duration=1}}"],
            &["`stages.impact` is typed, and `solve` does not list it"],
        ),
    ] {
        refused(BAR, overrides, parts);
    }
}

#[test]
fn what_cannot_act_in_a_stage_is_refused_by_name() {
    for (overrides, parts) in [
        (
            &["stages.load.quasi-static.steps=0"][..],
            &["`stages.load.quasi-static.steps` is 0"][..],
        ),
        (
            &["stages.impact.explicit.duration=-1"],
            &["`stages.impact.explicit.duration`"],
        ),
        (
            &["stages.impact.explicit.length=1"],
            &["`length` is not known in `stages.impact.explicit`"],
        ),
        (
            &["conditions.pull.traction.stages=[\"loud\"]"],
            &[
                "`conditions.pull.stages` names the stage `loud`",
                "did you mean `load`?",
            ],
        ),
        (
            &["conditions.pull.traction.stages=[]"],
            &["`conditions.pull` acts in no stage"],
        ),
        (
            &["conditions.held.displacement.stages=[\"impact\"]"],
            &["nothing holds the body"],
        ),
        (
            &["initial.bent={displacement={x=\"x\"}}"],
            &["`initial.bent.displacement` in a scene of several stages"],
        ),
        (
            &[
                "temperature={value=\"t\"}",
                "materials.m.lps.thermal-expansion=1e-5",
            ],
            &["`temperature.value` depends on the time t in a scene of several stages"],
        ),
        (
            &["zones.auto={}"],
            &["`zones.auto` in a scene of several stages"],
        ),
    ] {
        refused(BAR, overrides, parts);
    }
    let text = BAR.replace(
        "solve = [\"load\", \"impact\"]",
        "solve.explicit.duration = 1",
    );
    let text: String = text
        .lines()
        .filter(|l| !l.starts_with("stages"))
        .map(|l| format!("{l}\n"))
        .collect();
    refused(
        &text,
        &["conditions.pull.traction.stages=[\"load\"]"],
        &["names the stage `load` in a scene without stages"],
    );
}
