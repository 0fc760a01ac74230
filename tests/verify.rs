//! The other suites of `bondline verify`, in part.

use bondline::{
    observe::report::{Table, Verdict},
    progress::Silent,
};
use bondline_verify::{
    Effort, balance, extremes, large_deformation, layers, partial_volumes, plasticity, quadratic,
    surface_layer, tangents, warned, weights, zones,
};

fn assert_no_short(tables: &[Table]) {
    let short: Vec<_> = tables
        .iter()
        .flat_map(|t| &t.rows)
        .filter(|r| r.verdict == Verdict::Short)
        .collect();
    assert!(short.is_empty(), "{short:#?}");
}

fn count(tables: &[Table], quantity: &str, verdict: Verdict) -> usize {
    tables
        .iter()
        .flat_map(|t| &t.rows)
        .filter(|r| r.quantity.contains(quantity) && r.verdict == verdict && r.limit.is_some())
        .count()
}

#[test]
fn out_of_balance_forces_follow_their_leading_term() {
    let tables = balance::balance(Effort::Quick, &Silent);
    assert_no_short(&tables);
    // two laws; a splice, three functions over two widths, truncated bonds, balanced rows with a step and over a width;
    // in the table of every method the last three in 1D, and truncated bonds in 2D and 3D
    assert_eq!(count(&tables, "cubic", Verdict::Pass), 2 * (10 + 5));
    assert_eq!(count(&tables, "quartic", Verdict::Pass), 2 * (9 + 4));
    assert_eq!(count(&tables, "splice over", Verdict::Pass), 2);
}

#[test]
fn isotropic_weights_give_the_typed_tensor() {
    let tables = weights::weights(Effort::Quick, &Silent);
    assert_no_short(&tables);
    assert!(count(&tables, "isotropic", Verdict::Pass) > 60);
    // and plain ones do not
    let plain = tables
        .iter()
        .flat_map(|t| &t.rows)
        .filter(|r| r.quantity == "plain" && r.value > 1e-3)
        .count();
    assert!(plain > 60, "{plain}");
}

#[test]
fn extremes_pass_or_are_refused() {
    let tables = extremes::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    let refused = |words: &str| {
        let rows = tables.iter().flat_map(|t| &t.rows);
        rows.filter(|r| r.reason.as_deref().is_some_and(|w| w.contains(words)))
            .count()
    };
    // seven couplings at two ratios; four of five couplings at four contrasts; two kinds of cells; four couplings beyond their step
    assert_eq!(refused("poisson-ratio"), 14);
    assert_eq!(refused("another material"), 16);
    assert_eq!(refused("as long as it is wide"), 2);
    assert_eq!(refused("larger than the stable step"), 4);
    assert_eq!(refused("ran away"), 1);
    assert!(count(&tables, "lengths 1e-9", Verdict::Pass) == 14);
    // five couplings and peridynamics alone
    assert_eq!(count(&tables, "void in its place", Verdict::Pass), 6);
    assert_eq!(count(&tables, "left over", Verdict::Pass), 6);
    assert_eq!(count(&tables, "same in 1D", Verdict::Pass), 6);
    assert_eq!(count(&tables, "one that rests", Verdict::Pass), 6);
}

#[test]
fn plastic_elements_are_near_calculix_and_hill() {
    let tables = plasticity::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    // two meshes of either kind of cell, two ratios of Poisson with either
    assert_eq!(count(&tables, "tip", Verdict::Pass), 2 * 4);
    assert_eq!(count(&tables, "largest", Verdict::Pass), 2 * 4);
}

#[test]
fn large_deformations_pass_every_seam_that_takes_their_law() {
    let tables = large_deformation::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    // by a splice and by truncated families: four quantities on four meshes, of which a bar cannot turn
    let passed = tables.iter().flat_map(|table| &table.rows);
    let passed = passed.filter(|r| r.case.contains("neo-Hooke") && r.verdict == Verdict::Pass);
    assert_eq!(passed.count(), 2 * (3 * 4 + 1));
}

/// Steps, loads and affine fields; where little is left of elements at a surface, masses used to shorten the steps to a fifth.
#[test]
fn zones_that_are_drawn_hold_what_they_should() {
    let tables = zones::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    assert_eq!(count(&tables, "rims two spacings wide", Verdict::Pass), 4);
    assert_eq!(count(&tables, "loads and masses", Verdict::Pass), 12);
}

/// Of scenes that are drawn none that is right is refused or warned of.
#[test]
fn right_scenes_run_without_a_word() {
    let tables = warned::run(Effort::Quick, &Silent);
    for verdict in ["refused though right", "warned though right"] {
        let mut rows = tables.iter().flat_map(|t| &t.rows);
        let row = rows.find(|row| row.case == verdict).expect(verdict);
        assert_eq!(row.verdict, Verdict::Pass, "{tables:#?}");
    }
}

#[test]
fn tangents_are_derivatives_of_energies() {
    let tables = tangents::tangents(Effort::Quick, &Silent);
    assert_no_short(&tables);
    // three laws in one to three dimensions, and position-aware solids in the plane
    assert_eq!(count(&tables, "difference", Verdict::Pass), 3 * 3 * 2 + 2);
    assert!(count(&tables, "threads", Verdict::Pass) >= 6);
}

#[test]
fn partial_volumes_fill_the_ball() {
    let tables = partial_volumes::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    // exact in three dimensions, the ramp of HHB in one; rectangles, boxes, hexahedra
    assert_eq!(count(&tables, "largest", Verdict::Pass), 4 + 1);
    assert_eq!(count(&tables, "sum against", Verdict::Pass), 2);
}

#[test]
fn cells_of_second_order_pass_every_seam_and_have_their_order() {
    let tables = quadratic::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    // four cells, six couplings; six where the zone reaches a surface or its elements are too narrow, as beside linear cells
    assert_eq!(count(&tables, "error", Verdict::Pass), 18 + 9);
    // four linear cells, four of second order, curved ones; four beside points with two couplings
    assert_eq!(count(&tables, "order", Verdict::Pass), 9 + 4 * 2);
    assert_eq!(count(&tables, "over 3", Verdict::Pass), 4);
    assert_eq!(count(&tables, "deflection", Verdict::Pass), 4);
}

#[test]
fn skins_and_layers_are_exact() {
    let tables = surface_layer::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    assert_eq!(count(&tables, "modulus", Verdict::Pass), 6);
    let tables = layers::run(Effort::Quick, &Silent);
    assert_no_short(&tables);
    // two laws, two ratios, 1D and 2D
    assert_eq!(count(&tables, "residual", Verdict::Pass), 8);
    assert_eq!(count(&tables, "asymmetry", Verdict::Pass), 8);
}
