//! Suites that measure the claims of the code: exact fields, error norms, and tables of figures with their limits.
//!
//! | suite | measurements |
//! |---|---|
//! | `patch` | affine fields through the seam: residual, solution, out-of-balance force |
//! | `balance` | the out-of-balance force of a seam against its leading term |
//! | `truncated` | truncated bonds: symmetry, definiteness, affine fields, equilibrium, order in δ, savings by symmetry |
//! | `seams` | cracks and waves in the plane beside every method, conditions of seams that do not follow the lattice |
//! | `skin` | bars with free sides, with a skin of elements and without |
//! | `growth` | the load at which a long straight crack grows, under the K-field; specimens beside fracture mechanics |
//! | `softening` | softening bonds: a notched strip pulled to separation, a notched beam in three-point bending |
//! | `damage` | continuum damage: stress of a bar, plate with a hole of [SAND2015-7998] section 6.2.5 |
//! | `ductile` | the notched bar of [SAND2015-7998] section 6.3.1 beside CalculiX, until it tears |
//! | `plasticity` | J2 plasticity in elements: Cook's membrane beside CalculiX, a thick cylinder beside Hill's solution |
//! | `layers` | two lattices of different horizons with a layer of elements between |
//! | `large-deformation` | stretches and rotations of any size at seams whose elements follow the bonds |
//! | `interfaces` | two materials: energy of an interface, a crack that meets one |
//! | `weights` | the elastic tensor of a lattice with isotropic weights |
//! | `tangents` | stiffness against finite differences of energies, symmetry, rigid motion, momentum, threads |
//! | `bar` | the coupled bar of [SAND2015-7998] section 7.3 |
//! | `partial-volumes` | weights of full families, other cells, cost of the closed forms |
//! | `convergence` | the studies of [SAND2015-7998] chapter 5 |
//! | `variable-horizon` | the bar of [SAND2015-7998] section 7.2 |
//! | `horizons` | ways to change the horizon: ghost force, pairs, reflection, eight passes |
//! | `choices` | choices of `accuracy` in small scenes, against finer runs |
//! | `scale` | static solves of up to a million unknowns: iterations, time, memory |
//! | `bobaru` | the tables of \[Bobaru2009\] |
//! | `meshes` | scenes as people type them, on meshes that fit nothing |
//! | `warned` | warnings of scenes that are drawn, beside their errors |
//! | `zones` | zones that are drawn, on such meshes |
//! | `quadratic` | cells of second order: affine fields, orders, known solutions |
//! | `estimates` | the estimates of [SAND2015-7998] chapters 2 and 3, and the ghost strain of figure 2.1 |
//! | `emmrich-weckner` | the nonlocal bar of \[EmmrichWeckner2007\] |
//! | `wave` | energy and momentum over 100 000 steps |
//! | `reflection` | part of a pulse that a seam reflects |
//! | `extremes` | units, places, laws, shapes and steps at their limits |
//! | `spectrum` | eigenvalues of coupled models that move, and their stable step; `strip.rs` is their scene |
//!
//! `typed.rs` has what the suites type of laws, couplings and shapes; `observed.rs` runs scenes by their text; `enclosed.rs`, `strip.rs` are scenes that several suites share. `report_page.rs` writes what they found as a page in Markdown. A suite is one file and one line of [`SUITES`]; the command line, the tests and the examples run them from there.

pub mod accuracy_control;
pub mod balance;
pub mod bar;
pub mod bobaru;
pub mod continuum_damage;
pub mod convergence;
pub mod ductile;
pub mod emmrich_weckner;
pub mod enclosed;
pub mod estimates;
pub mod extremes;
pub mod fields;
pub mod figures;
pub mod growth;
pub mod horizons;
pub mod interfaces;
pub mod large_deformation;
pub mod layers;
pub mod meshes;
mod observed;
pub mod partial_volumes;
pub mod patch;
pub mod plasticity;
pub mod position_aware;
pub mod quadratic;
pub mod reflection;
pub mod report_page;
pub mod scale;
pub mod softening;
mod specimens;
pub mod spectrum;
pub mod strip;
pub mod surface_layer;
pub mod tangents;
pub mod truncated;
pub mod typed;
pub mod variable_horizon;
pub mod warned;
pub mod wave;
pub mod weights;
pub mod zones;

pub use balance::balance;
pub use patch::patch;
pub use tangents::tangents;
pub use weights::weights;

