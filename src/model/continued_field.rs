//! Points behind a face in elements of another material: the field of the zone goes on there.
//!
//! Bonds that end on faces take nothing from such points; the strain, stress and energy that are shown of the points before the face do. Across a border of materials the strain jumps, and what the elements behind it do is none of theirs.

use crate::{
    model::{
        Model,
        bins::Bins,
        interface_interpolation::Sites,
        least_squares_gradient::{FitDegree, fit},
        point_cloud::{PointCarrier, PointCloud},
    },
    peridynamics::Law,
    tensor::Vector,
};

/// Widths of the layer of points behind the nearest one that an affine fit is tried with, in spacings.
const LAYERS: [f64; 3] = [1.5, 2.5, 4.0];

/// Distance up to which the nearest point of the zone is sought, in spacings.
const FARTHEST: f64 = 12.0;

/// The points of a zone, from which its field is continued.
pub(crate) struct ContinuedField<'a, const D: usize> {
    model: &'a Model<D>,
    law: &'a dyn Law<D>,
    sites: &'a Sites<'a, D>,
    cloud: &'a PointCloud<D>,
    /// Numbers of the points that are sites; empty where nothing has to be continued.
    points: Vec<u32>,
    bins: Bins<D>,
}

impl<'a, const D: usize> ContinuedField<'a, D> {
    /// Of a cloud of points of a law.
    pub fn new(
        model: &'a Model<D>,
        law: &'a dyn Law<D>,
        sites: &'a Sites<'a, D>,
        cloud: &'a PointCloud<D>,
    ) -> Self {
        let mut field = Self {
            model,
            law,
            sites,
            cloud,
            points: Vec::new(),
            bins: Bins::new(&[], 1.0),
        };
        if !model.interface.overlap && (0..cloud.position.len()).any(|i| field.is_foreign(i)) {
            let points = (0..cloud.position.len()).filter(|&i| cloud.carrier[i].is_own());
            field.points = points.map(|i| i as u32).collect();
            let of = |&p: &u32| cloud.position[p as usize];
            let positions: Vec<Vector<D>> = field.points.iter().map(of).collect();
            field.bins = Bins::new(&positions, 2.0 * cloud.spacing);
        }
        field
    }

    /// Returns true if a point lies in an element of another stiffness than that of the points.
    fn is_foreign(&self, point: usize) -> bool {
        let PointCarrier::Element(cell, _) = &self.cloud.carrier[point] else {
            return false;
        };
        let (elastic, cell) = (&self.model.elastic, *cell as usize);
        let own = &elastic.tensors[usize::from(elastic.of_points)];
        !self.model.is_peridynamic(self.law, elastic.material[cell]) && elastic.tensor(cell) != own
    }

    /// Weights of the points, by their numbers, that are exact for affine fields; none of a point that is not behind a border of materials, or that no points around determine.
    pub fn row(&self, point: usize) -> Option<Vec<(u32, f64)>> {
        if self.points.is_empty() || !self.is_foreign(point) {
            return None;
        }
        let (x, h) = (&self.cloud.position[point], self.cloud.spacing);
        let at = |k: &usize| self.cloud.position[self.points[*k] as usize];
        let is_hidden = |k: &usize| self.sites.barriers.cuts(x, &at(k));
        let mut seen: Vec<(f64, usize)> = (self.bins.around(x, FARTHEST * h))
            .filter(|k| !is_hidden(k))
            .map(|k| ((at(&k) - x).norm(), k))
            .collect();
        seen.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let nearest = seen.first()?.0;
        LAYERS.iter().find_map(|layer| {
            let within = |entry: &&(f64, usize)| entry.0 <= nearest + layer * h;
            let chosen: Vec<usize> = seen.iter().take_while(within).map(|s| s.1).collect();
            let places: Vec<Vector<D>> = chosen.iter().map(at).collect();
            let weights = fit(x, &places, FitDegree::Affine)?;
            Some(
                chosen
                    .iter()
                    .map(|&k| self.points[k])
                    .zip(weights)
                    .collect(),
            )
        })
    }
}
