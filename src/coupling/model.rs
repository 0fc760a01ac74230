//! Common model of all couplings: sites, peridynamic points, their families, and the places at the seam that follow sites.

use std::any::Any;
use std::sync::{Arc, OnceLock};

use rustc_hash::FxHashMap;

use crate::{
    assembly::Transfer,
    coupling::{
        CellRole, Coupling, Interface, ModelError, Peridynamics, Problem, Reach, Surfaces, Zone,
        bond_cutting::{self, LatticeFactors, WholeFamily},
        completed_lattice::CompletedLattice,
        held_families::HeldFamilies,
        interface_interpolation::{self, Sites},
        multi_lattice::{self, ContinuedLattice, MergedLattices, reach, weighting},
        point_cloud::{PointCloud, Volumes},
        point_generation::{self, Beyond},
        problem,
        recovery::Patch,
        seam_order::{self, Ties},
        shared_families::SharedFamilies,
        tributary::Tributary,
        truncated_families::{self, Feet},
    },
    dimension,
    material::LocalLaw,
    mesh::{CellShape, Mesh},
    peridynamics::{BondWeights, CauchyBorn, Cloud, Ends, Families, PdBody},
    progress::Progress,
    shape::Barriers,
    system::{Ranks, Symmetry},
    tensor::{Tensor4, Vector},
};

/// Carrier of the degrees of freedom at a site.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SiteKind {
    /// A node of finite elements, by its number in the mesh.
    Node(u32),
    /// A peridynamic point, by its number in the cloud.
    Point(u32),
}

/// A place where a body keeps degrees of freedom.
#[derive(Clone, Copy, Debug)]
pub struct Site<const D: usize> {
    /// Reference position \[m\].
    pub position: Vector<D>,
    /// Node or point.
    pub kind: SiteKind,
    /// Volume of the part of the body that the site stands for \[m^D\], see [`Tributary`]: far from seams and surfaces that of the point's cell, or the integral of the node's shape function.
    pub volume: f64,
}

const NONE: u32 = u32::MAX;

/// A problem with its sites and families; a coupling turns it into rows.
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
    pub(super) tensors: Vec<Tensor4<D>>,
    pub(super) cell_material: Vec<u16>,
    peridynamic_material: u16,
    body: Option<PdBody<D>>,
    /// All quadrature points in and around elements whose stress is a partial stress.
    surroundings: Option<Cloud<D>>,
    point_zone: Vec<Zone>,
    pub(super) points_on_border: usize,
    node_cells: (Vec<u32>, Vec<u32>),
    pub(super) ties: Ties,
    pub(super) interface: Interface,
    passing: Option<ContinuedLattice<D>>,
    /// Corrections of the interpolation in elements, where elements carry the partial stress of points between their nodes.
    pub(super) patches: FxHashMap<u32, Patch<D>>,
    /// The whole family of a lattice with plain weights, whose tensor the elements have.
    plain_lattice: Option<WholeFamily<D>>,
    spacing: f64,
    is_lattice: bool,
    volumes: Volumes,
    /// True if rows are the gradient of an energy.
    pub(super) has_energy: bool,
    pub(super) tributary: Tributary,
    pub(super) row_scale: Option<Vec<f64>>,
    /// Bond factors and horizon of each lattice.
    pub(super) factors: Vec<(LatticeFactors<D>, f64)>,
    /// The laws of elements that follow the bonds, by the number of a material; empty where elements are linear.
    pub(super) cauchy_born: Vec<Option<Arc<dyn LocalLaw<D>>>>,
    /// Points of the cloud that are feet of families, on the faces of elements.
    pub(super) feet: Vec<u32>,
    pub(super) left_out: Vec<Vector<D>>,
    /// The dilatation of elements that follow the bonds of an LPS.
    pub(super) dilatation: Option<Arc<CauchyBorn<D>>>,
    /// Results of the operator that the next one of the same model can use: `zones = "auto"` solves before the run does.
    pub(super) operator_cache: OnceLock<Box<dyn Any + Send + Sync>>,
    /// Distribution of the families, where they are spread over processes.
    pub(super) shared: Option<SharedFamilies>,
    /// Which families a process would hold, where they can be spread over processes.
    pub(super) held: Option<HeldFamilies>,
}

