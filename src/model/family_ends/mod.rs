//! Families that end at feet, places on the faces of elements, for couplings with [`Interface::FEET`](crate::model::Interface::FEET).
//!
//! | file | content |
//! |---|---|
//! | `feet.rs` | places on the faces of elements at which families end, with their first weights |
//! | `fit.rs` | the smallest change of weights that balances every uniform stress |
//! | `least_squares.rs` | conjugate gradients for the least squares of that fit |
//!
//! Theory: [`crate::coupling::truncated_families`].

mod feet;
mod fit;
mod least_squares;

pub(crate) use feet::{Feet, place};
pub(crate) use fit::balance;
