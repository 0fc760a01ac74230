//! A lattice of points in a padded box, and its families as one stencil.

use super::{
    BondSetup,
    simd::LANES,
    stencil_numbers::{Numbers, numbers},
};
use crate::{parallel, peridynamics::offset_table::OffsetTable, tensor::Vector};
use rayon::prelude::*;

/// Largest distance of a point from its lattice site, in parts of the spacing.
const TOLERANCE: f64 = 1e-9;

/// Cells of the box per point, and lanes per point with a family, above which lists are better.
const SPARSEST_BOX: usize = 12;
const SPARSEST_LANES: usize = 3;

/// Rows and groups of eight of a tile: two to three tiles' width of 2m + 1 planes stay in the second-level cache.
const TILE_ROWS: usize = 16;
const TILE_GROUPS: usize = 32;

/// No cell, point or group.
pub(super) const NONE: u32 = u32::MAX;

/// One bond of the stencil.
#[derive(Clone, Copy, Debug)]
pub(super) struct Offset<const D: usize> {
    /// From a cell to its neighbour in the flat box.
    pub delta: isize,
    /// ξ.
    pub xi: [f64; D],
    /// 2 ξ, and 2 ξ/r².
    pub twice: [f64; D],
    pub slope: [f64; D],
    /// r², 1/r².
    pub square: f64,
    pub inverse: f64,
    /// `2 p r² V` or `ω V` with the lattice's own V, and that times r².
    pub weight: f64,
    pub moment: f64,
    /// Value of `t` beyond which the bond breaks.
    pub limit: f64,
}

impl<const D: usize> Offset<D> {
    /// The bond to the neighbour `steps` away.
    pub(super) fn new(
        steps: [i32; D],
        spacing: [f64; D],
        delta: isize,
        weight: f64,
        limit: f64,
    ) -> Self {
        let xi: [f64; D] = std::array::from_fn(|a| f64::from(steps[a]) * spacing[a]);
        let square: f64 = xi.iter().map(|x| x * x).sum();
        Self {
            delta,
            xi,
            twice: xi.map(|x| 2.0 * x),
            slope: xi.map(|x| 2.0 * x / square),
            square,
            inverse: 1.0 / square,
            weight,
            moment: weight * square,
            limit,
        }
    }
}

/// The box: cells in rows along x, each padded to whole groups of eight and to the reach of the stencil.
#[derive(Clone, Debug)]
pub(super) struct Box3 {
    pub counts: [usize; 3],
    /// Cells from row to row and from plane to plane.
    pub row: usize,
    pub plane: usize,
    /// Cell of site (0, 0, 0), a multiple of eight.
    pub first: usize,
    /// Cells in all.
    pub cells: usize,
}

impl Box3 {
    pub(super) fn new(counts: [usize; 3], reach: [usize; 3]) -> Self {
        // the padding of one row is that of the next one, too; odd multiples of eight cells keep rows and planes from falling on the same cache sets
        let odd = |n: usize| n.div_ceil(LANES) | 1;
        let row = odd(counts[0].next_multiple_of(LANES) + reach[0]) * LANES;
        let rows = (counts[1] + reach[1]) | 1;
        let plane = row * rows;
        let before = reach[2] * plane + reach[1] * row + reach[0].next_multiple_of(LANES);
        Self {
            counts,
            row,
            plane,
            first: before,
            cells: before + counts[2] * plane + reach[2] * plane + reach[1] * row + row,
        }
    }

    pub(super) fn cell(&self, site: [usize; 3]) -> usize {
        self.first + site[2] * self.plane + site[1] * self.row + site[0]
    }

