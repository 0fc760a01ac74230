//! Tests of the need of peridynamics under a displacement against closed forms.

use super::*;
use crate::mesh::generate::{Axis, Grid, cuboid, line, rectangle};
use crate::peridynamics::Micromodulus;
use crate::tensor::Tensor4;

/// The need of a grid of one material with unit shear modulus.
fn need<const D: usize>(
    mesh: &Mesh<D>,
    horizon: f64,
    ratio: f64,
    tolerance: f64,
    u: impl Fn(&Vector<D>) -> Vector<D> + Sync,
) -> Need {
    let count = mesh.cell_count();
    Criteria {
        mesh,
        elastic: &ElasticCells {
            tensors: vec![Tensor4::isotropic(1.0, 1.0)],
            material: vec![0; count],
            ..ElasticCells::default()
        },
        material: 0,
        horizon: &vec![horizon; count],
        gradient_ratio: ratio,
        tolerance,
        stretch: None,
        cut: &vec![false; count],
        unbreakable: &vec![false; count],
        held: &vec![false; count],
    }
    .need(|n| u(&mesh.nodes[n]))
}

fn cells(n: usize) -> Axis {
    Axis::Uniform {
        min: -1.0,
        max: 1.0,
        cells: n,
    }
}

#[test]
fn the_gradient_ratio_has_its_closed_forms() {
    // λ = c/r² in 1D: L x⁴ = ∫ c (6 x² ξ² + ξ⁴) dξ = c (4 x² δ³ + 2 δ⁵/5) with E = c δ³/3, so L − L_0 = 6/5 E δ² = 24 E ℓ²
    let found = gradient_ratio::<1>(|r| Micromodulus::Constant.shape(r, 0.3), 0.3);
    assert!((found * 20.0 - 1.0).abs() < 1e-6, "{found}");
    // λ = c/r³: L x⁴ = ∫ c/|ξ| (6 x² ξ² + ξ⁴) dξ = c (6 x² δ² + δ⁴/2) with E = c δ²/2, so L − L_0 = E δ² = 24 E ℓ²
    let found = gradient_ratio::<1>(|r| Micromodulus::InverseDistance.shape(r, 0.3), 0.3);
    assert!((found * 24.0 - 1.0).abs() < 1e-6, "{found}");
    // 5/12 · 1/6 · (1/5)/(1/3) and 5/12 · 1/7 · (1/6)/(1/4)
    let found = gradient_ratio::<2>(|r| Micromodulus::InverseDistance.shape(r, 2.0), 2.0);
    assert!((found / (5.0 / 72.0 * 0.6) - 1.0).abs() < 1e-6, "{found}");
    let found = gradient_ratio::<3>(|r| Micromodulus::InverseDistance.shape(r, 2.0), 2.0);
    assert!(
        (found / (5.0 / 84.0 * 2.0 / 3.0) - 1.0).abs() < 1e-6,
        "{found}"
    );
}

#[test]
fn a_field_of_the_fourth_degree_has_the_error_of_its_closed_form() {
    // u = x⁴: ε = 4 x³ + x h² in a cell, ℓ²∇²ε = 24 ℓ² x, to round-off; E of λ = μ = 1 is 3 in 1D and drops out
    let (n, delta) = (80, 0.1);
    let h = 2.0 / n as f64;
    let mesh = line(cells(n)).mesh().unwrap();
    let ratio = gradient_ratio::<1>(|r| Micromodulus::InverseDistance.shape(r, delta), delta);
    let found = need(&mesh, delta, ratio, 1.0, |x| Vector::<1>::new(x[0].powi(4)));
    let middle = |i: usize| -1.0 + (i as f64 + 0.5) * h;
    let (mut wrong, mut whole) = (0.0f64, 0.0f64);
    for i in 0..n {
        let x = middle(i);
        // at an end, where the mean is one-sided, a plane leaves half as much: see `level`
        let gradient = 24.0 * ratio * delta * delta * x;
        let strain = 4.0 * x.powi(3) + x * h * h;
        if i >= 2 && i + 2 < n {
            wrong += gradient.powi(2).min(strain.powi(2));
        }
        whole += strain.powi(2);
    }
    let inner = (wrong / whole).sqrt();
    // the four cells at the ends hold less than a tenth of the sum
    assert!(
        found.all_local >= inner * (1.0 - 1e-9) && found.all_local < 1.06 * inner,
        "{} {inner}",
        found.all_local
    );
    // outside of a set: the closed form over the cells that are left, here the right third without its end
    let left: Vec<bool> = (0..n).map(|i| !(53..n - 2).contains(&i)).collect();
    let sum: f64 = (0..n)
        .filter(|&i| !left[i])
        .map(|i| {
            let x = middle(i);
            let gradient = 24.0 * ratio * delta * delta * x;
            gradient.powi(2).min((4.0 * x.powi(3) + x * h * h).powi(2))
        })
        .sum();
    let (outside, exact) = (found.remaining_outside(&left), (sum / whole).sqrt());
    assert!((outside / exact - 1.0).abs() < 1e-9, "{outside} {exact}");
    assert!((found.remaining_outside(&vec![false; n]) / found.all_local - 1.0).abs() < 1e-12);
    assert!((found.remaining_outside(&found.error) / found.remaining - 1.0).abs() < 1e-9);
}

