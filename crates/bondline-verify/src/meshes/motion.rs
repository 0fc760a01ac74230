//! Motion of scenes as they are typed: the growing modes of the proof beside the growth in the run, and the discrete energy over long runs.

use super::scene::{history, run};
use crate::Effort;
use bondline::{
    observe::{
        report::{Columns, Table, TableRow},
        summary::RunSummary,
    },
    progress::Progress,
};

/// A scene that is said to grow, and how to let it.
struct Case {
    name: &'static str,
    text: &'static str,
    overrides: &'static [&'static str],
}

/// Points between the nodes of a bar, spliced.
const BAR: &str = r#"
kinematics = "bar"
mesh.line = { min = 0, max = 1, x = { cells = 160 } }
materials.m.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 0.01875, points = "cells" }
zones.nonlocal.box = { min = 0.3, max = 0.7 }
coupling = "splice"
conditions.l.displacement = { on = "left", x = 0 }
initial.u.displacement.x = "1e-3*sin(pi*x/2)"
solve.explicit = { duration = 12, step-fraction = 0.5, outputs = 0 }
output.vtu = false
"#;

/// A plate with a band of points across it.
const PLATE: &str = r#"
kinematics = "plane-stress"
mesh.rectangle = { min = [0, 0], max = [12, 6], x = { cells = 24 }, y = { cells = 12 } }
materials.plate.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 1.5, points.lattice = { spacing = 0.5 }, bonds = "linear" }
zones.nonlocal.box = { min = [3, 0], max = [9, 6] }
coupling = "balanced"
initial.v.velocity = { x = "1e-3*sin(x)", y = "1e-3*cos(y)*sin(x/2)" }
solve.explicit = { duration = 110, outputs = 0, history-interval = 1 }
output.vtu = false
"#;

/// As [`PLATE`], spliced and over a long duration.
const LONG: &[&str] = &[
    "coupling=splice",
    "materials.plate={lps={youngs-modulus=1,density=1,poisson-ratio=0.34}}",
    "solve.explicit.duration=4000",
];

/// Two plates that strike each other, [SAND2015-7998] section 2.6, points between the nodes.
const SPALL: &str = r#"
kinematics = "bar"
mesh.line = { min = 0, max = 60, x = { cells = 1000 } }
materials.plate.bond-based = { youngs-modulus = 1, density = 1, critical-stretch = 0.04 }
peridynamics = { horizon = 0.13, points = "cells", bonds = "linear" }
zones.nonlocal.box = { min = 37, max = 43 }
zones.damage-at-edge = "warn"
coupling = "splice"
initial.impactor.velocity = { inside = { box = { min = -1, max = 20 } }, x = 0.1 }
solve.explicit = { duration = 100, step-fraction = 0.65, outputs = 0, history-interval = 0.1 }
output.vtu = false
"#;

const CASES: &[Case] = &[
    Case {
        name: "bar, splice, points between the nodes",
        text: BAR,
        overrides: &[],
    },
    Case {
        name: "bar, splice, points on the nodes",
        text: BAR,
        overrides: &["peridynamics.points={lattice={spacing=0.00625}}"],
    },
    Case {
        name: "plate, balanced",
        text: PLATE,
        overrides: &[],
    },
    Case {
        name: "plate, splice over a long duration",
        text: PLATE,
        overrides: LONG,
    },
    Case {
        name: "plate, truncated",
        text: PLATE,
        overrides: &["coupling=truncated"],
    },
    Case {
        name: "spall, splice 37 to 43",
        text: SPALL,
        overrides: &[],
    },
    Case {
        name: "spall, splice 35 to 45",
        text: SPALL,
        overrides: &["zones.nonlocal={box={min=35,max=45}}"],
    },
    Case {
        name: "spall, truncated 35 to 45",
        text: SPALL,
        overrides: &["zones.nonlocal={box={min=35,max=45}}", "coupling=truncated"],
    },
];