use bondline::{observe::report::Table, progress::Progress, system::Ranks};
use rayon::prelude::*;

/// Extent to which a suite is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Every method, law and dimension at least once, in seconds.
    Quick,
    /// Everything.
    Full,
}

/// A named set of measurements.
#[derive(Clone, Copy, Debug)]
pub struct Suite {
    /// Its name on the command line.
    pub name: &'static str,
    /// Quantity that it measures, in one line.
    pub about: &'static str,
    /// Runs it.
    pub run: fn(Effort, &dyn Progress) -> Vec<Table>,
}

/// The suites that several processes can run together.
pub const ON_PROCESSES: [(&str, OnProcesses); 2] =
    [("patch", patch::patch_on), ("balance", balance::balance_on)];

/// Runs a suite by all processes, where there are several; all have the same tables.
pub type OnProcesses = fn(Effort, &dyn Progress, Option<&dyn Ranks>) -> Vec<Table>;

/// Shows a table of a full suite as soon as it is there, where the suite takes half an hour or more.
fn tell(table: &Table, effort: Effort, progress: &dyn Progress) {
    if effort == Effort::Full {
        progress.note(&table.text());
    }
}

/// Returns the results of `of_case` for each case, in their order. By several processes one after another, since all have to come to the same case together; else side by side.
fn each<C: Sync, R: Send>(
    ranks: Option<&dyn Ranks>,
    cases: &[C],
    of_case: impl Fn(&C) -> R + Sync + Send,
) -> Vec<R> {
    match ranks {
        None => cases.par_iter().map(of_case).collect(),
        Some(_) => cases.iter().map(of_case).collect(),
    }
}

