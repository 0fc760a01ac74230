//! Rows of some of the sites, and the force of all of them together with that of the bonds.

use crate::coupling::semidiscrete::behaviour::{CHUNK, NONE};
use crate::{
    assembly::{self, Row},
    model::Model,
    parallel,
    system::{BlockCsr, ROW_CHUNK},
    tensor::{Tensor, Vector},
};

/// Scales what each row gives, where the rows of a model are scaled.
pub fn scale_rows<const D: usize>(model: &Model<D>, values: &mut [f64]) {
    let Some(scale) = model.row_scale() else {
        return;
    };
    for (values, &factor) in values.chunks_exact_mut(D).zip(scale) {
        if factor != 1.0 {
            values.iter_mut().for_each(|v| *v *= factor);
        }
    }
}

/// The sites that have a row, and their rows: sites whose force comes from bonds alone cost nothing.
pub(super) struct SiteRows {
    /// The row of each site; `NONE` for a site without one.
    row_of_site: Vec<u32>,
    matrix: BlockCsr,
    /// True if no row responds to a translation, so that a body that drifts far need not lose digits to its drift.
    is_translation_free: bool,
    /// For each chunk of [`ROW_CHUNK`] rows, true if it is computed here; all are where others compute none.
    computed: Option<Vec<bool>>,
    /// Of these, the chunks with rows that other processes wait for, and the others; empty before [`SiteRows::begin_with`].
    early: Vec<bool>,
    late: Vec<bool>,
}

impl SiteRows {
    /// Assembles the rows of the sites that are `wanted`.
    pub fn assemble<const D: usize>(
        sites: usize,
        wanted: impl Fn(usize) -> bool,
        add_row: impl Fn(usize, &mut Row<D>) + Sync,
    ) -> Self {
        let listed: Vec<u32> = (0..sites as u32).filter(|&s| wanted(s as usize)).collect();
        let mut row_of_site = vec![NONE; sites];
        for (row, &site) in listed.iter().enumerate() {
            row_of_site[site as usize] = row as u32;
        }
        let matrix = assembly::assemble_rows(
            listed.len(),
            sites,
            |_| (),
            |r, row| add_row(listed[r] as usize, row),
        );
        Self {
            row_of_site,
            is_translation_free: matrix.rows_add_up_to_zero(),
            matrix,
            computed: None,
            early: Vec::new(),
            late: Vec::new(),
        }
    }

    /// Leaves the products of all but `own` sites to others: those of chunks without any are then anything.
    pub fn compute_only(&mut self, own: impl Fn(usize) -> bool) {
        self.computed = Some(self.chunks_of(own));
    }

    /// Goes on in two parts: the rows that others wait for come first, those of the sites `sent`.
    pub fn begin_with(&mut self, sent: &[u32]) {
        let is_sent = |site: usize| sent.binary_search(&(site as u32)).is_ok();
        self.early = self.chunks_of(is_sent);
        self.late = match &self.computed {
            None => self.early.iter().map(|is_early| !is_early).collect(),
            Some(computed) => {
                let chunks = computed.iter().zip(&self.early);
                chunks.map(|(own, is_early)| *own && !is_early).collect()
            }
        };
    }

    /// The chunks with rows of some sites.
    fn chunks_of(&self, is_wanted: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut chunks = vec![false; self.matrix.rows().div_ceil(ROW_CHUNK)];
        for (site, &row) in self.row_of_site.iter().enumerate() {
            if row != NONE && is_wanted(site) {
                chunks[row as usize / ROW_CHUNK] = true;
            }
        }
        chunks
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.matrix.values.len() * 8 + (self.matrix.columns.len() + self.row_of_site.len()) * 4
    }

