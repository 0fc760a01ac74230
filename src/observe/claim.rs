//! Claims on output folders and their files, so that no run takes another one's files for leftovers or writes over them.
//!
//! A claim is the file `.NAME.lock` in the folder, locked by the operating system while the run lasts. It lists the process, the scene and the files that
//! belong to the run. The system lifts the lock when the process ends, however it ends, so a claim that is left behind by a killed run is known from
//! one that holds. Where a file system knows no locks, nothing is claimed.

use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::ObserveError;
use super::pieces::stem;
use super::provenance::PROVENANCE;
use crate::regular_file;

/// The files of one run in its folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Files {
    /// The beginning of their names.
    pub name: String,
    /// Names, each in full.
    pub files: Vec<String>,
    /// True if there are files `NAME_0000.vtu`, `NAME_0001.vtu`, … too, or `NAME_0000.pvtu`, … with a piece of each process.
    pub series: bool,
    /// The beginnings of the names of further such series.
    #[serde(default)]
    pub others: Vec<String>,
}

impl Files {
    /// Returns true if a file is one of these.
    pub fn contains(&self, file: &str) -> bool {
        self.files.iter().any(|own| own == file) || self.names().any(|name| is_of(name, file))
    }

    /// The names of the series.
    fn names(&self) -> impl Iterator<Item = &str> {
        let own = self.series.then_some(&self.name).into_iter();
        own.chain(&self.others).map(String::as_str)
    }

    /// A file in `folder` that these would write over and that a scene of another name has left, and whose it is.
    ///
    /// A file at rest may be called as one of a series is: it is part of it where the collection lists it. A series begins with a file that stands alone
    /// only where another scene wrote that: its own runs, ended or killed, leave a claim, a collection or a table with it.
    fn of_another(&self, folder: &Path, was_claimed: bool) -> Option<(PathBuf, String)> {
        let lists = |collection: &Path, file: &str| {
            regular_file::read_to_string(collection)
                .is_ok_and(|text| text.contains(&format!("\"{file}\"")))
        };
        let listed = self.files.iter().find_map(|file| {
            if let Some((whole, _)) = file.strip_suffix(".vtu").and_then(|f| f.rsplit_once("_p")) {
                // perhaps the piece of a process
                let list = format!("{whole}.pvtu");
                let pieces = folder.join(&list);
                let is_own = whole == self.name || self.contains(&list);
                if !is_own && lists(&pieces, file) {
                    return Some((folder.join(file), pieces.display().to_string()));
                }
            }
            let (name, _) = stem(file)?.rsplit_once('_')?;
            let collection = folder.join(format!("{name}.pvd"));
            let is_of_another = is_of(name, file) && lists(&collection, file);
            is_of_another.then(|| (folder.join(file), collection.display().to_string()))
        });
        let alone = || {
            let first = ["vtu", "pvtu"].map(|end| folder.join(format!("{}_0000.{end}", self.name)));
            let first = first.into_iter().find(|file| file.exists())?;
            // scenes at rest leave provenance too
            let mut kinds = self.files.iter().filter(|file| !file.ends_with(PROVENANCE));
            let is_own = kinds.any(|file| folder.join(file).exists());
            let foreign = self.series && !was_claimed && !is_own;
            foreign.then(|| (first, "a scene of another name".to_owned()))
        };
        listed.or_else(alone)
    }

    /// A file that both would write.
    fn shared(&self, other: &Self) -> Option<String> {
        let of_both = || self.names().find(|name| other.names().any(|n| n == *name));
        let of_series = || of_both().map(|name| format!("{name}_0000.vtu"));
        let theirs = other.files.iter().filter(|f| self.contains(f));
        let mine = self.files.iter().filter(|f| other.contains(f));
        theirs.chain(mine).next().cloned().or_else(of_series)
    }
}

/// Returns true if a file is `NAME_0000.vtu` and the like, or a piece of one.
fn is_of(name: &str, file: &str) -> bool {
    let number = stem(file)
        .and_then(|stem| stem.strip_prefix(name))
        .and_then(|rest| rest.strip_prefix('_'));
    number.is_some_and(|n| n.len() >= 4 && n.bytes().all(|b| b.is_ascii_digit()))
}

/// Content of a claim.
#[derive(Debug, Serialize, Deserialize)]
struct Holder {
    process: u32,
    scene: String,
    files: Files,
}

/// Files of a folder that nobody else writes while this lives.
#[derive(Debug)]
pub struct Claim {
    /// The locked file; none where the file system knows no locks.
    held: Option<(File, PathBuf)>,
    /// Folders that were made for it, the deepest first.
    made: Vec<PathBuf>,
}

/// A claim may be looked at by others for an instant.
const LOOKS: u32 = 20;

/// Between two looks.
const LOOK: Duration = Duration::from_millis(10);

