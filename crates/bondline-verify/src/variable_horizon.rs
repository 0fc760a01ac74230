//! The bar of variable horizon: partial stress is free of ghost forces where standard peridynamics is not.
//!
//! Source: [SAND2015-7998] section 7.2, figures 7.1 to 7.3. A displacement is prescribed, and the acceleration that the internal force gives is
//! compared with `E u″/ρ`. The text prints E and ν; length, horizons and density are assumptions, stated in `docs/bars.md`.

use std::path::Path;

use rayon::prelude::*;

use crate::{
    Effort,
    enclosed::{Law, Method},
    meshes::scene::{self, SceneFailure},
    typed,
};
use bondline::{
    assembly::Row as MatrixRow,
    observe::{
        ObserveError,
        report::{Columns, Table, TableRow},
    },
    peridynamics::{
        Influence,
        influence::{Alpha, Degree},
    },
    progress::Progress,
    tensor::Vector,
};
use bondline_study::line_plot::{LinePlot, Series, Stroke};

/// Length of the bar \[m\]; it lies about x = 0.
pub const LENGTH: f64 = 10.0;
/// Young's modulus \[Pa\].
pub const YOUNGS_MODULUS: f64 = 200e9;
/// Density \[kg/m³\].
pub const DENSITY: f64 = 7800.0;
/// `u′` of the linear field.
pub const SLOPE: f64 = 1e-3;
/// Half of `u″` of the quadratic field \[1/m\].
pub const CURVATURE: f64 = 1e-3;
/// The largest horizon \[m\].
const LARGE: f64 = 0.25;
/// The smallest horizon \[m\].
const SMALL: f64 = 0.10;
/// Acceleration of partial stress, relative to the scale of the field, must be exact to this.
const EXACT: f64 = 1e-8;
/// Standard peridynamics misses by more than this, relative to the same scale, or the comparison shows nothing.
const VISIBLE: f64 = 0.1;

/// The horizon along the bar \[m\]: 0.25 for |x| < 2, a straight ramp to 0.10 at |x| = 3, 0.10 beyond.
///
/// Source: [SAND2015-7998] figure 7.1a, whose numbers the text does not give.
pub fn horizon(x: f64) -> f64 {
    let ramp = (x.abs() - 2.0).clamp(0.0, 1.0);
    LARGE + (SMALL - LARGE) * ramp
}

/// The same as a scene types it.
pub const HORIZON: &str = "0.25 - 0.15 * max(0, min(1, abs(x) - 2))";

/// The laws that the bar is run with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BarLaw {
    /// Elastic correspondence, as in the report; not stabilised.
    Correspondence,
    /// The linear peridynamic solid, with weights that are isotropic on the lattice.
    Lps,
}

impl BarLaw {
    fn name(self) -> &'static str {
        match self {
            Self::Correspondence => "correspondence",
            Self::Lps => "LPS",
        }
    }

    /// The law, and what further of its material a scene types.
    fn law(self) -> (Law, &'static str) {
        match self {
            Self::Correspondence => (
                Law::Correspondence(Influence::Gaussian),
                "stabilisation = 0\n",
            ),
            Self::Lps => (Law::StateBased(OMEGA), ""),
        }
    }
}

/// ω of the LPS, and of the divergence beside it: `P_1/|ξ|`.
const OMEGA: Influence = Influence::Polynomial {
    degree: Degree::P1,
    alpha: Alpha::One,
};

/// Model of the internal force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BarModel {
    /// The force states of both ends of each bond, eq. (2.5).
    Standard,
    /// The divergence of the partial stress, section 7.2.
    PartialStress,
}

impl BarModel {
    fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard PD",
            Self::PartialStress => "partial stress",
        }
    }

    /// The coupling as a scene types it.
    fn coupling(self) -> String {
        match self {
            Self::Standard => "\"nonlocal\"".to_owned(),
            Self::PartialStress => typed::coupling(Method::Meshfree),
        }
    }
}

