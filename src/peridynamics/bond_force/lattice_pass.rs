//! One pass over a lattice: displacements by cell, the sweeps over all groups, forces by point.

use std::ops::Range;

use rayon::prelude::*;

use super::{
    BondKinematics, Told,
    lattice::{COPY, Lattice, Solid, TASK},
    lattice_simd::{Bits, Broken, EARLY, FOREIGN, Field, IDLE, LATE, Task, job},
    simd::{LANES, Source, dispatch},
    softened_bonds::SoftenedBonds,
    stencil::NONE,
};
use crate::{
    parallel,
    system::{BondChanges, FailureUpdate, Segments},
};

impl<const D: usize> Lattice<D> {
    /// Displacements by cell, of some cells or of all.
    pub(super) fn spread(
        point_of: &[u32],
        cells: Option<&Segments>,
        u: &[f64],
        to: &mut [Vec<f64>; D],
    ) {
        // one component after another: each is a plain stream
        for (a, to) in to.iter_mut().enumerate() {
            let copy = |to: &mut [f64], points: &[u32]| {
                for (to, &p) in to.iter_mut().zip(points) {
                    if p != NONE {
                        *to = u[p as usize * D + a];
                    }
                }
            };
            let points = |chunk: usize| &point_of[chunk * COPY..];
            parallel::for_each_chunk(to, COPY, 1, |chunk, to| match cells {
                None => copy(to, points(chunk)),
                Some(cells) => {
                    let some = cells.of_chunk(chunk);
                    some.for_each(|cells| copy(&mut to[cells.clone()], &points(chunk)[cells]));
                }
            });
        }
    }

