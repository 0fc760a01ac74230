//! Pieces of bonds against places along them.

use super::*;
use crate::run::SceneModel;
use crate::run::block::Block;

/// Bonds of all kinds at a seam, of a lattice moved by some parts of its spacing: how they run against their pieces, which are found by looking where the middle of each part lies.
fn compare<const D: usize>(size: u32, has_triangles: bool) {
    let block = Block {
        coupling: "\"truncated\"",
        material: ["bond-based", ""],
        influence: "",
        size,
        has_triangles,
        widths: [2 * size, 0, 4 / size * size],
        ratio: 3,
        origin: 0.5,
    };
    let SceneModel { model, .. } = block.model::<D>();
    let model = &model;
    let (body, passing) = (model.body().unwrap(), model.passing().unwrap());
    let horizon = body.cloud.horizon.largest();
    let seam = Seam::new(model, 0, horizon, horizon);
    // points on faces last
    for shift in [0.0, 0.137, 0.5] {
        let by = Vector::repeat(shift * model.spacing());
        let position: Vec<Vector<D>> = body.cloud.position.iter().map(|x| x + by).collect();
        let is_site = |x: &Vector<D>| {
            let distance = |f: &Face<D>| model.mesh.distance_to_facet(x, &f.nodes);
            let touches = |f: &Face<D>| distance(f) <= ON_FACE * seam.size;
            seam.in_zone(x) && !seam.faces.iter().any(touches)
        };
        let is_site: Vec<bool> = position.iter().map(is_site).collect();
        let (mut cut, mut unclear) = (0, 0);
        let (mut near, mut pieces) = (Vec::new(), Vec::new());
        for i in 0..position.len() {
            let family = match body.families.of(i) {
                [] => passing.families.of(i),
                family => family,
            };
            seam.faces_around(&position[i], &mut near);
            for &j in family.iter().filter(|&&j| j as usize > i) {
                let (a, b) = (&position[i], &position[j as usize]);
                let ends = [is_site[i], is_site[j as usize]];
                let course = seam.course(a, b, ends, &near);
                if course == Course::Unclear {
                    unclear += usize::from(seam.near(a, b));
                    continue;
                }
                cut += usize::from(matches!(course, Course::Cut(_)));
                seam.pieces(a, b, &near, &mut pieces);
                let wanted = Piece::of(course, ends[0]);
                let wanted = (course != Course::Outside).then_some(wanted);
                assert_eq!(pieces, wanted.as_slice(), "{size}, {a} to {b}");
            }
        }
        assert!(cut > 50, "{cut}");
        // few enough for most of the work to be saved, unless points lie on faces
        let few = cut / 5;
        assert!(
            shift == 0.5 || unclear < few,
            "{size}, {shift}: {unclear} of {cut}"
        );
    }
}

#[test]
fn how_a_bond_runs_agrees_with_its_pieces() {
    compare::<2>(1, false);
    compare::<2>(3, false);
    compare::<2>(2, true);
    compare::<3>(1, false);
}
