//! Functions for one, two and three dimensions that are compiled with this crate.
//!
//! A function that is generic over the dimension is compiled once more in each crate that calls it, with all that it calls in turn: the solver of static scenes took
//! a minute of each test program that enters there. Where callers enter for much work, a static table has the function for each dimension instead, and the caller takes
//! that of its own.

use std::any::Any;

/// The function of type `F`, the one of its dimension, from a table of those for one, two and three dimensions.
///
/// # Panics
/// For a type that the table does not have: that of a fourth dimension.
pub(crate) fn of<F: Any + Copy>(table: &'static (impl Any, impl Any, impl Any)) -> F {
    let known: [&dyn Any; 3] = [&table.0, &table.1, &table.2];
    let found = known.into_iter().find_map(|f| f.downcast_ref::<F>());
    *found.expect("bodies have one, two or three dimensions")
}

#[cfg(test)]
mod tests {
    type Sum<const D: usize> = fn(&[f64; D]) -> f64;

    fn sum<const D: usize>(x: &[f64; D]) -> f64 {
        x.iter().sum()
    }

    static SUMS: (Sum<1>, Sum<2>, Sum<3>) = (sum::<1>, sum::<2>, sum::<3>);

    #[test]
    fn a_table_gives_the_function_of_each_dimension() {
        assert_eq!(super::of::<Sum<1>>(&SUMS)(&[1.0]), 1.0);
        assert_eq!(super::of::<Sum<2>>(&SUMS)(&[1.0, 2.0]), 3.0);
        assert_eq!(super::of::<Sum<3>>(&SUMS)(&[1.0, 2.0, 3.0]), 6.0);
    }
}
