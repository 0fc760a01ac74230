//! Sparse rows: transfer rows that express a place through sites, and the accumulator of one stiffness row.

use sprs::{CompressedStorage, CsMatI};

use crate::{
    parallel,
    system::{BlockCsr, RowBatch, SharedRows},
    tensor::{Tensor, Vector},
};

/// Expresses the displacement of places through the displacements of sites, `u(place) = Σ w u(site)`.
///
/// A place that is a site itself has one weight, 1. The weights of every row add up to 1 and reproduce affine fields,
/// which is what carries a patch test through the seam.
///
/// Shapes: a matrix of places by sites, each row sorted by site; one weight serves all components of a displacement.
#[derive(Clone, Debug)]
pub struct Transfer(CsMatI<f64, u32, usize>);

impl Default for Transfer {
    fn default() -> Self {
        Self::new(0)
    }
}

impl Transfer {
    /// A transfer from so many sites without rows.
    pub fn new(sites: usize) -> Self {
        Self(CsMatI::empty(CompressedStorage::CSR, sites))
    }

    /// A transfer from so many sites, by its rows.
    pub fn from_rows(sites: usize, rows: impl IntoIterator<Item = Vec<(u32, f64)>>) -> Self {
        let mut transfer = Self::new(sites);
        rows.into_iter().for_each(|row| transfer.push(row));
        transfer
    }

    /// Appends a row; entries for the same site are added, zero weights dropped.
    pub fn push(&mut self, mut row: Vec<(u32, f64)>) {
        row.sort_by_key(|&(site, _)| site);
        row.dedup_by(|next, sum| {
            let same = next.0 == sum.0;
            if same {
                sum.1 += next.1;
            }
            same
        });
        // sprs appends to a matrix that it takes and gives back
        let matrix = std::mem::replace(&mut self.0, CsMatI::empty(CompressedStorage::CSR, 0));
        let row = row
            .into_iter()
            .map(|(site, weight)| (site as usize, weight));
        self.0 = matrix.append_outer_iter(row);
    }

    /// Number of sites.
    pub fn sites(&self) -> usize {
        self.0.cols()
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.0.rows()
    }

    /// Returns true if there is no place.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The matrix, of places by sites.
    pub fn matrix(&self) -> &CsMatI<f64, u32, usize> {
        &self.0
    }

    #[inline]
    fn entries(&self, place: usize) -> (&[u32], &[f64]) {
        let range = self.0.indptr().outer_inds_sz(place);
        (&self.0.indices()[range.clone()], &self.0.data()[range])
    }

    /// Sites and weights of a place; none for a place that no equation uses.
    #[inline]
    pub fn row(&self, place: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let (sites, weights) = self.entries(place);
        sites.iter().copied().zip(weights.iter().copied())
    }

    /// The site that a place is.
    #[inline]
    pub fn site(&self, place: usize) -> Option<u32> {
        match self.entries(place) {
            (&[site], &[1.0]) => Some(site),
            _ => None,
        }
    }

    /// The site with the largest weight in a row: the place itself, where that is a site.
    pub fn heaviest(&self, place: usize) -> Option<Centre> {
        let heaviest = self
            .row(place)
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        heaviest.map(|(site, _)| Centre::Site(site))
    }

    /// The displacement of a place; `u` holds `D` numbers per site.
    pub fn displacement<const D: usize>(&self, place: usize, u: &[f64]) -> Vector<D> {
        let mut sum = Vector::zeros();
        for (site, weight) in self.row(place) {
            for a in 0..D {
                sum[a] += weight * u[site as usize * D + a];
            }
        }
        sum
    }
}

/// Accumulates one block row of the stiffness; sparse, reused from row to row.
pub struct Row<const D: usize> {
    slot: Vec<u32>,
    columns: Vec<u32>,
    blocks: Vec<Tensor<D>>,
    /// Work space of [`Row::gather`]: blocks of places that are no sites.
    slot_of_place: Vec<u32>,
    places: Vec<u32>,
    place_blocks: Vec<Tensor<D>>,
    /// Stiffnesses of elements, each at its number's remainder: nodes that follow each other have elements in common.
    elements: Vec<(u32, Vec<Tensor<D>>)>,
    counted: Option<Counted>,
    /// The parts of the row so far, and the centre of the one at hand; none of rows that are wanted as a whole.
    parts: Option<(Vec<RowPart<D>>, Option<Centre>)>,
}

