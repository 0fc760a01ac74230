//! Output during a run: history, VTU files, lines, tips of cracks, checkpoints.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::RunOptions;
use super::breaks::Breaks;
use super::contact::ContactRecord;
use super::crack_growth::CrackGrowth;
use super::impact_record::ImpactRecord;
use super::probe_rows::ProbeRows;
use super::saved::{EdgeReached, Saved, SavedZone, StepChoice, Written};
use super::section_rows::SectionRows;
use super::supports::Supports;
use super::tables::Tables;
use super::tips::farthest;
use crate::model::{Model, Sampler};
use crate::observe::ObserveError;
use crate::observe::checkpoint::{CheckpointFile, Pace};
use crate::observe::csv::{CsvTable, Entry};
use crate::observe::pieces::agreed;
use crate::observe::series::Series;
use crate::observe::summary::{ConditionForce, SectionForce};
use crate::observe::tip_summary::TipSummary;
use crate::run::bonds;
use crate::run::condition_terms::ConditionTerms;
use crate::run::energy_release;
use crate::run::error::RunError;
use crate::run::field_probes;
use crate::run::motion::seen::Seen;
use crate::run::pieces::Piece;
use crate::run::setup::RunSettings;
use crate::run::solution::Solved;
use crate::run::write::{Remembered, Shown, snapshot};
use crate::scene::bond_output::BondSelection;
use crate::scene::conditions::Condition;
use crate::scene::validated::{Output, Tip};
use crate::solve::explicit::{Explicit, State};
use crate::system::SemiDiscrete;
use crate::tensor::{AXES, Vector};

/// A state to be written.
pub struct Moment<'a> {
    /// Fields, time, step, work, broken bonds.
    pub state: &'a State,
    /// The system of the body.
    pub system: &'a dyn SemiDiscrete,
    /// Kinetic energy.
    pub kinetic: f64,
    /// The energy that the scheme keeps, of linear systems.
    pub discrete: Option<f64>,
    /// Forces of supports and loads together by dof, and of loads alone on each prescribed dof.
    pub supports: (&'a [f64], &'a [f64]),
    /// Internal and external forces by dof; the external ones of prescribed dofs stand in `supports`.
    pub forces: (&'a [f64], &'a [f64]),
}

impl<'a> Moment<'a> {
    /// A state of equilibrium.
    pub fn at_rest(
        state: &'a State,
        system: &'a dyn SemiDiscrete,
        supports: (&'a [f64], &'a [f64]),
        load: &'a [f64],
    ) -> Self {
        Self {
            state,
            system,
            kinetic: 0.0,
            discrete: None,
            forces: (supports.0, load),
            supports,
        }
    }
}

impl<'m> Moment<'m> {
    /// The present moment of a motion.
    pub fn of(motion: &'m Explicit<'_>, is_linear: bool) -> Self {
        let energies = motion.energies();
        Self {
            state: motion.state(),
            system: motion.system(),
            kinetic: energies.kinetic,
            discrete: is_linear.then_some(energies.discrete),
            supports: (motion.external_force(), motion.applied()),
            forces: (motion.internal_force(), motion.external_force()),
        }
    }

    /// Broken bonds by the sites of their ends, each once for each direction.
    pub fn broken_bonds(&self) -> Vec<(u32, u32)> {
        match self.state.broken {
            0 => Vec::new(),
            _ => (self.system.body_state()).map_or(Vec::new(), |state| state.broken_bonds()),
        }
    }
}

/// The energies of a row of the history.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyRow {
    /// `½ vᵀ M v`.
    pub kinetic: f64,
    /// Of all bodies.
    pub stored: f64,
    /// Of loads and supports.
    pub work: f64,
    /// Of broken bonds.
    pub dissipated: f64,
    /// Deficit of the balance of kinetic energy, stored energy and work: energy of broken bonds, and that which the seam takes.
    pub missing: f64,
}

