//! Parts of the scenes of the suites: numbers, places, boxes, generated meshes, laws and couplings as TOML.
//!
//! One place for each, so that a suite differs from a scene of a person only in who types it.

use std::sync::Arc;

use bondline::{
    coupling::BlendingFunction,
    model::FitDegree,
    peridynamics::{
        BondBased, CalibrationFields, Correspondence, Influence, LinearPeridynamicSolid,
        Micromodulus, PositionAwareSolid,
        influence::{Alpha, Degree},
    },
};

/// Young's modulus of every case \[Pa\].
pub const YOUNGS_MODULUS: f64 = 2e11;

/// Poisson's ratio of every case whose law has one.
pub const POISSON: f64 = 0.3;

/// `P_1/|ξ|`: the influence function with which every method behaved in the table of `docs/patch-test.md`.
pub const INFLUENCE: Influence = Influence::Polynomial {
    degree: Degree::P1,
    alpha: Alpha::One,
};

/// A coupling method with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Each site takes the force of its own model.
    Splice,
    /// Forces blended over the transition zone.
    Blending(BlendingFunction),
    /// Half of a splice and half of a blending with a step in β at the edge of the nonlocal zone.
    Balanced,
    /// The same with β over the transition zone.
    BalancedOver(BlendingFunction),
    /// Partial stress at points; ω of the divergence is that of the law, which a scene cannot choose apart from it.
    Meshfree,
    /// Partial stress in elements.
    Elements(FitDegree),
    /// Bonds that end on faces.
    Truncated,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 10] = [
        Self::Splice,
        Self::Blending(BlendingFunction::Constant),
        Self::Blending(BlendingFunction::Linear),
        Self::Blending(BlendingFunction::Smooth),
        Self::Meshfree,
        Self::Elements(FitDegree::Affine),
        Self::Elements(FitDegree::Quadratic),
        Self::Truncated,
        Self::Balanced,
        Self::BalancedOver(BlendingFunction::Smooth),
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Splice => "splice",
            Self::Blending(BlendingFunction::Constant) => "blending constant",
            Self::Blending(BlendingFunction::Linear) => "blending linear",
            Self::Blending(BlendingFunction::Smooth) => "blending smooth",
            Self::Balanced => "balanced",
            Self::BalancedOver(BlendingFunction::Constant) => "balanced constant",
            Self::BalancedOver(BlendingFunction::Linear) => "balanced linear",
            Self::BalancedOver(BlendingFunction::Smooth) => "balanced smooth",
            Self::Meshfree => "partial stress meshfree",
            Self::Elements(FitDegree::Affine) => "partial stress elements affine",
            Self::Elements(FitDegree::Quadratic) => "partial stress elements quadratic",
            Self::Truncated => "truncated",
        }
    }

    /// Returns true if a transition zone has a meaning of its own.
    pub fn has_transition(self) -> bool {
        !matches!(self, Self::Splice | Self::Truncated | Self::Balanced)
    }

    /// Returns true if the method takes a law.
    pub fn is_offered(self, law: Law) -> bool {
        self != Self::Truncated || !matches!(law, Law::Correspondence(_))
    }
}

/// A peridynamic law with its kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// [`BondBased`].
    BondBased(Micromodulus),
    /// [`LinearPeridynamicSolid`].
    StateBased(Influence),
    /// [`Correspondence`], stabilised with 1.
    Correspondence(Influence),
    /// [`PositionAwareSolid`], calibrated along the axes; not of bars.
    PositionAware(Influence),
}

impl Law {
    /// Every law of bodies of `D` dimensions, with its usual kernel.
    pub fn all<const D: usize>() -> Vec<Self> {
        let mut all = vec![
            Self::BondBased(Micromodulus::InverseDistance),
            Self::StateBased(INFLUENCE),
            Self::Correspondence(INFLUENCE),
        ];
        if D > 1 {
            all.push(Self::PositionAware(INFLUENCE));
        }
        all
    }

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::BondBased(_) => "bond-based",
            Self::StateBased(_) => "LPS",
            Self::Correspondence(_) => "correspondence",
            Self::PositionAware(_) => "PALS",
        }
    }

    /// Lamé parameters λ, μ \[Pa\] of the material of Young's modulus [`YOUNGS_MODULUS`], by hand: a bar in 1D, plane strain in 2D;
    /// Poisson ratio 1/4 where the law fixes it, else [`POISSON`].
    pub fn lame<const D: usize>(self) -> (f64, f64) {
        let e = YOUNGS_MODULUS;
        match (self, D) {
            (Self::BondBased(_), 1) => (e / 3.0, e / 3.0),
            (Self::BondBased(_), _) => (0.4 * e, 0.4 * e),
            (_, 1) => (e - 2.0 * e / 2.6, e / 2.6),
            _ => (e * 0.3 / (1.3 * 0.4), e / 2.6),
        }
    }

    /// The law itself, for bodies that are no scene: clouds of points at random.
    pub fn law<const D: usize>(self) -> Arc<dyn bondline::peridynamics::Law<D>> {
        let (lambda, mu) = self.lame::<D>();
        match self {
            Self::BondBased(kernel) => Arc::new(BondBased::<D>::new(kernel, mu)),
            Self::StateBased(w) => Arc::new(LinearPeridynamicSolid::<D>::new(w, lambda, mu)),
            Self::Correspondence(w) => Arc::new(Correspondence::<D>::new(w, lambda, mu, 1.0)),
            Self::PositionAware(w) => {
                let fields = CalibrationFields::Axes;
                Arc::new(PositionAwareSolid::<D>::new(w, fields, lambda, mu))
            }
        }
    }
}

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

/// Table that lets a scene leave its body free: it moves. Its model at rest is the same.
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
        Micromodulus::Constant => "\"inverted-triangular\"".to_owned(),
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
        Law::PositionAware(_) => ("pals", format!("poisson-ratio = {poisson_ratio:?}")),
    };
    format!("[materials.m.{name}]\nyoungs-modulus = {youngs_modulus:?}\ndensity = 1\n{rest}\n")
}

/// The line of `[peridynamics]` that the law has there, if any: its influence function.
pub fn law_line(law: Law) -> String {
    match law {
        Law::BondBased(_) => String::new(),
        Law::StateBased(w) | Law::Correspondence(w) | Law::PositionAware(w) => {
            format!("influence = {}\n", influence(w))
        }
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
