//! Times the solvers against each other, all within one run: `cargo bench --bench solvers -- [CASE …]`.

use bondline::progress::Silent;
use bondline::solve::FreeDofs;
use bondline::solve::direct::{DirectParams, Factor};
use bondline::solve::ordering::Ordering;
use bondline::solve::stencils::{Lattice, splice};
use bondline::system::{BlockCsr, Symmetry};
use std::time::Instant;

fn main() {
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let cases: [(&str, fn() -> (BlockCsr, Lattice)); 6] = [
        ("pd2d", || {
            let l = Lattice::rectangle(240, 240);
            (l.bonds(6), l)
        }),
        ("pd2d-large", || {
            let l = Lattice::rectangle(480, 480);
            (l.bonds(6), l)
        }),
        ("fe3d", || {
            let l = Lattice::block(40, 40, 40);
            (l.elements(), l)
        }),
        ("pd3d", || {
            let l = Lattice::block(30, 30, 30);
            (l.bonds(3), l)
        }),
        ("fe2d", || {
            let l = Lattice::rectangle(400, 400);
            (l.elements(), l)
        }),
        ("splice2d", || {
            let l = Lattice::rectangle(240, 240);
            let (pd, fe) = (l.bonds(6), l.elements());
            let x = l.positions();
            let k = splice(&pd, &fe, |i| {
                (x[i][0] - 120.0).abs() < 60.0 && (x[i][1] - 120.0).abs() < 60.0
            });
            (k, l)
        }),
    ];
    for (name, make) in cases {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == name) {
            continue;
        }
        let (matrix, lattice) = make();
        let positions = lattice.positions();
        let d = lattice.dimension;
        // the two faces across the first axis are held
        let prescribed: Vec<Option<f64>> = (0..matrix.dofs())
            .map(|k| {
                let x = positions[k / d][0] as usize;
                (x == 0 || x + 1 == lattice.counts[0]).then_some(0.0)
            })
            .collect();
        let free = FreeDofs::from_prescribed(&prescribed, d);
        let load: Vec<f64> = prescribed
            .iter()
            .enumerate()
            .map(|(k, p)| {
                if p.is_none() {
                    (k % 7) as f64 - 3.0
                } else {
                    0.0
                }
            })
            .collect();
        println!(
            "{name}: {} free dofs, {} non-zeros",
            free.count(),
            matrix.nonzeros()
        );
        for ordering in [
            Ordering::CoordinateNestedDissection,
            Ordering::Metis,
            Ordering::Amd,
        ] {
            for symmetry in [Symmetry::Symmetric, Symmetry::Unsymmetric] {
                if name.starts_with("splice") && symmetry == Symmetry::Symmetric {
                    continue;
                }
                if ordering != Ordering::CoordinateNestedDissection && name == "pd2d-large" {
                    continue;
                }
                let params = DirectParams {
                    ordering,
                    symmetry,
                    ..DirectParams::default()
                };
                let (factor, info) =
                    Factor::new(&matrix, &free, &positions, &params, &Silent).expect("factor");
                let start = Instant::now();
                let x = factor.solve(&load);
                let seconds = start.elapsed().as_secs_f64();
                let r = matrix.multiply(&x);
                let mut sums = (0.0, 0.0);
                for k in 0..r.len() {
                    if prescribed[k].is_none() {
                        sums.0 += (load[k] - r[k]).powi(2);
                        sums.1 += load[k].powi(2);
                    }
                }
                println!(
                    "  {ordering:?} {symmetry:?}: nnz {:.3e} flops {:.3e} ({} fronts, largest {}) order {:.2}s factor {:.2}s ({:.1} Gflop/s) solve {:.2}s residual {:.1e} predicted {:.2} GB stored {:.2} GB peak rss {:.2} GB",
                    info.cost.factor_nnz as f64,
                    info.cost.flops,
                    info.fronts,
                    info.largest_front,
                    info.ordering_seconds,
                    info.factor_seconds,
                    info.cost.flops / info.factor_seconds * 1e-9,
                    seconds,
                    f64::sqrt(sums.0 / sums.1),
                    info.cost.bytes as f64 * 1e-9,
                    factor.bytes() as f64 * 1e-9,
                    peak(),
                );
            }
        }
    }
}

fn peak() -> f64 {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|s| {
            s.lines()
                .find(|l| l.starts_with("VmHWM"))
                .and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok())
        })
        .unwrap_or(0.0)
        * 1e-6
}
