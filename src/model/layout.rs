//! Layout of a model: sites of nodes and points, families, and the places at the seam that follow sites.

use std::sync::OnceLock;

use crate::{
    assembly::Transfer,
    dimension,
    model::{
        CellRole, Model, ModelError, Peridynamics, Reach, Tributary, ZoneLayout, ZonedBody,
        bond_cutting::LatticeFactors,
        completed_lattice::CompletedLattice,
        continued_lattice::ContinuedLattice,
        coupled_model::{CauchyBornElements, ModelLattices, ModelPoints, SpreadFamilies},
        family_ends::{self, Feet},
        held_families::HeldFamilies,
        interface_interpolation::{self, Sites},
        multi_lattice::{self, MergedLattices, reach, weighting},
        point_cloud::PointCloud,
        point_generation::{self, Beyond},
        problem,
        seam_order::{self, Ties},
    },
    peridynamics::{BondWeights, Cloud, Ends, PdBody},
    progress::Progress,
    shape::Barriers,
    system::{Ranks, Symmetry},
    tensor::Vector,
};

const NONE: u32 = u32::MAX;

type LaidOut<const D: usize> = Result<Model<D>, ModelError>;
type Layout<const D: usize> =
    fn(ZonedBody<D>, &dyn ZoneLayout<D>, Option<&dyn Ranks>, &dyn Progress) -> LaidOut<D>;
static LAYOUTS: (Layout<1>, Layout<2>, Layout<3>) =
    (Model::laid_out, Model::laid_out, Model::laid_out);

impl<const D: usize> Model<D> {
    /// Lays out sites and families as a coupling demands. Collective with `ranks`: families are then spread over processes where [`ZoneLayout::families_of_all`] says how and the points are a lattice of one horizon. Who asks for it needs the rows of its own sites only.
    ///
    /// # Errors
    /// [`ModelError`], each with place and remedy.
    pub fn new(
        body: ZonedBody<D>,
        coupling: &dyn ZoneLayout<D>,
        ranks: Option<&dyn Ranks>,
        progress: &dyn Progress,
    ) -> LaidOut<D> {
        dimension::of::<Layout<D>>(&LAYOUTS)(body, coupling, ranks, progress)
    }

    fn laid_out(
        body: ZonedBody<D>,
        coupling: &dyn ZoneLayout<D>,
        ranks: Option<&dyn Ranks>,
        progress: &dyn Progress,
    ) -> LaidOut<D> {
        let ZonedBody {
            mesh,
            zones,
            elastic,
            peridynamics,
        } = body;
        problem::takes_law(coupling, peridynamics.as_ref())?;
        problem::is_calibrated(peridynamics.as_ref(), &elastic.tensors, elastic.of_points)?;
        let largest = peridynamics.as_ref().map_or(0.0, |p| {
            (0..mesh.cell_count())
                .map(|c| p.reach(p.horizon.at(&mesh.centroid(c))))
                .fold(0.0, f64::max)
        });
        let is_spliced = peridynamics.as_ref().is_some_and(Peridynamics::is_spliced);
        let roles = coupling.roles(&mesh, &zones, largest);
        let mesh = seam_order::linear_at_seam(mesh, &roles)?;
        let mut model = Self {
            node_cells: mesh.node_cells(),
            ties: Ties::new(&mesh),
            node_transfer: Transfer::default(),
            mesh,
            zones,
            roles,
            sites: Vec::new(),
            peridynamics,
            elastic,
            points: ModelPoints::default(),
            lattices: ModelLattices::default(),
            interface: coupling.interface(),
            has_energy: coupling.symmetry() == Symmetry::Symmetric && !is_spliced,
            tributary: Tributary::default(),
            row_scale: None,
            cauchy_born: CauchyBornElements {
                laws: Vec::new(),
                dilatation: None,
            },
            operator_cache: OnceLock::new(),
            spread: SpreadFamilies::default(),
        };
        model.refuse_splice_in_transition(is_spliced)?;
        // elements with a partial stress have points around them that are no sites
        let has_points = model.roles.iter().any(|role| *role != CellRole::Element);
        if has_points && model.peridynamics.is_none() {
            return Err(ModelError::Unsupported {
                what: "a peridynamic zone without a peridynamic material",
                remedy: "add [peridynamics], or use coupling.local",
            });
        }
        progress.stage("sites", None);
        let clouds = model.place_clouds(coupling)?;
        let node_site = model.place_nodes(coupling.interface());
        if !clouds.is_empty() {
            model.place_points(clouds, &node_site, coupling, ranks, progress)?;
        } else {
            let rows = (0..node_site.len() as u32).map(|n| match node_site[n as usize] {
                NONE => model.ties.row(n, &node_site).unwrap_or_default(),
                site => vec![(site, 1.0)],
            });
            model.node_transfer = Transfer::from_rows(model.sites.len(), rows);
        }
        model.share_out();
        Ok(model)
    }

