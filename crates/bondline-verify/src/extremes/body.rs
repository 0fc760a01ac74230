//! A scene made to measure, and the results of its run.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use bondline::model::Sampler;
use bondline::observe::summary::MotionSummary;
use bondline::progress::Silent;
use bondline::run::AnyScene;
use bondline::run::{RunError, Solved as Solution, solve_with};
use bondline::scene::{Scene, Source};
use bondline::tensor::{Vector, padded};

/// Couplings that join two models.
pub const METHODS: [&str; 5] = [
    "splice",
    "blending",
    "balanced",
    "partial-stress",
    "truncated",
];

/// A square (or bar, or cube) of finite elements with peridynamics in its middle third, pulled unevenly along x.
#[derive(Clone, Debug)]
pub struct Body {
    /// Dimension.
    pub dimension: usize,
    /// Length of its edges.
    pub size: f64,
    /// Its lowest corner, along every axis.
    pub origin: f64,
    /// Young's modulus.
    pub modulus: f64,
    /// Poisson ratio of an LPS; bond-based without.
    pub poisson: Option<f64>,
    /// Coupling of the two.
    pub coupling: &'static str,
    /// m = δ/h.
    pub ratio: f64,
    /// Cells, and spacings, along each edge; a multiple of 3.
    pub cells: usize,
    /// Width of the transition zone over the length, where a coupling has one.
    pub transition: f64,
    /// Displacement of the right end over the length.
    pub stretch: f64,
    /// Degree of the influence function of an LPS, or of the micromodulus.
    pub influence: Option<usize>,
    /// More of the scene, whole tables.
    pub more: String,
}

impl Body {
    /// A square of size 1 and modulus 1, m = 2.
    pub fn new(coupling: &'static str) -> Self {
        Self {
            dimension: 2,
            size: 1.0,
            origin: 0.0,
            modulus: 1.0,
            poisson: None,
            coupling,
            ratio: 2.0,
            cells: 24,
            transition: 0.2,
            stretch: 0.01,
            influence: None,
            more: String::new(),
        }
    }

    /// The scene.
    pub fn scene(&self) -> String {
        let d = self.dimension;
        let (low, high) = (self.origin, self.origin + self.size);
        let list = |v: f64| match d {
            1 => format!("{v:e}"),
            _ => format!("[{}]", vec![format!("{v:e}"); d].join(", ")),
        };
        let h = self.size / self.cells as f64;
        let third = self.size / 3.0;
        let axes: String = ["x", "y", "z"][..d]
            .iter()
            .map(|a| format!("{a} = {{ cells = {} }}\n", self.cells))
            .collect();
        let (kinematics, shape) = [
            ("bar", "line"),
            ("plane-strain", "rectangle"),
            ("solid", "box"),
        ][d - 1];
        let influence = self
            .influence
            .map(|n| format!("{{ degree = {n}, alpha = 1 }}"));
        let (material, influence) = match self.poisson {
            None => (
                format!(
                    "[materials.body.bond-based]\nyoungs-modulus = {:e}\ndensity = 1\n{}",
                    self.modulus,
                    influence.map_or(String::new(), |i| format!("micromodulus.influence = {i}\n")),
                ),
                String::new(),
            ),
            Some(nu) => (
                format!(
                    "[materials.body.lps]\nyoungs-modulus = {:e}\npoisson-ratio = {nu}\ndensity = 1\n",
                    self.modulus
                ),
                influence.map_or(String::new(), |i| format!("influence = {i}\n")),
            ),
        };
        let pure = matches!(self.coupling, "local" | "nonlocal");
        let zones = if pure {
            String::new()
        } else {
            format!(
                "[zones.nonlocal]\nbox = {{ min = {}, max = {} }}\n",
                list(low + third - 0.01 * h),
                list(high - third + 0.01 * h)
            )
        };
        let transition = if matches!(self.coupling, "blending" | "partial-stress" | "balanced") {
            format!(
                "[zones.transition]\naround = {:e}\n",
                self.transition * self.size
            )
        } else {
            String::new()
        };
        let held = ["x = 0\n", "y = 0\n", "z = 0\n"][..d].concat();
        let pull = self.stretch * self.size;
        let pull = if d == 1 {
            format!("x = {pull:e}\n")
        } else {
            format!(
                "x = \"{pull:e}*(1+0.3*((y-({low:e}))/{:e})^2)\"\n",
                self.size
            )
        };
        format!(
            "kinematics = \"{kinematics}\"\ncoupling = \"{}\"\n[mesh.{shape}]\nmin = {}\nmax = {}\n{axes}{material}\
             [peridynamics]\nhorizon = {:e}\npoints.lattice.spacing = {h:e}\n{influence}{zones}{transition}\
             [conditions.left.displacement]\non = \"left\"\n{held}[conditions.right.displacement]\non = \"right\"\n{pull}\
             [solver]\nmethod = \"direct\"\n{}",
            self.coupling,
            list(low),
            list(high),
            self.ratio * h,
            self.more,
        )
    }

