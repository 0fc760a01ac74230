//! Fields and motions carried from one layout of zones to another and back.

use super::*;
use crate::coupling::semidiscrete::behaviour::BondBehaviour;
use crate::mesh::Mesh;
use crate::mesh::generate::{Axis, rectangle};
use crate::peridynamics::bond_force::BondKinematics;
use crate::peridynamics::{BondBased, BondWeights, Micromodulus, PartialVolume};
use crate::progress::Silent;
use crate::solve::explicit::{Explicit, ExplicitParams, State, Undriven};
use crate::solve::stable_step::stable_step;
use crate::system::{SemiDiscrete, Symmetry};
use crate::tensor::Tensor4;
use crate::{
    coupling::{CoupledSystem, Coupling, Problem, Splice, Truncated},
    model::{ElasticCells, Peridynamics, PointSource, Surfaces, Zone, ZonedBody},
};

/// Size of an element; points lie four times as dense.
const H: f64 = 1.0;

/// Numbers between -0.5 and 0.5 without order.
fn noise(n: usize, a: usize) -> f64 {
    ((n * 7919 + a * 104_729) as f64 * 0.618_033_988_749_895).fract() - 0.5
}

/// Sixteen by twelve elements, nodes off their places by `jitter`.
fn plate(jitter: f64) -> Mesh<2> {
    let axis = |cells: usize| Axis::Uniform {
        min: 0.0,
        max: H * cells as f64,
        cells,
    };
    let mut mesh = rectangle(axis(16), axis(12)).mesh().unwrap();
    let (low, high) = mesh.bounds();
    for (n, x) in mesh.nodes.iter_mut().enumerate() {
        for a in 0..2 {
            if x[a] > low[a] && x[a] < high[a] {
                x[a] += jitter * H * noise(n, a);
            }
        }
    }
    mesh
}

/// A plate whose cells with the centroid within are peridynamic, of glass as light as it is stiff.
fn problem(mesh: Mesh<2>, within: [f64; 4], coupling: Box<dyn Coupling<2>>) -> Problem<2> {
    let zones = zones(&mesh, within);
    let body = ZonedBody {
        zones,
        elastic: ElasticCells {
            tensors: vec![Tensor4::isotropic(1.0, 1.0)],
            material: vec![0; mesh.cell_count()],
            of_points: 0,
            turned: Default::default(),
        },
        mesh,
        peridynamics: Some(Peridynamics {
            law: std::sync::Arc::new(BondBased::new(Micromodulus::InverseDistance, 1.0)),
            horizon: crate::model::HorizonField::Uniform(H),
            horizon_change: crate::model::HorizonChange::default(),
            points: PointSource::Lattice {
                spacing: 0.25 * H,
                origin: Vector::<2>::repeat(0.125 * H),
            },
            weights: BondWeights::Isotropic,
            volumes: PartialVolume::Full,
            barriers: Vec::new(),
            voids: Vec::new(),
            surfaces: Surfaces::Cut,
        }),
    };
    Problem { body, coupling }
}

fn zones(mesh: &Mesh<2>, [x0, y0, x1, y1]: [f64; 4]) -> Vec<Zone> {
    (0..mesh.cell_count())
        .map(|c| {
            let x = mesh.centroid(c);
            if x[0] > x0 && x[0] < x1 && x[1] > y0 && x[1] < y1 {
                Zone::Nonlocal
            } else {
                Zone::Local
            }
        })
        .collect()
}

