//! From a validated scene to its solution: the only place where scene, core, solver and observers meet.

use std::sync::Arc;

use rayon::prelude::*;

use super::conditions::{Components, Condition, Prescribed, Support};
use super::materials::{Law, Points};
use super::spec::{SurfacesSpec, WeightsSpec};
use super::validate::{Output, Scene, Solver};
use crate::coupling::Surfaces;
use crate::coupling::{
    self, Coupling, Model, ModelError, Operator, PointSource, Problem, SiteKind, Zone,
};
use crate::fem;
use crate::mesh::{Facet, Mesh};
use crate::observe::ObserveError;
use crate::observe::summary::{
    Choice, Reaction, RunSummary, Sizes, Stopwatch, Timings, peak_memory_bytes,
};
use crate::peridynamics::{
    BondBased, BondLaw, BondWeights, Correspondence, Influence, LinearPeridynamicSolid,
};
use crate::progress::Progress;
use crate::solve::statics::{self, StaticError, StaticParams, StaticProblem};
use crate::system::Symmetry;
use crate::tensor::{Vector, padded};

/// How far from a set a peridynamic point may lie, in its own spacings, to follow a condition on the set.
///
/// The first layer lies on the set or half a spacing away, at the corner of a square 0.71 of one; the second layer at least one.
const FIRST_LAYER: f64 = 0.75;

/// Why a scene that is right could not be run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The model cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The system cannot be solved.
    #[error(transparent)]
    Solve(#[from] StaticError),
    /// A result cannot be written.
    #[error(transparent)]
    Observe(#[from] ObserveError),
    /// A condition meets no site.
    #[error("the condition `{condition}` meets no site of the model; {remedy}")]
    Idle {
        /// Its name.
        condition: String,
        /// What to do.
        remedy: &'static str,
    },
}

/// A solved scene.
pub struct Solved<'a, const D: usize> {
    /// The model.
    pub model: &'a Model<D>,
    /// Its rows.
    pub operator: &'a dyn Operator<D>,
    /// Displacement, `D` numbers per site.
    pub displacement: &'a [f64],
    /// Residual `K u − f` of each dof; on prescribed dofs the reaction.
    pub residual: &'a [f64],
    /// Which zone each site lies in.
    pub zone_of_site: &'a [Zone],
}

/// Runs a scene and writes its outputs.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn run<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
) -> Result<RunSummary, RunError> {
    solve_with(scene, progress, |output, solved| {
        super::write::write(output, solved)
    })
}