    /// The aligned cells of eight sites along x each, tile by tile, along the slowest axis first within a tile.
    fn groups(&self) -> impl Iterator<Item = usize> + '_ {
        let across = self.counts[0].div_ceil(LANES);
        // in the plane, y is the slowest axis and tiles are columns
        let tile_rows = if self.counts[2] > 1 {
            TILE_ROWS
        } else {
            self.counts[1]
        };
        (0..self.counts[1])
            .step_by(tile_rows.max(1))
            .flat_map(move |y0| {
                (0..across).step_by(TILE_GROUPS).flat_map(move |g0| {
                    (0..self.counts[2]).flat_map(move |z| {
                        (y0..(y0 + tile_rows).min(self.counts[1])).flat_map(move |y| {
                            (g0..(g0 + TILE_GROUPS).min(across))
                                .map(move |g| self.cell([g * LANES, y, z]))
                        })
                    })
                })
            })
    }
}

/// Points in a box, groups of eight of those with families, and the stencil.
pub(super) struct Stencil<const D: usize> {
    pub offsets: Vec<Offset<D>>,
    /// Point in each cell, [`NONE`] if none.
    pub point_of: Vec<u32>,
    /// First cell of each group, in the order of the sweep.
    pub groups: Vec<u32>,
    /// Eight per group and offset: bonds of the reference families.
    pub reference: Vec<u8>,
    /// Those that stand.
    pub intact: Vec<u8>,
}

/// Sites of points on a lattice found from bond vectors.
struct Sites<const D: usize> {
    spacing: [f64; D],
    site: Vec<[i32; D]>,
    counts: [usize; 3],
}

fn sites<const D: usize>(setup: &BondSetup<'_, D>) -> Result<Sites<D>, String> {
    let points = setup.position.len();
    let mut spacing = [f64::INFINITY; D];
    let Some(longest) = (0..points).max_by_key(|&i| setup.family_size(i)) else {
        return Err("there are no points".into());
    };
    for j in setup.family_of_any(longest) {
        let xi = setup.bond(longest, j as usize);
        for a in 0..D {
            if xi[a].abs() > 1e-6 * xi.norm() {
                spacing[a] = spacing[a].min(xi[a].abs());
            }
        }
    }
    if spacing.iter().any(|h| !h.is_finite()) {
        return Err("no family spans all directions".into());
    }
    let mut low = Vector::<D>::repeat(f64::INFINITY);
    let mut high = -low;
    for x in setup.position {
        low = low.inf(x);
        high = high.sup(x);
    }
    // the spacing from the whole extent: its digits are better than those of one bond
    let mut counts = [1usize; 3];
    for a in 0..D {
        let steps = ((high[a] - low[a]) / spacing[a]).round();
        if steps > 1e6 {
            return Err("it would have more than a million sites along an axis".into());
        }
        counts[a] = steps as usize + 1;
        if steps > 0.0 {
            spacing[a] = (high[a] - low[a]) / steps;
        }
    }
    let mut site = Vec::with_capacity(points);
    for (i, x) in setup.position.iter().enumerate() {
        let mut s = [0i32; D];
        for a in 0..D {
            let steps = (x[a] - low[a]) / spacing[a];
            s[a] = steps.round() as i32;
            // what the coordinate's own digits allow is enough, too
            let digits = 4.0 * f64::EPSILON * (x[a].abs() + low[a].abs()) / spacing[a];
            if (steps - steps.round()).abs() > TOLERANCE.max(digits) {
                return Err(format!("point {i} lies off it"));
            }
        }
        site.push(s);
    }
    Ok(Sites {
        spacing,
        site,
        counts,
    })
}

/// The point of each cell of the box; `NONE` for an empty one.
fn points_of_cells<const D: usize>(cells: &Box3, site: &[[i32; D]]) -> Result<Vec<u32>, String> {
    let mut point_of = vec![NONE; cells.cells];
    for (i, s) in site.iter().enumerate() {
        let cell = cells.cell(std::array::from_fn(
            |a| if a < D { s[a] as usize } else { 0 },
        ));
        if point_of[cell] != NONE {
            return Err(format!("points {} and {i} lie on one site", point_of[cell]));
        }
        point_of[cell] = i as u32;
    }
    Ok(point_of)
}

