//! Dilatations of an LPS at the seam: those of points and of the elements behind the faces.
//!
//! A position-aware solid has two, θ by the influence function ω and θ_σ by σ, with `S = 2 μ Σ σ |ξ|² V` and `B = S θ_σ/D`. Its energy beyond that of its pairs is, with the scalar 𝓜 of its state part,
//!
//! ```text
//! ½ 𝓜 θ² − θ B/D  =  ½ κ θ² + ½ c (θ − θ_σ)² − ½ c θ_σ² ,     c = S/D² ,
//! ```
//!
//! In a whole family `c = (D + 2) μ/D`, so that an affine field has the pressure `K′ θ` of an LPS, `K′ = κ − c`. Pieces contribute to each dilatation as to that of an LPS.

use std::collections::BTreeMap;

use super::bond_segments::{Segment, Segments};
use crate::coupling::truncated::lps_constants::Carrier;
use crate::coupling::truncated::lps_constants::{
    Kernel, LpsConstants, deviatoric_of, stiffness_of_point,
};
use crate::coupling::truncated::springs::BySite;
use crate::{
    assembly::{Centre, Row},
    fem,
    tensor::{Tensor, Vector},
};

/// Energies `½ κ F²` of functionals `F = Σ b·u` of the displacement.
pub(super) struct Dilatations<const D: usize> {
    stiffness: Vec<f64>,
    offsets: Vec<usize>,
    entries: Vec<(u32, Vector<D>)>,
    /// True for those that only subtract what an element's own energy contains already.
    taken_back: Vec<bool>,
    /// The point or the element of each.
    centre: Vec<Centre>,
    of_site: BySite,
}

/// Coefficients b of a functional `Σ b·u`, by site.
pub(super) type Functional<const D: usize> = BTreeMap<u32, Vector<D>>;

/// Returns the contribution of a share of a piece's elongation to the volume that an element counts as its own: points on a face have half of their cells in the zone, the element carries their dilatation too.
pub(super) fn carried<const D: usize>(segments: &Segments<'_, D>, s: &Segment, share: f64) -> f64 {
    let xi = segments.body.bond(s.i as usize, s.j as usize);
    share * xi.norm_squared() * (s.piece.to - s.piece.from) / D as f64
}

/// `∫ div u` over an element, and its size.
pub(super) fn divergence<const D: usize>(
    segments: &Segments<'_, D>,
    cell: u32,
) -> (Functional<D>, f64) {
    let mut own = Functional::new();
    let mut size = 0.0;
    let mesh = &segments.model.mesh;
    fem::for_each_point(mesh, cell as usize, fem::Rule::Stiffness, |p| {
        size += p.weight;
        for (&n, g) in mesh.cell(cell as usize).iter().zip(&p.gradient) {
            for (site, w) in segments.model.node_transfer.row(n as usize) {
                *own.entry(site).or_insert_with(Vector::zeros) += g * (w * p.weight);
            }
        }
    });
    (own, size)
}

impl<const D: usize> Dilatations<D> {
    /// Without any.
    pub fn none(sites: usize) -> Self {
        Self {
            stiffness: Vec::new(),
            offsets: vec![0],
            entries: Vec::new(),
            taken_back: Vec::new(),
            centre: Vec::new(),
            of_site: BySite::new(sites, 0, |_, _| ()),
        }
    }

    /// The dilatations of the elements behind faces, and of all points that `listed` or whose neighbours it names.
    ///
    /// Each piece contributes its elongation, times `Segment::hands`, to the dilatations at its ends.
    pub fn new(segments: &Segments<'_, D>, common: &LpsConstants, listed: &[bool]) -> Self {
        let (functionals, volumes) = handed(Kernel::Volumetric, segments, common, listed);
        let other =
            (common.deviatoric).map(|c| (c, handed(Kernel::Deviatoric, segments, common, listed)));
        let mut found = Self::none(0);
        for (carrier, handed) in functionals {
            let of_other = other
                .as_ref()
                .map(|(c, (functionals, volumes))| (*c, &functionals[&carrier], volumes));
            let centre = match carrier {
                Carrier::Point(i) => Centre::Site(segments.site[i as usize]),
                Carrier::Cell(cell) => Centre::Cell(cell),
            };
            match carrier {
                Carrier::Point(i) => {
                    let stiffness = stiffness_of_point(segments, i);
                    match of_other {
                        None => found.push(centre, stiffness, &handed, false),
                        Some((_, other, _)) => {
                            let state = segments.body.state(i as usize);
                            let c = state.and_then(deviatoric_of).unwrap_or(0.0)
                                * segments.body.cloud.volume[i as usize];
                            found.push_two(
                                centre,
                                [stiffness - c, c],
                                [(&handed, 1.0), (other, 1.0)],
                            );
                        }
                    }
                }
                Carrier::Cell(cell) => {
                    let (own, size) = divergence(segments, cell);
                    found.push(centre, -common.bulk / size, &own, true);
                    let whole = |handed: &Functional<D>, volumes: &BTreeMap<u32, f64>| {
                        let size = size + volumes.get(&cell).copied().unwrap_or(0.0);
                        (combined(&own, handed, 1.0), size)
                    };
                    let (first, size) = whole(&handed, &volumes);
                    match of_other {
                        None => found.push(centre, common.bulk / size, &first, false),
                        Some((c, other, volumes)) => {
                            // points on a face contribute different volumes to the two
                            let (other, other_size) = whole(other, volumes);
                            found.push_two(
                                centre,
                                [common.bulk + c, c],
                                [(&first, size), (&other, other_size)],
                            );
                        }
                    }
                }
            }
        }
        let (offsets, entries) = (&found.offsets, &found.entries);
        found.of_site = BySite::new(
            segments.model.sites.len(),
            found.stiffness.len(),
            |row, visit| {
                entries[offsets[row]..offsets[row + 1]]
                    .iter()
                    .for_each(|e| visit(e.0));
            },
        );
        found
    }