/// Runs a scene and hands the solution to `visit`, which returns the files that it wrote.
///
/// # Errors
/// [`RunError`], each with place and remedy.
pub fn solve_with<const D: usize>(
    scene: Scene<D>,
    progress: &dyn Progress,
    visit: impl FnOnce(&Output<D>, &Solved<'_, D>) -> Result<Vec<std::path::PathBuf>, ObserveError>,
) -> Result<RunSummary, RunError> {
    let mut timings = Timings::default();
    let mut watch = Stopwatch::start();
    let name = scene.title.clone();
    let joining = scene.coupling.joining();
    let (cells, nodes) = (scene.mesh.cell_count(), scene.mesh.nodes.len());
    let (problem, rest) = problem(scene);
    let (model, coupling) = Model::new(problem, progress)?;
    watch.lap(&mut timings, "sites and bonds");
    let operator = coupling.operator(&model)?;
    let stiffness = model.assemble(operator.as_ref(), progress);
    watch.lap(&mut timings, "assembly");

    let (load, applied) = loads(&model, &rest.conditions)?;
    let (prescribed, holder) = supports(&model, &rest.conditions)?;
    let positions: Vec<[f64; 3]> = model.sites.iter().map(|s| padded(&s.position)).collect();
    let mut choices = Vec::new();
    let symmetry = symmetry(coupling.as_ref(), || stiffness.asymmetry(), &mut choices);
    watch.lap(&mut timings, "conditions");
    let solution = statics::solve(
        &StaticProblem {
            stiffness: &stiffness,
            symmetry,
            positions: &positions,
            load: &load,
            prescribed: &prescribed,
        },
        &params(&rest.solver),
        progress,
    )?;
    let info = &solution.info;
    timings.add("ordering", info.ordering_seconds);
    timings.add("factorisation", info.factor_seconds);
    timings.add("solve", info.solve_seconds);
    watch = Stopwatch::start();
    choices.push(Choice {
        choice: info.method.name().to_owned(),
        why: format!("{} system of {} unknowns", symmetry.name(), info.free_dofs),
    });

    let u = &solution.displacement;
    let internal = stiffness.multiply(u);
    let residual: Vec<f64> = internal.iter().zip(&load).map(|(k, f)| k - f).collect();
    let mut reactions = vec![Vector::<D>::zeros(); rest.conditions.len()];
    for (dof, holder) in holder.iter().enumerate() {
        if let Some(condition) = holder {
            reactions[*condition][dof % D] += solution.reactions[dof];
        }
    }
    let mut balance = Vector::<D>::zeros();
    internal
        .iter()
        .enumerate()
        .for_each(|(dof, f)| balance[dof % D] += f);
    let scale = reactions.iter().map(|r| r.norm()).fold(applied, f64::max);
    let zone_of_site = zone_of_site(&model);
    let solved = Solved {
        model: &model,
        operator: operator.as_ref(),
        displacement: u,
        residual: &residual,
        zone_of_site: &zone_of_site,
    };
    let files = visit(&rest.output, &solved)?;
    watch.lap(&mut timings, "output");
    progress.finish();
    let summary = RunSummary {
        scene: name,
        dimension: D,
        coupling: joining.name.to_owned(),
        sizes: Sizes {
            nodes,
            cells,
            sites: model.sites.len(),
            points: model
                .sites
                .iter()
                .filter(|s| matches!(s.kind, SiteKind::Point(_)))
                .count(),
            bonds: model.body().map_or(0, |b| b.bond_count()) + operator.additional_bonds(),
            dofs: stiffness.dofs(),
            nonzeros: stiffness.nonzeros(),
        },
        choices,
        total_seconds: timings.total(),
        timings,
        peak_memory_bytes: peak_memory_bytes(),
        residual: info.relative_residual,
        out_of_balance_force: balance.iter().copied().collect(),
        out_of_balance_relative: if scale > 0.0 {
            balance.norm() / scale
        } else {
            0.0
        },
        reactions: rest
            .conditions
            .iter()
            .zip(&reactions)
            .filter(|(c, _)| {
                matches!(
                    c.prescribed,
                    Prescribed::Displacement(_) | Prescribed::Field(_)
                )
            })
            .map(|(c, r)| Reaction {
                condition: c.name.clone(),
                force: r.iter().copied().collect(),
            })
            .collect(),
        energy: (symmetry == Symmetry::Symmetric)
            .then(|| 0.5 * u.iter().zip(&internal).map(|(u, f)| u * f).sum::<f64>()),
        files,
    };
    Ok(summary)
}

/// What of a scene remains once its problem is built.
pub(super) struct Rest<const D: usize> {
    pub conditions: Vec<Condition<D>>,
    pub solver: Solver,
    output: Output<D>,
}

pub(super) fn problem<const D: usize>(scene: Scene<D>) -> (Problem<D>, Rest<D>) {
    let material = scene
        .zones
        .iter()
        .zip(&scene.cell_material)
        .find(|(zone, _)| **zone != Zone::Local)
        .map_or(0, |(_, m)| *m);
    let chosen = &scene.materials[material as usize];
    let influence = match chosen.law {
        Law::Lps(i) | Law::Correspondence(i, _) => i,
        Law::BondBased(_) => Influence::Gaussian,
    };
    let (lambda, mu) = chosen.lame;
    let law: Box<dyn BondLaw<D>> = match chosen.law {
        Law::BondBased(micromodulus) => Box::new(BondBased::new(micromodulus, mu)),
        Law::Lps(influence) => Box::new(LinearPeridynamicSolid::new(influence, lambda, mu)),
        Law::Correspondence(influence, stabilisation) => {
            Box::new(Correspondence::new(influence, lambda, mu, stabilisation))
        }
    };
    let method = scene.coupling.build(influence);
    let tensors = scene.materials.iter().map(|m| m.stiffness()).collect();
    let (voids, barriers) = (scene.voids, scene.barriers);
    let peridynamics = scene.peridynamics.map(|p| {
        let horizon = p.horizon;
        coupling::Peridynamics {
            law,
            horizon: Arc::new(move |x: &Vector<D>| horizon.eval(&padded(x))),
            points: match p.points {
                Points::Cells => PointSource::Cells,
                Points::Lattice { spacing, origin } => PointSource::Lattice { spacing, origin },
            },
            weights: match p.weights {
                WeightsSpec::Isotropic => BondWeights::Isotropic,
                WeightsSpec::Plain => BondWeights::Plain,
                WeightsSpec::Fitted => BondWeights::Fitted,
            },
            barriers,
            voids,
            surfaces: match p.surfaces {
                SurfacesSpec::Cut => Surfaces::Cut,
                SurfacesSpec::Uncut => Surfaces::Uncut,
            },
        }
    });
    (
        Problem {
            mesh: scene.mesh,
            zones: scene.zones,
            tensors,
            cell_material: scene.cell_material,
            peridynamic_material: material,
            peridynamics,
            coupling: method,
        },
        Rest {
            conditions: scene.conditions,
            solver: scene.solver,
            output: scene.output,
        },
    )
}

pub(super) fn params(solver: &Solver) -> StaticParams {
    StaticParams {
        method: solver.method,
        ordering: solver.ordering,
        tolerance: solver.tolerance,
        max_iterations: solver.max_iterations,
        ..StaticParams::default()
    }
}

/// The symmetry that the coupling promises, if the matrix keeps it: a horizon that varies breaks it.
pub(super) fn symmetry<const D: usize>(
    coupling: &dyn Coupling<D>,
    asymmetry: impl FnOnce() -> f64,
    choices: &mut Vec<Choice>,
) -> Symmetry {
    const ROUND_OFF: f64 = 1e-12;
    if coupling.symmetry() == Symmetry::Symmetric {
        let asymmetry = asymmetry();
        if asymmetry <= ROUND_OFF {
            return Symmetry::Symmetric;
        }
        choices.push(Choice {
            choice: "unsymmetric solver".to_owned(),
            why: format!("the stiffness differs from its transpose by {asymmetry:.1e}"),
        });
    }
    Symmetry::Unsymmetric
}

/// For each node of the mesh its site, if it is one.
fn site_of_node<const D: usize>(model: &Model<D>) -> Vec<Option<u32>> {
    let mut site_of = vec![None; model.mesh.nodes.len()];
    for (site, s) in model.sites.iter().enumerate() {
        if let SiteKind::Node(n) = s.kind {
            site_of[n as usize] = Some(site as u32);
        }
    }
    site_of
}

fn zone_of_site<const D: usize>(model: &Model<D>) -> Vec<Zone> {
    let node_zone = |site: usize| {
        model
            .cells_of_site(site)
            .map(|(c, _)| c)
            .filter(|&c| model.is_element(c))
            .map(|c| model.zones[c])
            .max()
            .unwrap_or(Zone::Local)
    };
    (0..model.sites.len())
        .map(|site| match model.sites[site].kind {
            SiteKind::Point(p) => model.zone_of_point(p as usize),
            SiteKind::Node(_) => node_zone(site),
        })
        .collect()
}

/// The points in the first layer along facets or nodes, with their spacing.
fn first_layer<const D: usize>(
    model: &Model<D>,
    nodes: &[u32],
    facets: &[Facet],
) -> Vec<(usize, f64)> {
    let mesh = &model.mesh;
    let (mut lo, mut hi) = (
        Vector::<D>::repeat(f64::INFINITY),
        Vector::<D>::repeat(f64::NEG_INFINITY),
    );
    for &n in nodes {
        lo = lo.inf(&mesh.nodes[n as usize]);
        hi = hi.sup(&mesh.nodes[n as usize]);
    }
    (0..model.sites.len())
        .into_par_iter()
        .filter_map(|site| {
            let s = &model.sites[site];
            if !matches!(s.kind, SiteKind::Point(_)) {
                return None;
            }
            let h = s.volume.powf(1.0 / D as f64);
            let reach = FIRST_LAYER * h;
            let x = &s.position;
            if (0..D).any(|k| x[k] < lo[k] - reach || x[k] > hi[k] + reach) {
                return None;
            }
            let near = if facets.is_empty() {
                nodes
                    .iter()
                    .any(|&n| (mesh.nodes[n as usize] - x).norm() <= reach)
            } else {
                facets.iter().any(|f| mesh.distance_to_facet(x, f) <= reach)
            };
            near.then_some((site, h))
        })
        .collect()
}

type Held = (Vec<Option<f64>>, Vec<Option<usize>>);

/// The prescribed displacement of each dof, and the condition that prescribes it.
pub(super) fn supports<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
) -> Result<Held, RunError> {
    let dofs = model.sites.len() * D;
    let (mut prescribed, mut holder) = (vec![None; dofs], vec![None; dofs]);
    let site_of = site_of_node(model);
    let (lo, hi) = model.mesh.bounds();
    let tolerance = 1e-9 * (hi - lo).norm();
    for (number, condition) in conditions.iter().enumerate() {
        let support = match &condition.prescribed {
            Prescribed::Displacement(support) => support,
            Prescribed::Field(field) => {
                for (site, s) in model.sites.iter().enumerate() {
                    for (k, value) in field.at(&s.position).iter().flatten().enumerate() {
                        prescribed[site * D + k] = Some(*value);
                        holder[site * D + k] = Some(number);
                    }
                }
                continue;
            }
            Prescribed::Traction(_) | Prescribed::BodyForce(_) => continue,
        };
        let sites: Vec<usize> = match support {
            Support::Set { nodes, facets, .. } => {
                let on_nodes = nodes.iter().filter_map(|&n| site_of[n as usize]);
                let layer = first_layer(model, nodes, facets);
                on_nodes
                    .map(|s| s as usize)
                    .chain(layer.into_iter().map(|(s, _)| s))
                    .collect()
            }
            Support::Inside(region) => (0..model.sites.len())
                .filter(|&s| region.contains(&model.sites[s].position, tolerance))
                .collect(),
        };
        if sites.is_empty() {
            return Err(RunError::Idle {
                condition: condition.name.clone(),
                remedy: "name a set on the boundary, or enlarge the shape to hold nodes or points",
            });
        }
        for site in sites {
            for k in 0..D {
                if let Some(value) = condition.components.at(k, &model.sites[site].position) {
                    prescribed[site * D + k] = Some(value);
                    holder[site * D + k] = Some(number);
                }
            }
        }
    }
    Ok((prescribed, holder))
}

