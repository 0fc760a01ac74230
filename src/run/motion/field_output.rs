//! Fields of a moment, as output files and probes show them.

use std::cell::OnceCell;

use super::RunOptions;
use super::writer::{Moment, Recorder};
use crate::observe::ObserveError;

use crate::run::field_probes::FieldProbes;
use crate::run::pieces::Piece;
use crate::run::setup::RunSettings;
use crate::run::solution::{self, Moved, Solved};
use crate::run::stress_settings::StressSettings;
use crate::{coupling::Operator, model::Model};

/// Fields of a model as output files show them.
pub(super) struct FieldOutput<'a, const D: usize> {
    model: &'a Model<D>,
    operator: &'a Operator<'a, D>,
    zone_of_site: Vec<crate::model::Zone>,
    stresses: &'a StressSettings<D>,
    probes: FieldProbes,
    /// Shares of families that cracks and voids of the scene have cut, once they are asked for.
    cut: OnceCell<Vec<(u32, f64)>>,
    /// Piece of them that this one of several processes shows.
    piece: Option<Piece>,
}

impl<'a, const D: usize> FieldOutput<'a, D> {
    /// Of a model and the rows of its sites.
    pub fn new(
        model: &'a Model<D>,
        operator: &'a Operator<'a, D>,
        rest: &'a RunSettings<D>,
        options: &RunOptions<'_>,
    ) -> Self {
        let (output, stresses) = (&rest.output, &rest.stresses);
        let writers = options.writers().filter(|_| output.vtu);
        Self {
            probes: FieldProbes::new(model, output),
            cut: OnceCell::new(),
            model,
            operator,
            zone_of_site: solution::zone_of_site(model),
            stresses,
            piece: writers.map(|ranks| Piece::new(model, output.points, ranks)),
        }
    }

    /// Writes the fields of a moment.
    ///
    /// # Errors
    /// [`ObserveError`] if they cannot be written.
    pub fn write(
        &self,
        recorder: &mut Recorder<'_, D>,
        moment: &Moment<'_>,
    ) -> Result<(), ObserveError> {
        let broken = moment.broken_bonds();
        let damage = recorder.damage(moment).map(|d| self.with_cuts(d));
        let solved = self.solved(moment, &broken, damage.as_deref());
        recorder.output(moment, &solved, self.piece.as_ref())
    }

    /// The damage `1 − (1 − c)(1 − d)` of sites that have lost the share `c` of their family to cracks and voids of the scene, and `d` of the rest.
    fn with_cuts(&self, mut damage: Vec<f64>) -> Vec<f64> {
        for &(site, cut) in self.cut.get_or_init(|| self.model.cut_shares()) {
            let rest = &mut damage[site as usize];
            *rest = cut + (1.0 - cut) * *rest;
        }
        damage
    }

    /// A moment as it is shown.
    pub fn solved<'m>(
        &'m self,
        moment: &'m Moment<'_>,
        broken: &'m [(u32, u32)],
        damage: Option<&'m [f64]>,
    ) -> Solved<'m, D> {
        Solved {
            model: self.model,
            operator: self.operator,
            displacement: &moment.state.u,
            residual: &[],
            zone_of_site: &self.zone_of_site,
            system: Some(moment.system),
            moved: Moved {
                velocity: Some(&moment.state.v),
                damage,
                broken,
            },
            sections: &[],
            stresses: (self.stresses, moment.state.time),
        }
    }

    /// Stresses at the probes, as far as they are asked for.
    pub fn probed(&self, moment: &Moment<'_>) -> Vec<f64> {
        match self.probes.is_empty() {
            true => Vec::new(),
            false => self
                .probes
                .row(&self.solved(moment, &moment.broken_bonds(), None)),
        }
    }
}
