//! Rows that affine fields leave out of balance: their classes, limits, and the findings on them.

use crate::observe::proof::{Figure, Finding, Part, Severity};
use crate::observe::report::number;
use crate::observe::warning::{Code, Quantity, Warning};

/// Limits of this part of the proof; `docs/proof.md` has the measurements behind them.
pub(super) mod limits {
    /// Force per volume over stress per spacing up to which a row counts as exact: round-off is 1e-11 at most (`bondline verify patch`).
    pub const EXACT: f64 = 1e-9;
    /// Up to this no error is predicted: a hundred spacings of such forces would add up to a fifth of [`WARN`].
    pub const NEGLIGIBLE: f64 = 1e-5;
    /// Relative error of the stress at the seam, or among points, from which a run warns.
    pub const WARN: f64 = 0.005;
    /// Relative error of the stress there, from which a run is refused.
    pub const REFUSE: f64 = 0.5;
    /// As [`WARN`], at free surfaces and supports that cross the peridynamic zone.
    pub const WARN_SURFACE: f64 = 0.02;
    /// As [`WARN`], where the seam meets a surface: an error beside one edge bends the body, and a strip of 1.7 % there bent a plate of 15 by 9 cells by 6 % of its displacement.
    pub const WARN_SEAM_AT_SURFACE: f64 = 0.01;
    /// As [`REFUSE`], where the seam meets a surface: an incomplete family alone leaves less than 1. Surfaces alone are warned of, never refused: of rows that
    /// are nearly alike the one that is judged hangs on round-off, and so does the number.
    pub const REFUSE_SURFACE: f64 = 2.0;
    /// As [`WARN`], where points of a transition zone lie at a surface that their rows know nothing of: there is no reason to end one there.
    pub const WARN_TRANSITION: f64 = 0.002;
    /// As [`REFUSE`], where points of a transition zone lie at a surface: what is local of their rows knows nothing of a boundary, and a patch shows a third of what the whole zone does. Small zones
    /// beside one surface lie near 0.5.
    pub const REFUSE_TRANSITION: f64 = 1.0;
}

/// Class of a row that an affine field leaves out of balance, by its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum RowClass {
    /// Elements and points meet in the row.
    Seam,
    /// Points alone, their families full of points.
    Points,
    /// Points alone, of different horizons.
    HorizonChange,
    /// A point of a transition zone whose family lacks points beyond a surface of the body.
    Transition,
    /// A family of the row lacks points beyond a free surface.
    FreeSurface,
    /// A family of the row lacks points beyond a surface whose normal displacement is prescribed.
    Support,
    /// A family of the row lacks points beyond a surface with a traction.
    LoadedSurface,
    /// A family of the row lacks points behind a crack or in a void.
    Crack,
    /// Bonds of the row join points of two materials.
    Border,
    /// Elements and points meet in the row, and a family of it lacks points.
    SeamAtSurface,
}

impl RowClass {
    const ALL: [Self; 10] = [
        Self::Seam,
        Self::Points,
        Self::HorizonChange,
        Self::Transition,
        Self::FreeSurface,
        Self::Support,
        Self::LoadedSurface,
        Self::Crack,
        Self::Border,
        Self::SeamAtSurface,
    ];

    /// The class as a number, for other processes.
    pub fn number(self) -> f64 {
        let place = Self::ALL.iter().position(|class| *class == self);
        place.unwrap_or(0) as f64
    }

    /// The class of a number.
    pub fn numbered(number: f64) -> Self {
        Self::ALL[number as usize]
    }
}

/// Rows of one class that affine fields leave out of balance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unbalanced {
    /// Class of the rows, by their place.
    pub class: RowClass,
    /// Number of rows.
    pub rows: usize,
    /// Largest force per volume, over the stress of the field per spacing.
    pub residual: f64,
    /// Position of the row with that force.
    pub at: Vec<f64>,
    /// Predicted error of the stress, over that of the field; signed where it is that of the component which the field has. None where it is not predicted.
    pub stress_error: Option<f64>,
    /// True if the prediction failed: other surfaces cut all families around, or the patch has no unique solution.
    pub is_unpredictable: bool,
    /// Position of that error of the stress.
    pub stress_at: Vec<f64>,
}

/// Possibility of a layer of elements over the surfaces at which families lack points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Skin {
    /// `zones.skin` would lay one.
    Possible,
    /// A crack or void passes through the cells there, and elements carry neither.
    Crossed,
    /// There are no elements at all, so that zones are not looked at.
    NoElements,
}

impl Skin {
    /// Returns the remedy for surfaces.
    fn remedy(self) -> Remedy {
        match self {
            Self::Possible => Remedy {
                words: "zones.skin = \"free-surfaces\" puts elements there, through which no crack comes",
                keys: &[&["zones.skin=free-surfaces"]],
            },
            Self::Crossed => Remedy::in_words(
                "a crack or void passes through the cells there, which elements cannot carry; a smaller horizon makes the layer thinner",
            ),
            Self::NoElements => Remedy {
                words: "elements there (coupling = \"truncated\" and zones.skin = \"free-surfaces\") or a smaller horizon help",
                keys: &[&["coupling=truncated", "zones.skin=free-surfaces"]],
            },
        }
    }

