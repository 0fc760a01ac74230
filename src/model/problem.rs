//! A body with its zones and points, and the reasons why it may not make a model.

use std::sync::Arc;

use rustc_hash::FxHashMap;
use thiserror::Error;

use crate::{
    mesh::{CellShape, Mesh},
    model::{HorizonChange, Zone, ZoneLayout},
    peridynamics::{Accelerator, BondWeights, BoxCell, Horizon, Law, PartialVolume, PointError},
    shape::{Barrier, Shape},
    tensor::{Tensor4, Vector},
};

/// A scalar field of position.
pub type ScalarField<const D: usize> = Arc<dyn Fn(&Vector<D>) -> f64 + Send + Sync>;

/// The horizon of a problem \[m\].
#[derive(Clone)]
pub enum HorizonField<const D: usize> {
    /// One everywhere.
    Uniform(f64),
    /// By position.
    Field(ScalarField<D>),
}

impl<const D: usize> HorizonField<D> {
    /// At a position.
    pub fn at(&self, x: &Vector<D>) -> f64 {
        match self {
            Self::Uniform(horizon) => *horizon,
            Self::Field(field) => field(x),
        }
    }

    /// Of points at some positions.
    pub fn of_points(&self, position: &[Vector<D>]) -> Horizon {
        match self {
            Self::Uniform(horizon) => Horizon::Uniform(*horizon),
            Self::Field(field) => Horizon::of_field(position.iter().map(|x| field(x)).collect()),
        }
    }
}

/// Source of the peridynamic points.
#[derive(Clone, Debug, PartialEq)]
pub enum PointSource<const D: usize> {
    /// One point per cell, at its centroid, with its volume.
    Cells,
    /// The points of a lattice that lie in the zone; the volume of each is what its cell of the lattice shares with the body.
    Lattice {
        /// Distance h of neighbouring points \[m\].
        spacing: f64,
        /// Any point of the lattice.
        origin: Vector<D>,
    },
    /// Several lattices, each with its horizon, in cells that no face joins: bonds run within a lattice only.
    Lattices {
        /// The lattices.
        lattices: Vec<Lattice<D>>,
        /// The lattice of each cell, an index into `lattices`; without meaning in an element.
        of_cell: Vec<u16>,
    },
}

/// A lattice of points with its own horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice<const D: usize> {
    /// Distance h of neighbouring points \[m\].
    pub spacing: f64,
    /// Any point of the lattice.
    pub origin: Vector<D>,
    /// Horizon δ \[m\].
    pub horizon: f64,
}

/// The peridynamic part of a problem.
pub struct Peridynamics<const D: usize> {
    /// The law.
    pub law: Arc<dyn Law<D>>,
    /// Horizon δ \[m\].
    pub horizon: HorizonField<D>,
    /// Rule for bonds between points of different horizons.
    pub horizon_change: HorizonChange,
    /// Source of the points; a lattice of several has its own horizon instead.
    pub points: PointSource<D>,
    /// Weighting of the bonds.
    pub weights: BondWeights,
    /// Share that counts of a cell cut by the horizon; all but [`PartialVolume::Full`] need the points of a lattice.
    pub volumes: PartialVolume,
    /// Voids and cracks that cut bonds.
    pub barriers: Vec<Barrier<D>>,
    /// Shapes whose interior holds no points although the mesh may cover it.
    pub voids: Vec<Shape<D>>,
    /// Treatment of bonds that leave the mesh (holes of a mesh that no barrier describes).
    pub surfaces: Surfaces,
}

impl<const D: usize> Peridynamics<D> {
    /// The fast pass of the law, where the weights of a bond are the same from both ends; fitted ones are not, so that every family has its own force state.
    pub fn accelerator(&self) -> Option<Accelerator> {
        match self.weights {
            BondWeights::Plain | BondWeights::Isotropic => self.law.accelerator(),
            BondWeights::Fitted => None,
        }
    }

    /// Returns true if points of different horizons each continue the lattice with their own.
    pub fn is_spliced(&self) -> bool {
        let varies = match &self.points {
            PointSource::Lattices { lattices, .. } => lattices.len() > 1,
            PointSource::Cells | PointSource::Lattice { .. } => {
                matches!(self.horizon, HorizonField::Field(_))
            }
        };
        varies && self.horizon_change == HorizonChange::Splice
    }

    /// Returns the reach of a family of that horizon \[m\]: with partial volumes it exceeds the horizon, since cells count whose points lie beyond it.
    pub fn reach(&self, horizon: f64) -> f64 {
        let spacing = match self.points {
            PointSource::Lattice { spacing, .. } => spacing,
            PointSource::Cells | PointSource::Lattices { .. } => return horizon,
        };
        let beyond = BoxCell::<D>::cube(Vector::zeros(), spacing)
            .map_or(0.0, |cell| self.volumes.reach_beyond(&cell));
        horizon + beyond
    }
}

