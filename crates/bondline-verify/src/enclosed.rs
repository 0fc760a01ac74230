//! A block whose peridynamic core is enclosed by a transition zone and finite elements on all sides.

use crate::{
    meshes::{
        gmsh,
        scene::{self, SceneFailure},
    },
    typed,
};
use bondline::{
    coupling::Coupling,
    mesh::{
        MeshError,
        generate::{Axis, Grid},
    },
    model::Model,
    run::SceneModel,
    system::{BlockCsr, Partition, Ranks, Spread},
    tensor::{Tensor4, Vector},
};

pub use crate::typed::{INFLUENCE, Law, Method, POISSON, YOUNGS_MODULUS};

/// Spacing h of the lattice in every case \[m\]; no power of two, so that coordinates are rounded.
pub const SPACING: f64 = 0.01;

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

    /// Returns true if the elements are aligned to the lattice.
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

/// Method, law, elements and zones of one row.
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

/// Failure to build a case.
#[derive(Debug, thiserror::Error)]
pub enum EnclosedError {
    /// The mesh of its file.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The scene, or its model.
    #[error(transparent)]
    Scene(#[from] SceneFailure),
}

/// An assembled case.
pub struct Enclosed<const D: usize> {
    /// Its sites.
    pub model: Model<D>,
    /// Coupling of its models.
    pub coupling: Box<dyn Coupling<D>>,
    /// Its stiffness.
    pub stiffness: BlockCsr,
    /// Volumes of which the rows of the stiffness are equations.
    pub rows: Rows,
    /// Rows by process, where several assembled them.
    pub shared: Option<SharedRows>,
    /// Half the width of the block \[m\].
    pub half: f64,
    /// The elastic tensor of the elements \[Pa\].
    pub tensor: Tensor4<D>,
}

/// Rows that several processes assembled, each those of its own sites.
#[derive(Clone, Debug)]
pub struct SharedRows {
    /// Partition of the sites over the processes.
    pub partition: Partition,
    /// The rows of this process, ascending by site.
    pub own: BlockCsr,
}

/// Volumes of which the rows of a stiffness are equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// Each that of its own row, as the operator writes it; their sums hold.
    Own,
    /// The volume of the site, as in a run.
    OfSites,
}

/// Settings of a block beyond those of its case.
#[derive(Clone, Debug, Default)]
pub struct Otherwise<'a> {
    /// The coupling as a scene types it, on the lattice of the case.
    pub coupling: Option<&'a str>,
    /// Poisson's ratio.
    pub poisson_ratio: Option<f64>,
    /// Further tables of the scene: cracks.
    pub tables: &'a str,
}

impl<const D: usize> Enclosed<D> {
    /// Builds and assembles a case; the lattice's points are the integer multiples of h, or with truncated bonds halfway between.
    ///
    /// # Errors
    /// [`EnclosedError`] of the mesh, the scene or its model.
    pub fn new(case: &Case) -> Result<Self, EnclosedError> {
        Self::with(case, &Otherwise::default())
    }

    /// Collective: the same by several processes, of which each assembles the rows of its own sites, distributed as those of a run; all have the stiffness then. Without `ranks`, as [`Enclosed::new`].
    ///
    /// # Errors
    /// As [`Enclosed::new`], the same on every process.
    pub fn on(case: &Case, ranks: Option<&dyn Ranks>) -> Result<Self, EnclosedError> {
        Self::build(case, &Otherwise::default(), ranks)
    }

    /// The same block with finite elements everywhere.
    ///
    /// # Errors
    /// As [`Enclosed::new`].
    pub fn local(case: &Case) -> Result<Self, EnclosedError> {
        let coupling = Some("\"local\"");
        Self::with(
            case,
            &Otherwise {
                coupling,
                ..Otherwise::default()
            },
        )
    }

    /// The block with something else than the case names.
    ///
    /// # Errors
    /// As [`Enclosed::new`].
    pub fn with(case: &Case, otherwise: &Otherwise<'_>) -> Result<Self, EnclosedError> {
        Self::build(case, otherwise, None)
    }

    fn build(
        case: &Case,
        otherwise: &Otherwise<'_>,
        ranks: Option<&dyn Ranks>,
    ) -> Result<Self, EnclosedError> {
        let half = f64::from(case.widths.total()) * SPACING;
        let file = case.cells.file::<D>(case.widths)?;
        let files: Vec<(&str, &str)> = file.iter().map(|text| (MESH, text.as_str())).collect();
        let SceneModel {
            model, coupling, ..
        } = scene::model(&case.text::<D>(otherwise), &files)?;
        let (stiffness, shared) = {
            let operator = coupling.operator(&model).map_err(SceneFailure::from)?;
            let rows = |sites: &[u32]| model.assemble_sites_unscaled(&operator, sites);
            let all: Vec<u32> = (0..model.sites.len() as u32).collect();
            match ranks {
                None => (rows(&all), None),
                Some(ranks) => {
                    let partition = model
                        .distribute(ranks.count(), false, Some(ranks))
                        .partition;
                    let spread = Spread {
                        ranks,
                        partition: &partition,
                    };
                    let (stiffness, own) = (spread.gather_rows(&all, rows), rows(spread.own()));
                    (stiffness, Some(SharedRows { partition, own }))
                }
            }
        };
        let tensor = *model.tensor_of_cell(0);
        Ok(Self {
            model,
            coupling,
            stiffness,
            rows: Rows::Own,
            shared,
            half,
            tensor,
        })
    }

