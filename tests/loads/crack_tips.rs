//! Energy release rate and stress intensity factors at the tips of cracks, against the handbook and beam theory.

use bondline::observe::tip_summary::TipSummary;

use super::{Done, refused, run};

/// A plate of edges 40 with a crack of the half-length 1, 20 spacings, in its centre under a tension of 1; E = 1.
fn plate(degrees: f64) -> String {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let reach = |part: f64| (10.0 * (part + 0.375)).ceil() / 10.0;
    let [zx, zy] = [reach(cos), reach(sin)];
    let [fx, fy] = [zx + 0.3, zy + 0.3];
    format!(
        r#"
kinematics = "plane-stress"
coupling = "truncated"
[mesh.rectangle]
min = [-20, -20]
max = [20, 20]
x = {{ graded = {{ fine = [-{fx}, {fx}], spacing = 0.1, growth = 1.2, largest = 2 }} }}
y = {{ graded = {{ fine = [-{fy}, {fy}], spacing = 0.1, growth = 1.2, largest = 2 }} }}
[materials.plate.lps]
youngs-modulus = 1
poisson-ratio = 0.3
[peridynamics]
horizon = 0.15
points.lattice = {{ spacing = 0.05, origin = [0.025, 0.025] }}
[zones.nonlocal]
box = {{ min = [-{zx}, -{zy}], max = [{zx}, {zy}] }}
[cracks.slit]
segment = {{ from = [-{cos}, -{sin}], to = [{cos}, {sin}] }}
[conditions]
top.traction = {{ on = "top", y = 1 }}
bottom.traction = {{ on = "bottom", y = -1 }}
pin.displacement = {{ inside.ball = {{ center = [-20, -20], radius = 1e-6 }}, x = 0, y = 0 }}
roll.displacement = {{ inside.ball = {{ center = [20, -20], radius = 1e-6 }}, y = 0 }}
[output]
vtu = false
tips.right = {{ direction = [1, 0.1], energy-release = true }}
tips.left = {{ direction = [-1, -0.1], energy-release = true }}
"#
    )
}

/// Bonds that act alone.
const BOND_BASED: &str = "materials={plate={bond-based={youngs-modulus=1}}}";

fn tip<'a>(done: &'a Done, name: &str) -> &'a TipSummary {
    done.summary.tips.iter().find(|t| t.tip == name).unwrap()
}

/// Compares factors, and J with K²/E′, with those of the handbook; factors within a hundredth of √(K_I² + K_II²), J within a part of itself.
fn near(found: &TipSummary, factors: [f64; 2], modulus: f64, of_rate: f64) {
    let size = factors[0].hypot(factors[1]);
    let rate = size * size / modulus;
    println!("{found}; of the handbook {rate}, {factors:?}");
    for (k, factor) in factors.iter().enumerate() {
        let own = found.stress_intensity[k];
        assert!((own - factor).abs() < 0.006 * size, "{k}: {found}");
        assert!(found.stress_intensity_spread[k] < 0.01, "{k}: {found}");
    }
    let own = found.energy_release_rate;
    assert!((own / rate - 1.0).abs() < of_rate, "{found}: {rate}");
    assert_eq!(found.rings.len(), 3);
}

#[test]
fn a_slanted_crack_has_the_factors_of_the_handbook_in_both_modes() {
    let tension = std::f64::consts::PI.sqrt();
    for degrees in [0.0_f64, 30.0, 45.0, 60.0] {
        let done = run(&plate(degrees), &[]);
        let (sin, cos) = degrees.to_radians().sin_cos();
        // [Tada2000]; the plate is 20 cracks wide, a part in a thousand
        let factors = [tension * cos * cos, tension * sin * cos];
        for name in ["right", "left"] {
            near(tip(&done, name), factors, 1.0, 0.015);
        }
    }
}

#[test]
fn bonds_that_act_alone_and_plane_strain_have_them_too() {
    let tension = std::f64::consts::PI.sqrt();
    let done = run(&plate(0.0), &[BOND_BASED]);
    // faces that are softer give way under the stress along them: 2 % of the energy
    near(tip(&done, "right"), [tension, 0.0], 1.0, 0.035);
    let strain = [
        "kinematics=plane-strain",
        "materials.plate.lps.poisson-ratio=0.2",
    ];
    let done = run(&plate(0.0), &strain);
    let modulus = 1.0 / (1.0 - 0.04);
    near(tip(&done, "right"), [tension, 0.0], modulus, 0.015);
}

/// A double cantilever of arms with the height 1 and a crack of 4, whose ends are moved apart.
const CANTILEVER: &str = r#"
kinematics = "plane-stress"
coupling = "truncated"
[mesh.rectangle]
min = [0, -1]
max = [10, 1]
x = { spacing = 0.1 }
y = { spacing = 0.1 }
[materials.arm.lps]
youngs-modulus = 1
poisson-ratio = 0.3
[peridynamics]
horizon = 0.15
points.lattice = { spacing = 0.05, origin = [0.025, 0.025] }
[zones.nonlocal]
box = { min = [-1, -0.4], max = [4.5, 0.4] }
[cracks.slit]
segment = { from = [-1, 0], to = [4, 0] }
[conditions]
end.displacement = { on = "right", x = 0, y = 0 }
upper.displacement = { inside.ball = { center = [0, 1], radius = 1e-3 }, y = "0.5*t" }
lower.displacement = { inside.ball = { center = [0, -1], radius = 1e-3 }, y = "-0.5*t" }
[output]
vtu = false
tips.front = { direction = [1, 0], energy-release = true }
"#;

