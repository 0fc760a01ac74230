//! Fields that a scene asks for: the strain energy density of elements and points adds up to the stored energy of the run, in files, tables and histories.

use super::read;
use bondline::progress::Silent;

const LAWS: [(&str, &str); 4] = [
    ("bond-based = { youngs-modulus = 1000, density = 1 }", ""),
    (
        "lps = { youngs-modulus = 1000, poisson-ratio = 0.3, density = 1 }",
        ", bonds = \"exact\"",
    ),
    (
        "plastic-correspondence = { youngs-modulus = 1000, poisson-ratio = 0.3, yield-stress = 2, hardening-modulus = 100, density = 1 }",
        "",
    ),
    (
        "neo-hooke = { youngs-modulus = 1000, poisson-ratio = 0.3, density = 1 }",
        ", bonds = \"exact\"",
    ),
];

#[test]
fn strain_energy_densities_add_up_to_the_stored_energy() {
    for (law, bonds) in LAWS {
        for coupling in ["local", "nonlocal", "truncated"] {
            if law.starts_with("neo-hooke") && coupling == "truncated" {
                continue;
            }
            let points =
                format!("peridynamics = {{ horizon = 0.3, points.lattice.spacing = 0.1{bonds} }}");
            let (points, zone) = match coupling {
                "local" => ("", ""),
                "nonlocal" => (points.as_str(), ""),
                _ => (
                    points.as_str(),
                    "zones.nonlocal.box = { min = [0.8, 0], max = [1.2, 1] }",
                ),
            };
            let text = format!(
                r#"
kinematics = "plane-strain"
coupling = "{coupling}"
mesh.rectangle = {{ min = [0, 0], max = [2, 1], x = {{ cells = 20 }}, y = {{ cells = 10 }} }}
materials.m.{law}
{points}
{zone}
conditions.left.displacement = {{ on = "left", x = 0, y = 0 }}
conditions.right.displacement = {{ on = "right", x = "0.02*t" }}
output.fields = ["strain-energy-density"]
output.probes.p.at = [1.05, 0.55]
solve.quasi-static = {{ steps = 4, tolerance = 1e-10, outputs = 1 }}
"#
            );
            let solution = read(&text, &[]).unwrap().solve(&Silent).unwrap();
            let field = |name: &str| solution.cell_field(name).unwrap();
            let cells = field("strain-energy-density").iter().zip(field("volume"));
            let sum: f64 = cells.map(|(energy, volume)| energy * volume).sum();
            let stored = solution.summary().motion.as_ref().unwrap().stored_energy;
            // a linear element has the energy of its centre; at a seam, bonds that it cuts belong to neither
            let within = match (
                coupling,
                law.starts_with("plastic") || law.starts_with("neo"),
            ) {
                ("nonlocal", _) | ("local", true) => 1e-9,
                _ => 0.03,
            };
            assert!(
                (sum / stored - 1.0).abs() < within,
                "{sum} {stored} {coupling} {law}"
            );
            let probe = solution.history("p_strain_energy_density").unwrap();
            assert!(*probe.last().unwrap() > 0.0, "{coupling} {law}");
        }
    }
}

#[test]
fn a_field_that_there_is_not_is_refused() {
    let text = r#"
kinematics = "bar"
mesh.line = { min = 0, max = 1, x = { cells = 4 } }
materials.m.bond-based = { youngs-modulus = 1 }
output.fields = ["strain-energy"]
conditions.left.displacement = { on = "left", x = 0 }
"#;
    super::refused(text, &[], &["strain-energy-density"]);
}
