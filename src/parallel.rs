//! Parallel loops whose machinery is compiled once.
//!
//! rayon compiles its splitting of work anew for each closure that it is given, for each type of item, and the closure itself several times within: where code is
//! generic over the dimension, the law and the kind of pass, one loop came to dozens of copies, and all of them to a fifth of the program. Here one function splits
//! a range of numbers, as rayon splits its own, and calls what a loop does with each part through a pointer. Loops over several slices at once
//! ([`for_each`], [`for_each_with`], [`map_each`], [`list_each`], [`try_map_with`]) are rayon's, compiled once for each type of item.
//!
//! `at_least` is the least number of items of a task, one where nothing is gained by more. Where tasks end depends on the threads that are free, so that no result may.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::iter::{FromParallelIterator, IndexedParallelIterator, ParallelIterator};

/// Calls `body` with parts of the numbers below `count`, each number in one of them.
#[inline(never)]
fn for_parts(count: usize, at_least: usize, body: &(dyn Fn(Range<usize>) + Sync)) {
    let parts = rayon::current_num_threads();
    halve(0..count, (at_least.max(1), parts), false, body);
}

/// As rayon's own loops: a part is halved until there are as many as threads, and again where another thread has taken it.
fn halve(
    numbers: Range<usize>,
    (at_least, parts): (usize, usize),
    is_taken: bool,
    body: &(dyn Fn(Range<usize>) + Sync),
) {
    let half = numbers.len() / 2;
    if half < at_least || (parts == 0 && !is_taken) {
        if !numbers.is_empty() {
            body(numbers);
        }
        return;
    }
    let parts = match is_taken {
        true => (parts / 2).max(rayon::current_num_threads()),
        false => parts / 2,
    };
    let (first, middle, last) = (numbers.start, numbers.start + half, numbers.end);
    let both = (at_least, parts);
    rayon::join_context(
        |left| halve(first..middle, both, left.migrated(), body),
        |right| halve(middle..last, both, right.migrated(), body),
    );
}

/// Collects the items that `fill` adds to lists for parts of the numbers below `count`, in their order.
fn gathered<T: Send>(
    count: usize,
    at_least: usize,
    fill: &(dyn Fn(Range<usize>, &mut Vec<T>) + Sync),
) -> Vec<T> {
    let lists: Mutex<Vec<(usize, Vec<T>)>> = Mutex::default();
    for_parts(count, at_least, &|numbers| {
        let (first, mut list) = (numbers.start, Vec::new());
        fill(numbers, &mut list);
        // a list without an entry takes no memory
        if !list.is_empty() {
            let mut lists = lists.lock().unwrap_or_else(PoisonError::into_inner);
            // in its place, for a sort is compiled for each type of item
            let at = lists.partition_point(|(other, _)| *other < first);
            lists.insert(at, (first, list));
        }
    });
    let lists = lists.into_inner().unwrap_or_else(PoisonError::into_inner);
    let total: usize = lists.iter().map(|(_, list)| list.len()).sum();
    let mut lists = lists.into_iter().map(|(_, list)| list);
    let mut all = lists.next().unwrap_or_default();
    all.reserve_exact(total - all.len());
    lists.for_each(|list| all.extend(list));
    all
}

/// Loops whose tasks write to places of their own, without waiting for each other.
// what makes a place belong to one task is that each number is in one part
#[allow(unsafe_code)]
mod places {
    use super::for_parts;

    /// Memory of the values of the numbers below a count, each for the task that has its number.
    struct Places<T>(*mut T);

    // SAFETY: each value is used by one thread at a time, as if it had been sent there
    unsafe impl<T: Send> Sync for Places<T> {}

    impl<T> Places<T> {
        /// The place of a value. By a method: closures would take the pointer alone, which is not to be shared.
        ///
        /// # Safety
        /// There are more than `k` values.
        unsafe fn of(&self, k: usize) -> *mut T {
            // SAFETY: as the caller promises
            unsafe { self.0.add(k) }
        }
    }

