//! Model matrices on lattices, for tests and benchmarks of solvers.
//!
//! Both kinds discretise the same isotropic material (`λ = μ = 1`, the Cauchy relation of bond-based peridynamics) on
//! the same lattice of unit spacing, so that rows of one may be exchanged for rows of the other.

use crate::system::BlockCsr;

/// A box of lattice sites with unit spacing in two or three dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct StencilGrid {
    /// Sites along each axis; 1 along the third in two dimensions.
    pub counts: [usize; 3],
    /// Number of dimensions, which is the number of dofs of a site.
    pub dimension: usize,
}

impl StencilGrid {
    /// A rectangle of `nx × ny` sites.
    pub fn rectangle(nx: usize, ny: usize) -> StencilGrid {
        StencilGrid {
            counts: [nx, ny, 1],
            dimension: 2,
        }
    }

    /// A box of `nx × ny × nz` sites.
    pub fn block(nx: usize, ny: usize, nz: usize) -> StencilGrid {
        StencilGrid {
            counts: [nx, ny, nz],
            dimension: 3,
        }
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// Returns true if there is no site.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Positions of the sites, the first axis fastest.
    pub fn positions(&self) -> Vec<[f64; 3]> {
        (0..self.len())
            .map(|i| self.cell(i).map(|k| k as f64))
            .collect()
    }

    fn cell(&self, i: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [i % nx, i / nx % ny, i / (nx * ny)]
    }

    /// The site at an offset from site `i`, if it lies in the box.
    fn neighbour(&self, i: usize, offset: [isize; 3]) -> Option<usize> {
        let cell = self.cell(i);
        let mut to = [0usize; 3];
        for k in 0..3 {
            to[k] = cell[k]
                .checked_add_signed(offset[k])
                .filter(|&c| c < self.counts[k])?;
        }
        Some((to[2] * self.counts[1] + to[1]) * self.counts[0] + to[0])
    }

    /// Bond-based stiffness `K_ij = −c ξ⊗ξ/|ξ|³` for `|ξ| ≤ m`, the constant such that `C₁₁₁₁ = 3` in the bulk.
    pub fn bonds(&self, m: usize) -> BlockCsr {
        let d = self.dimension;
        let reach = m as isize;
        let deep = if d == 3 { reach } else { 0 };
        let mut offsets = Vec::new();
        let mut fourth = 0.0;
        for z in -deep..=deep {
            for y in -reach..=reach {
                for x in -reach..=reach {
                    let square = (x * x + y * y + z * z) as f64;
                    if square > 0.0 && square <= (m * m) as f64 {
                        offsets.push(([x, y, z], square));
                        fourth += 0.5 * (x as f64).powi(4) / square.powf(1.5);
                    }
                }
            }
        }
        let c = 3.0 / fourth;
        self.assemble(|i, row| {
            let mut diagonal = [0.0; 9];
            for &(xi, square) in &offsets {
                if let Some(j) = self.neighbour(i, xi) {
                    let mut block = [0.0; 9];
                    for a in 0..d {
                        for b in 0..d {
                            block[a * d + b] = -c * (xi[a] * xi[b]) as f64 / square.powf(1.5);
                            diagonal[a * d + b] -= block[a * d + b];
                        }
                    }
                    row.push((j, block));
                }
            }
            row.push((i, diagonal));
        })
    }

    /// Stiffness of bilinear or trilinear elements between the sites.
    pub fn elements(&self) -> BlockCsr {
        let d = self.dimension;
        let element = unit_element(d);
        let corners = 1usize << d;
        let side = |c: usize, k: usize| (c >> k & 1) as isize;
        self.assemble(|i, row| {
            for own in 0..corners {
                // the element in which site i is corner `own`
                let nodes: Vec<Option<usize>> = (0..corners)
                    .map(|c| {
                        self.neighbour(
                            i,
                            std::array::from_fn(
                                |k| if k < d { side(c, k) - side(own, k) } else { 0 },
                            ),
                        )
                    })
                    .collect();
                let Some(nodes) = nodes.into_iter().collect::<Option<Vec<usize>>>() else {
                    continue;
                };
                for (c, &j) in nodes.iter().enumerate() {
                    let mut block = [0.0; 9];
                    for a in 0..d {
                        for b in 0..d {
                            block[a * d + b] = element[(own * d + a) * corners * d + c * d + b];
                        }
                    }
                    row.push((j, block));
                }
            }
        })
    }

    fn assemble(&self, mut row_of: impl FnMut(usize, &mut Vec<(usize, [f64; 9])>)) -> BlockCsr {
        let size = self.dimension * self.dimension;
        let mut matrix = BlockCsr {
            block: self.dimension,
            row_offsets: vec![0],
            ..BlockCsr::default()
        };
        let mut row = Vec::new();
        for i in 0..self.len() {
            row.clear();
            row_of(i, &mut row);
            row.sort_by_key(|&(j, _)| j);
            let mut last = None;
            for &(j, block) in &row {
                if last == Some(j) {
                    let end = matrix.values.len() - size;
                    matrix.values[end..]
                        .iter_mut()
                        .zip(&block)
                        .for_each(|(v, b)| *v += b);
                } else {
                    matrix.columns.push(j as u32);
                    matrix.values.extend_from_slice(&block[..size]);
                    last = Some(j);
                }
            }
            matrix.row_offsets.push(matrix.columns.len());
        }
        matrix
    }
}

/// Rows of `first` where `choose_first` holds, rows of `second` elsewhere: the splice of two models of one lattice.
pub fn splice(
    first: &BlockCsr,
    second: &BlockCsr,
    choose_first: impl Fn(usize) -> bool,
) -> BlockCsr {
    let mut matrix = BlockCsr {
        block: first.block,
        row_offsets: vec![0],
        ..BlockCsr::default()
    };
    for i in 0..first.rows() {
        let (columns, blocks) = if choose_first(i) {
            first.row(i)
        } else {
            second.row(i)
        };
        matrix.columns.extend_from_slice(columns);
        matrix.values.extend_from_slice(blocks);
        matrix.row_offsets.push(matrix.columns.len());
    }
    matrix
}

/// Element stiffness on the unit square or cube, `λ = μ = 1`, two Gauss points along each axis; corner `c` has bit
/// `k` of `c` as its coordinate along axis `k`.
fn unit_element(d: usize) -> Vec<f64> {
    let corners = 1usize << d;
    let n = corners * d;
    let mut stiffness = vec![0.0; n * n];
    let gauss = [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()];
    let weight = 0.5f64.powi(d as i32);
    for point in 0..corners {
        let gradient: Vec<[f64; 3]> = (0..corners)
            .map(|c| {
                std::array::from_fn(|k| {
                    if k >= d {
                        return 0.0;
                    }
                    (0..d)
                        .map(|l| {
                            let x = gauss[point >> l & 1];
                            match (l == k, c >> l & 1 == 1) {
                                (true, high) => {
                                    if high {
                                        1.0
                                    } else {
                                        -1.0
                                    }
                                }
                                (false, true) => x,
                                (false, false) => 1.0 - x,
                            }
                        })
                        .product()
                })
            })
            .collect();
        for (i, gi) in gradient.iter().enumerate() {
            for (j, gj) in gradient.iter().enumerate() {
                let trace: f64 = (0..d).map(|k| gi[k] * gj[k]).sum();
                for a in 0..d {
                    for b in 0..d {
                        let same = if a == b { trace } else { 0.0 };
                        stiffness[(i * d + a) * n + j * d + b] +=
                            weight * (gi[a] * gj[b] + gi[b] * gj[a] + same);
                    }
                }
            }
        }
    }
    stiffness
}
