//! Functions of a program that stand for numbers of a scene: fields and loads that no expression gives.
//!
//! A function is called for many places at once. The scene's table has a word in its place, and its source has the function.

use std::cell::RefCell;
use std::fmt;
use std::sync::Arc;

/// A field as a function of position and time, given by a program.
///
/// Positions have three coordinates, those beyond the dimension are zero. A function must give the same values whenever it is asked, or a resumed run differs from one that never
/// stopped; a checkpoint does not know functions, so whoever resumes a run gives it the same ones.
#[derive(Clone)]
pub struct Function {
    evaluate: Arc<Evaluate>,
    /// True if values change: in space, and in time.
    varies: [bool; 2],
}

/// Writes a value for each of the positions at a time.
type Evaluate = dyn Fn(&[[f64; 3]], f64, &mut [f64]) + Send + Sync;

impl fmt::Debug for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Function")
    }
}

impl PartialEq for Function {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.evaluate, &other.evaluate)
    }
}

impl Function {
    /// A field that does not change with time, `f(x)`.
    pub fn of_position(f: impl Fn(&[f64; 3]) -> f64 + Send + Sync + 'static) -> Self {
        Self::of_points(move |places, values| {
            let each = places.iter().zip(values);
            each.for_each(|(x, value)| *value = f(x));
        })
    }

    /// A number that changes with time, `f(t)`.
    pub fn of_time(f: impl Fn(f64) -> f64 + Send + Sync + 'static) -> Self {
        let fill = move |_: &[[f64; 3]], t: f64, values: &mut [f64]| values.fill(f(t));
        Self {
            evaluate: Arc::new(fill),
            varies: [false, true],
        }
    }

    /// A field that changes with time, `f(x, t)`.
    pub fn of_position_and_time(f: impl Fn(&[f64; 3], f64) -> f64 + Send + Sync + 'static) -> Self {
        Self::of_points_and_time(move |places, t, values| {
            let each = places.iter().zip(values);
            each.for_each(|(x, value)| *value = f(x, t));
        })
    }

    /// As [`Function::of_position`], many places at once: `f` writes a value for each.
    pub fn of_points(f: impl Fn(&[[f64; 3]], &mut [f64]) + Send + Sync + 'static) -> Self {
        Self {
            evaluate: Arc::new(move |places, _, values| f(places, values)),
            varies: [true, false],
        }
    }

    /// As [`Function::of_position_and_time`], many places at once: `f` writes a value for each.
    pub fn of_points_and_time(
        f: impl Fn(&[[f64; 3]], f64, &mut [f64]) + Send + Sync + 'static,
    ) -> Self {
        Self {
            evaluate: Arc::new(f),
            varies: [true; 2],
        }
    }

    /// The values at some places at the time `t`; not a number where the function writes none.
    pub fn values(&self, places: &[[f64; 3]], t: f64) -> Vec<f64> {
        let mut values = vec![f64::NAN; places.len()];
        if !places.is_empty() {
            (self.evaluate)(places, t, &mut values);
        }
        values
    }

    /// Returns the word that stands in a scene's keys for the function of this number among those of its source, see [`Source::with_functions`](super::Source::with_functions).
    pub fn word(number: usize) -> String {
        format!("function {number}")
    }

    /// Returns true if values change in space.
    pub fn depends_on_position(&self) -> bool {
        self.varies[0]
    }

    /// Returns true if values change in time.
    pub fn depends_on_time(&self) -> bool {
        self.varies[1]
    }
}

thread_local! {
    /// The functions of the source that is read at present.
    static IN_SCOPE: RefCell<Vec<Function>> = const { RefCell::new(Vec::new()) };
}

/// Takes the functions out of scope again, whatever happened.
struct Scope(Vec<Function>);

impl Drop for Scope {
    fn drop(&mut self) {
        IN_SCOPE.set(std::mem::take(&mut self.0));
    }
}

/// Reads something in whose text words stand for `functions`. A deserialiser that is derived knows of nothing but its text, so they are kept beside it.
pub(crate) fn with_functions<T>(functions: &[Function], read: impl FnOnce() -> T) -> T {
    let _scope = Scope(IN_SCOPE.replace(functions.to_vec()));
    read()
}

/// The function that a text stands for, if it does.
pub(crate) fn in_scope(text: &str) -> Option<Function> {
    let number: usize = text.strip_prefix("function ")?.parse().ok()?;
    IN_SCOPE.with_borrow(|functions| functions.get(number).cloned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_stand_for_functions_within_their_source_only() {
        let double = Function::of_position(|x| 2.0 * x[0]);
        assert!(in_scope(&Function::word(0)).is_none());
        with_functions(std::slice::from_ref(&double), || {
            assert_eq!(in_scope(&Function::word(0)).as_ref(), Some(&double));
            assert!(in_scope(&Function::word(1)).is_none() && in_scope("2*x").is_none());
            with_functions(&[], || assert!(in_scope(&Function::word(0)).is_none()));
            assert!(in_scope(&Function::word(0)).is_some());
        });
        assert!(in_scope(&Function::word(0)).is_none());
        assert_eq!(
            double.values(&[[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]], 0.0),
            [2.0, 6.0]
        );
    }

    #[test]
    fn what_a_function_leaves_out_is_not_a_number() {
        let first = Function::of_points_and_time(|_, t, values| values[0] = t);
        let values = first.values(&[[0.0; 3]; 2], 5.0);
        assert!(values[0] == 5.0 && values[1].is_nan());
        assert!(Function::of_time(|t| t).values(&[], 1.0).is_empty());
    }
}
