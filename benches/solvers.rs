//! Times the solvers against each other, all within one run, in seconds of CPU (the machine may be shared):
//! `cargo bench --bench solvers -- [direct|faer|krylov|products …] [CASE …]`; `-- crossover` direct against Krylov by size; `-- symmetric` a symmetric seam against a splice. `products` has the matrix by blocks beside that of sprs.

use bondline::progress::Silent;
use bondline::solve::direct::{Analysis, DirectParams, Factor};
use bondline::solve::krylov::{KrylovParams, conjugate_gradients, gmres};
use bondline::solve::multigrid::{Multigrid, MultigridParams};
use bondline::solve::ordering::{Ordering, SiteGraph};
use bondline::solve::statics::{Method, StaticParams, StaticProblem, solve};
use bondline::solve::stencils::{StencilGrid, splice};
use bondline::solve::{FreeDofs, FreeOperator};
use bondline::system::{BlockCsr, Symmetry};
use faer::Side;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use std::time::Instant;

#[path = "solvers/symmetric.rs"]
mod symmetric;

/// A matrix with the sites that belong to it.
struct Case {
    lattice: StencilGrid,
    matrix: BlockCsr,
    symmetry: Symmetry,
}

impl Case {
    fn symmetric(lattice: StencilGrid, matrix: BlockCsr) -> Case {
        Case {
            lattice,
            matrix,
            symmetry: Symmetry::Symmetric,
        }
    }

    /// PD in the middle half along each axis, FE around it.
    fn spliced(lattice: StencilGrid, m: usize) -> Case {
        let inside = |x: [f64; 3]| {
            (0..lattice.dimension).all(|k| {
                let half = 0.5 * (lattice.counts[k] - 1) as f64;
                (x[k] - half).abs() <= 0.5 * half
            })
        };
        let x = lattice.positions();
        let matrix = splice(&lattice.bonds(m), &lattice.elements(), |i| inside(x[i]));
        Case {
            lattice,
            matrix,
            symmetry: Symmetry::Unsymmetric,
        }
    }
}

type Make = fn() -> Case;

const CASES: [(&str, Make); 9] = [
    ("pd2d", || {
        let l = StencilGrid::rectangle(240, 240);
        Case::symmetric(l.clone(), l.bonds(6))
    }),
    ("pd2d-large", || {
        let l = StencilGrid::rectangle(480, 480);
        Case::symmetric(l.clone(), l.bonds(6))
    }),
    ("fe2d", || {
        let l = StencilGrid::rectangle(400, 400);
        Case::symmetric(l.clone(), l.elements())
    }),
    ("fe3d", || {
        let l = StencilGrid::block(40, 40, 40);
        Case::symmetric(l.clone(), l.elements())
    }),
    ("pd3d", || {
        let l = StencilGrid::block(30, 30, 30);
        Case::symmetric(l.clone(), l.bonds(3))
    }),
    ("splice2d-small", || {
        Case::spliced(StencilGrid::rectangle(120, 120), 6)
    }),
    ("splice2d", || {
        Case::spliced(StencilGrid::rectangle(240, 240), 6)
    }),
    ("splice3d-small", || {
        Case::spliced(StencilGrid::block(18, 18, 18), 3)
    }),
    ("splice3d", || {
        Case::spliced(StencilGrid::block(30, 30, 30), 3)
    }),
];

