//! Sparse rows: transfer rows that express a place through sites, and the accumulator of one stiffness row.

use crate::{
    parallel,
    system::{BlockCsr, RowBatch, SharedRows},
    tensor::{Tensor, Vector},
};

/// Expresses the displacement of places through the displacements of sites, `u(place) = Σ w u(site)`.
///
/// A place that is a site itself has one weight, 1. The weights of every row add up to 1 and reproduce affine fields,
/// which is what carries a patch test through the seam.
#[derive(Clone, Debug, Default)]
pub struct Transfer {
    offsets: Vec<usize>,
    sites: Vec<u32>,
    weights: Vec<f64>,
}

impl Transfer {
    /// A transfer without rows.
    pub fn new() -> Self {
        Self {
            offsets: vec![0],
            ..Self::default()
        }
    }

    /// A transfer from its rows.
    pub fn from_rows(rows: impl IntoIterator<Item = Vec<(u32, f64)>>) -> Self {
        let mut transfer = Self::new();
        for row in rows {
            transfer.push(row);
        }
        transfer
    }

    /// Appends a row; entries for the same site are added, zero weights dropped.
    pub fn push(&mut self, row: impl IntoIterator<Item = (u32, f64)>) {
        let start = self.sites.len();
        for (site, weight) in row.into_iter().filter(|&(_, w)| w != 0.0) {
            // rows are short, and most come in order
            let behind = self.sites[start..].iter().rev().take_while(|s| **s > site);
            let place = self.sites.len() - behind.count();
            if place > start && self.sites[place - 1] == site {
                self.weights[place - 1] += weight;
            } else {
                self.sites.insert(place, site);
                self.weights.insert(place, weight);
            }
        }
        self.offsets.push(self.sites.len());
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Returns true if there is no place.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sites and weights of a place; none for a place that no equation uses.
    pub fn row(&self, place: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let range = self.offsets[place]..self.offsets[place + 1];
        self.sites[range.clone()]
            .iter()
            .copied()
            .zip(self.weights[range].iter().copied())
    }

    /// The site that a place is.
    #[inline]
    pub fn site(&self, place: usize) -> Option<u32> {
        let start = self.offsets[place];
        let is_site = self.offsets[place + 1] == start + 1 && self.weights[start] == 1.0;
        is_site.then(|| self.sites[start])
    }

    /// Number of stored weights.
    pub fn weight_count(&self) -> usize {
        self.sites.len()
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
        }
    }

