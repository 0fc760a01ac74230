//! Aggregation, prolongation and coarse matrices of the multigrid hierarchy.

use crate::solve::singularity_diagnosis::rigid_modes;
use crate::solve::smoother::BlockJacobi;
use crate::system::BlockCsr;
use crate::{parallel, solve::FreeDofs};

const NONE: u32 = u32::MAX;

/// A partition of the sites with free dofs.
#[derive(Clone, Debug)]
pub(crate) struct Aggregates {
    /// Aggregate of each site; `u32::MAX` without free dofs.
    pub of_site: Vec<u32>,
    /// Number of aggregates.
    pub count: usize,
}

/// Near-null-space vectors: `modes` values for each dof, dof by dof.
#[derive(Clone, Debug)]
pub(crate) struct NearNull {
    pub modes: usize,
    pub values: Vec<f64>,
}

/// The rigid-body modes of the sites, zero on prescribed dofs.
pub(crate) fn rigid_near_null_space(positions: &[[f64; 3]], free: &FreeDofs) -> NearNull {
    let d = free.block();
    let n = positions.len().max(1) as f64;
    let centre: [f64; 3] = std::array::from_fn(|k| positions.iter().map(|x| x[k]).sum::<f64>() / n);
    let relative = |x: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|k| x[k] - centre[k]) };
    let radius = positions
        .iter()
        .map(|x| relative(x).iter().map(|v| v * v).sum::<f64>())
        .fold(0.0, f64::max)
        .sqrt();
    let scale = if radius > 0.0 { radius } else { 1.0 };
    let modes = rigid_modes(d, [0.0; 3], 1.0).len();
    let mut values = vec![0.0; positions.len() * d * modes];
    for (i, x) in positions.iter().enumerate() {
        let r = rigid_modes(d, relative(x), scale);
        for a in free.of_site(i) {
            for (m, mode) in r.iter().enumerate() {
                values[(i * d + a) * modes + m] = mode[a];
            }
        }
    }
    NearNull { modes, values }
}

impl Aggregates {
    /// Gathers sites around roots that are no neighbours of each other's neighbours, in the order of site numbers;
    /// what is left joins the neighbouring aggregate with the strongest block.
    pub fn new(matrix: &BlockCsr, free: &FreeDofs) -> Aggregates {
        let n = matrix.rows();
        let size = matrix.block * matrix.block;
        let active = |i: usize| free.count_of_site(i) > 0;
        let strength = |blocks: &[f64], e: usize| -> f64 {
            blocks[e * size..(e + 1) * size].iter().map(|k| k * k).sum()
        };
        let mut of_site = vec![NONE; n];
        let mut count = 0u32;
        for i in (0..n).filter(|&i| active(i)) {
            let (columns, blocks) = matrix.row(i);
            let near = |e: usize| active(columns[e] as usize) && strength(blocks, e) > 0.0;
            if (0..columns.len()).all(|e| !near(e) || of_site[columns[e] as usize] == NONE) {
                of_site[i] = count;
                for e in (0..columns.len()).filter(|&e| near(e)) {
                    of_site[columns[e] as usize] = count;
                }
                count += 1;
            }
        }
        let roots = of_site.clone();
        let joined: Vec<u32> = parallel::map(n, 1, |i| {
            if !active(i) || roots[i] != NONE {
                return roots[i];
            }
            let (columns, blocks) = matrix.row(i);
            let mut best = (0.0, NONE);
            for (e, &c) in columns.iter().enumerate() {
                let s = strength(blocks, e);
                if roots[c as usize] != NONE && s > best.0 {
                    best = (s, roots[c as usize]);
                }
            }
            best.1
        });
        of_site = joined;
        for i in 0..n {
            if active(i) && of_site[i] == NONE {
                let (columns, blocks) = matrix.row(i);
                of_site[i] = count;
                for (e, &c) in columns.iter().enumerate() {
                    if active(c as usize)
                        && of_site[c as usize] == NONE
                        && strength(blocks, e) > 0.0
                    {
                        of_site[c as usize] = count;
                    }
                }
                count += 1;
            }
        }
        Aggregates {
            of_site,
            count: count as usize,
        }
    }

