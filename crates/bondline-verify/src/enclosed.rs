//! A block whose peridynamic core is enclosed by a transition zone and finite elements on all sides.

use std::sync::Arc;

use bondline::{
    coupling::{
        Balanced, Blending, BlendingFunction, Coupling, FitDegree, Local, Model, ModelError,
        PartialStressElements, PartialStressMeshfree, Peridynamics, PointSource, Problem, Splice,
        Surfaces, Truncated, Zone,
    },
    mesh::{
        Mesh, MeshError,
        generate::{Axis, Grid},
    },
    peridynamics::{
        BondBased, BondWeights, Correspondence, Influence, LinearPeridynamicSolid,
        Micromodulus, PartialVolume,
        influence::{Alpha, Degree},
    },
    progress::Silent,
    shape::Barrier,
    system::BlockCsr,
    tensor::{Tensor4, Vector},
};

/// Young's modulus of every case \[Pa\].
pub const YOUNGS_MODULUS: f64 = 2e11;

/// Spacing h of the lattice in every case \[m\]; no power of two, so that coordinates are rounded.
pub const SPACING: f64 = 0.01;

/// `P_1/|ξ|`: the influence function with which every method behaved in the table of `docs/patch-test.md`.
pub const INFLUENCE: Influence = Influence::Polynomial {
    degree: Degree::P1,
    alpha: Alpha::One,
};

/// A coupling method with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// [`Splice`].
    Splice,
    /// [`Blending`].
    Blending(BlendingFunction),
    /// [`Balanced`] with a step in β at the edge of the nonlocal zone.
    Balanced,
    /// [`Balanced`] with β over the transition zone.
    BalancedOver(BlendingFunction),
    /// [`PartialStressMeshfree`] with this ω of the divergence.
    Meshfree(Influence),
    /// [`PartialStressElements`].
    Elements(FitDegree),
    /// [`Truncated`].
    Truncated,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 10] = [
        Self::Splice,
        Self::Blending(BlendingFunction::Constant),
        Self::Blending(BlendingFunction::Linear),
        Self::Blending(BlendingFunction::Smooth),
        Self::Meshfree(INFLUENCE),
        Self::Elements(FitDegree::Affine),
        Self::Elements(FitDegree::Quadratic),
        Self::Truncated,
        Self::Balanced,
        Self::BalancedOver(BlendingFunction::Smooth),
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Splice => "splice",
            Self::Blending(BlendingFunction::Constant) => "blending constant",
            Self::Blending(BlendingFunction::Linear) => "blending linear",
            Self::Blending(BlendingFunction::Smooth) => "blending smooth",
            Self::Balanced => "balanced",
            Self::BalancedOver(BlendingFunction::Constant) => "balanced constant",
            Self::BalancedOver(BlendingFunction::Linear) => "balanced linear",
            Self::BalancedOver(BlendingFunction::Smooth) => "balanced smooth",
            Self::Meshfree(_) => "partial stress meshfree",
            Self::Elements(FitDegree::Affine) => "partial stress elements affine",
            Self::Elements(FitDegree::Quadratic) => "partial stress elements quadratic",
            Self::Truncated => "truncated",
        }
    }

    /// Whether a transition zone has a meaning of its own.
    pub fn has_transition(self) -> bool {
        !matches!(self, Self::Splice | Self::Truncated | Self::Balanced)
    }

    /// Whether the method takes a law.
    pub fn is_offered(self, law: Law) -> bool {
        self != Self::Truncated || !matches!(law, Law::Correspondence(_))
    }

    /// The coupling itself.
    pub fn coupling<const D: usize>(self) -> Box<dyn Coupling<D>> {
        match self {
            Self::Splice => Box::new(Splice),
            Self::Blending(function) => Box::new(Blending { function }),
            Self::Balanced => Box::new(Balanced { function: None }),
            Self::BalancedOver(function) => Box::new(Balanced {
                function: Some(function),
            }),
            Self::Meshfree(influence) => Box::new(PartialStressMeshfree { influence }),
            Self::Elements(fit) => Box::new(PartialStressElements { fit }),
            Self::Truncated => Box::new(Truncated::default()),
        }
    }
}

/// A peridynamic law with its kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// [`BondBased`].
    BondBased(Micromodulus),
    /// [`LinearPeridynamicSolid`].
    StateBased(Influence),
    /// [`Correspondence`], stabilised with 1.
    Correspondence(Influence),
}

