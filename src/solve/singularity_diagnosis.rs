//! Names the free motions in a singular system.
//!
//! Before factorisation: free dofs with an empty row, and connected bodies whose prescribed dofs do not hold all their
//! rigid-body modes. After a tiny pivot: the null vector by inverse iteration, for mechanisms that are not rigid.

use crate::progress::Silent;
use crate::solve::FreeDofs;
use crate::solve::direct::{Analysis, Factor};
use crate::solve::direct_params::DirectParams;
use crate::solve::ordering::Ordering;
use crate::system::{BlockCsr, Spread};
use crate::tensor::AXES;
use nalgebra::{DMatrix, DVector};

/// Sites that can move without resistance.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeMotion {
    /// The sites that move, ascending.
    pub sites: Vec<usize>,
    /// Their free motions, in words: rigid-body modes by name, an empty row, or a mechanism.
    pub modes: Vec<String>,
    /// The remedy.
    pub remedy: String,
}

/// A rigid mode whose squared size on the prescribed dofs is below this fraction of its squared size on the body is
/// not held. Round-off in the 6 × 6 Gram matrix is 1e-16 to 1e-15; a 2D bar with 1e5 sites held at two neighbouring
/// ones, its rotation barely held, has 1e-10.
const HELD: f64 = 1e-13;

/// A force this far below the stiffness times the motion is zero: far above the round-off of assembly, far below a
/// spring that anybody would call a support.
const NO_FORCE: f64 = 1e-10;

/// The rigid-body modes of sites in `block` dimensions (1, 3 or 6 of them), values at position `x` relative to a
/// centre and scaled by `scale` (both keep the numbers near one): `modes[m][component]`.
pub(crate) fn rigid_modes(block: usize, x: [f64; 3], scale: f64) -> Vec<[f64; 3]> {
    let [x, y, z] = x.map(|v| v / scale);
    match block {
        1 => vec![[1.0, 0.0, 0.0]],
        2 => vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-y, x, 0.0]],
        _ => vec![
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, -z, y],
            [z, 0.0, -x],
            [-y, x, 0.0],
        ],
    }
}

fn mode_name(block: usize, mode: usize) -> String {
    if mode < block {
        format!("translation along {}", AXES[mode])
    } else if block == 2 {
        "rotation in the x-y plane".to_owned()
    } else {
        format!("rotation about {}", AXES[mode - block])
    }
}

/// The rows of a matrix that this process holds: all, or those of its own sites.
#[derive(Clone, Copy)]
pub(crate) struct HeldRows<'a> {
    pub matrix: &'a BlockCsr,
    /// The partition, where sites are spread over ranks; every function of these rows is then collective.
    pub spread: Option<Spread<'a>>,
}

impl HeldRows<'_> {
    /// Number of sites, held or not.
    fn sites(&self) -> usize {
        self.spread
            .map_or(self.matrix.rows(), |s| s.partition.sites())
    }

    /// The site of a row.
    fn site(&self, row: usize) -> usize {
        self.spread.map_or(row, |s| s.own()[row] as usize)
    }

    /// The row of a site, if it is held.
    fn row(&self, site: usize) -> Option<usize> {
        match self.spread {
            None => Some(site),
            Some(s) => s.partition.row(s.ranks.rank(), site as u32),
        }
    }

    /// The largest of a number over all who hold rows.
    fn largest(&self, own: f64) -> f64 {
        self.spread.map_or(own, |s| s.largest(own))
    }
}

/// Connected bodies: the body number of each site, and how many there are. Zero blocks connect nothing.
fn bodies(rows: &HeldRows<'_>) -> (Vec<u32>, usize) {
    let (matrix, n) = (rows.matrix, rows.sites());
    let mut root: Vec<u32> = (0..n as u32).collect();
    fn find(root: &mut [u32], mut i: u32) -> u32 {
        while root[i as usize] != i {
            root[i as usize] = root[root[i as usize] as usize];
            i = root[i as usize];
        }
        i
    }
    // the smaller site number leads, so that bodies are numbered by their first site
    fn join(root: &mut [u32], i: u32, j: u32) {
        let (a, b) = (find(root, i), find(root, j));
        root[a.max(b) as usize] = a.min(b);
    }
    let size = matrix.block * matrix.block;
    for r in 0..matrix.rows() {
        let i = rows.site(r) as u32;
        let (columns, blocks) = matrix.row(r);
        for (e, &c) in columns.iter().enumerate() {
            if find(&mut root, i) != find(&mut root, c)
                && blocks[e * size..(e + 1) * size].iter().any(|&k| k != 0.0)
            {
                join(&mut root, i, c);
            }
        }
    }
    if let Some(spread) = rows.spread {
        let joined = (0..n as u32).filter(|&i| root[i as usize] != i);
        let own: Vec<u64> = joined
            .map(|i| u64::from(i) << 32 | u64::from(root[i as usize]))
            .collect();
        for pair in spread.ranks.gather_words(&own).into_iter().flatten() {
            join(&mut root, (pair >> 32) as u32, pair as u32);
        }
    }
    let mut number = vec![0u32; n];
    let mut count = 0;
    for i in 0..n {
        let r = find(&mut root, i as u32) as usize;
        if r == i {
            number[i] = count;
            count += 1;
        } else {
            number[i] = number[r];
        }
    }
    (number, count as usize)
}

