//! Volumes and masses of the parts of a body that sites stand for.

use crate::assembly::Transfer;

/// The part of the body that each site stands for.
#[derive(Clone, Debug, Default)]
pub struct Tributary {
    /// Volume of each site's part [m^D]; they add up to that of the mesh, less voids in the zone.
    pub volume: Vec<f64>,
    /// Mass of a unit density of each material: sparse, only of sites whose part is not of one material.
    pub mixed: Vec<(u32, u16, f64)>,
    /// Volume of the peridynamic zone, less voids \[m^D\].
    pub zone: f64,
    /// Parts by which masses go, where nodes hand these on by other weights than loads.
    pub(super) inertia: Option<Box<Self>>,
    /// Weights by which nodes hand on loads and masses, where it is not those of their displacement.
    pub(crate) shares: Option<Transfer>,
}

impl Tributary {
    /// Lumped mass of every site \[kg\]; `density` gives ρ [kg/m^D] of a material's number, `own` is that of the points.
    pub fn masses(&self, own: u16, density: impl Fn(u16) -> f64) -> Vec<f64> {
        let of_points = density(own);
        let own = self.inertia.as_deref().unwrap_or(self);
        let mut masses: Vec<f64> = own.volume.iter().map(|v| v * of_points).collect();
        for &(site, material, volume) in &own.mixed {
            masses[site as usize] += volume * (density(material) - of_points);
        }
        masses
    }
}
