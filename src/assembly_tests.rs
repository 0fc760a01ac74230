//! Tests of rows and of assembly.

use super::*;

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
fn a_place_is_the_sum_of_its_weights() {
    let transfer = Transfer::from_rows(
        4,
        [
            vec![(3, 0.25), (1, 0.5), (3, 0.25), (0, 0.0)],
            vec![],
            vec![(2, 1.0)],
        ],
    );
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
    // a weight that others cancel is none
    let cancelled = Transfer::from_rows(2, [vec![(1, 1.0), (0, 0.5), (1, -1.0)]]);
    assert_eq!(cancelled.row(0).collect::<Vec<_>>(), [(0, 0.5)]);
    // the product of the matrix
    let x = sprs::CsVecI::<f64, u32>::new(4, vec![0, 1, 2, 3], u[..4].to_vec());
    let product = transfer.matrix() * &x;
    assert_eq!(product.data(), [3.0, 3.0]);
}

#[test]
fn rows_are_sorted_summed_and_reused() {
    let transfer = Transfer::from_rows(6, [vec![(5, 0.5), (1, 0.5)]]);
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
