//! Newton's method with the consistent tangent of elements, by scenes: its rate, and its products beside differences of all forces.

use std::ops::ControlFlow;
use std::path::Path;

use super::*;
use crate::progress::Silent;
use crate::run::AnyScene;
use crate::run::loads::BodyForces;
use crate::run::motion::dynamic_system::start;
use crate::run::motion::setup::{ModelSetup, laid_out};
use crate::run::motion::time_dependent_loads::SceneDrive;
use crate::scene::Source;
use crate::scene::validated::Scene;
use crate::solve::krylov::LinearMap;
use crate::solve::quasi_static::{self, Aids, LoadState, Pacing, QuasiStaticParams, Refactor};
use crate::system::{FailureUpdate, Interval};

const STEPS: u64 = 4;

/// A way to look at a scene that is laid out.
trait Look {
    type Found;
    fn at<const D: usize>(&self, laid: ModelSetup<'_, D>) -> Result<Self::Found, RunError>;
}

fn look<L: Look>(text: &str, by: &L) -> L::Found {
    fn laid<const D: usize, L: Look>(scene: Scene<D>, by: &L) -> L::Found {
        laid_out(scene, None, &Silent, |_, _| Ok(()), |laid, ()| by.at(laid)).unwrap()
    }
    let source = Source::new("scene.toml", text.to_owned());
    match AnyScene::from_source(&source, Path::new(""), "scene").unwrap() {
        AnyScene::Bar(scene) => laid(scene.scene, by),
        AnyScene::Plane(scene) => laid(scene.scene, by),
        AnyScene::Solid(scene) => laid(scene.scene, by),
    }
}

/// Solves the load steps; the residuals and factorisations of each.
struct Solve;

impl Look for Solve {
    type Found = Vec<(Vec<f64>, usize)>;

    fn at<const D: usize>(&self, laid: ModelSetup<'_, D>) -> Result<Self::Found, RunError> {
        let (model, rest, mut system) = (laid.model, laid.rest, laid.moving.system);
        let body = (model, laid.operator, laid.terms.as_ref());
        let near = NewtonFactors::new(body, system.symmetry(), rest, &mut Vec::new(), &Silent)?;
        let near = near.expect("small enough to factorise");
        let refactor = near.of_present_tangents().expect("nonlinear elements");
        let step = 1.0 / STEPS as f64;
        let begin = start(model, rest);
        let at_rest = BodyForces::Consistent;
        let drive = SceneDrive::new(model, &rest.conditions, &begin.u, (step, STEPS), at_rest)?;
        let mut state = LoadState::at_rest(begin.u.len());
        let mut found = Vec::new();
        let params = QuasiStaticParams {
            tolerance: quasi_static::TIGHTEST,
            ..QuasiStaticParams::default()
        };
        let aids = Aids {
            near: Some(&near.factor as &dyn LinearMap),
            refactor: Some(&refactor as &dyn Refactor),
            ..Aids::default()
        };
        let times = |k: u64| (k <= STEPS).then_some(k as f64 * step);
        quasi_static::run(
            system.as_mut(),
            &drive,
            params,
            aids,
            Pacing::Listed(&times),
            &mut state,
            &mut |seen| {
                found.push((seen.residuals.to_vec(), seen.factorisations));
                ControlFlow::Continue(())
            },
        )?;
        Ok(found)
    }
}

/// Cantilevers that flow or bend far, of cells of either order.
fn cantilevers() -> Vec<(String, String)> {
    let rectangle =
        "mesh.rectangle = { min = [0, 0], max = [4, 1], x = { cells = 16 }, y = { cells = 4 }";
    let block = "mesh.box = { min = [0, 0, 0], max = [4, 1, 1], x = { cells = 8 }, y = { cells = 2 }, z = { cells = 2 }";
    let flows = "plastic-correspondence = { youngs-modulus = 2e5, poisson-ratio = 0.3, yield-stress = 250, hardening-modulus = 2000, saturation-stress = 100, saturation-rate = 40";
    let bends = "{ youngs-modulus = 1e3, poisson-ratio = 0.3 }";
    let laws = [
        (format!("{flows} }}"), 17.0),
        (format!("{flows}, strains = \"large\" }}"), 17.0),
        (format!("neo-hooke = {bends}"), 2.0),
        (format!("st-venant-kirchhoff = {bends}"), 2.0),
    ];
    let bodies = [
        ("plane-strain", rectangle, "quad4"),
        ("plane-strain", rectangle, "quad8"),
        ("plane-stress", rectangle, "quad4"),
        ("solid", block, "hex8"),
    ];
    let mut scenes = Vec::new();
    for (law, pull) in &laws {
        for (kinematics, mesh, cell) in bodies {
            let text = format!(
                "kinematics = \"{kinematics}\"\ncoupling = \"local\"\n{mesh}, cell = \"{cell}\" }}\nmaterials.m.{law}\nconditions.left.displacement = {{ on = \"left\", x = 0, y = 0{} }}\nconditions.right.traction = {{ on = \"right\", y = \"{pull}*t\" }}\nsolve.quasi-static = {{ duration = 1, steps = {STEPS} }}\n",
                if kinematics == "solid" { ", z = 0" } else { "" }
            );
            let name = format!("{kinematics}, {cell}, {law}");
            scenes.push((name, text));
        }
    }
    scenes
}

#[test]
fn newtons_method_converges_quadratically_in_bodies_of_elements() {
    for (name, text) in cantilevers() {
        let steps = look(&text, &Solve);
        let mut seen = 0;
        let longest = steps.iter().map(|(residuals, _)| residuals.len()).max();
        assert!(longest >= Some(4), "{name}: nearly linear");
        for (residuals, _) in &steps {
            let digits: Vec<String> = residuals.iter().map(|r| format!("{r:.1e}")).collect();
            println!("{name}: {}", digits.join(" "));
            for pair in residuals.windows(2).filter(|pair| pair[0] < 1e-3) {
                seen += 1;
                // at least the square, times what a body of some cells in a row amplifies, down to round-off
                assert!(
                    pair[1] < (1e3 * pair[0] * pair[0]).max(1e-10),
                    "{name}: {digits:?}"
                );
            }
        }
        assert!(seen > 0, "{name}: linear");
    }
}

/// Compares the differences of forces over a small displacement with the excess of elements and with the differences of all else.
struct Compare;

impl Look for Compare {
    type Found = (f64, bool);

