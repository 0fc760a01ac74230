//! The lattices of a model: one, or several that elements keep apart, each with its own spacing and horizon.

use std::sync::Arc;

use crate::{
    mesh::boundary::BoundaryFacet,
    model::{
        CellRole, Interface, Model, ModelError, Peridynamics, PointSource, Reach, Surfaces,
        ZoneLayout,
        bond_cutting::{self, LatticeFactors, WholeFamily},
        completed_lattice::CompletedLattice,
        held_families::HeldFamilies,
        horizon_regions::InteractionFactors,
        point_cloud::{PointCarrier, PointCloud},
        shared_families::SharedFamilies,
    },
    peridynamics::{
        BondWeights, Factors, Families, Horizon, Law, LinearForceState, PartialVolume,
        TIE_TOLERANCE,
        softening::{CalibrationError, RegularFamily},
    },
    system::Ranks,
    tensor::{Tensor4, Vector},
};

/// All lattices of a body as one cloud.
pub(crate) struct MergedLattices<const D: usize> {
    pub cloud: PointCloud<D>,
    pub families: Families,
    /// Families of the points in elements.
    pub passing: Option<Families>,
    /// Of each lattice.
    pub factors: Vec<Arc<LatticeFactors<D>>>,
    /// Of the first lattice, see [`CompletedLattice::wide`].
    pub wide: Option<(PointCloud<D>, Vec<u32>)>,
    pub is_constant: bool,
    /// Of the first lattice, see [`CompletedLattice::interaction`].
    pub interaction: Option<InteractionFactors>,
    /// The lattice of each point.
    pub of_point: Vec<u16>,
    /// Of each lattice.
    pub horizons: Vec<f64>,
    /// Of the first lattice, see [`CompletedLattice::shared`].
    pub shared: Option<SharedFamilies>,
    /// Of the first lattice, see [`CompletedLattice::held`].
    pub held: Option<HeldFamilies>,
}

impl<const D: usize> MergedLattices<D> {
    /// Lattices one after the other; none of no lattice.
    pub fn of(grown: Vec<CompletedLattice<D>>) -> Option<Self> {
        let mut grown = grown.into_iter();
        let CompletedLattice {
            mut cloud,
            mut families,
            mut passing,
            factors: first,
            wide,
            is_constant,
            interaction,
            shared,
            held,
        } = grown.next()?;
        let mut factors = vec![Arc::new(first)];
        let mut of_point = vec![0u16; cloud.position.len()];
        // a field has one lattice
        let mut horizons = vec![cloud.horizon.largest()];
        for next in grown {
            families.append(&next.families);
            if let (Some(all), Some(more)) = (&mut passing, &next.passing) {
                all.append(more);
            }
            of_point.extend(vec![factors.len() as u16; next.cloud.position.len()]);
            horizons.push(next.cloud.horizon.largest());
            cloud.append(next.cloud);
            factors.push(Arc::new(next.factors));
        }
        if factors.len() > 1 {
            cloud.horizon = Horizon::PerLattice {
                horizons: horizons.clone(),
                of_point: of_point.clone(),
            };
        }
        Some(Self {
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
        })
    }
}

/// The factors of each horizon, as points number these: of several lattices their own, of a field those of its one lattice.
pub(crate) fn by_horizon<const D: usize>(
    factors: &[Arc<LatticeFactors<D>>],
    horizon: &Horizon,
    of_lattices: Vec<f64>,
) -> Vec<(Arc<LatticeFactors<D>>, f64)> {
    match (horizon, factors) {
        (Horizon::PerLattice { horizons, .. }, [all]) => {
            horizons.iter().map(|h| (Arc::clone(all), *h)).collect()
        }
        _ => factors.iter().cloned().zip(of_lattices).collect(),
    }
}

/// Refuses horizons below the spacing, and a lattice without points of its own where there is a zone of such.
fn check_cloud<const D: usize>(cloud: &PointCloud<D>, has_zone: bool) -> Result<(), ModelError> {
    for (i, x) in cloud.position.iter().enumerate() {
        let horizon = cloud.horizon.of(i);
        if !(horizon.is_finite() && horizon >= cloud.spacing * (1.0 - 1e-9)) {
            return Err(ModelError::Horizon {
                position: x.iter().copied().collect(),
                horizon,
                spacing: cloud.spacing,
            });
        }
    }
    if has_zone && !cloud.carrier.iter().any(PointCarrier::is_own) {
        return Err(ModelError::NoPoints {
            spacing: cloud.spacing,
        });
    }
    Ok(())
}

