//! Output of a scene: lines, probes, sections, tips of cracks.

use std::path::PathBuf;

use super::error::SceneError;
use super::file_name::part_of_a_file_name;
use super::places::extent;
use super::region::{self, Region};
use super::section;
use super::spec::{OutputSpec, SceneSpec, SolveSpec, TipSpec};
use super::validated::{FieldChoice, Output, Tip};
use super::value::Text;
use super::{bond_output, bounds_checks};
use crate::fem::Locator;
use crate::material::Kinematics;
use crate::mesh::Mesh;
use crate::observe::ObserveError;
use crate::observe::checkpoint::Fingerprint;
use crate::observe::claim::{Claim, Files};
use crate::observe::provenance::{self, PROVENANCE};
use crate::shape::Shape;

/// The table of all probes; lines have tables by their own names beside it.
pub(crate) const PROBES: &str = "probes";

/// The table of all sections of a static scene.
pub(crate) const SECTIONS: &str = "sections";

/// The outputs of a scene whose files are named `name` by default.
pub(crate) fn output<const D: usize>(
    spec: &SceneSpec,
    (mesh, kinematics): (&Mesh<D>, Kinematics),
    voids: &[Shape<D>],
    (name, fingerprint): (&str, &Fingerprint),
) -> Result<Output<D>, SceneError> {
    let o = &spec.output;
    let moves = !matches!(spec.analysis(), None | Some(SolveSpec::Static(_)));
    if let Some(name) = &o.name {
        part_of_a_file_name("output.name", name)?;
    }
    let mut lines = Vec::with_capacity(o.lines.len());
    for (key, line) in &o.lines {
        let place = format!("output.lines.{key}");
        part_of_a_file_name(&place, key)?;
        let from = region::position::<D>(&format!("{place}.from"), &line.from)?;
        let to = region::position::<D>(&format!("{place}.to"), &line.to)?;
        let n = line.samples.value;
        if !(2..=1_000_000).contains(&n) {
            return Err(SceneError::wrong_value(format!("`{place}.samples` is {n}"))
                .label(line.samples.span.clone(), "2 to 1000000")
                .help("a line needs at least its two ends"));
        }
        let positions = (0..n)
            .map(|i| from.lerp(&to, i as f64 / (n - 1) as f64))
            .collect();
        has_own_table(&place, key, o, moves)?;
        lines.push((key.value.clone(), positions));
    }
    let locator = Locator::new(mesh, 0..mesh.cell_count());
    let tolerance = 1e-9 * (mesh.bounds().1 - mesh.bounds().0).norm();
    let mut probes = Vec::with_capacity(o.probes.len());
    for (key, probe) in &o.probes {
        let place = format!("output.probes.{key}.at");
        let at = region::position::<D>(&place, &probe.at)?;
        if locator.locate(mesh, &at, tolerance).is_none() {
            return Err(SceneError::empty(format!(
                "`{place}` = {:?} lies outside the mesh",
                at.as_slice()
            ))
            .label(probe.at.span.clone(), "outside")
            .help(extent(mesh)));
        }
        if voids.iter().any(|v| v.signed_distance(&at) < -tolerance) {
            return Err(SceneError::empty(format!(
                "`{place}` = {:?} lies in a void",
                at.as_slice()
            ))
            .label(probe.at.span.clone(), "nothing moves there")
            .help("move it out of all [voids]"));
        }
        probes.push((key.value.clone(), at));
    }
    let tips = o.tips.iter().map(|(key, spec)| tip(key, spec, mesh));
    let tips = tips.collect::<Result<_, _>>()?;
    let sections = section::sections(&o.sections, mesh)?;
    let bonds = bond_output::selections(spec, &probes, mesh)?;
    Ok(Output {
        directory: o
            .directory
            .as_ref()
            .map_or("out".into(), |d| d.value.clone().into()),
        name: o.name.as_ref().map_or(name.to_owned(), |n| n.value.clone()),
        stage: None,
        origin: provenance::origin(fingerprint.value()),
        vtu: o.vtu.unwrap_or(true),
        points: o.points,
        fields: field_choice(o, kinematics),
        lines,
        probes,
        sections,
        tips,
        bonds,
    })
}

fn field_choice(spec: &OutputSpec, kinematics: Kinematics) -> FieldChoice {
    let stresses = (spec.stresses.iter()).map(|s| s.get_ref().name().to_owned());
    let of_points = spec.energy_density == Some(true);
    let energy = of_points.then(|| ENERGY_DENSITY.to_owned());
    let fields = spec.fields.iter().map(|name| name.value.clone());
    FieldChoice {
        asked: stresses.chain(fields).chain(energy).collect(),
        stresses: spec.stresses.len(),
        across: kinematics == Kinematics::PlaneStrain,
    }
}

/// The field of the key `energy-density`.
const ENERGY_DENSITY: &str = "energy-density";

impl<const D: usize> Output<D> {
    /// The same outputs of a stage before the last, whose name is in all of its files.
    pub(crate) fn of_stage(&self, stage: &str) -> Self {
        Self {
            name: format!("{}_{stage}", self.name),
            stage: Some(stage.to_owned()),
            ..self.clone()
        }
    }