/// Finds bodies that the prescribed dofs do not hold, and free dofs without any stiffness; nothing if there are none.
pub(crate) fn unheld_bodies(
    rows: &HeldRows<'_>,
    free: &FreeDofs,
    positions: &[[f64; 3]],
) -> Option<FreeMotion> {
    let matrix = rows.matrix;
    let (body, count) = bodies(rows);
    let mut members = vec![Vec::new(); count];
    for (i, &b) in body.iter().enumerate() {
        members[b as usize].push(i);
    }
    let mut found = FreeMotion {
        sites: Vec::new(),
        modes: Vec::new(),
        remedy: String::new(),
    };
    let mut unheld = 0;
    for sites in &members {
        if sites.iter().all(|&i| free.count_of_site(i) == 0) {
            continue;
        }
        let motions = free_rigid_motions(rows, free, positions, sites);
        if motions.is_empty() {
            continue;
        }
        unheld += 1;
        for m in motions {
            if !found.modes.contains(&m) {
                found.modes.push(m);
            }
        }
        found
            .sites
            .extend(sites.iter().copied().filter(|&i| free.count_of_site(i) > 0));
    }
    if unheld > 0 {
        let all = found.sites.len() == rows.sites();
        found.remedy = if all {
            "prescribe displacements that hold these motions".to_owned()
        } else {
            format!(
                "{unheld} of {count} separate bodies are not held: prescribe displacements on them, reconnect them \
                 (bonds cut by a crack or a void?), or remove their sites"
            )
        };
        found.sites.sort_unstable();
        return Some(found);
    }
    let mut empty: Vec<usize> = (0..matrix.rows())
        .filter(|&r| {
            let d = matrix.block;
            let (_, blocks) = matrix.row(r);
            free.of_site(rows.site(r)).any(|a| {
                blocks
                    .chunks(d * d)
                    .all(|k| k[a * d..(a + 1) * d].iter().all(|&v| v == 0.0))
            })
        })
        .map(|r| rows.site(r))
        .collect();
    if let Some(spread) = rows.spread {
        let own: Vec<u64> = empty.iter().map(|&site| site as u64).collect();
        let all = spread.ranks.gather_words(&own).into_iter().flatten();
        empty = all.map(|site| site as usize).collect();
        empty.sort_unstable();
    }
    (!empty.is_empty()).then(|| FreeMotion {
        sites: empty,
        modes: vec!["a displacement component without any stiffness".to_owned()],
        remedy: "prescribe it, or give the site a stiffness in that direction".to_owned(),
    })
}

/// Names of the rigid modes that `sites` keep: those that vanish on the prescribed dofs and meet no force.
fn free_rigid_motions(
    rows: &HeldRows<'_>,
    free: &FreeDofs,
    positions: &[[f64; 3]],
    sites: &[usize],
) -> Vec<String> {
    let d = rows.matrix.block;
    let inverse = 1.0 / sites.len() as f64;
    let centre: [f64; 3] =
        std::array::from_fn(|k| sites.iter().map(|&i| positions[i][k]).sum::<f64>() * inverse);
    let relative = |i: usize| -> [f64; 3] { std::array::from_fn(|k| positions[i][k] - centre[k]) };
    let radius = sites
        .iter()
        .map(|&i| relative(i).iter().map(|v| v * v).sum::<f64>())
        .fold(0.0, f64::max)
        .sqrt();
    let scale = if radius > 0.0 { radius } else { 1.0 };
    let modes = rigid_modes(d, [0.0; 3], 1.0).len();
    let (mut whole, mut held) = (
        DMatrix::<f64>::zeros(modes, modes),
        DMatrix::<f64>::zeros(modes, modes),
    );
    for &i in sites {
        let r = rigid_modes(d, relative(i), scale);
        for a in 0..d {
            let v = DVector::from_iterator(modes, r.iter().map(|m| m[a]));
            let outer = &v * v.transpose();
            whole += &outer;
            if !free.is_free(i, a) {
                held += outer;
            }
        }
    }
    // modes that are no motion of this body at all (the rotation of a single site) do not count
    let total = whole.trace();
    let motions = whole.symmetric_eigen();
    let real: Vec<usize> = (0..modes)
        .filter(|&k| motions.eigenvalues[k] > HELD * total)
        .collect();
    let mut basis = DMatrix::<f64>::zeros(modes, real.len());
    for (column, &k) in real.iter().enumerate() {
        basis.set_column(
            column,
            &(motions.eigenvectors.column(k) / motions.eigenvalues[k].sqrt()),
        );
    }
    let grip = (basis.transpose() * held * &basis).symmetric_eigen();
    let mut names = Vec::new();
    for k in 0..real.len() {
        if grip.eigenvalues[k] > HELD {
            continue;
        }
        let c = &basis * grip.eigenvectors.column(k);
        let motion = |i: usize| -> [f64; 3] {
            let r = rigid_modes(d, relative(i), scale);
            std::array::from_fn(|a| (0..modes).map(|m| c[m] * r[m][a]).sum())
        };
        if meets_no_force(rows, free, sites, motion) {
            // a mode is named by its parts; tiny parts are round-off
            let largest = c.amax();
            for m in 0..modes {
                let name = mode_name(d, m);
                if c[m].abs() > 1e-6 * largest && !names.contains(&name) {
                    names.push(name);
                }
            }
        }
    }
    names
}