#[test]
fn fields_of_the_second_degree_need_nothing() {
    fn check<const D: usize>(mut grid: Grid<D>) {
        let jittered = grid.jitter(0.2, 7).mesh().unwrap();
        let quadratic = |x: &Vector<D>| Vector::from_fn(|i, _| x[i] * x[(i + 1) % D] + x[0]);
        let found = need(&jittered, 0.4, 0.04, 1e-3, quadratic);
        assert!(found.all_local < 5e-3, "{D} {}", found.all_local);
    }
    check(line(cells(20)));
    check(rectangle(cells(12), cells(12)));
    check(cuboid(cells(8), cells(8), cells(8)));
    let regular = rectangle(cells(12), cells(12)).mesh().unwrap();
    let found = need(&regular, 0.4, 0.04, 1e-3, |x| {
        Vector::<2>::new(x[0] * x[1], x[1] * x[1])
    });
    assert!(found.all_local < 1e-12, "{}", found.all_local);
    assert!(!found.error.contains(&true));
}

#[test]
fn cells_that_lie_alike_have_the_weights_of_the_first() {
    let smooth = |x: &Vector<2>| Vector::<2>::new((3.0 * x[0]).sin() * x[1], (2.0 * x[1]).cos());
    // a shear keeps all cells alike, a graded mesh and one with a moved node do not
    let sheared = |shear: f64, moved: f64| {
        let mut mesh = rectangle(cells(30), cells(30)).mesh().unwrap();
        mesh.nodes.iter_mut().for_each(|x| x[0] += shear * x[1]);
        mesh.nodes[31 * 15 + 15][0] += moved;
        mesh
    };
    let kinds_of = |mesh: &Mesh<2>| {
        let count = mesh.cell_count();
        let centre: Vec<Vector<2>> = (0..count).map(|c| mesh.centroid(c)).collect();
        let volume: Vec<f64> = (0..count).map(|c| mesh.cell_volume(c)).collect();
        let next = |c: usize, by: i64, is: bool| if is { (c as i64 + by) as u32 } else { NONE };
        let neighbours: Vec<[u32; 6]> = (0..count)
            .map(|c| {
                let (i, j) = (c % 30, c / 30);
                let left = next(c, -1, i > 0);
                let (right, below) = (next(c, 1, i < 29), next(c, -30, j > 0));
                [below, right, next(c, 30, j < 29), left, NONE, NONE]
            })
            .collect();
        kinds(&neighbours, &centre, &volume)
    };
    // of each row the first cell, the second and the last are new
    let kind = kinds_of(&sheared(0.3, 0.0));
    assert_eq!(*kind.last().unwrap(), 3 * 30);
    assert!(*kinds_of(&sheared(0.3, 0.01)).last().unwrap() > 3 * 30);
    // moved by next to nothing all cells go their own way
    let alike = need(&sheared(0.3, 0.0), 0.3, 0.04, 0.02, smooth);
    let mut each = sheared(0.3, 0.0);
    for (n, x) in each.nodes.iter_mut().enumerate() {
        x[0] += 1e-9 * (n as f64).sin();
    }
    assert_eq!(*kinds_of(&each).last().unwrap(), 30 * 30);
    let each = need(&each, 0.3, 0.04, 0.02, smooth);
    let off = (alike.all_local / each.all_local - 1.0).abs();
    let all = alike.all_local;
    assert!(off < 1e-6 && all > 5e-3 && all < 0.5, "{all} {off:e}");
    assert_eq!(alike.error, each.error);
}

#[test]
fn cells_are_marked_until_the_rest_is_within_the_tolerance() {
    let (marked, all, left) = worst(&[4.0, 0.0, 1.0, 3.0, 0.5], 100.0, 0.13);
    assert_eq!(marked, [true, false, false, true, false]);
    assert!((all - 0.085f64.sqrt()).abs() < 1e-12 && (left - 0.015f64.sqrt()).abs() < 1e-12);
    let (marked, all, _) = worst(&[0.0; 3], 0.0, 0.1);
    assert!(!marked.contains(&true) && all == 0.0);
}

#[test]
fn principal_strains_are_those_of_known_tensors() {
    let turned = Tensor::<2>::new(1.0, 2.0, 2.0, 1.0);
    assert!((largest_eigenvalue(&turned) - 3.0).abs() < 1e-14);
    let solid = Tensor::<3>::new(2.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, -5.0);
    assert!((largest_eigenvalue(&solid) - 3.0).abs() < 1e-14);
}