/// Families held by a process where families may be spread over processes, and these processes.
pub(crate) type Spreading<'a> = (Option<HeldFamilies>, Option<&'a dyn Ranks>);

impl<const D: usize> Model<D> {
    /// The families of points on a lattice along the axes, all of one `reach`, or those of this process; none of other points.
    fn by_lattice(
        &self,
        cloud: &PointCloud<D>,
        reaches: &[f64],
        (held, ranks): Spreading<'_>,
    ) -> Option<(Families, Option<SharedFamilies>)> {
        let reach = *reaches.first()?;
        if !cloud.is_axis_parallel() || reaches.iter().any(|r| *r != reach) {
            return None;
        }
        if let (Some(held), Some(ranks)) = (held, ranks) {
            let (found, shared) = self.search_shared(ranks, &held, cloud, reach)?;
            return Some((found, Some(shared)));
        }
        let (points, spacing) = (&cloud.position, cloud.spacing);
        let found = Families::search_lattice(points, spacing, reach, TIE_TOLERANCE)?;
        Some((found, None))
    }

    /// Completes the families of the points of one lattice, and drops the points that nothing needs.
    pub(crate) fn grow(
        &self,
        p: &Peridynamics<D>,
        mut cloud: PointCloud<D>,
        lattice: usize,
        reach: Reach,
        (held, ranks): Spreading<'_>,
    ) -> Result<CompletedLattice<D>, ModelError> {
        check_cloud(&cloud, self.roles.contains(&CellRole::Points))?;
        let is_constant = cloud.horizon.uniform().is_some();
        let reaches = p
            .horizon_change
            .reaches(p, &cloud.horizon, cloud.position.len());
        let held = held.filter(|_| is_constant);
        let known = self.by_lattice(&cloud, &reaches, (held, ranks));
        let held = held.filter(|_| known.is_some());
        let (mut families, shared) = match known {
            Some(known) => known,
            None => (
                Families::search(&cloud.position, &reaches, TIE_TOLERANCE)?,
                None,
            ),
        };
        let factors = LatticeFactors::new(p, &cloud)?;
        let mut interaction = InteractionFactors::of_rule(p, &cloud, &mut families, &factors);
        factors.drop_without_share(p.horizon_change.of_bonds(), &cloud, &mut families);
        let surface = self.cutting_surface(p, lattice);
        let longest = reaches.iter().copied().fold(0.0, f64::max);
        bond_cutting::cut(
            &p.barriers,
            &self.mesh,
            surface,
            longest,
            &cloud.position,
            &mut families,
        );
        // which points need a family of their own, and which only complete those of others
        let reach = if is_constant {
            reach
        } else {
            Reach::Neighbours
        };
        let (keep, passing) = match self.interface.faces {
            true => {
                let (keep, passing) = cloud.prune_through(&families, reach);
                let families = families.restrict(&keep.renumbered, &passing);
                (keep, Some(families))
            }
            false => (cloud.prune(&families, reach), None),
        };
        let families = families.restrict(&keep.renumbered, &keep.active);
        let wide = self
            .roles
            .contains(&CellRole::StressElement)
            .then(|| (cloud.clone(), keep.renumbered.clone()));
        if let Some((wide, _)) = &wide {
            let near = self.near_stress_elements(wide);
            self.check_materials(p.law.as_ref(), wide, |i| {
                near(&wide.position[i], wide.horizon.of(i))
            })?;
        }
        cloud.retain(&keep.renumbered);
        let factors_between = interaction.iter_mut();
        factors_between.for_each(|between| between.retain(&keep.renumbered));
        // bonds that are cut where elements begin see nothing of what lies beyond
        if self.interface.overlap {
            self.check_materials(p.law.as_ref(), &cloud, |_| true)?;
        }
        Ok(CompletedLattice {
            factors,
            cloud,
            families,
            passing,
            wide,
            is_constant,
            interaction,
            shared,
            held,
        })
    }