    /// The mean position of each aggregate.
    pub fn centres(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut sums = vec![([0.0; 3], 0.0f64); self.count];
        for (&g, x) in self
            .of_site
            .iter()
            .zip(positions)
            .filter(|&(&g, _)| g != NONE)
        {
            let (sum, n) = &mut sums[g as usize];
            (0..3).for_each(|k| sum[k] += x[k]);
            *n += 1.0;
        }
        sums.into_iter()
            .map(|(sum, n)| sum.map(|s| s / n))
            .collect()
    }

    /// The prolongation that interpolates the near null space exactly: an orthonormal basis of it on every aggregate
    /// (one `block × modes` matrix per site), and the near null space of the coarse level.
    pub fn tentative(&self, free: &FreeDofs, near_null: &NearNull) -> (Vec<f64>, NearNull) {
        let (d, modes) = (free.block(), near_null.modes);
        let mut members = vec![Vec::new(); self.count];
        for (i, &g) in self.of_site.iter().enumerate().filter(|&(_, &g)| g != NONE) {
            members[g as usize].push(i);
        }
        let per_aggregate: Vec<(Vec<f64>, Vec<f64>)> = parallel::map_slice(&members, |sites| {
            let mut q: Vec<Vec<f64>> = (0..modes)
                .map(|m| {
                    sites
                        .iter()
                        .flat_map(|&i| {
                            (0..d).map(move |a| near_null.values[(i * d + a) * modes + m])
                        })
                        .collect()
                })
                .collect();
            let r = orthonormalise(&mut q);
            (interleave(&q), r)
        });
        let mut tentative = vec![0.0; self.of_site.len() * d * modes];
        let mut coarse = Vec::with_capacity(self.count * modes * modes);
        for (sites, (q, r)) in members.iter().zip(per_aggregate) {
            for (&i, block) in sites.iter().zip(q.chunks(d * modes)) {
                tentative[i * d * modes..(i + 1) * d * modes].copy_from_slice(block);
            }
            coarse.extend(r);
        }
        (
            tentative,
            NearNull {
                modes,
                values: coarse,
            },
        )
    }
}

/// Columns to rows: entry `(dof, mode)` of the basis, dof by dof.
fn interleave(columns: &[Vec<f64>]) -> Vec<f64> {
    let length = columns.first().map_or(0, Vec::len);
    (0..length)
        .flat_map(|k| columns.iter().map(move |c| c[k]))
        .collect()
}

/// Gram–Schmidt, twice; returns `R` by rows. A vector that depends on those before it becomes zero: an aggregate of
/// one site has no rotation.
fn orthonormalise(columns: &mut [Vec<f64>]) -> Vec<f64> {
    let n = columns.len();
    let mut r = vec![0.0; n * n];
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    for k in 0..n {
        let (before, rest) = columns.split_at_mut(k);
        let v = &mut rest[0];
        let size = product(v, v).sqrt();
        for _ in 0..2 {
            for (j, q) in before.iter().enumerate() {
                let c = product(q, v);
                r[j * n + k] += c;
                v.iter_mut().zip(q).for_each(|(v, q)| *v -= c * q);
            }
        }
        let left = product(v, v).sqrt();
        if left > 1e-10 * size {
            r[k * n + k] = left;
            v.iter_mut().for_each(|v| *v /= left);
        } else {
            v.fill(0.0);
        }
    }
    r
}

/// A block-sparse prolongation by rows of sites, with the places of its transpose.
#[derive(Clone, Debug)]
pub(crate) struct Prolongation {
    block: usize,
    modes: usize,
    offsets: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
    /// For each aggregate, its entries as (site, place in `columns`), by ascending site.
    transposed_offsets: Vec<usize>,
    transposed: Vec<(u32, u32)>,
}

/// Sparse rows gathered by column through a marker array.
struct Gather {
    slot: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f64>,
    size: usize,
}

impl Gather {
    fn new(columns: usize, size: usize) -> Gather {
        Gather {
            slot: vec![NONE; columns],
            columns: Vec::new(),
            values: Vec::new(),
            size,
        }
    }

    /// The block of column `c`, zero if it is new.
    fn block(&mut self, c: u32) -> &mut [f64] {
        if self.slot[c as usize] == NONE {
            self.slot[c as usize] = self.columns.len() as u32;
            self.columns.push(c);
            self.values.resize(self.values.len() + self.size, 0.0);
        }
        let s = self.slot[c as usize] as usize;
        &mut self.values[s * self.size..(s + 1) * self.size]
    }

