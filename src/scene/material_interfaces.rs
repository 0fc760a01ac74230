//! Several materials of the points of a scene: whether they have bonds with each other, and what these are.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::bounds_checks;
use super::error::{SceneError, SceneErrorKind};
use super::materials::Material;
use super::peridynamics::Peridynamics;
use super::source::Span;
use super::spec::{CouplingSpec, MaterialInterfaceSpec, SceneSpec};
use super::value::Text;
use crate::model::{PointSource, Zone};
use crate::observe::summary::Decision;
use crate::peridynamics::failure::{self, Fracture};
use crate::peridynamics::{Law, Several, StiffnessMean};

/// Bonds between two materials, as a scene types them.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialInterface {
    /// Its name.
    pub name: String,
    /// The numbers of the two, the lower one first.
    pub between: [u16; 2],
    /// The stiffness of its bonds.
    pub mean: StiffnessMean,
    /// The fracture criterion of its bonds; the smaller critical stretch of the two materials if there is none.
    pub fracture: Option<Fracture>,
}

impl MaterialInterface {
    /// The interface of two materials, among all that are typed.
    pub fn of(list: &[Self], a: u16, b: u16) -> Option<&Self> {
        list.iter().find(|i| i.between == [a.min(b), a.max(b)])
    }
}

/// The interfaces of a scene.
///
/// # Errors
/// A [`SceneError`] for materials that are not there, two interfaces of the same materials, and what their laws do not take.
pub(crate) fn interfaces<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
) -> Result<Vec<MaterialInterface>, SceneError> {
    let mut found: Vec<MaterialInterface> = Vec::new();
    for (name, typed) in &spec.interfaces {
        let interface = interface(name, typed, materials)?;
        let [a, b] = interface.between;
        if let Some(other) = MaterialInterface::of(&found, a, b) {
            return Err(SceneError::conflict(format!(
                "the interfaces `{}` and `{name}` are of the same two materials",
                other.name
            ))
            .label(name.span.clone(), "a second rule for these bonds")
            .help("keep one of them"));
        }
        found.push(interface);
    }
    Ok(found)
}

fn interface<const D: usize>(
    name: &Text,
    typed: &MaterialInterfaceSpec,
    materials: &[Material<D>],
) -> Result<MaterialInterface, SceneError> {
    let number = |text: &Text| -> Result<u16, SceneError> {
        let place = materials.iter().position(|m| m.name == text.value);
        place.map(|n| n as u16).ok_or_else(|| {
            let known: Vec<&str> = materials.iter().map(|m| m.name.as_str()).collect();
            SceneError::wrong_value(format!(
                "`interfaces.{name}.between` names the material `{}`",
                text.value
            ))
            .label(text.span.clone(), "not a material of this scene")
            .help(format!("use two of {}", known.join(", ")))
        })
    };
    let [first, second] = &typed.between[..] else {
        let count = typed.between.len();
        return Err(SceneError::wrong_value(format!(
            "`interfaces.{name}.between` names {count} materials"
        ))
        .label(name.span.clone(), "bonds join two")
        .help("name two materials, and add a table for each other pair"));
    };
    let (a, b) = (number(first)?, number(second)?);
    if a == b {
        return Err(SceneError::wrong_value(format!(
            "`interfaces.{name}.between` names `{}` twice",
            first.value
        ))
        .label(second.span.clone(), "the same material")
        .help("name two different ones"));
    }
    let law_of = |m: u16| {
        let material = &materials[usize::from(m)];
        material.law.as_ref().ok_or_else(|| {
            SceneError::conflict(format!(
                "`interfaces.{name}.between` names the material `{}`, which has no points",
                material.name
            ))
            .label(name.span.clone(), "has no bonds")
            .help("an orthotropic material has finite elements alone, which share their nodes; remove the interface")
        })
    };
    let (law, _) = (law_of(a)?, law_of(b)?);
    if let Some(stiffness) = typed
        .stiffness
        .as_ref()
        .filter(|_| !law.linearised().is_pairwise())
    {
        return Err(SceneError::conflict(format!(
            "`interfaces.{name}.stiffness` is set, and the points of a {} have force states of their own",
            law.name()
        ))
        .label(stiffness.span(), "of bonds that have half of their stiffness from either end")
        .help("remove it, or use bond-based materials"));
    }
    Ok(MaterialInterface {
        name: name.value.clone(),
        between: [a.min(b), a.max(b)],
        mean: (typed.stiffness.as_ref()).map_or(StiffnessMean::Harmonic, |s| *s.get_ref()),
        fracture: fracture(name, typed, law.as_ref())?,
    })
}