/// Accelerations along the axis of the bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Positions, at least two horizons away from the ends \[m\].
    pub x: Vec<f64>,
    /// Acceleration along x under `u = 10⁻³ x` \[m/s²\].
    pub linear: Vec<f64>,
    /// Acceleration along x under `u = 10⁻³ x²` \[m/s²\].
    pub quadratic: Vec<f64>,
    /// Largest acceleration across the bar under either field \[m/s²\].
    pub across: f64,
    /// Points of the bar.
    pub points: usize,
    /// Directed bonds of the bar.
    pub bonds: usize,
}

/// The acceleration that the quadratic field should have, `E u″/ρ` \[m/s²\].
pub fn exact_acceleration() -> f64 {
    2.0 * CURVATURE * YOUNGS_MODULUS / DENSITY
}

/// The scale of accelerations under the linear field, `E u′/(ρ L)`: the stress that is there, lost over the length of the bar \[m/s²\].
pub fn linear_scale() -> f64 {
    SLOPE * YOUNGS_MODULUS / (DENSITY * LENGTH)
}

/// The scene of a bar.
fn bar_scene<const D: usize>(
    law: BarLaw,
    model: BarModel,
    spacing: f64,
    across: usize,
    horizon: &str,
) -> String {
    let section = 0.5 * across as f64 * spacing;
    let half: [f64; D] = std::array::from_fn(|k| [0.5 * LENGTH, section][k.min(1)]);
    let cells = (LENGTH / spacing).round() as usize;
    let (bond_law, rest) = law.law();
    // partial stress everywhere but at one end, out of reach of what is looked at: a scene has a nonlocal zone
    let last = std::array::from_fn(|k| if k == 0 { half[0] - SMALL } else { -half[k] });
    format!(
        "kinematics = \"{}\"\ncoupling = {}\n{}{}{rest}[peridynamics]\nhorizon = \"{horizon}\"\npoints.lattice = {{ spacing = {spacing:?}, origin = {} }}\nvolumes = \"full\"\n{}{}[zones]\nnonlocal = {}\ntransition = {{ everywhere = true }}\n{}",
        typed::kinematics::<D>(),
        model.coupling(),
        typed::grid(
            half.map(|h| -h),
            half,
            std::array::from_fn(|k| [cells, across][k.min(1)])
        ),
        typed::material(bond_law, YOUNGS_MODULUS, 0.0),
        typed::place(half.map(|h| 0.5 * spacing - h)),
        typed::law_line(bond_law),
        typed::UNCUT,
        typed::cuboid(last, half),
        typed::FREE
    )
}

/// Accelerations of the points on the axis of a bar of `D` dimensions, of points `spacing` apart and of a square section of
/// `across` (odd) points a side (without meaning in 1D).
///
/// # Errors
/// [`SceneFailure`] of its scene or model.
pub fn profile<const D: usize>(
    law: BarLaw,
    model: BarModel,
    spacing: f64,
    across: usize,
    horizon: &str,
    progress: &dyn Progress,
) -> Result<Profile, SceneFailure> {
    let text = bar_scene::<D>(law, model, spacing, across, horizon);
    progress.stage("sites and bonds", None);
    let laid = scene::model::<D>(&text, &[])?;
    let bar = &laid.model;
    let operator = laid.coupling.operator(bar).map_err(SceneFailure::from)?;
    let horizon = |x: f64| {
        let at = Vector::from_fn(|k, _| if k == 0 { x } else { 0.0 });
        (bar.peridynamics.as_ref()).map_or(0.0, |p| p.horizon.at(&at))
    };
    let field = |f: fn(f64) -> f64| -> Vec<f64> {
        bar.sites
            .iter()
            .flat_map(|s| (0..D).map(move |a| if a == 0 { f(s.position[0]) } else { 0.0 }))
            .collect()
    };
    let fields = [field(|x| SLOPE * x), field(|x| CURVATURE * x * x)];
    let end = 0.5 * LENGTH - 2.0 * horizon(0.5 * LENGTH);
    let mut axis: Vec<usize> = (0..bar.sites.len())
        .filter(|&s| {
            let x = &bar.sites[s].position;
            x[0].abs() < end && (1..D).all(|a| x[a].abs() < 0.25 * spacing)
        })
        .collect();
    axis.sort_by(|&a, &b| bar.sites[a].position[0].total_cmp(&bar.sites[b].position[0]));
    progress.stage("accelerations", Some(axis.len() as u64));
    let accelerations: Vec<[Vector<D>; 2]> = axis
        .par_iter()
        .map_init(
            || MatrixRow::<D>::new(bar.sites.len()),
            |row, &site| {
                progress.advance(1);
                operator.add_row(site, row);
                if let Some(scale) = bar.row_scale() {
                    row.scale(scale[site]);
                }
                // a row is minus the internal force
                row.take_products([&fields[0], &fields[1]])
                    .map(|f| f / (-DENSITY * bar.sites[site].volume))
            },
        )
        .collect();
    progress.finish();
    let along = |f: usize| accelerations.iter().map(|a| a[f][0]).collect();
    Ok(Profile {
        x: axis.iter().map(|&s| bar.sites[s].position[0]).collect(),
        linear: along(0),
        quadratic: along(1),
        across: accelerations
            .iter()
            .flatten()
            .flat_map(|a| a.iter().skip(1))
            .fold(0.0, |m: f64, a| m.max(a.abs())),
        points: bar.sites.len(),
        bonds: bar.body().map_or(0, |b| b.bond_count()),
    })
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    // `max` would drop a NaN
    values.fold(0.0, |m: f64, v| if v.abs() <= m { m } else { v.abs() })
}