/// Sites of the points in the lanes of each group.
struct LaneSites<'a, const D: usize> {
    groups: &'a [u32],
    point_of: &'a [u32],
    position: &'a OffsetTable<usize, D>,
}

impl<const D: usize> LaneSites<'_, D> {
    /// One bit for each lane, group and offset: whether there is a bond, and whether it stands at the start.
    fn bits(
        &self,
        setup: &BondSetup<'_, D>,
        stencil: usize,
        step: impl Fn(usize, u32) -> [i32; D] + Sync,
    ) -> (Vec<u8>, Vec<u8>) {
        let with_family = |p: u32| p != NONE && !setup.families.of(p as usize).is_empty();
        let mut reference = vec![0u8; self.groups.len() * stencil];
        let mut intact = reference.clone();
        let bits = reference
            .par_chunks_mut(stencil.max(1))
            .zip(intact.par_chunks_mut(stencil.max(1)));
        parallel::for_each(bits.zip(self.groups), |((reference, intact), &cell)| {
            for lane in 0..LANES {
                let i = self.point_of[cell as usize + lane];
                if !with_family(i) {
                    continue;
                }
                let i = i as usize;
                for &j in setup.families.of(i) {
                    let Some(o) = self.position.of(&step(i, j)) else {
                        continue;
                    };
                    reference[o] |= 1 << lane;
                    if !setup.precracked.is_some_and(|cut| cut(i, j as usize)) {
                        intact[o] |= 1 << lane;
                    }
                }
            }
        });
        (reference, intact)
    }

    /// As [`LaneSites::bits`]; collective where families are spread, of all points then.
    fn bits_of_all(
        &self,
        setup: &BondSetup<'_, D>,
        stencil: usize,
        step: impl Fn(usize, u32) -> [i32; D] + Sync,
    ) -> (Vec<u8>, Vec<u8>) {
        let (mut reference, mut intact) = self.bits(setup, stencil, step);
        if let Some(shared) = setup.shared {
            let is_own = |g: usize| {
                let points = &self.point_of[self.groups[g] as usize..][..LANES];
                points.iter().any(|&p| p != NONE && shared.own[p as usize])
            };
            shared.merge_bits(stencil, is_own, &mut reference);
            shared.merge_bits(stencil, is_own, &mut intact);
        }
        (reference, intact)
    }
}

/// Collective where families are spread: whether bonds weigh the same from both ends, as they do where all like bonds do. Of families that others hold, they look themselves.
fn check_ends<const D: usize>(setup: &BondSetup<'_, D>, are_alike: bool) -> Result<(), String> {
    let fault = match are_alike {
        true => None,
        false => setup.check_bonds().err(),
    };
    match setup.holds_on_all(fault.is_none()) {
        true => Ok(()),
        false => Err(fault.map_or(String::new(), |fault| fault.to_string())),
    }
}

/// The offsets of a stencil with their weights; one that is known only as its opposite has the numbers of that.
fn offsets_of<const D: usize>(
    steps: &[[i32; D]],
    found: &OffsetTable<(f64, f64), D>,
    cells: &Box3,
    spacing: [f64; D],
    volume: f64,
) -> Vec<Offset<D>> {
    steps
        .iter()
        .map(|s| {
            let mirror = s.map(|s| -s);
            let key = if *s < mirror { *s } else { mirror };
            let (weight, limit) = found.of(&key).or(found.of(s)).unwrap_or_default();
            Offset::new(*s, spacing, cells.delta(s), weight * volume, limit)
        })
        .collect()
}