fn fracture<const D: usize>(
    name: &Text,
    typed: &MaterialInterfaceSpec,
    law: &dyn Law<D>,
) -> Result<Option<Fracture>, SceneError> {
    let place = |key: &str| format!("interfaces.{name}.{key}");
    let refused = |span: Span, message: String, label: &str, help: &str| {
        Err(SceneError::conflict(message).label(span, label).help(help))
    };
    let found = match (&typed.fracture_energy, &typed.critical_stretch) {
        (None, None) => return Ok(None),
        (Some(_), Some(stretch)) => {
            return refused(
                stretch.span.clone(),
                format!("`interfaces.{name}` holds `fracture-energy`, `critical-stretch` at once"),
                "a second criterion",
                "keep one of them: bonds break by one criterion",
            );
        }
        (Some(energy), None) => {
            if law.bond_energy(1.0).is_none() {
                return refused(
                    energy.span.clone(),
                    format!(
                        "what breaking the bonds of a {} costs is not known in closed form",
                        law.name()
                    ),
                    "gives no critical stretch",
                    "give critical-stretch instead",
                );
            }
            Fracture {
                criterion: failure::FRACTURE_ENERGY,
                value: bounds_checks::positive(&place("fracture-energy"), energy)?,
                softening: 1.0,
                types_softening: false,
            }
        }
        (None, Some(stretch)) => Fracture {
            criterion: failure::CRITICAL_STRETCH,
            value: bounds_checks::positive(&place("critical-stretch"), stretch)?,
            softening: 1.0,
            types_softening: false,
        },
    };
    if !law.has_breakable_bonds() {
        return refused(
            name.span.clone(),
            format!("bonds of a {} do not break", law.name()),
            "needs a law whose bonds can break",
            "use bond-based or lps materials, or remove it",
        );
    }
    Ok(Some(found))
}

/// The materials that cells of the nonlocal and transition zones have, each once, that of the first such cell first; the first of all if there is no such cell.
pub(crate) fn materials_of_points(cell_material: &[u16], zones: &[Zone]) -> Vec<u16> {
    let mut used: Vec<u16> = Vec::new();
    let cells = cell_material.iter().zip(zones);
    for (&m, _) in cells.filter(|(_, zone)| **zone != Zone::Local) {
        if !used.contains(&m) {
            used.push(m);
        }
    }
    if used.is_empty() {
        used.push(0);
    }
    used
}

/// The law of the points, of all their materials; none of a material that has no points, in a scene without any.
///
/// # Errors
/// A [`SceneError`] for materials that cannot have bonds with each other.
pub(crate) fn law_of_points<const D: usize>(
    spec: &SceneSpec,
    materials: &[Material<D>],
    used: &[u16],
    interfaces: &[MaterialInterface],
) -> Result<Option<Arc<dyn Law<D>>>, SceneError> {
    let first = &materials[usize::from(used[0])].law;
    let (Some(first), [_, _, ..]) = (first, used) else {
        return Ok(first.clone());
    };
    // a material without points is never asked for its law
    let law = |m: &Material<D>| Arc::clone(m.law.as_ref().unwrap_or(first));
    let laws = materials.iter().map(law).collect();
    let mean =
        |a, b| MaterialInterface::of(interfaces, a, b).map_or_else(Default::default, |i| i.mean);
    match Several::new(laws, used, mean) {
        Ok(law) => Ok(Some(Arc::new(law))),
        Err(no) => {
            let (a, b) = (
                &materials[usize::from(no.first)],
                &materials[usize::from(no.second)],
            );
            Err(SceneError::conflict(format!(
                "the materials `{}` ({}) and `{}` ({}) both have points: {}",
                a.name,
                a.law_name(),
                b.name,
                b.law_name(),
                no.why
            ))
            .label(spec.span_of_material(&a.name), "one")
            .label(spec.span_of_material(&b.name), "another")
            .help("keep the nonlocal and transition zones within one of them, or give both the same law; a softening-bond does not mix"))
        }
    }
}

