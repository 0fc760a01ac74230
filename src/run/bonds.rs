//! Bonds of peridynamic points as lines: the points at their ends with displacements, and of each bond its length, its stretch and the state of failure.
//!
//! A bond between two points is one line, whichever family holds it. Bonds into elements are no lines: a seam weights or cuts them, and nothing tells
//! which of them has failed. Nor are those that cracks and voids of the scene cut beforehand, which belong to no family.

use rustc_hash::FxHashMap;

use super::error::RunError;
use super::intact::Intact;
use super::solution::Solved;
use crate::mesh::CellShape;
use crate::model::{Model, SiteKind};
use crate::observe::report::grouped;
use crate::observe::summary::{Decision, bytes_text};
use crate::observe::vtu::{Field, Snapshot};
use crate::peridynamics::{PdBody, TIE_TOLERANCE};
use crate::scene::bond_output::{BondOwners, BondSelection};
use crate::scene::validated::Output;
use crate::system::Ranks;
use crate::tensor::{Vector, padded};

/// Bytes of a bond while its file is encoded: two ends, type and offset, three fields, their copies and texts.
const BOND_BYTES: u64 = 160;

/// Bytes of a bond in its file, in base 64 and before compression: two ends of 8, an offset of 8, a type, two reals, a label.
const BYTES_IN_FILE: u64 = 42 * 4 / 3;

/// Bonds that a selection names, each once, by the points at its ends.
fn pairs<'a, const D: usize>(
    model: &Model<D>,
    body: &'a PdBody<D>,
    selection: &'a BondSelection<D>,
) -> impl Iterator<Item = [u32; 2]> + 'a {
    let (cloud, families) = (&body.cloud, &body.families);
    let mut is_point = vec![false; cloud.position.len()];
    for site in &model.sites {
        if let SiteKind::Point(p) = site.kind {
            is_point[p as usize] = true;
        }
    }
    let owns: Box<dyn Fn(usize) -> bool> = match &selection.of {
        BondOwners::Inside(region) => Box::new(|p| region.contains(&cloud.position[p], 0.0)),
        BondOwners::Nearest(at) => {
            let apart = |p: usize| (cloud.position[p] - at).norm();
            let points = (0..is_point.len()).filter(|&p| is_point[p]);
            let nearest = points.min_by(|&p, &q| apart(p).total_cmp(&apart(q)));
            let reach = |p: usize| cloud.horizon.of(p) * (1.0 + TIE_TOLERANCE);
            let nearest = nearest.filter(|&p| apart(p) <= reach(p));
            Box::new(move |p| nearest == Some(p))
        }
    };
    let owned: Vec<bool> = (0..cloud.position.len()).map(owns).collect();
    let held_by = |p: u32, q: u32| {
        let has_family = (q as usize) < families.len();
        has_family && families.of(q as usize).binary_search(&p).is_ok()
    };
    let all = (0..families.len() as u32)
        .flat_map(|p| families.of(p as usize).iter().map(move |&q| [p, q]));
    // where the families of both ends hold a bond, that of the lower number tells
    all.filter(move |&[p, q]| {
        let (i, j) = (p as usize, q as usize);
        is_point[i] && is_point[j] && (owned[i] || owned[j]) && (p < q || !held_by(p, q))
    })
}

/// Refuses bonds on several processes, and a selection without a bond.
///
/// # Errors
/// [`RunError::Later`], [`RunError::NoBonds`].
pub(crate) fn check<const D: usize>(
    model: &Model<D>,
    output: &Output<D>,
    ranks: Option<&dyn Ranks>,
) -> Result<(), RunError> {
    if output.bonds.is_empty() {
        return Ok(());
    }
    if ranks.is_some_and(|ranks| ranks.count() > 1) {
        return Err(RunError::Later {
            what: "output.bonds on several processes",
            remedy: "run the scene in one process, or leave output.bonds out",
        });
    }
    for (selection, count) in counts(model, output) {
        if count == 0 {
            return Err(RunError::NoBonds {
                selection: selection.name.clone(),
                remedy: match (&selection.of, model.body()) {
                    (_, None) => {
                        "the model has no peridynamic points: leave it out, or draw a nonlocal zone"
                    }
                    (BondOwners::Inside(_), _) => {
                        "no peridynamic point lies inside: move the shape into the nonlocal zone"
                    }
                    (BondOwners::Nearest(_), _) => {
                        "no peridynamic point lies within a horizon of the probe: move it into the nonlocal zone"
                    }
                },
            });
        }
    }
    Ok(())
}

