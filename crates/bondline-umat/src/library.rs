//! A routine of a compiled library with the calling convention of Abaqus' UMAT, and the call.
//!
//! Arguments are those of the Abaqus User Subroutines Reference Guide, section UMAT, all by reference; Fortran passes the length of `CMNAME` by value behind them, and a routine in C does not look at it.

use std::{
    ffi::{c_char, c_int},
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicI32, Ordering},
    },
};

use bondline::material::RoutineError;

/// Names that compilers give to `SUBROUTINE UMAT`.
const USUAL: [&str; 3] = ["umat_", "umat", "UMAT"];

/// The flag that `XIT` of `umat/abaqus_utilities.c` raises.
const FLAG: &str = "bondline_umat_failed";

/// Length of `CMNAME`.
const NAME: usize = 80;

type Reals = *mut f64;
type Integers = *const c_int;
/// `UMAT(STRESS, STATEV, DDSDDE, SSE, SPD, SCD, RPL, DDSDDT, DRPLDE, DRPLDT, STRAN, DSTRAN, TIME, DTIME, TEMP, DTEMP, PREDEF, DPRED, CMNAME, NDI, NSHR, NTENS, NSTATV, PROPS, NPROPS, COORDS, DROT, PNEWDT, CELENT, DFGRD0, DFGRD1, NOEL, NPT, LAYER, KSPT, JSTEP, KINC)`.
type UserRoutine = unsafe extern "C" fn(
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    *const c_char,
    Integers,
    Integers,
    Integers,
    Integers,
    Reals,
    Integers,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Reals,
    Integers,
    Integers,
    Integers,
    Integers,
    Integers,
    Integers,
    usize,
);

/// Held by every call that is not known to keep no common state: routines of one library share their `COMMON` blocks, whatever material calls them.
static CALLS: Mutex<()> = Mutex::new(());

/// A user's routine.
#[derive(Clone, Debug)]
pub struct Routine {
    entry: UserRoutine,
    flag: Option<&'static AtomicI32>,
    symbol: String,
    path: PathBuf,
}

/// Arguments and results of a call; stresses and strains in the order 11, 22, 33, 12, 13, 23, shears those of engineering, tensors by columns.
pub(crate) struct Call<'a> {
    /// `STRESS` \[Pa\], Cauchy.
    pub stress: [f64; 6],
    /// `STATEV`.
    pub state: &'a mut [f64],
    /// `SSE`, `SPD`, `SCD` \[J/m³\].
    pub energies: [f64; 3],
    /// `STRAN`.
    pub strain: [f64; 6],
    /// `DSTRAN`.
    pub change: [f64; 6],
    /// `TIME` \[s\], of the step and of the run alike.
    pub time: f64,
    /// `DTIME` \[s\].
    pub step: f64,
    /// `TEMP`.
    pub temperature: f64,
    /// `CMNAME`.
    pub name: &'a str,
    /// `PROPS`.
    pub constants: &'a [f64],
    /// `DROT`.
    pub rotation: [f64; 9],
    /// `CELENT` \[m\].
    pub length: f64,
    /// `DFGRD0`, `DFGRD1`.
    pub deformation: [[f64; 9]; 2],
    /// The third entry of `JSTEP`: whether deformations are large.
    pub is_large: bool,
    /// `KINC`.
    pub increment: i32,
    /// `DDSDDE` \[Pa\], by columns; zero before the call.
    pub tangent: [f64; 36],
    /// `PNEWDT`; below 1 the routine wants a smaller step.
    pub wanted_step: f64,
}