/// Carries a field from one zone to another and compares.
fn carried(
    jitter: f64,
    from: [f64; 4],
    to: [f64; 4],
    field: impl Fn(&Vector<2>) -> Vector<2>,
) -> f64 {
    let build = |within| {
        let coupling: Box<dyn Coupling<2>> = if jitter > 0.0 {
            Box::new(Splice)
        } else {
            Box::<Truncated>::default()
        };
        problem(plate(jitter), within, coupling)
            .lay_out(None, &Silent)
            .unwrap()
            .0
    };
    let (old, new) = (build(from), build(to));
    let values = |model: &Model<2>| -> Vec<f64> {
        let sites = model.sites.iter();
        sites
            .flat_map(|s| <[f64; 2]>::from(field(&s.position)))
            .collect()
    };
    let carrying = Carried::of(&old).onto(&new).unwrap();
    assert!(!carrying.new.is_empty());
    let (found, exact) = (carrying.field::<2>(&values(&old)), values(&new));
    let size = exact.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let difference = |(a, b): (&f64, &f64)| (a - b).abs();
    found.iter().zip(&exact).map(difference).fold(0.0, f64::max) / size
}

#[test]
fn quadratic_fields_are_carried_exactly_where_zones_grow_and_shrink() {
    let quadratic = |x: &Vector<2>| {
        let (x, y) = (x[0], x[1]);
        Vector::<2>::new(
            1.0 + 0.3 * x - y + 0.2 * x * x - 0.1 * x * y,
            0.4 * y * y + x * y - x,
        )
    };
    let (small, large, corner) = (
        [4.0, 4.0, 8.0, 8.0],
        [2.0, 3.0, 12.0, 9.0],
        [6.0, 5.0, 16.0, 12.0],
    );
    for jitter in [0.0, 0.2] {
        for (from, to) in [
            (small, large),
            (large, small),
            (small, corner),
            (corner, large),
        ] {
            let error = carried(jitter, from, to, quadratic);
            assert!(error < 1e-11, "{jitter} {from:?} {to:?}: {error:e}");
        }
    }
}

#[test]
fn a_wave_is_carried_more_exactly_than_by_shape_functions() {
    // a wave of twelve elements: shape functions alone are off by (k H)^2/8 = 3.4e-2 in the middle of an element
    let k = 2.0 * std::f64::consts::PI / 12.0;
    let wave = |x: &Vector<2>| Vector::<2>::new((k * x[0]).sin(), (k * (x[0] + x[1])).cos());
    let error = carried(0.0, [4.0, 4.0, 8.0, 8.0], [2.0, 3.0, 12.0, 9.0], wave);
    assert!(error < 1.2e-2, "{error:e}");
}

/// Energy, momentum along x, and mass.
fn account(system: &dyn SemiDiscrete, state: &State) -> [f64; 3] {
    let mut sums = [system.stored_energy(&state.u), 0.0, 0.0];
    for (v, m) in state.v.chunks_exact(2).zip(system.mass()) {
        sums[0] += 0.5 * m * (v[0] * v[0] + v[1] * v[1]);
        sums[1] += m * v[0];
        sums[2] += m;
    }
    sums
}

/// A pulse that runs to the right, from the elements.
fn pulse(model: &Model<2>) -> State {
    // to the right, from the elements: v = -c u'
    let speed = 3.0f64.sqrt();
    let pulse = |x: f64| (-((x - 3.0) / 2.5f64).powi(2)).exp();
    let slope = |x: f64| -2.0 * (x - 3.0) / 6.25 * pulse(x);
    let at = |f: &dyn Fn(f64) -> f64| {
        let sites = model.sites.iter();
        sites
            .flat_map(|s| [f(s.position[0]), 0.0])
            .collect::<Vec<_>>()
    };
    State::start(at(&pulse), at(&|x| -speed * slope(x)))
}

/// Checks the changes of energy, momentum and mass when the zones change, `first` being the energy at the start.
fn check_account(within: &str, before: &[f64; 3], now: &[f64; 3], first: f64) {
    let energy = (now[0] / before[0] - 1.0).abs();
    let momentum = (now[1] - before[1]).abs() / (first * 16.0f64.sqrt());
    let mass = (now[2] / before[2] - 1.0).abs();
    assert!(energy < 4e-3, "{within}: energy {energy:e}");
    // lumped masses are a trapezoidal rule, off by H²/12 times the change of the velocity's slope across what changes, at most sqrt(3) 0.32 on a height of 12
    let rule = 3.0f64.sqrt() * 0.32 * 12.0 / 12.0 / (first * 16.0f64.sqrt());
    assert!(momentum < rule, "{within}: momentum {momentum:e}, {rule:e}");
    assert!(mass < 1e-12, "{within}: mass {mass:e}");
}