    /// The facets of the mesh that cut bonds of a lattice, if any do.
    fn cutting_surface(&self, p: &Peridynamics<D>, lattice: usize) -> Option<Vec<BoundaryFacet>> {
        match (self.faces_cut_bonds(), p.surfaces) {
            // a bond may leave the body through the elements around, but not through a free surface of the points
            (true, _) => {
                let mut facets = self.mesh.outer_facets();
                facets.retain(|f| self.lattice_in(&p.points, f.cell as usize) == Some(lattice));
                Some(facets)
            }
            (false, Surfaces::Cut) => Some(self.mesh.outer_facets()),
            (false, Surfaces::Uncut) => None,
        }
    }

    /// Returns a test of whether a position may be in the family of a Gauss point of an element that carries the partial stress.
    fn near_stress_elements(&self, cloud: &PointCloud<D>) -> impl Fn(&Vector<D>, f64) -> bool {
        let boxes: Vec<(Vector<D>, Vector<D>)> = (0..self.mesh.cell_count())
            .filter(|&c| self.roles[c] == CellRole::StressElement)
            .map(|c| self.mesh.bounds_of(self.mesh.cell(c)))
            .collect();
        let slack = 1e-9 * cloud.spacing;
        move |x, horizon| {
            boxes.iter().any(|(low, high)| {
                let outside =
                    Vector::<D>::from_fn(|a, _| (low[a] - x[a]).max(x[a] - high[a]).max(0.0));
                outside.norm() < horizon - slack
            })
        }
    }

    /// Refuses families that reach into another material: their bonds would take its strain for that of the peridynamic one, and as the elements there
    /// know nothing of them, forces would not balance by far.
    fn check_materials(
        &self,
        law: &dyn Law<D>,
        cloud: &PointCloud<D>,
        counts: impl Fn(usize) -> bool,
    ) -> Result<(), ModelError> {
        let (offsets, cells) = self.node_cells();
        let is_own = |c: u32| self.is_peridynamic(law, self.material_of_cell(c as usize));
        let own = |node: u32| {
            cells[offsets[node as usize] as usize..offsets[node as usize + 1] as usize]
                .iter()
                .any(|&c| is_own(c))
        };
        for (i, (x, carrier)) in cloud.position.iter().zip(&cloud.carrier).enumerate() {
            let PointCarrier::Element(cell, weights) = carrier else {
                continue;
            };
            // a place on the border of the two materials has its weights on nodes of both
            let beyond = !is_own(*cell)
                && self
                    .mesh
                    .cell(*cell as usize)
                    .iter()
                    .zip(weights)
                    .any(|(&n, w)| w.abs() > 1e-9 && !own(n));
            if beyond && counts(i) {
                return Err(ModelError::OtherMaterial {
                    position: x.iter().copied().collect(),
                });
            }
        }
        Ok(())
    }

    /// Refuses a splice of horizons where elements carry a partial stress.
    pub(crate) fn refuse_splice_in_transition(&self, is_spliced: bool) -> Result<(), ModelError> {
        match is_spliced && self.roles.contains(&CellRole::StressElement) {
            true => Err(ModelError::Unsupported {
                what: "a splice of horizons beside elements that carry a partial stress",
                remedy: "leave peridynamics.horizon-change out there: a partial stress lets the horizon vary as it is",
            }),
            false => Ok(()),
        }
    }

    /// Refuses several lattices where bonds do not end on faces, and where two meet.
    pub(crate) fn check_lattices(&self, p: &Peridynamics<D>) -> Result<(), ModelError> {
        let PointSource::Lattices { lattices, .. } = &p.points else {
            return Ok(());
        };
        let meet = self.interface == Interface::OVERLAP && p.is_spliced();
        if self.interface != Interface::FACES && !meet {
            return Err(ModelError::Unsupported {
                what: "several lattices with a coupling that completes families across the seam",
                remedy: "use coupling.truncated, horizon-change = \"splice\" with coupling.splice, or one lattice",
            });
        }
        if p.volumes != PartialVolume::Full {
            return Err(ModelError::Unsupported {
                what: "partial volumes on several lattices",
                remedy: "use full volumes, or one lattice",
            });
        }
        if meet {
            return Ok(());
        }
        let of: Vec<Option<usize>> = (0..self.mesh.cell_count())
            .map(|c| self.lattice_in(&p.points, c))
            .collect();
        for a in 0..lattices.len() {
            for b in a + 1..lattices.len() {
                if !self
                    .mesh
                    .interface_facets(&of, &Some(a), &Some(b))
                    .is_empty()
                {
                    return Err(ModelError::Unsupported {
                        what: "two lattices that meet at a face",
                        remedy: "leave a layer of elements between them, one cell thick",
                    });
                }
            }
        }
        Ok(())
    }