/// Treatment of bonds across the boundary of the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "SurfacesSpec")]
pub enum Surfaces {
    /// Bonds that leave the body are cut.
    #[default]
    Cut,
    /// Bonds reach across holes.
    Uncut,
}

/// A body with its zones, before sites and families are laid out.
pub struct ZonedBody<const D: usize> {
    /// The mesh of the whole part.
    pub mesh: Mesh<D>,
    /// The zone of each cell.
    pub zones: Vec<Zone>,
    /// Elastic constants of the elements.
    pub elastic: ElasticCells<D>,
    /// The peridynamic part; none in a purely local problem.
    pub peridynamics: Option<Peridynamics<D>>,
}

/// Elastic constants of cells.
#[derive(Clone, Debug, Default)]
pub struct ElasticCells<const D: usize> {
    /// Local elastic tensors \[Pa\], one per material.
    pub tensors: Vec<Tensor4<D>>,
    /// The material of each cell, an index into `tensors`.
    pub material: Vec<u16>,
    /// The material that peridynamic points have, an index into `tensors`.
    pub of_points: u16,
    /// The tensors of cells whose material has axes that turn from cell to cell, by cell: in the place of their material's \[Pa\].
    pub turned: FxHashMap<u32, Tensor4<D>>,
}

impl<const D: usize> ElasticCells<D> {
    /// The local elastic tensor of a cell \[Pa\].
    pub fn tensor(&self, cell: usize) -> &Tensor4<D> {
        let own = match self.turned.is_empty() {
            true => None,
            false => self.turned.get(&(cell as u32)),
        };
        own.unwrap_or(&self.tensors[usize::from(self.material[cell])])
    }

    /// Returns true if two cells have other materials, or axes that turn from one to the other.
    pub fn differ(&self, a: usize, b: usize) -> bool {
        self.material[a] != self.material[b]
            || !self.turned.is_empty() && self.tensor(a) != self.tensor(b)
    }

    /// The same constants, those of some cells multiplied by a factor; tensors that no cell has are not kept apart.
    pub fn scaled_where(mut self, is_scaled: &[bool], factor: f64) -> Self {
        let shift = self.tensors.len() as u16;
        let scaled: Vec<Tensor4<D>> = self.tensors.iter().map(|c| c.scaled(factor)).collect();
        self.tensors.extend(scaled);
        for (material, _) in self.material.iter_mut().zip(is_scaled).filter(|m| *m.1) {
            *material += shift;
        }
        for (c, tensor) in &mut self.turned {
            if is_scaled[*c as usize] {
                *tensor = tensor.scaled(factor);
            }
        }
        self
    }
}

/// Refuses a law whose rows a coupling cannot hold.
pub(crate) fn takes_law<const D: usize>(
    coupling: &dyn ZoneLayout<D>,
    peridynamics: Option<&Peridynamics<D>>,
) -> Result<(), ModelError> {
    let law = peridynamics.map(|p| &p.law);
    // what a seam of truncated bonds cuts follows the linearisation, two horizons deep
    if coupling.interface().faces
        && law.is_some_and(|law| law.linearised().has_deviators() && !law.is_linear())
    {
        return Err(ModelError::Unsupported {
            what: "a position-aware solid that relaxes, with truncated bonds",
            remedy: "use coupling.nonlocal, or the material pals",
        });
    }
    match law.filter(|law| law.linearised().has_deviators() && !coupling.takes_deviators()) {
        Some(law) => Err(ModelError::Deviators {
            law: law.name(),
            coupling: coupling.name(),
        }),
        None => Ok(()),
    }
}

/// Relative difference up to which two stiffness tensors are one.
const SAME_STIFFNESS: f64 = 1e-9;

/// Refuses a law that is calibrated to other constants than the elements of its material have: a uniform strain would leave forces at the seam. With plain weights elements take the tensor of the lattice.
pub(crate) fn is_calibrated<const D: usize>(
    peridynamics: Option<&Peridynamics<D>>,
    tensors: &[Tensor4<D>],
    material: u16,
) -> Result<(), ModelError> {
    let Some(p) = peridynamics.filter(|p| p.weights != BondWeights::Plain) else {
        return Ok(());
    };
    let of_points: Vec<(u16, &dyn Law<D>)> = match p.law.several() {
        Some(several) => (several.used().iter())
            .map(|&material| (material, several.law(material)))
            .collect(),
        None => vec![(material, p.law.as_ref())],
    };
    for (material, law) in of_points {
        let (of_law, of_cells) = (law.linearised().tensor(), &tensors[usize::from(material)]);
        let mut difference = *of_law;
        difference.add_scaled(-1.0, of_cells);
        if difference.amax() > SAME_STIFFNESS * of_cells.amax() {
            return Err(ModelError::OtherConstants {
                material,
                of_law: of_law.amax(),
                of_cells: of_cells.amax(),
            });
        }
    }
    Ok(())
}

