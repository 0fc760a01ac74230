//! bondline joins a classical finite-element (FE) region to a meshfree peridynamic (PD) region, so that a structure pays for
//! nonlocality only where it may crack, and so that the seam between the two adds nothing of its own.
//!
//! # Governing equations
//!
//! Everywhere the body is in equilibrium, `L(x) + b(x) = 0`; the models differ in the internal force density `L` \[N/m^D\].
//!
//! *Finite elements* (local): `L⁰ = ∇·σ`, `σ = C : ∇u`, in weak form on the cells of a mesh ([`fem`]).
//!
//! *Peridynamics* (nonlocal), [SAND2015-7998] eq. (2.5): forces along the bonds `ξ = x′ − x` to all points of the family
//! `H = { ξ : 0 < |ξ| ≤ δ }` ([`peridynamics`]),
//!
//! ```text
//!   L^pd(x) = Σ ( T[x]⟨ξ⟩ − T[x′]⟨−ξ⟩ ) V′
//!
//!   bond-based       T⟨ξ⟩ = ½ λ(|ξ|) ξ (ξ·η)                                          η = u(x′) − u(x)
//!   LPS              T⟨ξ⟩ = (D k − (D+2) μ)/m ω θ ξ + D (D+2) μ/m ω ξ (ξ·η)/|ξ|²      θ = D/m Σ ω ξ·η V′,  m = Σ ω |ξ|² V′
//!   correspondence   T⟨ξ⟩ = ω σ(Ḡ K⁻¹) K⁻¹ ξ                                          Ḡ = Σ ω η⊗ξ V′,  K = Σ ω ξ⊗ξ V′
//! ```
//!
//! A uniform deformation of an endless body gives the *collapsed stress* `ν⁰ = Σ T⟨ξ⟩⊗ξ V′ = C : G`; the local side of a coupled model carries just this `C`.
//!
//! *Couplings* ([`coupling`]) choose the equation of each site:
//!
//! ```text
//!   splice           L = L^pd in B_pd,   L⁰ in B_0                                          eq. (2.30)
//!   blending         L = Σ w (T[x]⟨ξ⟩ − T[x′]⟨−ξ⟩) V′ + the Taylor expansion of what (1 − w) leaves out
//!                    w = ½ (β(x) + β(x′)),  β = 1 in B_pd, 0 in B_0                         eq. (3.14)
//!   partial stress   L = ∇·ν^ps in B_ps,   ν^ps(x) = Σ T[x]⟨ξ⟩⊗ξ V′                         eq. (2.19), (2.29)
//! ```
//!
//! `docs/methods.md` derives them and says what each can and cannot do.
//!
//! # Notation
//!
//! | symbol | in code | meaning | unit |
//! |---|---|---|---|
//! | D | `D` | dimension, 1, 2 or 3; the only const generic | |
//! | ξ | `xi` | bond `x′ − x` in the reference configuration | m |
//! | η | `eta` | relative displacement `u(x′) − u(x)` of a bond | m |
//! | δ | `horizon` | horizon | m |
//! | h | `spacing` | distance of neighbouring points | m |
//! | δ/h | `ratio` | what tables call m, the horizon in spacings | 1 |
//! | V′ | `volume` | volume of the far point of a bond | m^D |
//! | λ(\|ξ\|) | [`Micromodulus`] | stiffness of a bond of a bond-based material | N/m^(2D+3) |
//! | ω(\|ξ\|) | `omega`, [`Influence`] | influence function | 1 |
//! | m | `weighted_volume` | weighted volume `Σ ω \|ξ\|² V′` (where ω is a number) | m^(D+2) |
//! | θ | `theta` | dilatation of a family | 1 |
//! | T | `pair`, `state` | force state: force density per volume squared on a bond | N/m^(2D) |
//! | K | `shape` | shape tensor `Σ ω ξ⊗ξ V′` (in solvers: the stiffness, `K u = f`) | m^(D+2) |
//! | G | `gradient` | displacement gradient `∂u_i/∂x_j` | 1 |
//! | ν^ps | `partial_stress` | partial stress `Σ T⟨ξ⟩⊗ξ V′` | N/m^(D−1) |
//! | ν⁰, C | `collapsed_tensor` | collapsed stress, and the tensor that gives it | N/m^(D−1) |
//! | λ, μ, k | `lambda`, `mu`, `bulk` | Lamé's parameters and bulk modulus of D dimensions | Pa |
//! | β | `beta` | blending function, 1 where peridynamic, 0 where local | 1 |
//! | w | `weight` | weight `½ (β + β′)` of a bond | 1 |
//!
//! # Units
//!
//! No units are built in. Give all lengths, forces and stresses in one consistent set (m, N, Pa; mm, N, MPa; or none at all) and read the results in the same. The
//! units in doc comments say what kind of quantity a number is. A plane body is one unit thick, a bar has a cross-section of one unit.
//!
//! # Modules
//!
//! | module | contents |
//! |---|---|
//! | [`tensor`] | small tensors, const generic in `D` |
//! | [`shape`] | shapes, signed distances, barriers that cut bonds |
//! | [`mesh`] | nodes, cells, named sets, generators, readers, quality; geometry only |
//! | [`material`] | local laws: displacement gradient to energy, stress, tangent |
//! | [`fem`] | cells, quadrature, the element kernel, loads |
//! | [`peridynamics`] | families, influence functions, bond weights, laws, the PD body |
//! | [`contact`] | surfaces that press on each other, friction, closed cracks |
//! | [`coupling`] | sites, what completes families and elements at the seam, one file per method |
//! | [`assembly`] | sparse rows: places through sites, and the accumulator of one stiffness row |
//! | [`system`] | the seam to solvers: a block-sparse stiffness and its symmetry |
//! | [`solve`] | orderings, multifrontal factorisation, Krylov methods with multigrid, the static problem |
//! | [`progress`] | progress reports of long computations |
//! | [`observe`] | the only writers: VTU, CSV, JSON |
//! | [`scene`] | TOML to a validated scene; the only module that reads TOML |
//! | [`run`] | one run of a scene: laid out, proved, solved, written |
//! | [`predict`] | what a run will need, without solving |
//! | [`regular_file`] | refuses pipes, devices and folders in the place of a file |
//!
//! Other crates of the workspace stand on this one: `bondline-study` (many runs, `accuracy`, plots), `bondline-cli` (the program), `bondline-verify` (the suites that
//! `bondline verify` prints), `bondline-python` (the Python package) and `bondline-terminal` (what programs share).
//!
//! # From a scene
//!
//! ```no_run
//! use bondline::{AnyScene, Silent};
//! use std::path::Path;
//!
//! let scene = AnyScene::load(Path::new("examples/slit_plate.toml"), &["coupling=splice".to_owned()])?;
//! let summary = scene.run(&Silent)?;
//! println!("{summary}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # From Rust
//!
//! A [`SceneBuilder`] makes the same scenes without a file, with every key of the format; its [`Solution`] has fields and tables by name. Numbers that vary are expressions, or a [`Function`].
//!
//! ```
//! use bondline::{Condition, Function, Material, Region, SceneBuilder, Silent};
//!
//! let solution = SceneBuilder::bar("bar")
//!     .line(0.0, 30.0, 30)
//!     .material("steel", Material::bond_based(3.0))
//!     .horizon(3.0)
//!     .nonlocal(Region::cuboid([10.0], [20.0]))
//!     .condition("left", Condition::displacement("left").x(0))
//!     .condition("pull", Condition::traction("right").x(Function::of_position(|_| 0.03)))
//!     .solve(&Silent)?;
//! for (x, u) in solution.points().iter().zip(solution.displacement()?) {
//!     assert!((u[0] - 0.01 * x[0]).abs() < 1e-12);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/cracked_plate.rs` is a plate with a crack, `examples/bar_wave.rs` a wave in time, `examples/ring_study.rs` a study of rings on meshes in memory.
//!
//! # The parts
//!
//! A [`Problem`] says what the model is, a [`Model`] lays out its sites and bonds, an [`Operator`] gives the rows of the stiffness, a [`StaticProblem`] is solved.
//!
//! ```
//! use bondline::mesh::{CellShape, Mesh};
//! use bondline::model::{ElasticCells, HorizonField, PointSource, Surfaces, ZonedBody};
//! use bondline::peridynamics::{BondBased, BondWeights, PartialVolume};
//! use bondline::solve::statics::{StaticParams, solve};
//! use bondline::tensor::{Tensor4, Vector, padded};
//! use bondline::{Coupling, Micromodulus, Model, Peridynamics, Silent, Splice, StaticProblem, Zone, ZoneLayout};
//! use std::sync::Arc;
//!
//! // a bar of 30 cells of length 1, peridynamic in the middle third, E = 3
//! let mut mesh = Mesh::<1>::default();
//! mesh.nodes = (0..=30).map(|i| Vector::<1>::new(f64::from(i))).collect();
//! (0..30u32).for_each(|i| mesh.push_cell(CellShape::Line2, &[i, i + 1]));
//! let zones = (0..30).map(|c| if (10..20).contains(&c) { Zone::Nonlocal } else { Zone::Local });
//! let body = ZonedBody {
//!     zones: zones.collect(),
//!     elastic: ElasticCells {
//!         tensors: vec![Tensor4::isotropic(1.0, 1.0)],
//!         material: vec![0; 30],
//!         of_points: 0,
//!         turned: Default::default(),
//!     },
//!     peridynamics: Some(Peridynamics {
//!         horizon_change: Default::default(),
//!         law: Arc::new(BondBased::new(Micromodulus::Constant, 1.0)),
//!         horizon: HorizonField::Uniform(3.0),
//!         points: PointSource::Cells,
//!         weights: BondWeights::Isotropic,
//!         volumes: PartialVolume::Full,
//!         barriers: vec![],
//!         voids: vec![],
//!         surfaces: Surfaces::Cut,
//!     }),
//!     mesh,
//! };
//! let coupling: &dyn Coupling<1> = &Splice;
//! let model = Model::new(body, coupling, None, &Silent)?;
//! let operator = coupling.operator(&model)?;
//! let stiffness = model.assemble(&operator, &Silent);
//!
//! // both ends are held, the right one 0.3 away from where it was
//! let positions: Vec<_> = model.sites.iter().map(|s| padded(&s.position)).collect();
//! let prescribed: Vec<_> = positions.iter().map(|x| match x[0] {
//!     0.0 => Some(0.0),
//!     30.0 => Some(0.3),
//!     _ => None,
//! }).collect();
//! let solution = solve(
//!     &StaticProblem {
//!         stiffness: &stiffness,
//!         symmetry: coupling.symmetry(),
//!         positions: &positions,
//!         load: &vec![0.0; stiffness.dofs()],
//!         prescribed: &prescribed,
//!     },
//!     &StaticParams::default(),
//!     &Silent,
//! )?;
//! // a straight line through both seams
//! for (x, u) in positions.iter().zip(&solution.displacement) {
//!     assert!((u - 0.01 * x[0]).abs() < 1e-12);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Keys in brackets, such as [SAND2015-7998], are resolved in `docs/references.md`.