impl Claim {
    /// Claims `files` in `folder` for a scene, and removes what killed runs left of them half written.
    ///
    /// # Errors
    /// [`ObserveError::Claimed`] if another run writes any of them, [`ObserveError::OfAnother`] if a scene of another name has left one that would be
    /// written over, [`ObserveError::Folder`], [`ObserveError::Write`].
    pub fn take(folder: &Path, scene: &str, files: &Files) -> Result<Self, ObserveError> {
        let folder = match folder.as_os_str().is_empty() {
            true => Path::new("."),
            false => folder,
        };
        let made = folder
            .ancestors()
            .take_while(|f| !f.as_os_str().is_empty() && !f.exists())
            .map(Path::to_path_buf)
            .collect();
        let mut claim = Self { held: None, made };
        let path = folder.join(format!(".{}.lock", files.name));
        let fail = ObserveError::write(&path);
        let mut looks = 0;
        let mut file = loop {
            // another run that ends may remove the folder with its claim
            std::fs::create_dir_all(folder).map_err(|source| ObserveError::Folder {
                path: folder.to_path_buf(),
                source,
            })?;
            let mut options = File::options();
            let file = match options.read(true).write(true).create(true).open(&path) {
                Err(e) if e.kind() == ErrorKind::NotFound && looks < LOOKS => {
                    looks += 1;
                    continue;
                }
                opened => opened.map_err(&fail)?,
            };
            match file.try_lock() {
                Ok(()) if is_at(&file, &path) => break file,
                // removed by its owner between opening and locking
                Ok(()) => {}
                Err(TryLockError::WouldBlock) if looks < LOOKS => {
                    looks += 1;
                    std::thread::sleep(LOOK);
                }
                Err(TryLockError::WouldBlock) => {
                    return Err(claimed(folder, &path, files.files.first().cloned()));
                }
                Err(TryLockError::Error(_)) => return Ok(claim),
            }
        };
        // what a killed run leaves says whose its files are
        let was_claimed = file.metadata().is_ok_and(|found| found.len() > 0);
        let holder = Holder {
            process: std::process::id(),
            scene: scene.to_owned(),
            files: files.clone(),
        };
        file.set_len(0)
            .and_then(|()| file.rewind())
            .and_then(|()| serde_json::to_writer(&file, &holder).map_err(std::io::Error::from))
            .and_then(|()| file.flush())
            .map_err(fail)?;
        claim.held = Some((file, path.clone()));
        // only now: of two that begin together, the later one sees the list of the other
        for other in others(folder, &path) {
            let shared = read(&other).and_then(|holder| holder.files.shared(files));
            if let Some(shared) = shared
                && is_held(&other)
            {
                return Err(claimed(folder, &other, Some(shared)));
            }
        }
        if let Some((path, owner)) = files.of_another(folder, was_claimed) {
            return Err(ObserveError::OfAnother { path, owner });
        }
        remove_parts(folder, files);
        Ok(claim)
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if let Some((file, path)) = self.held.take() {
            // while it is locked, so that it is ours; elsewhere than on Unix a file that is open stays
            if cfg!(unix) {
                let _ = std::fs::remove_file(path);
            }
            drop(file);
        }
        // a run that wrote nothing leaves no folder; one that holds anything stays
        for folder in &self.made {
            if std::fs::remove_dir(folder).is_err() {
                break;
            }
        }
    }
}

/// The process and scene of a claim that holds in a folder, if there is any.
pub fn holder(folder: &Path) -> Option<(u32, String)> {
    let held = others(folder, Path::new("")).into_iter();
    let mut held = held
        .filter(|path| is_held(path))
        .filter_map(|path| read(&path));
    held.next().map(|holder| (holder.process, holder.scene))
}

/// The claims in a folder but for `own`.
fn others(folder: &Path, own: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_claim = |name: &str| name.starts_with('.') && name.ends_with(".lock");
    let claims = entries.filter(|e| e.file_name().to_str().is_some_and(is_claim));
    let paths = claims.map(|e| e.path());
    paths.filter(|p| p.is_file() && p != own).collect()
}

/// Returns true if the process of a claim lives.
fn is_held(path: &Path) -> bool {
    let Ok(file) = File::open(path) else {
        return false;
    };
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

fn read(path: &Path) -> Option<Holder> {
    let mut text = String::new();
    let file = File::open(path).ok()?;
    file.take(1 << 20).read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

fn claimed(folder: &Path, claim: &Path, file: Option<String>) -> ObserveError {
    let by = match read(claim) {
        Some(holder) => format!("process {}, scene `{}`", holder.process, holder.scene),
        None => "another process".to_owned(),
    };
    ObserveError::Claimed {
        path: folder.join(file.unwrap_or_default()),
        by,
    }
}

/// Returns true if an open file is the one that lies at `path`.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let (Ok(own), Ok(there)) = (file.metadata(), std::fs::metadata(path)) else {
        return false;
    };
    (own.dev(), own.ino()) == (there.dev(), there.ino())
}

