//! The functions of `c/shim.c`, each behind a safe one that checks lengths.

use std::ffi::{CStr, c_char, c_double, c_int, c_longlong, c_uint, c_ulonglong, c_void};
use std::ptr::{NonNull, null, null_mut};

/// A matrix with its solver, on the side of C.
#[repr(C)]
struct Bl {
    _private: [u8; 0],
}

/// A vector of PETSc.
#[repr(C)]
struct Vector {
    _private: [u8; 0],
}

unsafe extern "C" {
    fn bl_message() -> *const c_char;
    fn bl_start(rank: *mut c_int, size: *mut c_int, threads: *mut c_int) -> c_int;
    fn bl_stop() -> c_int;
    fn bl_abort(code: c_int);
    fn bl_counts(own: c_int, all: *mut c_int) -> c_int;
    fn bl_gather(
        own: *const c_double,
        n: c_int,
        all: *mut c_double,
        counts: *const c_int,
        starts: *const c_int,
    ) -> c_int;
    fn bl_gather_words(
        own: *const c_ulonglong,
        n: c_int,
        all: *mut c_ulonglong,
        counts: *const c_int,
        starts: *const c_int,
    ) -> c_int;
    fn bl_add(sums: *mut c_longlong, n: c_int) -> c_int;
    fn bl_parts(
        n: c_int,
        starts: *const c_int,
        neighbours: *const c_uint,
        parts: c_int,
        of: *mut c_uint,
    ) -> c_int;
    fn bl_ghosts(
        block: c_int,
        mine: c_int,
        n: c_int,
        wanted: *const c_longlong,
        out: *mut *mut Vector,
    ) -> c_int;
    fn bl_ghosts_begin(v: *mut Vector, own: *const c_double, n: c_int) -> c_int;
    fn bl_ghosts_end(v: *mut Vector, mine: c_int, wanted: *mut c_double, n: c_int) -> c_int;
    fn bl_ghosts_free(v: *mut Vector);
    fn bl_matrix(
        block: c_int,
        mine: c_int,
        own: *const c_int,
        other: *const c_int,
        symmetric: c_int,
        out: *mut *mut Bl,
    ) -> c_int;
    fn bl_row(
        s: *mut Bl,
        row: c_longlong,
        n: c_int,
        columns: *const c_longlong,
        strip: *const c_double,
    ) -> c_int;
    fn bl_shell(
        s: *mut Bl,
        product: extern "C" fn(*mut c_void, *const c_double, *mut c_double),
        of: *mut c_void,
    ) -> c_int;
    fn bl_finish(s: *mut Bl, xyz: *const c_double, direct: c_int, symmetric: c_int) -> c_int;
    fn bl_solve(
        s: *mut Bl,
        b: *const c_double,
        x: *mut c_double,
        tolerance: c_double,
        most: c_int,
        iterations: *mut c_int,
        why: *mut *const c_char,
    ) -> c_int;
    fn bl_free(s: *mut Bl);
}

/// Return value of `bl_parts` without PT-Scotch; no error code of PETSc is negative.
const NO_PARTITIONER: c_int = -1;

/// Turns a non-zero return code of PETSc or MPI into an error with its message.
fn told(code: c_int) -> Result<(), String> {
    if code == 0 {
        return Ok(());
    }
    // SAFETY: a static buffer that ends with a zero
    let text = unsafe { CStr::from_ptr(bl_message()) };
    Err(format!(
        "{} (error {code} of PETSc)",
        text.to_string_lossy()
    ))
}

/// A number as C's `int`; MPI 3 counts by these.
fn int(n: usize) -> Result<c_int, String> {
    c_int::try_from(n).map_err(|_| format!("{n} entries are more than MPI counts in one message"))
}

fn ints(numbers: &[usize]) -> Result<Vec<c_int>, String> {
    numbers.iter().map(|&n| int(n)).collect()
}

/// Starts MPI and PETSc: rank, count, and whether threads may call them, one at a time.
pub fn start() -> Result<(usize, usize, bool), String> {
    let (mut rank, mut size, mut threads) = (0, 0, 0);
    // SAFETY: three places to write to
    told(unsafe { bl_start(&raw mut rank, &raw mut size, &raw mut threads) })?;
    Ok((rank as usize, size as usize, threads != 0))
}

/// Ends PETSc and MPI.
pub fn stop() {
    // SAFETY: nothing is asked of either after this; the process ends whatever they say
    unsafe { bl_stop() };
}

/// The part of each vertex of a graph, by PT-Scotch in this process; a vertex weighs as much as it has neighbours and one.
pub fn parts_of_graph(
    starts: &[usize],
    neighbours: &[u32],
    count: usize,
) -> Result<Vec<u32>, String> {
    let vertices = starts.len() - 1;
    assert_eq!(starts[vertices], neighbours.len(), "neighbours of all");
    assert!(
        neighbours.iter().all(|&j| (j as usize) < vertices),
        "neighbours are vertices"
    );
    let starts = ints(starts)?;
    let mut of = vec![0; vertices];
    // SAFETY: lengths as C reads them, neighbours that are vertices
    let code = unsafe {
        bl_parts(
            int(vertices)?,
            starts.as_ptr(),
            neighbours.as_ptr(),
            int(count)?,
            of.as_mut_ptr(),
        )
    };
    if code == NO_PARTITIONER {
        return Err("PETSc was built without PT-Scotch".to_owned());
    }
    told(code)?;
    Ok(of)
}