    pub(super) fn field<'a>(
        &'a self,
        u: &'a [Vec<f64>; D],
        pull: &'a [f64],
        limit: f64,
    ) -> Field<'a, D> {
        let groups = &self.stencil.groups;
        let starts = (
            groups.iter().min().map_or(0, |c| *c as usize),
            groups.iter().max().map_or(0, |c| *c as usize),
        );
        let deltas = || self.stencil.offsets.iter().map(|o| o.delta).chain([0]);
        let offsets = (deltas().min().unwrap_or(0), deltas().max().unwrap_or(0));
        // what a law does without is never read, but any array will do
        let source =
            |x: &'a [f64]| Source::new(if x.is_empty() { &u[0] } else { x }, starts, offsets);
        Field {
            offsets: &self.stencil.offsets,
            u: std::array::from_fn(|a| source(&u[a])),
            volume: source(&self.volume),
            deviatoric: source(self.solid.as_ref().map_or(&[], |s| &s.deviatoric)),
            pull: source(pull),
            limit,
            no_fail: &self.no_fail,
        }
    }

    /// One sweep over all groups but those of the flags `skip`, with bits as they stand.
    pub(super) fn sweep<const EXACT: bool, const JOB: u8>(
        &self,
        field: &Field<'_, D>,
        skip: u8,
        flags: &mut [u8],
        sums: &mut [[f64; LANES]],
    ) {
        let stencil = self.stencil.offsets.len().max(1);
        let vectors = if JOB == job::MOMENTS { 2 } else { D };
        let groups = self.stencil.groups.par_chunks(TASK);
        let tasks = groups
            .zip(self.stencil.intact.par_chunks(TASK * stencil))
            .zip(flags.par_chunks_mut(TASK))
            .zip(sums.par_chunks_mut(TASK * vectors));
        parallel::for_each(tasks, |(((groups, bits), flags), sums)| {
            dispatch(Task::<D, EXACT, JOB> {
                field,
                first: 0,
                skip,
                groups,
                bits: Bits::Held(bits),
                flags,
                sums,
            });
        });
    }

    /// One sweep that may break bonds; returns which.
    fn breaking_sweep<const EXACT: bool, const JOB: u8>(
        &self,
        field: &Field<'_, D>,
        skip: u8,
        intact: &mut [u8],
        flags: &mut [u8],
        sums: &mut [[f64; LANES]],
    ) -> Vec<Broken> {
        let stencil = self.stencil.offsets.len().max(1);
        let vectors = if JOB == job::MOMENTS { 2 } else { D };
        let groups = self.stencil.groups.par_chunks(TASK);
        let tasks = groups
            .zip(intact.par_chunks_mut(TASK * stencil))
            .zip(flags.par_chunks_mut(TASK))
            .zip(sums.par_chunks_mut(TASK * vectors));
        parallel::list_each(
            tasks.enumerate(),
            |(task, (((groups, bits), flags), sums))| {
                dispatch(Task::<D, EXACT, JOB> {
                    field,
                    first: task * TASK,
                    skip,
                    groups,
                    bits: Bits::Breaking(bits),
                    flags,
                    sums,
                })
            },
        )
    }

    /// Computes `pull` from the dilatations of a sweep, except for groups that are idle.
    pub(super) fn pull_from(
        &self,
        solid: &Solid,
        flags: &[u8],
        sums: &[[f64; LANES]],
        pull: &mut [f64],
    ) {
        parallel::for_each_chunk(pull, COPY, 1, |chunk, pull| {
            let groups = &solid.group_of[chunk * (COPY / LANES)..];
            for (pull, &g) in pull.chunks_mut(LANES).zip(groups) {
                if g == NONE || flags[g as usize] & IDLE != 0 {
                    continue;
                }
                let g = g as usize;
                for lane in 0..LANES {
                    let theta = solid.dilatation[g][lane] * sums[2 * g][lane];
                    pull[lane] = solid.volumetric[g][lane] * theta;
                }
            }
        });
    }

    /// The force on a point.
    fn force_of(&self, p: usize, sums: &[[f64; LANES]]) -> [f64; D] {
        let scale = self.scale.get(p).copied().unwrap_or(self.unit);
        let place = self.place[p] as usize;
        std::array::from_fn(|a| {
            if scale == 0.0 || place == NONE as usize {
                0.0
            } else {
                -scale * sums[place / LANES * D + a][place % LANES]
            }
        })
    }

    /// Forces by point, of own points where processes move theirs.
    pub(super) fn collect(&self, sums: &[[f64; LANES]], force: &mut [f64]) {
        let own = self.reach.as_ref().map(|reach| &reach.own);
        parallel::for_each_chunk(force, COPY * D, 1, |chunk, force| {
            let count = force.len() / D;
            let mut copy = |points: Range<usize>| {
                let of = force[points.start * D..points.end * D].chunks_exact_mut(D);
                for (k, force) in points.zip(of) {
                    force.copy_from_slice(&self.force_of(chunk * COPY + k, sums));
                }
            };
            match own {
                None => copy(0..count),
                Some(own) => own.of_chunk(chunk).for_each(copy),
            }
        });
    }

    /// Forces of the points for which others wait.
    fn collect_sent(&self, sums: &[[f64; LANES]], force: &mut [f64]) {
        let sent = self.reach.iter().flat_map(|reach| &reach.sent);
        for &p in sent {
            let p = p as usize;
            force[p * D..(p + 1) * D].copy_from_slice(&self.force_of(p, sums));
        }
    }

    /// Follows bonds past the onset of softening, with those that a sweep has found there, and adds them to its sums.
    fn with_softened<const EXACT: bool>(
        &self,
        softened: &mut SoftenedBonds,
        may_break: bool,
        broken: &mut Vec<Broken>,
        u: &[Vec<f64>; D],
        sums: &mut [[f64; LANES]],
    ) -> BondChanges {
        let changes = match may_break {
            true => self.soften::<EXACT>(softened, broken, u),
            false => softened.hold(),
        };
        broken.clear();
        match self.solid {
            None => self.add_softened_forces::<EXACT>(softened, (u, &[]), sums),
            Some(_) => self.add_softened_moments::<EXACT>(softened, u, sums),
        }
        changes
    }

    /// One pass. Where others wait for forces of own points, these come first, and `told` is called once they are there.
    pub(super) fn pass<const EXACT: bool>(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: FailureUpdate,
        told: Option<Told<'_>>,
    ) -> BondChanges {
        let mut field_u = std::mem::replace(&mut self.u, std::array::from_fn(|_| Vec::new()));
        let cells = self.reach.as_ref().map(|reach| &reach.cells);
        Self::spread(&self.stencil.point_of, cells, u, &mut field_u);
        let mut flags = std::mem::take(&mut self.flags);
        let mut sums = std::mem::take(&mut self.sums);
        let mut intact = std::mem::take(&mut self.stencil.intact);
        let mut pull = self
            .solid
            .as_mut()
            .map_or(Vec::new(), |s| std::mem::take(&mut s.pull));
        let may_break = breakage == FailureUpdate::Update && self.limit < f64::INFINITY;
        let limit = if may_break { self.limit } else { f64::INFINITY };
        // with nobody to tell, all groups at once
        let (first, rest) = match told {
            None => (FOREIGN, None),
            Some(told) => (FOREIGN | LATE, Some((FOREIGN | EARLY, told))),
        };
        let mut broken = {
            let field = self.field(&field_u, &[], limit);
            let (i, f, s) = (&mut intact, &mut flags, &mut sums);
            match self.solid {
                None => self.breaking_sweep::<EXACT, { job::PAIR }>(&field, first, i, f, s),
                Some(_) => self.breaking_sweep::<EXACT, { job::MOMENTS }>(&field, IDLE, i, f, s),
            }
        };
        if self.solid.is_some() {
            self.stencil.intact = std::mem::take(&mut intact);
        }
        let mut softened = self.softened.take();
        let mut changes = BondChanges::default();
        if let Some(softened) = &mut softened {
            let (b, s) = (&mut broken, &mut sums);
            changes = self.with_softened::<EXACT>(softened, may_break, b, &field_u, s);
        }
        if let Some(solid) = &self.solid {
            self.pull_from(solid, &flags, &sums, &mut pull);
            let field = self.field(&field_u, &pull, f64::INFINITY);
            self.sweep::<EXACT, { job::SOLID }>(&field, first, &mut flags, &mut sums);
            if let Some(softened) = &softened {
                self.add_softened_forces::<EXACT>(softened, (&field_u, &pull), &mut sums);
            }
        }
        self.softened = softened;
        if let Some((rest, told)) = rest {
            self.collect_sent(&sums, force);
            told(force);
            let (f, s) = (&mut flags, &mut sums);
            if self.solid.is_some() {
                let field = self.field(&field_u, &pull, f64::INFINITY);
                self.sweep::<EXACT, { job::SOLID }>(&field, rest, f, s);
            } else {
                let field = self.field(&field_u, &[], limit);
                let i = &mut intact;
                let late = self.breaking_sweep::<EXACT, { job::PAIR }>(&field, rest, i, f, s);
                broken.extend(late);
            }
        }
        if self.solid.is_none() {
            self.stencil.intact = intact;
        }
        self.broken = broken;
        self.collect(&sums, force);
        self.u = field_u;
        self.flags = flags;
        self.sums = sums;
        if let Some(solid) = &mut self.solid {
            solid.pull = pull;
        }
        self.forget_breaks_of_others();
        let lanes = self.broken.iter().map(|b| u64::from(b.lanes.count_ones()));
        changes.broken += lanes.sum::<u64>();
        changes
    }

    /// The force on own points, those first that others wait for; bonds that broke are those of own points alone.
    pub(super) fn pass_at_own(
        &mut self,
        u: &[f64],
        force: &mut [f64],
        breakage: FailureUpdate,
        told: Told<'_>,
    ) -> u64 {
        let changes = match self.kinematics {
            BondKinematics::Exact => self.pass::<true>(u, force, breakage, Some(told)),
            BondKinematics::Linear => self.pass::<false>(u, force, breakage, Some(told)),
        };
        changes.broken
    }
}
