//! Sums whose bits do not depend on the order of their terms, nor on which process has which of them.
//!
//! A sum is a number of fixed point that holds every double exactly, in limbs of 32 bits with room for carries: limbs are added as integers, over processes too, and
//! the sum is rounded once, where its value is asked for.

/// Bits of a limb that count; the others are room for carries.
const BITS: u32 = 32;
/// Limbs from the least double to the largest, 2098 bits, and some room above.
const LIMBS: usize = 67;
/// The exponent of the least bit.
const LEAST: i32 = -1074;

/// An exact sum of doubles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExactSum {
    limbs: [i64; LIMBS],
    /// Terms that are not finite.
    strange: i64,
}

impl Default for ExactSum {
    fn default() -> Self {
        Self {
            limbs: [0; LIMBS],
            strange: 0,
        }
    }
}

impl ExactSum {
    /// Integers of a sum.
    pub const WORDS: usize = LIMBS + 1;

    /// Adds a term. After 2³⁰ of them, [`ExactSum::carry`] has to make room.
    pub fn add(&mut self, term: f64) {
        let bits = term.to_bits();
        let exponent = (bits >> 52) as usize & 0x7FF;
        let fraction = bits & ((1 << 52) - 1);
        if exponent == 0x7FF {
            self.strange += 1;
            return;
        }
        let (place, digits) = match exponent {
            0 => (0, fraction),
            e => (e - 1, fraction | 1 << 52),
        };
        let wide = u128::from(digits) << (place % BITS as usize);
        let first = place / BITS as usize;
        let sign = if bits >> 63 == 1 { -1 } else { 1 };
        for (k, limb) in self.limbs[first..first + 3].iter_mut().enumerate() {
            *limb += sign * i64::from((wide >> (k as u32 * BITS)) as u32);
        }
    }

    /// Adds another sum; as [`ExactSum::add`], at most 2³⁰ that have been carried.
    pub fn merge(&mut self, other: &Self) {
        self.strange += other.strange;
        for (own, other) in self.limbs.iter_mut().zip(&other.limbs) {
            *own += other;
        }
    }

    /// Makes room for more terms.
    pub fn carry(&mut self) {
        let mut carried = 0;
        for limb in &mut self.limbs[..LIMBS - 1] {
            let all = *limb + carried;
            carried = all >> BITS;
            *limb = all & ((1 << BITS) - 1);
        }
        self.limbs[LIMBS - 1] += carried;
    }

    /// The sum, rounded to the nearest double; not a number if a term was not finite.
    pub fn value(&self) -> f64 {
        if self.strange > 0 {
            return f64::NAN;
        }
        let mut size = self.clone();
        size.carry();
        let is_negative = size.limbs[LIMBS - 1] < 0;
        if is_negative {
            size.limbs.iter_mut().for_each(|limb| *limb = -*limb);
            size.carry();
        }
        let top = size
            .limbs
            .iter()
            .rposition(|limb| *limb != 0)
            .unwrap_or(0)
            .max(2);
        // three limbs have 65 bits at least, and one below them tells whether anything is left
        let high = size.limbs[top - 2..=top].iter().rev();
        let high = high.fold(0u128, |all, limb| all << BITS | *limb as u128);
        let rest = size.limbs[..top - 2].iter().any(|limb| *limb != 0);
        let digits = (high << 1 | u128::from(rest)) as f64;
        let power = LEAST - 1 + (BITS as usize * (top - 2)) as i32;
        // in two steps, each of which is a double
        let scaled = digits * 2f64.powi(power / 2) * 2f64.powi(power - power / 2);
        if is_negative { -scaled } else { scaled }
    }

    /// Appends its integers: those of sums are added number by number.
    pub fn extend(&mut self, words: &mut Vec<i64>) {
        self.carry();
        words.extend(&self.limbs);
        words.push(self.strange);
    }

    /// The sum of so many integers.
    ///
    /// # Panics
    /// If there are not [`ExactSum::WORDS`].
    pub fn of_words(words: &[i64]) -> Self {
        let (limbs, strange) = words.split_at(LIMBS);
        Self {
            limbs: limbs.try_into().expect("as many limbs"),
            strange: strange[0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(terms: impl IntoIterator<Item = f64>) -> ExactSum {
        let mut sum = ExactSum::default();
        terms.into_iter().for_each(|x| sum.add(x));
        sum
    }

    #[test]
    fn a_sum_is_exact_and_rounded_once() {
        let most = f64::MAX;
        let least = f64::from_bits(1);
        for (terms, wanted) in [
            (vec![], 0.0),
            (vec![0.1], 0.1),
            (vec![-0.1], -0.1),
            (vec![1e300, 1.0, -1e300], 1.0),
            (vec![1.0, 1e-300, -1.0, -1e-300, 3e-310], 3e-310),
            (vec![most, least, -most], least),
            (vec![most, -most, -least], -least),
            (vec![most], most),
            // half a unit in the last place goes to the even digit, and anything beyond it up
            (vec![1.0, f64::EPSILON / 2.0], 1.0),
            (vec![1.0, f64::EPSILON / 2.0, least], 1.0 + f64::EPSILON),
            (vec![-1.0, -f64::EPSILON / 2.0, -least], -1.0 - f64::EPSILON),
            (vec![3.0; 1000], 3000.0),
        ] {
            assert_eq!(sum(terms.clone()).value(), wanted, "{terms:?}");
        }
        assert!(sum([1.0, f64::INFINITY]).value().is_nan());
        assert!(sum([f64::NAN]).value().is_nan());
    }

    #[test]
    fn neither_order_nor_parts_change_a_bit() {
        let term = |k: i32| (f64::from(k) * 0.7).sin() * 10f64.powi(k % 37 - 18);
        let forward = sum((0..5000).map(term));
        let mut words = vec![0; ExactSum::WORDS];
        for part in 0..7 {
            let mut own = Vec::new();
            sum((0..5000).rev().filter(|k| k % 7 == part).map(term)).extend(&mut own);
            words
                .iter_mut()
                .zip(&own)
                .for_each(|(all, own)| *all += own);
        }
        assert_eq!(
            ExactSum::of_words(&words).value().to_bits(),
            forward.value().to_bits()
        );
        // the same of integers, which have an exact sum by other means
        let term = |k: i64| (k * k % 1_000_003 - 400_000) * (1 << (k % 20));
        let wanted: i64 = (0..5000).map(term).sum();
        let found = sum((0..5000).map(|k| term(k) as f64 / 1024.0)).value();
        assert_eq!(found, wanted as f64 / 1024.0);
    }
}
