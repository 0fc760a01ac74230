//! Truncated bonds on a mesh of triangles, the zone a box drawn across the cells: affine fields are exact at every Poisson ratio, and motion keeps its energy.

use crate::Case;

fn triangles(material: &str, rest: &str) -> Case {
    Case::new(&format!(
        r#"
kinematics = "plane-stress"
mesh.file.path = "triangles.msh"
materials.plate.{material}
peridynamics = {{ horizon = 3, points.lattice = {{ spacing = 1, origin = [0.13, 0.221] }} }}
zones.nonlocal.box = {{ min = [4.6, 4.9], max = [11.3, 11.1] }}
coupling = "truncated"
output.directory = "out"
{rest}
"#
    ))
    .with_file("triangles.msh")
}

const SIDES: &str = "inside = { without = { from = { everywhere = true }, removed = { box = { min = [1e-6, 1e-6], max = [15.999999, 15.999999] } } } }";

#[test]
fn affine_fields_store_their_energy_at_every_poisson_ratio() {
    let (xx, yy, xy) = (1e-3f64, -3e-4, 3e-4);
    let rest = format!(
        "[conditions.sides.displacement]\n{SIDES}\nx = \"1e-3*x + 2e-4*y\"\ny = \"-3e-4*y + 1e-4*x\""
    );
    let mut materials = vec![("bond-based = { youngs-modulus = 2 }".to_owned(), 1.0 / 3.0)];
    for nu in [-0.3, 0.18, 0.4] {
        let lps = format!("lps = {{ youngs-modulus = 2, poisson-ratio = {nu} }}");
        materials.push((lps, nu));
    }
    for (material, nu) in materials {
        let summary = triangles(&material, &rest).run(&[]).expect("it runs");
        let energy = summary["energy"].as_f64().expect("a number");
        let square = xx * xx + yy * yy + 2.0 * nu * xx * yy + 0.5 * (1.0 - nu) * xy * xy;
        let wanted = 256.0 * square / (1.0 - nu * nu);
        // of a field that is not exact the energy is off by the square of the error: this is 1e-6 of the field
        assert!(
            (energy / wanted - 1.0).abs() < 1e-12,
            "{material}: {energy} for {wanted}"
        );
    }
}

#[test]
fn triangles_move_and_keep_their_energy_below_the_pairwise_ratio_and_when_bonds_may_break() {
    // half of the plate thrown against the other: linear bonds, and exact ones that may break but do not
    let rest = "[initial.wave.velocity]\nx = \"1e-3*sin(0.39269908169872414*x)\"\n[solve.explicit]\nduration = 200\noutputs = 1";
    for more in ["", ", critical-stretch = 0.5"] {
        for law in [
            "lps = { youngs-modulus = 1, poisson-ratio = 0.18",
            "bond-based = { youngs-modulus = 1",
        ] {
            let material = format!("{law}, density = 1{more} }}");
            let summary = triangles(&material, rest).run(&[]).expect("it runs");
            let motion = &summary["motion"];
            let of = |name: &str| motion[name].as_f64().expect("a number");
            let all = of("kinetic_energy") + of("stored_energy");
            // half of 1e-6 sin² over the plate; elements of 2 leave 1.3 % of it in the mean of their nodes
            assert!((all / 6.4e-5 - 1.0).abs() < 0.05, "{material}: {all}");
            // the time step, 0.95 of the stable one, leaves 0.9 % of the energy at that moment; what runs away leaves more by powers of ten
            assert!(
                of("missing_energy").abs() < 0.02 * all,
                "{material}: {motion}"
            );
        }
    }
}
