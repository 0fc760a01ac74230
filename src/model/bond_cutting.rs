//! Bonds that voids, cracks and holes cut, and the weights of those of a lattice.

use rustc_hash::FxHashSet;

use crate::{
    fem,
    mesh::{Mesh, boundary::BoundaryFacet, visibility::SegmentCutter},
    model::{ModelError, Peridynamics, PointSource, bins::bin_of, point_cloud::PointCloud},
    parallel,
    peridynamics::{
        BondHorizon, BondWeights, Families, Family, LatticeBonds, LinearForceState, PartialVolume,
        StatePart, TIE_TOLERANCE, collapsed_tensor, isotropic_shell_factors,
        offset_table::OffsetTable,
        partial_volume::lattice_shells,
        plane_energy,
        softened_plane::{StateBonds, crack_energy},
    },
    shape::{Barrier, Barriers},
    tensor::{Tensor, Tensor4, Vector},
};

/// Removes the bonds that barriers or facets cut; `reach` is the largest horizon.
pub(crate) fn cut<const D: usize>(
    barriers: &[Barrier<D>],
    mesh: &Mesh<D>,
    surface: Option<Vec<BoundaryFacet>>,
    reach: f64,
    position: &[Vector<D>],
    families: &mut Families,
) {
    let barriers = Barriers::new(barriers.to_vec());
    let cutter = surface
        .as_ref()
        .map(|facets| SegmentCutter::new(mesh, facets));
    let cutter = cutter.filter(|cutter| !cutter.is_convex_around(position));
    // bodies that touch have no facet between them that a bond through a node would meet
    let bodies = surface.as_ref().and_then(|_| bodies_of(mesh, position));
    if barriers.is_empty() && cutter.is_none() && bodies.is_none() {
        return;
    }
    // a bond crosses a facet only if both of its ends are within its length of it
    let facets = surface.filter(|_| cutter.is_some());
    let bins = facets.map(|facets| NearBins::new(mesh, &facets, reach));
    let near: Vec<bool> = parallel::map_slice(position, |x| {
        bodies.is_some() || barriers.near(x, reach) || bins.as_ref().is_some_and(|b| b.contains(x))
    });
    let is_apart = |i: usize, j: usize| {
        let of = bodies.as_ref().map(|bodies| (bodies[i], bodies[j]));
        matches!(of, Some((Some(a), Some(b))) if a != b)
    };
    families.retain_of(
        |i| near[i],
        |i, j| {
            let j = j as usize;
            if !near[j] {
                return true;
            }
            let (a, b) = (&position[i], &position[j]);
            !is_apart(i, j)
                && !barriers.cuts(a, b)
                && !cutter.as_ref().is_some_and(|c| c.cuts(a, b))
        },
    );
}

/// The body of each position in the mesh; none of a mesh that is one body.
fn bodies_of<const D: usize>(mesh: &Mesh<D>, position: &[Vector<D>]) -> Option<Vec<Option<u32>>> {
    let of_node = mesh.bodies();
    let of_cell = |c: usize| of_node[mesh.cell(c)[0] as usize];
    if (0..mesh.cell_count()).all(|c| of_cell(c) == of_cell(0)) {
        return None;
    }
    let cells = fem::Locator::new(mesh, 0..mesh.cell_count());
    Some(parallel::map_slice(position, |x| {
        let located = cells.locate(mesh, x, 1e-9);
        located.map(|located| of_cell(located.cell))
    }))
}

/// Bins of the size of a horizon in or beside which facets lie.
struct NearBins<const D: usize> {
    size: f64,
    bins: FxHashSet<[i64; D]>,
}

