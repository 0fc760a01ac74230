//! Makes the lattice pass from a cloud or from a block.

use super::{
    BlockSetup, BondForce, BondKinematics, BondSetup,
    lattice::{Lattice, Solid, TASK, ones},
    lattice_simd::EVEN,
    simd::LANES,
    softened_bonds::SoftenedBonds,
    stencil::{NONE, Stencil},
};
use crate::parallel;

fn most_common(volume: &[f64]) -> f64 {
    let mut sorted = volume.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let runs = sorted.chunk_by(|a, b| a == b);
    runs.max_by_key(|r| r.len()).map_or(1.0, |r| r[0])
}

/// Contents of the cells of the padded box; see the fields of the same names in [`Lattice`].
struct Filled {
    unit: f64,
    volume: Vec<f64>,
    no_fail: Vec<bool>,
    scale: Vec<f64>,
    /// Without an energy of their own; empty for none.
    without_energy: Vec<bool>,
}

/// Computes the numbers that a solid adds to a lattice: factors of dilatation and of the deviatoric part from the weighted volumes of families.
fn solid<const D: usize>(
    stencil: &Stencil<D>,
    volume: &[f64],
    without_energy: &[bool],
    bulk: f64,
    shear: f64,
) -> Solid {
    let (groups, cells) = (stencil.groups.len(), stencil.point_of.len());
    let relative = |cell: usize| volume[cell];
    let offsets = &stencil.offsets;
    let bits = |g: usize| &stencil.reference[g * offsets.len()..(g + 1) * offsets.len()];
    let d = D as f64;
    let mut solid = Solid {
        dilatation: vec![[0.0; LANES]; groups],
        volumetric: vec![[0.0; LANES]; groups],
        deviatoric: vec![0.0; cells],
        pull: vec![0.0; cells],
        group_of: vec![NONE; cells.div_ceil(LANES)],
    };
    for (g, &cell) in stencil.groups.iter().enumerate() {
        let cell = cell as usize;
        solid.group_of[cell / LANES] = g as u32;
        let mut m = [0.0; LANES];
        for (o, &b) in offsets.iter().zip(bits(g)) {
            for lane in (0..LANES).filter(|l| b >> l & 1 == 1) {
                m[lane] += o.moment * relative(((cell + lane) as isize + o.delta) as usize);
            }
        }
        let own = |lane: &usize| !without_energy.get(cell + lane).copied().unwrap_or(false);
        for lane in (0..LANES).filter(|&l| m[l] > 0.0).filter(own) {
            solid.dilatation[g][lane] = d / m[lane];
            solid.volumetric[g][lane] = (d * bulk - (d + 2.0) * shear) / m[lane];
            solid.deviatoric[cell + lane] = d * (d + 2.0) * shear / m[lane];
        }
    }
    // the weights carry the lattice's own volume, so m is in true units and forces are too
    solid
}

