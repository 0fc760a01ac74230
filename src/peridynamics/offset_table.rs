//! A value for each bond of a lattice, by its integer offset: a look-up without hashing.

/// Values of offsets of at most `reach` along each axis.
#[derive(Clone, Debug)]
pub(crate) struct OffsetTable<T, const D: usize> {
    reach: i32,
    /// The last axis fastest.
    values: Vec<Option<T>>,
}

impl<T: Copy, const D: usize> OffsetTable<T, D> {
    /// A table without values.
    pub fn empty(reach: i32) -> Self {
        Self {
            reach,
            values: vec![None; (2 * reach as usize + 1).pow(D as u32)],
        }
    }

    /// A table that just holds the given offsets.
    pub fn new(known: &[([i32; D], T)]) -> Self {
        let components = known.iter().flat_map(|(offset, _)| offset);
        let mut table = Self::empty(components.map(|k| k.abs()).max().unwrap_or(0));
        for (offset, value) in known {
            if let Some(place) = table.slot(offset) {
                *place = Some(*value);
            }
        }
        table
    }

    fn place(&self, offset: &[i32; D]) -> Option<usize> {
        let mut place = 0;
        for &k in offset {
            if k.abs() > self.reach {
                return None;
            }
            place = place * (2 * self.reach + 1) as usize + (k + self.reach) as usize;
        }
        Some(place)
    }

    /// The value of an offset; none for one that has none, or lies beyond the table.
    pub fn of(&self, offset: &[i32; D]) -> Option<T> {
        self.values[self.place(offset)?]
    }

    /// Returns the place of the value of an offset; none beyond the table.
    pub fn slot(&mut self, offset: &[i32; D]) -> Option<&mut Option<T>> {
        let place = self.place(offset)?;
        self.values.get_mut(place)
    }

    /// Another value in the place of each.
    pub fn map<U>(self, f: impl Fn(T) -> U) -> OffsetTable<U, D> {
        OffsetTable {
            reach: self.reach,
            values: self.values.into_iter().map(|v| v.map(&f)).collect(),
        }
    }

    /// Offsets with values, ascending.
    pub fn known(&self) -> impl Iterator<Item = ([i32; D], T)> + '_ {
        let side = (2 * self.reach + 1) as usize;
        self.values
            .iter()
            .enumerate()
            .filter_map(move |(place, v)| {
                let mut rest = place;
                let mut offset = [0; D];
                for k in offset.iter_mut().rev() {
                    *k = (rest % side) as i32 - self.reach;
                    rest /= side;
                }
                v.map(|v| (offset, v))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_found_again() {
        let known = [([-2, 0, 1], 'a'), ([0, 0, 0], 'b'), ([1, 2, -1], 'c')];
        let mut table = OffsetTable::new(&known);
        assert_eq!(table.known().collect::<Vec<_>>(), known);
        assert_eq!(table.of(&[1, 2, -1]), Some('c'));
        assert_eq!(table.of(&[1, 2, 1]), None);
        assert_eq!(table.of(&[3, 0, 0]), None);
        assert!(table.slot(&[0, -3, 0]).is_none());
        *table.slot(&[2, 2, 2]).unwrap() = Some('d');
        assert_eq!(table.known().last(), Some(([2, 2, 2], 'd')));
    }
}
