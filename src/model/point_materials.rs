//! The materials of points, in a body of several.

use crate::{
    fem::Locator,
    model::{
        CellRole, Interface, Model, ModelError,
        bins::Bins,
        point_cloud::{PointCarrier, PointCloud},
    },
    parallel,
    peridynamics::{Law, Mixture},
    tensor::Vector,
};

/// Positions that are nearer than this, in sizes of a cell, lie in the cell.
const TOLERANCE: f64 = 1e-9;

/// The material of each point, and how many lie on the border of two.
#[derive(Clone, Debug, Default)]
pub(crate) struct PointMaterials {
    /// Empty in a body of one material.
    pub of_point: Vec<u16>,
    /// Sites that lie on the border of two materials.
    pub on_border: usize,
}

impl<const D: usize> Model<D> {
    /// The laws of the points, if they have several materials.
    pub fn several(&self) -> Option<&dyn Mixture<D>> {
        self.peridynamics.as_ref()?.law.several()
    }

    /// Returns true if points may have the given material.
    pub(crate) fn is_peridynamic(&self, law: &dyn Law<D>, material: u16) -> bool {
        match law.several() {
            Some(several) => several.used().contains(&material),
            None => material == self.peridynamic_material(),
        }
    }

    /// Points that lie on the border of two materials: each has that of the first by name.
    pub fn points_on_border(&self) -> usize {
        self.points.on_border
    }

    /// The material of each point: that of the cell in which it lies, on a border that of the lowest number. A place in an element has the element's where bonds reach into it; behind a face at which bonds end, that of the
    /// nearest point of the zone.
    pub(crate) fn materials_of(&self, law: &dyn Law<D>, cloud: &PointCloud<D>) -> PointMaterials {
        let Some(several) = law.several() else {
            return PointMaterials::default();
        };
        let mut used = several.used().to_vec();
        used.sort_unstable();
        let locator = |m: u16| {
            let cells = (0..self.mesh.cell_count())
                .filter(|&c| self.roles[c] == CellRole::Points && self.elastic.material[c] == m);
            (m, Locator::new(&self.mesh, cells))
        };
        let locators: Vec<(u16, Locator<D>)> = used.into_iter().map(locator).collect();
        let holders = |x: &Vector<D>| {
            let mut holders = (locators.iter()).filter(|(_, l)| l.holds(&self.mesh, x, TOLERANCE));
            (holders.next().map(|(m, _)| *m), holders.next().is_some())
        };
        let found = parallel::map(cloud.position.len(), 1, |i| match &cloud.carrier[i] {
            PointCarrier::Own | PointCarrier::Lattice => holders(&cloud.position[i]),
            PointCarrier::Element(..) if self.interface == Interface::FACES => (None, false),
            PointCarrier::Element(cell, _) => {
                let material = self.elastic.material[*cell as usize];
                let is_known = several.used().contains(&material);
                (is_known.then_some(material), false)
            }
        });
        let sites = (0..found.len()).filter(|&i| cloud.carrier[i].is_own() && found[i].0.is_some());
        let sites: Vec<(Vector<D>, u16)> = sites
            .filter_map(|i| Some((cloud.position[i], found[i].0?)))
            .collect();
        let nearest = NearestSite::new(&sites, cloud.spacing);
        let of_point = parallel::map(found.len(), 1, |i| {
            let known = found[i].0.or_else(|| nearest.material(&cloud.position[i]));
            known.unwrap_or_else(|| several.used()[0])
        });
        PointMaterials {
            of_point,
            on_border: found.iter().filter(|f| f.1).count(),
        }
    }