impl<const D: usize> NearBins<D> {
    fn new(mesh: &Mesh<D>, facets: &[BoundaryFacet], size: f64) -> Self {
        let mut bins = FxHashSet::default();
        for facet in facets {
            let (low, high) = mesh.bounds_of(&facet.nodes);
            let margin = Vector::repeat(size * (1.0 + 1e-6));
            let (from, to) = (
                bin_of(&(low - margin), size),
                bin_of(&(high + margin), size),
            );
            let counts: [usize; D] = std::array::from_fn(|i| (to[i] - from[i] + 1) as usize);
            for index in 0..counts.iter().product::<usize>() {
                let mut rest = index;
                bins.insert(std::array::from_fn(|i| {
                    let k = rest % counts[i];
                    rest /= counts[i];
                    from[i] + k as i64
                }));
            }
        }
        Self { size, bins }
    }

    fn contains(&self, x: &Vector<D>) -> bool {
        self.bins.contains(&bin_of(x, self.size))
    }
}

/// Bond factors of a lattice, shell by shell, for every horizon in use: the weight of the shell times the share of the far cell.
pub(crate) struct LatticeFactors<const D: usize> {
    /// By the bits of the horizon, ascending.
    tables: Vec<(u64, OffsetTable<f64, D>)>,
    spacing: f64,
    /// Axes of the lattice, as columns; none for scattered points.
    axes: Option<Tensor<D>>,
    volumes: PartialVolume,
}

impl<const D: usize> LatticeFactors<D> {
    /// Factors for the horizons of a cloud; without effect unless the points are a lattice's, and the weights isotropic or the volumes partial.
    pub fn new(p: &Peridynamics<D>, cloud: &PointCloud<D>) -> Result<Self, ModelError> {
        let mut factors = Self {
            tables: Vec::new(),
            spacing: cloud.spacing,
            axes: cloud.axes,
            volumes: p.volumes,
        };
        let isotropic = p.weights == BondWeights::Isotropic;
        if factors.has_partial_volumes() {
            let regular =
                cloud.is_axis_parallel() && matches!(p.points, PointSource::Lattice { .. });
            if !regular || p.weights == BondWeights::Fitted {
                return Err(ModelError::Unsupported {
                    what: "a partial volume without a lattice, or with fitted weights",
                    remedy: "give peridynamics.points a lattice and isotropic or plain weights, or leave out peridynamics.volumes",
                });
            }
        } else if cloud.axes.is_none() || !isotropic {
            return Ok(factors);
        }
        let mut horizons: Vec<u64> = cloud.horizon.values().iter().map(|d| d.to_bits()).collect();
        horizons.sort_unstable();
        horizons.dedup();
        for bits in horizons {
            let horizon = f64::from_bits(bits);
            let (lattice, shares) =
                lattice_shells::<D>(p.volumes, horizon / cloud.spacing, TIE_TOLERANCE)?;
            let weights = match p.law.linearised().shell_target().filter(|_| isotropic) {
                Some(target) => {
                    let base: Vec<f64> = lattice
                        .shells
                        .iter()
                        .zip(&shares)
                        .map(|(s, share)| {
                            share * p.law.linearised().kernel(s.length(cloud.spacing), horizon)
                        })
                        .collect();
                    isotropic_shell_factors(&lattice, cloud.spacing, &base, target)?
                }
                None => vec![1.0; shares.len()],
            };
            let mut known = Vec::new();
            for ((shell, weight), share) in lattice.shells.iter().zip(weights).zip(shares) {
                known.extend(shell.offsets.iter().map(|k| (*k, weight * share)));
            }
            factors.tables.push((bits, OffsetTable::new(&known)));
        }
        Ok(factors)
    }

    /// Returns true if the points are those of a lattice, whatever its axes.
    pub fn is_lattice(&self) -> bool {
        self.axes.is_some()
    }

    /// Returns true if the points are those of a lattice along the coordinate axes.
    pub fn is_axis_parallel(&self) -> bool {
        self.axes == Some(Tensor::identity())
    }

    /// Integer offset of a bond, along the axes of the lattice.
    fn offset(&self, xi: &Vector<D>) -> [i32; D] {
        match &self.axes {
            Some(axes) if !self.is_axis_parallel() => offset_of(&axes.tr_mul(xi), self.spacing),
            _ => offset_of(xi, self.spacing),
        }
    }

