//! The patch-test and ghost-force suite, in part; `bondline verify patch` runs all of it.

use std::path::Path;

use bondline::{
    coupling::{
        CoupledSystem,
        semidiscrete::{BondBehaviour, SystemError},
    },
    model::FitDegree,
    observe::report::{Table, TableRow, Verdict, exit_code},
    peridynamics::{
        Micromodulus,
        bond_force::{BondKinematics, Storage},
        laws::{Named, Ratio},
    },
    progress::Silent,
    run::SceneModel,
    scene::Source,
    system::{FailureUpdate, Interval, SemiDiscrete},
};
use bondline_verify::{
    Effort,
    enclosed::{Case, Cells, Enclosed, EnclosedError, Law, Method, Rows, Widths},
    patch, typed,
};
use rayon::prelude::*;

fn shorts(tables: &[Table]) -> String {
    tables
        .iter()
        .flat_map(|t| &t.rows)
        .filter(|r| r.verdict == Verdict::Short)
        .map(|r| format!("{}, {}: {:e} {:?}\n", r.case, r.quantity, r.value, r.reason))
        .collect()
}

/// Methods and laws of a dimension in these cases.
fn assert_complete<'a>(d: usize, cases: impl Iterator<Item = &'a str> + Clone) {
    let laws = match d {
        1 => Law::all::<1>(),
        _ => Law::all::<3>(),
    };
    for law in laws {
        for method in [
            "splice",
            "blending smooth",
            "balanced",
            "meshfree",
            "elements quadratic",
        ] {
            let mut cases = cases.clone();
            assert!(
                cases.any(|c| c.contains(method) && c.contains(law.name())),
                "{d}D {method} {} is missing",
                law.name()
            );
        }
    }
}

#[test]
fn affine_fields_are_exact_through_every_seam_of_a_bar() {
    let tables = [patch::table::<1>(Effort::Quick, &Silent, None)];
    assert_eq!(exit_code(&tables), 0, "{}", shorts(&tables));
    // a figure that was measured
    let measured = |r: &&TableRow| r.quantity == "residual" && r.value > 0.0;
    let rows = tables[0].rows.iter().filter(measured);
    assert_complete(1, rows.map(|r| r.case.as_str()));
}

/// Measures the affine forces of cases; the names of those that no scene refuses.
fn without_forces<const D: usize>(cases: &[Case]) -> Vec<String> {
    let measured = cases.par_iter().filter_map(|case| {
        let name = format!("{} {}", case.method.name(), case.law.name());
        let enclosed = match Enclosed::<D>::new(case) {
            Err(EnclosedError::Scene(e)) if e.is_seam() => return None,
            enclosed => enclosed.unwrap_or_else(|e| panic!("{name}: {e}")),
        };
        let residual = patch::affine_residual(&enclosed);
        let limit = match case.cells.is_aligned() {
            true => patch::ALIGNED_LIMIT,
            false => patch::IRREGULAR_LIMIT,
        };
        assert!(residual > 0.0 && residual < limit, "{name}: {residual:e}");
        Some(name)
    });
    measured.collect()
}

// Forces, and few solutions: factorisations take most of the time of the suite, which `.ci/run` runs with all of them (`bondline verify patch --quick`).

#[test]
fn affine_fields_leave_no_force_in_plates() {
    let measured = without_forces::<2>(&patch::cases::<2>(Effort::Quick));
    assert_complete(2, measured.iter().map(String::as_str));
}

#[test]
fn affine_fields_on_the_boundary_of_a_plate_are_its_solution() {
    for method in Method::ALL {
        let case = Case {
            method,
            law: Law::StateBased(typed::INFLUENCE),
            cells: Cells::Coarse,
            widths: patch::widths::<2>(method, Cells::Coarse),
            ratio: 3,
        };
        let name = method.name();
        let enclosed = Enclosed::<2>::new(&case).unwrap_or_else(|e| panic!("{name}: {e}"));
        let error = patch::solution_error(&enclosed).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(error < patch::SOLUTION_LIMIT, "{name}: {error:e}");
    }
}

/// Every second pair of a method and a law, so that each of either meets two of the other and more.
#[test]
fn affine_fields_leave_no_force_in_solids() {
    let laws = Law::all::<3>();
    let mut cases = patch::cases::<3>(Effort::Quick);
    cases.retain(|case| {
        let method = Method::ALL.iter().position(|m| *m == case.method);
        let law = laws.iter().position(|l| *l == case.law);
        (method.expect("a method") + law.expect("a law")).is_multiple_of(2)
    });
    let measured = without_forces::<3>(&cases);
    assert_eq!(measured.len(), cases.len());
    for case in patch::cases::<3>(Effort::Quick) {
        for part in [case.method.name(), case.law.name()] {
            let times = measured.iter().filter(|name| name.contains(part)).count();
            assert!(times >= 2, "{part}: {measured:?}");
        }
    }
}