    /// The horizon of each lattice with what a plane through it costs to open, over the square of the critical stretch \[m\], \[J/m²\]: of bonds that break at once ([`crate::peridynamics::plane_energy`]), or that soften
    /// up to `s_c/s_e` ([`crate::peridynamics::softened_plane`]). Points that are no lattice count as one of their spacing.
    ///
    /// # Errors
    /// [`ModelError::Family`] if the law has no coefficients there.
    pub fn plane_energies(&self, softening: Option<f64>) -> Result<Vec<(f64, f64)>, ModelError> {
        let Some(p) = &self.peridynamics else {
            return Ok(Vec::new());
        };
        self.plane_energies_of(p.law.linearised(), softening)
    }

    /// Energy that bonds across a plane take, its mean over the directions of the plane over that along the axes of the lattice, of each lattice.
    ///
    /// # Errors
    /// [`ModelError::Family`] if the law has no coefficients there.
    pub fn mean_over_axis_planes(&self) -> Result<Vec<f64>, ModelError> {
        let Some(p) = &self.peridynamics else {
            return Ok(Vec::new());
        };
        let of = |(factors, horizon): &(Arc<LatticeFactors<D>>, f64)| {
            let family = factors.regular_family(p.law.linearised(), *horizon)?;
            Ok(family.mean_over_axis_planes())
        };
        self.lattices.factors.iter().map(of).collect()
    }

    /// As [`Model::plane_energies`], of a body all of whose points have that law.
    pub fn plane_energies_of(
        &self,
        law: &dyn LinearForceState<D>,
        softening: Option<f64>,
    ) -> Result<Vec<(f64, f64)>, ModelError> {
        let of = |(factors, horizon): &(Arc<LatticeFactors<D>>, f64)| {
            let family = factors.regular_family(law, *horizon)?;
            let at_once = || family.plane_energy();
            let per_square = softening.map_or_else(at_once, |ratio| family.crack_energy(ratio));
            Ok((*horizon, per_square))
        };
        self.lattices.factors.iter().map(of).collect()
    }

    /// Gives a law the constants that follow from the lattice.
    pub(crate) fn calibrate_law(&mut self) -> Result<(), ModelError> {
        let (Some(p), Some(body)) = (&self.peridynamics, self.body()) else {
            return Ok(());
        };
        let Some(law) = p.law.calibrate() else {
            return Ok(());
        };
        let failed = |source| ModelError::Calibration {
            law: p.law.name(),
            source,
        };
        let [(factors, horizon)] = &self.lattices.factors[..] else {
            return Err(failed(CalibrationError::Varies));
        };
        if body.cloud.horizon.uniform().is_none() {
            return Err(failed(CalibrationError::Varies));
        }
        let whole = factors.regular_family(p.law.linearised(), *horizon)?;
        let vectors = whole.vectors();
        let bonds = vectors.iter().map(|(xi, v)| (*xi, whole.of(xi).0 * v));
        let bonds: Vec<_> = bonds.collect();
        let law = law
            .to_lattice(&RegularFamily {
                bonds: &bonds,
                plane_energy: whole.plane_energy(),
                horizon: *horizon,
            })
            .map_err(failed)?;
        if let Some(p) = &mut self.peridynamics {
            p.law = law;
        }
        Ok(())
    }

    /// Spacing of the lattice of a point of the cloud \[m\], of several the point's own.
    pub fn spacing_at(&self, point: u32) -> f64 {
        match self.peridynamics.as_ref().map(|p| &p.points) {
            Some(PointSource::Lattices { lattices, .. }) => {
                lattices[self.lattice_of_point(point)].spacing
            }
            _ => self.spacing(),
        }
    }

    /// The lattice of a point of the cloud; the first where there are not several.
    pub(crate) fn lattice_of_point(&self, point: u32) -> usize {
        let points = self.peridynamics.as_ref().map(|p| &p.points);
        match (points, self.body()) {
            (Some(PointSource::Lattices { .. }), Some(body)) => {
                body.cloud.horizon.lattice_of(point as usize)
            }
            _ => 0,
        }
    }