/// Ends all processes of the job.
pub fn abort(code: u8) {
    // SAFETY: no arguments that could be wrong
    unsafe { bl_abort(c_int::from(code)) };
}

/// A number from each rank.
pub fn counts(own: usize, ranks: usize) -> Result<Vec<usize>, String> {
    let mut all = vec![0; ranks];
    // SAFETY: one place for each rank
    told(unsafe { bl_counts(int(own)?, all.as_mut_ptr()) })?;
    Ok(all.into_iter().map(|n| n as usize).collect())
}

/// The counts of a message and where each rank's part starts, if they add up to `all`.
fn parts(lengths: &[usize], all: usize) -> Result<(Vec<c_int>, Vec<c_int>), String> {
    let mut starts = Vec::with_capacity(lengths.len());
    let mut end = 0;
    for n in lengths {
        starts.push(end);
        end += n;
    }
    assert_eq!(end, all, "the parts of a message make its whole");
    Ok((ints(lengths)?, ints(&starts)?))
}

/// The numbers of all ranks.
pub fn gather(own: &[f64], lengths: &[usize], all: &mut [f64]) -> Result<(), String> {
    let (counts, starts) = parts(lengths, all.len())?;
    // SAFETY: `all` takes the sum of the counts
    told(unsafe {
        bl_gather(
            own.as_ptr(),
            int(own.len())?,
            all.as_mut_ptr(),
            counts.as_ptr(),
            starts.as_ptr(),
        )
    })
}

/// The words of all ranks.
pub fn gather_words(own: &[u64], lengths: &[usize]) -> Result<Vec<u64>, String> {
    let mut all = vec![0; lengths.iter().sum()];
    let (counts, starts) = parts(lengths, all.len())?;
    // SAFETY: `all` takes the sum of the counts
    told(unsafe {
        bl_gather_words(
            own.as_ptr(),
            int(own.len())?,
            all.as_mut_ptr(),
            counts.as_ptr(),
            starts.as_ptr(),
        )
    })?;
    Ok(all)
}

/// The sums over all ranks, number by number.
pub fn add(sums: &mut [i64]) -> Result<(), String> {
    // SAFETY: as many numbers as are told
    told(unsafe { bl_add(sums.as_mut_ptr(), int(sums.len())?) })
}

/// Numbers of this rank, and those of others that it wants.
#[derive(Debug)]
pub struct GhostVector {
    vector: NonNull<Vector>,
    own: usize,
    wanted: usize,
}

// SAFETY: PETSc is started for calls from any thread, one at a time, and whoever calls has the vector for itself
unsafe impl Send for GhostVector {}
// SAFETY: nothing is done by a shared reference
unsafe impl Sync for GhostVector {}

impl GhostVector {
    /// Of `own` blocks of this rank, and of others by their numbers over all ranks.
    pub fn new(own: usize, wanted: &[u64], block: usize) -> Result<Self, String> {
        let wanted: Vec<c_longlong> = wanted.iter().map(|n| n.cast_signed()).collect();
        let mut out = null_mut();
        // SAFETY: as many numbers as are told
        told(unsafe {
            bl_ghosts(
                int(block)?,
                int(own)?,
                int(wanted.len())?,
                wanted.as_ptr(),
                &raw mut out,
            )
        })?;
        Ok(Self {
            vector: NonNull::new(out).ok_or("no memory for a vector")?,
            own: own * block,
            wanted: wanted.len() * block,
        })
    }

    /// Sends the own numbers.
    pub fn begin(&mut self, own: &[f64]) -> Result<(), String> {
        assert_eq!(own.len(), self.own, "numbers of this rank");
        // SAFETY: the vector has as many numbers of this rank
        told(unsafe { bl_ghosts_begin(self.vector.as_ptr(), own.as_ptr(), int(own.len())?) })
    }

    /// Receives the wanted ones.
    pub fn end(&mut self, wanted: &mut [f64]) -> Result<(), String> {
        assert_eq!(wanted.len(), self.wanted, "numbers of other ranks");
        let (own, count) = (int(self.own)?, int(wanted.len())?);
        // SAFETY: the vector has as many numbers of this rank, and of others after them
        told(unsafe { bl_ghosts_end(self.vector.as_ptr(), own, wanted.as_mut_ptr(), count) })
    }
}

impl Drop for GhostVector {
    fn drop(&mut self) {
        // SAFETY: made by `new`, freed once, before PETSc is stopped
        unsafe { bl_ghosts_free(self.vector.as_ptr()) };
    }
}

/// Overwrites the second with the own rows times the first, numbers of this rank; collective.
pub type Product<'a> = dyn FnMut(&[f64], &mut [f64]) + Send + 'a;