/// Every suite, in the order in which `verify` runs them.
pub const SUITES: &[Suite] = &[
    Suite {
        name: "patch",
        about: "affine fields through the seam of every method, law, dimension and kind of mesh",
        run: patch,
    },
    Suite {
        name: "balance",
        about: "out-of-balance force of a seam against its leading term, spurious force of a single site",
        run: balance,
    },
    Suite {
        name: "truncated",
        about: "truncated bonds: symmetry, definiteness, affine fields, equilibrium, order in the horizon, what symmetry saves",
        run: truncated::run,
    },
    Suite {
        name: "skin",
        about: "3D bars with free sides, with a skin of elements and without: affine field, Young's modulus, Poisson's ratio",
        run: surface_layer::run,
    },
    Suite {
        name: "pals",
        about: "SAND2015-7998 chapter 4: energies of a position-aware solid at surfaces, Young's modulus of a tension bar (figure 4.2), relaxation (figure 4.7)",
        run: position_aware::run,
    },
    Suite {
        name: "softening",
        about: "softening bonds: energy and peak load of a notched strip pulled to separation, a notched beam in three-point bending",
        run: softening::run,
    },
    Suite {
        name: "growth",
        about: "load at which a long straight crack grows, over sqrt(G0 E'), under the K-field: laws, ratios, directions, heights in the cell; coupled specimens beside fracture mechanics",
        run: growth::run,
    },
    Suite {
        name: "damage",
        about: "SAND2015-7998 section 6.2: continuum damage of a bar, and of the plate with a hole (6.2.5) beside bonds that break by their stretch",
        run: continuum_damage::run,
    },
    Suite {
        name: "plasticity",
        about: "J2 plasticity in finite elements: Cook's membrane beside CalculiX, a thick cylinder up to 0.95 of its limit pressure beside Hill's solution",
        run: plasticity::run,
    },
    Suite {
        name: "layers",
        about: "two lattices, horizons 4:1, with a layer of elements between: reciprocity, affine fields, reflection",
        run: layers::run,
    },
    Suite {
        name: "large-deformation",
        about: "a stretch of 1.3 with a rotation of 0.7 rad at each seam whose elements follow the bonds: forces, stress on both sides, energy of the rotation",
        run: large_deformation::run,
    },
    Suite {
        name: "interfaces",
        about: "two materials: what opening their interface takes, and whether a crack that meets it turns or goes through",
        run: interfaces::run,
    },
    Suite {
        name: "weights",
        about: "elastic tensor of lattices with isotropic and with plain weights",
        run: weights,
    },
    Suite {
        name: "tangents",
        about: "stiffness against finite differences of energies, symmetry, momentum, threads",
        run: tangents,
    },
    Suite {
        name: "bar",
        about: "the coupled bar of SAND2015-7998 section 7.3: deviation from the straight line",
        run: bar::run,
    },
    Suite {
        name: "partial-volumes",
        about: "partial lengths, areas and volumes: sums over full families, other cells, cost",
        run: partial_volumes::run,
    },
    Suite {
        name: "convergence",
        about: "SAND2015-7998 chapter 5, figures 5.3, 5.5 and 5.8: errors and orders of every kernel; 3D to N = 90",
        run: convergence::run,
    },
    Suite {
        name: "variable-horizon",
        about: "the bar of variable horizon, SAND2015-7998 section 7.2: accelerations under linear and quadratic fields",
        run: variable_horizon::run,
    },
    Suite {
        name: "horizons",
        about: "ways to change the horizon, published and ours: ghost force, reciprocity, reflection, eight passes of a wave",
        run: horizons::run,
    },
    Suite {
        name: "spectrum",
        about: "eigenvalues of coupled strips: whether their motion is bounded, and the stable step against its limit",
        run: spectrum::run,
    },
    Suite {
        name: "wave",
        about: "100 000 steps at 0.95 of the stable step: discrete energy, momentum, the bodies' own energy beside a seam",
        run: wave::run,
    },
    Suite {
        name: "reflection",
        about: "what a seam sends back of a pulse, by its width, method, m and side",
        run: reflection::run,
    },
    Suite {
        name: "meshes",
        about: "scenes as people type them, on meshes that fit nothing: loads, affine fields, order, motion, fracture",
        run: meshes::run,
    },
    Suite {
        name: "zones",
        about: "zones drawn by seeds on such meshes: affine fields, steps in time, loads and supports across them",
        run: zones::run,
    },
    Suite {
        name: "warnings",
        about: "scenes drawn by a seed: what is wrong with their results, beside what they were told",
        run: warned::run,
    },
    Suite {
        name: "quadratic",
        about: "cells of second order: affine fields beside every coupling, order, Kirsch's hole, a cantilever, Cook's membrane",
        run: quadratic::run,
    },
    Suite {
        name: "extremes",
        about: "units, distances, Poisson ratios, m, thin cells, odd zones, fragments, time steps: each passes or is refused",
        run: extremes::run,
    },
    Suite {
        name: "bobaru",
        about: "the tables of Bobaru et al. 2009 beside ours: matrix, statics, waves",
        run: bobaru::run,
    },
    Suite {
        name: "emmrich-weckner",
        about: "the nonlocal bar of Emmrich and Weckner 2007: exact solution, three discretisations, energies",
        run: emmrich_weckner::run,
    },
    Suite {
        name: "estimates",
        about: "estimates of SAND2015-7998 (2.18), (2.23) to (2.28), (3.15) and the ghost strain of figure 2.1",
        run: estimates::run,
    },
];

/// Suites that take minutes, or gigabytes: `verify` runs them only by name.
pub const LONG_SUITES: &[Suite] = &[
    Suite {
        name: "choices",
        about: "what `accuracy` chooses in 25 small scenes: error, cost, and both against their predictions; minutes, only if named",
        run: accuracy_control::run,
    },
    Suite {
        name: "convergence-3d",
        about: "all of SAND2015-7998 figure 5.8, N = 75 to 150: about 20 minutes on two cores, only if named",
        run: convergence::run_solid,
    },
    Suite {
        name: "ductile",
        about: "SAND2015-7998 section 6.3.1: a notched bar beside CalculiX until it tears; an hour or more, only if named",
        run: ductile::run,
    },
    Suite {
        name: "seams",
        about: "cracks at rest and in motion, waves onto faces and corners, by every method; seams that do not follow the lattice: only if named",
        run: truncated::seams,
    },
    Suite {
        name: "scale",
        about: "static solves of up to a million unknowns: iterations, time, memory; minutes and 9 GB, only if named",
        run: scale::run,
    },
];

/// The suite of that name.
pub fn suite(name: &str) -> Option<&'static Suite> {
    SUITES.iter().chain(LONG_SUITES).find(|s| s.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suites_are_found_by_their_names() {
        for s in SUITES.iter().chain(LONG_SUITES) {
            assert_eq!(suite(s.name).map(|f| f.about), Some(s.about));
        }
        assert!(suite("ghost").is_none());
    }
}
