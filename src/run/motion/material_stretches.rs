//! The stretch at which bonds of each material break, and those between two.

use crate::coupling::semidiscrete::behaviour::{BondThreshold, StretchOfMaterials, SystemError};
use crate::model::Model;
use crate::peridynamics::Mixture;
use crate::peridynamics::critical_stretch as failure_stretch;
use crate::peridynamics::failure::Fracture;
use crate::run::error::RunError;
use crate::scene::failure::{Breaking, FractureOfMaterials};
use crate::scene::material_interfaces::MaterialInterface;
use crate::scene::spec::CalibrationSpec;

/// Critical stretches of the bonds in a body of several materials.
struct Stretches<'a, const D: usize> {
    model: &'a Model<D>,
    law: &'a dyn Mixture<D>,
    fracture: &'a FractureOfMaterials,
    calibration: CalibrationSpec,
}

impl<const D: usize> Stretches<'_, D> {
    /// Returns the energy of opening a plane per square of the critical stretch \[J/m²\], of points of one material.
    fn per_square(&self, material: u16) -> Result<f64, RunError> {
        let law = self.law.law(material);
        let planes = self.model.plane_energies_of(law.linearised(), None)?;
        let Some(&(horizon, per_square)) = planes.first() else {
            return Ok(0.0);
        };
        let Some(bonds) = law.bond_energy(horizon) else {
            return Err(SystemError::Law { law: law.name() }.into());
        };
        Ok(match self.calibration {
            CalibrationSpec::Lattice => per_square,
            // the stretch goes with the root of the energy
            CalibrationSpec::Continuum => bonds.critical_stretch::<D>(1.0, horizon)?.powi(-2),
        })
    }

    /// Returns that of a plane between two materials: the bonds across have half of their energy from either side, and stiffnesses by their rule.
    fn per_square_between(&self, a: u16, b: u16) -> Result<f64, RunError> {
        let (of_a, of_b) = (self.per_square(a)?, self.per_square(b)?);
        Ok(0.5 * (of_a * self.law.relative(a, b) + of_b * self.law.relative(b, a)))
    }

    /// The stretch at which the bonds of a criterion break, of a plane between two materials, or within one.
    fn stretch(&self, fracture: Option<Fracture>, a: u16, b: u16) -> Result<f64, RunError> {
        let of_energy = |energy: f64| -> Result<f64, RunError> {
            let per_square = self.per_square_between(a, b)?;
            let linear = failure_stretch::critical_stretch(energy, per_square)?;
            let ratio = |m: u16, s: f64| {
                let states = self.law.law(m).force_state();
                states.map_or(1.0, |law| law.energy_ratio(s))
            };
            Ok(failure_stretch::stretch_of_equal_energy(linear, |s| {
                0.5 * (ratio(a, s) + ratio(b, s))
            })?)
        };
        let typed = fracture.map(|f| f.stretch(of_energy)).transpose()?;
        Ok(typed.flatten().unwrap_or(f64::INFINITY))
    }

    fn within(&self, material: u16) -> Result<f64, RunError> {
        let (_, fracture) = &self.fracture.of[usize::from(material)];
        self.stretch(*fracture, material, material)
    }

    /// As an interface says, else the smaller of the two.
    fn between(&self, a: u16, b: u16) -> Result<f64, RunError> {
        if a == b {
            return self.within(a);
        }
        let typed = MaterialInterface::of(&self.fracture.interfaces, a, b);
        match typed.and_then(|interface| interface.fracture) {
            Some(fracture) => self.stretch(Some(fracture), a, b),
            None => Ok(self.within(a)?.min(self.within(b)?)),
        }
    }
}

/// The critical stretches of all pairs of materials.
///
/// # Errors
/// [`RunError::Fracture`], or [`RunError::System`] for a law whose bond energy is not known.
pub(super) fn of<const D: usize>(
    model: &Model<D>,
    law: &dyn Mixture<D>,
    breaking: &Breaking<D>,
) -> Result<BondThreshold, RunError> {
    let Some(fracture) = &breaking.several else {
        let law = law.law(law.used()[0]).name();
        return Err(SystemError::Law { law }.into());
    };
    let stretches = Stretches {
        model,
        law,
        fracture,
        calibration: breaking.calibration,
    };
    let count = fracture.of.len();
    let mut table = vec![f64::INFINITY; count * count];
    for &a in &fracture.used {
        for &b in fracture.used.iter().filter(|b| **b >= a) {
            table[usize::from(a) * count + usize::from(b)] = stretches.between(a, b)?;
        }
    }
    Ok(BondThreshold::ByMaterials(StretchOfMaterials::new(
        count,
        |a, b| table[usize::from(a) * count + usize::from(b)],
    )))
}

/// In words: at which stretch the bonds of each material and of each interface break.
pub(super) fn stretches_of_materials<const D: usize>(
    stretch: &StretchOfMaterials,
    breaking: &Breaking<D>,
) -> String {
    let Some(FractureOfMaterials { of, used, .. }) = &breaking.several else {
        return String::new();
    };
    let mut used = used.clone();
    used.sort_unstable();
    let name = |m: u16| of[usize::from(m)].0.as_str();
    let told = |s: f64| match s.is_finite() {
        true => format!("break at the stretch {s:.3e}"),
        false => "do not break".to_owned(),
    };
    let mut list = Vec::new();
    for (place, &a) in used.iter().enumerate() {
        list.push(format!("bonds of {} {}", name(a), told(stretch.at(a, a))));
        for &b in &used[place + 1..] {
            let own = told(stretch.at(a, b));
            list.push(format!("those between {} and {} {own}", name(a), name(b)));
        }
    }
    list.join(", ")
}
