//! A strip of finite elements, transition, peridynamics, transition and finite elements that moves: the model of the suites `spectrum`, `wave` and `reflection`.
//!
//! Units are those of the lattice: spacing h = 1, modulus `C_1111` = 1 and density 1, so that long waves run one spacing in a unit of time.

use std::sync::Arc;

use crate::{
    coupling::{
        Coupling, Local, Model, ModelError, Nonlocal, Peridynamics, PointSource, Problem, Surfaces,
        Zone,
    },
    mesh::{
        MeshError,
        generate::{Axis, Grid},
    },
    peridynamics::{
        BondBased, BondLaw, BondWeights, Correspondence, Influence, LinearPeridynamicSolid,
        Micromodulus, PartialVolume,
    },
    progress::Silent,
    system::LinearMotion,
    tensor::Vector,
    verify::enclosed::Method,
};

/// The law of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StripLaw {
    /// Bond-based.
    BondBased(Micromodulus),
    /// Linear peridynamic solid, Poisson ratio 1/4.
    Lps(Influence),
    /// Correspondence, stabilised with 1, Poisson ratio 1/4.
    Correspondence(Influence),
}

impl StripLaw {
    fn law<const D: usize>(self) -> Box<dyn BondLaw<D>> {
        // λ = μ is plane strain or a solid at ν = 1/4; C_1111 = 3 μ
        let mu = 1.0 / 3.0;
        match self {
            Self::BondBased(kernel) => Box::new(BondBased::<D>::new(kernel, mu)),
            Self::Lps(w) => Box::new(LinearPeridynamicSolid::<D>::new(w, mu, mu)),
            Self::Correspondence(w) => Box::new(Correspondence::<D>::new(w, mu, mu, 1.0)),
        }
    }
}

/// What holds along the strip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Finite elements everywhere.
    Local,
    /// Peridynamics everywhere.
    Nonlocal,
    /// Both, by a method.
    Coupled(Method),
}

impl Kind {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Local => "finite elements",
            Self::Nonlocal => "peridynamics",
            Self::Coupled(method) => method.name(),
        }
    }

    fn coupling<const D: usize>(self) -> Box<dyn Coupling<D>> {
        match self {
            Self::Local => Box::new(Local),
            Self::Nonlocal => Box::new(Nonlocal),
            Self::Coupled(method) => method.coupling(),
        }
    }
}

/// A strip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StripCase {
    /// What holds along it.
    pub kind: Kind,
    /// The law of the points.
    pub law: StripLaw,
    /// m = δ/h in the peridynamic zone.
    pub ratio: f64,
    /// δ/h where the transition meets the finite elements; the horizon runs straight between. Equal to `ratio` for a constant horizon.
    pub edge_ratio: f64,
    /// Lengths of local, transition, nonlocal, transition and local zones, in spacings.
    pub lengths: [u32; 5],
    /// Size of the finite elements in spacings; it divides the lengths.
    pub cell: u32,
    /// Cells across the strip, of which in 2D the sides are free.
    pub across: u32,
}

/// Why a strip was not built.
#[derive(Debug, thiserror::Error)]
pub enum StripError {
    /// The mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The model.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// A strip that can move.
pub struct Strip {
    /// Stiffness and masses.
    pub motion: LinearMotion,
    /// Position of each site along the strip, in spacings.
    pub x: Vec<f64>,
    /// Position of each site across it; 0 in 1D.
    pub y: Vec<f64>,
    /// Blending function of each site: 1 where it is peridynamic, 0 where it is local.
    pub beta: Vec<f64>,
    /// Where zones meet: local to transition, transition to nonlocal, and so on.
    pub borders: [f64; 4],
}

impl Strip {
    /// Builds and assembles a strip.
    ///
    /// # Errors
    /// [`StripError`] of the mesh or the model.
    pub fn new<const D: usize>(case: &StripCase) -> Result<Strip, StripError> {
        let mut borders = [0.0; 6];
        for (k, length) in case.lengths.iter().enumerate() {
            borders[k + 1] = borders[k] + f64::from(*length);
        }
        let cell = case.cell.max(1);
        let grid = Grid::<D>::new(std::array::from_fn(|a| Axis::Uniform {
            min: 0.0,
            max: if a == 0 {
                borders[5]
            } else {
                f64::from(case.across * cell)
            },
            cells: if a == 0 {
                (case.lengths.iter().sum::<u32>() / cell) as usize
            } else {
                case.across as usize
            },
        }));
        let mesh = grid.mesh()?;
        let zones: Vec<Zone> = (0..mesh.cell_count())
            .map(|c| {
                let x = mesh.centroid(c)[0];
                if x < borders[1] || x > borders[4] {
                    Zone::Local
                } else if x < borders[2] || x > borders[3] {
                    Zone::Transition
                } else {
                    Zone::Nonlocal
                }
            })
            .collect();
        let law = case.law.law::<D>();
        let tensor = *law.tensor();
        let (ratio, edge) = (case.ratio, case.edge_ratio);
        let horizon = move |x: &Vector<D>| {
            let left = (x[0] - borders[1]) / (borders[2] - borders[1]).max(1.0);
            let right = (borders[4] - x[0]) / (borders[4] - borders[3]).max(1.0);
            edge + (ratio - edge) * left.min(right).clamp(0.0, 1.0)
        };
        let problem = Problem {
            cell_material: vec![0; mesh.cell_count()],
            mesh,
            zones,
            tensors: vec![tensor],
            peridynamic_material: 0,
            peridynamics: Some(Peridynamics {
                law,
                horizon: Arc::new(horizon),
                points: PointSource::Lattice {
                    spacing: 1.0,
                    origin: Vector::zeros(),
                },
                weights: BondWeights::Isotropic,
                volumes: PartialVolume::Full,
                barriers: Vec::new(),
                voids: Vec::new(),
                surfaces: Surfaces::Uncut,
            }),
            coupling: case.kind.coupling(),
        };
        let (model, coupling) = Model::new(problem, &Silent)?;
        let operator = coupling.operator(&model)?;
        let stiffness = model.assemble(operator.as_ref(), &Silent);
        Ok(Strip {
            beta: (0..model.sites.len()).map(|s| operator.beta(s)).collect(),
            x: model.sites.iter().map(|s| s.position[0]).collect(),
            y: model
                .sites
                .iter()
                .map(|s| if D > 1 { s.position[1] } else { 0.0 })
                .collect(),
            motion: LinearMotion {
                stiffness,
                mass: model.sites.iter().map(|s| s.volume).collect(),
                symmetry: coupling.symmetry(),
            },
            borders: [borders[1], borders[2], borders[3], borders[4]],
        })
    }
}
