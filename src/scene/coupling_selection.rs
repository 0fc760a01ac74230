//! The coupling of a scene: the one that is typed, or the one that suits it.
//!
//! Left to the program, it is `truncated` wherever that holds, for it alone is symmetric, in exact equilibrium and bounded in time. Where the scene shows that it
//! cannot hold (points that are no lattice, say) it is `splice`. Where only the seam itself can tell, because faces cut the lattice anywhere, an LPS has a low
//! Poisson's ratio, or points have a stress, `truncated` is tried, and the run goes on with `splice` if the seam, or the proof, refuses it (`src/run/chosen.rs`).

use super::error::SceneError;
use super::material_interfaces;
use super::materials::Material;
use super::peridynamics;
use super::selected_coupling::SelectedCoupling;
use super::source::Span;
use super::spec::{
    CouplingSpec, ElementsSpec, LocalSpec, NonlocalSpec, PeridynamicsSpec, PointsSpec, SceneSpec,
    SpliceSpec, TruncatedSpec,
};
use super::zones::{self, Placed};
use crate::mesh::Mesh;
use crate::model::{PointSource, Zone};
use crate::peridynamics::BondWeights;
use crate::tensor::Vector;

/// Distance, in spacings, by which faces may deviate from the lattice.
const FOLLOWS: f64 = 1e-6;

/// Obstacle to `truncated` in a scene that names no coupling.
enum Obstacle {
    /// It cannot hold.
    Certain(String),
    /// The seam or the proof has to tell.
    Possible(String),
}

/// The coupling that the scene names; without a name `truncated` where it is exact, or else `splice`. One model alone where a zone that was placed holds no cell, or every one.
///
/// # Errors
/// Those of the zones and of the lattice, on which the choice depends.
pub(crate) fn selected<const D: usize>(
    spec: &SceneSpec,
    (found, cell_material): (&[Material<D>], &[u16]),
    mesh: &Mesh<D>,
    placed: Option<&Placed>,
    instead: Option<&CouplingSpec>,
) -> Result<SelectedCoupling, SceneError> {
    let of = |coupling: CouplingSpec, span: Span, why: Option<String>| SelectedCoupling {
        traits: coupling.traits(),
        otherwise: None,
        coupling,
        span,
        why,
    };
    if let Some(placed) = placed {
        let only = |coupling, why: &str| of(coupling, placed.span.clone(), Some(why.to_owned()));
        if !placed.nonlocal.contains(&true) {
            let coupling = CouplingSpec::Local(LocalSpec {});
            return Ok(only(coupling, "the zone that was placed is empty"));
        }
        if !placed.nonlocal.contains(&false) && spec.coupling.is_none() {
            let coupling = CouplingSpec::Nonlocal(NonlocalSpec {});
            return Ok(only(coupling, "the zone that was placed holds every cell"));
        }
    }
    if let Some(coupling) = instead {
        let why = "the scene names none".to_owned();
        return Ok(of(coupling.clone(), spec.kinematics.span(), Some(why)));
    }
    if let Some(typed) = &spec.coupling {
        return Ok(of(typed.get_ref().clone(), typed.span(), None));
    }
    let span = spec.kinematics.span();
    let Some(p) = &spec.peridynamics else {
        without_peridynamics(spec)?;
        let why = "the scene has no [peridynamics]".to_owned();
        return Ok(of(CouplingSpec::Local(LocalSpec {}), span, Some(why)));
    };
    if matches!(p.points, Some(PointsSpec::File(_))) {
        let why = "the points of a file are the whole body".to_owned();
        return Ok(of(CouplingSpec::Nonlocal(NonlocalSpec {}), span, Some(why)));
    }
    let truncated = of(
        CouplingSpec::Truncated(TruncatedSpec::default()),
        span.clone(),
        Some(
            "the scene names none; symmetric and in exact equilibrium, and its faces follow the lattice"
                .to_owned(),
        ),
    );
    let splice = CouplingSpec::Splice(SpliceSpec {});
    if !spec.zones.bodies.is_empty() {
        let why = "the scene names none, and its bodies are spliced".to_owned();
        return Ok(match p.splices() {
            true => of(splice, span, Some(why)),
            // a layer of elements keeps bodies apart
            false => truncated,
        });
    }
    let is_placed = spec.zones.auto.is_some();
    Ok(
        match obstacle(spec, p, (found, cell_material), mesh, &truncated, placed)? {
            None => truncated,
            Some(Obstacle::Possible(reason)) if !is_placed => SelectedCoupling {
                otherwise: Some(splice),
                why: Some(format!(
                    "the scene names none; symmetric and in exact equilibrium, though {reason}"
                )),
                ..truncated
            },
            Some(Obstacle::Certain(reason) | Obstacle::Possible(reason)) => of(
                splice,
                span,
                Some(format!(
                    "the scene names none, and `truncated` is not for {reason}"
                )),
            ),
        },
    )
}

/// Refuses a scene that draws a nonlocal zone and has no peridynamics to fill it with.
fn without_peridynamics(spec: &SceneSpec) -> Result<(), SceneError> {
    let (span, what) = match (&spec.zones.nonlocal, spec.zones.bodies.keys().next()) {
        (Some(zone), _) => (zone.span(), "zones.nonlocal".to_owned()),
        (None, Some(name)) => (name.span.clone(), format!("zones.bodies.{name}")),
        (None, None) => return Ok(()),
    };
    Err(SceneError::missing(format!(
        "the scene draws `{what}` and has no [peridynamics] to fill it with"
    ))
    .label(span, "would be finite elements")
    .help(
        "add [peridynamics] with horizon = ..., or take the zone out, or type coupling = \"local\"",
    ))
}