fn main() {
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    if let [first, rest @ ..] = wanted.as_slice()
        && first == symmetric::CHILD
    {
        return symmetric::child(rest);
    }
    if wanted.iter().any(|w| w == "symmetric") {
        return symmetric::compare();
    }
    if wanted.iter().any(|w| w == "crossover") {
        return crossover();
    }
    let asked = |name: &str, kinds: &[&str]| {
        let named: Vec<&String> = wanted
            .iter()
            .filter(|w| kinds.contains(&w.as_str()))
            .collect();
        named.is_empty() || named.iter().any(|w| *w == name)
    };
    let names = CASES.map(|(name, _)| name);
    let solvers = ["direct", "orderings", "faer", "krylov", "products"];
    for (name, make) in CASES {
        if !asked(name, &names) {
            continue;
        }
        let case = make();
        let d = case.lattice.dimension;
        let positions = case.lattice.positions();
        // the two faces across the first axis are held
        let prescribed: Vec<Option<f64>> = (0..case.matrix.dofs())
            .map(|k| {
                let x = positions[k / d][0] as usize;
                (x == 0 || x + 1 == case.lattice.counts[0]).then_some(0.0)
            })
            .collect();
        let free = FreeDofs::from_prescribed(&prescribed, d);
        println!(
            "{name}: {} free dofs, {} non-zeros",
            free.count(),
            case.matrix.nonzeros()
        );
        let bench = Bench {
            case: &case,
            positions: &positions,
            free: &free,
        };
        if asked("direct", &solvers) {
            bench.direct(Ordering::CoordinateNestedDissection, Symmetry::Symmetric);
            if name != "pd2d-large" {
                bench.direct(Ordering::CoordinateNestedDissection, Symmetry::Unsymmetric);
            }
        }
        if asked("orderings", &solvers) {
            bench.direct(Ordering::Metis, case.symmetry);
            bench.direct(Ordering::Amd, case.symmetry);
        }
        if asked("krylov", &solvers) {
            bench.krylov();
        }
        if asked("faer", &solvers) {
            bench.faer();
        }
        if asked("products", &solvers) {
            bench.products();
        }
    }
}

/// Direct against Krylov over a range of sizes: where `Method::Auto` should change over.
fn crossover() {
    let flat = [40, 60, 80, 120, 160].map(|n| StencilGrid::rectangle(n, n));
    let solid = [8, 10, 12, 16, 20].map(|n| StencilGrid::block(n, n, n));
    for lattice in flat.into_iter().chain(solid) {
        let m = if lattice.dimension == 2 { 4 } else { 3 };
        let models = [
            (
                "elements",
                Case::symmetric(lattice.clone(), lattice.elements()),
            ),
            ("bonds", Case::symmetric(lattice.clone(), lattice.bonds(m))),
            ("splice", Case::spliced(lattice.clone(), m)),
        ];
        for (name, case) in models {
            let positions = lattice.positions();
            let d = lattice.dimension;
            let prescribed: Vec<Option<f64>> = (0..case.matrix.dofs())
                .map(|k| (positions[k / d][0] == 0.0).then_some(0.0))
                .collect();
            let free = FreeDofs::from_prescribed(&prescribed, d);
            let bench = Bench {
                case: &case,
                positions: &positions,
                free: &free,
            };
            let load = bench.load();
            let seconds = [Method::Direct, Method::Krylov].map(|method| {
                let problem = StaticProblem {
                    stiffness: &case.matrix,
                    symmetry: case.symmetry,
                    positions: &positions,
                    load: &load,
                    prescribed: &prescribed,
                };
                let params = StaticParams {
                    method,
                    ..StaticParams::default()
                };
                let (start, mut runs) = (cpu_seconds(), 0);
                // the clock ticks every 10 ms
                while cpu_seconds() - start < 0.5 {
                    solve(&problem, &params, &Silent).expect("solved");
                    runs += 1;
                }
                (cpu_seconds() - start) / runs as f64
            });
            println!(
                "{d}D {name}: {} dofs, direct {:.3}, krylov {:.3} cpu, direct / krylov {:.2}",
                free.count(),
                seconds[0],
                seconds[1],
                seconds[0] / seconds[1]
            );
        }
    }
}

struct Bench<'a> {
    case: &'a Case,
    positions: &'a [[f64; 3]],
    free: &'a FreeDofs,
}