/// Recorder of the output of a run.
pub struct Recorder<'a, const D: usize> {
    output: &'a Output<D>,
    probes: ProbeRows<'a, D>,
    supports: Supports<D>,
    sections: SectionRows<'a, D>,
    /// Record of impactors, if there are any.
    pub impact: Option<ImpactRecord<D>>,
    /// Record of the contact of surfaces, if there is any.
    pub contact: Option<ContactRecord<D>>,
    breaks: Breaks,
    history: CsvTable,
    tables: Tables,
    series: Series,
    /// Bonds of each selection.
    bonds: Vec<Series>,
    checkpoint: CheckpointFile,
    options: RunOptions<'a>,
    last_checkpoint: Instant,
    /// Kinetic and stored energy at the start.
    pub energy_at_start: f64,
    /// Energies of the last row.
    pub last: EnergyRow,
    /// Growth of cracks between rows.
    pub growth: CrackGrowth,
    /// Number of broken bonds, and the area of the cracks that they have left.
    cracks: (u64, f64),
    /// Integrals at the tips of the present state, one for each; empty where the scene asks for none.
    pub tips: Vec<Option<TipSummary>>,
    /// Displacement that load steps before the motion left it to begin with; empty without any.
    pub loaded: Vec<f64>,
    /// Seconds that writing took.
    pub seconds: f64,
}

impl<'a, const D: usize> Recorder<'a, D> {
    /// Makes the files, or cuts them back to what was `written` at a checkpoint; none where the `options` want none.
    ///
    /// # Errors
    /// [`ObserveError`] for files that cannot be made or cut.
    #[expect(clippy::too_many_arguments, reason = "each is another part of the run")]
    pub fn new(
        output: &'a Output<D>,
        conditions: &[Condition<D>],
        sampler: &Sampler<'_, D>,
        impact: Option<ImpactRecord<D>>,
        contact: Option<ContactRecord<D>>,
        breaks: Breaks,
        is_linear: bool,
        checkpoint: CheckpointFile,
        options: RunOptions<'a>,
        written: Option<&Written>,
    ) -> Result<Self, ObserveError> {
        let probes = ProbeRows::new(&output.probes, sampler);
        let supports = Supports::new(conditions);
        let sections = SectionRows::new(&output.sections);
        let mut header = history_header(&probes, &supports, breaks, is_linear);
        header.extend(sections.header());
        header.extend(field_probes::header(output));
        header.extend(impact.iter().flat_map(ImpactRecord::header));
        header.extend(contact.iter().flat_map(ContactRecord::header));
        let begun = files_begun(output, header, &checkpoint, &options, written);
        let begun = agreed(options.ranks, begun, &output.directory);
        let (history, tables, series) = begun?;
        let bonds = bond_series(output, &options, series.times());
        let bonds = agreed(options.ranks, bonds, &output.directory)?;
        Ok(Self {
            output,
            probes,
            supports,
            sections,
            impact,
            contact,
            breaks,
            history,
            tables,
            series,
            bonds,
            checkpoint,
            options,
            last_checkpoint: Instant::now(),
            energy_at_start: written.map_or(0.0, |w| w.energy_at_start),
            last: EnergyRow::default(),
            growth: written.map_or_else(CrackGrowth::default, |w| w.growth),
            cracks: (0, 0.0),
            tips: Vec::new(),
            loaded: Vec::new(),
            seconds: 0.0,
        })
    }

    /// Finds the probes in another layout of the same body.
    pub fn move_to(&mut self, sampler: &Sampler<'_, D>) {
        self.probes.find(sampler);
        self.cracks = (0, 0.0);
    }

    /// Finds the part of a model beyond each section, and takes the springs that hold the model.
    ///
    /// # Errors
    /// [`RunError::EmptySection`].
    pub(crate) fn cut(
        &mut self,
        model: &Model<D>,
        rest: &'a RunSettings<D>,
        terms: Arc<ConditionTerms>,
    ) -> Result<(), RunError> {
        self.sections.find(model, rest)?;
        self.supports.take_terms(terms);
        Ok(())
    }

    /// Learns which condition holds each prescribed dof.
    pub fn hold(&mut self, holders: impl Iterator<Item = (u32, u32)>) {
        self.supports.hold(holders);
    }

    /// The forces of the conditions that hold, at the last row.
    pub fn reactions(&self) -> Vec<ConditionForce> {
        self.supports.reactions()
    }

    /// Forces in the sections, at the last row.
    pub fn section_forces(&self) -> Vec<SectionForce> {
        self.sections.last()
    }

