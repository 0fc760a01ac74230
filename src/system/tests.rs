//! Products, sums and transposes of block matrices.

use super::*;

#[test]
fn products_with_differences_do_not_feel_how_far_a_body_has_drifted() {
    // a chain of unequal springs; displacements that stay exact beside a drift of 2^20
    let springs: Vec<f64> = (0..9).map(|k| 0.5 + 1.0 / f64::from(k + 3)).collect();
    let (mut row_offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
    for i in 0..10_usize {
        let left = if i > 0 { springs[i - 1] } else { 0.0 };
        let right = springs.get(i).copied().unwrap_or(0.0);
        let row = [
            (i.wrapping_sub(1), -left),
            (i, left + right),
            (i + 1, -right),
        ];
        for (column, value) in row.into_iter().filter(|&(c, _)| c < 10) {
            columns.push(column as u32);
            values.push(value);
        }
        row_offsets.push(columns.len());
    }
    let mut matrix = BlockCsr {
        block: 1,
        row_offsets,
        columns,
        values,
        shared: None,
    };
    assert!(matrix.rows_add_up_to_zero());
    let u: Vec<f64> = (0..10).map(|k| f64::from(k * k % 7) / 1024.0).collect();
    let far: Vec<f64> = u.iter().map(|u| u + 1_048_576.0).collect();
    let (exact, mut force) = (matrix.multiply(&u), vec![0.0; 10]);
    matrix.multiply_differences_into(&far, &mut force);
    for (f, exact) in force.iter().zip(&exact) {
        assert!((f - exact).abs() < 1e-17, "{f:e} {exact:e}");
    }
    matrix.values[0] += 1e-9;
    assert!(!matrix.rows_add_up_to_zero());
}

#[test]
fn products_and_asymmetry_are_those_of_the_scalar_matrix() {
    let matrix = BlockCsr {
        block: 2,
        row_offsets: vec![0, 2, 3, 5],
        columns: vec![0, 2, 1, 0, 2],
        values: (0..20).map(|k| f64::from(k * k % 7) - 2.5).collect(),
        shared: None,
    };
    let scalar = matrix.to_csr();
    let x: Vec<f64> = (0..6).map(|k| 1.0 / (1.0 + f64::from(k))).collect();
    let expected = &scalar * &sprs::CsVec::new(6, (0..6).collect(), x.clone());
    for (i, y) in matrix.multiply(&x).into_iter().enumerate() {
        assert!((y - expected.get(i).copied().unwrap_or(0.0)).abs() < 1e-15);
    }
    let difference = &scalar - &scalar.transpose_view().to_csr();
    let norm = |m: &sprs::CsMat<f64>| m.data().iter().map(|v| v * v).sum::<f64>().sqrt();
    let expected = norm(&difference) / norm(&scalar);
    assert!(
        (matrix.asymmetry() - expected).abs() < 1e-15,
        "{} {expected}",
        matrix.asymmetry()
    );
}