impl Bench<'_> {
    fn load(&self) -> Vec<f64> {
        let d = self.free.block();
        (0..self.case.matrix.dofs())
            .map(|k| {
                if self.free.is_free(k / d, k % d) {
                    (k % 7) as f64 - 3.0
                } else {
                    0.0
                }
            })
            .collect()
    }

    fn residual(&self, x: &[f64]) -> f64 {
        let (d, load, product) = (self.free.block(), self.load(), self.case.matrix.multiply(x));
        let mut sums = (0.0, 0.0);
        for k in (0..x.len()).filter(|&k| self.free.is_free(k / d, k % d)) {
            sums.0 += (load[k] - product[k]).powi(2);
            sums.1 += load[k].powi(2);
        }
        f64::sqrt(sums.0 / sums.1)
    }

    fn direct(&self, ordering: Ordering, symmetry: Symmetry) {
        if self.case.symmetry == Symmetry::Unsymmetric && symmetry == Symmetry::Symmetric {
            return;
        }
        let params = DirectParams {
            symmetry,
            ..DirectParams::default()
        };
        let (wall, cpu) = (Instant::now(), cpu_seconds());
        let analysis =
            Analysis::new(&self.case.matrix, self.free, self.positions, ordering).expect("ordered");
        let made = Factor::new(&self.case.matrix, self.free, analysis, &params, &Silent);
        let (wall, cpu) = (wall.elapsed().as_secs_f64(), cpu_seconds() - cpu);
        let (factor, info) = made.expect("the case is regular");
        let start = cpu_seconds();
        let x = factor.solve(&self.load());
        let solve = cpu_seconds() - start;
        println!(
            "  own {symmetry:?} {ordering:?}: nnz {:.3e}, {:.3e} flops, {} fronts up to {}, ordering {:.2}, total {cpu:.2} \
             cpu ({wall:.2} wall, {:.1} Gflop/cpu s), solve {solve:.2}, residual {:.0e}, predicted {:.2} GB, stored {:.2} GB, \
             peak so far {:.2} GB",
            info.cost.factor_nnz as f64,
            info.cost.flops,
            info.fronts,
            info.largest_front,
            info.ordering_seconds,
            info.cost.flops / cpu * 1e-9,
            self.residual(&x),
            info.cost.bytes as f64 * 1e-9,
            factor.bytes() as f64 * 1e-9,
            peak(),
        );
    }

    /// Products with the matrix as it is, by blocks of its own in each row, and by sprs.
    fn products(&self) {
        let shared = &self.case.matrix;
        let mut apart = BlockCsr {
            block: shared.block,
            row_offsets: shared.row_offsets.clone(),
            columns: shared.columns.clone(),
            ..BlockCsr::default()
        };
        for i in 0..shared.rows() {
            apart.values.extend_from_slice(shared.row(i).1);
        }
        let scalar = shared.to_csr();
        let x = self.load();
        let mut y = vec![0.0; x.len()];
        let mut timed = |product: &mut dyn FnMut(&mut [f64])| {
            let (start, mut runs) = (cpu_seconds(), 0);
            while cpu_seconds() - start < 0.5 {
                product(&mut y);
                runs += 1;
            }
            (cpu_seconds() - start) / f64::from(runs)
        };
        let by_sprs = timed(&mut |y| {
            y.fill(0.0);
            sprs::prod::mul_acc_mat_vec_csr(scalar.view(), &x[..], y);
        });
        let by_blocks = timed(&mut |y| apart.multiply_into(&x, y));
        let as_it_is = timed(&mut |y| shared.multiply_into(&x, y));
        let bytes = |m: &BlockCsr| 8 * m.values.len() + 4 * m.columns.len();
        let of_sprs = 16 * scalar.nnz();
        println!(
            "  product: sprs {by_sprs:.2e} s, {:.3} GB; blocks {:.2} of that, {:.2} of the memory; as it is {:.2}, {:.2}",
            of_sprs as f64 * 1e-9,
            by_blocks / by_sprs,
            bytes(&apart) as f64 / of_sprs as f64,
            as_it_is / by_sprs,
            bytes(shared) as f64 / of_sprs as f64,
        );
    }

    fn krylov(&self) {
        let start = cpu_seconds();
        let (multigrid, info) = Multigrid::new(
            &self.case.matrix,
            self.free,
            self.positions,
            &MultigridParams::default(),
        )
        .expect("hierarchy");
        let setup = cpu_seconds() - start;
        let operator = FreeOperator::new(&self.case.matrix, self.free);
        let solver = match self.case.symmetry {
            Symmetry::Symmetric => conjugate_gradients,
            Symmetry::Unsymmetric => gmres,
        };
        let start = cpu_seconds();
        let (x, done) = solver(
            &operator,
            &multigrid,
            &self.load(),
            &KrylovParams::default(),
            &Silent,
        )
        .expect("converged");
        println!(
            "  krylov {:?}: levels {:?}, complexity {:.2}, set-up {setup:.2}, {} iterations {:.2} cpu, residual {:.0e}, peak so far {:.2} GB",
            self.case.symmetry,
            info.dofs,
            info.operator_complexity,
            done.iterations,
            cpu_seconds() - start,
            self.residual(&x),
            peak(),
        );
    }

    /// The free part of the matrix, columns compressed, in the order of elimination.
    fn permuted(
        &self,
        ordering: Ordering,
        keep: impl Fn(usize, usize) -> bool,
    ) -> SparseColMat<u32, f64> {
        let matrix = &self.case.matrix;
        let graph = SiteGraph::new(matrix, self.free);
        let order = ordering.order(&graph, self.positions).expect("order");
        let d = matrix.block;
        let mut number = vec![u32::MAX; matrix.dofs()];
        let mut dofs = Vec::new();
        for &v in &order {
            let i = graph.sites[v as usize] as usize;
            for a in self.free.of_site(i) {
                number[i * d + a] = dofs.len() as u32;
                dofs.push(i * d + a);
            }
        }
        // rows of the matrix are columns of its transpose
        let (mut offsets, mut rows, mut values) = (vec![0u32], Vec::new(), Vec::new());
        for &dof in &dofs {
            let (columns, blocks) = matrix.row(dof / d);
            let mut row = Vec::new();
            for (e, &c) in columns.iter().enumerate() {
                for b in self.free.of_site(c as usize) {
                    let to = number[c as usize * d + b];
                    if keep(number[dof] as usize, to as usize) {
                        row.push((to, blocks[e * d * d + dof % d * d + b]));
                    }
                }
            }
            row.sort_by_key(|r| r.0);
            rows.extend(row.iter().map(|r| r.0));
            values.extend(row.iter().map(|r| r.1));
            offsets.push(rows.len() as u32);
        }
        let n = dofs.len();
        SparseColMat::new(
            SymbolicSparseColMat::new_checked(n, n, offsets, None, rows),
            values,
        )
    }

    /// faer's own sparse factorisations of the same matrix: Cholesky in the same order, LU with COLAMD.
    fn faer(&self) {
        if self.case.symmetry == Symmetry::Symmetric {
            let upper = self.permuted(Ordering::CoordinateNestedDissection, |own, other| {
                other <= own
            });
            let identity: Vec<u32> = (0..upper.ncols() as u32).collect();
            let start = cpu_seconds();
            let symbolic = factorize_symbolic_cholesky(
                upper.symbolic(),
                Side::Upper,
                SymmetricOrdering::Custom(faer::perm::PermRef::new_checked(
                    &identity,
                    &identity,
                    identity.len(),
                )),
                Default::default(),
            )
            .expect("symbolic");
            let par = faer::get_global_parallelism();
            let mut values = vec![0.0; symbolic.len_val()];
            let mut memory = MemBuffer::new(
                symbolic.factorize_numeric_llt_scratch::<f64>(par, Default::default()),
            );
            symbolic
                .factorize_numeric_llt(
                    &mut values,
                    upper.as_ref(),
                    Side::Upper,
                    Default::default(),
                    par,
                    MemStack::new(&mut memory),
                    Default::default(),
                )
                .expect("positive definite");
            println!(
                "  faer LLT, same order: stored {:.2} GB, {:.2} cpu, peak so far {:.2} GB",
                8e-9 * values.len() as f64,
                cpu_seconds() - start,
                peak()
            );
        } else {
            let all = self.permuted(Ordering::CoordinateNestedDissection, |_, _| true);
            let start = cpu_seconds();
            let symbolic = SymbolicLu::try_new(all.symbolic()).expect("symbolic");
            let lu = Lu::try_new_with_symbolic(symbolic, all.as_ref()).expect("regular");
            println!(
                "  faer LU (COLAMD): {:.2} cpu, peak so far {:.2} GB",
                cpu_seconds() - start,
                peak()
            );
            drop(lu);
        }
    }
}

/// Seconds of CPU that this process has used on all threads.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text
        .rsplit(") ")
        .next()
        .unwrap_or("")
        .split_whitespace()
        .collect();
    let ticks = |k: usize| {
        fields
            .get(k)
            .and_then(|f| f.parse::<f64>().ok())
            .unwrap_or(0.0)
    };
    (ticks(11) + ticks(12)) / 100.0
}

/// Largest resident size so far, in gigabytes.
fn peak() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with("VmHWM")).unwrap_or("");
    line.split_whitespace()
        .nth(1)
        .and_then(|kb| kb.parse::<f64>().ok())
        .unwrap_or(0.0)
        * 1e-6
}