impl<const D: usize> Lattice<D> {
    /// The pass of a cloud, or the reason that it has none.
    pub(super) fn new(setup: &BondSetup<'_, D>) -> Result<Self, String> {
        let unit = most_common(setup.volume);
        if unit.is_nan() || unit <= 0.0 {
            return Err("volumes are not positive".into());
        }
        let stencil = Stencil::new(setup, unit)?;
        let alike = setup.volume.iter().all(|&v| v == unit);
        let by_cell = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let points = stencil.point_of.iter();
            points
                .map(|&p| if p == NONE { 0.0 } else { f(p as usize) })
                .collect()
        };
        let volume = by_cell(&|p| setup.volume[p] / unit);
        let points = setup.position.len();
        let no_fail = if (0..points).any(|p| setup.no_fail(p)) {
            let points = stencil.point_of.iter();
            points
                .map(|&p| p != NONE && setup.no_fail(p as usize))
                .collect()
        } else {
            Vec::new()
        };
        let without_energy = if (0..points).any(|p| setup.has_no_energy(p)) {
            let points = stencil.point_of.iter();
            points
                .map(|&p| p != NONE && setup.has_no_energy(p as usize))
                .collect()
        } else {
            Vec::new()
        };
        let scale = if alike && (0..points).all(|p| setup.row(p)) {
            Vec::new()
        } else {
            (0..points)
                .map(|p| if setup.row(p) { setup.volume[p] } else { 0.0 })
                .collect()
        };
        let filled = Filled {
            unit,
            volume,
            no_fail,
            scale,
            without_energy,
        };
        let mut pass = Self::finish(stencil, filled, points, setup.kinematics, &setup.force)?;
        pass.softened = (setup.failure.and_then(|f| f.softening)).map(SoftenedBonds::new);
        Ok(pass)
    }

    /// The pass of a full block.
    pub(super) fn block(setup: &BlockSetup<'_, D>) -> Result<Self, String> {
        let unit: f64 = setup.spacing.iter().product();
        let setup_limit = |s: f64| match setup.kinematics {
            BondKinematics::Exact => s * (2.0 + s),
            BondKinematics::Linear => 2.0 * s,
        };
        let limit = setup.critical.map_or(f64::INFINITY, setup_limit);
        let stencil = setup.stencil(
            |xi| {
                let weight = match setup.force {
                    BondForce::Pairwise { coefficient } => {
                        2.0 * coefficient(0, 0, xi) * xi.norm_squared()
                    }
                    BondForce::Solid { omega, .. } => omega(0, 0, xi),
                    BondForce::Law { .. } => 0.0,
                };
                (weight, limit)
            },
            unit,
        );
        let points = setup.counts.iter().product();
        let volume = stencil.point_of.iter();
        let volume = volume.map(|&p| if p == NONE { 0.0 } else { 1.0 }).collect();
        let filled = Filled {
            unit,
            volume,
            no_fail: Vec::new(),
            scale: Vec::new(),
            without_energy: Vec::new(),
        };
        Self::finish(stencil, filled, points, setup.kinematics, &setup.force)
    }

    /// The two constructors' common end.
    fn finish(
        stencil: Stencil<D>,
        filled: Filled,
        points: usize,
        kinematics: BondKinematics,
        force: &BondForce<'_, D>,
    ) -> Result<Self, String> {
        let Filled {
            unit,
            volume,
            no_fail,
            scale,
            without_energy,
        } = filled;
        let groups = stencil.groups.len();
        let cells = stencil.point_of.len();
        let mut place = vec![NONE; points];
        for (g, &cell) in stencil.groups.iter().enumerate() {
            for lane in 0..LANES {
                let p = stencil.point_of[cell as usize + lane];
                if p != NONE {
                    place[p as usize] = (g * LANES + lane) as u32;
                }
            }
        }
        let relative = |cell: usize| volume[cell];
        let offsets = &stencil.offsets;
        let bits = |g: usize| &stencil.reference[g * offsets.len()..(g + 1) * offsets.len()];
        let solid = match *force {
            BondForce::Law { .. } => return Err("the law has no lattice pass".into()),
            BondForce::Pairwise { .. } => None,
            BondForce::Solid { bulk, shear, .. } => {
                Some(solid(&stencil, &volume, &without_energy, bulk, shear))
            }
        };
        // a group is even if all bonds of its points see the same
        let even = |g: usize| {
            let cell = stencil.groups[g] as usize;
            offsets.iter().zip(bits(g)).all(|(o, &b)| {
                (0..LANES).filter(|l| b >> l & 1 == 1).all(|lane| {
                    let here = cell + lane;
                    let there = (here as isize + o.delta) as usize;
                    relative(there) == 1.0
                        && solid
                            .as_ref()
                            .is_none_or(|s| s.deviatoric[here] == s.deviatoric[there])
                })
            })
        };
        let flags = parallel::map(groups, TASK, |g| if even(g) { EVEN } else { 0 });
        let limit = offsets.iter().fold(f64::INFINITY, |m, o| m.min(o.limit));
        let reference = ones(&stencil.reference);
        let mut lattice = Self {
            unit,
            volume,
            no_fail,
            flags,
            scale,
            place,
            kinematics,
            limit,
            solid,
            u: std::array::from_fn(|_| vec![0.0; cells]),
            sums: vec![[0.0; LANES]; groups * D.max(2)],
            reference,
            stencil,
            broken: Vec::new(),
            softened: None,
            own: Vec::new(),
            reach: None,
            has_seen_breaks: false,
        };
        lattice.mark_full();
        Ok(lattice)
    }
}