/// The place about which the body of a part of a row expands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Centre {
    /// A site.
    Site(u32),
    /// The centroid of a cell.
    Cell(u32),
}

/// A part of a row: of the gradient of one energy (of a bond, a family, an element), which a translation leaves as it is.
#[derive(Clone, Debug)]
pub struct RowPart<const D: usize> {
    /// The middle of what has that energy; none of a row without one.
    pub centre: Option<Centre>,
    /// Sites, each once.
    pub columns: Vec<u32>,
    /// A block \[N/m\] for each.
    pub blocks: Vec<Tensor<D>>,
}

/// The material whose elements and bonds alone count in a row; of a bond between two materials each has half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counted {
    /// Its number.
    pub material: u16,
    /// The number of the material of points, in a body of one.
    pub of_points: u16,
}

const EMPTY: u32 = u32::MAX;

/// Elements that a row remembers: some rows of a mesh in the plane.
const ELEMENTS: usize = 512;

impl<const D: usize> Row<D> {
    /// An empty row of a system of `sites` sites.
    pub fn new(sites: usize) -> Self {
        Self {
            slot: vec![EMPTY; sites],
            columns: Vec::new(),
            blocks: Vec::new(),
            slot_of_place: Vec::new(),
            places: Vec::new(),
            place_blocks: Vec::new(),
            elements: Vec::new(),
            counted: None,
            parts: None,
        }
    }

    /// An empty row whose parts stay apart, for [`Row::take_parts`].
    pub fn in_parts(sites: usize) -> Self {
        Self {
            parts: Some((Vec::new(), None)),
            ..Self::new(sites)
        }
    }

    /// Adds a part of the row, what `add` adds, of which `centre` is the middle.
    #[inline]
    pub fn part(&mut self, centre: impl FnOnce() -> Option<Centre>, add: impl FnOnce(&mut Self)) {
        if self.parts.is_none() {
            return add(self);
        }
        let around = self.begin_part(centre());
        add(self);
        self.begin_part(around);
    }

    /// Returns the centre of the part that this ends.
    fn begin_part(&mut self, next: Option<Centre>) -> Option<Centre> {
        let (mut parts, centre) = self.parts.take()?;
        if !self.columns.is_empty() {
            let mut part = RowPart {
                centre,
                columns: Vec::with_capacity(self.columns.len()),
                blocks: Vec::with_capacity(self.columns.len()),
            };
            self.take_blocks(|column, block| {
                part.columns.push(column);
                part.blocks.push(*block);
            });
            parts.push(part);
        }
        self.parts = Some((parts, next));
        centre
    }

    /// The parts of the row, in the order in which they came, which empties it; none of a row that was made as a whole.
    pub fn take_parts(&mut self) -> Vec<RowPart<D>> {
        self.begin_part(None);
        let parts = self.parts.as_mut().map(|(parts, _)| std::mem::take(parts));
        parts.unwrap_or_default()
    }

    /// Counts the elements and bonds of one material alone from now on; with none all.
    pub fn count_only(&mut self, counted: Option<Counted>) {
        self.counted = counted;
    }

    /// Part of an element of a material that counts.
    pub fn part_of(&self, material: u16) -> f64 {
        match self.counted {
            Some(counted) if counted.material != material => 0.0,
            _ => 1.0,
        }
    }

    /// Part of a bond that counts, by the materials of its ends; none of a body of one.
    #[inline]
    pub fn part_between(&self, ends: [Option<&u16>; 2]) -> f64 {
        let Some(counted) = self.counted else {
            return 1.0;
        };
        let is_its = |end: Option<&u16>| *end.unwrap_or(&counted.of_points) == counted.material;
        let counting = ends.into_iter().filter(|end| is_its(*end));
        0.5 * counting.count() as f64
    }

