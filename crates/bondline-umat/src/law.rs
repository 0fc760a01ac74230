//! A user's routine with the calling convention of Abaqus' UMAT as a local law of solids.

use std::{
    collections::BTreeMap,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use bondline::material::{
    Banded, LocalHistory, LocalLaw, LocalResponse, UmatEnergies, UmatSettings, differenced_tangent,
};
use bondline::tensor::{Tensor, Tensor4, determinant, inverse, strain};

use crate::library::{Call, Routine};

/// The law of a user's routine, called with `NDI = 3`, `NSHR = 3`, `NTENS = 6`.
///
/// For small strains `DSTRAN` is the growth of `ε = ½ (G + Gᵀ)`, `DROT = I`, `DFGRD = I + G`.
///
/// For strains of any size it is the rate form of \[HughesWinget1980\]: with `L = ΔF F⁻¹` of the middle of the step, `DSTRAN = sym L`, `ω = skew L`, `DROT = (I − ½ ω)⁻¹ (I + ½ ω)`. `STRESS` and `STRAN`
/// are turned by `DROT` before the call, as Abaqus does, which makes it of second order in the length of a step where the principal directions stay, and of first order where they turn; tensors among `STATEV` are the routine's own (`ROTSIG`); `P = J σ F⁻ᵀ`. A rotation stresses nothing, whatever its size below half a turn within a step.
///
/// The algorithmic tangent is that of central differences, or `DDSDDE`, which for strains of any size is that of the Jaumann rate of `J σ`: then it is exact but for terms of the length of a step. `COORDS` is not a number, `NOEL`, `NPT`, `LAYER`, `KSPT` are 1: a law does not know its place. `KINC` counts the increments of a point. Without time (`step` of zero) and at the deformation
/// that is remembered the routine is not called.
#[derive(Debug)]
pub struct Umat {
    routine: Routine,
    settings: UmatSettings,
    elastic: Tensor4<3>,
    history: &'static [&'static str],
    failure: Mutex<Option<String>>,
    /// True once the routine has called `XIT`.
    is_over: AtomicBool,
}

/// Components in the order of Abaqus.
const COMPONENTS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Offsets of the parts of the history, and names of its numbers before `STATEV`.
const STRESS: usize = 9;
const STRAIN: usize = 15;
const ENERGIES: usize = 21;
const STORED: usize = 24;
const TIME: usize = 25;
const INCREMENTS: usize = 26;
const STATES: usize = 27;
const NAMES: [&str; STATES] = [
    "umat gradient xx",
    "umat gradient yx",
    "umat gradient zx",
    "umat gradient xy",
    "umat gradient yy",
    "umat gradient zy",
    "umat gradient xz",
    "umat gradient yz",
    "umat gradient zz",
    "umat stress xx",
    "umat stress yy",
    "umat stress zz",
    "umat stress xy",
    "umat stress xz",
    "umat stress yz",
    "umat strain xx",
    "umat strain yy",
    "umat strain zz",
    "umat strain xy",
    "umat strain xz",
    "umat strain yz",
    "umat sse",
    "umat spd",
    "umat scd",
    "umat stored energy",
    "umat time",
    "umat increments",
];

/// Names of a history with so many `STATEV`; those of each number are made once.
fn names(states: usize) -> &'static [&'static str] {
    static MADE: Mutex<BTreeMap<usize, &'static [&'static str]>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    made.entry(states).or_insert_with(|| {
        let own = (1..=states).map(|k| &*format!("umat state {k}").leak());
        let all: Vec<&'static str> = NAMES.into_iter().chain(own).collect();
        all.leak()
    })
}

/// A symmetric tensor of six components, those off the diagonal times `shear`.
fn tensor(components: &[f64], shear: f64) -> Tensor<3> {
    let mut t = Tensor::zeros();
    for ((i, j), x) in COMPONENTS.into_iter().zip(components) {
        let x = if i == j { *x } else { x * shear };
        t[(i, j)] = x;
        t[(j, i)] = x;
    }
    t
}

/// The six components of a symmetric tensor, those off the diagonal times `shear`.
fn components(t: &Tensor<3>, shear: f64) -> [f64; 6] {
    COMPONENTS.map(|(i, j)| if i == j { t[(i, j)] } else { t[(i, j)] * shear })
}

fn columns(t: &Tensor<3>) -> [f64; 9] {
    std::array::from_fn(|k| t[(k % 3, k / 3)])
}

/// Deformation of the material within a step.
struct Increment {
    /// `sym L` of the step.
    change: Tensor<3>,
    rotation: Tensor<3>,
    /// `J` before and after.
    volume_ratio: [f64; 2],
}

