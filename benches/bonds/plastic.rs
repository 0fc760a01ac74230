//! Correspondence with plasticity: by a stress per point, and by a force state per bond.

use std::{sync::Arc, time::Instant};

use bondline::assembly::Transfer;
use bondline::material::Kinematics as Body;
use bondline::material::LocalLaw;
use bondline::peridynamics::bond_force::{
    BondForce, BondPass, BondSetup, CriticalStretch, Failure, Kinematics, Layout, Storage,
    bond_pass,
};
use bondline::peridynamics::laws::{Constants, Named};
use bondline::peridynamics::{
    BondEnergy, Cloud, DeformedFamily, Ends, EnergyDensity, Factors, Families, ForceState,
    HistoryLayout, Influence, Law, LinearForceState, Past, PdBody, Present, TIE_TOLERANCE,
};
use bondline::system::{FailureUpdate, Interval};
use bondline::tensor::Vector;

use super::{H, cpu, pool};

/// A law whose points do not tell that they have a stress.
#[derive(Debug)]
struct BondByBond(Arc<dyn Law<3>>);

impl BondByBond {
    fn states(&self) -> &dyn ForceState<3> {
        self.0.force_state().expect("force states")
    }
}

impl Law<3> for BondByBond {
    fn name(&self) -> &'static str {
        self.0.name()
    }
    fn linearised(&self) -> &dyn LinearForceState<3> {
        self.0.linearised()
    }
    fn force_state(&self) -> Option<&dyn ForceState<3>> {
        Some(self)
    }
    fn local_law(&self) -> Option<Arc<dyn LocalLaw<3>>> {
        self.0.local_law()
    }
    fn has_breakable_bonds(&self) -> bool {
        true
    }
    fn bond_energy(&self, _: f64) -> Option<BondEnergy> {
        None
    }
}

impl ForceState<3> for BondByBond {
    fn history(&self) -> HistoryLayout {
        self.states().history()
    }
    fn respond(
        &self,
        family: &DeformedFamily<'_, 3>,
        step: f64,
        past: Past<'_>,
        present: Present<'_>,
        force: &mut [Vector<3>],
    ) -> EnergyDensity {
        self.states().respond(family, step, past, present, force)
    }
    fn is_objective(&self) -> bool {
        self.states().is_objective()
    }
    fn energy_ratio(&self, _: f64) -> f64 {
        1.0
    }
}

fn pass(n: usize, law: &Arc<dyn Law<3>>) -> (Box<dyn BondPass<3>>, Vec<Vector<3>>) {
    let at = |p: usize| [p % n, p / n % n, p / n / n].map(|k| H * k as f64);
    let position: Vec<Vector<3>> = (0..n * n * n).map(|p| at(p).into()).collect();
    let horizon = vec![3.0 * H; position.len()];
    let families = Families::search(&position, &horizon, TIE_TOLERANCE).expect("families");
    let volume = vec![H.powi(3); position.len()];
    let cloud = Cloud {
        position: position.clone(),
        volume: volume.clone(),
        horizon,
        transfer: Transfer::new(),
        material: Vec::new(),
    };
    let (linear, of_body) = (law.linearised(), families.clone());
    let body = PdBody::new(cloud, of_body, linear, &Factors::Plain, Ends::Differ).expect("a body");
    let pass = bond_pass(&BondSetup {
        position: &position,
        volume: &volume,
        families: &families,
        rows: &[],
        without_energy: &[],
        force: BondForce::Law { law, body: &body },
        kinematics: Kinematics::Exact,
        failure: Some(Failure {
            critical: CriticalStretch::TearingParameter(1e3),
            no_fail: &[],
        }),
        precracked: None,
        layout: Layout::List,
        storage: Storage::Double,
    });
    (pass.expect("a pass"), position)
}

/// Nanoseconds per directed bond and step, force and commit, the least of `steps`: CPU on one thread, and wall clock on two.
fn per_bond(
    pass: &mut dyn BondPass<3>,
    position: &[Vector<3>],
    yields: bool,
    steps: usize,
) -> [f64; 2] {
    let mut force = vec![0.0; 3 * position.len()];
    let mut least = [f64::INFINITY; 2];
    let noise = super::motion(force.len());
    // beyond the yield strain of 0.4 %, a little more in each step
    let first = if yields { 0.05 } else { 1e-3 };
    for k in 0..steps {
        let e = first * (1.0 + 1e-3 * k as f64);
        let strain = [e, -0.4 * e, -0.4 * e];
        let mut u = noise.clone();
        for (u, x) in u.chunks_exact_mut(3).zip(position) {
            (0..3).for_each(|a| u[a] += strain[a] * x[a]);
        }
        let interval = Interval {
            end: k as f64,
            length: 1.0,
        };
        for (threads, least) in [1, 2].into_iter().zip(&mut least) {
            let (start, busy) = (Instant::now(), cpu());
            pool(threads).install(|| {
                pass.force_into(&u, &mut force, interval, FailureUpdate::Update);
                pass.commit();
            });
            let time = match threads {
                1 => cpu() - busy,
                _ => start.elapsed().as_nanos() as f64,
            };
            *least = least.min(time / pass.bonds() as f64);
        }
    }
    least
}

/// Both ways, elastic and flowing, on a block of 24³ points.
pub(super) fn correspondence() {
    println!(
        "\n### Plastic correspondence for large strains, ns per directed bond and step (3D, m = 3, tearing parameter on, force and commit, the least of 15)\n"
    );
    println!("| state | | one thread, CPU | two threads, wall |");
    println!("|---|---|---|---|");
    let constants = Constants {
        lambda: 1.0,
        shear: 1.0,
        influence: Influence::Gaussian,
        kinematics: Body::Solid,
        density: 1.0,
    };
    for (state, yields) in [("elastic", false), ("flowing", true)] {
        let mut found = Vec::new();
        for control in [None, Some(0.0), Some(1.0), Some(2.0)] {
            let values = [0.01, 0.1, 0.0, 0.0, 0.1, 1.0, control.unwrap_or(0.0)];
            let law = Named::PlasticCorrespondence.build::<3>(constants, &values);
            let law = match control {
                None => Arc::new(BondByBond(law)) as Arc<dyn Law<3>>,
                Some(_) => law,
            };
            let (mut pass, position) = pass(24, &law);
            let times = per_bond(pass.as_mut(), &position, yields, 15);
            let name = match control {
                None => "bond by bond",
                Some(0.0) => "by points, bond force",
                Some(1.0) => "by points, length",
                Some(_) => "by points, drag",
            };
            println!("| {state} | {name} | {:.1} | {:.1} |", times[0], times[1]);
            found.push(times);
        }
        println!(
            "| {state} | ratio | {:.1} | {:.1} |",
            found[0][0] / found[1][0],
            found[0][1] / found[1][1]
        );
    }
}