    /// Columns ascending and their blocks; empties the row.
    fn take(&mut self) -> (Vec<u32>, Vec<f64>) {
        let mut columns = std::mem::take(&mut self.columns);
        columns.sort_unstable();
        let mut values = Vec::with_capacity(self.values.len());
        for &c in &columns {
            let s = std::mem::replace(&mut self.slot[c as usize], NONE) as usize;
            values.extend_from_slice(&self.values[s * self.size..(s + 1) * self.size]);
        }
        self.values.clear();
        (columns, values)
    }
}

/// Block rows with columns ascending.
type Rows = Vec<(Vec<u32>, Vec<f64>)>;

/// `c += s a b` for `a` of `m × k` and `b` of `k × n`, all row-major.
#[inline(always)]
fn add_product(c: &mut [f64], s: f64, a: &[f64], b: &[f64], (m, k, n): (usize, usize, usize)) {
    for i in 0..m {
        for l in 0..k {
            let f = s * a[i * k + l];
            for j in 0..n {
                c[i * n + j] += f * b[l * n + j];
            }
        }
    }
}

/// `P = (I − ω D⁻¹ A) T` for the tentative prolongation `T`, on free dofs.
pub(crate) fn smoothed(
    matrix: &BlockCsr,
    free: &FreeDofs,
    jacobi: &BlockJacobi,
    omega: f64,
    aggregates: &Aggregates,
    tentative: &[f64],
    modes: usize,
) -> Prolongation {
    let d = matrix.block;
    let size = d * modes;
    let rows: Rows = parallel::map_with(
        matrix.rows(),
        64,
        || {
            (
                Gather::new(aggregates.count, size),
                Gather::new(aggregates.count, size),
            )
        },
        |(product, row), i| {
            if free.count_of_site(i) == 0 {
                return (Vec::new(), Vec::new());
            }
            let (columns, blocks) = matrix.row(i);
            for (e, &c) in columns.iter().enumerate() {
                let g = aggregates.of_site[c as usize];
                if g != NONE {
                    let t = &tentative[c as usize * size..(c as usize + 1) * size];
                    let k = &blocks[e * d * d..(e + 1) * d * d];
                    fixed_product(product.block(g), k, t, (d, modes));
                }
            }
            let (columns, products) = product.take();
            for (&g, p) in columns.iter().zip(products.chunks(size)) {
                add_product(
                    row.block(g),
                    -omega,
                    jacobi.inverse_of_site(i),
                    p,
                    (d, d, modes),
                );
            }
            let own = row.block(aggregates.of_site[i]);
            own.iter_mut()
                .zip(&tentative[i * size..(i + 1) * size])
                .for_each(|(p, t)| *p += t);
            row.take()
        },
    );
    Prolongation::new(d, modes, aggregates.count, rows)
}

/// `c += a b` for a `d × d` block and a `d × modes` block, the usual sizes unrolled by the compiler.
fn fixed_product(c: &mut [f64], a: &[f64], b: &[f64], (d, modes): (usize, usize)) {
    match (d, modes) {
        (1, 1) => add_product(c, 1.0, a, b, (1, 1, 1)),
        (2, 3) => add_product(c, 1.0, &a[..4], &b[..6], (2, 2, 3)),
        (3, 3) => add_product(c, 1.0, &a[..9], &b[..9], (3, 3, 3)),
        (3, 6) => add_product(c, 1.0, &a[..9], &b[..18], (3, 3, 6)),
        (6, 6) => add_product(c, 1.0, &a[..36], &b[..36], (6, 6, 6)),
        _ => add_product(c, 1.0, a, b, (d, d, modes)),
    }
}

