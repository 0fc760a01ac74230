//! Sections of legacy files of grids in rows, columns and layers.

use super::{DataSet, Reader};
use crate::mesh::MeshError;
use crate::mesh::vtk_structured::{Extent, Geometry, Image};

impl Reader<'_> {
    /// Takes the cells and points of a set in rows, columns and layers.
    pub(super) fn take_structured(&mut self, extent: &Extent) -> Result<(), MeshError> {
        let at = self.grid.at;
        let geometry = match (self.set, self.image) {
            (DataSet::Image, [Some(origin), Some(spacing)]) => {
                let is_size = |s: &f64| s.is_finite() && *s > 0.0;
                if !spacing.iter().all(is_size) {
                    let found = format!("the spacing {spacing:?}");
                    return Err(self.syntax(at, &found, "a spacing above zero"));
                }
                if self.grid.cell_data.is_empty() {
                    let found = "an image without integers per cell";
                    return Err(self.syntax(at, found, "CELL_DATA with an integer array"));
                }
                Geometry::Image(Image { origin, spacing })
            }
            (DataSet::Rectilinear, _) => Geometry::Planes(std::mem::take(&mut self.planes)),
            _ => {
                let points = self.points.chunks_exact(3).map(|x| [x[0], x[1], x[2]]);
                Geometry::Points(points.collect())
            }
        };
        let grid = std::mem::take(&mut self.grid);
        self.grid = (extent.grid(&geometry, grid))
            .map_err(|found| self.syntax(at, &found, "as many as DIMENSIONS has"))?;
        Ok(())
    }

    /// Coordinates of so many axes for each of an announced number of places.
    pub(super) fn coordinates(&mut self, axes: u64) -> Result<Vec<f64>, MeshError> {
        let count = self.count("the number of places")?;
        let kind = self.kind()?;
        let all = self.times(count, axes)?;
        let mut read = Vec::new();
        self.each(kind, all, &mut |n| {
            read.push(n.real());
            true
        })?;
        Ok(read)
    }

    /// Three numbers that are written as words, whatever the encoding.
    pub(super) fn triple<T: std::str::FromStr + Copy + Default>(
        &mut self,
        wanted: &str,
    ) -> Result<[T; 3], MeshError> {
        let mut read = [T::default(); 3];
        for value in &mut read {
            let at = self.next();
            let word = self.word(wanted)?;
            *value = word.parse().map_err(|_| self.syntax(at, &word, wanted))?;
        }
        Ok(read)
    }

    /// The numbers of points along the axes.
    pub(super) fn dimensions(&mut self, at: usize) -> Result<(), MeshError> {
        let counts = self.triple("a number of points along each axis")?;
        if self.set == DataSet::Unstructured {
            let found = "DIMENSIONS of an unstructured grid";
            return Err(self.syntax(at, found, "POINTS"));
        }
        let extent = Extent::of_counts(counts).filter(|extent| extent.count().is_some());
        let Some(extent) = extent else {
            let found = format!("DIMENSIONS {counts:?}");
            let wanted = "two points or more along x and y (a plane grid has one along z), and at most 1e8 cells";
            return Err(self.syntax(at, &found, wanted));
        };
        self.grid.points = extent.points();
        self.extent = Some(extent);
        Ok(())
    }
}
