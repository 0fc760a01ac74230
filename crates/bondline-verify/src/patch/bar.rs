//! A bar with a splice under the body force of a cubic and of a quartic displacement, points on the nodes.

use super::SOLUTION_LIMIT;
use crate::enclosed::{Law, Method, POISSON};
use crate::{meshes::scene, typed};
use bondline::observe::report::{Columns, Table, TableRow};

/// Largest error under a cubic field over the largest displacement: rows of points, of elements and their loads are exact for it.
pub const CUBIC_LIMIT: f64 = 1e-11;

/// The same under a quartic field, of bonds that act alone with `1/|ξ|` at m = 3 and the body force of each point taken at its place.
///
/// With that load the rows of points err by `M₆ u⁗/24`, `M₆ = Σ λ ξ⁶ V = 12 C h²`; with its mean over a hat by `(M₆ − 2 C h²) u⁗/24`, a sixth less.
pub const QUARTIC_LIMIT: f64 = 5.93e-4;

/// Largest error of any displacement over the largest one, under the body force of `u = x^degree` in a bar of length 1.
fn error(law: Law, degree: i32) -> Result<f64, String> {
    let n = f64::from(degree);
    let text = format!(
        "kinematics = \"bar\"\ncoupling = {}\n{}{}[peridynamics]\nhorizon = 0.1\npoints.lattice.spacing = {:?}\n{}\
         [zones]\nnonlocal = {}\n[conditions.left.displacement]\non = \"left\"\nx = 0\n\
         [conditions.right.displacement]\non = \"right\"\nx = 1\n[conditions.load.body-force]\nx = \"-{:?}*x^{}\"\n",
        typed::coupling(Method::Splice),
        typed::grid([0.0], [1.0], [30]),
        typed::material(law, 1.0, POISSON),
        1.0 / 30.0,
        typed::law_line(law),
        typed::cuboid([0.4], [0.6]),
        n * (n - 1.0),
        degree - 2,
    );
    let (_, sites) = scene::solve(&text, &[], &[])?;
    let off = |site: &scene::Site| (site.displacement[0] - site.position[0].powi(degree)).abs();
    Ok(sites.iter().map(off).fold(0.0, f64::max))
}

/// The table: each law under either field.
pub(super) fn table() -> Table {
    let mut table = Table::new(
        "Bar with a splice, points on nodes, under the body force of x³ and x⁴: largest error over the largest displacement",
        Columns::Full,
    );
    for law in Law::all::<1>() {
        for (degree, name) in [(2, "quadratic"), (3, "cubic"), (4, "quartic")] {
            let case = format!("1D splice, {}, matching", law.name());
            let quantity = format!("{name} solution error");
            let limit = match (degree, law) {
                (2, _) => Some(SOLUTION_LIMIT),
                (3, _) => Some(CUBIC_LIMIT),
                (_, Law::BondBased(_)) => Some(QUARTIC_LIMIT),
                _ => None,
            };
            table.push(match (error(law, degree), limit) {
                (Ok(error), Some(limit)) => TableRow::at_most(&case, &quantity, error, limit),
                (Ok(error), None) => TableRow::info(&case, &quantity, error),
                (Err(why), _) => TableRow::at_most(&case, &quantity, f64::NAN, 0.0).because(why),
            });
        }
    }
    table
}