    /// `½ κ θ² + ½ c (θ − θ_σ)² − ½ c θ_σ²` of the integrals of θ and θ_σ over these volumes.
    fn push_two(
        &mut self,
        centre: Centre,
        [kappa, c]: [f64; 2],
        [theta, sigma]: [(&Functional<D>, f64); 2],
    ) {
        let [size, other] = [theta.1, sigma.1];
        self.push(centre, kappa / size, theta.0, false);
        let difference = combined(theta.0, sigma.0, -size / other);
        self.push(centre, c / size, &difference, false);
        self.push(centre, -c / other, sigma.0, false);
    }

    /// Returns true if no energy is negative but those that an element has already: the volume that pieces add to an element may be negative.
    pub fn is_positive(&self) -> bool {
        let all = self.stiffness.iter().zip(&self.taken_back);
        all.filter(|(_, back)| !**back).all(|(k, _)| *k >= 0.0)
    }

    fn push(
        &mut self,
        centre: Centre,
        stiffness: f64,
        functional: &Functional<D>,
        taken_back: bool,
    ) {
        self.centre.push(centre);
        self.stiffness.push(stiffness);
        self.taken_back.push(taken_back);
        self.entries
            .extend(functional.iter().map(|(&site, &b)| (site, b)));
        self.offsets.push(self.entries.len());
    }

    /// Adds the row of a site.
    pub fn add_row(&self, site: usize, row: &mut Row<D>) {
        self.add_row_of(site, |_| true, row);
    }

    /// Adds to the row of a site only the terms that subtract the elements' own dilatations.
    pub fn take_back(&self, site: usize, row: &mut Row<D>) {
        self.add_row_of(site, |f| self.taken_back[f], row);
    }

    fn add_row_of(&self, site: usize, counts: impl Fn(usize) -> bool, row: &mut Row<D>) {
        let own = self.of_site.of(site).iter().map(|&f| f as usize);
        for f in own.filter(|&f| counts(f)) {
            let entries = &self.entries[self.offsets[f]..self.offsets[f + 1]];
            let Ok(own) = entries.binary_search_by_key(&(site as u32), |e| e.0) else {
                continue;
            };
            let b = entries[own].1 * self.stiffness[f];
            let add = |row: &mut Row<D>| {
                for (other, c) in entries {
                    let block: Tensor<D> = b * c.transpose();
                    row.add_site(*other, &block);
                }
            };
            row.part(|| Some(self.centre[f]), add);
        }
    }
}

/// A functional and some of another.
fn combined<const D: usize>(
    first: &Functional<D>,
    second: &Functional<D>,
    factor: f64,
) -> Functional<D> {
    let mut sum = first.clone();
    for (&site, b) in second {
        *sum.entry(site).or_insert_with(Vector::zeros) += b * factor;
    }
    sum
}

/// Returns the contributions of pieces, and of the whole bonds of the points around, to the dilatations of one influence function, and the volumes that elements count as their own.
fn handed<const D: usize>(
    kernel: Kernel,
    segments: &Segments<'_, D>,
    common: &LpsConstants,
    listed: &[bool],
) -> (BTreeMap<Carrier, Functional<D>>, BTreeMap<u32, f64>) {
    let body = segments.body;
    let volume = &body.cloud.volume;
    let mut functionals: BTreeMap<Carrier, Functional<D>> = BTreeMap::new();
    let mut volumes: BTreeMap<u32, f64> = BTreeMap::new();
    for s in &segments.cut {
        let xi = body.bond(s.i as usize, s.j as usize);
        let difference: Vec<(u32, f64)> = segments.difference(s).collect();
        common.shares_of(kernel, segments, s, |carrier, factor| {
            let functional = functionals.entry(carrier).or_default();
            for &(site, w) in &difference {
                *functional.entry(site).or_insert_with(Vector::zeros) += xi * (factor * w);
            }
            if let Carrier::Cell(cell) = carrier {
                *volumes.entry(cell).or_default() += carried(segments, s, factor);
            }
        });
    }
    // whole bonds of the points around
    let mut needed = vec![false; segments.site.len()];
    for i in 0..needed.len() {
        if segments.is_point(i as u32) && listed[i] {
            needed[i] = true;
            for &j in body.families.of(i) {
                needed[j as usize] |= segments.is_point(j);
            }
        }
    }
    for i in (0..needed.len() as u32).filter(|&i| needed[i as usize]) {
        let functional = functionals.entry(Carrier::Point(i)).or_default();
        let own = segments.site[i as usize];
        let (pair, omega) = body.kernel(i as usize);
        let normal = kernel.of_point(body.state(i as usize));
        for (k, &j) in body.families.of(i as usize).iter().enumerate() {
            if segments.is_whole(i, j) {
                let xi = body.bond(i as usize, j as usize);
                let weight = kernel.of_bond((pair[k], omega[k]), &xi) * normal;
                let share = segments.hands(i, j)[0] * weight * volume[j as usize];
                let b = xi * share;
                let other = segments.site[j as usize];
                *functional.entry(other).or_insert_with(Vector::zeros) += b;
                *functional.entry(own).or_insert_with(Vector::zeros) -= b;
            }
        }
    }
    (functionals, volumes)
}