    /// Calls `add` with each block of the row of a local node in the stiffness of an element of the one model that the row is for; `stiffness` is asked where the element is not remembered.
    ///
    /// Shapes: `nodes` are those of the element; `stiffness` overwrites a list of `nodes.len()²` blocks of `D` by `D`, row by row, and `add` gets one with its node. Units: \[N/m^(4−D)\], as those of [`crate::fem::stiffness_into`].
    pub fn element_row(
        &mut self,
        (element, nodes): (usize, &[u32]),
        local_node: usize,
        stiffness: impl FnOnce(&mut Vec<Tensor<D>>),
        mut add: impl FnMut(&mut Self, u32, &Tensor<D>),
    ) {
        if self.elements.is_empty() {
            self.elements = vec![(EMPTY, Vec::new()); ELEMENTS];
        }
        let (known, blocks) = &mut self.elements[element % ELEMENTS];
        if *known as usize != element {
            *known = element as u32;
            stiffness(blocks);
        }
        // out of the row while it is added to
        let blocks = std::mem::take(blocks);
        let own = &blocks[local_node * nodes.len()..][..nodes.len()];
        for (&node, block) in nodes.iter().zip(own) {
            add(self, node, block);
        }
        self.elements[element % ELEMENTS].1 = blocks;
    }

    /// Adds `block · u(site)` to the row.
    // a row of a state-based law names each of its sites many times: a call would be a fifth of the work
    #[inline(always)]
    pub fn add_site(&mut self, site: u32, block: &Tensor<D>) {
        let slot = self.slot[site as usize];
        if slot == EMPTY {
            self.add_new_site(site, block);
        } else {
            self.blocks[slot as usize] += block;
        }
    }

    #[inline(never)]
    fn add_new_site(&mut self, site: u32, block: &Tensor<D>) {
        self.slot[site as usize] = self.columns.len() as u32;
        self.columns.push(site);
        self.blocks.push(*block);
    }

    /// Adds `block · u(place)` to the row, the place being expressed through sites.
    #[inline]
    pub fn add(&mut self, transfer: &Transfer, place: usize, block: &Tensor<D>) {
        for (site, weight) in transfer.row(place) {
            if weight == 1.0 {
                self.add_site(site, block);
            } else {
                self.add_site(site, &(block * weight));
            }
        }
    }

    /// As [`Row::add`], but a place that is no site waits for [`Row::spread`]: a row names such a place many times, and each has many sites.
    #[inline]
    pub fn gather(&mut self, transfer: &Transfer, place: usize, block: &Tensor<D>) {
        if let Some(site) = transfer.site(place) {
            self.add_site(site, block);
            return;
        }
        if self.parts.is_some() {
            self.add(transfer, place, block);
            return;
        }
        if self.slot_of_place.len() <= place {
            self.slot_of_place.resize(transfer.len(), EMPTY);
        }
        let slot = &mut self.slot_of_place[place];
        if *slot == EMPTY {
            *slot = self.places.len() as u32;
            self.places.push(place as u32);
            self.place_blocks.push(*block);
        } else {
            self.place_blocks[*slot as usize] += block;
        }
    }

    /// Adds the blocks that wait for the places of this transfer.
    pub fn spread(&mut self, transfer: &Transfer) {
        let places = std::mem::take(&mut self.places);
        let blocks = std::mem::take(&mut self.place_blocks);
        for (&place, block) in places.iter().zip(&blocks) {
            self.slot_of_place[place as usize] = EMPTY;
            self.add(transfer, place as usize, block);
        }
        (self.places, self.place_blocks) = (places, blocks);
        self.places.clear();
        self.place_blocks.clear();
    }

    /// Multiplies the row by a factor.
    pub fn scale(&mut self, factor: f64) {
        if factor != 1.0 {
            self.blocks.iter_mut().for_each(|block| *block *= factor);
            let parts = self.parts.iter_mut().flat_map(|(parts, _)| parts);
            let blocks = parts.flat_map(|part| &mut part.blocks);
            blocks.for_each(|block| *block *= factor);
        }
    }