    /// Overwrites `force` with the product of the rows and, where a site takes some, the force of the bonds: for each site the number of a point, and
    /// the forces of the points. `products` is scratch.
    pub fn multiply_into<const D: usize>(
        &self,
        u: &[f64],
        bonds: Option<(&[u32], &[f64])>,
        products: &mut Vec<f64>,
        force: &mut [f64],
    ) {
        self.multiply_chunks_into::<D>(self.computed.as_deref(), u, products);
        parallel::for_each_chunk(force, CHUNK * D, 1, |chunk, force| {
            for (k, force) in force.chunks_exact_mut(D).enumerate() {
                let site = chunk * CHUNK + k;
                let bonds = bonds.map_or((NONE, &[][..]), |(of, points)| (of[site], points));
                let sum: Vector<D> = self.with_bonds(site, products, bonds);
                force.copy_from_slice(sum.as_slice());
            }
        });
    }

    /// The products of the rows that others wait for.
    pub fn multiply_early_into<const D: usize>(&self, u: &[f64], products: &mut Vec<f64>) {
        self.multiply_chunks_into::<D>(Some(&self.early), u, products);
    }

    /// Those of the other rows that are computed here.
    pub fn multiply_late_into<const D: usize>(&self, u: &[f64], products: &mut Vec<f64>) {
        self.multiply_chunks_into::<D>(Some(&self.late), u, products);
    }

    fn multiply_chunks_into<const D: usize>(
        &self,
        chunks: Option<&[bool]>,
        u: &[f64],
        products: &mut Vec<f64>,
    ) {
        products.resize(self.matrix.rows() * D, 0.0);
        if self.is_translation_free {
            (self.matrix).multiply_differences_of_chunks_into(chunks, u, products);
        } else {
            self.matrix.multiply_chunks_into(chunks, u, products);
        }
    }

    /// The product of the row of a site, with the force of a point where it takes one.
    pub fn with_bonds<const D: usize>(
        &self,
        site: usize,
        products: &[f64],
        (point, points): (u32, &[f64]),
    ) -> Vector<D> {
        let entry = |from: &[f64], of: u32| -> Vector<D> {
            match of {
                NONE => Vector::zeros(),
                of => Vector::from_column_slice(&from[of as usize * D..][..D]),
            }
        };
        entry(products, self.row_of_site[site]) + entry(points, point)
    }

    /// Returns true if no site has a row.
    pub fn is_empty(&self) -> bool {
        self.matrix.rows() == 0
    }

    /// The columns of the row of a site; none without a row.
    pub fn columns(&self, site: usize) -> &[u32] {
        match self.row_of_site[site] {
            NONE => &[],
            row => self.matrix.row(row as usize).0,
        }
    }

    /// Returns true if a site has a row.
    pub fn has(&self, site: usize) -> bool {
        self.row_of_site[site] != NONE
    }

    /// Adds the row of a site, if it has one.
    pub fn add_row<const D: usize>(&self, site: usize, row: &mut Row<D>) {
        if self.has(site) {
            let (columns, blocks) = self.matrix.row(self.row_of_site[site] as usize);
            for (&column, block) in columns.iter().zip(blocks.chunks_exact(D * D)) {
                row.add_site(column, &Tensor::from_row_slice(block));
            }
        }
    }

    /// Per unknown `Σ_b |K_ab|` over the rows.
    pub fn row_sums<const D: usize>(&self) -> Vec<f64> {
        let sums = self.matrix.row_sums();
        self.row_of_site
            .iter()
            .flat_map(|&row| {
                let sums = &sums;
                (0..D).map(move |k| match row {
                    NONE => 0.0,
                    row => sums[row as usize * D + k],
                })
            })
            .collect()
    }

    /// The row of a site times a vector; zero without a row.
    pub fn product<const D: usize>(&self, site: usize, u: &[f64]) -> Vector<D> {
        match self.row_of_site[site] {
            NONE => Vector::zeros(),
            row => row_product(&self.matrix, row as usize, u),
        }
    }
}

/// One block row times a vector.
pub(super) fn row_product<const D: usize>(matrix: &BlockCsr, row: usize, u: &[f64]) -> Vector<D> {
    let (columns, blocks) = matrix.row(row);
    let mut sum = Vector::zeros();
    for (&c, block) in columns.iter().zip(blocks.chunks_exact(D * D)) {
        for a in 0..D {
            for b in 0..D {
                sum[a] += block[a * D + b] * u[c as usize * D + b];
            }
        }
    }
    sum
}