    fn at<const D: usize>(&self, laid: ModelSetup<'_, D>) -> Result<Self::Found, RunError> {
        let mut system = laid.moving.system;
        let size = 0.02;
        let noise = |k: usize, phase: f64| (1.7 * k as f64 + phase).sin();
        let sites = &laid.model.sites;
        let dofs = sites.len() * D;
        let u: Vec<f64> = (0..dofs)
            .map(|k| {
                let x = &sites[k / D].position;
                size * (x.iter().enumerate())
                    .map(|(j, x)| noise(j + k % D, 0.3) * x)
                    .sum::<f64>()
                    + 1e-3 * noise(k, 0.0)
            })
            .collect();
        let along: Vec<f64> = (0..dofs).map(|k| noise(k, 1.0)).collect();
        let interval = Interval {
            end: 1.0,
            length: 1.0,
        };
        let by = 1e-6;
        let moved =
            |by: f64| -> Vec<f64> { u.iter().zip(&along).map(|(u, d)| u + by * d).collect() };
        let mut forces = |by: f64, beside: bool| {
            let mut force = vec![0.0; dofs];
            match beside {
                true => system.force_beside_elements_into(&moved(by), &mut force, interval),
                false => {
                    let held = FailureUpdate::Frozen;
                    system.internal_force_into(&moved(by), &mut force, interval, held);
                }
            }
            force
        };
        let [up, down, up_beside, down_beside] =
            [(by, false), (-by, false), (by, true), (-by, true)]
                .map(|(by, beside)| forces(by, beside));
        let known = system
            .element_tangent(&u, interval)
            .expect("nonlinear elements");
        let product = known.excess.multiply(&along);
        let scale = up
            .iter()
            .zip(&down)
            .fold(0.0f64, |m, (a, b)| m.max((a - b).abs() / (2.0 * by)));
        let largest_excess = product.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        assert!(largest_excess > 1e-3 * scale, "elements are linear there");
        let off = (0..dofs)
            .map(|k| {
                let all = (up[k] - down[k]) / (2.0 * by);
                let beside = (up_beside[k] - down_beside[k]) / (2.0 * by);
                (all - beside - product[k]).abs()
            })
            .fold(0.0f64, f64::max);
        Ok((off / scale, known.is_whole))
    }
}

#[test]
fn products_are_those_of_all_forces_also_beside_points() {
    let law = "plastic-correspondence = { youngs-modulus = 2e5, poisson-ratio = 0.3, yield-stress = 250, hardening-modulus = 2000 }";
    let bend = "neo-hooke = { youngs-modulus = 1e3, poisson-ratio = 0.3 }";
    for law in [law, bend] {
        for cell in ["quad4", "quad8"] {
            let head = format!(
                "kinematics = \"plane-strain\"\nmesh.rectangle = {{ min = [0, 0], max = [4, 2], x = {{ cells = 16 }}, y = {{ cells = 8 }}, cell = \"{cell}\" }}\nmaterials.m.{law}\nconditions.left.displacement = {{ on = \"left\", x = 0, y = 0 }}\nsolve.quasi-static = {{ duration = 1, steps = 2 }}\n"
            );
            let (off, is_whole) = look(&format!("{head}coupling = \"local\"\n"), &Compare);
            assert!(off < 1e-6 && is_whole, "{law}: {off:e}");
            let spliced = format!(
                "coupling = \"splice\"\n{head}peridynamics.horizon = 0.76\nzones.nonlocal.box = {{ min = [1.5, 0], max = [2.5, 2] }}\n"
            );
            let (off, is_whole) = look(&spliced, &Compare);
            assert!(off < 1e-6 && !is_whole, "splice, {law}: {off:e}");
        }
    }
}
