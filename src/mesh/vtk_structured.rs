//! Grids of VTK in rows, columns and layers: images, boxes along the axes with integers per cell, whose voxels are cells; rectilinear grids, whose planes
//! have coordinates of their own; structured grids, whose points lie anywhere.

use std::array::from_fn;

use super::vtk_grid::Grid;

/// The most cells of a grid: planes of a rectilinear one announce far more than they take in the file.
const MOST_CELLS: u64 = 100_000_000;

/// Place and size of the voxels of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Image {
    pub origin: [f64; 3],
    pub spacing: [f64; 3],
}

/// Lists of numbers in attributes.
fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let all: Option<Vec<T>> = text.split_whitespace().map(|w| w.parse().ok()).collect();
    all?.try_into().ok()
}

impl Image {
    /// By the attributes of the tag, which are called by name; none if a number is wrong, or the image is turned.
    pub fn of<'a>(attribute: impl Fn(&str) -> Option<std::borrow::Cow<'a, str>>) -> Option<Self> {
        let list = |name: &str, otherwise: [f64; 3]| match attribute(name) {
            Some(text) => numbers::<f64, 3>(&text),
            None => Some(otherwise),
        };
        let spacing = list("Spacing", [1.0; 3])?;
        let image = Self {
            origin: list("Origin", [0.0; 3])?,
            spacing,
        };
        let is_size = |s: &f64| s.is_finite() && *s > 0.0;
        let is_turned = attribute("Direction").is_some_and(|text| {
            numbers(&text) != Some([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
        });
        (spacing.iter().all(is_size) && !is_turned).then_some(image)
    }
}

/// First and last plane of a piece along each axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent([[i64; 2]; 3]);

impl Extent {
    /// From the text of an attribute; none if it is no extent along x and y at least.
    pub fn parse(text: &str) -> Option<Self> {
        let all: [i64; 6] = numbers(text)?;
        Self::of(from_fn(|k| [all[2 * k], all[2 * k + 1]]))
    }

    fn of(planes: [[i64; 2]; 3]) -> Option<Self> {
        let extent = Self(planes);
        let far = 1 << 40;
        let is_fine = |&[low, high]: &[i64; 2]| low.abs() < far && high.abs() < far && low <= high;
        let is_flat = |k: usize| extent.0[k][0] == extent.0[k][1];
        (extent.0.iter().all(is_fine) && !is_flat(0) && !is_flat(1)).then_some(extent)
    }

    /// Cells along each axis; of a plane grid none along z.
    fn cells(&self) -> [u64; 3] {
        self.0.map(|[low, high]| low.abs_diff(high))
    }

    /// Number of cells; none of a grid of more than can be a mesh.
    pub fn count(&self) -> Option<u64> {
        let [x, y, z] = self.cells();
        let all = x.checked_mul(y)?.checked_mul(z.max(1))?;
        (all <= MOST_CELLS).then_some(all)
    }

    /// Planes along each axis.
    pub fn planes(&self) -> [u64; 3] {
        self.cells().map(|n| n + 1)
    }

    /// Number of points.
    pub fn points(&self) -> u64 {
        self.planes().iter().product()
    }

    /// The extent from the first plane on of a grid with so many points along each axis; none if it has no cells along x and y at least.
    pub fn of_counts(counts: [u64; 3]) -> Option<Self> {
        let last = |n: u64| i64::try_from(n).ok()?.checked_sub(1);
        let [x, y, z] = counts.map(last);
        Self::of([[0, x?], [0, y?], [0, z?]])
    }

    /// The grid of the piece, whose values per cell have been read.
    ///
    /// # Errors
    /// The number of points, in words, where the geometry has another one.
    pub fn grid(&self, geometry: &Geometry, mut grid: Grid) -> Result<Grid, String> {
        let [nx, ny, nz] = self.cells();
        geometry.fits(self)?;
        let point = |[i, j, k]: [u64; 3]| i + (nx + 1) * (j + (ny + 1) * k);
        let kind = if nz == 0 { PIXEL } else { VOXEL };
        for k in 0..nz.max(1) {
            for j in 0..ny {
                for i in 0..nx {
                    let corners = if nz == 0 { 4 } else { 8 };
                    let corner = |n: u64| point([i + (n & 1), j + (n >> 1 & 1), k + (n >> 2)]);
                    grid.nodes.extend((0..corners).map(corner));
                    grid.ends.push(grid.nodes.len() as u64);
                    grid.types.push(kind);
                }
            }
        }
        for k in 0..=nz {
            for j in 0..=ny {
                for i in 0..=nx {
                    let at = [i, j, k];
                    grid.used.push(point(at));
                    grid.coordinates.push(match geometry {
                        Geometry::Image(image) => from_fn(|a| {
                            let plane = self.0[a][0] + at[a] as i64;
                            image.origin[a] + image.spacing[a] * plane as f64
                        }),
                        Geometry::Planes(planes) => from_fn(|a| planes[a][at[a] as usize]),
                        Geometry::Points(points) => points[point(at) as usize],
                    });
                }
            }
        }
        Ok(grid)
    }
}

/// The places of the points of a grid of rows, columns and layers.
pub(super) enum Geometry {
    /// Evenly spaced.
    Image(Image),
    /// Along each axis a coordinate for each plane.
    Planes([Vec<f64>; 3]),
    /// Anywhere; x runs fastest, z slowest.
    Points(Vec<[f64; 3]>),
}

impl Geometry {
    /// Refuses another number of points than an extent has.
    fn fits(&self, extent: &Extent) -> Result<(), String> {
        match self {
            Self::Image(_) => Ok(()),
            Self::Planes(planes) => {
                let wanted = extent.planes();
                let found = [0, 1, 2].map(|a| planes[a].len() as u64);
                match found == wanted {
                    true => Ok(()),
                    false => Err(format!("{found:?} planes of an extent of {wanted:?}")),
                }
            }
            Self::Points(points) => match points.len() as u64 == extent.points() {
                true => Ok(()),
                false => Err(format!(
                    "{} points of an extent of {}",
                    points.len(),
                    extent.points()
                )),
            },
        }
    }
}

/// VTK's number for a rectangle along the axes.
pub(super) const PIXEL: u8 = 8;
/// VTK's number for a box along the axes.
pub(super) const VOXEL: u8 = 11;