pub mod assembly;
pub mod contact;
pub mod coupling;
mod dimension;
pub mod fem;
pub mod material;
pub mod mesh;
pub mod model;
pub mod observe;
mod parallel;
pub mod peridynamics;
pub mod predict;
pub mod progress;
pub mod regular_file;
pub mod run;
pub mod scene;
pub mod shape;
pub mod solve;
pub mod system;
pub mod tensor;

pub use coupling::{
    Blending, BlendingFunction, Coupling, Local, Nonlocal, Operator, PartialStressElements,
    PartialStressMeshfree, Problem, Splice,
};
pub use mesh::{CellShape, Mesh, MeshError};
pub use model::{
    CellRole, FitDegree, Model, ModelError, Peridynamics, PointSource, Sampler, Site, SiteKind,
    Zone, ZoneLayout,
};
pub use observe::summary::RunSummary;
pub use peridynamics::{
    BondBased, BondWeights, Correspondence, Influence, LinearForceState, LinearPeridynamicSolid,
    Micromodulus, PdBody,
};
pub use progress::{Progress, Silent};
pub use run::{AnyScene, RunError, Solution};
pub use scene::build::{self, Condition, Impactor, Initial, Material, Region, SceneBuilder};
pub use scene::{Function, Scene, SceneError};
pub use shape::{Barrier, Shape};
pub use solve::statics::{StaticError, StaticParams, StaticProblem, StaticSolution};
pub use system::{BlockCsr, Symmetry};
pub use tensor::{Tensor, Tensor4, Vector};
