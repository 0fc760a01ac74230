//! A bar of square section with free sides: peridynamic throughout, and with a skin of finite elements one cell thick.

use crate::{
    Effort,
    enclosed::{INFLUENCE, Law, POISSON, SPACING, YOUNGS_MODULUS},
    meshes::scene,
    typed,
};
use bondline::{
    model::{Model, SiteKind},
    observe::report::{Columns, Table, TableRow},
    peridynamics::Micromodulus,
    progress::{Progress, Silent},
    solve::statics::{self, StaticParams, StaticProblem},
    system::Symmetry,
    tensor::{Vector, padded},
};

/// Largest error of an affine field, of Young's modulus and of Poisson's ratio with a skin.
pub const SKIN_LIMIT: f64 = 1e-9;

const STRETCH: f64 = 1e-3;
/// Cells along the bar and across it, of size h.
const CELLS: [usize; 3] = [12, 8, 8];

/// A pulled bar: errors of the displacement (over the largest), and signed ones of Young's modulus and of Poisson's ratio (over their own; positive: too stiff).
struct Pulled {
    field: f64,
    modulus: f64,
    ratio: f64,
}

/// Displacements that are prescribed, and the sites at both ends: those along x, and on the planes of symmetry those across.
fn held(
    model: &Model<3>,
    half: [f64; 3],
    exact: &dyn Fn(&Vector<3>) -> Vector<3>,
    dofs: usize,
) -> (Vec<Option<f64>>, Vec<usize>) {
    // both ends are held along x only; what is free of rigid motion, by the four lines in the middle of the ends' edges
    let layer = |x: f64, at: f64| (x.abs() - at).abs() < 0.6 * SPACING;
    let mut prescribed = vec![None; dofs];
    let mut ends = Vec::new();
    for (s, site) in model.sites.iter().enumerate() {
        let x = &site.position;
        let node = matches!(site.kind, SiteKind::Node(_));
        let at_end = if node {
            x[0].abs() > half[0] - 1e-9
        } else {
            layer(x[0], half[0])
        };
        if at_end {
            prescribed[s * 3] = Some(exact(x)[0]);
            ends.push(s);
        }
        for k in [1, 2] {
            // a plane of symmetry, or the two layers beside it
            if x[k].abs() < 1e-9 {
                prescribed[s * 3 + k] = Some(0.0);
            } else if !node
                && x[k].abs() < 0.6 * SPACING
                && model
                    .sites
                    .iter()
                    .all(|s| matches!(s.kind, SiteKind::Point(_)))
            {
                prescribed[s * 3 + k] = Some(exact(x)[k]);
            }
        }
    }
    (prescribed, ends)
}