    /// `of` each number below `count`, in their order, with what `new` makes for each task. Values that are there when a task panics are not dropped.
    #[inline]
    pub(crate) fn map_with<S, T: Send>(
        count: usize,
        at_least: usize,
        new: impl Fn() -> S + Sync,
        of: impl Fn(&mut S, usize) -> T + Sync,
    ) -> Vec<T> {
        let mut all: Vec<T> = Vec::with_capacity(count);
        let places = Places(all.as_mut_ptr());
        for_parts(count, at_least, &|numbers| {
            let mut own = new();
            for k in numbers {
                let value = of(&mut own, k);
                // SAFETY: k is below the capacity, and in one part
                unsafe { places.of(k).write(value) };
            }
        });
        // SAFETY: all parts together are all numbers
        unsafe { all.set_len(count) };
        all
    }

    /// Calls `body` with the number of each chunk of `size` values, the last of which may be shorter, and the chunk.
    ///
    /// # Panics
    /// For chunks without a value.
    #[inline]
    pub(crate) fn for_each_chunk<A: Send>(
        values: &mut [A],
        size: usize,
        at_least: usize,
        body: impl Fn(usize, &mut [A]) + Sync,
    ) {
        let count = values.len();
        let places = Places(values.as_mut_ptr());
        for_parts(count.div_ceil(size), at_least, &|chunks| {
            for k in chunks {
                let (first, size) = (k * size, size.min(count - k * size));
                // SAFETY: chunks lie within the values and do not overlap, and each is in one part
                body(k, unsafe {
                    std::slice::from_raw_parts_mut(places.of(first), size)
                });
            }
        });
    }

    /// Calls `body` with the number of each task and the task. Tasks that are left when one panics are not dropped.
    #[inline]
    pub(crate) fn for_each_task<T: Send>(
        mut tasks: Vec<T>,
        at_least: usize,
        body: impl Fn(usize, T) + Sync,
    ) {
        let count = tasks.len();
        // SAFETY: from here on a task belongs to the part that has its number
        unsafe { tasks.set_len(0) };
        let places = Places(tasks.as_mut_ptr());
        for_parts(count, at_least, &|numbers| {
            for k in numbers {
                // SAFETY: k is below the count, and in one part
                body(k, unsafe { places.of(k).read() });
            }
        });
    }
}

pub(crate) use places::{for_each_chunk, for_each_task, map_with};

/// Calls `body` with the number of each value and the value.
#[inline]
pub(crate) fn for_each_mut<A: Send>(
    values: &mut [A],
    at_least: usize,
    body: impl Fn(usize, &mut A) + Sync,
) {
    for_each_chunk(values, 1, at_least, |k, value| body(k, &mut value[0]));
}

/// `of` each number below `count`, in their order.
#[inline]
pub(crate) fn map<T: Send>(
    count: usize,
    at_least: usize,
    of: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    map_with(count, at_least, || (), |(), k| of(k))
}

/// `of` each value, in their order.
#[inline]
pub(crate) fn map_slice<'a, A: Sync, T: Send>(
    values: &'a [A],
    of: impl Fn(&'a A) -> T + Sync,
) -> Vec<T> {
    map(values.len(), 1, |k| of(&values[k]))
}

/// `of` the number of each chunk of `size` values, the last of which may be shorter, and the chunk, in their order.
#[inline]
pub(crate) fn map_chunks<'a, A: Sync, T: Send>(
    values: &'a [A],
    size: usize,
    of: impl Fn(usize, &'a [A]) -> T + Sync,
) -> Vec<T> {
    let count = values.len();
    map(count.div_ceil(size), 1, |k| {
        of(k, &values[k * size..count.min((k + 1) * size)])
    })
}