/// Says which materials points have, and what their bonds are between two, if they have several.
pub(crate) fn choice<const D: usize>(
    materials: &[Material<D>],
    used: &[u16],
    interfaces: &[MaterialInterface],
) -> Option<Decision> {
    let mut used = used.to_vec();
    used.sort_unstable();
    if used.len() < 2 {
        return None;
    }
    let of = |m: &u16| &materials[usize::from(*m)];
    let names: Vec<&str> = used.iter().map(|m| of(m).name.as_str()).collect();
    let is_own = |i: &&MaterialInterface| i.between.iter().all(|m| used.contains(m));
    let list = |counts: &dyn Fn(&MaterialInterface) -> bool| -> Vec<String> {
        let counted = interfaces.iter().filter(is_own).filter(|i| counts(i));
        counted.map(|i| format!("`{}`", i.name)).collect()
    };
    let arithmetic = list(&|i| i.mean == StiffnessMean::Arithmetic);
    let is_pairwise = |law: &Arc<dyn Law<D>>| law.linearised().is_pairwise();
    let is_pairwise = of(&used[0]).law.as_ref().is_some_and(is_pairwise);
    let mut why = match (is_pairwise, &arithmetic[..]) {
        (false, _) => "bonds between two have half of their stiffness from either end".to_owned(),
        (true, []) => "bonds between two have the harmonic mean of their stiffnesses".to_owned(),
        (true, list) => format!(
            "bonds between two have the harmonic mean of their stiffnesses, of {} the arithmetic one",
            list.join(", ")
        ),
    };
    let typed = list(&|i| i.fracture.is_some());
    if !typed.is_empty() || used.iter().any(|m| of(m).fracture.is_some()) {
        why += ", and break at the smaller critical stretch of the two";
        if !typed.is_empty() {
            why += &format!(", or as {} says", typed.join(", "));
        }
    }
    Some(Decision {
        choice: format!("points of the materials {}", names.join(", ")),
        why,
    })
}

/// Warnings of interfaces between materials that have no points together.
pub(crate) fn unused<const D: usize>(
    interfaces: &BTreeMap<Text, MaterialInterfaceSpec>,
    materials: &[Material<D>],
    used: &[u16],
) -> Vec<String> {
    let has_points = |name: &Text| {
        used.iter()
            .any(|&m| materials[usize::from(m)].name == name.value)
    };
    let idle = interfaces
        .iter()
        .filter(|(_, i)| !i.between.iter().all(has_points));
    idle.map(|(name, i)| {
        let names: Vec<String> = i.between.iter().map(|m| format!("`{m}`")).collect();
        format!(
            "the interface `{name}` is not used: no points of {} have bonds with each other",
            names.join(" and ")
        )
    })
    .collect()
}

/// The first two materials of points that have several, to refuse something of both.
struct Pair<'a, const D: usize> {
    spec: &'a SceneSpec,
    materials: [&'a Material<D>; 2],
}

