//! Model of a body that all couplings share: sites, peridynamic points, their families, and the places at the seam that follow sites.

use std::any::Any;
use std::sync::{Arc, OnceLock};

use rustc_hash::FxHashMap;

use crate::{
    assembly::Transfer,
    material::LocalLaw,
    mesh::{CellShape, Mesh},
    model::{
        CellRole, ElasticCells, Interface, Peridynamics, Site, SiteKind, Surfaces, Tributary, Zone,
        ZonedBody,
        bond_cutting::{self, LatticeFactors, WholeFamily},
        continued_lattice::ContinuedLattice,
        held_families::HeldFamilies,
        point_cloud::Volumes,
        recovery_patch::Patch,
        seam_order::Ties,
        shared_families::SharedFamilies,
    },
    peridynamics::{CauchyBorn, Cloud, Families, PdBody},
    system::Symmetry,
    tensor::{Tensor4, Vector},
};

/// A body with its sites and families; a coupling turns it into rows.
pub struct Model<const D: usize> {
    /// The mesh of the whole part.
    pub mesh: Mesh<D>,
    /// The zone of each cell.
    pub zones: Vec<Zone>,
    /// Role of each cell in the coupling.
    pub roles: Vec<CellRole>,
    /// Sites: nodes first, then points.
    pub sites: Vec<Site<D>>,
    /// Every node through sites; no weights for a node that no equation uses.
    pub node_transfer: Transfer,
    /// The peridynamic part of the problem.
    pub peridynamics: Option<Peridynamics<D>>,
    /// Elastic constants of cells.
    pub(crate) elastic: ElasticCells<D>,
    /// Peridynamic points.
    pub(crate) points: ModelPoints<D>,
    /// Lattices of the points.
    pub(crate) lattices: ModelLattices<D>,
    /// Cells around every node: where those of each begin, and their numbers.
    pub(crate) node_cells: (Vec<u32>, Vec<u32>),
    /// Nodes that follow others.
    pub(crate) ties: Ties,
    /// Places at the seam.
    pub(crate) interface: Interface,
    /// True if rows are the gradient of an energy.
    pub(crate) has_energy: bool,
    /// Volumes, masses and loads of sites.
    pub(crate) tributary: Tributary,
    /// Tributary volume of each site over that of its row, of rows that are no gradient of an energy.
    pub(crate) row_scale: Option<Vec<f64>>,
    /// Laws of elements that follow the bonds.
    pub(crate) cauchy_born: CauchyBornElements<D>,
    /// Results of the operator that the next one of the same model can use: `zones = "auto"` solves before the run does.
    pub(crate) operator_cache: OnceLock<Box<dyn Any + Send + Sync>>,
    /// Families of processes.
    pub(crate) spread: SpreadFamilies,
}

/// Peridynamic points of a model.
pub(crate) struct ModelPoints<const D: usize> {
    pub(crate) body: Option<PdBody<D>>,
    /// All quadrature points in and around elements whose stress is a partial stress.
    pub(crate) surroundings: Option<Cloud<D>>,
    /// Corrections of the interpolation in elements, where elements carry the partial stress of points between their nodes.
    pub(crate) patches: FxHashMap<u32, Patch<D>>,
    pub(crate) zone: Vec<Zone>,
    /// Points on the border of two materials.
    pub(crate) on_border: usize,
    /// Points of the cloud that continue a lattice among those of another, ascending: they follow these.
    pub(crate) continued: Vec<u32>,
    /// Points of the cloud that are feet of families, on the faces of elements.
    pub(crate) feet: Vec<u32>,
    /// Positions of points whose families have too few feet.
    pub(crate) left_out: Vec<Vector<D>>,
    pub(crate) volumes: Volumes,
}

impl<const D: usize> Default for ModelPoints<D> {
    fn default() -> Self {
        Self {
            body: None,
            surroundings: None,
            patches: FxHashMap::default(),
            zone: Vec::new(),
            on_border: 0,
            continued: Vec::new(),
            feet: Vec::new(),
            left_out: Vec::new(),
            volumes: Volumes::default(),
        }
    }
}