impl Umat {
    /// The law of a routine.
    pub fn new(routine: Routine, settings: UmatSettings) -> Self {
        Self {
            elastic: Tensor4::isotropic(settings.lame.0, settings.lame.1),
            history: names(settings.states),
            routine,
            settings,
            failure: Mutex::new(None),
            is_over: AtomicBool::new(false),
        }
    }

    /// Returns the deformation of the material within a step; none where it is turned inside out.
    fn increment(&self, before: &Tensor<3>, after: &Tensor<3>) -> Option<Increment> {
        let identity = Tensor::identity();
        if !self.settings.is_large {
            return Some(Increment {
                change: strain(&(after - before)),
                rotation: identity,
                volume_ratio: [1.0; 2],
            });
        }
        let volume_ratio = [before, after].map(|g| determinant(&(identity + g)));
        let (middle, _) = inverse(&(identity + (before + after) * 0.5))?;
        let flow = (after - before) * middle;
        let half_spin = (flow - flow.transpose()) * 0.25;
        let (back, _) = inverse(&(identity - half_spin))?;
        volume_ratio.iter().all(|j| *j > 0.0).then(|| Increment {
            change: strain(&flow),
            rotation: back * (identity + half_spin),
            volume_ratio,
        })
    }

    /// `½ σ : C⁻¹ : σ`.
    fn elastic_energy(&self, stress: &Tensor<3>) -> f64 {
        let (lambda, shear) = self.settings.lame;
        let mean = lambda / (3.0 * lambda + 2.0 * shear) * stress.trace();
        let elastic = (stress - Tensor::identity() * mean) / (2.0 * shear);
        0.5 * stress.dot(&elastic)
    }

    /// Returns the energy stored at the end of a step and that dissipated within it, per undeformed volume; `energies` are those that the routine gave, `stress` is that before, turned, and after.
    fn energies(
        &self,
        past: &[f64],
        energies: &[f64; 3],
        stress: &[Tensor<3>; 2],
        change: &Tensor<3>,
        volume_ratio: [f64; 2],
    ) -> (f64, f64) {
        let [was, is] = volume_ratio;
        let spent = |e: &[f64]| e[1] + e[2];
        match self.settings.energies {
            UmatEnergies::Routine => {
                let before = was * spent(&past[ENERGIES..STORED]);
                (is * energies[0], is * spent(energies) - before)
            }
            UmatEnergies::Stress => {
                let stored = is * self.elastic_energy(&stress[1]);
                let work = 0.5 * (stress[0] * was + stress[1] * is).dot(change);
                (stored, work - (stored - past[STORED]))
            }
        }
    }

    /// The response of a history.
    fn answer(&self, gradient: &Tensor<3>, history: &[f64], dissipated: f64) -> LocalResponse<3> {
        let stress = tensor(&history[STRESS..STRAIN], 1.0);
        let stored = history[STORED];
        if !self.settings.is_large {
            return LocalResponse {
                stress,
                across: 0.0,
                volume_ratio: 1.0,
                stored,
                dissipated,
            };
        }
        let deformation = Tensor::identity() + gradient;
        let Some((reverse, volume_ratio)) = inverse(&deformation) else {
            return NOT_A_NUMBER;
        };
        LocalResponse {
            stress: stress * reverse.transpose() * volume_ratio,
            across: 0.0,
            volume_ratio,
            stored,
            dissipated,
        }
    }

    /// Records a failure.
    fn note(&self, call: &Call<'_>, what: &str, remedy: &str) {
        let strain: Vec<String> = (call.strain.iter().zip(&call.change))
            .map(|(e, d)| format!("{:.4e}", e + d))
            .collect();
        let message = format!(
            "the routine `{}` of the material `{}` ({}) {what} in increment {} of a point, to t = {:.6e}, at the strain ({}); {remedy}",
            self.routine.symbol(),
            self.settings.name,
            self.routine.path().display(),
            call.increment,
            call.time + call.step,
            strain.join(", ")
        );
        let mut failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        *failure = Some(message);
    }

