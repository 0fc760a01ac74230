use super::*;
use crate::progress::Silent;
use crate::solve::stencils::{StencilGrid, splice};
use nalgebra::{DMatrix, DVector};

struct Case {
    matrix: BlockCsr,
    symmetry: Symmetry,
    positions: Vec<[f64; 3]>,
    load: Vec<f64>,
    prescribed: Vec<Option<f64>>,
}

impl Case {
    fn new(lattice: &StencilGrid, matrix: BlockCsr, symmetry: Symmetry) -> Case {
        let n = matrix.dofs();
        Case {
            matrix,
            symmetry,
            positions: lattice.positions(),
            load: (0..n).map(|k| ((k * 37) % 11) as f64 - 5.0).collect(),
            prescribed: vec![None; n],
        }
    }

    /// The face x = 0 is held in all components, the far face in its last one only.
    fn held(mut self) -> Case {
        let d = self.matrix.block;
        let far = self.positions.iter().fold(0.0, |m: f64, x| m.max(x[0]));
        for (i, x) in self.positions.iter().enumerate() {
            for a in 0..d {
                if x[0] == 0.0 {
                    self.prescribed[i * d + a] = Some(0.1 * x[1] - 0.02 * a as f64);
                }
            }
            if x[0] == far {
                self.prescribed[i * d + d - 1] = Some(0.3);
            }
        }
        self
    }

    fn solve(&self, params: &StaticParams) -> Result<StaticSolution, StaticError> {
        let problem = StaticProblem {
            stiffness: &self.matrix,
            symmetry: self.symmetry,
            positions: &self.positions,
            load: &self.load,
            prescribed: &self.prescribed,
        };
        solve(&problem, params, &Silent)
    }

    fn dense(&self) -> DMatrix<f64> {
        let d = self.matrix.block;
        let mut k = DMatrix::zeros(self.matrix.dofs(), self.matrix.dofs());
        for i in 0..self.matrix.rows() {
            let (columns, blocks) = self.matrix.row(i);
            for (e, &c) in columns.iter().enumerate() {
                for a in 0..d {
                    for b in 0..d {
                        k[(i * d + a, c as usize * d + b)] = blocks[e * d * d + a * d + b];
                    }
                }
            }
        }
        k
    }

    /// The solution by dense LU of the free rows and columns.
    fn oracle(&self) -> Vec<f64> {
        let k = self.dense();
        let free: Vec<usize> = (0..self.load.len())
            .filter(|&i| self.prescribed[i].is_none())
            .collect();
        let mut u: Vec<f64> = self.prescribed.iter().map(|p| p.unwrap_or(0.0)).collect();
        let known = &k * DVector::from_column_slice(&u);
        let reduced = DMatrix::from_fn(free.len(), free.len(), |i, j| k[(free[i], free[j])]);
        let rhs = DVector::from_fn(free.len(), |i, _| self.load[free[i]] - known[free[i]]);
        let x = reduced
            .lu()
            .solve(&rhs)
            .expect("the oracle's matrix is regular");
        free.iter().zip(x.iter()).for_each(|(&i, &x)| u[i] = x);
        u
    }
}

fn cases() -> Vec<(&'static str, Case)> {
    let plane = StencilGrid::rectangle(14, 9);
    let solid = StencilGrid::block(6, 5, 4);
    let inner = |x: [f64; 3]| x[0] > 3.0 && x[0] < 9.0;
    let (p, s) = (plane.positions(), solid.positions());
    use Symmetry::{Symmetric, Unsymmetric};
    vec![
        (
            "2D bonds",
            Case::new(&plane, plane.bonds(3), Symmetric).held(),
        ),
        (
            "2D elements",
            Case::new(&plane, plane.elements(), Symmetric).held(),
        ),
        (
            "2D splice",
            Case::new(
                &plane,
                splice(&plane.bonds(3), &plane.elements(), |i| inner(p[i])),
                Unsymmetric,
            )
            .held(),
        ),
        (
            "3D bonds",
            Case::new(&solid, solid.bonds(2), Symmetric).held(),
        ),
        (
            "3D splice",
            Case::new(
                &solid,
                splice(&solid.bonds(2), &solid.elements(), |i| s[i][0] > 2.5),
                Unsymmetric,
            )
            .held(),
        ),
    ]
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(x, y)| x - y)) / norm(&mut b.iter().copied())
}