/// Returns the obstacle that keeps truncated bonds from being exact, if there is one.
fn obstacle<const D: usize>(
    spec: &SceneSpec,
    p: &PeridynamicsSpec,
    (found, cell_material): (&[Material<D>], &[u16]),
    mesh: &Mesh<D>,
    truncated: &SelectedCoupling,
    placed: Option<&Placed>,
) -> Result<Option<Obstacle>, SceneError> {
    let certain = |reason: &str| Ok(Some(Obstacle::Certain(reason.to_owned())));
    let follows_bonds = |e: &toml::Spanned<ElementsSpec>| *e.get_ref() == ElementsSpec::CauchyBorn;
    let is_slow = |m: &Material<D>| m.law.is_some() && !m.is_accelerated();
    if p.elements.as_ref().is_some_and(follows_bonds) && found.iter().any(is_slow) {
        return certain("elements that follow the bonds of such a law at any stretch");
    }
    // what the seam or the proof has to tell
    let mut doubt = None;
    for m in found {
        let (Some((lambda, mu)), Some(law)) = (m.lame(), &m.law) else {
            continue;
        };
        let law = law.linearised();
        if law.has_deviators() {
            return certain(&format!("the {} material `{}`", m.law_name(), m.name));
        }
        if !law.is_ordinary() {
            doubt = Some(
                "it meets uniform stresses by least squares where its faces meet a free surface"
                    .to_owned(),
            );
        } else if !law.is_pairwise() && lambda < mu * (1.0 - 1e-9) {
            doubt = Some(format!(
                "the lps material `{}` has a Poisson's ratio below that of a bond-based one",
                m.name
            ));
        }
    }
    if matches!(p.points, Some(PointsSpec::Cells | PointsSpec::File(_))) {
        return certain("points that are no lattice");
    }
    if p.weights == BondWeights::Fitted {
        return certain("weights that are fitted family by family");
    }
    if p.horizon_varies() {
        return certain("a horizon that varies");
    }
    let zones = zones::zones(spec, truncated, mesh, placed)?;
    let used = material_interfaces::materials_of_points(cell_material, &zones);
    let law = found[usize::from(used[0])].law.as_ref();
    let is_pairwise = law.is_some_and(|law| law.linearised().is_pairwise());
    if used.len() > 1 && (D == 3 || !is_pairwise) {
        return certain("points of several materials in space, or of a law with dilatations");
    }
    let lattice = peridynamics::peridynamics(p, truncated.traits.lattice, mesh, &zones)?;
    let PointSource::Lattice { spacing, origin } = lattice.points else {
        return certain("points that are no lattice");
    };
    if let Some(reason) = doubt {
        return Ok(Some(Obstacle::Possible(reason)));
    }
    Ok((!follows(mesh, &zones, (spacing, &origin), FOLLOWS))
        .then(|| Obstacle::Possible("the faces of the zone do not follow the lattice".to_owned())))
}

/// Returns true if the faces of the zone are planes of the lattice, or halfway between them, and their nodes too, within a tolerance in spacings.
pub(super) fn follows<const D: usize>(
    mesh: &Mesh<D>,
    zones: &[Zone],
    (spacing, origin): (f64, &Vector<D>),
    tolerance: f64,
) -> bool {
    let nonlocal: Vec<bool> = zones.iter().map(|&z| z == Zone::Nonlocal).collect();
    let facets = mesh.interface_facets(&nonlocal, &true, &false);
    let at = |n: u32| (mesh.nodes[n as usize] - origin) / spacing;
    let near = |x: f64| (x - x.round()).abs() <= tolerance;
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
        D == 1 || n.norm() - n.amax() <= tolerance * n.norm()
    });
    upright && (shifted(0.5) || shifted(0.0))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::run::AnyScene;
    use crate::scene::Source;

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
        coupling_of(PLATE, overrides)
    }

    fn coupling_of(plate: &str, overrides: &[&str]) -> (&'static str, Option<String>) {
        let mut source = Source::new("plate.toml", plate);
        for o in overrides {
            source.push_override(o).expect("an override");
        }
        match AnyScene::from_source(&source, Path::new("."), "plate").expect("a scene") {
            AnyScene::Plane(s) => (s.coupling.traits().name, s.scene.coupling_why),
            other => panic!("a plate is plane: {other:?}"),
        }
    }

    #[test]
    fn a_scene_without_a_coupling_gets_the_one_that_suits_it() {
        assert_eq!(coupling(&["coupling=splice"]), ("splice", None));
        let (name, why) = coupling(&[]);
        assert_eq!(name, "truncated");
        assert!(why.is_some());
        for (change, first, reason) in [
            // the seam has to tell: tried first
            (
                "materials.plate.lps.poisson-ratio=0.1",
                "truncated",
                "below that of a bond-based",
            ),
            // a zone of cells of 0.1 beside a lattice of 0.08
            (
                "peridynamics.points.lattice.spacing=0.08",
                "truncated",
                "the scene names none",
            ),
            (
                "peridynamics.horizon=0.3 + 0.01*x",
                "splice",
                "a horizon that varies",
            ),
            ("peridynamics.weights=fitted", "splice", "fitted"),
            ("peridynamics.points=cells", "splice", "no lattice"),
        ] {
            let (name, why) = coupling(&[change]);
            assert_eq!(name, first, "{change}");
            assert!(why.is_some_and(|w| w.contains(reason)), "{change}");
        }
        let (name, why) = coupling_of(&PLATE.replace("lps]", "correspondence]"), &[]);
        assert_eq!(name, "truncated");
        assert!(why.is_some_and(|w| w.contains("least squares")));
        let (name, why) = coupling_of(&PLATE.replace("lps]", "pals]"), &[]);
        assert_eq!(name, "splice");
        assert!(why.is_some_and(|w| w.contains("`plate`")));
    }
}