impl<const D: usize> Pair<'_, D> {
    fn refused(&self, what: &str, why: &str, help: &str) -> SceneError {
        let [a, b] = self.materials.map(|m| m.name.as_str());
        SceneError::new(
            SceneErrorKind::Later,
            format!("points have the materials `{a}` and `{b}`, and {what}"),
        )
        .label(self.spec.span_of_material(a), "one")
        .label(self.spec.span_of_material(b), why)
        .help(help)
    }

    /// Refuses couplings whose rows know of one material.
    fn check_coupling(&self, coupling: &CouplingSpec) -> Result<(), SceneError> {
        let Some(law) = &self.materials[0].law else {
            return Ok(());
        };
        match coupling {
            CouplingSpec::Nonlocal(_) | CouplingSpec::Local(_) | CouplingSpec::Splice(_) => Ok(()),
            CouplingSpec::Truncated(_) if D == 3 => Err(self.refused(
                "the coupling is `truncated`",
                "another, and the strings along the edges of a zone in space have the stiffness of one",
                "use coupling = \"splice\" or \"nonlocal\", or keep the nonlocal zone within one material",
            )),
            CouplingSpec::Truncated(_) if !law.linearised().is_pairwise() => Err(self.refused(
                &format!("the coupling is `truncated`, and the law {}", law.name()),
                "another, and the dilatations of that seam have the constants of one",
                "use bond-based materials, coupling = \"splice\" or \"nonlocal\", or keep the nonlocal zone within one material",
            )),
            CouplingSpec::Truncated(_) => Ok(()),
            _ => Err(self.refused(
                &format!("the coupling is `{}`", coupling.traits().name),
                "another, whose bonds the rows of that seam do not know",
                "use coupling = \"truncated\", \"splice\" or \"nonlocal\", or keep the nonlocal and transition zones within one material",
            )),
        }
    }
}

/// Refuses what points of several materials do not take.
///
/// # Errors
/// A [`SceneError`] that names it, with the reason.
pub(crate) fn check<const D: usize>(
    spec: &SceneSpec,
    coupling: &CouplingSpec,
    p: Option<&Peridynamics<D>>,
    materials: &[Material<D>],
    used: &[u16],
    interfaces: &[MaterialInterface],
) -> Result<(), SceneError> {
    let &[first, second, ..] = used else {
        return Ok(());
    };
    let of = |m: u16| &materials[usize::from(m)];
    let pair = Pair {
        spec,
        materials: [of(first), of(second)],
    };
    pair.check_coupling(coupling)?;
    if spec.accuracy.is_some() {
        return Err(pair.refused(
            "`accuracy` is set",
            "another, and what is known of errors is of one",
            "choose mesh, horizon and zones yourself, or keep the zones within one material",
        ));
    }
    if spec.zones.follow.is_some() {
        return Err(pair.refused(
            "`zones.follow` is set",
            "another, and a zone that follows damage stays within one",
            "draw a zone that is wide enough, or remove it",
        ));
    }
    let tears = |m: &&u16| of(**m).fracture.is_some_and(|f| !f.is_of_stretch());
    if used.iter().find(tears).is_some() {
        return Err(pair.refused(
            "one breaks by the state of its points",
            "another, and what crosses their border has no such criterion",
            "give critical-stretch to both",
        ));
    }
    let Some(p) = p else { return Ok(()) };
    if matches!(p.points, PointSource::Lattices { .. }) {
        return Err(pair.refused(
            "`zones.bodies` is set",
            "another, and each body has a lattice of one",
            "use one lattice, or keep the zones within one material",
        ));
    }
    let own = |i: &&MaterialInterface| i.between.iter().all(|m| used.contains(m));
    let mut between = interfaces.iter().filter(own);
    let breaks =
        used.iter().any(|&m| of(m).fracture.is_some()) || between.any(|i| i.fracture.is_some());
    if breaks && p.horizon.as_constant().is_none() {
        return Err(pair.refused(
            "the horizon varies",
            "another, and critical stretches follow from one horizon",
            "give peridynamics.horizon a number, or remove what breaks bonds",
        ));
    }
    Ok(())
}