#[test]
fn direct_agrees_with_dense_lu_for_every_ordering() {
    for (name, case) in cases() {
        let expected = case.oracle();
        for ordering in [
            Ordering::CoordinateNestedDissection,
            Ordering::Metis,
            Ordering::Amd,
        ] {
            let params = StaticParams {
                method: Method::Direct,
                ordering,
                ..StaticParams::default()
            };
            let solution = case.solve(&params).expect(name);
            let error = distance(&solution.displacement, &expected);
            assert!(error < 1e-11, "{name} {ordering:?}: {error:e}");
            assert!(
                solution.info.relative_residual < 1e-13,
                "{name}: {:?}",
                solution.info
            );
            let used = if case.symmetry == Symmetry::Symmetric {
                MethodUsed::Cholesky
            } else {
                MethodUsed::Lu
            };
            assert_eq!(solution.info.method, used, "{name}");
        }
    }
}

#[test]
fn krylov_agrees_with_direct() {
    let (plane, solid) = (
        StencilGrid::rectangle(70, 60),
        StencilGrid::block(16, 14, 12),
    );
    let x = plane.positions();
    let y = solid.positions();
    use Symmetry::{Symmetric, Unsymmetric};
    let cases = [
        (&plane, plane.bonds(3), Symmetric),
        (&plane, plane.elements(), Symmetric),
        (
            &plane,
            splice(&plane.bonds(3), &plane.elements(), |i| {
                (x[i][0] - 35.0).abs() < 12.0
            }),
            Unsymmetric,
        ),
        (&solid, solid.bonds(2), Symmetric),
        (
            &solid,
            splice(&solid.bonds(2), &solid.elements(), |i| {
                (y[i][0] - 8.0).abs() < 4.0
            }),
            Unsymmetric,
        ),
    ];
    for (lattice, matrix, symmetry) in cases {
        let case = Case::new(lattice, matrix, symmetry).held();
        let direct = case
            .solve(&StaticParams {
                method: Method::Direct,
                ..StaticParams::default()
            })
            .expect("direct");
        let params = StaticParams {
            method: Method::Krylov,
            tolerance: 1e-12,
            ..StaticParams::default()
        };
        let krylov = case.solve(&params).expect("krylov");
        let error = distance(&krylov.displacement, &direct.displacement);
        println!("{symmetry:?} {error:e} {:?}", krylov.info);
        assert!(error < 1e-8, "{error:e}");
        assert!(krylov.info.relative_residual <= 1e-12);
        // multigrid keeps the count of iterations low whatever the size
        assert!(krylov.info.iterations <= 40, "{:?}", krylov.info);
    }
}

#[test]
fn reactions_balance_the_load() {
    // symmetric models conserve momentum, so that the reactions and the load add up to nothing
    for (name, case) in cases()
        .into_iter()
        .filter(|(_, c)| c.symmetry == Symmetry::Symmetric)
    {
        let solution = case.solve(&StaticParams::default()).expect(name);
        let d = case.matrix.block;
        for a in 0..d {
            let total: f64 = (0..case.matrix.rows())
                .map(|i| solution.reactions[i * d + a])
                .zip(0..)
                .map(|(r, i): (f64, usize)| {
                    let k = i * d + a;
                    // the load on a prescribed dof goes straight into the support
                    r + case.load[k]
                })
                .sum();
            assert!(total.abs() < 1e-9, "{name}: {total:e}");
        }
    }
}

#[test]
fn prescribed_values_are_kept_component_by_component() {
    for (name, case) in cases() {
        let solution = case.solve(&StaticParams::default()).expect(name);
        for (k, p) in case.prescribed.iter().enumerate() {
            match p {
                Some(value) => assert_eq!(solution.displacement[k], *value, "{name}"),
                None => assert_eq!(solution.reactions[k], 0.0, "{name}"),
            }
        }
    }
}

#[test]
fn results_have_the_same_bits_on_any_number_of_threads() {
    let lattice = StencilGrid::rectangle(70, 60);
    let x = lattice.positions();
    let spliced = splice(&lattice.bonds(3), &lattice.elements(), |i| x[i][0] > 30.0);
    for (matrix, symmetry) in [
        (lattice.bonds(3), Symmetry::Symmetric),
        (spliced, Symmetry::Unsymmetric),
    ] {
        let case = Case::new(&lattice, matrix, symmetry).held();
        let run = |threads: usize, method: Method| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("pool");
            pool.install(|| {
                case.solve(&StaticParams {
                    method,
                    ..StaticParams::default()
                })
                .expect("solved")
                .displacement
            })
        };
        for method in [Method::Direct, Method::Krylov] {
            let one = run(1, method);
            assert_eq!(one, run(2, method));
            assert_eq!(one, run(5, method));
        }
    }
}