    /// Returns true if families of one lattice hold both points of the cloud.
    pub(crate) fn are_of_one_lattice(&self, [i, j]: [usize; 2]) -> bool {
        let (Some(p), Some(body)) = (&self.peridynamics, self.body()) else {
            return true;
        };
        let are_several = p.is_spliced() || matches!(p.points, PointSource::Lattices { .. });
        let horizon = &body.cloud.horizon;
        !are_several || horizon.lattice_of(i) == horizon.lattice_of(j)
    }

    /// The lattice whose points a cell holds; none of an element.
    pub(crate) fn lattice_of_cell(&self, cell: usize) -> Option<usize> {
        let points = self.peridynamics.as_ref().map(|p| &p.points)?;
        self.lattice_in(points, cell)
    }

    fn lattice_in(&self, points: &PointSource<D>, cell: usize) -> Option<usize> {
        match points {
            _ if self.roles[cell] != CellRole::Points => None,
            PointSource::Lattices { of_cell, .. } => Some(usize::from(of_cell[cell])),
            _ => Some(0),
        }
    }
}

/// The whole family of each lattice, where bonds are those of regular lattices.
///
/// # Errors
/// [`ModelError::Unsupported`] where they are not, and where lattices have different tensors.
pub(crate) fn whole_families<const D: usize>(
    p: &Peridynamics<D>,
    lattices: &[Arc<LatticeFactors<D>>],
    horizons: &[f64],
    is_regular: bool,
) -> Result<Vec<WholeFamily<D>>, ModelError> {
    let whole = lattices
        .iter()
        .zip(horizons)
        .map(|(lattice, &horizon)| lattice.whole_family(p.law.linearised(), horizon))
        .collect::<Result<Option<Vec<_>>, _>>()?;
    // the faces that cut bonds follow the axes
    let is_regular = is_regular && lattices.iter().all(|l| l.is_axis_parallel());
    let (true, Some(whole)) = (is_regular, whole) else {
        return Err(ModelError::Unsupported {
            what: "a seam of truncated bonds without a regular lattice of one horizon and one weight per shell of bonds",
            remedy: "give peridynamics.points a lattice, a constant horizon and isotropic or plain weights, or couple by splice or blending",
        });
    };
    if whole
        .iter()
        .any(|w| !same_tensor(&w.tensor, &whole[0].tensor))
    {
        return Err(ModelError::Unsupported {
            what: "plain weights on lattices whose elastic tensors differ, as elements between them can have one only",
            remedy: "give all bodies the same horizon over spacing, or use isotropic weights",
        });
    }
    Ok(whole)
}

/// Returns true if two tensors agree to round-off.
fn same_tensor<const D: usize>(a: &Tensor4<D>, b: &Tensor4<D>) -> bool {
    let size = a.get(0, 0, 0, 0).abs();
    (0..D).all(|i| (0..D).all(|j| (a.0[i][j] - b.0[i][j]).amax() <= 1e-9 * size))
}

/// Returns the weighting of the bonds of a body.
pub(crate) fn weighting<'a, const D: usize>(
    p: &Peridynamics<D>,
    factors: &LatticeFactors<D>,
    mixes_horizons: bool,
    shells: &'a (dyn Fn([usize; 2], &Vector<D>) -> f64 + Sync),
) -> Factors<'a, D> {
    match (p.weights, factors.is_lattice()) {
        _ if mixes_horizons => Factors::Shells(shells),
        (BondWeights::Isotropic, true) => Factors::Shells(shells),
        (BondWeights::Plain, true) if factors.has_partial_volumes() => Factors::Shells(shells),
        (BondWeights::Fitted, _) => Factors::Fitted,
        _ => Factors::Plain,
    }
}

/// Returns the extent to which families have to be complete: weights that are fitted family by family differ at both ends of a bond, so that those of the neighbours count too.
pub(crate) fn reach<const D: usize>(coupling: &dyn ZoneLayout<D>, p: &Peridynamics<D>) -> Reach {
    match p.weights {
        BondWeights::Fitted => Reach::Neighbours,
        BondWeights::Plain | BondWeights::Isotropic => coupling.reach(p.law.linearised()),
    }
}