/// `of` each number below `count`, in their order.
///
/// # Errors
/// One of those of `of`; not always the same where there are several.
#[inline]
pub(crate) fn try_map<T: Send, E: Send>(
    count: usize,
    at_least: usize,
    of: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let has_failed = AtomicBool::new(false);
    let error = Mutex::new(None);
    let all = gathered(count, at_least, &|numbers, list| {
        list.reserve_exact(numbers.len());
        for k in numbers {
            if has_failed.load(Ordering::Relaxed) {
                return;
            }
            match of(k) {
                Ok(value) => list.push(value),
                Err(e) => {
                    has_failed.store(true, Ordering::Relaxed);
                    *error.lock().unwrap_or_else(PoisonError::into_inner) = Some(e);
                }
            }
        }
    });
    match error.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(e) => Err(e),
        None => Ok(all),
    }
}

/// Collects the values that `of` finds for numbers below `count`, in their order.
#[inline]
pub(crate) fn filter_map<T: Send>(
    count: usize,
    at_least: usize,
    of: impl Fn(usize) -> Option<T> + Sync,
) -> Vec<T> {
    gathered(count, at_least, &|numbers, list| {
        list.extend(numbers.filter_map(&of));
    })
}

/// Collects the items that `add` adds to a list for the numbers below `count`, in their order.
#[inline]
pub(crate) fn listed<T: Send>(
    count: usize,
    at_least: usize,
    add: impl Fn(usize, &mut Vec<T>) + Sync,
) -> Vec<T> {
    gathered(count, at_least, &|numbers, list| {
        for k in numbers {
            add(k, list);
        }
    })
}

/// Returns the value that `of` finds for the first number below `count` for which it finds one.
#[inline]
pub(crate) fn find_first<T: Send>(
    count: usize,
    at_least: usize,
    of: impl Fn(usize) -> Option<T> + Sync,
) -> Option<T> {
    let first = AtomicUsize::new(usize::MAX);
    let found: Mutex<Option<(usize, T)>> = Mutex::new(None);
    for_parts(count, at_least, &|mut numbers| {
        let mut sought = numbers
            .by_ref()
            .take_while(|k| *k < first.load(Ordering::Relaxed));
        if let Some((k, value)) = sought.find_map(|k| of(k).map(|value| (k, value))) {
            first.fetch_min(k, Ordering::Relaxed);
            let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
            if found.as_ref().is_none_or(|(other, _)| k < *other) {
                *found = Some((k, value));
            }
        }
    });
    let found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    found.map(|(_, value)| value)
}

/// Returns true if `is` holds for all numbers below `count`.
#[inline]
pub(crate) fn all(count: usize, at_least: usize, is: impl Fn(usize) -> bool + Sync) -> bool {
    let are = AtomicBool::new(true);
    for_parts(count, at_least, &|mut numbers| {
        if !numbers.all(|k| are.load(Ordering::Relaxed) && is(k)) {
            are.store(false, Ordering::Relaxed);
        }
    });
    are.into_inner()
}

/// Calls `body` with each item of what rayon iterates over.
#[inline]
pub(crate) fn for_each<I: ParallelIterator>(items: I, body: impl Fn(I::Item) + Sync) {
    each(items, &body);
}

#[inline(never)]
fn each<I: ParallelIterator>(items: I, body: &(dyn Fn(I::Item) + Sync)) {
    items.for_each(body);
}

/// Calls `body` with each item of what rayon iterates over, and what `new` makes for each task.
#[inline]
pub(crate) fn for_each_with<I: ParallelIterator, S>(
    items: I,
    new: impl Fn() -> S + Sync,
    body: impl Fn(&mut S, I::Item) + Sync,
) {
    each_with(items, &new, &body);
}

#[inline(never)]
fn each_with<I: ParallelIterator, S>(
    items: I,
    new: &(dyn Fn() -> S + Sync),
    body: &(dyn Fn(&mut S, I::Item) + Sync),
) {
    items.for_each_init(new, body);
}

/// `of` each item of what rayon iterates over, in the order of the items.
#[inline]
pub(crate) fn map_each<I, T>(items: I, of: impl Fn(I::Item) -> T + Sync) -> Vec<T>
where
    I: IndexedParallelIterator,
    T: Send,
{
    mapped(items, &of)
}