    /// Calls the routine; `states` is `STATEV`, before and after. None where it fails, which is recorded.
    fn called(
        &self,
        gradient: &Tensor<3>,
        step: f64,
        past: &[f64],
        states: &mut [f64],
    ) -> Option<Called> {
        let before = Tensor::<3>::from_column_slice(&past[..STRESS]);
        let increment = self.increment(&before, gradient)?;
        // what is not a number already says nothing of the routine
        let is_lost = !gradient.iter().all(|x| x.is_finite());
        if is_lost || self.is_over.load(Ordering::Relaxed) {
            return None;
        }
        let rotation = increment.rotation;
        let turned = |t: Tensor<3>| rotation * t * rotation.transpose();
        let stress = turned(tensor(&past[STRESS..STRAIN], 1.0));
        let total = turned(tensor(&past[STRAIN..ENERGIES], 0.5));
        let settings = &self.settings;
        let identity = Tensor::identity();
        // a routine may take more than the scene gives it
        let mut guarded = vec![GUARD; states.len() + GUARDS];
        guarded[..states.len()].copy_from_slice(states);
        let (own, guards) = guarded.split_at_mut(states.len());
        let mut call = Call {
            stress: components(&stress, 1.0),
            state: own,
            energies: std::array::from_fn(|k| past[ENERGIES + k]),
            strain: components(&total, 2.0),
            change: components(&increment.change, 2.0),
            time: past[TIME],
            step,
            temperature: settings.temperature,
            name: &settings.name,
            constants: &settings.constants,
            rotation: columns(&rotation),
            length: settings.length,
            deformation: [
                columns(&(identity + before)),
                columns(&(identity + gradient)),
            ],
            is_large: settings.is_large,
            increment: past[INCREMENTS] as i32 + 1,
            tangent: [0.0; 36],
            wanted_step: 1.0,
        };
        self.routine.call(&mut call, !settings.is_thread_safe);
        let written = guards.iter().rposition(|x| x.to_bits() != GUARD.to_bits());
        let wrong = match written {
            Some(k) => {
                self.is_over.store(true, Ordering::Relaxed);
                let (states, wanted) = (call.state.len(), call.state.len() + k + 1);
                let what = format!("wrote to number {wanted} of STATEV, which has {states}");
                Some((what, "give it as many by `state`"))
            }
            None => self.wrong(&call),
        };
        states.copy_from_slice(call.state);
        // what was to be read only is as it was, whatever the routine wrote there
        call.strain = components(&total, 2.0);
        call.change = components(&increment.change, 2.0);
        (call.time, call.step) = (past[TIME], step);
        if let Some((what, remedy)) = wrong {
            self.note(&call, &what, remedy);
            return None;
        }
        Some(Called {
            turned: stress,
            total,
            stress: call.stress,
            energies: call.energies,
            tangent: call.tangent,
            increment,
        })
    }

    /// `∂P_ij/∂G_kl` of `DDSDDE`: for small strains that itself. Else it is `C` of `δτ = J C : δD + δW τ − τ δW`, τ = J σ, with `δD + δW = δF F⁻¹`, and `P = τ F⁻ᵀ`.
    fn moduli(&self, gradient: &Tensor<3>, called: &Called) -> Tensor4<3> {
        let numbered = |i: usize, j: usize| {
            let found = COMPONENTS.iter().position(|c| *c == (i, j) || *c == (j, i));
            found.expect("six components name all pairs")
        };
        let given = |i: usize, j: usize, k: usize, l: usize| {
            called.tangent[6 * numbered(k, l) + numbered(i, j)]
        };
        if !self.settings.is_large {
            return Tensor4::from_fn(given);
        }
        let Some((reverse, volume_ratio)) = inverse(&(Tensor::identity() + gradient)) else {
            return Tensor4::from_fn(|_, _, _, _| f64::NAN);
        };
        let given = Tensor4::from_fn(given);
        let kirchhoff = tensor(&called.stress, 1.0) * volume_ratio;
        let mut tangent = Tensor4::zeros();
        for (k, l) in (0..3).flat_map(|k| (0..3).map(move |l| (k, l))) {
            let mut flow = Tensor::<3>::zeros();
            for j in 0..3 {
                flow[(k, j)] = reverse[(l, j)];
            }
            let spin = (flow - flow.transpose()) * 0.5;
            let stressed = given.contract(&flow) * volume_ratio;
            let change = stressed + spin * kirchhoff - kirchhoff * spin;
            let slope = (change - kirchhoff * flow.transpose()) * reverse.transpose();
            for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
                tangent.0[i][j][(k, l)] = slope[(i, j)];
            }
        }
        tangent
    }

    /// Returns the fault of the results of a call, and the remedy; none if they are sound.
    fn wrong(&self, call: &Call<'_>) -> Option<(String, &'static str)> {
        let is_finite = |numbers: &[f64]| numbers.iter().all(|x| x.is_finite());
        if self.routine.has_given_up() {
            self.is_over.store(true, Ordering::Relaxed);
            let remedy = "its own output says why";
            return Some(("called XIT".to_owned(), remedy));
        }
        let named = [
            ("STRESS", &call.stress[..]),
            ("STATEV", &*call.state),
            ("SSE, SPD, SCD", &call.energies[..]),
            ("DDSDDE", &call.tangent[..]),
        ];
        let named = &named[..if self.settings.has_tangent { 4 } else { 3 }];
        let bad = named.iter().find(|(_, numbers)| !is_finite(numbers));
        if let Some((what, numbers)) = bad {
            let k = numbers.iter().position(|x| !x.is_finite()).unwrap_or(0);
            let what = format!("gave {what} whose number {} is {}", k + 1, numbers[k]);
            let remedy = "check the routine and its constants; COORDS, and CELENT without `element-length`, are not numbers";
            return Some((what, remedy));
        }
        if self.settings.has_tangent && call.tangent.iter().all(|x| *x == 0.0) {
            let remedy = "without `tangent = \"routine\"` its stress is differenced";
            return Some(("gave no DDSDDE".to_owned(), remedy));
        }
        (call.wanted_step < 1.0).then(|| {
            let what = format!("asked for a smaller step, PNEWDT = {}", call.wanted_step);
            (what, "take more load steps, or a smaller time step")
        })
    }
}

