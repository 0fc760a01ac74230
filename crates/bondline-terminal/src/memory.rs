//! The limit of memory, and the end of a run that exceeds it: a message and an exit status instead of an abort.
//!
//! Scenes that are too large are refused by their counts before anything is laid out (`run/budget.rs`). What is here catches what no count foresaw: large
//! allocations are added up, and where they exceed the limit, or the system gives no more, the program ends in order. Files are written beside their place and renamed, so none is left half written.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write as _;
use std::sync::atomic::{AtomicUsize, Ordering};

use bondline::run;

/// Exit status of a run that got no more memory.
pub const EXHAUSTED: u8 = 4;

/// Allocations of fewer bytes are not counted: together they are little beside fields, bonds and factors, and counting them would cost time.
const COUNTED: usize = 1 << 12;

/// Bytes of counted allocations.
static HELD: AtomicUsize = AtomicUsize::new(0);

/// The most that may be held.
static MOST: AtomicUsize = AtomicUsize::new(usize::MAX);

/// The system's allocator, but for what happens where there is nothing left.
pub struct Allocator;

// SAFETY: every call is passed to the system's allocator as it came, and what that returns is returned, unless it is null or exceeds the limit: then the
// program ends.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: the caller keeps the contract of `alloc`
        given(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: the caller keeps the contract of `alloc_zeroed`
        given(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        take(size);
        leave(layout.size());
        // SAFETY: the caller keeps the contract of `realloc`
        given(unsafe { System.realloc(pointer, layout, size) }, size)
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        leave(layout.size());
        // SAFETY: the caller keeps the contract of `dealloc`
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[inline]
fn take(size: usize) {
    if size >= COUNTED {
        let held = HELD.fetch_add(size, Ordering::Relaxed);
        if held.saturating_add(size) > MOST.load(Ordering::Relaxed) {
            exhausted(size);
        }
    }
}

#[inline]
fn leave(size: usize) {
    if size >= COUNTED {
        HELD.fetch_sub(size, Ordering::Relaxed);
    }
}

#[inline]
fn given(pointer: *mut u8, size: usize) -> *mut u8 {
    if pointer.is_null() {
        exhausted(size);
    }
    pointer
}

/// Ends the program. Nothing here allocates: standard error is not buffered, and numbers are written digit by digit.
#[cold]
fn exhausted(size: usize) -> ! {
    let _ = writeln!(
        std::io::stderr(),
        "  × memory is exhausted: {size} more bytes are not there; files are whole as far as they were written. Use a larger spacing, a smaller nonlocal \
         zone or fewer cells (`bondline check` counts them), or allow more by --memory"
    );
    std::process::exit(i32::from(EXHAUSTED));
}

/// Limits the memory of this program: to `typed` bytes, else to all that the machine has.
pub fn limit(typed: Option<u64>) {
    if let Some(bytes) = typed {
        run::set_memory_budget(bytes);
    }
    if let Some(bytes) = typed.or_else(installed) {
        MOST.store(
            usize::try_from(bytes).unwrap_or(usize::MAX),
            Ordering::Relaxed,
        );
    }
}

/// Bytes of memory and of what is swapped out, beyond which nothing can be held.
fn installed() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let of = |name: &str| -> Option<u64> {
        let line = text.lines().find_map(|l| l.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse().ok()
    };
    let machine = 1024 * (of("MemTotal:")? + of("SwapTotal:").unwrap_or(0));
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max");
    let group = group.ok().and_then(|text| text.trim().parse().ok());
    Some(group.map_or(machine, |group: u64| group.min(machine)))
}

/// Reads a size of memory \[bytes\]: 4GiB, 500MB, 1.5G.
///
/// # Errors
/// A message with the spelling that is understood.
pub fn size(text: &str) -> Result<u64, String> {
    let wrong = || format!("`{text}` is no size of memory; write 500MB, 4GiB or 1.5G");
    let trimmed = text.trim();
    let end = trimmed.find(|c: char| !(c.is_ascii_digit() || c == '.'));
    let (number, unit) = trimmed.split_at(end.unwrap_or(trimmed.len()));
    let factor = match unit.trim().to_ascii_lowercase().as_str() {
        "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        "k" | "kib" => 1024.0,
        "m" | "mib" => f64::from(1 << 20),
        "g" | "gib" => f64::from(1 << 30),
        "t" | "tib" => 1024.0 * f64::from(1 << 30),
        _ => return Err(wrong()),
    };
    let number: f64 = number.parse().map_err(|_| wrong())?;
    let bytes = number * factor;
    if (1.0..1e18).contains(&bytes) {
        Ok(bytes as u64)
    } else {
        Err(wrong())
    }
}

#[cfg(test)]
mod tests {
    use super::size;

    #[test]
    fn sizes_have_units() {
        assert_eq!(size("500MB"), Ok(500_000_000));
        assert_eq!(size("4 GiB"), Ok(4 << 30));
        assert_eq!(size("1.5g"), Ok(3 << 29));
        for wrong in ["4", "GiB", "-1GB", "0MB", "1e3MB", "9999999TiB", "1.2.3G"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}