impl Law {
    /// Every law, with its usual kernel.
    pub const ALL: [Self; 3] = [
        Self::BondBased(Micromodulus::InverseDistance),
        Self::StateBased(INFLUENCE),
        Self::Correspondence(INFLUENCE),
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::BondBased(_) => "bond-based",
            Self::StateBased(_) => "LPS",
            Self::Correspondence(_) => "correspondence",
        }
    }

    /// Lamé parameters λ, μ \[Pa\] of the material of Young's modulus [`YOUNGS_MODULUS`]: plane strain in 2D;
    /// Poisson ratio 1/4 where the law fixes it, else 0.3.
    pub fn lame<const D: usize>(self) -> (f64, f64) {
        let e = YOUNGS_MODULUS;
        match (self, D) {
            (Self::BondBased(_), 1) => (e / 3.0, e / 3.0),
            (Self::BondBased(_), _) => (0.4 * e, 0.4 * e),
            (_, 1) => (0.4 * e, 0.3 * e),
            _ => (e * 0.3 / (1.3 * 0.4), e / 2.6),
        }
    }

    /// The law itself.
    pub fn law<const D: usize>(self) -> Arc<dyn bondline::peridynamics::Law<D>> {
        let (lambda, mu) = self.lame::<D>();
        match self {
            Self::BondBased(kernel) => Arc::new(BondBased::<D>::new(kernel, mu)),
            Self::StateBased(w) => Arc::new(LinearPeridynamicSolid::<D>::new(w, lambda, mu)),
            Self::Correspondence(w) => Arc::new(Correspondence::<D>::new(w, lambda, mu, 1.0)),
        }
    }
}

/// The finite elements around the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cells {
    /// Of the lattice's spacing, nodes on lattice points.
    Matching,
    /// Three times coarser, aligned.
    Coarse,
    /// Two times coarser, inner nodes moved by up to a fifth of a cell, those between zones too.
    Jittered,
    /// So many times coarser, aligned.
    Aligned(u32),
    /// Triangles or tetrahedra, two times coarser, inner nodes moved by up to a tenth of a cell.
    Simplices,
}

impl Cells {
    /// Every kind.
    pub const ALL: [Self; 4] = [
        Self::Matching,
        Self::Coarse,
        Self::Jittered,
        Self::Simplices,
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Matching => "matching",
            Self::Coarse | Self::Aligned(3) => "coarse x3",
            Self::Aligned(1) => "matching",
            Self::Aligned(2) => "coarse x2",
            Self::Aligned(4) => "coarse x4",
            Self::Aligned(_) => "coarse",
            Self::Jittered => "jittered x2",
            Self::Simplices => "simplices x2",
        }
    }

    /// Whether the elements are aligned to the lattice.
    pub fn is_aligned(self) -> bool {
        matches!(self, Self::Matching | Self::Coarse | Self::Aligned(_))
    }

    /// Size of a cell in spacings.
    pub fn size(self) -> u32 {
        match self {
            Self::Matching => 1,
            Self::Coarse => 3,
            Self::Aligned(times) => times,
            Self::Jittered | Self::Simplices => 2,
        }
    }
}

/// Widths of the zones along every half axis, in spacings of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Widths {
    /// Half the width of the peridynamic core.
    pub nonlocal: u32,
    /// Width of the transition zone.
    pub transition: u32,
    /// Width of the finite elements outside it.
    pub local: u32,
}

impl Widths {
    /// Half the width of the block.
    pub fn total(self) -> u32 {
        self.nonlocal + self.transition + self.local
    }
}

/// What is measured in one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The method.
    pub method: Method,
    /// The law.
    pub law: Law,
    /// The elements.
    pub cells: Cells,
    /// The zones.
    pub widths: Widths,
    /// m = δ/h.
    pub ratio: u32,
}

/// Why a case was not built.
#[derive(Debug, thiserror::Error)]
pub enum EnclosedError {
    /// The mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The model.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// An assembled case.
pub struct Enclosed<const D: usize> {
    /// Its sites.
    pub model: Model<D>,
    /// Its stiffness.
    pub stiffness: BlockCsr,
    /// Half the width of the block \[m\].
    pub half: f64,
    /// The typed elastic tensor \[Pa\].
    pub tensor: Tensor4<D>,
}

impl<const D: usize> Enclosed<D> {
    /// Builds and assembles a case; the lattice's points are the integer multiples of h, or with truncated bonds halfway between.
    ///
    /// # Errors
    /// [`EnclosedError`] of the mesh or the model.
    pub fn new(case: &Case) -> Result<Self, EnclosedError> {
        Self::with(case, case.method.coupling(), case.law.law::<D>())
    }