    /// The peridynamic points of each lattice; none without peridynamic cells.
    fn place_clouds(&self, coupling: &dyn ZoneLayout<D>) -> Result<Vec<PointCloud<D>>, ModelError> {
        match &self.peridynamics {
            Some(p) if self.roles.iter().any(|role| *role != CellRole::Element) => {
                let beyond = match self.interface.faces {
                    true => Beyond::Continued,
                    false => Beyond::Empty,
                };
                self.check_lattices(p)?;
                // feet stand for what the whole lattice has beyond a face
                let reach = match self.interface.feet {
                    true => Reach::Neighbours,
                    false => reach(coupling, p),
                };
                let (mesh, zones) = (&self.mesh, &self.zones);
                let mut clouds =
                    point_generation::place(mesh, zones, &self.roles, p, reach, beyond)?;
                match clouds.len() {
                    1 => p.horizon_change.clouds(clouds.remove(0)),
                    _ => Ok(clouds),
                }
            }
            _ => Ok(Vec::new()),
        }
    }

    /// Makes sites of points, completes families, and expresses every other place through sites.
    fn place_points(
        &mut self,
        clouds: Vec<PointCloud<D>>,
        node_site: &[u32],
        coupling: &dyn ZoneLayout<D>,
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
        coupling: &dyn ZoneLayout<D>,
        ranks: Option<&dyn Ranks>,
    ) -> Result<(Vec<CompletedLattice<D>>, Option<Feet<D>>), ModelError> {
        let mut feet = None;
        let reach = reach(coupling, p);
        let held = match &clouds[..] {
            [alone] => HeldFamilies::of(coupling, p, reach, alone.spacing),
            _ => None,
        };
        let grow = |(l, cloud): (usize, PointCloud<D>)| match self.interface.feet {
            true => {
                let whole = self.grow(p, cloud, l, Reach::Neighbours, (None, None))?;
                let (lattice, ends) = family_ends::place((&self.mesh, &self.roles), p, whole)?;
                feet = Some(ends);
                Ok(lattice)
            }
            false => self.grow(p, cloud, l, reach, (held, ranks)),
        };
        let grown: Result<Vec<_>, ModelError> = clouds.into_iter().enumerate().map(grow).collect();
        Ok((grown?, feet))
    }