/// Quadratic fields pass the seam where elements match the lattice: the force per volume of each row is `C:∇∇u`, of those that are written for more than their site has too.
#[test]
fn quadratic_fields_have_their_force_per_volume_on_matching_meshes() {
    for method in Method::ALL {
        let case = |law| Case {
            method,
            law,
            cells: Cells::Matching,
            widths: patch::widths::<1>(method, Cells::Matching),
            ratio: 3,
        };
        for law in Law::all::<1>()
            .into_iter()
            .filter(|&law| method.is_offered(law))
        {
            let enclosed = Enclosed::<1>::new(&case(law)).unwrap();
            let off = patch::quadratic_residual(&enclosed);
            // bonds that end at a face follow an energy instead, and a stress fitted by affine fields knows no quadratic
            let may_err = [Method::Truncated, Method::Elements(FitDegree::Affine)];
            let is_exact = !may_err.contains(&method);
            let name = format!("{} {}", method.name(), law.name());
            assert_eq!(off < 1e-11, is_exact, "{name}: {off:e}");
        }
    }
}

#[test]
fn a_seam_that_lacks_bonds_is_found() {
    // too thin a local zone: bonds of the last points reach beyond the block
    let case = Case {
        method: Method::Splice,
        law: Law::BondBased(Micromodulus::InverseDistance),
        cells: Cells::Matching,
        widths: Widths {
            nonlocal: 6,
            transition: 0,
            local: 1,
        },
        ratio: 3,
    };
    let thin = Enclosed::<1>::new(&case).unwrap();
    assert!(patch::affine_residual(&thin) > 1e-3);
    assert!(patch::solution_error(&thin).unwrap() > 1e-6);
    let wide = Enclosed::<1>::new(&Case {
        widths: Widths {
            local: 12,
            ..case.widths
        },
        ..case
    })
    .unwrap();
    assert!(patch::affine_residual(&wide) < 1e-13);
}

/// Each law that a scene can name, by its key, as a table of usual numbers.
fn typed_laws() -> Vec<(String, String)> {
    let with_own_keys = Law::all::<2>().into_iter().map(|law| {
        let table = typed::material(law, typed::YOUNGS_MODULUS, typed::POISSON);
        let key = table.split(['.', ']']).nth(2).unwrap().to_owned();
        (key, table)
    });
    let named = Named::ALL.iter().map(|law| {
        let ratio = match law.ratio() {
            Ratio::Pairwise => "",
            Ratio::Any => "poisson-ratio = 0.3\n",
        };
        let missing = law.parameters().iter().filter(|p| p.default.is_none());
        let usual: String = missing
            .filter(|p| p.words.is_empty())
            .map(|p| format!("{} = {:?}\n", p.key, p.usual))
            .collect();
        let key = law.key();
        let table =
            format!("[materials.m.{key}]\nyoungs-modulus = 1.0\ndensity = 1\n{ratio}{usual}");
        (key.to_owned(), table)
    });
    with_own_keys.chain(named).collect()
}

/// A law in the block of a case, with a Young's modulus of one; or why it is refused.
fn block_of_law(case: &Case, material: &str) -> Result<SceneModel<2>, String> {
    let own = typed::material(case.law, typed::YOUNGS_MODULUS, typed::POISSON);
    let text = case.text::<2>(&Default::default());
    assert!(text.contains(&own));
    let text = text.replace(&own, material);
    let source = Source::new("block.toml", text);
    let scene = bondline_study::from_source(&source, Path::new("."), "block")
        .map_err(|e| format!("{e}; {}", e.remedy().unwrap_or_default()))?;
    let scene = scene.of_dimension::<2>().expect("a plane");
    SceneModel::new(scene).map_err(|e| e.to_string())
}

/// The affine residual of a law in the block of a case, over a Young's modulus of one; or why it is refused.
fn residual_of_law(case: &Case, material: &str) -> Result<f64, String> {
    let SceneModel {
        model, coupling, ..
    } = block_of_law(case, material)?;
    let stiffness = {
        let operator = coupling.operator(&model).map_err(|e| e.to_string())?;
        let all: Vec<u32> = (0..model.sites.len() as u32).collect();
        model.assemble_sites_unscaled(&operator, &all)
    };
    let tensor = *model.tensor_of_cell(0);
    let size = tensor.amax() / typed::YOUNGS_MODULUS;
    Ok(patch::affine_residual(&Enclosed {
        model,
        coupling,
        stiffness,
        rows: Rows::Own,
        shared: None,
        half: f64::from(case.widths.total()) * bondline_verify::enclosed::SPACING,
        tensor,
    }) / size)
}

