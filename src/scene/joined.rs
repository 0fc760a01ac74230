//! The coupling of a scene: the one that is typed, or the one that suits it.

use super::automatic::Placed;
use super::error::SceneError;
use super::materials::{Law, Material};
use super::peridynamics::{self, Points};
use super::source::Span;
use super::spec::{
    CouplingSpec, Joining, NoOptionsSpec, PeridynamicsSpec, PointsSpec, SceneSpec, TruncatedSpec,
    WeightsSpec,
};
use super::zones;
use crate::coupling::Zone;
use crate::mesh::Mesh;
use crate::tensor::Vector;

/// How exactly, in spacings, faces have to follow the lattice.
const FOLLOWS: f64 = 1e-6;

/// A coupling, and why it was chosen if the scene names none.
pub(super) struct Joined {
    pub coupling: CouplingSpec,
    pub joining: Joining,
    /// Where the scene names it, or its kinematics if it does not.
    pub span: Span,
    pub why: Option<String>,
}

/// The coupling that the scene names; without a name `truncated` where it is exact, or else `splice`. One model alone where a zone that was placed holds no cell, or every one.
///
/// # Errors
/// Those of the zones and of the lattice, which the choice looks at.
pub(super) fn joined<const D: usize>(
    spec: &SceneSpec,
    found: &[Material<D>],
    mesh: &Mesh<D>,
    placed: Option<&Placed>,
) -> Result<Joined, SceneError> {
    let of = |coupling: CouplingSpec, span: Span, why: Option<String>| Joined {
        joining: coupling.joining(),
        coupling,
        span,
        why,
    };
    if let Some(placed) = placed {
        let only = |coupling, why: &str| of(coupling, placed.span.clone(), Some(why.to_owned()));
        if !placed.nonlocal.contains(&true) {
            let coupling = CouplingSpec::Local(NoOptionsSpec {});
            return Ok(only(coupling, "the zone that was placed is empty"));
        }
        if !placed.nonlocal.contains(&false) && spec.coupling.is_none() {
            let coupling = CouplingSpec::Nonlocal(NoOptionsSpec {});
            return Ok(only(coupling, "the zone that was placed holds every cell"));
        }
    }
    if let Some(typed) = &spec.coupling {
        return Ok(of(typed.get_ref().clone(), typed.span(), None));
    }
    let span = spec.kinematics.span();
    let Some(p) = &spec.peridynamics else {
        let why = "the scene has no [peridynamics]".to_owned();
        return Ok(of(CouplingSpec::Local(NoOptionsSpec {}), span, Some(why)));
    };
    let truncated = of(
        CouplingSpec::Truncated(TruncatedSpec::default()),
        span.clone(),
        Some(
            "the scene names none; symmetric and in exact equilibrium, and its faces follow the lattice"
                .to_owned(),
        ),
    );
    if !spec.zones.bodies.is_empty() {
        // only bonds that end on faces join bodies of different horizons
        return Ok(truncated);
    }
    Ok(match obstacle(spec, p, found, mesh, &truncated, placed)? {
        None => truncated,
        Some(reason) => of(
            CouplingSpec::Splice(NoOptionsSpec {}),
            span,
            Some(format!(
                "the scene names none, and `truncated` is not for {reason}"
            )),
        ),
    })
}