fn singular(case: &Case) -> (Vec<usize>, Vec<String>, String) {
    let error = case
        .solve(&StaticParams::default())
        .expect_err("the system is singular");
    let message = error.to_string();
    match error {
        StaticError::Singular {
            sites,
            modes,
            positions,
            ..
        } => {
            assert_eq!(positions.len(), sites.len().min(LISTED));
            (sites, modes, message)
        }
        other => panic!("{other}"),
    }
}

#[test]
fn a_free_body_is_named_with_all_its_motions() {
    let plane = StencilGrid::rectangle(8, 5);
    let (sites, modes, message) = singular(&Case::new(&plane, plane.bonds(2), Symmetry::Symmetric));
    assert_eq!(sites.len(), 40);
    assert_eq!(modes.len(), 3, "{modes:?}");
    assert!(message.contains("prescribe displacements"), "{message}");
    let solid = StencilGrid::block(3, 4, 3);
    let (_, modes, _) = singular(&Case::new(&solid, solid.elements(), Symmetry::Symmetric));
    assert_eq!(modes.len(), 6, "{modes:?}");
}

#[test]
fn one_pinned_point_leaves_a_rotation() {
    let plane = StencilGrid::rectangle(8, 5);
    let mut case = Case::new(&plane, plane.elements(), Symmetry::Symmetric);
    case.prescribed[0] = Some(0.0);
    case.prescribed[1] = Some(0.0);
    let (sites, modes, _) = singular(&case);
    assert_eq!(sites.len(), 39);
    assert!(
        modes.contains(&"rotation in the x-y plane".to_owned()),
        "{modes:?}"
    );
    // a second pinned component beside it takes the rotation away
    case.prescribed[3] = Some(0.0);
    case.solve(&StaticParams::default()).expect("held");
}

/// Removes every block between the two groups of sites, as cut bonds do.
fn cut(case: &mut Case, group: impl Fn(usize) -> bool) {
    let d = case.matrix.block;
    for i in 0..case.matrix.rows() {
        let (a, b) = (case.matrix.row_offsets[i], case.matrix.row_offsets[i + 1]);
        let mut lost = [0.0; 9];
        for e in a..b {
            let j = case.matrix.columns[e] as usize;
            if group(i) != group(j) {
                let block = &mut case.matrix.values[e * d * d..(e + 1) * d * d];
                for (l, k) in lost.iter_mut().zip(block.iter()) {
                    *l += k;
                }
                block.fill(0.0);
            }
        }
        let own = a + case.matrix.columns[a..b]
            .binary_search(&(i as u32))
            .expect("diagonal");
        for (k, l) in case.matrix.values[own * d * d..(own + 1) * d * d]
            .iter_mut()
            .zip(&lost)
        {
            *k += l;
        }
    }
}

#[test]
fn a_detached_fragment_and_an_isolated_site_are_named() {
    let plane = StencilGrid::rectangle(12, 7);
    let mut case = Case::new(&plane, plane.bonds(2), Symmetry::Symmetric).held();
    let x = plane.positions();
    let inside = |i: usize| (4.0..=6.0).contains(&x[i][0]) && (2.0..=4.0).contains(&x[i][1]);
    cut(&mut case, inside);
    let (sites, _, message) = singular(&case);
    assert_eq!(
        sites,
        (0..x.len()).filter(|&i| inside(i)).collect::<Vec<_>>()
    );
    assert!(message.contains("1 of 2 separate bodies"), "{message}");

    let mut case = Case::new(&plane, plane.bonds(2), Symmetry::Symmetric).held();
    cut(&mut case, |i| i == 40);
    let (sites, modes, _) = singular(&case);
    assert_eq!(sites, [40]);
    // a single site cannot rotate
    assert_eq!(modes, ["translation along x", "translation along y"]);
}