#[test]
fn a_double_cantilever_releases_the_energy_of_beams_that_shear_and_turn_at_their_roots() {
    // time is zero at rest
    let finer = [
        "mesh.rectangle.x.spacing=0.05",
        "mesh.rectangle.y.spacing=0.05",
        "peridynamics.horizon=0.075",
        "peridynamics.points.lattice={spacing=0.025,origin=[0.0125,0.0125]}",
    ];
    let done = run(&CANTILEVER.replace("*t", ""), &finer);
    let force = done.reaction("upper")[1];
    // [FooteBuchwald1985]
    let rate = 12.0 * (force * (4.0 + 0.673)).powi(2);
    let found = tip(&done, "front");
    println!("{found}; of beams {rate}");
    assert!(
        (found.energy_release_rate / rate - 1.0).abs() < 0.02,
        "{rate}"
    );
    assert!(found.energy_release_rate_spread < 0.01);
}

/// At prescribed displacements `J = −dU/da`, whatever the model.
#[test]
fn a_double_cantilever_loses_the_energy_that_the_integral_tells() {
    let text = CANTILEVER.replace("*t", "");
    for law in [
        "lps={youngs-modulus=1,poisson-ratio=0.3}",
        "bond-based={youngs-modulus=1}",
    ] {
        let law = format!("materials={{arm={{{law}}}}}");
        let with_end = |x: f64| run(&text, &[&law, &format!("cracks.slit.segment.to=[{x},0]")]);
        let energy = |x: f64| with_end(x).summary.energy.unwrap();
        let lost = (energy(3.95) - energy(4.05)) / 0.1;
        let found = tip(&with_end(4.0), "front").energy_release_rate;
        println!("{law}: {found}, {lost}");
        assert!((found / lost - 1.0).abs() < 0.01, "{law}: {found}, {lost}");
    }
}

#[test]
fn load_steps_have_the_factors_of_each_state_in_the_table_of_the_tip() {
    let still = run(&CANTILEVER.replace("*t", ""), &[]);
    let still = tip(&still, "front");
    let done = run(CANTILEVER, &["solve={quasi-static={steps=2}}"]);
    let column = |name: &str| done.column("scene_tip_front.csv", name);
    assert_eq!(column("time"), [0.0, 0.5, 1.0]);
    assert_eq!(column("x"), [4.0; 3]);
    let rates = column("energy_release_rate");
    for (found, part) in rates.iter().zip([0.0, 0.25, 1.0]) {
        let exact = part * still.energy_release_rate;
        assert!(
            (found - exact).abs() < 1e-6 * still.energy_release_rate,
            "{rates:?}"
        );
    }
    let opening = column("stress_intensity_1");
    assert!((opening[2] / still.stress_intensity[0] - 1.0).abs() < 1e-6);
    assert_eq!(column("energy_release_rate_spread").len(), 3);
    assert_eq!(done.summary.tips.len(), 1);
}

#[test]
fn a_crack_that_grows_releases_the_energy_that_it_takes() {
    let done = run(
        CANTILEVER,
        &[
            "materials.arm.lps.fracture-energy=2e-4",
            "zones.nonlocal.box.max=[7,0.4]",
            "solve={quasi-static={steps=[0.3,0.6,0.7,0.8,0.9,1]}}",
        ],
    );
    let column = |name: &str| done.column("scene_tip_front.csv", name);
    let [x, rates] = [column("x"), column("energy_release_rate")];
    println!("{x:?} {rates:?} {:?}", column("stress_intensity_1"));
    println!("{:?}", column("energy_release_rate_spread"));
    let grown: Vec<usize> = (0..x.len()).filter(|&k| x[k] > 4.2).collect();
    assert!(grown.len() > 1 && x.is_sorted(), "{x:?}");
    for k in grown {
        // a lattice traps a crack by up to 6 % of its load
        let part = rates[k] / 2e-4;
        assert!(part > 1.0 && part < 1.15, "{rates:?}");
    }
}

#[test]
fn rings_that_leave_the_homogeneous_body_and_scenes_beyond_the_integral_are_refused() {
    let text = plate(0.0);
    let cases: [(&[&str], [&str; 2]); 9] = [
        (
            &["output.tips.right.radii=[0.3,0.6,0.9]"],
            [
                "`output.tips.right.radii` has 3 of at least 4 radii",
                "three domains",
            ],
        ),
        (
            &["output.tips.right.radii=[0.3,0.6,0.5,0.9]"],
            ["has 0.5 after a radius as large", "from the smallest"],
        ),
        (
            &["output.tips.right.radii=[0.3,0.6,0.9,2.5]"],
            [
                "has 2.5, and the rest of the crack `slit` is 2.0000",
                "smaller radii",
            ],
        ),
        (
            &[
                "output.tips.right.energy-release=false",
                "output.tips.right.radii=[1]",
                "materials.plate.lps.critical-stretch=1",
            ],
            [
                "`output.tips.right.radii` are radii of nothing",
                "energy-release = true",
            ],
        ),
        (
            &["conditions.weight.body-force.y=-1"],
            [
                "`output.tips.left.energy-release` knows no body force",
                "conditions.weight",
            ],
        ),
        (
            &[
                "temperature.value=\"1\"",
                "materials.plate.lps.thermal-expansion=1e-5",
            ],
            ["knows no thermal strain", "leave `temperature` out"],
        ),
        (&["cracks={}"], ["no crack ends there", "[cracks.NAME]"]),
        (
            &["cracks.slit.segment.from=[0.8,0]"],
            [
                "three horizons around the tip, 0.4500, meet the rest of the crack",
                "smaller horizon",
            ],
        ),
        (
            &[
                "solve={explicit={duration=1}}",
                "materials.plate.lps.density=1",
            ],
            ["knows no inertia", "in load steps"],
        ),
    ];
    for (overrides, parts) in cases {
        refused(&text, overrides, &parts);
    }
}