/// A figure of the part `growth` of a proof; zero of one that is proved.
fn figure(summary: &RunSummary, name: &str) -> f64 {
    let parts = summary.proof.parts.iter().filter(|p| p.name == "growth");
    let found = parts
        .flat_map(|p| &p.figures)
        .find(|figure| figure.name == name);
    found.map_or(0.0, |figure| figure.value)
}

/// Adds the growth by the proof, that in the run, and the outcome of the scene at the defaults.
fn rows(case: &Case, table: &mut Table) {
    let let_go = [case.overrides, &["solve.explicit.largest-energy-gain=1e9"]].concat();
    let summary = match run(case.text, &let_go, &[]) {
        Ok(summary) => summary,
        Err(reason) => return table.push(TableRow::refused(case.name, "let go", reason)),
    };
    let Some(motion) = &summary.motion else {
        return;
    };
    let (found, unseen) = (
        2.0 * figure(&summary, "exponent"),
        2.0 * figure(&summary, "exponent that would not show"),
    );
    table.push(TableRow::info(
        case.name,
        "proof: ln of the energy's growth",
        found,
    ));
    table.push(TableRow::info(
        case.name,
        "proof: ln of what would not show",
        unseen,
    ));
    let now = motion.kinetic_energy + motion.stored_energy;
    let start = now + motion.missing_energy - motion.external_work;
    // what the seam exchanges with a wave, and what velocity Verlet makes of the energy, is no growth
    let margin = 0.1;
    table.push(TableRow::at_most(
        case.name,
        "run: ln of the energy's growth",
        (now / start).ln(),
        found.max(unseen) + margin,
    ));
    match run(case.text, case.overrides, &[]) {
        Err(reason) => table.push(TableRow::refused(case.name, "at the defaults", reason)),
        Ok(summary) => {
            let gain = summary.motion.and_then(|m| m.energy_gain);
            table.push(TableRow::at_most(
                case.name,
                "at the defaults: energy gained, of the largest",
                gain.map_or(0.0, |g| g.largest),
                0.12,
            ));
        }
    }
}

/// A motion whose discrete energy is looked at: linear bonds, no loads.
struct Swing {
    name: &'static str,
    text: &'static str,
    mesh: &'static [(&'static str, &'static str)],
    overrides: &'static [&'static str],
    /// The time step, beside its limit.
    step: f64,
}

/// Triangles from Gmsh, sides of 0.5 to 1.9, and a box across them.
const TRIANGLES: &str = r#"
kinematics = "plane-stress"
mesh.file.path = "m.msh"
materials.plate.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 0.9, points.lattice = { spacing = 0.3 }, bonds = "linear" }
zones.nonlocal.box = { min = [6.13, 5.88], max = [14.21, 13.77] }
coupling = "truncated"
initial.v.velocity = { x = "1e-3*sin(x/2)", y = "1e-3*cos(y/2)*sin(x/3)" }
solve.explicit = { duration = 100, outputs = 0 }
output.vtu = false
"#;

/// A bar of tetrahedra from Gmsh, sides of 1/3, and a box across them.
const TETRAHEDRA: &str = r#"
kinematics = "solid"
mesh.file.path = "m.msh"
materials.bar.bond-based = { youngs-modulus = 1, density = 1 }
peridynamics = { horizon = 0.375, points.lattice = { spacing = 0.125 }, bonds = "linear" }
zones.nonlocal.box = { min = [2.05, 0, 0], max = [3.93, 1, 1] }
coupling = "truncated"
initial.v.velocity = { x = "1e-3*sin(x)", y = "1e-3*cos(y)*sin(x/2)", z = "1e-3*cos(z)*sin(x)" }
solve.explicit = { duration = 10, outputs = 0 }
output.vtu = false
"#;

/// A free body drifts far in 100 000 steps, and where rows are multiplied with displacements, not with their differences, the rounding of its internal force grows with it; a held one stays.
const HELD: &str = "conditions.held.displacement={on=\"start\",x=0,y=0,z=0}";