    /// As [`Skin::remedy`], where a seam meets the surface.
    fn remedy_at_seam(self) -> Remedy {
        match self {
            Self::Possible | Self::NoElements => Remedy {
                words: "zones.skin = \"free-surfaces\", or end the zones two horizons from the surface",
                keys: &[&["zones.skin=free-surfaces"]],
            },
            Self::Crossed => Remedy::in_words(
                "a crack or void passes through the cells there, so that the zone has to end in the surface; a smaller horizon makes the layer thinner",
            ),
        }
    }
}

/// A remedy in words, and what of it keys of a scene can do.
#[derive(Clone, Copy, Debug)]
struct Remedy {
    words: &'static str,
    /// Ways to choose from, each the values of `--set` that it takes.
    keys: &'static [&'static [&'static str]],
}

impl Remedy {
    const fn in_words(words: &'static str) -> Self {
        Self { words, keys: &[] }
    }
}

/// The coupling whose seam balances uniform stresses on any mesh.
const TRUNCATED: Remedy = Remedy {
    words: "use coupling.truncated",
    keys: &[&["coupling=truncated"]],
};

/// The rule under which a uniform strain leaves no force.
const SPLICE: Remedy = Remedy {
    words: "peridynamics.horizon-change = \"splice\" leaves no such error, but forces are no pairs then",
    keys: &[&["peridynamics.horizon-change=splice"]],
};

/// Properties of a model that decide which remedies there are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// True if points lie on a lattice.
    pub is_lattice: bool,
    /// True if bonds end on the faces of elements.
    pub is_truncated: bool,
    /// Possibility of elements at surfaces.
    pub skin: Skin,
    /// True if the horizon has so few values that points may see others with their own.
    pub takes_splice: bool,
}

/// Returns the results of this part of the proof, as data.
pub(super) fn told(
    fields: usize,
    residual: f64,
    rows: usize,
    unbalanced: &[Unbalanced],
    layout: Layout,
) -> Part {
    let figure = |name: String, value: f64| Figure { name, value };
    let mut figures = vec![
        figure("fields".to_owned(), fields as f64),
        figure("residual of rows in balance".to_owned(), residual),
        figure("rows out of balance".to_owned(), rows as f64),
    ];
    let mut line = format!("affine fields pass the seam to {}", number(residual));
    let mut kinds = Vec::new();
    for class in unbalanced {
        let name = class.class.name();
        figures.push(figure(format!("rows {name}"), class.rows as f64));
        figures.push(figure(format!("residual {name}"), class.residual));
        let mut kind = format!("{} {name}", class.rows);
        if let Some(error) = class.stress_error {
            figures.push(figure(format!("stress error {name}"), error));
            kind += &format!(", stress {:+.1} %", 100.0 * error);
        }
        if class.is_unpredictable {
            kind += ", stress not known";
        }
        kinds.push(kind);
    }
    if !kinds.is_empty() {
        line += &format!(", but for {rows} rows: {}", kinds.join("; "));
    }
    Part {
        name: "affine",
        line,
        figures,
        findings: unbalanced
            .iter()
            .filter_map(|rows| verdict(rows, layout))
            .collect(),
    }
}

impl RowClass {
    /// Returns the place of such rows, in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Seam => "at the seam",
            Self::Points => "among points",
            Self::HorizonChange => "where the horizon changes",
            Self::Transition => "of the transition zone at surfaces",
            Self::FreeSurface => "at free surfaces",
            Self::Support => "at supports",
            Self::LoadedSurface => "at loaded surfaces",
            Self::Crack => "at cracks and voids",
            Self::Border => "at borders of materials",
            Self::SeamAtSurface => "where the seam meets surfaces",
        }
    }
}