    /// Begins the account of energy.
    pub fn begin(&mut self, moment: &Moment<'_>) {
        let Moment { state, system, .. } = moment;
        // a body that begins deformed may have flowed to get there
        let dissipated = self.dissipated(*system);
        let energy = moment.kinetic + system.stored_energy(&state.u) + dissipated;
        // work of load steps before is stored by now, or gone
        self.energy_at_start = energy - state.work;
    }

    fn dissipated(&self, system: &dyn SemiDiscrete) -> f64 {
        match self.breaks {
            Breaks::Possibly | Breaks::Gradually | Breaks::Dissipating => {
                system.dissipation().map_or(0.0, |d| d.total())
            }
            Breaks::Never => 0.0,
        }
    }

    /// The energies of a state.
    pub fn energies(&self, moment: &Moment<'_>) -> EnergyRow {
        let Moment { state, system, .. } = moment;
        let stored = system.stored_energy(&state.u);
        EnergyRow {
            kinetic: moment.kinetic,
            stored,
            work: state.work,
            dissipated: self.dissipated(*system),
            missing: self.energy_at_start + state.work - moment.kinetic - stored,
        }
    }

    /// Collective: area of the cracks, found anew where the number of broken bonds has changed since it was asked for last.
    pub fn crack_area(&mut self, broken: u64, system: &dyn SemiDiscrete) -> f64 {
        if self.cracks.0 != broken {
            let body = system.body_state();
            self.cracks = (broken, body.map_or(0.0, |body| body.crack_area()));
        }
        self.cracks.1
    }

    /// Appends to the history and to the tables of tips; `probed` are the stresses at the probes.
    ///
    /// # Errors
    /// [`ObserveError`] if a row cannot be written.
    pub fn row(
        &mut self,
        moment: &Moment<'_>,
        energies: EnergyRow,
        probed: &[f64],
        positions: impl Fn(usize) -> Vector<D>,
    ) -> Result<(), ObserveError> {
        let begun = Instant::now();
        let Moment { state, system, .. } = moment;
        self.last = energies;
        let mut row: Vec<Entry> = vec![
            (state.step as i64).into(),
            state.time.into(),
            energies.kinetic.into(),
            energies.stored.into(),
            state.work.into(),
        ];
        row.extend(moment.discrete.map(Entry::from));
        if self.breaks != Breaks::Never {
            row.push(energies.dissipated.into());
            row.push(energies.missing.into());
        }
        if self.breaks.may() {
            row.push((state.broken as i64).into());
            let area = self.crack_area(state.broken, *system);
            self.growth.watch(state, area);
            row.push(area.into());
        }
        let mut momentum = [0.0; D];
        for (v, m) in state.v.chunks_exact(D).zip(system.mass()) {
            momentum.iter_mut().zip(v).for_each(|(p, v)| *p += m * v);
        }
        row.extend(momentum.map(Entry::from));
        let probes = self.probes.row(&state.u, &state.v);
        row.extend(probes.into_iter().map(Entry::from));
        let supports = self.supports.row(moment.supports, &state.u);
        row.extend(supports.into_iter().map(Entry::from));
        let held = self.supports.dofs().zip(moment.supports.1);
        let terms = self.supports.terms();
        let at = (&state.u[..], state.time);
        let sections = self.sections.row(moment.forces, terms, held, at);
        row.extend(sections.into_iter().map(Entry::from));
        row.extend(probed.iter().map(|&s| Entry::from(s)));
        let impact = self
            .impact
            .iter()
            .flat_map(|impact| impact.row(state, moment.supports.0));
        row.extend(impact.map(Entry::from));
        let contact = self.contact.iter_mut();
        row.extend(
            contact
                .flat_map(|contact| contact.row(state))
                .map(Entry::from),
        );
        let name = self.output.table("history");
        self.options.keep(&name, &mut self.history, &row)?;
        let may_be_damaged = state.broken > 0 || self.breaks == Breaks::Gradually;
        self.tables.tips(
            (self.output, &self.tips),
            &self.options,
            (state, *system),
            may_be_damaged,
            positions,
        )?;
        self.seconds += begun.elapsed().as_secs_f64();
        Ok(())
    }

    /// Returns true if the scene asks for integrals at the tip of a crack.
    pub fn integrates_at_tips(&self) -> bool {
        self.output.tips.iter().any(|tip| tip.domains.is_some())
    }