impl Prolongation {
    fn new(block: usize, modes: usize, coarse: usize, rows: Rows) -> Prolongation {
        let mut p = Prolongation {
            block,
            modes,
            offsets: vec![0],
            columns: Vec::new(),
            values: Vec::new(),
            transposed_offsets: vec![0; coarse + 1],
            transposed: Vec::new(),
        };
        for (columns, values) in rows {
            p.columns.extend(columns);
            p.values.extend(values);
            p.offsets.push(p.columns.len());
        }
        for &c in &p.columns {
            p.transposed_offsets[c as usize + 1] += 1;
        }
        for c in 0..coarse {
            p.transposed_offsets[c + 1] += p.transposed_offsets[c];
        }
        let mut next = p.transposed_offsets.clone();
        p.transposed = vec![(0, 0); p.columns.len()];
        for i in 0..p.offsets.len() - 1 {
            for e in p.offsets[i]..p.offsets[i + 1] {
                let to = &mut next[p.columns[e] as usize];
                p.transposed[*to] = (i as u32, e as u32);
                *to += 1;
            }
        }
        p
    }

    fn entry(&self, e: usize) -> &[f64] {
        let size = self.block * self.modes;
        &self.values[e * size..(e + 1) * size]
    }

    /// `P x`.
    pub fn prolong(&self, x: &[f64]) -> Vec<f64> {
        let (d, m) = (self.block, self.modes);
        let mut y = vec![0.0; (self.offsets.len() - 1) * d];
        parallel::for_each_chunk(&mut y, d, 256, |i, y| {
            for e in self.offsets[i]..self.offsets[i + 1] {
                let x = &x[self.columns[e] as usize * m..][..m];
                for (y, row) in y.iter_mut().zip(self.entry(e).chunks(m)) {
                    *y += row.iter().zip(x).map(|(p, x)| p * x).sum::<f64>();
                }
            }
        });
        y
    }

    /// `Pᵀ x`.
    pub fn restrict(&self, x: &[f64]) -> Vec<f64> {
        let (d, m) = (self.block, self.modes);
        let mut y = vec![0.0; (self.transposed_offsets.len() - 1) * m];
        parallel::for_each_chunk(&mut y, m, 1, |g, y| {
            for &(i, e) in
                &self.transposed[self.transposed_offsets[g]..self.transposed_offsets[g + 1]]
            {
                let x = &x[i as usize * d..][..d];
                for (x, row) in x.iter().zip(self.entry(e as usize).chunks(m)) {
                    y.iter_mut().zip(row).for_each(|(y, p)| *y += p * x);
                }
            }
        });
        y
    }
}

/// `Pᵀ A P`. A coarse dof that interpolates nothing gets a unit diagonal.
pub(crate) fn coarse_matrix(matrix: &BlockCsr, free: &FreeDofs, p: &Prolongation) -> BlockCsr {
    let (d, m) = (p.block, p.modes);
    let coarse = p.transposed_offsets.len() - 1;
    let product: Rows = parallel::map_with(
        matrix.rows(),
        64,
        || Gather::new(coarse, d * m),
        |row, i| {
            if free.count_of_site(i) == 0 {
                return (Vec::new(), Vec::new());
            }
            let (columns, blocks) = matrix.row(i);
            for (e, &c) in columns.iter().enumerate() {
                let k = &blocks[e * d * d..(e + 1) * d * d];
                for f in p.offsets[c as usize]..p.offsets[c as usize + 1] {
                    fixed_product(row.block(p.columns[f]), k, p.entry(f), (d, m));
                }
            }
            row.take()
        },
    );
    let rows: Rows = parallel::map_with(
        coarse,
        8,
        || Gather::new(coarse, m * m),
        |row, g| {
            for &(i, e) in &p.transposed[p.transposed_offsets[g]..p.transposed_offsets[g + 1]] {
                let own = p.entry(e as usize);
                let (columns, values) = &product[i as usize];
                for (&c, v) in columns.iter().zip(values.chunks(d * m)) {
                    let target = row.block(c);
                    for a in 0..d {
                        for k in 0..m {
                            let f = own[a * m + k];
                            for l in 0..m {
                                target[k * m + l] += f * v[a * m + l];
                            }
                        }
                    }
                }
            }
            let own = row.block(g as u32);
            for k in 0..m {
                if own[k * m + k] == 0.0 {
                    own[k * m + k] = 1.0;
                }
            }
            row.take()
        },
    );
    let mut result = BlockCsr {
        block: m,
        row_offsets: vec![0],
        ..BlockCsr::default()
    };
    for (columns, values) in rows {
        result.columns.extend(columns);
        result.values.extend(values);
        result.row_offsets.push(result.columns.len());
    }
    result
}