impl<const D: usize> Stencil<D> {
    /// The stencil of a cloud, or why it has none.
    pub(super) fn new(setup: &BondSetup<'_, D>, volume: f64) -> Result<Self, String> {
        let Sites {
            spacing,
            site,
            counts,
        } = sites(setup)?;
        let step = |i: usize, j: u32| -> [i32; D] {
            std::array::from_fn(|a| site[j as usize][a] - site[i][a])
        };
        let Numbers {
            by_steps: found,
            are_alike,
        } = numbers(setup, site.len(), step)?;
        check_ends(setup, are_alike)?;
        let mut steps: Vec<[i32; D]> = found.known().map(|(s, _)| s).collect();
        // by the flat offset; the numbers of an offset and its opposite are one
        steps.sort_unstable_by_key(|s| {
            let mut reversed = *s;
            reversed.reverse();
            reversed
        });
        let mut reach = [0usize; 3];
        for s in &steps {
            for a in 0..D {
                reach[a] = reach[a].max(s[a].unsigned_abs() as usize);
            }
        }
        let cells = Box3::new(counts, reach);
        let points = site.len();
        if cells.cells > SPARSEST_BOX * points + 100_000 || cells.cells >= NONE as usize {
            return Err(format!(
                "its box has {} cells for {points} points",
                cells.cells
            ));
        }
        let offsets = offsets_of(&steps, &found, &cells, spacing, volume);
        let number = |(o, s): (usize, &[i32; D])| (*s, o);
        let position = OffsetTable::new(&steps.iter().enumerate().map(number).collect::<Vec<_>>());
        let point_of = points_of_cells(&cells, &site)?;
        let with_family = |p: u32| p != NONE && setup.has_family(p as usize);
        let groups: Vec<u32> = cells
            .groups()
            .filter(|&c| point_of[c..c + LANES].iter().any(|&p| with_family(p)))
            .map(|c| c as u32)
            .collect();
        let rows = (0..points as u32).filter(|&p| with_family(p)).count();
        if groups.len() * LANES > SPARSEST_LANES * rows + 10_000 {
            return Err(format!(
                "{rows} points with families would take {} places",
                groups.len() * LANES
            ));
        }
        let stencil = offsets.len();
        let sites = LaneSites {
            groups: &groups,
            point_of: &point_of,
            position: &position,
        };
        let (reference, intact) = sites.bits_of_all(setup, stencil, step);
        let stencil = Self {
            offsets,
            point_of,
            groups,
            reference,
            intact,
        };
        let mirror: Vec<Option<usize>> =
            steps.iter().map(|s| position.of(&s.map(|s| -s))).collect();
        match stencil.has_one_sided(&mirror, with_family) {
            true => Err("a bond stands in one family only".into()),
            false => Ok(stencil),
        }
    }

    /// Returns true if a bond lacks its reverse, where the point at its other end has a family; `mirror` is the offset opposite to each.
    fn has_one_sided(
        &self,
        mirror: &[Option<usize>],
        with_family: impl Fn(u32) -> bool + Sync,
    ) -> bool {
        let count = self.offsets.len();
        let mut group_of = vec![NONE; self.point_of.len().div_ceil(LANES)];
        for (g, &cell) in self.groups.iter().enumerate() {
            group_of[cell as usize / LANES] = g as u32;
        }
        let stands = |cell: usize, offset: usize| match group_of[cell / LANES] {
            NONE => false,
            g => self.reference[g as usize * count + offset] >> (cell % LANES) & 1 == 1,
        };
        let is_one_sided = |here: usize, bits: &[u8]| {
            let offsets = bits.iter().zip(&self.offsets).zip(mirror);
            offsets.into_iter().any(|((&bits, offset), mirror)| {
                (0..LANES).filter(|l| bits >> l & 1 == 1).any(|lane| {
                    let there = ((here + lane) as isize + offset.delta) as usize;
                    with_family(self.point_of[there])
                        && !mirror.is_some_and(|back| stands(there, back))
                })
            })
        };
        count > 0
            && !parallel::all(self.groups.len(), 1, |g| {
                let bits = &self.reference[g * count..][..count];
                !is_one_sided(self.groups[g] as usize, bits)
            })
    }
}