    fn place_points_of(
        &mut self,
        p: &Peridynamics<D>,
        clouds: Vec<PointCloud<D>>,
        node_site: &[u32],
        coupling: &dyn ZoneLayout<D>,
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
            interaction,
            of_point,
            horizons,
            shared,
            held,
        } = merged;
        (self.spread.held, self.lattices.spacing) = (held, cloud.spacing);
        self.lattices.is_lattice = factors[0].is_lattice();
        self.points.volumes = cloud.volumes;
        self.points.continued = cloud.continued();
        let point_site = self.place_point_sites(&cloud);
        progress.stage("seam", None);
        let transfer = self.express_places(p, &cloud, wide, &point_site, node_site, coupling)?;
        progress.stage("bonds", None);
        self.check_seam_on_border(p.law.as_ref())?;
        let materials = self.materials_of(p.law.as_ref(), &cloud);
        self.points.on_border = materials.on_border;
        let horizon = cloud.horizon.clone();
        let (of_bonds, lattice_of) = (p.horizon_change.of_bonds(), of_point.clone());
        let shells = |ends: [usize; 2], xi: &Vector<D>| {
            let lattice = usize::from(lattice_of[ends[0]]);
            let factor = factors[lattice].factor(of_bonds.of(ends, &horizon), xi);
            factor.unwrap_or(1.0) * interaction.as_ref().map_or(1.0, |i| i.of(ends, &horizon))
        };
        let is_regular = is_constant && p.weights != BondWeights::Fitted;
        let weighting = weighting(p, &factors[0], interaction.is_some(), &shells);
        let is_alike = is_regular && feet.is_none();
        let ends = if is_alike { Ends::Alike } else { Ends::Differ };
        if p.weights == BondWeights::Plain {
            self.carry_plain_stiffness(p, &factors[0], horizons[0], self.elastic.of_points)?;
        }
        if let Some(families) = passing {
            let whole = multi_lattice::whole_families(p, &factors, &horizons, is_regular)?;
            let passing = ContinuedLattice {
                families,
                whole,
                of_point,
            };
            self.lattices.passing = Some(passing);
        }
        self.points.zone = cloud.zone;
        let cloud = Cloud {
            position: cloud.position,
            volume: cloud.volume,
            horizon: cloud.horizon.grouped(),
            transfer,
            material: materials.of_point,
            bond_horizon: of_bonds,
        };
        self.lattices.factors = multi_lattice::by_horizon(&factors, &cloud.horizon, horizons);
        let body = PdBody::new(cloud, families, p.law.linearised(), &weighting, ends)
            .map_err(|e| ModelError::family("the point", e));
        let mut body = self.held_body(shared.zip(ranks), &point_site, body)?;
        if let Some(feet) = feet {
            self.end_families(p, feet, &mut body)?;
        }
        self.points.body = Some(body);
        Ok(())
    }

    /// Balances families that end at feet, and keeps where they do.
    fn end_families(
        &mut self,
        p: &Peridynamics<D>,
        feet: Feet<D>,
        body: &mut PdBody<D>,
    ) -> Result<(), ModelError> {
        let at = (&self.mesh, &self.node_transfer, self.lattices.spacing);
        family_ends::balance(at, &feet, p.law.linearised(), body)?;
        self.points.feet = (feet.points as u32..body.cloud.position.len() as u32).collect();
        self.points.left_out = feet.left_out;
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
        coupling: &dyn ZoneLayout<D>,
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
        let law = p.law.as_ref();
        let among = interface_interpolation::fit_continued(&sites, cloud)?;
        let (transfer, _) = self.transfer_of(law, &sites, cloud, &among, |i| point_site[i]);
        if let Some((wide, renumbered)) = wide {
            let site = |i: usize| point_site[renumbered[i] as usize];
            let (transfer, patches) = self.transfer_of(law, &sites, &wide, &[], site);
            self.points.patches = patches;
            self.points.surroundings = Some(Cloud {
                position: wide.position,
                volume: wide.volume,
                horizon: wide.horizon,
                transfer,
                ..Cloud::default()
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
                self.elastic.tensors[usize::from(material)] =
                    factors.regular_family(law, horizon)?.tensor;
            }
        }
        if let Some(whole) = factors.whole_family(p.law.linearised(), horizon)? {
            self.elastic.tensors[peridynamic_material as usize] = whole.tensor;
            self.lattices.plain = Some(whole);
        }
        Ok(())
    }
}