/// Pulls the bar by its ends; what it shows is compared with the tensor of its elements.
fn pull(coupling: &str, law: Law, ratio: u32, weights: &str) -> Result<Pulled, String> {
    let half: [f64; 3] = std::array::from_fn(|i| 0.5 * CELLS[i] as f64 * SPACING);
    let text = format!(
        "kinematics = \"solid\"\ncoupling = \"{coupling}\"\n{}{}[peridynamics]\nhorizon = {:?}\npoints.lattice = {{ spacing = {SPACING}, origin = {} }}\nweights = \"{weights}\"\n{}[zones]\nnonlocal = {{ everywhere = true }}\nskin = \"free-surfaces\"\n{}",
        typed::grid(half.map(|h| -h), half, CELLS),
        typed::material(law, YOUNGS_MODULUS, POISSON),
        f64::from(ratio) * SPACING,
        typed::place([0.5 * SPACING; 3]),
        typed::law_line(law),
        typed::FREE
    );
    let laid = scene::model::<3>(&text, &[]).map_err(|e| e.to_string())?;
    let model = &laid.model;
    // uniaxial stress of the tensor that the elements have
    let c = model.tensor_of_cell(0);
    let (c11, c12) = (c.get(0, 0, 0, 0), c.get(0, 0, 1, 1));
    let ratio = c12 / (c11 + c12);
    let modulus = c11 - 2.0 * c12 * ratio;
    let stiffness = laid.stiffness().map_err(|e| e.to_string())?;
    let exact = |x: &Vector<3>| Vector::<3>::new(x[0], -ratio * x[1], -ratio * x[2]) * STRETCH;
    let (prescribed, ends) = held(model, half, &exact, stiffness.dofs());
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let solution = statics::solve(
        &StaticProblem {
            stiffness: &stiffness,
            symmetry: Symmetry::Symmetric,
            positions: &positions,
            load: &vec![0.0; stiffness.dofs()],
            prescribed: &prescribed,
        },
        &StaticParams {
            tolerance: 1e-12,
            ..StaticParams::default()
        },
        &Silent,
    )
    .map_err(|e| e.to_string())?;
    let u = &solution.displacement;
    let mut field = 0.0f64;
    // Poisson's ratio by least squares over the middle third, free of the ends
    let (mut across, mut squares) = (0.0, 0.0);
    for (s, site) in model.sites.iter().enumerate() {
        let wanted = exact(&site.position);
        for k in 0..3 {
            field = field.max((u[s * 3 + k] - wanted[k]).abs());
        }
        if site.position[0].abs() < half[0] / 3.0 {
            for k in [1, 2] {
                across -= u[s * 3 + k] * site.position[k];
                squares += site.position[k].powi(2);
            }
        }
    }
    let force: f64 = ends
        .iter()
        .filter(|&&s| model.sites[s].position[0] > 0.0)
        .map(|&s| solution.reactions[s * 3])
        .sum();
    let shown = force / (4.0 * half[1] * half[2] * STRETCH);
    Ok(Pulled {
        field: field / (half[0] * STRETCH),
        modulus: shown / modulus - 1.0,
        ratio: across / squares / STRETCH / ratio - 1.0,
    })
}

/// The table of both bars, with isotropic and with plain weights.
pub fn table(progress: &dyn Progress) -> Table {
    progress.stage("skin", None);
    let mut table = Table::new(
        "3D bar with free sides, pulled at its ends: relative errors of the affine field, Young's modulus and Poisson's ratio, signed: positive is too stiff (as typed with isotropic weights, of the lattice's tensor with plain ones)",
        Columns::ByQuantity,
    );
    let bars = [
        ("skin of elements", "truncated", true),
        ("peridynamics alone", "nonlocal", false),
    ];
    let (state_based, pairwise) = (
        Law::StateBased(INFLUENCE),
        Law::BondBased(Micromodulus::InverseDistance),
    );
    // with m = 3 bonds leave the body through the skin
    let cases = [
        (state_based, 2, "isotropic"),
        (state_based, 2, "plain"),
        (state_based, 3, "isotropic"),
        (state_based, 3, "plain"),
        (pairwise, 3, "isotropic"),
        (pairwise, 3, "plain"),
    ];
    for (law, ratio, weights) in cases {
        for (what, coupling, limited) in &bars {
            let name = format!("{}, m = {ratio}, {weights} weights, {what}", law.name());
            match pull(coupling, law, ratio, weights) {
                Ok(p) => {
                    for (quantity, value) in [
                        ("field", p.field),
                        ("modulus", p.modulus),
                        ("ratio", p.ratio),
                    ] {
                        table.push(if *limited {
                            TableRow::at_most(&name, quantity, value.abs(), SKIN_LIMIT)
                        } else {
                            TableRow::info(&name, quantity, value)
                        });
                    }
                }
                Err(why) => {
                    table.push(TableRow::at_most(&name, "field", f64::NAN, SKIN_LIMIT).because(why))
                }
            }
        }
    }
    table
}

/// The suite `skin`.
pub fn run(_effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let tables = vec![table(progress)];
    progress.finish();
    tables
}