impl Routine {
    /// Loads a library, for the rest of the program's life: runtimes of Fortran cannot be unloaded safely. Without a `symbol` the usual names of `SUBROUTINE UMAT` are tried.
    ///
    /// # Errors
    /// [`RoutineError`] if the library cannot be loaded or has no such routine.
    pub fn load(path: &Path, symbol: Option<&str>) -> Result<Self, RoutineError> {
        let failed = |message: String| RoutineError::Library {
            path: path.to_path_buf(),
            message,
        };
        // a bare name would be looked for in the system's folders
        let whole = std::path::absolute(path).map_err(|e| failed(e.to_string()))?;
        // SAFETY: what a library does when it is loaded cannot be known; the scene names it, and docs/umat.md says that it is trusted
        let library = unsafe { libloading::Library::new(&whole) }.map_err(|error| {
            let why = std::error::Error::source(&error);
            failed(why.map_or_else(|| error.to_string(), ToString::to_string))
        })?;
        let tried: Vec<String> = match symbol {
            Some(symbol) => vec![symbol.to_owned()],
            None => USUAL.map(str::to_owned).to_vec(),
        };
        // SAFETY: the routine has the arguments of UMAT, as the scene says by naming it
        let found = tried.iter().find_map(|name| {
            let entry = unsafe { library.get::<UserRoutine>(name.as_bytes()) };
            entry.ok().map(|entry| (*entry, name.clone()))
        });
        // SAFETY: `umat/abaqus_utilities.c` declares it as an int of C, and the library stays
        let flag = unsafe {
            let flag = library.get::<*mut i32>(FLAG.as_bytes());
            flag.ok().map(|flag| AtomicI32::from_ptr(*flag))
        };
        std::mem::forget(library);
        if let Some(flag) = flag {
            flag.store(0, Ordering::Relaxed);
        }
        let (entry, symbol) = found.ok_or_else(|| RoutineError::Symbol {
            path: path.to_path_buf(),
            tried,
        })?;
        Ok(Self {
            entry,
            flag,
            symbol,
            path: path.to_path_buf(),
        })
    }

    /// Its name in the library.
    pub fn symbol(&self) -> &str {
        &self.symbol
    }

    /// The library.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns true if the routine has called `XIT`.
    pub(crate) fn has_given_up(&self) -> bool {
        self.flag
            .is_some_and(|flag| flag.load(Ordering::Relaxed) != 0)
    }

    /// Calls the routine; `is_alone` keeps all others out meanwhile.
    pub(crate) fn call(&self, call: &mut Call<'_>, is_alone: bool) {
        let mut name = [b' '; NAME];
        for (to, from) in name.iter_mut().zip(call.name.bytes()) {
            *to = from.to_ascii_uppercase();
        }
        // a routine may write where it should not: what is ours is copied
        let mut constants = call.constants.to_vec();
        let mut thermal = [[0.0; 6]; 2];
        let (mut heat, mut heat_rate, mut warming) = (0.0, 0.0, 0.0);
        let mut time = [call.time; 2];
        let (mut fields, mut field_changes) = ([0.0], [0.0]);
        // the law does not know its place
        let mut place = [f64::NAN; 3];
        let (axial, shear, all, one): (c_int, c_int, c_int, c_int) = (3, 3, 6, 1);
        let (states, count) = (call.state.len() as c_int, constants.len() as c_int);
        // step 1, a static procedure, large deformations, no perturbation
        let step: [c_int; 4] = [1, 1, c_int::from(call.is_large), 0];
        let increment: c_int = call.increment;
        let [stored, plastic, creep] = &mut call.energies;
        let [before, after] = &mut call.deformation;
        let _alone = is_alone.then(|| CALLS.lock().unwrap_or_else(PoisonError::into_inner));
        // SAFETY: every pointer is to as many numbers as NTENS, NSTATV, NPROPS and the convention say, all of them live and, but for integers and the name, our own to be written to
        unsafe {
            (self.entry)(
                call.stress.as_mut_ptr(),
                call.state.as_mut_ptr(),
                call.tangent.as_mut_ptr(),
                stored,
                plastic,
                creep,
                &raw mut heat,
                thermal[0].as_mut_ptr(),
                thermal[1].as_mut_ptr(),
                &raw mut heat_rate,
                call.strain.as_mut_ptr(),
                call.change.as_mut_ptr(),
                time.as_mut_ptr(),
                &raw mut call.step,
                &raw mut call.temperature,
                &raw mut warming,
                fields.as_mut_ptr(),
                field_changes.as_mut_ptr(),
                name.as_ptr().cast(),
                &raw const axial,
                &raw const shear,
                &raw const all,
                &raw const states,
                constants.as_mut_ptr(),
                &raw const count,
                place.as_mut_ptr(),
                call.rotation.as_mut_ptr(),
                &raw mut call.wanted_step,
                &raw mut call.length,
                before.as_mut_ptr(),
                after.as_mut_ptr(),
                &raw const one,
                &raw const one,
                &raw const one,
                &raw const one,
                step.as_ptr(),
                &raw const increment,
                NAME,
            );
        }
    }
}
