//! Warnings of `check` and `run`, as data: each has a code, with a section of `docs/manual/warnings.md`, and the error that it predicts.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

macro_rules! codes {
    ($($name:ident $code:literal $title:literal,)*) => {
        /// Kinds of warnings.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
        pub enum Code {
            $(#[doc = $title] #[serde(rename = $code)] $name,)*
        }

        impl Code {
            /// All of them, in the order of their numbers.
            pub const ALL: &[Self] = &[$(Self::$name),*];

            /// Returns the code as scenes and messages have it, `W31`.
            pub fn name(self) -> &'static str {
                match self { $(Self::$name => $code,)* }
            }

            /// Returns the heading of its section in `docs/manual/warnings.md`.
            pub fn title(self) -> &'static str {
                match self { $(Self::$name => $title,)* }
            }
        }
    };
}

codes! {
    Unused "W01" "A part of the scene does nothing",
    Mesh "W02" "The mesh was repaired or left something out",
    Units "W03" "Constants in other units than lengths",
    Cost "W04" "A run of unknown or great cost",
    SparseFamily "W05" "Families with too few points",
    NarrowTransition "W06" "A transition zone narrower than its coupling needs",
    Load "W11" "A load or a mass that the model carries in part",
    Support "W12" "A support that holds points inside of its face",
    SurfaceStress "W13" "Points at a surface that lack neighbours",
    SeamStress "W14" "A uniform stress that is out of balance at the seam",
    SeamGradient "W15" "A seam that errs where strains vary",
    Asymmetry "W16" "A stiffness that should be symmetric and is not",
    Growth "W17" "A mode of the seam that grows",
    TransitionAtSurface "W18" "A transition zone at the surface of the body",
    CrackAtSeam "W19" "A crack beside the seam",
    FlowInSimplices "W21" "Triangles and tetrahedra that flow at constant volume",
    Locking "W22" "Elements of first order of a nearly incompressible solid",
    CrackBand "W23" "Elongated elements that soften",
    Indefinite "W31" "An equilibrium that is not one of least energy",
    Imbalance "W32" "Loads and reactions that do not balance",
    SurfacePeak "W33" "A peak of stress at a surface within a family",
    SeamPeak "W34" "A peak of stress in an element beside the seam",
    Rotation "W35" "Kinematics of small rotations in a body that turns",
    BeyondRange "W36" "Linear or whole parts beyond the range of their material",
    Relaxation "W37" "Elastic parts of a material that relaxes",
    TornPoints "W41" "Torn points without a deformation gradient",
    EnergyGain "W42" "Energy gained without work",
    CrackRan "W43" "A crack that ran on within a load step",
    DamageAtEdge "W44" "Damage at the edge of the nonlocal zone",
    Impactor "W51" "An impactor that touches nothing, or few sites",
    ContactDepth "W52" "Surfaces deep inside each other",
    CrackOverlap "W53" "Faces of a crack that lie in each other",
}

/// The page of the manual that explains them, a section each.
const PAGE: &str = include_str!("../../docs/manual/warnings.md");

impl Code {
    /// Returns its section of the manual.
    pub fn explanation(self) -> &'static str {
        let heading = format!("## {self} {}\n", self.title());
        let Some((_, rest)) = PAGE.split_once(heading.as_str()) else {
            return self.title();
        };
        let end = rest.find("\n#").unwrap_or(rest.len());
        rest[..end].trim()
    }
}

impl std::str::FromStr for Code {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL
            .iter()
            .find(|code| code.name().eq_ignore_ascii_case(text));
        found.copied().ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|code| code.name()).collect();
            format!("there is no such code; known are {}", names.join(", "))
        })
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Quantity that a warning predicts an error of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Displacement, over the largest one.
    Displacement,
    /// Stress at the place of the warning, over itself.
    Stress,
    /// Load or mass, over itself.
    Load,
    /// Energy, over the largest one of the run.
    Energy,
    /// Contact force, over its peak.
    ContactForce,
}

/// A doubt about a model or its solution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Warning {
    /// Its kind.
    pub code: Code,
    /// Quantity that may be wrong, where one is named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<Quantity>,
    /// Predicted error of that quantity, a part of it: signed where the sign is known, positive where it is not; none where it cannot be predicted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effect: Option<f64>,
    /// Place, one coordinate per dimension \[m\]; empty where no single place is to blame.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub place: Vec<f64>,
    /// Remedies to choose from, each the values of `--set` that it takes; empty where it is a matter of drawing or meshing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remedies: Vec<Vec<String>>,
    /// The defect, its place and size, and a remedy: one sentence for people.
    pub message: String,
    /// True if the scene denies its kind, so that the run counts as failed.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub denied: bool,
}

impl Warning {
    /// A warning of a kind, with its sentence.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self {
            code,
            quantity: None,
            effect: None,
            place: Vec::new(),
            remedies: Vec::new(),
            message: message.into(),
            denied: false,
        }
    }

    /// With the quantity that may be wrong, and by which part of it.
    pub fn of(self, quantity: Quantity, effect: impl Into<Option<f64>>) -> Self {
        Self {
            quantity: Some(quantity),
            effect: effect.into(),
            ..self
        }
    }

    /// With its place.
    pub fn at(self, place: impl Into<Vec<f64>>) -> Self {
        Self {
            place: place.into(),
            ..self
        }
    }

    /// With one more remedy to choose from, the values of `--set` that it takes.
    pub fn remedy<const N: usize>(mut self, values: [&str; N]) -> Self {
        self.remedies.push(values.map(str::to_owned).to_vec());
        self
    }
}

impl fmt::Display for Warning {
    /// As a line of a report.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.denied { "denied" } else { "warning" };
        write!(f, "{word} {}: {}", self.code, self.message)
    }
}

/// Kinds of warnings that a scene does not want to see, and those that it does not accept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Policy {
    /// Kinds that are left out.
    pub allowed: Vec<Code>,
    /// Kinds with which a run counts as failed.
    pub denied: Vec<Code>,
}

impl Policy {
    /// Leaves out what is allowed, and marks what is denied.
    pub fn apply(&self, warnings: &mut Vec<Warning>) {
        warnings.retain(|warning| !self.allowed.contains(&warning.code));
        for warning in warnings {
            warning.denied = self.denied.contains(&warning.code);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manual_explains_every_code_and_no_other() {
        let headings: Vec<&str> = PAGE.lines().filter(|l| l.starts_with("## W")).collect();
        let codes = Code::ALL
            .iter()
            .map(|code| format!("## {code} {}", code.title()));
        assert_eq!(headings, codes.collect::<Vec<_>>());
        assert!(Code::ALL.iter().all(|code| code.explanation().len() > 60));
        assert_eq!("w32".parse(), Ok(Code::Imbalance));
        assert!("W99".parse::<Code>().unwrap_err().contains("W01, W02"));
    }
}