/// The applied force of each dof, and the sum of the sizes of the forces of all conditions.
///
/// Every site takes the load of its own model: a node the consistent force of all cells around it, a point its volume
/// times the body force, and in the first layer its share of the facets' area times the traction.
pub(super) fn loads<const D: usize>(
    model: &Model<D>,
    conditions: &[Condition<D>],
) -> Result<(Vec<f64>, f64), RunError> {
    let mut load = vec![Vector::<D>::zeros(); model.sites.len()];
    let site_of = site_of_node(model);
    let mut applied = 0.0;
    for condition in conditions {
        let mut own: Vec<(usize, Vector<D>)> = Vec::new();
        let field = |x: &Vector<D>| condition.components.vector(x);
        match &condition.prescribed {
            Prescribed::Displacement(_) | Prescribed::Field(_) => continue,
            Prescribed::Traction(facets) => {
                traction(model, facets, &condition.components, &site_of, &mut own);
            }
            Prescribed::BodyForce(region) => {
                for c in 0..model.mesh.cell_count() {
                    if !region.contains(&model.mesh.centroid(c), 0.0) || !model.node_takes(c) {
                        continue;
                    }
                    for (n, f) in fem::body_force_vector(&model.mesh, c, field) {
                        own.extend(site_of[n as usize].map(|s| (s as usize, f)));
                    }
                }
                for (site, s) in model.sites.iter().enumerate() {
                    if matches!(s.kind, SiteKind::Point(_)) && region.contains(&s.position, 0.0) {
                        own.push((site, field(&s.position) * s.volume));
                    }
                }
            }
        }
        if own.is_empty() {
            return Err(RunError::Idle {
                condition: condition.name.clone(),
                remedy: "name a set on the boundary of the body, or enlarge the shape",
            });
        }
        applied += own.iter().map(|(_, f)| f).sum::<Vector<D>>().norm();
        for (site, f) in own {
            load[site] += f;
        }
    }
    let flat = load.iter().flat_map(|f| f.iter().copied()).collect();
    Ok((flat, applied))
}

