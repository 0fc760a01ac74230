//! Nonlocal zones with a rim of their own, `zones.rim = "own"`, in meshes of triangles, quadrilaterals, tetrahedra, hexahedra and lines that know nothing of the lattice.

use bondline::{Region, SceneBuilder};

mod affine;
mod bad_input;
mod convergence;
mod crack;
mod hexahedra;
mod meshes;
mod quadrilaterals;
mod second_order;
mod shown;
mod skin;
mod structure;
mod supports;
mod surfaces;

use meshes::{Body, Random};

/// Shapes of zones.
#[derive(Clone, Copy, Debug)]
enum Drawn {
    Box,
    Ball,
    /// A polygon of an angle, turned; in solids a ball.
    Angle,
    /// A polygon of five corners; in solids a box.
    Polygon,
}

/// A zone of a shape and a radius about the middle of a body, placed and turned at random by up to half a spacing.
fn zone<const D: usize>(shape: Drawn, body: &Body<D>, radius: f64, random: &mut Random) -> Region {
    let middle = body.middle().map(|x| x + random.within(-0.5, 0.5));
    let along = |angle: f64, r: f64| [middle[0] + r * angle.cos(), middle[1 % D] + r * angle.sin()];
    let turned = random.within(0.0, std::f64::consts::TAU);
    match shape {
        Drawn::Angle if D == 2 => {
            let corners = [
                (1.0, 1.0),
                (-1.0, 1.0),
                (-1.0, -1.0),
                (0.1, -1.0),
                (0.1, 0.0),
                (1.0, 0.0),
            ];
            let corners =
                corners.map(|(x, y): (f64, f64)| along(y.atan2(x) + turned, radius * x.hypot(y)));
            Region::polygon(&corners)
        }
        Drawn::Polygon if D == 2 => {
            let corner =
                |k: usize| along(turned + k as f64 * 1.257, radius * random.within(0.8, 1.2));
            let corners: Vec<[f64; 2]> = (0..5).map(corner).collect();
            Region::polygon(&corners)
        }
        Drawn::Ball | Drawn::Angle => Region::ball(middle, radius),
        Drawn::Box | Drawn::Polygon => {
            let low = middle.map(|x| x - radius * random.within(0.8, 1.1));
            let high = middle.map(|x| x + radius * random.within(0.8, 1.1));
            Region::cuboid(low, high)
        }
    }
}

/// A scene of a body with a rim of its own, and a lattice of spacing one that begins anywhere.
fn scene<const D: usize>(body: &Body<D>, random: &mut Random) -> SceneBuilder {
    scene_of_spacing(body, 1.0, random)
}

/// As [`scene`], with a spacing.
fn scene_of_spacing<const D: usize>(
    body: &Body<D>,
    spacing: f64,
    random: &mut Random,
) -> SceneBuilder {
    let origin = [(); D].map(|()| spacing * random.unit());
    let scene = match D {
        1 => SceneBuilder::bar("rim"),
        2 => SceneBuilder::plane_stress("rim"),
        _ => SceneBuilder::solid("rim"),
    };
    scene
        .mesh(body.mesh())
        .spacing(spacing)
        .set("peridynamics.points.lattice.origin", origin)
        .set("zones.rim", "own")
        // what a surface does to points is what these ask
        .set("zones.skin", "none")
        .set("solver.tolerance", 1e-14)
}