    /// Integrates over the rings around the tips of a moment, which lie where its damage ends. Collective where families are spread.
    pub fn find_tips(&mut self, moment: &Moment<'_>, solved: &Solved<'_, D>) {
        let is_damaged = moment.state.broken > 0 || self.breaks == Breaks::Gradually;
        let damage = solved.moved.damage.filter(|_| is_damaged);
        let sites = &solved.model.sites;
        let grown = |tip: &Tip<D>| {
            let site = farthest(tip, damage?, |site| sites[site].position)?;
            Some(sites[site].position)
        };
        self.tips = energy_release::of_tips(solved, self.output, self.options.ranks, grown);
    }

    /// Damage of a moment, where bonds may break or lose their stiffness.
    pub fn damage(&self, moment: &Moment<'_>) -> Option<Vec<f64>> {
        match self.breaks {
            Breaks::Possibly | Breaks::Gradually => moment.system.body_state()?.damage(),
            Breaks::Never | Breaks::Dissipating => None,
        }
    }

    /// Appends the state to the tables of the lines, writes a VTU file, if the scene wants any, and shows the same to the observer. Collective where each process writes
    /// a `piece` of the file.
    ///
    /// # Errors
    /// [`ObserveError`] if a file cannot be written.
    pub fn output(
        &mut self,
        moment: &Moment<'_>,
        solved: &Solved<'_, D>,
        piece: Option<&Piece>,
    ) -> Result<(), ObserveError> {
        let begun = Instant::now();
        self.tables
            .lines(self.output, &self.options, moment.state, solved)?;
        self.seconds += begun.elapsed().as_secs_f64();
        let observer = self.options.observer;
        let pieces = piece.zip(self.options.writers());
        let writes = self.output.vtu && self.options.writes();
        if !writes && pieces.is_none() && observer.is_none() {
            return Ok(());
        }
        let begun = Instant::now();
        let state = moment.system.body_state();
        let remembered = state.map_or(Vec::new(), |state| state.remembered());
        let remembered: Vec<Remembered<'_>> = remembered
            .iter()
            .map(|(name, values)| (*name, values.as_slice()))
            .collect();
        let of = |shown| snapshot(solved, &remembered, self.output, shown);
        let time = moment.state.time;
        let mut written = None;
        if let Some((piece, ranks)) = pieces {
            let own = of(Shown::Piece(piece));
            self.series.push_pieces(time, own, ranks)?;
        } else if writes {
            written = Some(self.series.push(time, of(Shown::All))?);
            for (selection, series) in self.output.bonds.iter().zip(&mut self.bonds) {
                series.push(
                    time,
                    bonds::snapshot(solved, selection, &self.output.origin),
                )?;
            }
        }
        if let Some(observer) = observer {
            let mut shown = written.unwrap_or_else(|| of(Shown::All));
            shown.time = Some(time);
            shown.check(&self.series.collection())?;
            observer.snapshot(shown);
        }
        self.seconds += begun.elapsed().as_secs_f64();
        Ok(())
    }

    /// Returns true if a checkpoint is due after `step` steps on the process that writes it.
    pub fn is_checkpoint_step(&self, step: u64) -> bool {
        matches!(self.options.checkpoint_every, Some(Pace::Steps(n)) if step.is_multiple_of(n))
    }

    /// Returns true if this process has to write a checkpoint after `step` steps.
    pub fn is_checkpoint_due(&self, step: u64) -> bool {
        match self.options.checkpoint_every {
            _ if !self.options.writes() => false,
            None => false,
            Some(Pace::Steps(n)) => step.is_multiple_of(n),
            Some(Pace::Clock(time)) => self.last_checkpoint.elapsed() >= time,
        }
    }

    /// Returns true if the end of the run leaves a checkpoint: one is asked for, or an older one would be left behind.
    pub fn keeps_state(&self) -> bool {
        let asked = self.options.checkpoint_every.is_some();
        self.options.writes() && (asked || self.checkpoint.path().exists())
    }