    /// Returns the deviation of the families of points from the constants of their material: relative differences of `C_1111`, mean and largest size, over the families of one material that
    /// weigh at least 0.95 of the heaviest one; none without points.
    pub fn tensor_deviation(&self) -> Option<[f64; 2]> {
        /// Families looked at: enough for a mean.
        const SAMPLE: usize = 1000;
        let body = self.body()?;
        let law = &self.peridynamics.as_ref()?.law;
        let material = &body.cloud.material;
        let typed = |i: usize| {
            let own = law.several().zip(material.get(i));
            let law = own.map_or(law.as_ref(), |(several, &m)| several.law(m));
            law.linearised().tensor().get(0, 0, 0, 0)
        };
        let weight = |i: usize| -> f64 {
            let family = body.families.of(i).iter();
            family.map(|&j| body.cloud.volume[j as usize]).sum()
        };
        let points = body.cloud.position.len();
        let sample: Vec<(usize, f64)> = (0..points)
            .step_by(points.div_ceil(SAMPLE).max(1))
            .map(|i| (i, weight(i)))
            .collect();
        let heaviest = sample.iter().map(|s| s.1).fold(0.0, f64::max);
        let is_of_one = |i: usize| {
            let mut family = body.families.of(i).iter();
            material.is_empty() || family.all(|&j| material[j as usize] == material[i])
        };
        let full = sample
            .iter()
            .filter(|s| s.1 >= 0.95 * heaviest && is_of_one(s.0));
        let off: Vec<f64> = full
            .map(|s| body.collapsed_tensor(s.0).get(0, 0, 0, 0) / typed(s.0) - 1.0)
            .collect();
        let mean = off.iter().sum::<f64>() / off.len().max(1) as f64;
        Some([mean, off.iter().fold(0.0, |m, e| m.max(e.abs()))])
    }

    /// Refuses a seam along the border of two materials where rows at the seam are balanced for one: bonds across would take the strain of the elements for that of the points.
    pub(crate) fn check_seam_on_border(&self, law: &dyn Law<D>) -> Result<(), ModelError> {
        if law.several().is_none() || self.interface == Interface::FACES {
            return Ok(());
        }
        let holds: Vec<bool> = self.roles.iter().map(|&r| r == CellRole::Points).collect();
        let facets = self.mesh.interface_facets(&holds, &true, &false);
        let differs = |[a, b]: [u32; 2]| {
            self.elastic.material[a as usize] != self.elastic.material[b as usize]
        };
        match facets
            .iter()
            .find(|f| differs([f.first.cell, f.second.cell]))
        {
            None => Ok(()),
            Some(facet) => {
                let nodes = facet.first.nodes.iter();
                let sum: Vector<D> = nodes.map(|&n| self.mesh.nodes[n as usize]).sum();
                let at = sum / facet.first.nodes.len() as f64;
                Err(ModelError::OtherMaterial {
                    position: at.iter().copied().collect(),
                })
            }
        }
    }
}

/// The points of the zone, in bins.
struct NearestSite<'a, const D: usize> {
    sites: &'a [(Vector<D>, u16)],
    bins: Bins<D>,
    spacing: f64,
    /// Size of the box around them.
    extent: f64,
}

impl<'a, const D: usize> NearestSite<'a, D> {
    fn new(sites: &'a [(Vector<D>, u16)], spacing: f64) -> Self {
        let positions: Vec<Vector<D>> = sites.iter().map(|s| s.0).collect();
        let start = positions.first().copied().unwrap_or_else(Vector::zeros);
        let low = positions.iter().fold(start, |low, x| low.inf(x));
        let high = positions.iter().fold(start, |high, x| high.sup(x));
        Self {
            sites,
            bins: Bins::new(&positions, 2.0 * spacing),
            spacing,
            extent: (high - low).norm(),
        }
    }

    /// The material of the nearest; of equal distances, of the first.
    fn material(&self, x: &Vector<D>) -> Option<u16> {
        let mut radius = 2.0 * self.spacing;
        while !self.sites.is_empty() && radius <= 4.0 * (self.extent + self.spacing) {
            let distance = |k: usize| (self.sites[k].0 - x).norm();
            let found = self.bins.around(x, radius);
            let nearest = found
                .filter(|&k| distance(k) <= radius)
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
            if let Some(k) = nearest {
                return Some(self.sites[k].1);
            }
            radius *= 2.0;
        }
        None
    }
}