fn rows(case: &str, model: BarModel, profile: &Profile, table: &mut Table) {
    let linear = largest(profile.linear.iter().copied()) / linear_scale();
    let exact = exact_acceleration();
    let quadratic = largest(profile.quadratic.iter().map(|a| a - exact)) / exact;
    for (quantity, value) in [
        ("u = 1e-3 x: largest |a| rho L/(E u')", linear),
        ("u = 1e-3 x^2: largest |a rho/(E u'') - 1|", quadratic),
    ] {
        table.push(match model {
            BarModel::PartialStress => TableRow::at_most(case, quantity, value, EXACT),
            BarModel::Standard => TableRow::at_least(case, quantity, value, VISIBLE),
        });
    }
    if model == BarModel::PartialStress && profile.across > 0.0 {
        let quantity = "largest |a| across the bar, of E u''/rho";
        table.push(TableRow::at_most(
            case,
            quantity,
            profile.across / exact,
            EXACT,
        ));
    }
}

/// Spacings and section that are run.
const SPACING_1D: f64 = 0.025;
/// h = 0.05: m = 5 in the middle, 2 at the ends.
const SPACING_3D: f64 = 0.05;
/// The axis is 0.525 from the free sides, more than two of the largest horizons.
const ACROSS: usize = 21;

fn dimension<const D: usize>(
    spacing: f64,
    across: usize,
    laws: &[BarLaw],
    table: &mut Table,
    progress: &dyn Progress,
) -> Option<usize> {
    let mut counted = None;
    for &law in laws {
        for model in [BarModel::PartialStress, BarModel::Standard] {
            let case = format!("{D}D {}, {}", law.name(), model.name());
            match profile::<D>(law, model, spacing, across, HORIZON, progress) {
                Ok(p) => {
                    rows(&case, model, &p, table);
                    if counted.replace(p.bonds).is_none() {
                        table.push(TableRow::info(format!("{D}D"), "points", p.points as f64));
                        table.push(TableRow::info(format!("{D}D"), "bonds", p.bonds as f64));
                    }
                }
                Err(e) => {
                    let row = TableRow::at_most(case, "largest |a|", f64::NAN, EXACT);
                    table.push(row.because(e.to_string()));
                }
            }
        }
    }
    counted
}