type LaidOut<const D: usize> = Result<(Model<D>, Box<dyn Coupling<D>>), ModelError>;
type Layout<const D: usize> = fn(Problem<D>, Option<&dyn Ranks>, &dyn Progress) -> LaidOut<D>;
static LAYOUTS: (Layout<1>, Layout<2>, Layout<3>) =
    (Model::laid_out, Model::laid_out, Model::laid_out);

impl<const D: usize> Model<D> {
    /// Lays out sites and families.
    ///
    /// # Errors
    /// [`ModelError`], each with place and remedy.
    pub fn new(problem: Problem<D>, progress: &dyn Progress) -> LaidOut<D> {
        Self::shared(problem, None, progress)
    }

    /// Collective: as [`Model::new`], with the families spread over processes where [`Coupling::families_of_all`] says how and the points are a lattice of one horizon. Who asks for it needs the rows of its own sites only.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn shared(
        problem: Problem<D>,
        ranks: Option<&dyn Ranks>,
        progress: &dyn Progress,
    ) -> LaidOut<D> {
        dimension::of::<Layout<D>>(&LAYOUTS)(problem, ranks, progress)
    }

    fn laid_out(
        problem: Problem<D>,
        ranks: Option<&dyn Ranks>,
        progress: &dyn Progress,
    ) -> LaidOut<D> {
        let Problem {
            mesh,
            zones,
            tensors,
            cell_material,
            peridynamic_material,
            peridynamics,
            coupling,
        } = problem;
        problem::takes_law(coupling.as_ref(), peridynamics.as_ref())?;
        problem::is_calibrated(peridynamics.as_ref(), &tensors, peridynamic_material)?;
        let largest = peridynamics.as_ref().map_or(0.0, |p| {
            (0..mesh.cell_count())
                .map(|c| p.reach(p.horizon.at(&mesh.centroid(c))))
                .fold(0.0, f64::max)
        });
        let roles = coupling.roles(&mesh, &zones, largest);
        let mesh = seam_order::linear_at_seam(mesh, &roles)?;
        let mut model = Self {
            node_cells: mesh.node_cells(),
            ties: Ties::new(&mesh),
            node_transfer: Transfer::new(),
            mesh,
            zones,
            roles,
            sites: Vec::new(),
            peridynamics,
            tensors,
            cell_material,
            peridynamic_material,
            body: None,
            surroundings: None,
            point_zone: Vec::new(),
            points_on_border: 0,
            interface: coupling.interface(),
            passing: None,
            patches: FxHashMap::default(),
            plain_lattice: None,
            spacing: 0.0,
            is_lattice: false,
            volumes: Volumes::default(),
            has_energy: coupling.symmetry() == Symmetry::Symmetric,
            tributary: Tributary::default(),
            row_scale: None,
            factors: Vec::new(),
            cauchy_born: Vec::new(),
            feet: Vec::new(),
            left_out: Vec::new(),
            dilatation: None,
            operator_cache: OnceLock::new(),
            shared: None,
            held: None,
        };
        let has_points = model.roles.contains(&CellRole::Points);
        if has_points && model.peridynamics.is_none() {
            return Err(ModelError::Unsupported {
                what: "a peridynamic zone without a peridynamic material",
                remedy: "add [peridynamics], or use coupling.local",
            });
        }
        progress.stage("sites", None);
        let clouds = model.place_clouds(coupling.as_ref())?;
        let node_site = model.place_nodes(coupling.interface());
        if !clouds.is_empty() {
            model.place_points(clouds, &node_site, coupling.as_ref(), ranks, progress)?;
        } else {
            let rows = (0..node_site.len() as u32).map(|n| match node_site[n as usize] {
                NONE => model.ties.row(n, &node_site).unwrap_or_default(),
                site => vec![(site, 1.0)],
            });
            model.node_transfer = Transfer::from_rows(rows);
        }
        model.share_out();
        Ok((model, coupling))
    }

    /// The peridynamic points of each lattice; none without peridynamic cells.
    fn place_clouds(&self, coupling: &dyn Coupling<D>) -> Result<Vec<PointCloud<D>>, ModelError> {
        match &self.peridynamics {
            Some(p) if self.roles.contains(&CellRole::Points) => {
                let beyond = match self.interface {
                    Interface::Faces => Beyond::Continued,
                    _ => Beyond::Empty,
                };
                self.check_lattices(p)?;
                // feet stand for what the whole lattice has beyond a face
                let reach = match self.interface {
                    Interface::Feet => Reach::Neighbours,
                    _ => reach(coupling, p),
                };
                let (mesh, zones) = (&self.mesh, &self.zones);
                point_generation::place(mesh, zones, &self.roles, p, reach, beyond)
            }
            _ => Ok(Vec::new()),
        }
    }

    /// The problem that the model was laid out from, to lay it out anew with other zones.
    pub fn into_problem(self, coupling: Box<dyn Coupling<D>>) -> Problem<D> {
        Problem {
            mesh: self.mesh,
            zones: self.zones,
            tensors: self.tensors,
            cell_material: self.cell_material,
            peridynamic_material: self.peridynamic_material,
            peridynamics: self.peridynamics,
            coupling,
        }
    }

    /// The cells around every node: where those of each begin, and their numbers.
    pub(super) fn node_cells(&self) -> (&[u32], &[u32]) {
        (&self.node_cells.0, &self.node_cells.1)
    }

    /// Makes sites of points, completes families, and expresses every other place through sites.
    fn place_points(
        &mut self,
        clouds: Vec<PointCloud<D>>,
        node_site: &[u32],
        coupling: &dyn Coupling<D>,
        ranks: Option<&dyn Ranks>,
        progress: &dyn Progress,
    ) -> Result<(), ModelError> {
        let Some(p) = self.peridynamics.take() else {
            return Ok(());
        };
        let result = self.place_points_of(&p, clouds, node_site, coupling, ranks, progress);
        self.peridynamics = Some(p);
        result?;
        self.calibrate_law()
    }

    /// The lattices with their families, and where these end on faces, if they do.
    fn grown(
        &self,
        p: &Peridynamics<D>,
        clouds: Vec<PointCloud<D>>,
        coupling: &dyn Coupling<D>,
        ranks: Option<&dyn Ranks>,
    ) -> Result<(Vec<CompletedLattice<D>>, Option<Feet<D>>), ModelError> {
        let mut feet = None;
        let reach = reach(coupling, p);
        let held = match &clouds[..] {
            [alone] => HeldFamilies::of(coupling, p, reach, alone.spacing),
            _ => None,
        };
        let grow = |(l, cloud): (usize, PointCloud<D>)| match self.interface {
            Interface::Feet => {
                let whole = self.grow(p, cloud, l, Reach::Neighbours, (None, None))?;
                let (lattice, ends) =
                    truncated_families::place((&self.mesh, &self.roles), p, whole)?;
                feet = Some(ends);
                Ok(lattice)
            }
            _ => self.grow(p, cloud, l, reach, (held, ranks)),
        };
        let grown: Result<Vec<_>, ModelError> = clouds.into_iter().enumerate().map(grow).collect();
        Ok((grown?, feet))
    }

    fn place_points_of(
        &mut self,
        p: &Peridynamics<D>,
        clouds: Vec<PointCloud<D>>,
        node_site: &[u32],
        coupling: &dyn Coupling<D>,
        ranks: Option<&dyn Ranks>,
        progress: &dyn Progress,
    ) -> Result<(), ModelError> {
        progress.stage("families", None);
        let (grown, feet) = self.grown(p, clouds, coupling, ranks)?;
        let Some(merged) = MergedLattices::of(grown) else {
            return Ok(());
        };
        let MergedLattices {
            cloud,
            families,
            passing,
            factors,
            wide,
            is_constant,
            of_point,
            horizons,
            shared,
            held,
        } = merged;
        self.held = held;
        self.spacing = cloud.spacing;
        self.is_lattice = factors[0].is_lattice();
        self.volumes = cloud.volumes;
        let point_site = self.place_point_sites(&cloud);
        progress.stage("seam", None);
        let transfer = self.express_places(p, &cloud, wide, &point_site, node_site, coupling)?;
        progress.stage("bonds", None);
        self.check_seam_on_border(p.law.as_ref())?;
        let materials = self.materials_of(p.law.as_ref(), &cloud);
        self.points_on_border = materials.on_border;
        let horizon = cloud.horizon.clone();
        let shells = |i: usize, xi: &Vector<D>| {
            let of_lattice = &factors[horizon.lattice_of(i)];
            of_lattice.factor(horizon.of(i), xi).unwrap_or(1.0)
        };
        let is_regular = is_constant && p.weights != BondWeights::Fitted;
        let weighting = weighting(p, &factors[0], &shells);
        let ends = match is_regular && feet.is_none() {
            true => Ends::Alike,
            false => Ends::Differ,
        };
        if p.weights == BondWeights::Plain {
            self.carry_plain_stiffness(p, &factors[0], horizons[0], self.peridynamic_material)?;
        }
        if let Some(families) = passing {
            let whole = multi_lattice::whole_families(p, &factors, &horizons, is_regular)?;
            self.passing = Some(ContinuedLattice {
                families,
                whole,
                of_point,
            });
        }
        self.point_zone = cloud.zone;
        let cloud = Cloud {
            position: cloud.position,
            volume: cloud.volume,
            horizon: cloud.horizon,
            transfer,
            material: materials.of_point,
        };
        let body = PdBody::new(cloud, families, p.law.linearised(), &weighting, ends)
            .map_err(|e| ModelError::family("the point", e));
        let mut body = self.held_body(shared.zip(ranks), &point_site, body)?;
        if let Some(feet) = feet {
            self.end_families(p, feet, &mut body)?;
        }
        self.body = Some(body);
        self.factors = factors.into_iter().zip(horizons).collect();
        Ok(())
    }

    /// Balances families that end at feet, and keeps where they do.
    fn end_families(
        &mut self,
        p: &Peridynamics<D>,
        feet: Feet<D>,
        body: &mut PdBody<D>,
    ) -> Result<(), ModelError> {
        let at = (&self.mesh, &self.node_transfer, self.spacing);
        truncated_families::balance(at, &feet, p.law.linearised(), body)?;
        self.feet = (feet.points as u32..body.cloud.position.len() as u32).collect();
        self.left_out = feet.left_out;
        body.set_ends(feet.ends);
        Ok(())
    }

    /// Expresses nodes that are no sites, points in elements and those around elements that carry a partial stress through sites; returns how points follow.
    fn express_places(
        &mut self,
        p: &Peridynamics<D>,
        cloud: &PointCloud<D>,
        wide: Option<(PointCloud<D>, Vec<u32>)>,
        point_site: &[u32],
        node_site: &[u32],
        coupling: &dyn Coupling<D>,
    ) -> Result<Transfer, ModelError> {
        let barriers = Barriers::new(p.barriers.clone());
        let sites = Sites {
            mesh: &self.mesh,
            roles: &self.roles,
            sites: &self.sites,
            node_site,
            ties: &self.ties,
            barriers: &barriers,
        };
        self.node_transfer =
            interface_interpolation::fit_nodes(&sites, coupling.interface(), cloud)?;
        let (transfer, _) = self.transfer_of(&sites, cloud, |i| point_site[i]);
        if let Some((wide, renumbered)) = wide {
            let site = |i: usize| point_site[renumbered[i] as usize];
            let (transfer, patches) = self.transfer_of(&sites, &wide, site);
            self.patches = patches;
            self.surroundings = Some(Cloud {
                position: wide.position,
                volume: wide.volume,
                horizon: wide.horizon,
                transfer,
                material: Vec::new(),
            });
        }
        Ok(transfer)
    }

    /// Gives the local side the stiffness of the peridynamic quadrature with plain weights, or the seam would be a jump of material.
    fn carry_plain_stiffness(
        &mut self,
        p: &Peridynamics<D>,
        factors: &LatticeFactors<D>,
        horizon: f64,
        peridynamic_material: u16,
    ) -> Result<(), ModelError> {
        if let Some(several) = p.law.several().filter(|_| factors.is_lattice()) {
            for &material in several.used() {
                let law = several.law(material).linearised();
                self.tensors[usize::from(material)] = factors.regular_family(law, horizon)?.tensor;
            }
        }
        if let Some(whole) = factors.whole_family(p.law.linearised(), horizon)? {
            self.tensors[peridynamic_material as usize] = whole.tensor;
            self.plain_lattice = Some(whole);
        }
        Ok(())
    }

    /// All quadrature points in and around elements whose stress is a partial stress, if there are such elements.
    pub fn surroundings(&self) -> Option<&Cloud<D>> {
        self.surroundings.as_ref()
    }

    /// The whole family of a lattice with plain weights.
    pub(super) fn plain_lattice(&self) -> Option<&WholeFamily<D>> {
        self.plain_lattice.as_ref()
    }

    /// Removes the bonds that voids, cracks or the boundary of the mesh cut.
    pub fn cut_bonds(&self, position: &[Vector<D>], families: &mut Families) {
        let Some(p) = &self.peridynamics else { return };
        let surface = (p.surfaces == Surfaces::Cut).then(|| self.mesh.outer_facets());
        let longest = p.horizon.of_points(position).largest();
        bond_cutting::cut(p, &self.mesh, surface, longest, position, families);
    }

    /// The peridynamic body, if there is one.
    pub fn body(&self) -> Option<&PdBody<D>> {
        self.body.as_ref()
    }

    /// The peridynamic body and the point of a site; `None` if the site is a node.
    pub fn point_of(&self, site: usize) -> Option<(&PdBody<D>, usize)> {
        match self.sites[site].kind {
            SiteKind::Point(p) => self.body.as_ref().map(|b| (b, p as usize)),
            SiteKind::Node(_) => None,
        }
    }

    /// The zone of a point of the cloud.
    pub fn zone_of_point(&self, point: usize) -> Zone {
        self.point_zone[point]
    }

    /// The volume of a point whose cell is whole \[m^D\].
    pub fn typical_volume(&self) -> f64 {
        self.spacing.powi(D as i32)
    }

    /// Spacing h of the points \[m\]; 0 without points.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Returns true if the points are those of a lattice, whatever its axes.
    pub fn is_lattice(&self) -> bool {
        self.is_lattice
    }

    /// Volumes of the peridynamic zone and of the points in it.
    pub fn volumes(&self) -> Volumes {
        self.volumes
    }

    /// The number of a cell's material.
    pub fn material_of_cell(&self, cell: usize) -> u16 {
        self.cell_material[cell]
    }

    /// The number of the material that peridynamic points have.
    pub fn peridynamic_material(&self) -> u16 {
        self.peridynamic_material
    }

    /// The local elastic tensor of a cell.
    pub fn tensor_of_cell(&self, cell: usize) -> &Tensor4<D> {
        &self.tensors[self.cell_material[cell] as usize]
    }

    /// The cells around a site that is a node, with the node's number within each.
    pub fn cells_of_site(&self, site: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let node = match self.sites[site].kind {
            SiteKind::Node(n) => Some(n),
            SiteKind::Point(_) => None,
        };
        node.into_iter().flat_map(|n| self.cells_of_node(n))
    }

    /// The cells around a node, with the node's number within each.
    pub(super) fn cells_of_node(&self, n: u32) -> impl Iterator<Item = (usize, usize)> + '_ {
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

    /// The nodes in the middle of edges that follow a site by half, see [`mesh::Tie`](crate::mesh::Tie); none of a point.
    pub fn followers_of_site(&self, site: usize) -> &[u32] {
        match self.sites[site].kind {
            SiteKind::Node(n) => self.ties.followers(n),
            SiteKind::Point(_) => &[],
        }
    }

    /// The ends of its edge that a node in the middle follows, by half each, see [`mesh::Tie`](crate::mesh::Tie); none of a free node.
    pub fn followed_ends(&self, node: u32) -> Option<[u32; 2]> {
        self.ties.ends(node)
    }

    /// Returns true if the rows and loads of the nodes around a cell contain its share: where elements overlap into the peridynamic region, those of all cells do.
    pub fn node_takes(&self, cell: usize) -> bool {
        !self.faces_cut_bonds() || self.is_element(cell)
    }

    /// Returns true if bonds end on the faces of elements, so that no place beyond acts on a point.
    pub fn faces_cut_bonds(&self) -> bool {
        matches!(self.interface, Interface::Faces | Interface::Feet)
    }

    /// The lattice behind the faces at which bonds end, if they do.
    pub(super) fn passing(&self) -> Option<&ContinuedLattice<D>> {
        self.passing.as_ref()
    }

    /// Returns true if a cell belongs to the finite elements of the model (as opposed to holding points).
    pub fn is_element(&self, cell: usize) -> bool {
        self.roles[cell] != CellRole::Points && self.mesh.shapes[cell] != CellShape::Vertex
    }
}
