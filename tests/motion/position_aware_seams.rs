//! Position-aware solids through every coupling: affine fields, a slit beside peridynamics alone, slow motion, breaking bonds, and which couplings take which laws.

use crate::laws::history;
use crate::{run, table, write};

/// Every coupling with a seam that takes a position-aware solid, as a scene types it.
const COUPLINGS: [&str; 9] = [
    "\"splice\"",
    "{ blending = { beta = \"constant\" } }",
    "{ blending = { beta = \"linear\" } }",
    "{ blending = { beta = \"smooth\" } }",
    "\"balanced\"",
    "{ balanced = { beta = \"smooth\" } }",
    "{ partial-stress = { form = \"meshfree\" } }",
    "{ partial-stress = { interface = \"quadratic\" } }",
    "{ partial-stress = { interface = \"affine\" } }",
];

/// A block whose zone elements enclose, with an affine displacement on its boundary: families are whole.
struct Enclosed<'a> {
    kinematics: &'a str,
    coupling: &'a str,
    fields: &'a str,
    /// Size of the elements over the spacing.
    cells: usize,
    /// Where a point of the lattice lies.
    origin: f64,
}

impl Enclosed<'_> {
    /// The spacing is 0.5.
    fn text(&self) -> String {
        let is_solid = self.kinematics == "solid";
        let (d, mesh, half, [zone, transition], horizon) = match is_solid {
            true => (3, "box", 3.5, [0.5, 1.0], 0.75),
            false => (2, "rectangle", 10.0, [2.0, 4.0], 1.5),
        };
        let list = |x: f64| format!("{:?}", &[x; 3][..d]);
        let boxed = |h: f64| format!("{{ box = {{ min = {}, max = {} }} }}", list(-h), list(h));
        let axes = &["x", "y", "z"][..d];
        let count = (4.0 * half) as usize / self.cells;
        let cells: String = axes
            .iter()
            .map(|a| format!("{a}.cells = {count}\n"))
            .collect();
        let field: String = (axes.iter().zip(FIELD))
            .map(|(axis, g)| {
                let terms = axes.iter().zip(g).map(|(x, g)| format!("({g:?})*{x}"));
                format!("{axis} = \"{}\"\n", terms.collect::<Vec<_>>().join("+"))
            })
            .collect();
        format!(
            "kinematics = \"{}\"\ncoupling = {}\n[mesh.{mesh}]\nmin = {}\nmax = {}\n{cells}[materials.m.pals]\nyoungs-modulus = 1000\npoisson-ratio = 0.3\ncalibration-fields = \"{}\"\n[peridynamics]\nhorizon = {horizon}\npoints.lattice = {{ spacing = 0.5, origin = {} }}\n[zones]\nnonlocal = {}\ntransition = {}\n[conditions.all.displacement]\ninside.without = {{ from = {}, removed = {} }}\n{field}[solver]\ntolerance = 1e-13\n[output]\nvtu = false\nlines.l = {{ from = {}, to = {}, samples = 41 }}\n",
            self.kinematics,
            self.coupling,
            list(-half),
            list(half),
            self.fields,
            list(self.origin),
            boxed(zone),
            boxed(transition),
            boxed(half),
            boxed(half - 0.1),
            list(-0.97 * half),
            format!("{:?}", &[0.9 * half, 0.7 * half, 0.8 * half][..d]),
        )
    }
}

/// The gradient of the displacement.
const FIELD: [[f64; 3]; 3] = [
    [2e-3, 1e-3, -7e-4],
    [-5e-4, 1e-3, 3e-4],
    [6e-4, -2e-4, -1.5e-3],
];

/// The largest error of the displacement along the line, over the largest displacement.
fn error_of_line(folder: &std::path::Path, typed: &str) -> f64 {
    write(folder, "block.toml", typed);
    run(folder, &["block.toml"]);
    let (header, rows) = table(&folder.join("out/block_l.csv"));
    let d = header
        .iter()
        .filter(|h| ["x", "y", "z"].contains(&h.as_str()))
        .count();
    let (mut worst, mut largest) = (0.0f64, 0.0f64);
    for row in &rows {
        for (i, g) in FIELD.iter().take(d).enumerate() {
            let exact: f64 = (0..d).map(|j| g[j] * row[j]).sum();
            worst = worst.max((row[d + i] - exact).abs());
            largest = largest.max(exact.abs());
        }
    }
    worst / largest
}

#[test]
fn every_coupling_passes_affine_fields_of_position_aware_points() {
    let folder = tempfile::tempdir().unwrap();
    for coupling in COUPLINGS {
        for (kinematics, fields, cells, origin) in [
            ("plane-stress", "axes", 1, 0.0),
            ("plane-strain", "affine", 2, 0.13),
            ("solid", "axes", 1, 0.0),
        ] {
            let block = Enclosed {
                kinematics,
                coupling,
                fields,
                cells,
                origin,
            };
            let off = error_of_line(folder.path(), &block.text());
            assert!(off < 1e-11, "{kinematics}, {coupling}: {off:e}");
        }
    }
}