impl Box3 {
    /// The flat distance of a step.
    pub(super) fn delta<const D: usize>(&self, s: &[i32; D]) -> isize {
        let along = [1, self.row, self.plane];
        (0..D).map(|a| s[a] as isize * along[a] as isize).sum()
    }
}

/// A full block of points, families and all, without lists: `counts` sites of equal volume.
#[derive(Clone, Copy)]
pub struct BlockSetup<'a, const D: usize> {
    /// Points along each axis; point numbers run along x first.
    pub counts: [usize; D],
    /// Distance of neighbours along each axis \[m\].
    pub spacing: [f64; D],
    /// Horizon \[m\].
    pub horizon: f64,
    /// The law; its function is evaluated for point 0 and bond 0 only.
    pub force: super::BondForce<'a, D>,
    /// Kinematics of the bonds.
    pub kinematics: super::BondKinematics,
    /// Critical stretch \[1\]; `None` for never.
    pub critical: Option<f64>,
}

impl<const D: usize> BlockSetup<'_, D> {
    /// Steps to all neighbours within the horizon.
    pub(super) fn steps(&self) -> Vec<[i32; D]> {
        let reach: [i32; D] =
            std::array::from_fn(|a| (self.horizon / self.spacing[a] * (1.0 + 1e-6)) as i32);
        let mut steps = vec![[0i32; D]];
        for a in 0..D {
            steps = (-reach[a]..=reach[a])
                .flat_map(|k| {
                    steps.iter().map(move |s| {
                        let mut s = *s;
                        s[a] = k;
                        s
                    })
                })
                .collect();
        }
        steps.retain(|s| {
            let square: f64 = (0..D)
                .map(|a| (f64::from(s[a]) * self.spacing[a]).powi(2))
                .sum();
            square > 0.0
                && square.sqrt() <= self.horizon * (1.0 + crate::peridynamics::TIE_TOLERANCE)
        });
        steps
    }

    /// The stencil of the block.
    pub(super) fn stencil(
        &self,
        number: impl Fn(&Vector<D>) -> (f64, f64),
        volume: f64,
    ) -> Stencil<D> {
        let steps = self.steps();
        let mut reach = [0usize; 3];
        for s in &steps {
            for a in 0..D {
                reach[a] = reach[a].max(s[a].unsigned_abs() as usize);
            }
        }
        let counts: [usize; 3] = std::array::from_fn(|a| if a < D { self.counts[a] } else { 1 });
        let cells = Box3::new(counts, reach);
        let offsets: Vec<Offset<D>> = steps
            .iter()
            .map(|s| {
                let xi = Vector::<D>::from_fn(|a, _| f64::from(s[a]) * self.spacing[a]);
                let (weight, limit) = number(&xi);
                Offset::new(*s, self.spacing, cells.delta(s), weight * volume, limit)
            })
            .collect();
        let mut point_of = vec![NONE; cells.cells];
        let mut point = 0;
        for z in 0..counts[2] {
            for y in 0..counts[1] {
                for x in 0..counts[0] {
                    point_of[cells.cell([x, y, z])] = point;
                    point += 1;
                }
            }
        }
        let groups: Vec<u32> = cells.groups().map(|c| c as u32).collect();
        let mut reference = vec![0u8; groups.len() * offsets.len()];
        parallel::for_each_chunk(&mut reference, offsets.len().max(1), 1, |group, bits| {
            let cell = groups[group];
            for (bits, o) in bits.iter_mut().zip(&offsets) {
                for lane in 0..LANES {
                    let here = cell as usize + lane;
                    let there = (here as isize + o.delta) as usize;
                    let stands = point_of[here] != NONE && point_of[there] != NONE;
                    *bits |= u8::from(stands) << lane;
                }
            }
        });
        Stencil {
            offsets,
            point_of,
            groups,
            intact: reference.clone(),
            reference,
        }
    }
}