/// Lattices of the points of a model.
pub(crate) struct ModelLattices<const D: usize> {
    /// Spacing of the first \[m\]; 0 without points.
    pub(crate) spacing: f64,
    pub(crate) is_lattice: bool,
    /// Bond factors and horizon of each, as the points' [`Horizon::lattice_of`](crate::peridynamics::Horizon::lattice_of) numbers them.
    pub(crate) factors: Vec<(Arc<LatticeFactors<D>>, f64)>,
    /// The whole family of a lattice with plain weights, whose tensor the elements have.
    pub(crate) plain: Option<WholeFamily<D>>,
    /// Continuation behind the faces at which bonds end.
    pub(crate) passing: Option<ContinuedLattice<D>>,
}

impl<const D: usize> Default for ModelLattices<D> {
    fn default() -> Self {
        Self {
            spacing: 0.0,
            is_lattice: false,
            factors: Vec::new(),
            plain: None,
            passing: None,
        }
    }
}

/// Laws of elements that follow the bonds of the points.
pub(crate) struct CauchyBornElements<const D: usize> {
    /// By the number of a material; empty where elements are linear.
    pub(crate) laws: Vec<Option<Arc<dyn LocalLaw<D>>>>,
    /// Dilatation of elements that follow the bonds of an LPS.
    pub(crate) dilatation: Option<Arc<CauchyBorn<D>>>,
}

/// Families of a model that several processes have.
#[derive(Default)]
pub(crate) struct SpreadFamilies {
    /// Distribution of the families, where they are spread over processes.
    pub(crate) shared: Option<SharedFamilies>,
    /// Which families a process would hold, where they can be spread over processes.
    pub(crate) held: Option<HeldFamilies>,
}

impl<const D: usize> Model<D> {
    /// The body that the model was laid out from, to lay it out anew with other zones.
    pub fn into_body(self) -> ZonedBody<D> {
        ZonedBody {
            mesh: self.mesh,
            zones: self.zones,
            elastic: self.elastic,
            peridynamics: self.peridynamics,
        }
    }

    /// The cells around every node: where those of each begin, and their numbers.
    pub(crate) fn node_cells(&self) -> (&[u32], &[u32]) {
        (&self.node_cells.0, &self.node_cells.1)
    }

    /// All quadrature points in and around elements whose stress is a partial stress, if there are such elements.
    pub fn surroundings(&self) -> Option<&Cloud<D>> {
        self.points.surroundings.as_ref()
    }

    /// The whole family of a lattice with plain weights.
    pub(crate) fn plain_lattice(&self) -> Option<&WholeFamily<D>> {
        self.lattices.plain.as_ref()
    }

    /// Removes the bonds that voids, cracks or the boundary of the mesh cut.
    pub fn cut_bonds(&self, position: &[Vector<D>], families: &mut Families) {
        let Some(p) = &self.peridynamics else { return };
        let surface = (p.surfaces == Surfaces::Cut).then(|| self.mesh.outer_facets());
        let longest = p.horizon.of_points(position).largest();
        bond_cutting::cut(
            &p.barriers,
            &self.mesh,
            surface,
            longest,
            position,
            families,
        );
    }

    /// The symmetry of its stiffness, by its coupling and by the rule under which horizons change.
    pub fn symmetry(&self) -> Symmetry {
        match self.has_energy {
            true => Symmetry::Symmetric,
            false => Symmetry::Unsymmetric,
        }
    }

    /// The peridynamic body, if there is one.
    pub fn body(&self) -> Option<&PdBody<D>> {
        self.points.body.as_ref()
    }

    /// The peridynamic body and the point of a site; `None` if the site is a node.
    pub fn point_of(&self, site: usize) -> Option<(&PdBody<D>, usize)> {
        match self.sites[site].kind {
            SiteKind::Point(p) => self.points.body.as_ref().map(|b| (b, p as usize)),
            SiteKind::Node(_) => None,
        }
    }

    /// Returns true if a point of the cloud continues a lattice among those of another.
    pub(crate) fn continues_on(&self, point: u32) -> bool {
        self.points.continued.binary_search(&point).is_ok()
    }

    /// The zone of a point of the cloud.
    pub fn zone_of_point(&self, point: usize) -> Zone {
        self.points.zone[point]
    }