    /// The same block with finite elements everywhere.
    ///
    /// # Errors
    /// As [`Enclosed::new`].
    pub fn local(case: &Case) -> Result<Self, EnclosedError> {
        Self::with(case, Box::new(Local), case.law.law::<D>())
    }

    /// The block with another coupling or law than the case names.
    ///
    /// # Errors
    /// As [`Enclosed::new`].
    pub fn with(
        case: &Case,
        coupling: Box<dyn Coupling<D>>,
        law: Arc<dyn bondline::peridynamics::Law<D>>,
    ) -> Result<Self, EnclosedError> {
        Self::with_barriers(case, coupling, law, Vec::new())
    }

    /// As [`Enclosed::with`], with cracks and slits.
    ///
    /// # Errors
    /// As [`Enclosed::new`].
    pub fn with_barriers(
        case: &Case,
        coupling: Box<dyn Coupling<D>>,
        law: Arc<dyn bondline::peridynamics::Law<D>>,
        barriers: Vec<Barrier<D>>,
    ) -> Result<Self, EnclosedError> {
        let (mesh, zones) = blocks::<D>(case.cells, case.widths)?;
        let tensor = *law.linearised().tensor();
        let horizon = f64::from(case.ratio) * SPACING;
        // truncated bonds want the seam halfway between points
        let origin = match case.method {
            Method::Truncated => Vector::repeat(0.5 * SPACING),
            _ => Vector::zeros(),
        };
        let problem = Problem {
            cell_material: vec![0; mesh.cell_count()],
            mesh,
            zones,
            tensors: vec![tensor],
            peridynamic_material: 0,
            peridynamics: Some(Peridynamics {
                law,
                horizon: Arc::new(move |_| horizon),
                points: PointSource::Lattice {
                    spacing: SPACING,
                    origin,
                },
                weights: BondWeights::Isotropic,
                volumes: PartialVolume::Full,
                barriers,
                voids: Vec::new(),
                surfaces: Surfaces::Uncut,
            }),
            coupling,
        };
        let (model, coupling) = Model::new(problem, &Silent)?;
        let stiffness = {
            let operator = coupling.operator(&model)?;
            model.assemble_unscaled(operator.as_ref())
        };
        Ok(Self {
            model,
            stiffness,
            half: f64::from(case.widths.total()) * SPACING,
            tensor,
        })
    }

    /// Whether a site lies on the outer boundary.
    pub fn is_outer(&self, site: usize) -> bool {
        self.model.sites[site].position.amax() > self.half * (1.0 - 1e-9)
    }

    /// Positions of all sites.
    pub fn positions(&self) -> impl Iterator<Item = &Vector<D>> {
        self.model.sites.iter().map(|s| &s.position)
    }
}

/// Nested boxes of the three zones.
fn blocks<const D: usize>(cells: Cells, widths: Widths) -> Result<(Mesh<D>, Vec<Zone>), MeshError> {
    let half = f64::from(widths.total()) * SPACING;
    let mut grid = Grid::<D>::new(std::array::from_fn(|_| Axis::Uniform {
        min: -half,
        max: half,
        cells: (2 * widths.total()).div_ceil(cells.size()) as usize,
    }));
    if cells == Cells::Simplices {
        grid.simplices();
    }
    // zones by the cells of the regular grid; moving nodes keeps the numbers of cells
    let regular = grid.mesh()?;
    let core = f64::from(widths.nonlocal) * SPACING;
    let transition = core + f64::from(widths.transition) * SPACING;
    let zones = (0..regular.cell_count())
        .map(|c| match regular.centroid(c).amax() {
            r if r < core => Zone::Nonlocal,
            r if r < transition => Zone::Transition,
            _ => Zone::Local,
        })
        .collect();
    let mesh = match cells {
        Cells::Matching | Cells::Coarse | Cells::Aligned(_) => regular,
        Cells::Jittered => grid.jitter(0.2, 7).mesh()?,
        Cells::Simplices => grid.jitter(0.1, 7).mesh()?,
    };
    Ok((mesh, zones))
}
