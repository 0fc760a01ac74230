//! What the suites type of their scenes: numbers, places, boxes, generated meshes, laws and couplings as TOML.
//!
//! One place for each, so that a suite differs from a scene of a person only in who types it.

use crate::enclosed::{Law, Method};
use bondline::{
    coupling::{BlendingFunction, FitDegree},
    peridynamics::{
        Influence, Micromodulus,
        influence::{Alpha, Degree},
    },
};

/// Coordinates with all their digits, `[0.5, -0.25]`.
pub fn place<const D: usize>(x: [f64; D]) -> String {
    format!("{x:?}")
}

/// A box as a shape.
pub fn cuboid<const D: usize>(min: [f64; D], max: [f64; D]) -> String {
    format!(
        "{{ box = {{ min = {}, max = {} }} }}",
        place(min),
        place(max)
    )
}

/// A box about the origin, `half` wide to either side.
pub fn cube<const D: usize>(half: f64) -> String {
    cuboid([-half; D], [half; D])
}

/// The first shape without the second.
pub fn without(from: &str, removed: &str) -> String {
    format!("{{ without = {{ from = {from}, removed = {removed} }} }}")
}

/// A table of a mesh of equal boxes.
pub fn grid<const D: usize>(min: [f64; D], max: [f64; D], cells: [usize; D]) -> String {
    let name = ["line", "rectangle", "box"][D - 1];
    let mut text = format!(
        "[mesh.{name}]\nmin = {}\nmax = {}\n",
        place(min),
        place(max)
    );
    for (axis, cells) in ["x", "y", "z"].iter().zip(cells) {
        text += &format!("{axis}.cells = {cells}\n");
    }
    text
}

/// The kinematics of a suite of `D` dimensions; plane strain in 2D.
pub fn kinematics<const D: usize>() -> &'static str {
    ["bar", "plane-strain", "solid"][D - 1]
}

/// What lets a scene leave its body free: it moves. Its model at rest is the same.
pub const FREE: &str = "[solve.explicit]\nduration = 1\n";

/// No bond of a convex body leaves it: the scene need not look for those that do.
pub const UNCUT: &str = "surfaces = \"uncut\"\n";

/// An influence function.
pub fn influence(w: Influence) -> String {
    match w {
        Influence::Gaussian => "\"gaussian\"".to_owned(),
        Influence::Polynomial { degree, alpha } => {
            let alpha = u8::from(alpha == Alpha::One);
            format!("{{ degree = {}, alpha = {alpha} }}", Degree::order(degree))
        }
    }
}

fn micromodulus(kernel: Micromodulus) -> String {
    match kernel {
        Micromodulus::InverseDistance => "\"inverse-distance\"".to_owned(),
        Micromodulus::Uniform => "\"uniform\"".to_owned(),
        Micromodulus::Constant => "\"constant\"".to_owned(),
        Micromodulus::Triangular => "\"triangular\"".to_owned(),
        Micromodulus::Influence(w) => format!("{{ influence = {} }}", influence(w)),
    }
}

/// The table of the one material, of density 1; a bond-based one has no use for Poisson's ratio.
pub fn material(law: Law, youngs_modulus: f64, poisson_ratio: f64) -> String {
    let (name, rest) = match law {
        Law::BondBased(kernel) => {
            let kernel = micromodulus(kernel);
            ("bond-based", format!("micromodulus = {kernel}"))
        }
        Law::StateBased(_) => ("lps", format!("poisson-ratio = {poisson_ratio:?}")),
        Law::Correspondence(_) => (
            "correspondence",
            format!("poisson-ratio = {poisson_ratio:?}"),
        ),
    };
    format!("[materials.m.{name}]\nyoungs-modulus = {youngs_modulus:?}\ndensity = 1\n{rest}\n")
}

/// The line of `[peridynamics]` that the law has there, if any: its influence function.
pub fn law_line(law: Law) -> String {
    match law {
        Law::BondBased(_) => String::new(),
        Law::StateBased(w) | Law::Correspondence(w) => format!("influence = {}\n", influence(w)),
    }
}

/// A coupling.
pub fn coupling(method: Method) -> String {
    let beta = |function| match function {
        BlendingFunction::Constant => "constant",
        BlendingFunction::Linear => "linear",
        BlendingFunction::Smooth => "smooth",
    };
    match method {
        Method::Splice => "\"splice\"".to_owned(),
        Method::Truncated => "\"truncated\"".to_owned(),
        Method::Balanced => "\"balanced\"".to_owned(),
        Method::Blending(f) => format!("{{ blending = {{ beta = \"{}\" }} }}", beta(f)),
        Method::BalancedOver(f) => format!("{{ balanced = {{ beta = \"{}\" }} }}", beta(f)),
        Method::Meshfree => "{ partial-stress = { form = \"meshfree\" } }".to_owned(),
        Method::Elements(fit) => {
            let fit = match fit {
                FitDegree::Affine => "affine",
                FitDegree::Quadratic => "quadratic",
            };
            format!("{{ partial-stress = {{ interface = \"{fit}\" }} }}")
        }
    }
}
