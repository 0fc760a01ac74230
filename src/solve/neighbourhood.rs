//! A neighbourhood of one site of a model, cut out as a small model of its own: all sites outside are held.

use std::collections::{BTreeMap, HashSet};

use crate::system::{BlockCsr, LinearMotion, SemiDiscrete};

/// A part of a model.
pub(super) struct Neighbourhood {
    /// Its sites in the model, ascending.
    pub sites: Vec<u32>,
    /// Its rows and masses.
    pub motion: LinearMotion,
    /// Its dofs that are prescribed.
    pub held: Vec<u32>,
}

impl Neighbourhood {
    /// The sites that `seed` is linked to, those that they are linked to, and so on, until there are `most`; none of a system that does not tell its rows.
    pub fn of(
        system: &dyn SemiDiscrete,
        seed: u32,
        prescribed: &[u32],
        most: usize,
    ) -> Option<Self> {
        let mut sites = vec![seed];
        let mut known: HashSet<u32> = sites.iter().copied().collect();
        let mut level = sites.clone();
        while sites.len() < most && !level.is_empty() {
            let rows = system.tangent_rows(&level);
            if rows.rows() != level.len() {
                return None;
            }
            // those with the most links come first: the nearest ones
            let mut links: BTreeMap<u32, usize> = BTreeMap::new();
            for i in 0..level.len() {
                let (columns, blocks) = rows.row(i);
                let size = (rows.block * rows.block).max(1);
                for (column, block) in columns.iter().zip(blocks.chunks_exact(size)) {
                    if !known.contains(column) && block.iter().any(|k| *k != 0.0) {
                        *links.entry(*column).or_default() += 1;
                    }
                }
            }
            let mut next: Vec<(u32, usize)> = links.into_iter().collect();
            next.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
            next.truncate(most - sites.len());
            level = next.into_iter().map(|(site, _)| site).collect();
            known.extend(&level);
            sites.extend(&level);
        }
        sites.sort_unstable();
        let rows = system.tangent_rows(&sites);
        let d = rows.block;
        let number = |site: u32| sites.binary_search(&site).ok();
        let mut stiffness = BlockCsr {
            block: d,
            row_offsets: vec![0],
            ..BlockCsr::default()
        };
        for i in 0..sites.len() {
            let (columns, blocks) = rows.row(i);
            for (&column, block) in columns.iter().zip(blocks.chunks_exact(d * d)) {
                if let Some(column) = number(column) {
                    stiffness.columns.push(column as u32);
                    stiffness.values.extend(block);
                }
            }
            stiffness.row_offsets.push(stiffness.columns.len());
        }
        let held = prescribed.iter().filter_map(|&dof| {
            let site = number(dof / d as u32)?;
            Some((site * d) as u32 + dof % d as u32)
        });
        Some(Self {
            held: held.collect(),
            motion: LinearMotion {
                stiffness,
                mass: sites.iter().map(|&s| system.mass()[s as usize]).collect(),
                symmetry: system.symmetry(),
            },
            sites,
        })
    }

    /// Returns true if a site of the model belongs to it.
    pub fn contains(&self, site: u32) -> bool {
        self.sites.binary_search(&site).is_ok()
    }
}