    /// Writes a checkpoint, unless the run writes no files.
    ///
    /// # Errors
    /// [`ObserveError`] if it cannot be written.
    pub fn checkpoint(
        &mut self,
        state: &State,
        system: &dyn SemiDiscrete,
        pace: StepChoice,
        edge: Option<EdgeReached>,
        zone: Option<SavedZone>,
        seen: &Seen,
    ) -> Result<(), ObserveError> {
        if !self.options.writes() {
            return Ok(());
        }
        let begun = Instant::now();
        let mut bytes = vec![self.history.mark()?];
        for table in self.tables.iter() {
            bytes.push(table.mark()?);
        }
        self.checkpoint.write(&Saved {
            state: state.clone(),
            loaded: self.loaded.clone(),
            damage: system.damage_state(),
            pace,
            written: Written {
                bytes,
                times: self.series.times().to_vec(),
                energy_at_start: self.energy_at_start,
                growth: self.growth,
                peaks: self.impact.as_ref().map_or(Vec::new(), |i| i.peaks.clone()),
            },
            edge,
            zone,
            seen: seen.clone(),
        })?;
        self.last_checkpoint = Instant::now();
        self.seconds += begun.elapsed().as_secs_f64();
        Ok(())
    }

    /// The files that are there.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        if self.options.writes() && !self.series.times().is_empty() {
            files.push(self.series.collection());
            files.extend(self.bonds.iter().map(Series::collection));
        }
        let tables = std::iter::once(&self.history).chain(self.tables.iter());
        files.extend(
            tables
                .filter(|t| t.is_begun())
                .map(|t| t.path().to_path_buf()),
        );
        if self.options.writes() && self.checkpoint.path().exists() {
            files.push(self.checkpoint.path().to_path_buf());
        }
        files
    }
}

/// The files of a run, cut back to what was `written` at a checkpoint; those of an earlier run are removed.
fn files_begun<const D: usize>(
    output: &Output<D>,
    header: Vec<String>,
    checkpoint: &CheckpointFile,
    options: &RunOptions<'_>,
    written: Option<&Written>,
) -> Result<(CsvTable, Tables, Series), ObserveError> {
    let bytes = |file: usize| written.map_or(0, |w| w.bytes.get(file).copied().unwrap_or(0));
    let path = |end: &str| output.directory.join(format!("{}_{end}.csv", output.name));
    let table = |name: &str, header, file| match options.writes() {
        true => CsvTable::resumed(&path(name), header, bytes(file)),
        false => Ok(CsvTable::unwritten(header)),
    };
    let history = table("history", header, 0)?;
    let tables = Tables::new(output, |name, header, place| table(name, header, place + 1))?;
    let times = written.map_or(Vec::new(), |w| w.times.clone());
    let series = Series::resumed(&output.directory, &output.name, times);
    if options.writes() {
        if written.is_none() {
            checkpoint.remove()?;
            // that of an earlier run would be taken for that of this one if it is killed
            let _ = std::fs::remove_file(output.provenance_path());
            series.remove_collection();
        }
        series.remove_later();
        series.write_collection()?;
    }
    Ok((history, tables, series))
}

/// The series of files of each selection of bonds, as long as that of the body at a checkpoint.
fn bond_series<const D: usize>(
    output: &Output<D>,
    options: &RunOptions<'_>,
    times: &[f64],
) -> Result<Vec<Series>, ObserveError> {
    let one = |selection: &BondSelection<D>| {
        let name = selection.stem(&output.name);
        let series = Series::resumed(&output.directory, &name, times.to_vec());
        if options.writes() {
            if times.is_empty() {
                series.remove_collection();
            }
            series.remove_later();
            series.write_collection()?;
        }
        Ok(series)
    };
    output.bonds.iter().map(one).collect()
}

fn history_header<const D: usize>(
    probes: &ProbeRows<'_, D>,
    supports: &Supports<D>,
    breaks: Breaks,
    is_linear: bool,
) -> Vec<String> {
    let mut header = vec![
        "step",
        "time",
        "kinetic_energy",
        "stored_energy",
        "external_work",
    ];
    if is_linear {
        header.push("discrete_energy");
    }
    if breaks != Breaks::Never {
        header.extend(["dissipated_energy", "missing_energy"]);
    }
    if breaks.may() {
        header.extend(["broken_bonds", "crack_area"]);
    }
    let mut header: Vec<String> = header.into_iter().map(str::to_owned).collect();
    header.extend(AXES[..D].iter().map(|a| format!("momentum_{a}")));
    header.extend(probes.header());
    header.extend(supports.header());
    header
}