#[test]
fn every_law_passes_every_coupling_or_is_told_one_that_takes_it() {
    let mut taken_in_all = 0;
    for (key, material) in typed_laws() {
        let of = |method: Method| {
            let case = Case {
                method,
                law: Law::StateBased(typed::INFLUENCE),
                cells: Cells::Matching,
                widths: patch::widths::<2>(method, Cells::Matching),
                ratio: 3,
            };
            residual_of_law(&case, &material)
        };
        let all = Method::ALL.map(|method| (method, of(method)));
        // as a scene types it, without its keys
        let word = |method: &Method| {
            let typed = typed::coupling(*method);
            let mut words = typed.split(|c: char| !c.is_ascii_lowercase() && c != '-');
            words.find(|w| !w.is_empty()).unwrap().to_owned()
        };
        let taken: Vec<String> = (all.iter())
            .filter(|(_, found)| found.is_ok())
            .map(|(method, _)| word(method))
            .collect();
        for (method, found) in &all {
            let what = format!("{key}, {}", method.name());
            match found {
                Ok(residual) => assert!(*residual < patch::ALIGNED_LIMIT, "{what}: {residual:e}"),
                Err(why) => {
                    let is_told = taken.iter().any(|word| why.contains(word.as_str()));
                    assert!(is_told || why.contains("nonlocal"), "{what}: {why}");
                }
            }
        }
        taken_in_all += taken.len();
    }
    assert!(taken_in_all > 60, "{taken_in_all}");
}

/// Tests laws that a seam of truncated bonds takes over, or leaves linear: with geometrically exact bonds both have to be the derivative of one energy.
#[test]
fn forces_of_every_law_at_a_truncated_seam_are_derivatives_of_its_energy() {
    let mut taken = 0;
    for (key, material) in typed_laws() {
        let case = Case {
            method: Method::Truncated,
            law: Law::StateBased(typed::INFLUENCE),
            cells: Cells::Matching,
            widths: patch::widths::<2>(Method::Truncated, Cells::Matching),
            ratio: 3,
        };
        // refused with a coupling that takes it, see above
        let Ok(block) = block_of_law(&case, &material) else {
            continue;
        };
        let model = &block.model;
        let operator = block.coupling.operator(model).unwrap();
        let behaviour = BondBehaviour {
            kinematics: BondKinematics::Exact,
            failure: None,
            softening: None,
            no_fail: &|_| false,
            contact: None,
            storage: Storage::Double,
            broken: None,
            heat: None,
        };
        let symmetry = block.coupling.symmetry();
        let system = CoupledSystem::new(model, &operator, symmetry, |_| 1.0, &behaviour);
        let system = match system {
            Ok(system) => system,
            // known to first order only: a scene with exact bonds is refused
            Err(SystemError::Law { .. }) => continue,
            Err(why) => panic!("{key}: {why}"),
        };
        let mut system = system.with_local_laws(&block.local_laws).unwrap();
        // far below what makes a material flow or soften, and far above round-off
        let size = 1e-3 * model.spacing();
        let field = |phase: f64| -> Vec<f64> {
            let unknowns = 0..2 * model.sites.len();
            unknowns
                .map(|n| size * (1.7 * n as f64 * n as f64 + phase).sin())
                .collect()
        };
        let (u, v) = (field(0.3), field(1.1));
        let mut force = vec![0.0; u.len()];
        let mut at = |step: f64| {
            let moved: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u + step * v).collect();
            let frozen = FailureUpdate::Frozen;
            system.internal_force_into(&moved, &mut force, Interval::AT_ONCE, frozen);
            (system.stored_energy(&moved), force.clone())
        };
        let step = 1e-2;
        let (_, force) = at(0.0);
        let slope = (at(step).0 - at(-step).0) / (2.0 * step);
        let power: f64 = force.iter().zip(&v).map(|(f, v)| f * v).sum();
        let norm = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>().sqrt();
        let off = (slope - power).abs() / (norm(&force) * norm(&v));
        assert!(off < 1e-8, "{key}: {slope:e} {power:e} {off:e}");
        taken += 1;
    }
    assert!(taken > 10, "{taken}");
}
