//! Tests of rows and of assembly.

use super::*;

/// A ring of sites, each joined to the next ones; `skew` times an antisymmetric part.
fn ring(sites: usize, skew: f64) -> impl Fn(usize, &mut Row<2>) + Sync {
    move |site, row| {
        let k = Tensor::<2>::new(2.0, 1.0, 1.0, 3.0);
        for (step, sign) in [(1, 1.0), (sites - 1, -1.0)] {
            row.add_site(((site + step) % sites) as u32, &(k * (skew * sign - 1.0)));
        }
        row.add_site(((site + 5) % sites) as u32, &Tensor::zeros());
        row.add_site(site as u32, &(k * 2.0));
    }
}

#[test]
fn remembered_elements_are_told_apart() {
    let mut row = Row::<2>::new(1);
    let entry = |element: usize, a: usize, b: usize| {
        Tensor::<2>::repeat((100 * element + 10 * a + b) as f64)
    };
    let nodes: Vec<u32> = (10..18).collect();
    let asked = std::cell::Cell::new(0);
    // the third takes the place of the first
    for (element, times) in [(3, 1), (4, 2), (3, 2), (3 + ELEMENTS, 3), (3, 4), (4, 4)] {
        for local in [0, 5] {
            let fill = |blocks: &mut Vec<Tensor<2>>| {
                asked.set(asked.get() + 1);
                blocks.clear();
                blocks.extend((0..64).map(|k| entry(element, k / 8, k % 8)));
            };
            let mut seen = 0;
            row.element_row((element, &nodes), local, fill, |_, node, block| {
                assert_eq!(node, nodes[seen]);
                assert_eq!(*block, entry(element, local, seen), "{element}");
                seen += 1;
            });
            assert_eq!(seen, 8);
        }
        assert_eq!(asked.get(), times, "{element}");
    }
}

#[test]
fn the_pattern_is_that_of_the_matrix() {
    for skew in [0.0, 1e-3] {
        let sites = 10_000;
        let matrix = assemble_rows(sites, sites, |_| (), ring(sites, skew));
        let field: Vec<f64> = (0..2 * sites).map(|k| (k as f64).sin()).collect();
        let found = pattern(
            sites,
            std::slice::from_ref(&field),
            |_| (),
            ring(sites, skew),
        );
        for (a, b) in found.products[0].iter().zip(matrix.multiply(&field)) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
        assert_eq!(matrix.rows(), sites);
        assert_eq!(found.row_offsets.len(), sites + 1);
        assert_eq!(found.stored * 4, matrix.nonzeros());
        for i in [0, 255, 256, 4095, 4096, 9999] {
            let mut wanted = vec![
                ((i + sites - 1) % sites) as u32,
                i as u32,
                ((i + 1) % sites) as u32,
            ];
            wanted.sort_unstable();
            let row = found.row_offsets[i]..found.row_offsets[i + 1];
            assert_eq!(found.columns[row], wanted);
            assert_eq!(matrix.row(i).0.len(), 4);
            assert!(matrix.row(i).0.is_sorted());
        }
        let exact = matrix.asymmetry();
        if skew == 0.0 {
            assert!(
                exact == 0.0 && found.asymmetry < 1e-13,
                "{}",
                found.asymmetry
            );
        } else {
            let ratio = found.asymmetry / exact;
            assert!((0.01..10.0).contains(&ratio), "{ratio}");
        }
    }
}

#[test]
fn a_place_is_the_sum_of_its_weights() {
    let transfer = Transfer::from_rows([
        vec![(3, 0.25), (1, 0.5), (3, 0.25), (0, 0.0)],
        vec![],
        vec![(2, 1.0)],
    ]);
    assert_eq!(transfer.len(), 3);
    assert_eq!(transfer.row(0).collect::<Vec<_>>(), [(1, 0.5), (3, 0.5)]);
    assert_eq!(transfer.row(1).count(), 0);
    let u = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
    assert_eq!(
        transfer.displacement::<2>(0, &u),
        Vector::<2>::new(5.0, 6.0)
    );
    assert_eq!(
        transfer.displacement::<2>(2, &u),
        Vector::<2>::new(5.0, 6.0)
    );
}

#[test]
fn rows_are_sorted_summed_and_reused() {
    let transfer = Transfer::from_rows([vec![(5, 0.5), (1, 0.5)]]);
    let matrix = assemble_rows::<2>(
        600,
        600,
        |_| {},
        |site, row| {
            row.add(&transfer, 0, &(Tensor::identity() * site as f64));
            row.add_site(site as u32, &Tensor::<2>::new(1.0, 2.0, 3.0, 4.0));
            row.add_site(site as u32, &Tensor::<2>::new(1.0, 2.0, 3.0, 4.0));
        },
    );
    assert_eq!(matrix.rows(), 600);
    let (columns, blocks) = matrix.row(7);
    assert_eq!(columns, [1, 5, 7]);
    assert_eq!(blocks[..4], [3.5, 0.0, 0.0, 3.5]);
    assert_eq!(blocks[8..], [2.0, 4.0, 6.0, 8.0]);
    assert_eq!(matrix.row(1).0, [1, 5]);
    assert_eq!(matrix.row(1).1[..4], [2.5, 4.0, 6.0, 8.5]);
}