/// Claims stay where they are.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Removes what killed runs left of these files half written: `.FILE.PROCESS-NUMBER.part`.
fn remove_parts(folder: &Path, files: &Files) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if name
            .to_str()
            .and_then(of_part)
            .is_some_and(|f| files.contains(f))
        {
            // what cannot be removed does no harm
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// The file that a part belongs to.
fn of_part(name: &str) -> Option<&str> {
    let inner = name.strip_prefix('.')?.strip_suffix(".part")?;
    let (file, writer) = inner.rsplit_once('.')?;
    let (process, number) = writer.split_once('-')?;
    let is_number = |n: &str| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit());
    (is_number(process) && is_number(number)).then_some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(name: &str) -> Files {
        Files {
            name: name.to_owned(),
            files: vec![format!("{name}.pvd"), format!("{name}_history.csv")],
            series: true,
            others: Vec::new(),
        }
    }

    #[test]
    fn a_name_that_begins_like_another_is_another() {
        let folder = tempfile::tempdir().unwrap();
        let long = Claim::take(folder.path(), "long", &moving("branching_moving")).unwrap();
        let parts = [
            ".branching_moving_0001.vtu.17-3.part",
            ".branching_0001.vtu.17-3.part",
            ".branching_0001_p2.vtu.17-4.part",
            ".branching_0001.pvtu.17-5.part",
            ".branching_history.csv.17-12.part",
            ".branching_0001.vtu.part",
            ".branching_tip.csv.17-3.part",
        ];
        for part in parts {
            std::fs::write(folder.path().join(part), b"half").unwrap();
        }
        let short = Claim::take(folder.path(), "short", &moving("branching")).unwrap();
        let left = parts.map(|part| folder.path().join(part).exists());
        assert_eq!(left, [true, false, false, false, false, true, true]);
        // both stand, and a second one of either is refused
        let error = Claim::take(folder.path(), "again", &moving("branching")).unwrap_err();
        let said = error.to_string();
        let process = format!("process {}, scene `short`", std::process::id());
        assert!(
            said.contains(&process) && said.contains("--output"),
            "{said}"
        );
        drop((long, short));
        assert!(!folder.path().join(".branching.lock").exists());
        Claim::take(folder.path(), "again", &moving("branching")).unwrap();
    }

    #[test]
    fn two_names_with_a_file_in_common_are_told_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let _moving = Claim::take(folder.path(), "moving", &moving("plate")).unwrap();
        let still = |file: &str| Files {
            name: "plate_0000".to_owned(),
            files: vec![file.to_owned()],
            series: false,
            others: Vec::new(),
        };
        let error = Claim::take(folder.path(), "still", &still("plate_0000.vtu")).unwrap_err();
        let said = error.to_string();
        assert!(
            said.contains("plate_0000.vtu") && said.contains("scene `moving`"),
            "{said}"
        );
        Claim::take(folder.path(), "still", &still("plate_0000_probes.csv")).unwrap();
        // a claim whose process has ended, and what is no claim at all
        std::fs::write(folder.path().join(".plate_0000.lock"), b"{").unwrap();
        std::fs::write(folder.path().join(".cargo.lock"), b"x = 1").unwrap();
        Claim::take(folder.path(), "still", &still("plate_0000.csv")).unwrap();
    }

    #[test]
    fn a_piece_of_another_scene_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let list = b"<PUnstructuredGrid><Piece Source=\"st_p1.vtu\"/></PUnstructuredGrid>";
        std::fs::write(folder.path().join("st.pvtu"), list).unwrap();
        let named = |name: &str| Files {
            name: name.to_owned(),
            files: vec![format!("{name}.vtu")],
            series: false,
            others: Vec::new(),
        };
        let error = Claim::take(folder.path(), "other", &named("st_p1")).unwrap_err();
        assert!(error.to_string().contains("st_p1.vtu"), "{error}");
        for name in ["st_p2", "st_pa", "st"] {
            Claim::take(folder.path(), "other", &named(name)).unwrap();
        }
        // its own are written anew
        let again = Files {
            files: vec!["st.pvtu".to_owned(), "st_p1.vtu".to_owned()],
            ..named("st")
        };
        Claim::take(folder.path(), "same", &again).unwrap();
    }

    #[test]
    fn folders_that_stay_empty_go() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b");
        drop(Claim::take(&deep, "scene", &moving("x")).unwrap());
        assert!(!folder.path().join("a").exists());
        let claim = Claim::take(&deep, "scene", &moving("x")).unwrap();
        std::fs::write(deep.join("x.pvd"), b"").unwrap();
        drop(claim);
        assert!(deep.join("x.pvd").exists());
    }
}