    /// Counts the elements and bonds of one material alone from now on.
    pub fn count_only(&mut self, counted: Counted) {
        self.counted = Some(counted);
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

/// Pattern of a block matrix whose values were dropped row by row, with sums over them.
#[derive(Clone, Debug, Default)]
pub struct Pattern {
    /// Blocks of all rows, zero blocks included.
    pub stored: usize,
    /// Blocks that [`assemble_rows`] would hold, about: equal rows are stored once.
    pub distinct: usize,
    /// An estimate of `‖K − Kᵀ‖_F / ‖K‖_F`, from `xᵀ K y − yᵀ K x` with random `x` and `y`.
    pub asymmetry: f64,
    /// Start of each block row among the blocks that are not zero.
    pub row_offsets: Vec<usize>,
    /// Column of each block that is not zero, ascending within a row.
    pub columns: Vec<u32>,
    /// Product of the matrix with each of the vectors that were given.
    pub products: Vec<Vec<f64>>,
}

/// Sums over the values of rows that are dropped.
#[derive(Clone, Debug, Default)]
struct Dropped {
    /// Hash of each row, by which equal rows are found, and its number of blocks.
    marks: Vec<(u64, usize)>,
    stored: usize,
    skew: f64,
    squares: f64,
    /// Products of the rows with each of some vectors.
    products: Vec<Vec<f64>>,
}

/// A number in [−1, 1) that depends on its arguments only.
fn noise(site: u32, component: usize, which: u64) -> f64 {
    let mut z = (u64::from(site) << 4 | (component as u64) << 1 | which)
        .wrapping_add(1)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl<const D: usize> Row<D> {
    /// Empties the row of `site` into the columns of its non-zero blocks.
    fn drain_pattern(
        &mut self,
        site: u32,
        fields: &[Vec<f64>],
        columns: &mut Vec<u32>,
        sums: &mut Dropped,
    ) -> u64 {
        for (u, product) in fields.iter().zip(&mut sums.products) {
            let mut sum = Vector::<D>::zeros();
            for (&column, block) in self.columns.iter().zip(&self.blocks) {
                let start = column as usize * D;
                sum += block * Vector::<D>::from_column_slice(&u[start..start + D]);
            }
            product.extend(sum.iter());
        }
        let start = columns.len();
        let largest = self.blocks.iter().map(|b| b.amax()).fold(0.0, f64::max);
        // a sum over the blocks, so that their order does not matter; nine digits, so that round-off does not
        let mut mark = 0u64;
        for (&other, block) in self.columns.iter().zip(&self.blocks) {
            self.slot[other as usize] = EMPTY;
            sums.stored += 1;
            if block.iter().all(|&k| k == 0.0) {
                continue;
            }
            columns.push(other);
            for a in 0..D {
                for b in 0..D {
                    let k = block[(a, b)];
                    let digits = (k / largest * 1e9).round() as i64 as u64;
                    mark = mark.wrapping_add(
                        (digits ^ ((a * D + b) as u64) << 40).wrapping_mul(0x9E37_79B9_7F4A_7C15)
                            ^ digits.rotate_left(31),
                    );
                    sums.skew += k
                        * (noise(site, a, 0) * noise(other, b, 1)
                            - noise(site, a, 1) * noise(other, b, 0));
                    sums.squares += k * k;
                }
            }
        }
        columns[start..].sort_unstable();
        self.columns.clear();
        self.blocks.clear();
        mark.wrapping_add(largest.to_bits() >> 12)
    }
}

/// The pattern of the matrix that [`assemble_rows`] would make, and its products with `fields` (`D` numbers per site each); each row is computed and dropped.
pub fn pattern<const D: usize>(
    sites: usize,
    fields: &[Vec<f64>],
    advance: impl Fn(u64) + Sync,
    add_row: impl Fn(usize, &mut Row<D>) + Sync,
) -> Pattern {
    let parts: Vec<(Vec<usize>, Vec<u32>, Dropped)> = parallel::map_with(
        sites.div_ceil(CHUNK),
        1,
        || Row::<D>::new(sites),
        |row, chunk| {
            let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(sites);
            let (mut ends, mut columns) = (Vec::new(), Vec::new());
            let mut sums = Dropped {
                products: vec![Vec::new(); fields.len()],
                ..Dropped::default()
            };
            let count = range.len() as u64;
            for site in range {
                add_row(site, row);
                let before = sums.stored;
                let mark = row.drain_pattern(site as u32, fields, &mut columns, &mut sums);
                sums.marks.push((mark, sums.stored - before));
                ends.push(columns.len());
            }
            advance(count);
            (ends, columns, sums)
        },
    );
    let mut pattern = Pattern {
        row_offsets: vec![0],
        products: vec![Vec::new(); fields.len()],
        ..Pattern::default()
    };
    let mut sums = Dropped::default();
    let mut seen = std::collections::HashSet::new();
    for (ends, columns, part) in parts {
        for (mark, blocks) in part.marks {
            if seen.insert((mark, blocks)) {
                pattern.distinct += blocks;
            }
        }
        let before = pattern.columns.len();
        pattern.row_offsets.extend(ends.iter().map(|e| before + e));
        pattern.columns.extend(columns);
        for (all, own) in pattern.products.iter_mut().zip(part.products) {
            all.extend(own);
        }
        sums.stored += part.stored;
        sums.skew += part.skew;
        sums.squares += part.squares;
    }
    pattern.stored = sums.stored;
    // x and y have variance 1/3 per entry: E (xᵀ (K − Kᵀ) y)² = ‖K − Kᵀ‖² / 9
    if sums.squares > 0.0 {
        pattern.asymmetry = 3.0 * sums.skew.abs() / sums.squares.sqrt();
    }
    pattern
}

#[cfg(test)]
#[path = "assembly_tests.rs"]
mod tests;
