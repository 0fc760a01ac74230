//! The coarsest candidate whose error is small enough, by looking at candidates themselves.

use std::iter::successors;

/// Candidates nearer than this are as good as each other.
const CLOSE: f64 = 1.04;

/// So many candidates are looked at.
const MOST: usize = 8;

/// The coarsest of the candidates of `least` cells and more whose `error` is at most `wanted`, from a `guess`; `None` where none is found.
///
/// `fitting` is the least number of cells that is possible from a number on, `error` goes about as n to the power of `-order` and is infinite for
/// a candidate that does not run. An error that jumps leaves a candidate that meets what is wanted, if not
/// the coarsest.
pub(super) fn coarsest(
    guess: usize,
    least: usize,
    (wanted, order): (f64, f64),
    fitting: impl Fn(usize) -> usize,
    mut error: impl FnMut(usize) -> f64,
) -> Option<usize> {
    let mut misses = least.saturating_sub(1);
    let mut meets = None;
    let mut next = fitting(guess.max(least));
    for _ in 0..MOST {
        let e = error(next);
        let expected = next as f64 * (e / wanted).powf(1.0 / order);
        if e <= wanted {
            meets = Some(next);
        } else {
            misses = next;
        }
        next = match meets {
            Some(best) => {
                let most = (best as f64 / CLOSE) as usize;
                let between: Vec<usize> =
                    successors(Some(fitting(misses + 1)), |n| Some(fitting(n + 1)))
                        .take_while(|&n| n <= most)
                        .collect();
                // one that does not run says nothing of where to look
                let aim = match (between.first(), expected.is_finite()) {
                    (Some(&first), false) => (first as f64 * most as f64).sqrt(),
                    _ => expected,
                };
                let apart = |n: usize| (n as f64 / aim).ln().abs();
                match between
                    .into_iter()
                    .min_by(|&a, &b| apart(a).total_cmp(&apart(b)))
                {
                    Some(n) => n,
                    None => break,
                }
            }
            None if expected.is_finite() => {
                fitting((expected.ceil() as usize).max((misses as f64 * CLOSE).ceil() as usize))
            }
            None => break,
        };
    }
    meets
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 9/n² is at most 0.1 from n = 9.49 on.
    #[test]
    fn a_power_law_is_met_in_few_steps_from_any_guess() {
        for guess in [1, 4, 9, 10, 11, 30, 100] {
            let mut looked = 0;
            let n = coarsest(
                guess,
                1,
                (0.1, 2.0),
                |n| n,
                |n| {
                    looked += 1;
                    9.0 / (n * n) as f64
                },
            );
            assert_eq!(n, Some(10), "from {guess}");
            assert!(looked <= 3, "{looked} from {guess}");
        }
    }

    /// Two cells do worse than one, as where they put a node where a load is nil; the law alone would take three.
    #[test]
    fn jumps_leave_a_candidate_that_meets() {
        let error = |n: usize| [0.0, 0.04, 0.9, 0.2, 0.03][n.min(4)];
        assert_eq!(coarsest(4, 1, (0.05, 2.0), |n| n, error), Some(4));
        assert_eq!(coarsest(1, 1, (0.05, 2.0), |n| n, error), Some(1));
        // the largest in between is left out where it does not run
        let refused = |n: usize| if n < 6 { f64::INFINITY } else { 1e-3 };
        assert_eq!(coarsest(16, 1, (0.05, 1.0), |n| n, refused), Some(6));
        assert_eq!(coarsest(2, 1, (0.05, 1.0), |n| n, refused), None);
    }

    /// A hole puts the cells on multiples of four; the law is met from 9.49 on.
    #[test]
    fn only_candidates_that_fit_are_looked_at() {
        let fours = |n: usize| n.div_ceil(4) * 4;
        for guess in [3, 10, 40] {
            let n = coarsest(guess, 1, (0.1, 2.0), fours, |n| {
                assert_eq!(n % 4, 0);
                9.0 / (n * n) as f64
            });
            assert_eq!(n, Some(12), "from {guess}");
        }
    }

    #[test]
    fn nothing_below_the_least_is_looked_at() {
        let error = |n: usize| {
            assert!(n >= 8);
            0.5
        };
        assert_eq!(coarsest(5, 8, (1.0, 2.0), |n| n, error), Some(8));
        assert_eq!(coarsest(20, 8, (1.0, 2.0), |n| n, error), Some(8));
    }
}