    /// Returns true if cells may count in part.
    pub fn has_partial_volumes(&self) -> bool {
        self.volumes != PartialVolume::Full
    }

    /// Removes the bonds to cells of which nothing counts.
    pub fn drop_without_share(
        &self,
        bond_horizon: BondHorizon,
        cloud: &PointCloud<D>,
        families: &mut Families,
    ) {
        if self.has_partial_volumes() {
            let x = &cloud.position;
            families.retain(|i, j| {
                let horizon = bond_horizon.of([i, j as usize], &cloud.horizon);
                self.factor(horizon, &(x[j as usize] - x[i]))
                    .is_some_and(|factor| factor > 0.0)
            });
        }
    }

    /// The factor of a bond; none for a horizon that no point of the lattice has.
    pub fn factor(&self, horizon: f64, xi: &Vector<D>) -> Option<f64> {
        let bits = horizon.to_bits();
        let place = self.tables.binary_search_by_key(&bits, |t| t.0).ok()?;
        let known = self.tables[place].1.of(&self.offset(xi));
        // an isotropic table lacks no bond of its family; a table of shares lacks those to cells of which nothing counts
        let other = if self.has_partial_volumes() { 0.0 } else { 1.0 };
        Some(known.unwrap_or(other))
    }

    /// The whole family of a lattice point with the coefficients that the law gives it; none without a lattice.
    pub fn whole_family(
        &self,
        law: &dyn LinearForceState<D>,
        horizon: f64,
    ) -> Result<Option<WholeFamily<D>>, ModelError> {
        self.is_lattice()
            .then(|| self.regular_family(law, horizon))
            .transpose()
    }

    /// The whole family of a point of a regular lattice of the same spacing and horizon, with the coefficients of a law: the lattice's own if the points are one.
    pub fn bonds(
        &self,
        law: &dyn LinearForceState<D>,
        horizon: f64,
    ) -> Result<(LatticeBonds<D>, Tensor4<D>), ModelError> {
        let axes = self.axes.unwrap_or_else(Tensor::identity);
        let (lattice, _) =
            lattice_shells::<D>(self.volumes, horizon / self.spacing, TIE_TOLERANCE)?;
        let bonds: Vec<Vector<D>> = lattice
            .shells
            .iter()
            .flat_map(|s| {
                s.offsets
                    .iter()
                    .map(|k| axes * Vector::<D>::from_fn(|i, _| f64::from(k[i]) * self.spacing))
            })
            .collect();
        let volumes = vec![self.spacing.powi(D as i32); bonds.len()];
        let factors: Vec<f64> = bonds
            .iter()
            .map(|xi| self.factor(horizon, xi).unwrap_or(1.0))
            .collect();
        let family = Family {
            bonds: &bonds,
            volumes: &volumes,
            factors: &factors,
            horizon,
            bond_horizons: &[],
            materials: None,
        };
        let (mut pair, mut omega) = (vec![0.0; bonds.len()], vec![0.0; bonds.len()]);
        let state = law
            .coefficients(&family, &mut pair, &mut omega)
            .map_err(|source| ModelError::Family {
                what: "a point of the full lattice",
                position: vec![0.0; D],
                bonds: bonds.len(),
                source,
            })?;
        let tensor = collapsed_tensor(&family, &pair, state.as_ref());
        let bonds = LatticeBonds {
            bonds,
            volumes,
            pair,
            omega,
            state,
        };
        Ok((bonds, tensor))
    }