    /// The model of a scene of a block `half` wide to either side, with its stiffness as a run has it.
    ///
    /// # Errors
    /// [`SceneFailure`] of the scene or its model.
    pub fn of_scene(text: &str, files: &[(&str, &str)], half: f64) -> Result<Self, SceneFailure> {
        let laid = scene::model::<D>(text, files)?;
        Ok(Self {
            stiffness: laid.stiffness()?,
            rows: Rows::OfSites,
            shared: None,
            tensor: *laid.model.tensor_of_cell(0),
            model: laid.model,
            coupling: laid.coupling,
            half,
        })
    }

    /// Returns true if a site lies on the outer boundary.
    pub fn is_outer(&self, site: usize) -> bool {
        self.model.sites[site].position.amax() > self.half * (1.0 - 1e-9)
    }

    /// Returns the factor that turns the force in the row of a site into one per volume.
    pub fn per_volume(&self, site: usize) -> f64 {
        let scale = self.model.row_scale().filter(|_| self.rows == Rows::Own);
        scale.map_or(1.0, |scale| scale[site]) / self.model.sites[site].volume
    }

    /// Positions of all sites.
    pub fn positions(&self) -> impl Iterator<Item = &Vector<D>> {
        self.model.sites.iter().map(|s| &s.position)
    }
}

/// Name of the file of a mesh that a scene's own generators do not make.
pub const MESH: &str = "mesh.msh";

impl Cells {
    /// Cells along an axis of a block.
    fn along(self, widths: Widths) -> usize {
        (2 * widths.total()).div_ceil(self.size()) as usize
    }

    /// The mesh as a file, where nodes are moved.
    fn file<const D: usize>(self, widths: Widths) -> Result<Option<String>, MeshError> {
        let fraction = match self {
            Self::Matching | Self::Coarse | Self::Aligned(_) => return Ok(None),
            Self::Jittered => 0.2,
            Self::Simplices => 0.1,
        };
        let half = f64::from(widths.total()) * SPACING;
        let mesh = jittered::<D>(half, self.along(widths), self == Self::Simplices, fraction)?;
        Ok(Some(gmsh::of_mesh(&mesh, &[], |_| None)))
    }
}

/// A block of boxes or simplices, `half` wide to either side, whose inner nodes are moved by up to this fraction of a cell.
///
/// # Errors
/// [`MeshError`] of the generator.
pub fn jittered<const D: usize>(
    half: f64,
    cells: usize,
    simplices: bool,
    fraction: f64,
) -> Result<bondline::mesh::Mesh<D>, MeshError> {
    let mut grid = Grid::<D>::new(std::array::from_fn(|_| Axis::Uniform {
        min: -half,
        max: half,
        cells,
    }));
    if simplices {
        grid.simplices();
    }
    grid.jitter(fraction, 7).mesh()
}

impl Case {
    /// The case as a scene: nested boxes of the three zones. Moved nodes leave centroids in the box of their cell.
    pub fn text<const D: usize>(&self, otherwise: &Otherwise<'_>) -> String {
        let Self {
            law, cells, widths, ..
        } = *self;
        let half = f64::from(widths.total()) * SPACING;
        let mesh = match cells.is_aligned() {
            true => typed::grid([-half; D], [half; D], [cells.along(widths); D]),
            false => format!("[mesh.file]\npath = \"{MESH}\"\n"),
        };
        // truncated bonds want the seam halfway between points
        let origin = match self.method {
            Method::Truncated => 0.5 * SPACING,
            _ => 0.0,
        };
        let core = f64::from(widths.nonlocal) * SPACING;
        let transition = match widths.transition {
            0 => String::new(),
            width => {
                let edge = core + f64::from(width) * SPACING;
                format!("transition = {}\n", typed::cube::<D>(edge))
            }
        };
        let own = typed::coupling(self.method);
        format!(
            "kinematics = \"{}\"\ncoupling = {}\n{mesh}{}[peridynamics]\nhorizon = {:?}\npoints.lattice = {{ spacing = {SPACING}, origin = {} }}\n{}{}[zones]\nnonlocal = {}\n{transition}{}{}",
            typed::kinematics::<D>(),
            otherwise.coupling.unwrap_or(&own),
            typed::material(
                law,
                YOUNGS_MODULUS,
                otherwise.poisson_ratio.unwrap_or(POISSON)
            ),
            f64::from(self.ratio) * SPACING,
            typed::place([origin; D]),
            typed::law_line(law),
            typed::UNCUT,
            typed::cube::<D>(core),
            otherwise.tables,
            typed::FREE
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_have_the_tensor_of_the_law_by_hand() {
        fn check<const D: usize>() {
            for law in Law::all::<D>() {
                let case = Case {
                    method: Method::Splice,
                    law,
                    cells: Cells::Matching,
                    widths: Widths {
                        nonlocal: 2,
                        transition: 0,
                        local: 3,
                    },
                    ratio: 2,
                };
                let (lambda, mu) = law.lame::<D>();
                let mut off = Enclosed::<D>::new(&case).unwrap().tensor;
                off.add_scaled(-1.0, &Tensor4::isotropic(lambda, mu));
                assert!(off.amax() < 1e-15 * YOUNGS_MODULUS, "{D}D {law:?}");
            }
        }
        check::<1>();
        check::<2>();
        check::<3>();
    }

    #[test]
    fn a_scene_of_another_dimension_is_refused() {
        let text = format!(
            "kinematics = \"bar\"\n{}{}{}",
            typed::grid([0.0], [1.0], [4]),
            typed::material(Law::all::<1>()[0], 1.0, POISSON),
            typed::FREE
        );
        let error = scene::model::<2>(&text, &[]).err().unwrap();
        assert!(
            error.to_string().contains("another dimension than 2"),
            "{error}"
        );
    }
}
