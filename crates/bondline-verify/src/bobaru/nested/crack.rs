//! Goal-oriented refinement in statics, in a plane: the opening of a crack, on lattices nested about it.
//!
//! The visibility criterion of \[Bobaru2009\] section 5: what is watched must be seen by no coarse node. Watched is the crack, from tip to tip; level k fills all cells within one horizon of level
//! k − 1 of it, and levels are added until the opening settles.

use crate::bobaru::nested::{plate::Plate, transfer::Scattered};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    progress::Silent,
    solve::statics::{StaticParams, StaticProblem, solve},
    tensor::Vector,
};

/// Half of the edge of the plate, and of the crack; the tips lie within cells.
const HALF: usize = 20;
const TIP: f64 = 5.5;
/// Strain along y of the two rows of cells that hold the plate.
const STRAIN: f64 = 1e-3;
/// Change of the opening between two grids, relative to it, at which it has settled.
const SETTLED: f64 = 0.01;

/// Results of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stage {
    sites: usize,
    opening: f64,
}

/// Levels up to a spacing of h over `finest`, a power of two.
fn plate(finest: u32) -> Plate {
    Plate {
        half: HALF,
        levels: (0..=finest.ilog2()).map(|k| 1 << k).collect(),
        m: 2.0,
        crack: Some(TIP),
    }
}

/// The cells that the crack touches.
fn watched(plate: &Plate) -> Vec<usize> {
    let last = TIP.ceil() as usize;
    let columns = HALF - last..HALF + last;
    let cells = columns.flat_map(|i| [[i, HALF - 1], [i, HALF]]);
    cells.map(|c| plate.index(c)).collect()
}

/// The opening in the middle of the crack, between the places half a cell above and below it.
fn stage(plate: &Plate, levels: &[u8]) -> Result<Stage, String> {
    let body = plate.body(levels)?;
    let positions: Vec<[f64; 3]> = body.positions.iter().map(|x| [x[0], x[1], 0.0]).collect();
    let hold = |x: &Vector<2>| match x[1].abs() > HALF as f64 - 1.0 {
        true => [Some(0.0), Some(STRAIN * x[1])],
        false => [None, None],
    };
    let prescribed: Vec<Option<f64>> = body.positions.iter().flat_map(hold).collect();
    let problem = StaticProblem {
        stiffness: &body.motion.stiffness,
        symmetry: body.motion.symmetry,
        positions: &positions,
        load: &vec![0.0; prescribed.len()],
        prescribed: &prescribed,
    };
    let solution = solve(&problem, &StaticParams::default(), &Silent).map_err(|e| e.to_string())?;
    // each side of the crack by itself
    let lift = |side: f64| -> Result<f64, String> {
        let sites: Vec<usize> = (0..body.positions.len())
            .filter(|&i| side * body.positions[i][1] > 0.0)
            .collect();
        let places: Vec<Vector<2>> = sites.iter().map(|&i| body.positions[i]).collect();
        let u: Vec<f64> = sites
            .iter()
            .flat_map(|&i| {
                [
                    solution.displacement[2 * i],
                    solution.displacement[2 * i + 1],
                ]
            })
            .collect();
        let [found] = Scattered::new(&places).carry(&[Vector::<2>::new(0.0, 0.5 * side)], [&u])?;
        Ok(found[1])
    };
    Ok(Stage {
        sites: body.positions.len(),
        opening: lift(1.0)? - lift(-1.0)?,
    })
}

/// Grids with more and more levels until the opening settles, by what is watched: everything, what sees the crack, and what the crack touches.
pub fn opening() -> Table {
    let mut table = Table::new(
        format!(
            "Goal-oriented refinement in a plane: opening of a crack {} h long in a plate of {1} x {1} cells h, pulled by {STRAIN}; bond-based, m = 2, lattices h, h/2, ... nested about the crack until the opening changes by less than {SETTLED}",
            2.0 * TIP,
            2 * HALF
        ),
        Columns::Full,
    );
    let mut last = Vec::new();
    for (name, padding, most) in [
        ("uniform", None, 4),
        ("visibility of the crack", Some(1.0), 16),
        ("cells of the crack", Some(0.0), 16),
    ] {
        let mut before: Option<Stage> = None;
        let mut finest = 1;
        while finest <= most {
            let plate = plate(finest);
            let cells = match padding {
                None => (0..plate.cells().pow(2)).collect(),
                Some(_) => watched(&plate),
            };
            let levels = plate.levels_about(&cells, padding.unwrap_or(0.0));
            let case = format!("{name}, h/{finest}");
            let stage = match stage(&plate, &levels) {
                Ok(stage) => stage,
                Err(why) => {
                    table.push(TableRow::at_most(case, "opening", f64::NAN, 0.0).because(why));
                    break;
                }
            };
            table.push(TableRow::info(&case, "sites", stage.sites as f64));
            table.push(TableRow::info(
                &case,
                "opening over h, strain",
                stage.opening / STRAIN,
            ));
            last.push((name, finest, stage));
            let change = before.map_or(f64::INFINITY, |b| (stage.opening / b.opening - 1.0).abs());
            if change.is_finite() {
                table.push(TableRow::info(&case, "change", change));
            }
            if change < SETTLED && padding.is_some() {
                break;
            }
            before = Some(stage);
            finest *= 2;
        }
    }
    let of = |name: &str, finest: u32| {
        last.iter()
            .find(|s| s.0 == name && s.1 == finest)
            .map(|s| s.2)
    };
    if let Some(uniform) = of("uniform", 4) {
        for name in ["visibility of the crack", "cells of the crack"] {
            let Some(nested) = of(name, 4) else { continue };
            let case = format!("{name}, h/4");
            let off = (nested.opening / uniform.opening - 1.0).abs();
            let saved = uniform.sites as f64 / nested.sites as f64;
            let quantity = "opening off that of the uniform lattice h/4";
            table.push(match name {
                "visibility of the crack" => TableRow::at_most(&case, quantity, off, SETTLED),
                _ => TableRow::info(&case, quantity, off),
            });
            table.push(TableRow::at_least(
                &case,
                "sites of the uniform lattice over these",
                saved,
                2.0,
            ));
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crack_opens_only_where_it_is() {
        let cracked = plate(2);
        let levels = cracked.levels_about(&watched(&cracked), 1.0);
        let open = stage(&cracked, &levels).unwrap();
        let whole = Plate {
            crack: None,
            ..cracked
        };
        // between the two places lies one cell, that stretches by about the strain (the grips hold the plate along x, and its sides are free and soft)
        let closed = stage(&whole, &levels).unwrap();
        assert!(
            (closed.opening / STRAIN - 1.0).abs() < 0.1,
            "{}",
            closed.opening / STRAIN
        );
        // a crack in an infinite plate opens by 4 a σ/E′ in its middle; less the half cells beside it
        let wanted = 4.0 * TIP;
        assert!(
            open.opening / STRAIN > 0.7 * wanted && open.opening / STRAIN < 1.6 * wanted,
            "{}",
            open.opening / STRAIN
        );
    }
}