/// The number of bonds of each selection.
fn counts<'a, const D: usize>(
    model: &'a Model<D>,
    output: &'a Output<D>,
) -> impl Iterator<Item = (&'a BondSelection<D>, usize)> {
    let count = |selection| {
        model
            .body()
            .map_or(0, |body| pairs(model, body, selection).count())
    };
    output.bonds.iter().map(move |s| (s, count(s)))
}

/// Says how many bonds each selection has, and how large its files become.
pub(super) fn told<const D: usize>(model: &Model<D>, output: &Output<D>) -> Vec<Decision> {
    let one = |(selection, count): (&BondSelection<D>, usize)| Decision {
        choice: format!(
            "{} bonds in output.bonds.{}",
            grouped(count),
            selection.name
        ),
        why: format!(
            "at most {} a file",
            bytes_text(BYTES_IN_FILE * count as u64)
        ),
    };
    counts(model, output).map(one).collect()
}

/// Memory of the largest selection while its file is encoded \[bytes\].
pub(crate) fn bytes<const D: usize>(model: &Model<D>, output: &Output<D>) -> u64 {
    let largest = counts(model, output).map(|(_, count)| count).max();
    BOND_BYTES * largest.unwrap_or(0) as u64
}

/// The bonds of a selection as lines, with the displacements of their ends.
///
/// Of a bond ξ whose ends move apart by η the stretch is `(|ξ + η| − |ξ|) / |ξ|`, as in [SAND2015-7998] eq. (3.1), computed as
/// `(2 ξ·η + η·η) / (|ξ| (|ξ + η| + |ξ|))`, which keeps the digits of small displacements.
///
/// Units: length \[m\], stretch \[1\]; broken is 1 for a bond that has failed, else 0.
pub(super) fn snapshot<const D: usize>(
    solved: &Solved<'_, D>,
    selection: &BondSelection<D>,
    origin: &str,
) -> Snapshot {
    let mut lines = Snapshot {
        origin: origin.to_owned(),
        ..Snapshot::default()
    };
    let Some(body) = solved.model.body() else {
        return lines;
    };
    let intact = Intact::of(solved);
    let mut number: FxHashMap<u32, u32> = FxHashMap::default();
    let mut moved: Vec<Vector<D>> = Vec::new();
    let (mut length, mut stretch, mut broken) = (Vec::new(), Vec::new(), Vec::new());
    for ends in pairs(solved.model, body, selection) {
        let own = ends.map(|p| {
            *number.entry(p).or_insert_with(|| {
                let p = p as usize;
                lines.points.push(padded(&body.cloud.position[p]));
                moved.push(body.cloud.transfer.displacement(p, solved.displacement));
                moved.len() as u32 - 1
            })
        });
        lines.push_cell(CellShape::Line2, &own);
        let [i, j] = ends.map(|p| p as usize);
        let xi = body.bond(i, j);
        let eta = moved[own[1] as usize] - moved[own[0] as usize];
        let (before, after) = (xi.norm(), (xi + eta).norm());
        length.push(before);
        stretch.push((2.0 * xi.dot(&eta) + eta.dot(&eta)) / (before * (after + before)));
        broken.push(u8::from(!intact.is_intact(i, j) || !intact.is_intact(j, i)));
    }
    lines.point_fields = vec![Field::vector("displacement", &moved)];
    lines.cell_fields = vec![
        Field::scalar("length", length),
        Field::scalar("stretch", stretch),
        Field::labels("broken", broken),
    ];
    lines
}