    /// The whole family of a point of such a lattice by its integer offsets.
    pub fn regular_family(
        &self,
        law: &dyn LinearForceState<D>,
        horizon: f64,
    ) -> Result<WholeFamily<D>, ModelError> {
        let (family, tensor) = self.bonds(law, horizon)?;
        let coefficients = family.pair.iter().zip(&family.omega);
        let mut bonds: Vec<_> = (family.bonds.iter())
            .zip(coefficients)
            .map(|(xi, (&p, &w))| (self.offset(xi), (p, w)))
            .collect();
        bonds.sort_unstable_by_key(|b| b.0);
        Ok(WholeFamily {
            spacing: self.spacing,
            coefficients: OffsetTable::new(&bonds),
            bonds,
            state: family.state,
            tensor,
        })
    }
}

/// Integer offset of a lattice's bond.
fn offset_of<const D: usize>(xi: &Vector<D>, spacing: f64) -> [i32; D] {
    std::array::from_fn(|i| (xi[i] / spacing).round() as i32)
}

/// The family of a lattice point far from all surfaces, with its coefficients.
pub(crate) struct WholeFamily<const D: usize> {
    /// Spacing of the lattice.
    pub spacing: f64,
    bonds: Vec<([i32; D], (f64, f64))>,
    coefficients: OffsetTable<(f64, f64), D>,
    /// The state part of the law, if it has one.
    pub state: Option<StatePart<D>>,
    /// The classical tensor that the family carries.
    pub tensor: Tensor4<D>,
}

impl<const D: usize> WholeFamily<D> {
    /// `G0/s_c²` of a plane between two layers, [`plane_energy`].
    pub fn plane_energy(&self) -> f64 {
        let (state, deviator) = self
            .state
            .as_ref()
            .map_or((0.0, 0.0), |s| (s.modulus.get(0, 0, 0, 0), s.deviator));
        plane_energy(self.spacing, &self.bonds, state, deviator)
    }

    /// `G0/s_0²` of a crack whose bonds soften up to `s_c/s_e = ratio`, [`crack_energy`].
    pub fn crack_energy(&self, ratio: f64) -> f64 {
        let modulus = |s: &StatePart<D>| s.modulus.get(0, 0, 0, 0);
        let bonds = StateBonds {
            spacing: self.spacing,
            bonds: &self.bonds,
            state: self.state.as_ref().map_or(0.0, modulus),
            tensor: &self.tensor,
        };
        crack_energy(&bonds, ratio)
    }

    /// Energy that bonds which act alone take across a plane, `Σ ½ |ξ·n| p |ξ|⁴ V`, its mean over all normals over that over the axes.
    pub fn mean_over_axis_planes(&self) -> f64 {
        // mean of |cos| over the directions of a bond
        let mean_cosine = [1.0, std::f64::consts::FRAC_2_PI, 0.5][D - 1];
        let (mut over_all, mut over_axes) = (0.0, 0.0);
        for (k, (p, _)) in &self.bonds {
            let square = f64::from(k.iter().map(|k| k * k).sum::<i32>());
            let energy = p * square * square;
            let steps: i32 = k.iter().map(|k| k.abs()).sum();
            over_all += energy * mean_cosine * square.sqrt();
            over_axes += energy * f64::from(steps) / D as f64;
        }
        over_all / over_axes
    }

    /// All bonds by their integer offsets, in their order, with `p` and `ω`.
    pub fn bonds(&self) -> impl Iterator<Item = ([i32; D], (f64, f64))> + '_ {
        self.bonds.iter().copied()
    }

    /// The bond vectors, each with the volume of a whole cell.
    pub fn vectors(&self) -> Vec<(Vector<D>, f64)> {
        let volume = self.spacing.powi(D as i32);
        self.bonds
            .iter()
            .map(|(k, _)| {
                let xi = Vector::from_fn(|i, _| f64::from(k[i]) * self.spacing);
                (xi, volume)
            })
            .collect()
    }

    /// The coefficients `p` and `ω` of a bond; zero for one that the lattice does not have.
    pub fn of(&self, xi: &Vector<D>) -> (f64, f64) {
        self.coefficients
            .of(&offset_of(xi, self.spacing))
            .unwrap_or((0.0, 0.0))
    }
}