    /// Solves it: displacements over the length at fixed places, and the residual.
    ///
    /// # Errors
    /// The message of the scene or of the run.
    pub fn solve(&self) -> Result<Solved, String> {
        let found = solve(&self.scene())?;
        Ok(Solved {
            samples: found.samples.iter().map(|u| u / self.size).collect(),
            ..found
        })
    }
}

/// Results of a run.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// Displacements at fixed places, component by component.
    pub samples: Vec<f64>,
    /// Relative residual of the system.
    pub residual: f64,
    /// Bonds.
    pub bonds: usize,
}

impl Solved {
    /// Largest difference at a sample over the largest displacement; infinite if any is no number, or samples are missing.
    pub fn difference(&self, other: &Self) -> f64 {
        if self.samples.len() != other.samples.len() || self.samples.is_empty() {
            return f64::INFINITY;
        }
        let (mut most, mut scale) = (0.0f64, 0.0f64);
        for (a, b) in self.samples.iter().zip(&other.samples) {
            if !(a.is_finite() && b.is_finite()) {
                return f64::INFINITY;
            }
            most = most.max((a - b).abs());
            scale = scale.max(b.abs());
        }
        most / scale
    }
}

/// Samples per axis.
const EACH: [usize; 3] = [37, 11, 5];

fn of<const D: usize>(scene: Scene<D>) -> Result<Solved, RunError> {
    let (low, high) = scene.mesh.bounds();
    let mut found = Solved::default();
    let summary = solve_with(scene, &Silent, |_, solved| {
        let sampler = Sampler::new(solved.model);
        let each = EACH[D - 1];
        for k in 0..each.pow(D as u32) {
            let x = Vector::<D>::from_fn(|a, _| {
                let t = ((k / each.pow(a as u32) % each) as f64 + 0.53) / each as f64;
                low[a] + t * (high[a] - low[a])
            });
            if let Some(u) = sampler.displacement(&x, solved.displacement) {
                found.samples.extend(&padded(&u)[..D]);
            }
        }
        Ok(Vec::new())
    })?;
    found.residual = summary.residual;
    found.bonds = summary.sizes.bonds;
    Ok(found)
}

/// Runs a scene that moves, or is loaded step by step; its files are of no further use.
///
/// # Errors
/// As [`solve`].
pub fn moved(source: &Source) -> Result<MotionSummary, String> {
    let mut scene = bondline_study::from_source(source, Path::new(""), "extreme")
        .map_err(|e| e.message().to_owned())?;
    // several run at a time
    static BEGUN: AtomicUsize = AtomicUsize::new(0);
    let number = BEGUN.fetch_add(1, Ordering::Relaxed);
    let name = format!("bondline-extremes-{}-{number}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    scene.set_output_directory(folder.clone());
    let summary = scene.run(&Silent).map_err(|e| e.to_string());
    // what lies there is of no further use
    let _ = std::fs::remove_dir_all(&folder);
    summary?.motion.ok_or_else(|| "nothing moved".to_owned())
}

/// Solves a plane scene at rest, and hands out what samples its displacement.
///
/// # Errors
/// As [`solve`].
pub fn sampled(text: &str, mut see: impl FnMut(&Sampler<'_, 2>, &[f64])) -> Result<(), String> {
    let source = Source::new("extreme.toml", text);
    let scene = bondline_study::from_source(&source, Path::new(""), "extreme")
        .map_err(|e| e.message().to_owned())?;
    let AnyScene::Plane(scene) = scene else {
        return Err("no plane scene".to_owned());
    };
    let see = |_: &_, solved: &Solution<'_, 2>| {
        see(&Sampler::new(solved.model), solved.displacement);
        Ok(Vec::new())
    };
    solve_with(*scene, &Silent, see)
        .map(|_| ())
        .map_err(|e| e.to_string())
}

/// Solves a scene at rest.
///
/// # Errors
/// The message of the scene or of the run, which name place and remedy.
pub fn solve(text: &str) -> Result<Solved, String> {
    solve_in(Path::new(""), text)
}

/// Solves a scene at rest whose mesh lies in `folder`.
///
/// # Errors
/// As [`solve`].
pub fn solve_in(folder: &Path, text: &str) -> Result<Solved, String> {
    let source = Source::new("extreme.toml", text);
    let scene = bondline_study::from_source(&source, folder, "extreme")
        .map_err(|e| e.message().to_owned())?;
    match scene {
        AnyScene::Bar(s) => of(s.scene),
        AnyScene::Plane(s) => of(s.scene),
        AnyScene::Solid(s) => of(s.scene),
    }
    .map_err(|e| e.to_string())
}
