//! Dilatations of an LPS at the seam: those of points and of the elements behind the faces.

use std::collections::BTreeMap;

use super::segments::{BySite, End, Segments};
use crate::{
    assembly::Row,
    coupling::ModelError,
    fem,
    peridynamics::StatePart,
    tensor::{Tensor, Vector},
};

/// Energies `½ κ F²` of functionals `F = Σ b·u` of the displacement.
pub(super) struct Dilatations<const D: usize> {
    stiffness: Vec<f64>,
    offsets: Vec<usize>,
    entries: Vec<(u32, Vector<D>)>,
    of_site: BySite,
}

/// Whose dilatation a piece changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Carrier {
    Point(u32),
    Cell(u32),
}

/// A functional as it grows: entries by site.
type Functional<const D: usize> = BTreeMap<u32, Vector<D>>;

impl<const D: usize> Dilatations<D> {
    /// Without any.
    pub fn none(sites: usize) -> Self {
        Self {
            stiffness: Vec::new(),
            offsets: vec![0],
            entries: Vec::new(),
            of_site: BySite::new(sites, 0, |_, _| ()),
        }
    }

    /// The dilatations of the elements behind faces, and of all points that `listed` or whose neighbours it names.
    ///
    /// Each piece hands its share, `Segment::hands`, of its elongation to the dilatations at its ends.
    ///
    /// # Errors
    /// [`ModelError::Unsupported`] for a law whose state is more than a dilatation.
    pub fn new(segments: &Segments<'_, D>, listed: &[bool]) -> Result<Self, ModelError> {
        let body = segments.body;
        let volume = &body.cloud.volume;
        let passing = segments.passing;
        let Some(reference) = state_of(segments)? else {
            return Ok(Self::none(segments.model.sites.len()));
        };
        let mut functionals: BTreeMap<Carrier, Functional<D>> = BTreeMap::new();
        let mut carried: BTreeMap<u32, f64> = BTreeMap::new();
        let d = D as f64;
        let over_m: Vec<f64> = passing
            .whole
            .iter()
            .map(|w| d / w.state.as_ref().map_or(f64::NAN, |s| s.shape.trace()))
            .collect();
        // what pieces hand over
        for s in &segments.cut {
            let (i, j) = (s.i as usize, s.j as usize);
            let xi = body.bond(i, j);
            let (from, to) = (s.piece.from, s.piece.to);
            let difference = segments.difference(s);
            for (side, (end, weight)) in s.ends.iter().zip(s.hands).enumerate() {
                let weight = weight * s.piece.share;
                let (own, other) = if side == 0 { (s.i, s.j) } else { (s.j, s.i) };
                let mut add = |carrier: Carrier, factor: f64| {
                    let functional = functionals.entry(carrier).or_default();
                    for &(site, w) in &difference {
                        *functional.entry(site).or_insert_with(Vector::zeros) += xi * (factor * w);
                    }
                };
                match end {
                    End::Point(p) => {
                        let omega = segments.coefficients(own, other).1;
                        add(Carrier::Point(*p), weight * omega * volume[other as usize]);
                    }
                    End::Face(foot) => {
                        let omega = passing.whole_of(s.i).of(&xi).1;
                        let over_m = over_m[usize::from(passing.of_point[i])];
                        let share = weight * over_m * omega * volume[i] * volume[j]
                            / foot.cells.len() as f64;
                        for &cell in &foot.cells {
                            add(Carrier::Cell(cell), share);
                            *carried.entry(cell).or_default() +=
                                share * xi.norm_squared() * (to - from) / d;
                        }
                    }
                }
            }
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
            let (_, omega) = body.kernel(i as usize);
            for (k, &j) in body.families.of(i as usize).iter().enumerate() {
                if segments.is_whole(i, j) {
                    let share = segments.hands(i, j)[0] * omega[k] * volume[j as usize];
                    let b = body.bond(i as usize, j as usize) * share;
                    let other = segments.site[j as usize];
                    *functional.entry(other).or_insert_with(Vector::zeros) += b;
                    *functional.entry(own).or_insert_with(Vector::zeros) -= b;
                }
            }
        }
        let mut found = Self::none(0);
        // K′ of the material, the same for all lattices
        let bulk = reference.modulus.get(0, 0, 0, 0) / (over_m[0] * over_m[0]);
        for (carrier, handed) in functionals {
            match carrier {
                Carrier::Point(i) => {
                    let factor = body
                        .state(i as usize)
                        .map_or(0.0, |state| state.modulus.get(0, 0, 0, 0));
                    found.push(factor * volume[i as usize], &handed);
                }
                Carrier::Cell(cell) => {
                    let mut own = Functional::new();
                    let mut size = 0.0;
                    let mesh = &segments.model.mesh;
                    fem::for_each_point(mesh, cell as usize, fem::Rule::Stiffness, |p| {
                        size += p.weight;
                        for (&n, g) in mesh.cell(cell as usize).iter().zip(&p.gradient) {
                            for (site, w) in segments.model.node_transfer.row(n as usize) {
                                *own.entry(site).or_insert_with(Vector::zeros) +=
                                    g * (w * p.weight);
                            }
                        }
                    });
                    // the element's own energy has this part already
                    found.push(-bulk / size, &own);
                    for (site, b) in handed {
                        *own.entry(site).or_insert_with(Vector::zeros) += b;
                    }
                    // points on a face have half of their cells in the zone: the element carries their dilatation too
                    size += carried.get(&cell).copied().unwrap_or(0.0);
                    found.push(bulk / size, &own);
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
        Ok(found)
    }

    fn push(&mut self, stiffness: f64, functional: &Functional<D>) {
        self.stiffness.push(stiffness);
        self.entries
            .extend(functional.iter().map(|(&site, &b)| (site, b)));
        self.offsets.push(self.entries.len());
    }

    /// Adds the row of a site.
    pub fn add_row(&self, site: usize, row: &mut Row<D>) {
        for &f in self.of_site.of(site) {
            let f = f as usize;
            let entries = &self.entries[self.offsets[f]..self.offsets[f + 1]];
            let Ok(own) = entries.binary_search_by_key(&(site as u32), |e| e.0) else {
                continue;
            };
            let b = entries[own].1 * self.stiffness[f];
            for (other, c) in entries {
                let block: Tensor<D> = b * c.transpose();
                row.add_site(*other, &block);
            }
        }
    }
}

/// The state of the law, if it has one.
///
/// # Errors
/// [`ModelError::Unsupported`] for a law whose state is more than a dilatation.
pub(super) fn state_of<'a, const D: usize>(
    segments: &Segments<'a, D>,
) -> Result<Option<&'a StatePart<D>>, ModelError> {
    let first = segments.passing.whole.first();
    match first.and_then(|w| w.state.as_ref()) {
        Some(state) if !is_volumetric(state) => Err(ModelError::Unsupported {
            what: "a seam of truncated bonds for a law with a state beyond its dilatation",
            remedy: "use an lps or bond-based material, or couple by splice or blending",
        }),
        state => Ok(state),
    }
}

/// Whether the state of a law is its dilatation alone: `𝓜 ∝ I ⊗ I`, no stabilisation.
fn is_volumetric<const D: usize>(state: &StatePart<D>) -> bool {
    let factor = state.modulus.get(0, 0, 0, 0);
    state.stabilisation == 0.0
        && (0..D).all(|i| {
            (0..D).all(|j| {
                let expected = if i == j {
                    Tensor::identity() * factor
                } else {
                    Tensor::zeros()
                };
                (state.modulus.0[i][j] - expected).amax() <= 1e-14 * factor.abs()
            })
        })
}
