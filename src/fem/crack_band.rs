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
    mesh::{CellShape, Mesh},
};

/// A cell whose law would snap back.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("cell {cell}: {source}; refine the mesh there")]
pub struct WideCell {
    /// The cell.
    pub cell: usize,
    /// Why.
    #[source]
    pub source: WideBand,
}

/// The width of the crack band of a cell \[m\].
pub fn crack_band<const D: usize>(mesh: &Mesh<D>, cell: usize) -> f64 {
    let in_box = match mesh.shapes[cell] {
        CellShape::Tri3 | CellShape::Tri6 => 2.0,
        CellShape::Tet4 | CellShape::Tet10 => 6.0,
        _ => 1.0,
    };
    (in_box * cell_volume(mesh, cell).abs()).powf(1.0 / D as f64)
}

/// Local laws of cells: one of a material, or of a material and a width.
#[derive(Debug)]
pub(super) struct CellLaws<const D: usize> {
    /// What was asked for, by its place in memory.
    typed: Vec<Arc<dyn LocalLaw<D>>>,
    /// The laws of the cells.
    pub laws: Vec<Arc<dyn LocalLaw<D>>>,
    /// By the number among those typed, and the width to seven digits, so that equal cells share one law.
    number: HashMap<(usize, u32), u32>,
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
    /// [`WideCell`] if the cell is too large for it.
    pub fn number(
        &mut self,
        law: Arc<dyn LocalLaw<D>>,
        mesh: &Mesh<D>,
        cell: usize,
    ) -> Result<u32, WideCell> {
        let known = self.typed.iter().position(|l| Arc::ptr_eq(l, &law));
        let typed = known.unwrap_or_else(|| {
            self.typed.push(Arc::clone(&law));
            self.typed.len() - 1
        });
        let width = match law.damage() {
            Some(_) => crack_band(mesh, cell) as f32,
            None => 0.0,
        };
        let key = (typed, width.to_bits());
        if let Some(number) = self.number.get(&key) {
            return Ok(*number);
        }
        let banded = match law.damage().and_then(|_| law.in_band(f64::from(width))) {
            Some(banded) => banded.map_err(|source| WideCell { cell, source })?,
            None => law,
        };
        let number = self.laws.len() as u32;
        self.laws.push(banded);
        self.number.insert(key, number);
        Ok(number)
    }
}