fn traction<const D: usize>(
    model: &Model<D>,
    facets: &[Facet],
    components: &Components<D>,
    site_of: &[Option<u32>],
    own: &mut Vec<(usize, Vector<D>)>,
) {
    let mesh: &Mesh<D> = &model.mesh;
    let field = |x: &Vector<D>| components.vector(x);
    // a facet without a cell is an element's as far as anybody knows, and carries no point
    let located = mesh.locate_facets(facets).ok();
    let cell = |f: usize| located.as_ref().map(|l| l[f].cell as usize);
    for (f, facet) in facets.iter().enumerate() {
        if cell(f).is_none_or(|c| model.node_takes(c)) {
            for (n, f) in fem::traction_vector(mesh, facet, field) {
                own.extend(site_of[n as usize].map(|s| (s as usize, f)));
            }
        }
    }
    let on_points: Vec<Facet> = located
        .into_iter()
        .flatten()
        .filter(|f| !model.is_element(f.cell as usize))
        .map(|f| f.nodes)
        .collect();
    let mut nodes: Vec<u32> = on_points.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    if nodes.is_empty() {
        return;
    }
    let layer = first_layer(model, &nodes, &on_points);
    let area: f64 = on_points.iter().map(|f| fem::facet_area(mesh, f)).sum();
    let face = |h: f64| h.powi(D as i32 - 1);
    let shares: f64 = layer.iter().map(|(_, h)| face(*h)).sum();
    for (site, h) in layer {
        let share = area * face(h) / shares;
        own.push((site, field(&model.sites[site].position) * share));
    }
}
