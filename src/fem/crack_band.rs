//! Crack bands: the width in which the deformation of a cell localises, and the laws that depend on it.
//!
//! A law that softens has an energy per area only together with the width of the band that softens \[BazantOh1983\]. A row of cells that is alike all through holds one such band,
//! so the width is that of a cell: its length, the side of a square of its area or of a cube of its volume. Triangles and tetrahedra share the square or cube that D! of them fill: a band along a row of squares cut in two is as wide as they are.
//! The same number stands for a band at an angle to the cells, which is wider: by √2 where it follows the diagonals of squares.

use std::collections::HashMap;
use std::sync::Arc;

use super::element::cell_volume;
use crate::{
    material::{LocalLaw, WideBand},
    mesh::Mesh,
};

/// Error of a cell that cannot have a law that softens.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CellBandError {
    /// It would snap back.
    #[error("cell {cell} is too large: {source}; refine the mesh there")]
    Wide {
        /// The cell.
        cell: usize,
        /// The reason.
        #[source]
        source: WideBand,
    },
    /// A part of the cell would crack. A bar of line3 with a weak cell took 0.72 of its fracture energy.
    #[error(
        "cell {cell} is of second order: a material that softens would localise in a part of it, whose width nobody knows; use cells of first order"
    )]
    SecondOrder {
        /// The cell.
        cell: usize,
    },
}

/// The law of a cell whose material has the law `law`, within the crack band of the cell; none of one that does not soften.
///
/// # Errors
/// [`CellBandError`] for a cell in which it would not take its fracture energy.
pub fn banded_law<const D: usize>(
    law: &dyn LocalLaw<D>,
    mesh: &Mesh<D>,
    cell: usize,
) -> Result<Option<Arc<dyn LocalLaw<D>>>, CellBandError> {
    // to seven digits, so that equal cells have the same
    let width = f64::from(crack_band(mesh, cell) as f32);
    let Some(banded) = law.history().damage.and_then(|_| law.in_band(width)) else {
        return Ok(None);
    };
    if mesh.shapes[cell].is_quadratic() {
        return Err(CellBandError::SecondOrder { cell });
    }
    let banded = banded.map_err(|source| CellBandError::Wide { cell, source })?;
    Ok(Some(banded))
}

/// The width of the crack band of a cell \[m\].
pub fn crack_band<const D: usize>(mesh: &Mesh<D>, cell: usize) -> f64 {
    let in_box = mesh.shapes[cell].in_box().len() as f64;
    // strains localise between the nodes, whatever part of the cell is left
    let volume = match mesh.embedded.cut_cell(cell) {
        Some(_) => mesh.cell_volume(cell),
        None => cell_volume(mesh, cell),
    };
    (in_box * volume.abs()).powf(1.0 / D as f64)
}

/// Local laws of cells: one of a material, or of a material and a width.
#[derive(Debug)]
pub(super) struct CellLaws<const D: usize> {
    /// Laws of the materials, by their place in memory.
    typed: Vec<Arc<dyn LocalLaw<D>>>,
    /// The laws of the cells.
    pub laws: Vec<Arc<dyn LocalLaw<D>>>,
    /// By the number among those typed, the width, and whether the cell is of second order: equal cells share one law.
    number: HashMap<(usize, u32, bool), u32>,
}

impl<const D: usize> CellLaws<D> {
    pub fn new() -> Self {
        Self {
            typed: Vec::new(),
            laws: Vec::new(),
            number: HashMap::new(),
        }
    }

    /// The number of the law of a cell whose material has the law `law`.
    ///
    /// # Errors
    /// [`CellBandError`] for a cell in which it would not take its fracture energy.
    pub fn number(
        &mut self,
        law: Arc<dyn LocalLaw<D>>,
        mesh: &Mesh<D>,
        cell: usize,
    ) -> Result<u32, CellBandError> {
        let known = self.typed.iter().position(|l| Arc::ptr_eq(l, &law));
        let typed = known.unwrap_or_else(|| {
            self.typed.push(Arc::clone(&law));
            self.typed.len() - 1
        });
        let width = match law.history().damage {
            Some(_) => crack_band(mesh, cell) as f32,
            None => 0.0,
        };
        let is_quadratic = mesh.shapes[cell].is_quadratic();
        let key = (typed, width.to_bits(), is_quadratic);
        if let Some(number) = self.number.get(&key) {
            return Ok(*number);
        }
        let banded = banded_law(law.as_ref(), mesh, cell)?.unwrap_or(law);
        let number = self.laws.len() as u32;
        self.laws.push(banded);
        self.number.insert(key, number);
        Ok(number)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{NonlinearElements, sample::unit_box};
    use super::*;
    use crate::material::{
        EquivalentStrain, Kinematics, Reduced, ScalarDamage, ScalarDamageSettings, SofteningCurve,
    };
    use crate::mesh::CellShape;

    fn widths<const D: usize>(shapes: &[CellShape]) {
        for &shape in shapes {
            // rows of the side 1/4, whatever its boxes are cut into
            let mesh = unit_box::<D>(shape, 4, 0.0);
            for c in 0..mesh.cell_count() {
                let width = crack_band(&mesh, c);
                assert!((width - 0.25).abs() < 1e-12, "{shape:?} {c}: {width}");
            }
        }
    }

    #[test]
    fn a_row_of_boxes_is_a_band_as_wide_as_they_are() {
        use CellShape::*;
        widths::<1>(&[Line2, Line3]);
        widths::<2>(&[Tri3, Quad4, Tri6, Quad8]);
        widths::<3>(&[Tet4, Hex8, Tet10, Hex20]);
    }

    #[test]
    fn equal_cells_share_a_law_and_one_that_is_too_large_is_named() {
        let mesh = unit_box::<2>(CellShape::Quad4, 4, 0.0);
        let law = |strength: f64| -> Arc<dyn LocalLaw<2>> {
            let solid = ScalarDamage::new(ScalarDamageSettings {
                lambda: 0.0,
                shear: 500.0,
                strength,
                energy: 1e-3,
                measure: EquivalentStrain::Mazars,
                curve: SofteningCurve::Linear,
            });
            Arc::new(Reduced::new(Arc::new(solid), Kinematics::PlaneStress))
        };
        // 2 E G/f² = 2/f²
        let mut laws = CellLaws::new();
        let good = law(2.0);
        for c in 0..mesh.cell_count() {
            assert_eq!(laws.number(Arc::clone(&good), &mesh, c).unwrap(), 0);
        }
        assert_eq!(laws.laws.len(), 1);
        let second = unit_box::<2>(CellShape::Quad8, 4, 0.0);
        let why = laws.number(Arc::clone(&good), &second, 3).unwrap_err();
        assert!(why.to_string().contains("first order"), "{why}");
        let bad = law(3.0);
        let cells = (5..9).map(|c| (c, true));
        let why = NonlinearElements::new(&mesh, cells, |_| Some(Arc::clone(&bad)));
        let why = why.unwrap_err().to_string();
        assert!(why.contains("cell 5") && why.contains("2.2222e-1"), "{why}");
    }
}
