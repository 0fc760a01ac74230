//! Parallel loops whose machinery is compiled once for each type of item.
//!
//! rayon compiles its splitting of work anew for each closure that it is given, and the closure itself several times within: where code is generic over the dimension, the
//! law and the kind of pass, one loop came to dozens of copies, and all of them to a fifth of the program. Here the closure is called through a pointer. That costs a
//! nanosecond for each item: a loop over single numbers goes by chunks of them.
//!
//! `at_least` is the least number of items of a task, one where nothing is gained by more. Where tasks end depends on the threads that are free, so that no result may.

use rayon::iter::{
    FromParallelIterator, IndexedParallelIterator, IntoParallelIterator,
    IntoParallelRefMutIterator, MinLen, ParallelIterator,
};
use rayon::slice::ParallelSliceMut;

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
    let chunks = values.par_chunks_mut(size).enumerate();
    for_each(chunks.with_min_len(at_least), |(k, chunk)| body(k, chunk));
}

/// Calls `body` with the number of each value and the value.
#[inline]
pub(crate) fn for_each_mut<A: Send>(
    values: &mut [A],
    at_least: usize,
    body: impl Fn(usize, &mut A) + Sync,
) {
    let all = values.par_iter_mut().enumerate();
    for_each(all.with_min_len(at_least), |(k, value)| body(k, value));
}

/// Calls `body` with the number of each task and the task.
#[inline]
pub(crate) fn for_each_task<T: Send>(
    tasks: Vec<T>,
    at_least: usize,
    body: impl Fn(usize, T) + Sync,
) {
    let all = tasks.into_par_iter().enumerate();
    for_each(all.with_min_len(at_least), |(k, task)| body(k, task));
}

fn numbers(count: usize, at_least: usize) -> MinLen<rayon::range::Iter<usize>> {
    (0..count).into_par_iter().with_min_len(at_least)
}

/// `of` each number below `count`, in their order.
#[inline]
pub(crate) fn map<T: Send>(
    count: usize,
    at_least: usize,
    of: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    mapped(numbers(count, at_least), &of)
}

/// `of` each value, in their order.
#[inline]
pub(crate) fn map_slice<'a, A: Sync, T: Send>(
    values: &'a [A],
    of: impl Fn(&'a A) -> T + Sync,
) -> Vec<T> {
    map(values.len(), 1, |k| of(&values[k]))
}

/// `of` each number below `count`, in their order, with what `new` makes for each task.
#[inline]
pub(crate) fn map_with<S, T: Send>(
    count: usize,
    at_least: usize,
    new: impl Fn() -> S + Sync,
    of: impl Fn(&mut S, usize) -> T + Sync,
) -> Vec<T> {
    mapped_with(numbers(count, at_least), &new, &of)
}

#[inline(never)]
fn mapped_with<S, T: Send>(
    numbers: MinLen<rayon::range::Iter<usize>>,
    new: &(dyn Fn() -> S + Sync),
    of: &(dyn Fn(&mut S, usize) -> T + Sync),
) -> Vec<T> {
    numbers.map_init(new, of).collect()
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
    tried(numbers(count, at_least), &of)
}

#[inline(never)]
fn tried<T: Send, E: Send>(
    numbers: MinLen<rayon::range::Iter<usize>>,
    of: &(dyn Fn(usize) -> Result<T, E> + Sync),
) -> Result<Vec<T>, E> {
    numbers.map(of).collect()
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

/// What `of` finds for numbers below `count`, in their order.
#[inline]
pub(crate) fn filter_map<T: Send>(
    count: usize,
    at_least: usize,
    of: impl Fn(usize) -> Option<T> + Sync,
) -> Vec<T> {
    filtered(numbers(count, at_least), &of)
}

#[inline(never)]
fn filtered<T: Send>(
    numbers: MinLen<rayon::range::Iter<usize>>,
    of: &(dyn Fn(usize) -> Option<T> + Sync),
) -> Vec<T> {
    numbers.filter_map(of).collect()
}

/// What `add` adds to a list for the numbers below `count`, in their order.
#[inline]
pub(crate) fn listed<T: Send>(
    count: usize,
    at_least: usize,
    add: impl Fn(usize, &mut Vec<T>) + Sync,
) -> Vec<T> {
    all_listed(numbers(count, at_least), &add)
}

#[inline(never)]
fn all_listed<T: Send>(
    numbers: MinLen<rayon::range::Iter<usize>>,
    add: &(dyn Fn(usize, &mut Vec<T>) + Sync),
) -> Vec<T> {
    let lists = numbers.fold(Vec::new, |mut list, k| {
        add(k, &mut list);
        list
    });
    // a list without an entry takes no memory
    lists.reduce(Vec::new, |mut all, more| {
        all.extend(more);
        all
    })
}

/// What `of` finds for the first number below `count` for which it finds something.
#[inline]
pub(crate) fn find_first<T: Send>(
    count: usize,
    at_least: usize,
    of: impl Fn(usize) -> Option<T> + Sync,
) -> Option<T> {
    found_first(numbers(count, at_least), &of)
}

#[inline(never)]
fn found_first<T: Send>(
    numbers: MinLen<rayon::range::Iter<usize>>,
    of: &(dyn Fn(usize) -> Option<T> + Sync),
) -> Option<T> {
    numbers.find_map_first(of)
}

/// Whether all numbers below `count` are as asked.
#[inline]
pub(crate) fn all(count: usize, at_least: usize, is: impl Fn(usize) -> bool + Sync) -> bool {
    are_all(numbers(count, at_least), &is)
}

#[inline(never)]
fn are_all(
    numbers: MinLen<rayon::range::Iter<usize>>,
    is: &(dyn Fn(usize) -> bool + Sync),
) -> bool {
    numbers.all(is)
}

#[cfg(test)]
mod tests {
    use super::*;

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