/// A pulse runs through a zone that grows, moves and shrinks under it, from elements to points and back.
#[test]
fn a_wave_keeps_its_energy_and_momentum_where_zones_change_under_it() {
    let layouts = [
        [4.0, 4.0, 8.0, 8.0],
        [3.0, 2.0, 12.0, 10.0],
        [8.0, 4.0, 13.0, 8.0],
        [2.0, 2.0, 10.0, 9.0],
        [5.0, 5.0, 9.0, 8.0],
    ];
    let behaviour = BondBehaviour::<2> {
        kinematics: BondKinematics::Linear,
        failure: None,
        softening: None,
        no_fail: &|_| false,
        contact: None,
        storage: crate::peridynamics::bond_force::Storage::Double,
        broken: None,
        heat: None,
    };
    let mut problem = problem(plate(0.0), layouts[0], Box::<Truncated>::default());
    let mut state: Option<(Carried<2>, State)> = None;
    let mut last: Option<[f64; 3]> = None;
    let mut first = 0.0;
    for within in layouts {
        problem.body.zones = zones(&problem.body.mesh, within);
        let (model, coupling) = problem.lay_out(None, &Silent).unwrap();
        let operator = coupling.operator(&model).unwrap();
        let mut system =
            CoupledSystem::new(&model, &operator, Symmetry::Symmetric, |_| 1.0, &behaviour)
                .unwrap();
        let mut begin = match state.take() {
            None => pulse(&model),
            Some((carried, old)) => {
                let carrying = carried.onto(&model).unwrap();
                State {
                    u: carrying.field::<2>(&old.u),
                    v: carrying.field::<2>(&old.v),
                    a: Vec::new(),
                    ..old
                }
            }
        };
        let now = account(&system, &begin);
        match last {
            Some(before) => check_account(&format!("{within:?}"), &before, &now, first),
            None => {
                first = now[0];
                assert!((now[2] / (16.0 * 12.0) - 1.0).abs() < 1e-12, "{}", now[2]);
            }
        }
        let step = 0.9 * stable_step(&system, &[]).unwrap().stable;
        begin.step = 0;
        let mut motion = Explicit::new(
            &mut system,
            &Undriven,
            ExplicitParams::with_step(step),
            begin,
        )
        .unwrap();
        for _ in 0..(1.5 / step) as usize {
            motion.step().unwrap();
        }
        let end = motion.into_state();
        last = Some(account(&system, &end));
        state = Some((Carried::of(&model), end));
        drop(system);
        drop(operator);
        problem = Problem {
            body: model.into_body(),
            coupling,
        };
    }
}

#[test]
fn a_law_of_other_constants_than_its_elements_is_refused() {
    let with = |tensor: Tensor4<2>, weights: BondWeights| {
        let splice = Box::new(Splice);
        let mut problem = problem(plate(0.0), [4.0, 4.0, 12.0, 8.0], splice);
        problem.body.elastic.tensors = vec![tensor];
        problem.body.peridynamics.as_mut().unwrap().weights = weights;
        problem.lay_out(None, &Silent).map(|_| ())
    };
    with(Tensor4::isotropic(1.0, 1.0), BondWeights::Isotropic).unwrap();
    let refused = with(Tensor4::isotropic(2.0, 1.0), BondWeights::Isotropic).unwrap_err();
    assert!(refused.to_string().contains("calibrated to"), "{refused}");
    // elements take the tensor of the lattice
    with(Tensor4::isotropic(2.0, 1.0), BondWeights::Plain).unwrap();
}
