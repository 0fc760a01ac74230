//! Laws of solids under a temperature: flow out of the plane and back, and strains of any size, against closed forms.

use super::{Done, run};

/// A body between walls that is heated by `3 σ_y/E` and cooled again, without hardening.
fn heated_and_cooled(kinematics: &str, body: &str) -> String {
    format!(
        r#"
kinematics = "{kinematics}"
materials.m.plastic-correspondence = {{ youngs-modulus = 1000, poisson-ratio = 0.3, yield-stress = 2, density = 1, thermal-expansion = 1e-3 }}
temperature = {{ value = "6*if(t < 0.5, 2*t, 2 - 2*t)" }}
{body}
output.vtu = false
output.stresses = ["von-mises"]
solve.quasi-static = {{ steps = 12, tolerance = 1e-10, outputs = 1 }}
"#
    )
}

/// A column of the probe at the middle of the run and at its end.
fn at_the_turn_and_after(done: &Done, name: &str) -> [f64; 2] {
    let column = done.column("scene_history.csv", name);
    let time = done.column("scene_history.csv", "time");
    let turn = time.iter().position(|t| (t - 0.5).abs() < 1e-9).unwrap();
    [column[turn], *column.last().unwrap()]
}

/// It yields in compression, and on the way back in tension: along a bar, and across the plane of a body that is free within it.
#[test]
fn a_body_that_is_heated_between_walls_yields_both_ways() {
    let points = "peridynamics = { horizon = 0.3, points.lattice.spacing = 0.1 }\n";
    let zone = |shape: &str| format!("{points}zones.nonlocal.box = {{ {shape} }}\n");
    for coupling in ["local", "nonlocal", "splice"] {
        let of = |shape: &str| match coupling {
            "local" => String::new(),
            "nonlocal" => points.to_owned(),
            _ => zone(shape),
        };
        let bar = format!(
            "coupling = \"{coupling}\"\nmesh.line = {{ min = 0, max = 2, x = {{ cells = 20 }} }}\noutput.probes.p.at = 1.0\nconditions.a.displacement = {{ on = \"left\", x = 0 }}\nconditions.b.displacement = {{ on = \"right\", x = 0 }}\n{}",
            of("min = 0.6, max = 1.4")
        );
        let long = format!(
            "coupling = \"{coupling}\"\nmesh.rectangle = {{ min = [0, 0], max = [1.6, 1.6], x = {{ cells = 16 }}, y = {{ cells = 16 }} }}\noutput.probes.p.at = [0.8, 0.8]\nconditions.a.symmetry.on = \"left\"\nconditions.b.symmetry.on = \"bottom\"\n{}",
            of("min = [0.6, 0.6], max = [1.0, 1.0]")
        );
        for (kinematics, body, name) in [("bar", bar, "p_sxx"), ("plane-strain", long, "p_szz")] {
            let done = run(&heated_and_cooled(kinematics, &body), &[]);
            let found = at_the_turn_and_after(&done, name);
            for (found, wanted) in found.into_iter().zip([-2.0, 2.0]) {
                assert!(
                    (found - wanted).abs() < 1e-6,
                    "{found} {wanted} {kinematics} {coupling}"
                );
            }
        }
    }
}

/// The Cauchy stress of a Neo-Hooke bar at the stretch λ whose sides are free, by bisection on the stretch of its sides.
fn uniaxial(young: f64, poisson: f64, stretch: f64) -> f64 {
    let shear = 0.5 * young / (1.0 + poisson);
    let lambda = 2.0 * shear * poisson / (1.0 - 2.0 * poisson);
    let stress = |along: f64, side: f64| {
        let volume = along * side * side;
        (
            lambda * volume.ln(),
            shear * (along * along - 1.0),
            shear * (side * side - 1.0),
            volume,
        )
    };
    let (mut low, mut high) = (0.1, 10.0);
    for _ in 0..200 {
        let side = 0.5 * (low + high);
        let (pressure, _, across, _) = stress(stretch, side);
        if pressure + across > 0.0 {
            high = side
        } else {
            low = side
        }
    }
    let (pressure, along, _, volume) = stress(stretch, low);
    (pressure + along) / volume
}

/// Held at its length, it has the stress of the stretch `1/(1 + α ΔT)`, and pulls with that stress over the section that its sides leave.
#[test]
fn a_neo_hooke_bar_between_walls_has_its_closed_form() {
    for coupling in ["local", "nonlocal", "splice"] {
        let (points, zone) = match coupling {
            "local" => ("", ""),
            "nonlocal" => (
                "peridynamics = { horizon = 0.3, points.lattice.spacing = 0.1, bonds = \"exact\" }",
                "",
            ),
            _ => (
                "peridynamics = { horizon = 0.3, points.lattice.spacing = 0.1, bonds = \"exact\" }",
                "zones.nonlocal.box = { min = [0.6], max = [1.4] }",
            ),
        };
        // points lose bonds at the ends
        let held = match coupling {
            "nonlocal" => "conditions.all.displacement = { inside.everywhere = true, x = 0 }",
            _ => {
                "conditions.a.displacement = { on = \"left\", x = 0 }\nconditions.b.displacement = { on = \"right\", x = 0 }"
            }
        };
        let text = format!(
            r#"
kinematics = "bar"
coupling = "{coupling}"
mesh.line = {{ min = 0, max = 2, x = {{ cells = 20 }} }}
materials.m.neo-hooke = {{ youngs-modulus = 1000, poisson-ratio = 0.3, thermal-expansion = 1e-3 }}
{points}
{zone}
temperature = {{ value = "100*t" }}
{held}
output.probes.p.at = 1.0
output.vtu = false
output.stresses = ["von-mises"]
solve.quasi-static = {{ steps = 4, tolerance = 1e-11, outputs = 1 }}
"#
        );
        let done = run(&text, &[]);
        let wanted = uniaxial(1000.0, 0.3, 1.0 / 1.1);
        let found = *done.column("scene_history.csv", "p_sxx").last().unwrap();
        assert!(
            (found / wanted - 1.0).abs() < 1e-8,
            "{found} {wanted} {coupling}"
        );
    }
}