/// Returns true if the internal force of a motion of `sites` vanishes on their free dofs.
fn meets_no_force(
    rows: &HeldRows<'_>,
    free: &FreeDofs,
    sites: &[usize],
    motion: impl Fn(usize) -> [f64; 3],
) -> bool {
    let matrix = rows.matrix;
    let d = matrix.block;
    let (mut force, mut stiffness, mut size) = (0.0_f64, 0.0_f64, 0.0_f64);
    for &i in sites {
        let Some(row) = rows.row(i) else {
            continue;
        };
        let (columns, blocks) = matrix.row(row);
        let mut f = [0.0; 3];
        for (e, &c) in columns.iter().enumerate() {
            let u = motion(c as usize);
            for a in 0..d {
                for b in 0..d {
                    let k = blocks[e * d * d + a * d + b];
                    f[a] += k * u[b];
                    stiffness = stiffness.max(k.abs());
                    size = size.max(u[b].abs());
                }
            }
        }
        for a in free.of_site(i) {
            force = force.max(f[a].abs());
        }
    }
    let [force, stiffness, size] = [force, stiffness, size].map(|own| rows.largest(own));
    force <= NO_FORCE * stiffness * size
}

/// The sites that move in the null vector of a matrix, by inverse iteration with a shifted matrix; nothing if the
/// matrix has none.
pub(crate) fn mechanism(
    matrix: &BlockCsr,
    free: &FreeDofs,
    positions: &[[f64; 3]],
    ordering: Ordering,
) -> Option<FreeMotion> {
    let v = null_vector(matrix, free, positions, ordering)?;
    let d = matrix.block;
    let size: Vec<f64> = v
        .chunks(d)
        .map(|u| u.iter().map(|x| x * x).sum::<f64>().sqrt())
        .collect();
    let largest = size.iter().fold(0.0, |a: f64, &b| a.max(b));
    let all: Vec<usize> = (0..size.len()).collect();
    let motion = |i: usize| std::array::from_fn(|a| if a < d { v[i * d + a] } else { 0.0 });
    let rows = HeldRows {
        matrix,
        spread: None,
    };
    meets_no_force(&rows, free, &all, motion).then(|| {
        moving(
            (0..size.len())
                .filter(|&i| size[i] > 1e-3 * largest)
                .collect(),
        )
    })
}

/// The report of a mechanism that moves `sites`.
pub(crate) fn moving(sites: Vec<usize>) -> FreeMotion {
    FreeMotion {
        sites,
        modes: vec!["a mechanism: a motion that is not rigid and meets no force".to_owned()],
        remedy: "hold these sites, or give the joint a stiffness (a hinge between two sites, a family with too few \
                 bonds?)"
            .to_owned(),
    }
}

fn null_vector(
    matrix: &BlockCsr,
    free: &FreeDofs,
    positions: &[[f64; 3]],
    ordering: Ordering,
) -> Option<Vec<f64>> {
    let d = matrix.block;
    let mut shifted = matrix.unshare();
    let mut shift = vec![0.0; matrix.dofs()];
    for i in 0..matrix.rows() {
        let (columns, _) = matrix.row(i);
        let e = matrix.row_offsets[i] + columns.binary_search(&(i as u32)).ok()?;
        for a in 0..d {
            let k = &mut shifted.values[e * d * d + a * d + a];
            // far above round-off, far below the stiffness of anything that is held
            shift[i * d + a] = 1e-9 * k.abs();
            *k += shift[i * d + a];
        }
    }
    let analysis = Analysis::new(&shifted, free, positions, ordering).ok()?;
    let params = DirectParams {
        smallest_pivot: 0.0,
        ..DirectParams::default()
    };
    let (factor, _) = Factor::new(&shifted, free, analysis, &params, &Silent).ok()?;
    // any start with a part of every site will do; this one is fixed
    let mut v: Vec<f64> = (0..matrix.dofs())
        .map(|k| 1.0 + ((k * 7919) % 1013) as f64 / 1013.0)
        .collect();
    for _ in 0..3 {
        let rhs: Vec<f64> = v.iter().zip(&shift).map(|(x, s)| x * s).collect();
        v = factor.solve(&rhs);
        let largest = v.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
        if !(largest.is_finite() && largest > 0.0) {
            return None;
        }
        v.iter_mut().for_each(|x| *x /= largest);
    }
    Some(v)
}