#[inline(never)]
fn mapped<I, T>(items: I, of: &(dyn Fn(I::Item) -> T + Sync)) -> Vec<T>
where
    I: IndexedParallelIterator,
    T: Send,
{
    items.map(of).collect()
}

/// The lists that `of` gives for what rayon iterates over, one after another in the order of the items.
#[inline]
pub(crate) fn list_each<I, T>(items: I, of: impl Fn(I::Item) -> Vec<T> + Sync) -> Vec<T>
where
    I: ParallelIterator,
    T: Send,
{
    concatenated(items, &of)
}

#[inline(never)]
fn concatenated<I, T>(items: I, of: &(dyn Fn(I::Item) -> Vec<T> + Sync)) -> Vec<T>
where
    I: ParallelIterator,
    T: Send,
{
    // a list without an entry takes no memory
    items.map(of).reduce(Vec::new, |mut all, more| {
        all.extend(more);
        all
    })
}

/// `of` each item of what rayon iterates over, in their order, with what `new` makes for each task.
///
/// # Errors
/// One of those of `of`; not always the same where there are several.
#[inline]
pub(crate) fn try_map_with<I, S, T, E>(
    items: I,
    new: impl Fn() -> S + Sync,
    of: impl Fn(&mut S, I::Item) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E>
where
    I: IndexedParallelIterator,
    T: Send,
    E: Send,
{
    tried_with(items, &new, &of)
}

#[inline(never)]
fn tried_with<I, S, R, C>(
    items: I,
    new: &(dyn Fn() -> S + Sync),
    of: &(dyn Fn(&mut S, I::Item) -> R + Sync),
) -> C
where
    I: IndexedParallelIterator,
    R: Send,
    C: FromParallelIterator<R>,
{
    items.map_init(new, of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    const COUNT: usize = 1000;

    #[test]
    fn results_come_in_the_order_of_what_they_are_of() {
        let odd = |k: usize| (k % 2 == 1).then_some(3 * k);
        let odds: Vec<usize> = (0..COUNT).filter_map(odd).collect();
        assert_eq!(filter_map(COUNT, 7, odd), odds);
        let add = |k: usize, list: &mut Vec<usize>| list.extend(odd(k));
        assert_eq!(listed(COUNT, 1, add), odds);
        let list = |k: usize| odd(k).into_iter().collect();
        assert_eq!(list_each((0..COUNT).into_par_iter(), list), odds);
        let square = |k: usize| k * k;
        let squares: Vec<usize> = (0..COUNT).map(square).collect();
        assert_eq!(map(COUNT, 1, square), squares);
        assert_eq!(map_slice(&squares, |k| k + 1)[30], 901);
        assert_eq!(map_with(COUNT, 16, || 0, |_, k| square(k)), squares);
        assert_eq!(find_first(COUNT, 1, |k| (k > 10).then_some(k)), Some(11));
        let below = |least: usize| move |k: usize| if k < least { Ok(k) } else { Err(k) };
        assert_eq!(
            try_map(COUNT, 1, below(COUNT)).map(|all| all.len()),
            Ok(COUNT)
        );
        assert!(try_map(COUNT, 1, below(10)).is_err());
        assert!(all(COUNT, 1, |k| k < COUNT) && !all(COUNT, 1, |k| k != 500));
    }

    #[test]
    fn chunks_and_values_come_with_their_numbers() {
        let mut values = vec![0; COUNT];
        for_each_chunk(&mut values, 3, 2, |chunk, values| values.fill(chunk));
        assert!(values.iter().enumerate().all(|(k, value)| *value == k / 3));
        for_each_mut(&mut values, 1, |k, value| *value += k);
        assert!(
            values
                .iter()
                .enumerate()
                .all(|(k, value)| *value == k / 3 + k)
        );
        let tasks: Vec<_> = values.iter_mut().collect();
        for_each_task(tasks, 8, |k, value| *value -= k);
        assert_eq!(values[COUNT - 1], (COUNT - 1) / 3);
    }
}