/// Results of a routine for an increment, and its input.
struct Called {
    increment: Increment,
    /// Stress and strain before, turned.
    turned: Tensor<3>,
    total: Tensor<3>,
    /// `STRESS` \[Pa\], and `SSE`, `SPD`, `SCD` \[J/m³\].
    stress: [f64; 6],
    energies: [f64; 3],
    /// `DDSDDE` \[Pa\], by columns.
    tangent: [f64; 36],
}

/// The response where there is none.
const NOT_A_NUMBER: LocalResponse<3> = LocalResponse {
    stress: Tensor::from_array_storage(nalgebra::ArrayStorage([[f64::NAN; 3]; 3])),
    across: f64::NAN,
    volume_ratio: f64::NAN,
    stored: f64::NAN,
    dissipated: f64::NAN,
};

/// Number of guard entries behind `STATEV` that no routine may write to, and their value.
const GUARDS: usize = 64;
const GUARD: f64 = -7.306_172_948e-289;

/// Deformations that differ by no more than this of their size are one.
const SAME: f64 = 4.0 * f64::EPSILON;

impl LocalLaw<3> for Umat {
    fn tangent(&self) -> &Tensor4<3> {
        &self.elastic
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn is_objective(&self) -> bool {
        self.settings.is_large
    }

    fn flows_at_constant_volume(&self) -> bool {
        self.settings.flows_at_constant_volume
    }

    fn history(&self) -> LocalHistory {
        LocalHistory::of(self.history)
    }

    fn failure(&self) -> Option<String> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.clone()
    }

    fn in_band(&self, _width: f64) -> Option<Banded<3>> {
        None
    }

    fn respond(
        &self,
        gradient: &Tensor<3>,
        step: f64,
        past: &[f64],
        present: &mut [f64],
    ) -> LocalResponse<3> {
        present.copy_from_slice(past);
        let before = Tensor::<3>::from_column_slice(&past[..STRESS]);
        if step == 0.0 && (gradient - before).amax() <= SAME * gradient.amax() {
            return self.answer(&before, past, 0.0);
        }
        let Some(called) = self.called(gradient, step, past, &mut present[STATES..]) else {
            return NOT_A_NUMBER;
        };
        let change = &called.increment.change;
        let ends = [called.turned, tensor(&called.stress, 1.0)];
        let (stored, dissipated) = self.energies(
            past,
            &called.energies,
            &ends,
            change,
            called.increment.volume_ratio,
        );
        present[..STRESS].copy_from_slice(&columns(gradient));
        present[STRESS..STRAIN].copy_from_slice(&called.stress);
        present[STRAIN..ENERGIES].copy_from_slice(&components(&(called.total + change), 2.0));
        present[ENERGIES..STORED].copy_from_slice(&called.energies);
        present[STORED] = stored;
        present[TIME] = past[TIME] + step;
        present[INCREMENTS] = past[INCREMENTS] + 1.0;
        self.answer(gradient, present, dissipated)
    }

    fn algorithmic_tangent(&self, gradient: &Tensor<3>, step: f64, past: &[f64]) -> Tensor4<3> {
        if !self.settings.has_tangent {
            return differenced_tangent(self, gradient, step, past);
        }
        let mut states = past[STATES..].to_vec();
        match self.called(gradient, step, past, &mut states) {
            Some(called) => self.moduli(gradient, &called),
            None => Tensor4::from_fn(|_, _, _, _| f64::NAN),
        }
    }
}