    /// The volume of a point whose cell is whole \[m^D\].
    pub fn typical_volume(&self) -> f64 {
        self.lattices.spacing.powi(D as i32)
    }

    /// Spacing h of the points \[m\]; 0 without points.
    pub fn spacing(&self) -> f64 {
        self.lattices.spacing
    }

    /// Returns true if the points are those of a lattice, whatever its axes.
    pub fn is_lattice(&self) -> bool {
        self.lattices.is_lattice
    }

    /// Volumes of the peridynamic zone and of the points in it.
    pub fn volumes(&self) -> Volumes {
        self.points.volumes
    }

    /// The number of a cell's material.
    pub fn material_of_cell(&self, cell: usize) -> u16 {
        self.elastic.material[cell]
    }

    /// Returns true if two cells have other materials, or axes that turn from one to the other.
    pub fn differ(&self, a: usize, b: usize) -> bool {
        self.elastic.differ(a, b)
    }

    /// The number of the material that peridynamic points have.
    pub fn peridynamic_material(&self) -> u16 {
        self.elastic.of_points
    }

    /// The local elastic tensor of a cell.
    pub fn tensor_of_cell(&self, cell: usize) -> &Tensor4<D> {
        self.elastic.tensor(cell)
    }

    /// The cells around a site that is a node, with the node's number within each.
    pub fn cells_of_site(&self, site: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let node = match self.sites[site].kind {
            SiteKind::Node(n) => Some(n),
            SiteKind::Point(_) => None,
        };
        node.into_iter().flat_map(|n| self.cells_of_node(n))
    }

    /// Returns true if the row of a site is the derivative of an energy: that of the model, or of the elements around, none of which another model has a part in.
    pub(crate) fn has_row_of_energy(&self, site: usize) -> bool {
        let is_element =
            |c: usize| self.roles[c] == CellRole::Element && self.zones[c] == Zone::Local;
        let mut cells = self.cells_of_site(site).peekable();
        self.has_energy || cells.peek().is_some() && cells.all(|(c, _)| is_element(c))
    }

    /// The cells around a node, with the node's number within each.
    pub(crate) fn cells_of_node(&self, n: u32) -> impl Iterator<Item = (usize, usize)> + '_ {
        let (offsets, cells) = &self.node_cells;
        cells[offsets[n as usize] as usize..offsets[n as usize + 1] as usize]
            .iter()
            .filter_map(move |&c| {
                self.mesh
                    .cell(c as usize)
                    .iter()
                    .position(|&m| m == n)
                    .map(|a| (c as usize, a))
            })
    }

    /// The nodes that follow a site, with its weight in each: those in the middle of edges, see [`mesh::Tie`](crate::mesh::Tie), and around an embedded patch; none of a point.
    pub fn followers_of_site(&self, site: usize) -> &[(u32, f64)] {
        match self.sites[site].kind {
            SiteKind::Node(n) => self.ties.followers(n),
            SiteKind::Point(_) => &[],
        }
    }

    /// The nodes that a node follows, with their weights: in the middle of an edge the ends of this, see [`mesh::Tie`](crate::mesh::Tie); none of a free node.
    pub fn followed_nodes(&self, node: u32) -> Option<&[(u32, f64)]> {
        self.ties.followed(node)
    }

    /// Returns true if the rows and loads of the nodes around a cell contain its share: where elements overlap into the peridynamic region, those of all cells do.
    pub fn node_takes(&self, cell: usize) -> bool {
        self.interface.overlap || self.is_element(cell)
    }

    /// Returns true if bonds end on the faces of elements.
    pub fn faces_cut_bonds(&self) -> bool {
        self.interface.faces || self.interface.feet
    }

    /// The lattice behind the faces at which bonds end, if they do.
    pub(crate) fn passing(&self) -> Option<&ContinuedLattice<D>> {
        self.lattices.passing.as_ref()
    }

    /// Returns true if a cell belongs to the finite elements of the model (as opposed to holding points).
    pub fn is_element(&self, cell: usize) -> bool {
        self.roles[cell] != CellRole::Points && self.mesh.shapes[cell] != CellShape::Vertex
    }
}