/// Returns the place of the rows of a class, the remedy, and the errors from which on they are warned of and refused; none of rows at cracks, voids and borders of materials.
fn described(class: RowClass, layout: Layout) -> Option<(&'static str, Remedy, [f64; 2])> {
    let Layout {
        is_lattice,
        is_truncated,
        skin,
        takes_splice,
    } = layout;
    Some(match class {
        RowClass::Seam if is_lattice && is_truncated => (
            "at the seam",
            Remedy::in_words(
                "leave peridynamics.points out, whose lattice follows the mesh, or make the elements beside the zone no larger than two spacings",
            ),
            [limits::WARN, limits::REFUSE],
        ),
        RowClass::Seam if is_truncated => (
            "at the seam",
            Remedy::in_words("give peridynamics.points a lattice"),
            [limits::WARN, limits::REFUSE],
        ),
        RowClass::Seam if is_lattice => ("at the seam", TRUNCATED, [limits::WARN, limits::REFUSE]),
        RowClass::Points if is_lattice => (
            "among the points",
            Remedy {
                words: "leave peridynamics.weights out: isotropic ones carry the constants typed",
                keys: &[&["peridynamics.weights=isotropic"]],
            },
            [limits::WARN, limits::REFUSE],
        ),
        RowClass::Seam => (
            "at the seam",
            Remedy {
                words: "give peridynamics.points a lattice, or use coupling.truncated",
                keys: TRUNCATED.keys,
            },
            [limits::WARN, limits::REFUSE],
        ),
        RowClass::Points => (
            "among the points, which are no lattice,",
            Remedy::in_words("give peridynamics.points a lattice"),
            [limits::WARN, limits::REFUSE],
        ),
        RowClass::HorizonChange => (
            "where the horizon changes",
            match takes_splice {
                true => SPLICE,
                false => Remedy::in_words(
                    "let the slope of the horizon change over a greater length, or use coupling.partial-stress there",
                ),
            },
            [limits::WARN, f64::INFINITY],
        ),
        RowClass::SeamAtSurface => (
            "where the seam meets the surface of the body",
            skin.remedy_at_seam(),
            [limits::WARN_SEAM_AT_SURFACE, limits::REFUSE_SURFACE],
        ),
        RowClass::Transition => (
            "where the transition zone meets the surface of the body, which its rows know nothing of,",
            Remedy {
                words: "end the transition zone two horizons from the surface, or use coupling.truncated",
                keys: TRUNCATED.keys,
            },
            [limits::WARN_TRANSITION, limits::REFUSE_TRANSITION],
        ),
        RowClass::FreeSurface | RowClass::LoadedSurface => (
            "at a surface that crosses the peridynamic zone, where families lack points",
            skin.remedy(),
            [limits::WARN_SURFACE, f64::INFINITY],
        ),
        RowClass::Support => (
            "at a symmetry plane or support that crosses the peridynamic zone, where families lack points",
            skin.remedy(),
            [limits::WARN_SURFACE, f64::INFINITY],
        ),
        RowClass::Crack | RowClass::Border => return None,
    })
}

impl Remedy {
    /// The warning of rows with it, at a place with the predicted error of the stress there.
    fn warning(
        &self,
        is_surface: bool,
        (place, effect): (&[f64], Option<f64>),
        message: String,
    ) -> Warning {
        let code = match is_surface {
            true => Code::SurfaceStress,
            false => Code::SeamStress,
        };
        let values = |keys: &&[&str]| keys.iter().map(|&key| key.to_owned()).collect();
        Warning {
            remedies: self.keys.iter().map(values).collect(),
            ..Warning::new(code, message)
                .of(Quantity::Stress, effect)
                .at(place)
        }
    }
}

/// Returns the finding on a class of rows, if there is one.
fn verdict(rows: &Unbalanced, layout: Layout) -> Option<Finding> {
    let (what, remedy, [warn, refuse]) = described(rows.class, layout)?;
    let is_surface = !matches!(
        rows.class,
        RowClass::Seam | RowClass::Points | RowClass::HorizonChange
    );
    if rows.residual < limits::NEGLIGIBLE {
        return None;
    }
    let place = |x: &[f64]| {
        let x: Vec<String> = x.iter().map(|x| format!("{x:.4e}")).collect();
        format!("({})", x.join(", "))
    };
    // a residual whose effect is not known
    let unknown = |limit: f64, why: &str, more: &str| {
        Finding {
        severity: Severity::Warning,
        value: rows.residual,
        limit,
        warning: remedy.warning(
            is_surface,
            (&rows.at, None),
            format!(
                "a uniform stress is out of balance {what} by {} of it per spacing near {}; {why}{}{more}",
                number(rows.residual),
                place(&rows.at),
                remedy.words
            ),
        ),
    }
    };
    if rows.is_unpredictable && is_surface && rows.residual >= warn {
        let smaller = match remedy.words.contains("smaller horizon") {
            true => "",
            false => ", or take a smaller horizon",
        };
        let why = "the error of the stress there cannot be predicted, as in a body thinner than two horizons; ";
        return Some(unknown(warn, why, smaller));
    }
    let Some(error) = rows.stress_error else {
        // at a surface another class speaks for it
        return (!is_surface).then(|| unknown(limits::EXACT, "", ""));
    };
    if error.abs() < warn {
        return None;
    }
    let (severity, limit) = if error.is_nan() || error.abs() >= refuse {
        (Severity::Refusal, refuse)
    } else {
        (Severity::Warning, warn)
    };
    Some(Finding {
        severity,
        value: error,
        limit,
        warning: remedy.warning(
            is_surface,
            (&rows.stress_at, Some(error)),
            format!(
                "a uniform stress comes out wrong by {:+.1} % of it {what} near {}; {}",
                100.0 * error,
                place(&rows.stress_at),
                remedy.words
            ),
        ),
    })
}