/// What keeps truncated bonds from being exact, if anything does.
fn obstacle<const D: usize>(
    spec: &SceneSpec,
    p: &PeridynamicsSpec,
    found: &[Material<D>],
    mesh: &Mesh<D>,
    truncated: &Joined,
    placed: Option<&Placed>,
) -> Result<Option<String>, SceneError> {
    for m in found {
        let (lambda, mu) = m.lame;
        match m.law {
            Law::Correspondence(..) => {
                return Ok(Some(format!("the correspondence material `{}`", m.name)));
            }
            Law::Lps(_) if lambda < mu * (1.0 - 1e-9) => {
                return Ok(Some(format!(
                    "an lps material below the Poisson ratio of a bond-based one, `{}`: its dilatation has a negative stiffness",
                    m.name
                )));
            }
            _ => {}
        }
    }
    if matches!(p.points, PointsSpec::Cells) {
        return Ok(Some("points that are no lattice".to_owned()));
    }
    if p.weights == WeightsSpec::Fitted {
        return Ok(Some("weights that are fitted family by family".to_owned()));
    }
    if p.horizon.as_constant().is_none() {
        return Ok(Some("a horizon that varies".to_owned()));
    }
    let lattice = peridynamics::peridynamics(p, truncated.joining.lattice, mesh)?;
    let Points::Lattice { spacing, origin } = lattice.points else {
        return Ok(Some("points that are no lattice".to_owned()));
    };
    let zones = zones::zones(spec, truncated, mesh, placed)?;
    Ok((!follows(mesh, &zones, spacing, &origin))
        .then(|| "a nonlocal zone whose faces do not follow the lattice".to_owned()))
}

/// Whether the faces of the zone are planes of the lattice, or halfway between them, and their nodes too.
fn follows<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    spacing: f64,
    origin: &Vector<D>,
) -> bool {
    let nonlocal: Vec<bool> = zones.iter().map(|&z| z == Zone::Nonlocal).collect();
    let facets = mesh.interface_facets(&nonlocal, &true, &false);
    let at = |n: u32| (mesh.nodes[n as usize] - origin) / spacing;
    let near = |x: f64| (x - x.round()).abs() <= FOLLOWS;
    let shifted = |shift: f64| {
        facets.iter().all(|f| {
            f.first
                .nodes
                .iter()
                .all(|&n| at(n).iter().all(|&x| near(x + shift)))
        })
    };
    let upright = facets.iter().all(|f| {
        let n = mesh.facet_normal_area(&f.first);
        D == 1 || n.norm() - n.amax() <= FOLLOWS * n.norm()
    });
    upright && (shifted(0.5) || shifted(0.0))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::{AnyScene, Source};

    const PLATE: &str = r#"
kinematics = "plane-strain"
[mesh.rectangle]
min = [0, 0]
max = [2, 1]
x = { cells = 20 }
y = { cells = 10 }
[materials.plate.lps]
youngs-modulus = 200
poisson-ratio = 0.3
[peridynamics]
horizon = 0.3
points.lattice = { spacing = 0.1 }
[zones.nonlocal]
box = { min = [0.6, 0], max = [1.4, 1] }
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
"#;

    /// The coupling of the plate with overrides, and why.
    fn coupling(overrides: &[&str]) -> (&'static str, Option<String>) {
        let mut source = Source::new("plate.toml", PLATE);
        for o in overrides {
            source.push_override(o).expect("an override");
        }
        match AnyScene::from_source(&source, Path::new("."), "plate").expect("a scene") {
            AnyScene::Plane(s) => (s.coupling.joining().name, s.coupling_why),
            other => panic!("a plate is plane: {other:?}"),
        }
    }

    #[test]
    fn a_scene_without_a_coupling_gets_the_one_that_suits_it() {
        assert_eq!(coupling(&["coupling=splice"]), ("splice", None));
        let (name, why) = coupling(&[]);
        assert_eq!(name, "truncated");
        assert!(why.is_some());
        for (change, reason) in [
            (
                "materials.plate.lps.poisson-ratio=0.1",
                "below the Poisson ratio",
            ),
            ("peridynamics.horizon=0.3 + 0.01*x", "a horizon that varies"),
            ("peridynamics.weights=fitted", "fitted"),
            ("peridynamics.points=cells", "no lattice"),
            // a zone of cells of 0.1 beside a lattice of 0.08
            ("peridynamics.points.lattice.spacing=0.08", "do not follow"),
        ] {
            let (name, why) = coupling(&[change]);
            assert_eq!(name, "splice", "{change}");
            assert!(why.is_some_and(|w| w.contains(reason)), "{change}");
        }
    }
}