/// The whole comparison: 1D and the axis of a bar in 3D, correspondence and LPS (in 3D only with full effort).
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let mut table = Table::new(
        "Bar of variable horizon, [SAND2015-7998] section 7.2: accelerations under prescribed displacement",
        Columns::Full,
    );
    let laws = [BarLaw::Correspondence, BarLaw::Lps];
    dimension::<1>(SPACING_1D, 1, &laws, &mut table, progress);
    let laws = match effort {
        Effort::Quick => &laws[..1],
        Effort::Full => &laws,
    };
    let varying_bonds = dimension::<3>(SPACING_3D, ACROSS, laws, &mut table, progress);
    let constant = profile::<1>(
        BarLaw::Correspondence,
        BarModel::Standard,
        SPACING_1D,
        1,
        "0.25",
        progress,
    );
    if let Ok(p) = constant {
        let quantity = "bonds with delta = 0.25 everywhere";
        table.push(TableRow::info("1D", quantity, p.bonds as f64));
        let quantity = "delta = 0.25 everywhere, u = 1e-3 x: largest |a| rho L/(E u')";
        let value = largest(p.linear.iter().copied()) / linear_scale();
        table.push(TableRow::at_most(
            "1D correspondence, standard PD",
            quantity,
            value,
            EXACT,
        ));
    }
    vec![table, printed(&varying_bonds)]
}

/// The weighted volume of the influence function against that of a lattice.
fn push_weighted_volume(table: &mut Table) {
    let lattice = bondline::peridynamics::LatticeFamily::<3>::new(12.0, 1e-6);
    if let Ok(lattice) = lattice {
        let sum: f64 = lattice
            .shells
            .iter()
            .map(|s| {
                let r = s.length(1.0);
                s.offsets.len() as f64 * Influence::Gaussian.value(r, 12.0) * r * r
            })
            .sum();
        table.push(TableRow::within(
            "Gaussian of Algorithm 1",
            "weighted volume, closed form over the sum of a lattice of m = 12",
            Influence::Gaussian.weighted_volume::<3>(12.0) / sum,
            1.0,
            0.02,
        ));
    }
}

/// Numbers that section 7.2 prints of its bar: bonds, and stable steps.
fn printed(varying: &Option<usize>) -> Table {
    let mut table = Table::new(
        "[SAND2015-7998] section 7.2: bonds, stable steps, and the influence function of Algorithm 1",
        Columns::Full,
    );
    let why = "the text gives neither length, section nor spacing of its bar; ours is 10 long, h = 0.05, 21 h wide";
    let cells = [
        (LENGTH / SPACING_3D).round() as i64,
        ACROSS as i64,
        ACROSS as i64,
    ];
    let constant = directed_bonds(cells, LARGE / SPACING_3D) as f64;
    let add = |table: &mut Table, case: &str, quantity: &str, ours: f64, theirs: f64| {
        let row = TableRow::info(case, quantity, ours).with_reference(theirs);
        table.push(row.differs(why));
    };
    add(
        &mut table,
        "constant horizon",
        "bonds, directed",
        constant,
        92.6e6,
    );
    if let Some(bonds) = varying {
        let bonds = *bonds as f64;
        add(
            &mut table,
            "varying horizon",
            "bonds, directed",
            bonds,
            46.5e6,
        );
        add(
            &mut table,
            "both",
            "varying over constant",
            bonds / constant,
            46.5 / 92.6,
        );
    }
    // Silling and Askari: Δt = √(2ρ/Σ C V), C = 18 K/(π δ⁴ |ξ|), over a full family
    let bulk = YOUNGS_MODULUS / 3.0;
    let step = |horizon: f64| horizon * (DENSITY / (18.0 * bulk)).sqrt();
    table.push(TableRow::within(
        "constant horizon",
        "stable step of a whole family of 0.25, delta sqrt(rho/(18 K)) [s]",
        step(LARGE),
        2.03e-5,
        0.01,
    ));
    table.push(
        TableRow::info(
            "varying horizon",
            "the same of our smallest horizon, 0.10 [s]",
            step(SMALL),
        )
        .with_reference(7.15e-6)
        .differs(
            "figure 7.1a has no numbers; the printed steps belong to a smallest horizon of 0.088",
        ),
    );
    let implied = LARGE * 7.15e-6 / 2.03e-5;
    table.push(TableRow::info(
        "varying horizon",
        "smallest horizon that the printed steps imply [m]",
        implied,
    ));
    push_weighted_volume(&mut table);
    table
}

