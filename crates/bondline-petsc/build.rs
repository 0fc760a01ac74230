//! Compiles the C shim against the headers of the PETSc at hand, and links it: nothing at all without the feature `petsc`.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    #[cfg(feature = "petsc")]
    petsc::build();
}

#[cfg(feature = "petsc")]
mod petsc {
    use std::env::var;
    use std::process::Command;

    /// Installation folder of PETSc, and its configuration there, as PETSc's own makefiles have them.
    const PLACE: [&str; 2] = ["PETSC_DIR", "PETSC_ARCH"];

    /// Returns the output of a command; an error that says what is missing ends the build.
    fn printed(command: &mut Command, missing: &str) -> String {
        match command.output() {
            Ok(found) if found.status.success() => {
                String::from_utf8_lossy(&found.stdout).into_owned()
            }
            Ok(found) => {
                let why = String::from_utf8_lossy(&found.stderr);
                panic!("{missing} ({})", why.trim())
            }
            Err(why) => panic!("{missing} ({command:?}: {why})"),
        }
    }

    /// Hands flags on to the linker.
    fn link(flags: &str) {
        for flag in flags.split_whitespace() {
            if let Some(library) = flag.strip_prefix("-l") {
                println!("cargo:rustc-link-lib={library}");
            } else if let Some(folder) = flag.strip_prefix("-L") {
                println!("cargo:rustc-link-search=native={folder}");
            }
        }
    }

    pub fn build() {
        println!("cargo:rerun-if-changed=c/shim.c");
        for name in PLACE.iter().chain(&["MPICC", "PKG_CONFIG_PATH"]) {
            println!("cargo:rerun-if-env-changed={name}");
        }
        let mpicc = var("MPICC").unwrap_or_else(|_| "mpicc".to_owned());
        let mut folders: Vec<String> = var("PKG_CONFIG_PATH").into_iter().collect();
        if let Ok(place) = var(PLACE[0]) {
            let arch = var(PLACE[1]).unwrap_or_default();
            let own = [
                format!("{place}/{arch}/lib/pkgconfig"),
                format!("{place}/lib/pkgconfig"),
            ];
            folders.splice(0..0, own);
        }
        let package = |what: &str| {
            printed(
                Command::new("pkg-config")
                    .args([what, "PETSc"])
                    .env("PKG_CONFIG_PATH", folders.join(":")),
                "PETSc is not found: install libpetsc-real-dev and pkg-config, or set PETSC_DIR (docs/clusters.md)",
            )
        };
        let flags = package("--cflags");
        let mut shim = cc::Build::new();
        shim.compiler(&mpicc).file("c/shim.c").opt_level(2);
        for flag in flags.split_whitespace() {
            match flag.strip_prefix("-I") {
                Some(folder) => shim.include(folder),
                None => shim.flag(flag),
            };
        }
        shim.compile("bondline_petsc");
        link(&package("--libs"));
        // the wrapper of the compiler knows which libraries MPI is made of
        let missing = format!(
            "{mpicc} is not found: install an MPI with its compiler, or name its compiler in MPICC"
        );
        link(&printed(Command::new(&mpicc).arg("-show"), &missing));
    }
}