    /// The name of a table, as observers are told.
    pub(crate) fn table(&self, name: &str) -> String {
        match &self.stage {
            None => name.to_owned(),
            Some(stage) => format!("{stage}_{name}"),
        }
    }

    /// Keeps others from the files of a scene while it runs on some `processes`; nothing to keep where it writes none.
    ///
    /// # Errors
    /// As [`Claim::take`].
    pub(crate) fn claim(
        &self,
        scene: &str,
        moves: bool,
        processes: usize,
    ) -> Result<Option<Claim>, ObserveError> {
        let files = self.files(moves, processes);
        if files.files.is_empty() {
            return Ok(None);
        }
        Claim::take(&self.directory, scene, &files).map(Some)
    }

    /// The file of the provenance of a run by the program.
    pub(crate) fn provenance_path(&self) -> PathBuf {
        self.directory.join(format!("{}{PROVENANCE}", self.name))
    }

    /// The files that a scene writes, or removes for those that another number of processes has written: at rest, or where it `moves`.
    fn files(&self, moves: bool, processes: usize) -> Files {
        let name = &self.name;
        let mut ends: Vec<String> = Vec::new();
        if moves {
            ends.extend(
                [
                    "_history.csv",
                    ".checkpoint",
                    ".checkpoint.previous",
                    ".pvd",
                ]
                .map(str::to_owned),
            );
            ends.extend(self.tips.iter().map(|t| format!("_tip_{}.csv", t.name)));
            ends.extend(self.lines.iter().map(|(line, _)| format!("_{line}.csv")));
        } else {
            if self.vtu {
                ends.extend([".vtu", ".pvtu"].map(str::to_owned));
                let pieces = (0..processes).filter(|_| processes > 1);
                ends.extend(pieces.map(|rank| format!("_p{rank}.vtu")));
            }
            ends.extend(self.lines.iter().map(|(line, _)| format!("_{line}.csv")));
            if !self.probes.is_empty() {
                ends.push(format!("_{PROBES}.csv"));
            }
            if !self.sections.is_empty() {
                ends.push(format!("_{SECTIONS}.csv"));
            }
        }
        let bonds = self.bonds.iter().map(|of| of.stem(""));
        let end = if moves { ".pvd" } else { ".vtu" };
        ends.extend(bonds.map(|stem| format!("{stem}{end}")));
        if !ends.is_empty() {
            ends.push(PROVENANCE.to_owned());
        }
        Files {
            name: name.clone(),
            files: ends.into_iter().map(|end| format!("{name}{end}")).collect(),
            series: moves,
            others: match moves {
                true => self.bonds.iter().map(|of| of.stem(name)).collect(),
                false => Vec::new(),
            },
        }
    }
}

/// Refuses a line whose table would be another one: in a static scene that of all probes or all sections, in others the history or that of a tip.
fn has_own_table(place: &str, key: &Text, o: &OutputSpec, moves: bool) -> Result<(), SceneError> {
    let mut taken: Vec<(String, String)> = Vec::new();
    if moves {
        taken.push(("history".to_owned(), "the history".to_owned()));
        let of_tips = o
            .tips
            .keys()
            .map(|t| (format!("tip_{t}"), format!("the table of the tip `{t}`")));
        taken.extend(of_tips);
    } else {
        let of_all = [
            (PROBES, o.probes.is_empty()),
            (SECTIONS, o.sections.is_empty()),
        ];
        let typed = of_all.iter().filter(|(_, none)| !none);
        taken.extend(typed.map(|(t, _)| ((*t).to_owned(), format!("the table of all {t}"))));
    }
    match taken.iter().find(|(name, _)| key.value == *name) {
        None => Ok(()),
        Some((_, table)) => Err(SceneError::wrong_value(format!(
            "the line `{place}` has the name of {table}"
        ))
        .label(key.span.clone(), "both would be one file")
        .help("give the line another name")),
    }
}

fn tip<const D: usize>(key: &Text, spec: &TipSpec, mesh: &Mesh<D>) -> Result<Tip<D>, SceneError> {
    let place = format!("output.tips.{key}");
    part_of_a_file_name(&place, key)?;
    let direction = region::position::<D>(&format!("{place}.direction"), &spec.direction)?;
    if direction.norm() <= 0.0 {
        return Err(
            SceneError::wrong_value(format!("`{place}.direction` is zero"))
                .label(spec.direction.span.clone(), "points nowhere")
                .help("give the direction in which the crack runs"),
        );
    }
    let threshold = match &spec.threshold {
        Some(t) => bounds_checks::within(
            &format!("{place}.threshold"),
            t,
            t.value > 0.0 && t.value < 1.0,
            "must lie between 0 and 1",
            "0.35 suits most scenes: a straight crack cuts up to half of the bonds",
        )?,
        None => 0.35,
    };
    Ok(Tip {
        name: key.value.clone(),
        direction: direction.normalize(),
        inside: match &spec.inside {
            Some(shape) => region::region(&format!("{place}.inside"), shape, mesh)?,
            None => Region::everywhere(),
        },
        threshold,
        // laid out once the rest of the scene is known
        domains: None,
    })
}