const OF_TRIANGLES: &[(&str, &str)] = &[(
    "m.msh",
    include_str!("../../../../meshes/graded_triangles.msh"),
)];
const OF_TETRAHEDRA: &[(&str, &str)] =
    &[("m.msh", include_str!("../../../../meshes/bar_tets.msh"))];

const ON_PLATE: &str = "initial.v={velocity={x=\"1e-3*sin(x)\",y=\"1e-3*cos(y)*sin(x/2)\"}}";

const SWINGS: &[Swing] = &[
    Swing {
        name: "plate, quadrilaterals",
        text: PLATE,
        mesh: &[],
        overrides: &["coupling=truncated", ON_PLATE],
        step: 0.3,
    },
    Swing {
        name: "plate, triangles",
        text: PLATE,
        mesh: &[],
        overrides: &["coupling=truncated", ON_PLATE, "mesh.rectangle.cell=tri3"],
        step: 0.3,
    },
    Swing {
        name: "plate, LPS",
        text: PLATE,
        mesh: &[],
        overrides: &[
            "coupling=truncated",
            ON_PLATE,
            "materials.plate={lps={youngs-modulus=1,density=1,poisson-ratio=0.4}}",
        ],
        step: 0.3,
    },
    Swing {
        name: "plate, zone across the cells",
        text: PLATE,
        mesh: &[],
        overrides: &[
            "coupling=truncated",
            ON_PLATE,
            "peridynamics.points={lattice={spacing=0.4,origin=[0.07,0.11]}}",
            "peridynamics.horizon=1.2",
        ],
        step: 0.3,
    },
    Swing {
        name: "Gmsh triangles, a box across them",
        text: TRIANGLES,
        mesh: OF_TRIANGLES,
        overrides: &[],
        step: 0.06,
    },
    Swing {
        name: "Gmsh tetrahedra, a box across them, free",
        text: TETRAHEDRA,
        mesh: OF_TETRAHEDRA,
        overrides: &[],
        step: 0.0123,
    },
    Swing {
        name: "Gmsh tetrahedra, a box across them, held",
        text: TETRAHEDRA,
        mesh: OF_TETRAHEDRA,
        overrides: &[HELD],
        step: 0.0123,
    },
];

/// The largest change of the discrete energy over a run, relative to the energy.
fn discrete_energy(swing: &Swing, steps: u64, table: &mut Table) {
    let name = swing.name;
    let duration = swing.step * steps as f64;
    let typed = [
        format!("solve.explicit.step={}", swing.step),
        format!("solve.explicit.duration={duration}"),
        format!("solve.explicit.history-interval={}", duration / 500.0),
    ];
    let all: Vec<&str> = (swing.overrides.iter().copied())
        .chain(typed.iter().map(String::as_str))
        .collect();
    let quantity = "change of the discrete energy, relative";
    match history(swing.text, &all, swing.mesh, "discrete_energy") {
        Err(reason) => table.push(TableRow::refused(name, quantity, reason)),
        Ok(values) => {
            let first = values.first().copied().unwrap_or(f64::NAN);
            let change = values.iter().fold(0.0_f64, |m, v| m.max((v - first).abs()));
            table.push(TableRow::at_most(name, quantity, change / first, 1e-9));
        }
    }
}

/// The tables of motion.
pub(super) fn tables(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut growth = Table::new(
        "motion: growth that the proof tells of beside that of the run",
        Columns::Full,
    );
    progress.stage("motion", None);
    CASES.iter().for_each(|case| rows(case, &mut growth));
    let steps = match effort {
        Effort::Quick => 5_000,
        Effort::Full => 100_000,
    };
    let mut energy = Table::new(
        format!("motion: discrete energy over {steps} steps, truncated, linear bonds"),
        Columns::Full,
    );
    for swing in SWINGS {
        // solids cost six times as much per step
        let fewer = effort == Effort::Quick && swing.text == TETRAHEDRA;
        discrete_energy(swing, if fewer { steps / 5 } else { steps }, &mut energy);
    }
    vec![growth, energy]
}
