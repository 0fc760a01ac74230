//! Energy and area of broken bonds, in a summary.

use std::fmt;

use serde::Serialize;

use super::report::number;

/// Energy that bonds took when they broke, and the cracks that they left.
///
/// Units: J and m² (per metre of thickness and m in 2D, per square metre of section and a number in 1D).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CrackSummary {
    /// Stored energy just before less that just after bonds broke.
    pub dissipated_energy: f64,
    /// Area of the cracks, a length in 2D, from the broken bonds between next neighbours.
    pub area: f64,
    /// Dissipated energy over area; none without a crack.
    pub energy_per_area: Option<f64>,
    /// Energy per area of a plane along the lattice's axes at the critical stretch, or of a crack whose bonds soften; none with several lattices.
    pub plane_energy: Option<f64>,
    /// The fracture energy that the scene has; none where it has a critical stretch.
    pub fracture_energy: Option<f64>,
}

impl CrackSummary {
    /// Energy and area with their quotient.
    pub fn new(dissipated_energy: f64, area: f64) -> Self {
        Self {
            dissipated_energy,
            area,
            energy_per_area: (area > 0.0).then(|| dissipated_energy / area),
            ..Self::default()
        }
    }

    pub(super) fn write(&self, dimension: usize, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "dissipated energy      {}",
            number(self.dissipated_energy)
        )?;
        let Some(per_area) = self.energy_per_area else {
            return Ok(());
        };
        let (measure, per) = match dimension {
            1 => ("cracks", "crack"),
            2 => ("crack length", "length"),
            _ => ("crack area", "area"),
        };
        write!(
            f,
            "{measure:<22} {}, dissipated per {per} {}",
            number(self.area),
            number(per_area)
        )?;
        match (self.fracture_energy, self.plane_energy) {
            (Some(typed), _) => writeln!(
                f,
                ": {:.3} of the fracture energy {}",
                per_area / typed,
                number(typed)
            ),
            (None, Some(plane)) => writeln!(
                f,
                ": {:.3} of what a plane of the lattice takes, {}",
                per_area / plane,
                number(plane)
            ),
            (None, None) => writeln!(f),
        }
    }
}