    /// The row times each of `u` (`D` numbers per site), which empties it: for rows that are needed once, without a matrix.
    pub fn take_products<const N: usize>(&mut self, u: [&[f64]; N]) -> [Vector<D>; N] {
        let mut sums = [Vector::zeros(); N];
        for (&column, block) in self.columns.iter().zip(&self.blocks) {
            let start = column as usize * D;
            for (sum, u) in sums.iter_mut().zip(u) {
                *sum += block * Vector::<D>::from_column_slice(&u[start..start + D]);
            }
            self.slot[column as usize] = EMPTY;
        }
        self.columns.clear();
        self.blocks.clear();
        sums
    }

    /// The columns of the row, in the order in which they came, which empties it.
    pub fn take_columns(&mut self) -> Vec<u32> {
        for &column in &self.columns {
            self.slot[column as usize] = EMPTY;
        }
        self.blocks.clear();
        std::mem::take(&mut self.columns)
    }

    /// Empties the row into `visit`, block by block.
    pub fn take_blocks(&mut self, mut visit: impl FnMut(u32, &Tensor<D>)) {
        for (&column, block) in self.columns.iter().zip(&self.blocks) {
            visit(column, block);
            self.slot[column as usize] = EMPTY;
        }
        self.columns.clear();
        self.blocks.clear();
    }

    /// Empties the row into sorted columns and row-major blocks.
    fn drain_into(&mut self, columns: &mut Vec<u32>, values: &mut Vec<f64>) {
        let mut order: Vec<u32> = (0..self.columns.len() as u32).collect();
        order.sort_unstable_by_key(|&e| self.columns[e as usize]);
        for e in order {
            let site = self.columns[e as usize];
            self.slot[site as usize] = EMPTY;
            columns.push(site);
            let block = &self.blocks[e as usize];
            for a in 0..D {
                for b in 0..D {
                    values.push(block[(a, b)]);
                }
            }
        }
        self.columns.clear();
        self.blocks.clear();
    }
}

/// Rows of one task.
const CHUNK: usize = 256;

/// Tasks that run before their rows are moved into the matrix: what is held twice is one wave, not the whole matrix.
const WAVE: usize = 16;

/// Assembles a block matrix of `rows` rows, which need not be those of sites, row by row and in parallel; the same bits for any number of threads.
pub fn assemble_rows<const D: usize>(
    rows: usize,
    sites: usize,
    advance: impl Fn(u64) + Sync,
    add_row: impl Fn(usize, &mut Row<D>) + Sync,
) -> BlockCsr {
    let mut gathered = SharedRows::gather(D, rows);
    let chunks = rows.div_ceil(CHUNK);
    for wave in (0..chunks).step_by(WAVE) {
        let parts: Vec<RowBatch> = parallel::map_with(
            (wave + WAVE).min(chunks) - wave,
            1,
            || (Row::<D>::new(sites), Vec::new(), Vec::new()),
            |(row, columns, values), k| {
                let chunk = wave + k;
                let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(rows);
                let mut batch = RowBatch::new(D);
                let count = range.len() as u64;
                for site in range {
                    add_row(site, row);
                    row.drain_into(columns, values);
                    batch.push(columns, values);
                    columns.clear();
                    values.clear();
                }
                advance(count);
                batch
            },
        );
        parts.into_iter().for_each(|batch| gathered.append(batch));
    }
    gathered.finish()
}

/// As [`assemble_rows`], each row with blocks of its own, whose bits do not depend on the other rows.
pub fn assemble_apart<const D: usize>(
    rows: usize,
    sites: usize,
    add_row: impl Fn(usize, &mut Row<D>) + Sync,
) -> BlockCsr {
    let each = parallel::map_with(
        rows,
        CHUNK,
        || Row::<D>::new(sites),
        |row, r| {
            let (mut columns, mut values) = (Vec::new(), Vec::new());
            add_row(r, row);
            row.drain_into(&mut columns, &mut values);
            (columns, values)
        },
    );
    let mut matrix = BlockCsr {
        block: D,
        row_offsets: vec![0],
        ..BlockCsr::default()
    };
    for (columns, values) in each {
        matrix.columns.extend(columns);
        matrix.values.extend(values);
        matrix.row_offsets.push(matrix.columns.len());
    }
    matrix
}

#[cfg(test)]
#[path = "assembly_tests.rs"]
mod tests;