/// Matrix–vector product that PETSc calls.
struct Callback<'a> {
    dofs: usize,
    product: Box<Product<'a>>,
}

extern "C" fn multiply(of: *mut c_void, x: *const c_double, y: *mut c_double) {
    // SAFETY: `of` is the callback that its system keeps, and nobody else uses it while PETSc solves
    let callback = unsafe { &mut *of.cast::<Callback<'_>>() };
    // SAFETY: vectors of the shell have as many numbers of this rank
    let x = unsafe { std::slice::from_raw_parts(x, callback.dofs) };
    // SAFETY: as `x`, and another vector
    let y = unsafe { std::slice::from_raw_parts_mut(y, callback.dofs) };
    (callback.product)(x, y);
}

/// A matrix with its solver.
pub struct System<'a> {
    bl: NonNull<Bl>,
    /// Made by `Box::into_raw`: PETSc has the address.
    callback: Option<NonNull<Callback<'a>>>,
    /// Numbers of this rank.
    dofs: usize,
    rows: usize,
    block: usize,
}

// SAFETY: PETSc's objects belong to no thread, and MPI is started so that any thread may call it; `&mut self` lets one at a time
unsafe impl Send for System<'_> {}

impl<'a> System<'a> {
    /// A matrix of blocks with so many entries in each row, in columns of this rank and of others.
    pub fn new(
        block: usize,
        own: &[usize],
        other: &[usize],
        symmetric: bool,
    ) -> Result<Self, String> {
        assert_eq!(own.len(), other.len(), "two counts for each row");
        let (own, other) = (ints(own)?, ints(other)?);
        let mut out = null_mut();
        // SAFETY: both lists have one entry per row
        let code = unsafe {
            bl_matrix(
                int(block)?,
                int(own.len())?,
                own.as_ptr(),
                other.as_ptr(),
                c_int::from(symmetric),
                &raw mut out,
            )
        };
        let bl = NonNull::new(out).ok_or("no memory for a matrix")?;
        let system = Self {
            bl,
            callback: None,
            dofs: block * own.len(),
            rows: own.len(),
            block,
        };
        told(code)?;
        Ok(system)
    }

    /// Sets a block row of the whole matrix; `strip` has a row of numbers for each unknown of the site.
    pub fn set_row(&mut self, row: u32, columns: &[i64], strip: &[f64]) -> Result<(), String> {
        assert_eq!(
            strip.len(),
            self.block * self.block * columns.len(),
            "a block for each column"
        );
        // SAFETY: lengths as C reads them
        told(unsafe {
            bl_row(
                self.bl.as_ptr(),
                c_longlong::from(row),
                int(columns.len())?,
                columns.as_ptr(),
                strip.as_ptr(),
            )
        })
    }

    /// Solves with a product, and preconditions with the matrix.
    pub fn multiply_by(&mut self, product: Box<Product<'a>>) -> Result<(), String> {
        assert!(self.callback.is_none(), "one product");
        let dofs = self.dofs;
        let callback = Box::into_raw(Box::new(Callback { dofs, product }));
        self.callback = NonNull::new(callback);
        // SAFETY: the callback lives until the matrix is freed
        told(unsafe { bl_shell(self.bl.as_ptr(), multiply, callback.cast()) })
    }

    /// Ends the matrix and sets its solver up; `xyz` has the coordinates of the own sites, as many as unknowns.
    pub fn finish(&mut self, xyz: &[f64], direct: bool, symmetric: bool) -> Result<(), String> {
        assert_eq!(xyz.len(), self.dofs, "coordinates of {} sites", self.rows);
        // SAFETY: a coordinate for each unknown
        told(unsafe {
            bl_finish(
                self.bl.as_ptr(),
                xyz.as_ptr(),
                c_int::from(direct),
                c_int::from(symmetric),
            )
        })
    }

    /// Solves; the iterations, and why it did not converge, if it did not.
    pub fn solve(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
        most: usize,
    ) -> Result<(usize, Option<String>), String> {
        assert_eq!(
            [b.len(), x.len()],
            [self.dofs; 2],
            "numbers of the own sites"
        );
        let (mut iterations, mut why) = (0, null());
        // SAFETY: both vectors have the length of the rows
        told(unsafe {
            bl_solve(
                self.bl.as_ptr(),
                b.as_ptr(),
                x.as_mut_ptr(),
                tolerance,
                int(most)?,
                &raw mut iterations,
                &raw mut why,
            )
        })?;
        let why = (!why.is_null()).then(|| {
            // SAFETY: a static text of PETSc
            let text = unsafe { CStr::from_ptr(why) };
            text.to_string_lossy().into_owned()
        });
        Ok((iterations as usize, why))
    }
}

impl Drop for System<'_> {
    fn drop(&mut self) {
        // SAFETY: made by `new`, freed once
        unsafe { bl_free(self.bl.as_ptr()) };
        if let Some(callback) = self.callback {
            // SAFETY: made by `Box::into_raw`, and PETSc no longer has it
            drop(unsafe { Box::from_raw(callback.as_ptr()) });
        }
    }
}