#[test]
fn a_hinge_is_found_by_its_pivot() {
    // two blocks of elements share one site: the second turns about it
    let plane = StencilGrid::rectangle(5, 5);
    let k = plane.elements();
    let n = plane.len();
    let hinge = 24;
    let number = |half: usize, i: usize| {
        if half == 0 {
            i
        } else if i == 0 {
            hinge
        } else {
            n + i - 1
        }
    };
    let mut rows = vec![std::collections::BTreeMap::<usize, [f64; 4]>::new(); 2 * n - 1];
    for half in 0..2 {
        for i in 0..n {
            let (columns, blocks) = k.row(i);
            for (e, &c) in columns.iter().enumerate() {
                let entry = rows[number(half, i)]
                    .entry(number(half, c as usize))
                    .or_default();
                entry
                    .iter_mut()
                    .zip(&blocks[e * 4..])
                    .for_each(|(v, b)| *v += b);
            }
        }
    }
    let mut matrix = BlockCsr {
        block: 2,
        row_offsets: vec![0],
        ..BlockCsr::default()
    };
    for row in rows {
        for (c, block) in row {
            matrix.columns.push(c as u32);
            matrix.values.extend(block);
        }
        matrix.row_offsets.push(matrix.columns.len());
    }
    let x = plane.positions();
    let mut positions = x.clone();
    positions.extend(x[1..].iter().map(|p| [p[0] + 4.0, p[1] + 4.0, 0.0]));
    let dofs = matrix.dofs();
    for symmetry in [Symmetry::Symmetric, Symmetry::Unsymmetric] {
        let mut case = Case {
            matrix: matrix.clone(),
            symmetry,
            positions: positions.clone(),
            load: vec![1.0; dofs],
            prescribed: vec![None; dofs],
        };
        for i in (0..n).filter(|&i| x[i][0] == 0.0) {
            case.prescribed[2 * i] = Some(0.0);
            case.prescribed[2 * i + 1] = Some(0.0);
        }
        let (sites, modes, _) = singular(&case);
        assert_eq!(sites, (n..2 * n - 1).collect::<Vec<_>>(), "{symmetry:?}");
        assert!(modes[0].contains("mechanism"), "{modes:?}");
    }
}

#[test]
fn a_symmetric_indefinite_system_falls_back_to_lu() {
    let plane = StencilGrid::rectangle(6, 5);
    let mut case = Case::new(&plane, plane.elements(), Symmetry::Symmetric).held();
    let e = case.matrix.row_offsets[9] + case.matrix.row(9).0.binary_search(&9).expect("diagonal");
    case.matrix.values[4 * e] -= 20.0;
    let solution = case.solve(&StaticParams::default()).expect("regular");
    assert_eq!(solution.info.method, MethodUsed::Lu);
    assert!(distance(&solution.displacement, &case.oracle()) < 1e-11);
}

#[test]
fn wrong_shapes_and_numbers_are_refused() {
    let plane = StencilGrid::rectangle(4, 3);
    let mut case = Case::new(&plane, plane.elements(), Symmetry::Symmetric).held();
    case.load[5] = f64::NAN;
    let message = case
        .solve(&StaticParams::default())
        .expect_err("not a number")
        .to_string();
    assert!(
        message.contains("load of site 2 at [2.0, 0.0, 0.0]"),
        "{message}"
    );
    case.load.pop();
    let message = case
        .solve(&StaticParams::default())
        .expect_err("short")
        .to_string();
    assert!(
        message.contains("23 entries") && message.contains("24"),
        "{message}"
    );
}

#[test]
fn auto_factorises_narrow_stencils_and_iterates_on_wide_ones_in_three_dimensions() {
    let plane = StencilGrid::rectangle(60, 60);
    let case = Case::new(&plane, plane.elements(), Symmetry::Symmetric).held();
    let info = case.solve(&StaticParams::default()).expect("solved").info;
    assert_eq!(info.method, MethodUsed::Cholesky);
    let solid = StencilGrid::block(17, 17, 17);
    let case = Case::new(&solid, solid.bonds(3), Symmetry::Symmetric).held();
    let info = case.solve(&StaticParams::default()).expect("solved").info;
    assert_eq!(info.method, MethodUsed::ConjugateGradients);
    assert!(info.relative_residual <= 1e-10);
    // too little memory for the factors leaves the iteration, and an error where that was ruled out
    let small = StaticParams {
        memory_limit: Some(1000),
        ..StaticParams::default()
    };
    let case = Case::new(&plane, plane.elements(), Symmetry::Symmetric).held();
    assert_eq!(
        case.solve(&small).expect("solved").info.method,
        MethodUsed::ConjugateGradients
    );
    let direct = StaticParams {
        method: Method::Direct,
        ..small
    };
    assert!(matches!(case.solve(&direct), Err(StaticError::TooLarge(_))));
}