/// Directed bonds of a box of so many lattice points with one horizon, in spacings.
fn directed_bonds(cells: [i64; 3], ratio: f64) -> i64 {
    let reach = ratio * (1.0 + bondline::peridynamics::TIE_TOLERANCE);
    let n = reach.floor() as i64;
    let mut bonds = 0;
    for a in -n..=n {
        for b in -n..=n {
            for c in -n..=n {
                let square = a * a + b * b + c * c;
                if square > 0 && square as f64 <= reach * reach {
                    let left = |count: i64, k: i64| (count - k.abs()).max(0);
                    bonds += left(cells[0], a) * left(cells[1], b) * left(cells[2], c);
                }
            }
        }
    }
    bonds
}

/// Draws figures 7.1a, 7.2 and 7.3 as `bar_horizon.svg`, `bar_linear.svg` and `bar_quadratic.svg`.
///
/// # Errors
/// [`FigureError`] if the bar cannot be computed or a file not written.
pub fn figures(folder: &Path, progress: &dyn Progress) -> Result<(), FigureError> {
    let h = SPACING_1D;
    let profiles = [BarModel::Standard, BarModel::PartialStress].map(|model| {
        profile::<1>(BarLaw::Correspondence, model, h, 1, HORIZON, progress)
            .map(|p| (model.name(), p))
    });
    let [standard, partial] = profiles;
    let profiles = [standard?, partial?];
    let x_label = "x [m]".to_owned();
    let along: Vec<(f64, f64)> = (0..=200)
        .map(|i| LENGTH * (f64::from(i) / 200.0 - 0.5))
        .map(|x| (x, horizon(x)))
        .collect();
    LinePlot {
        title: "Horizon along the bar".into(),
        x_label: x_label.clone(),
        y_label: "horizon [m]".into(),
        series: vec![Series::new("horizon", Stroke::Line, along)],
        ..LinePlot::default()
    }
    .write(&folder.join("bar_horizon.svg"))?;
    for (name, title, values) in [
        (
            "bar_linear.svg",
            "Acceleration under u = 0.001 x",
            (|p: &Profile| p.linear.clone()) as fn(&Profile) -> Vec<f64>,
        ),
        (
            "bar_quadratic.svg",
            "Acceleration under u = 0.001 x²",
            |p| p.quadratic.clone(),
        ),
    ] {
        let series = profiles
            .iter()
            .map(|(model, p)| {
                let points = p.x.iter().copied().zip(values(p)).collect();
                Series::new(*model, Stroke::Line, points)
            })
            .collect();
        LinePlot {
            title: title.into(),
            x_label: x_label.clone(),
            y_label: "acceleration [m/s²]".into(),
            series,
            ..LinePlot::default()
        }
        .write(&folder.join(name))?;
    }
    Ok(())
}

/// Failure to draw a figure.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The bar.
    #[error(transparent)]
    Bar(#[from] SceneFailure),
    /// The file.
    #[error(transparent)]
    Write(#[from] ObserveError),
}

#[cfg(test)]
mod tests {
    use super::*;
    use bondline::progress::Silent;

    #[test]
    fn partial_stress_follows_the_field_and_standard_peridynamics_does_not() {
        // E u'' / rho = 200e9 * 2e-3 / 7800, by hand
        assert!((exact_acceleration() - 51_282.051_282_051_28).abs() < 1e-9);
        for law in [BarLaw::Correspondence, BarLaw::Lps] {
            let p = profile::<1>(law, BarModel::PartialStress, 0.05, 1, HORIZON, &Silent).unwrap();
            assert!(p.x.len() > 180 && p.x[0] < -4.7);
            for (l, q) in p.linear.iter().zip(&p.quadratic) {
                assert!(l.abs() < 1e-8 * linear_scale(), "{law:?} {l}");
                assert!((q / exact_acceleration() - 1.0).abs() < 1e-8, "{law:?} {q}");
            }
            // ghost forces where the horizon varies, and nowhere else
            let s = profile::<1>(law, BarModel::Standard, 0.05, 1, HORIZON, &Silent).unwrap();
            for (x, a) in s.x.iter().zip(&s.linear) {
                if x.abs() < 1.7 || x.abs() > 3.3 {
                    assert!(a.abs() < 1e-8 * linear_scale(), "{law:?} at {x}: {a}");
                }
            }
            assert!(largest(s.linear.iter().copied()) > 0.1 * linear_scale());
        }
    }
}