/// Reasons why a model cannot be built.
#[derive(Debug, Error)]
pub enum ModelError {
    /// A family that another process holds cannot be used; in the words of that one.
    #[error("{message}")]
    OfProcess {
        /// Message of that process.
        message: String,
    },
    /// A zone has no cell.
    #[error(
        "the {zone} zone is empty: no cell of the mesh has its centroid in it; enlarge the zone, refine the mesh there, or choose coupling.local"
    )]
    EmptyZone {
        /// Which zone.
        zone: &'static str,
    },
    /// A zone holds no peridynamic point.
    #[error(
        "the nonlocal zone holds no peridynamic point: voids cover it, or its smallest extent is below the spacing {spacing}; shrink the voids, enlarge the zone or refine the lattice"
    )]
    NoPoints {
        /// Spacing of the lattice \[m\].
        spacing: f64,
    },
    /// A lattice far too fine.
    #[error(
        "a lattice of spacing {spacing} has {points:.1e} points around the peridynamic zone, more than can be numbered; make the spacing larger or the zone smaller"
    )]
    TooManyPoints {
        /// Spacing of the lattice \[m\].
        spacing: f64,
        /// Number of lattice points in the box around the zone.
        points: f64,
    },
    /// The horizon is too small or not a number.
    #[error("the horizon is {horizon} at ({}): it must be finite and at least the spacing of the points, {spacing}, or no point has a neighbour", join(.position))]
    Horizon {
        /// Position of the point.
        position: Vec<f64>,
        /// Its value \[m\].
        horizon: f64,
        /// Spacing of the points \[m\].
        spacing: f64,
    },
    /// More horizons than a rule takes.
    #[error(
        "the horizon has {count} values at the points, and horizon-change = \"{rule}\" takes at most {most}, as it knows regions of one horizon each; use horizon-change = \"dual\", coupling.partial-stress, or an expression of few values, such as if(x < 1, 0.1, 0.2)"
    )]
    TooManyHorizons {
        /// The rule.
        rule: &'static str,
        /// Number of different horizons.
        count: usize,
        /// The most that the rule takes.
        most: usize,
    },
    /// A point that continues a lattice among the points of another cannot be fitted to those.
    #[error("a lattice has to go on at ({}), but the {found} points of other lattices around that no crack or void hides do not determine an affine fit: keep cracks and voids a horizon away from where lattices meet, or give all the same spacing", join(.position))]
    Continuation {
        /// Position of the point.
        position: Vec<f64>,
        /// Number of points found.
        found: usize,
    },
    /// A family cannot carry the law.
    #[error("{what} at ({}) has a family of {bonds} bonds that cannot carry the material: {source}", join(.position))]
    Family {
        /// Point or Gauss point.
        what: &'static str,
        /// Its position.
        position: Vec<f64>,
        /// Number of intact bonds.
        bonds: usize,
        /// Cause.
        #[source]
        source: crate::peridynamics::PdError,
    },
    /// A family reaches over the border of two materials.
    #[error("bonds reach into another material at ({}): they would take its strain for that of the peridynamic one; keep the peridynamic and transition zones two horizons away from other materials, or use coupling.truncated, whose bonds end at the seam", join(.position))]
    OtherMaterial {
        /// Position where this happens.
        position: Vec<f64>,
    },
    /// A node at the seam cannot be fitted.
    #[error("node {node} at ({}) lies at the seam, but the {found} sites around it that no crack or void hides do not determine an affine fit: make the peridynamic zone at least three points thick there", join(.position))]
    Fit {
        /// Number of the node.
        node: u32,
        /// Position of the node.
        position: Vec<f64>,
        /// Number of sites found.
        found: usize,
    },
    /// A cell at the seam has curved sides.
    #[error(
        "cell {cell} ({shape:?}) lies in the peridynamic zone or beside it, where cells of second order are made linear, but its node at ({}) is {distance:.1e} of its edge's length away from the middle of the edge; keep the zone away from curved sides, or read the mesh with order = \"linear\"", join(.position))]
    CurvedSeam {
        /// Number of the cell.
        cell: usize,
        /// Its shape.
        shape: CellShape,
        /// Position of the node.
        position: Vec<f64>,
        /// Its distance from the middle over the length of the edge.
        distance: f64,
    },
    /// Derivatives cannot be taken at a point of the blending region.
    #[error("the point at ({}) lies where the models are blended, but its {bonds} bonds do not determine a quadratic field: widen the horizon or the body there", join(.position))]
    Derivative {
        /// Position of the point.
        position: Vec<f64>,
        /// Number of intact bonds.
        bonds: usize,
    },
    /// The points do not make families.
    #[error(transparent)]
    Families(#[from] crate::peridynamics::FamilyError),
    /// The lattice has no partial volumes.
    #[error(transparent)]
    Volumes(#[from] crate::peridynamics::PartialVolumeError),
    /// Weights of the lattice's shells cannot be made isotropic.
    #[error(transparent)]
    Shells(#[from] crate::peridynamics::ShellError),
    /// No constants of the law do on this lattice what the material is to do.
    #[error("the material `{law}`: {source}")]
    Calibration {
        /// The law's name.
        law: &'static str,
        /// Cause.
        #[source]
        source: crate::peridynamics::softening::CalibrationError,
    },
    /// Faces cut the lattice in such a way that no energies of pieces make affine fields exact.
    #[error(
        "the faces of the nonlocal zone cut the lattice where truncated bonds cannot be fitted to them: no {what} leave less than {residual:.1e} of the largest traction; give the zone a rim of its own on the lattice (zones.rim = \"own\"), let the faces follow the lattice (element edges a whole number of spacings long), use a horizon of three spacings or more or elements of two spacings or more at the seam, or couple by splice"
    )]
    Seam {
        /// Quantity that was sought.
        what: &'static str,
        /// Residual, relative to the largest traction of a face.
        residual: f64,
    },
    /// The conditions of a seam are more than can be met in minutes.
    #[error(
        "the faces of the nonlocal zone cut the lattice, and fitting truncated bonds to them takes factors of {conditions} conditions, {operations:.0e} operations or more where {most:.0e} are the limit; give the zone a rim of its own on the lattice (zones.rim = \"own\"), let the faces follow the lattice (element edges a whole number of spacings long), take a larger spacing or a smaller zone, or couple by splice"
    )]
    SeamTooLarge {
        /// Conditions on the energies of bonds that the seam cuts.
        conditions: usize,
        /// Operations of their factorisation, a lower bound.
        operations: f64,
        /// The most that it may take.
        most: f64,
    },
    /// A law whose dilatation and deviator have influence functions of their own, in a coupling whose rows have no place for their products.
    #[error(
        "the law `{law}` is not offered with the coupling `{coupling}`: its dilatation and its deviatoric extensions have influence functions of their own, and its rows have no place for the products of the two; use coupling.splice, coupling.truncated or coupling.nonlocal, or the law lps"
    )]
    Deviators {
        /// The law.
        law: &'static str,
        /// The coupling.
        coupling: &'static str,
    },
    /// A seam that would have to be fitted, of a law with two dilatations.
    #[error(
        "the faces of the nonlocal zone cut the lattice, and truncated bonds are fitted to such faces for one dilatation, where a position-aware solid has two; let the faces follow the lattice (element edges a whole number of spacings long, halfway between points), or use coupling.splice, coupling.balanced, coupling.blending or coupling.partial-stress, or the law lps"
    )]
    TwoDilatations,
    /// A law of other constants than those of the elements of its material.
    #[error(
        "the peridynamic law of material {material} is calibrated to a stiffness whose largest entry is {of_law:e}, the elements of that material have {of_cells:e}, or the two differ in another entry; make the law from the tensor in `tensors`, or use plain weights, with which elements take the stiffness of the lattice"
    )]
    OtherConstants {
        /// The material, an index into [`ElasticCells::tensors`].
        material: u16,
        /// The largest entry of the law's tensor \[Pa\].
        of_law: f64,
        /// That of the elements \[Pa\].
        of_cells: f64,
    },
    /// A combination that is not offered.
    #[error("{what} is not offered: {remedy}")]
    Unsupported {
        /// Requested combination.
        what: &'static str,
        /// Alternative to it.
        remedy: &'static str,
    },
}

impl ModelError {
    /// Returns the position of the failure \[m\], if a single place is known.
    pub fn position(&self) -> Option<&[f64]> {
        match self {
            Self::Horizon { position, .. }
            | Self::Family { position, .. }
            | Self::OtherMaterial { position }
            | Self::Fit { position, .. }
            | Self::Continuation { position, .. }
            | Self::CurvedSeam { position, .. }
            | Self::Derivative { position, .. } => Some(position),
            _ => None,
        }
    }
}

fn join(position: &[f64]) -> String {
    position
        .iter()
        .map(|x| format!("{x}"))
        .collect::<Vec<_>>()
        .join(", ")
}

impl ModelError {
    pub(crate) fn family<const D: usize>(what: &'static str, e: PointError<D>) -> Self {
        Self::Family {
            what,
            position: e.position.iter().copied().collect(),
            bonds: e.bonds,
            source: e.source,
        }
    }

    /// The error of a family of a Gauss point.
    pub fn gauss_point<const D: usize>(e: PointError<D>) -> Self {
        Self::family("the Gauss point", e)
    }
}
