//! The state of a long run on disk, from which it goes on as if it had never stopped.
//!
//! A checkpoint is one file: eight letters, the version of the format, the identity of what was computed, the keys of its scene and the state in
//! [postcard](https://docs.rs/postcard)'s encoding, its length and its CRC-32. It is written beside its place, forced to
//! the disk and renamed, after the one before has been renamed to `….previous`; so whenever a run is killed, one of the
//! two is whole.
//!
//! The state is not compressed: displacements and velocities are noise to a compressor. Of the 960 150 bytes of
//! `examples/wave_bar.toml` on 40 000 cells zstd takes off 2.1 % at level 1 and 5.8 % at level 9, and it would be a
//! dependency in C.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::ObserveError;
use super::atomic_file::{sync_folder, write_whole};
use crate::regular_file;

/// The letters at the beginning of a file.
const MAGIC: &[u8; 8] = b"bondline";

/// The version of the format; a change of what is saved changes it.
const VERSION: u32 = 10;

/// Bytes before the state: letters, version, identity.
const HEAD: usize = 8 + 4 + 8;

/// Bytes after the state: its length and the CRC-32 of all before the CRC.
const TAIL: usize = 8 + 4;

/// Interval at which something is repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// After this many steps.
    Steps(u64),
    /// After this time of the clock.
    Clock(Duration),
}

/// Error of a pace that cannot be parsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "`{text}` is no pace; write a number of steps such as 1000, or a time such as 30s, \"10 min\" or 2h"
)]
pub struct PaceError {
    /// Text that was given.
    pub text: String,
}

impl FromStr for Pace {
    type Err = PaceError;

    fn from_str(text: &str) -> Result<Self, PaceError> {
        let wrong = || PaceError {
            text: text.to_owned(),
        };
        let trimmed = text.trim();
        let end = trimmed
            .find(|c: char| !(c.is_ascii_digit() || c == '.'))
            .unwrap_or(trimmed.len());
        let (number, unit) = trimmed.split_at(end);
        let seconds = match unit.trim() {
            "" => {
                return match number.parse() {
                    Ok(steps) if steps > 0 => Ok(Self::Steps(steps)),
                    _ => Err(wrong()),
                };
            }
            "s" => 1.0,
            "min" => 60.0,
            "h" => 3600.0,
            _ => return Err(wrong()),
        };
        let amount: f64 = number.parse().map_err(|_| wrong())?;
        Duration::try_from_secs_f64(amount * seconds)
            .ok()
            .filter(|d| !d.is_zero())
            .map(Self::Clock)
            .ok_or_else(wrong)
    }
}

/// Error of a run that cannot go on from a checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// There is none.
    #[error("there is no checkpoint {}; run without --resume, or name the folder of the run by --output", path.display())]
    None {
        /// Path at which it would be.
        path: PathBuf,
    },
    /// The file cannot be read.
    #[error("cannot read the checkpoint {}: {source}; put a file there that can be read, or start again without --resume", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{} is no checkpoint of bondline; remove it, or start again without --resume", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Another version of the program wrote it.
    #[error("the checkpoint {} has format {found}, this program reads {VERSION}; go on with the program that wrote it, or start again without --resume", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The version of its format.
        found: u32,
    },
    /// The file ends too early.
    #[error("the checkpoint {} is cut off: it has {found} bytes; take its copy from a backup, or start again without --resume", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Its length.
        found: usize,
    },
    /// The file has changed since it was written.
    #[error("the checkpoint {} is damaged: its checksum is {found:08x}, not {expected:08x}; take its copy from a backup, or start again without --resume", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The checksum that it holds.
        expected: u32,
        /// The checksum of its content.
        found: u32,
    },
    /// It belongs to another computation.
    #[error("the checkpoint {} belongs to another scene or mesh{}; resume with the scene, the mesh and the overrides that it was run with, or start again without --resume", path.display(), named(keys))]
    OtherScene {
        /// The file.
        path: PathBuf,
        /// Keys of the scene that differ; none where a file that it reads does.
        keys: Vec<String>,
    },
    /// Its content cannot be understood.
    #[error("the checkpoint {} does not hold what this scene needs: {message}; start again without --resume", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The defect.
        message: String,
    },
}

/// Keys that differ, in brackets: no more than three.
fn named(keys: &[String]) -> String {
    const MOST: usize = 3;
    let names: Vec<String> = keys.iter().take(MOST).map(|k| format!("`{k}`")).collect();
    let names = names.join(", ");
    match keys.len() {
        0 => " (a file that the scene reads has changed)".to_owned(),
        1 => format!(" ({names} differs)"),
        n if n <= MOST => format!(" ({names} differ)"),
        n => format!(" ({names} and {} more differ)", n - MOST),
    }
}

impl CheckpointError {
    /// The file that it is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::None { path }
            | Self::Unreadable { path, .. }
            | Self::Foreign { path }
            | Self::Version { path, .. }
            | Self::Truncated { path, .. }
            | Self::Damaged { path, .. }
            | Self::OtherScene { path, .. }
            | Self::Content { path, .. } => path,
        }
    }
}

/// Source of a state, one of two files.
#[derive(Debug)]
pub enum Found {
    /// The last one that was written.
    Current,
    /// The one before, and why not the last one.
    Previous(CheckpointError),
}

/// The place of the checkpoints of one run.
#[derive(Clone, Debug)]
pub struct CheckpointFile {
    path: PathBuf,
    print: Fingerprint,
}

impl CheckpointFile {
    /// The place `path` for the computation of which `print` is the fingerprint.
    pub fn new(path: PathBuf, print: Fingerprint) -> Self {
        Self { path, print }
    }

    /// Path of the last checkpoint.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the checkpoint before the last.
    pub fn previous(&self) -> PathBuf {
        let mut name = self.path.file_name().unwrap_or_default().to_os_string();
        name.push(".previous");
        self.path.with_file_name(name)
    }

    /// Writes a state; the one that lay there is kept as [`CheckpointFile::previous`].
    ///
    /// # Errors
    /// [`ObserveError::Folder`] or [`ObserveError::Write`]; what lay there before is then still there.
    pub fn write<T: Serialize>(&self, state: &T) -> Result<(), ObserveError> {
        write_whole(&self.path, |out| {
            let mut out = Checked {
                inner: out,
                hasher: crc32fast::Hasher::new(),
                bytes: 0,
                failed: None,
            };
            out.write_all(MAGIC)?;
            out.write_all(&VERSION.to_le_bytes())?;
            out.write_all(&self.print.value.to_le_bytes())?;
            if let Err(error) = postcard::to_io(&(&self.print.keys, state), &mut out) {
                // postcard says of each failed write that its buffer is full
                return Err(out.failed.unwrap_or_else(|| std::io::Error::other(error)));
            }
            let length = out.bytes - HEAD as u64;
            out.write_all(&length.to_le_bytes())?;
            let sum = out.hasher.clone().finalize();
            out.inner.write_all(&sum.to_le_bytes())?;
            // the new file is whole only once it is renamed; until then the old one has to stay reachable
            match std::fs::rename(&self.path, self.previous()) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(e),
                _ => Ok(()),
            }
        })?;
        sync_folder(&self.path);
        Ok(())
    }

    /// Removes the checkpoints of an earlier run.
    ///
    /// # Errors
    /// [`ObserveError::Write`] if one is there and stays.
    pub fn remove(&self) -> Result<(), ObserveError> {
        for path in [self.previous(), self.path.clone()] {
            match std::fs::remove_file(&path) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(ObserveError::Write { path, source });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Reads the last state that is whole.
    ///
    /// # Errors
    /// [`CheckpointError`] of the last checkpoint if neither it nor the one before can be read.
    pub fn read<T: DeserializeOwned>(&self) -> Result<(T, Found), CheckpointError> {
        let error = match self.read_file(&self.path) {
            Ok(state) => return Ok((state, Found::Current)),
            // the one before belongs to the same scene, so it would be refused too
            Err(error @ CheckpointError::OtherScene { .. }) => return Err(error),
            Err(error) => error,
        };
        match self.read_file(&self.previous()) {
            Ok(state) => Ok((state, Found::Previous(error))),
            Err(older @ CheckpointError::OtherScene { .. }) => Err(older),
            Err(_) => Err(error),
        }
    }

    fn read_file<T: DeserializeOwned>(&self, path: &Path) -> Result<T, CheckpointError> {
        let path_buf = || path.to_path_buf();
        let bytes = regular_file::read(path).map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => CheckpointError::None { path: path_buf() },
            _ => CheckpointError::Unreadable {
                path: path_buf(),
                source,
            },
        })?;
        let truncated = || CheckpointError::Truncated {
            path: path_buf(),
            found: bytes.len(),
        };
        if !bytes.starts_with(&MAGIC[..bytes.len().min(MAGIC.len())]) {
            return Err(CheckpointError::Foreign { path: path_buf() });
        }
        let version = number::<4>(&bytes, MAGIC.len()).ok_or_else(truncated)?;
        let found = u32::from_le_bytes(version);
        if found != VERSION {
            return Err(CheckpointError::Version {
                path: path_buf(),
                found,
            });
        }
        let identity = number::<8>(&bytes, MAGIC.len() + 4).ok_or_else(truncated)?;
        let end = bytes
            .len()
            .checked_sub(TAIL)
            .filter(|&end| end >= HEAD)
            .ok_or_else(truncated)?;
        let length = number::<8>(&bytes, end).ok_or_else(truncated)?;
        let expected = number::<4>(&bytes, end + 8).ok_or_else(truncated)?;
        let (expected, found) = (
            u32::from_le_bytes(expected),
            crc32fast::hash(&bytes[..end + 8]),
        );
        if u64::from_le_bytes(length) != (end - HEAD) as u64 {
            return Err(truncated());
        }
        if expected != found {
            return Err(CheckpointError::Damaged {
                path: path_buf(),
                expected,
                found,
            });
        }
        let content = |message: String| CheckpointError::Content {
            path: path_buf(),
            message,
        };
        let (keys, state) = postcard::take_from_bytes::<Vec<(String, u64)>>(&bytes[HEAD..end])
            .map_err(|e| content(e.to_string()))?;
        if u64::from_le_bytes(identity) != self.print.value {
            return Err(CheckpointError::OtherScene {
                path: path_buf(),
                keys: self.print.differing(&keys),
            });
        }
        let (value, rest) = postcard::take_from_bytes(state).map_err(|e| content(e.to_string()))?;
        if rest.is_empty() {
            Ok(value)
        } else {
            Err(content(format!("{} bytes are left over", rest.len())))
        }
    }
}

fn number<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..at + N)?.try_into().ok()
}

/// Passes bytes on, and sums them up.
struct Checked<W> {
    inner: W,
    hasher: crc32fast::Hasher,
    bytes: u64,
    /// Error of a write that failed.
    failed: Option<std::io::Error>,
}

impl<W: Write> Write for Checked<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.inner.write(bytes);
        let written = self.noted(written)?;
        self.hasher.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        let flushed = self.inner.flush();
        self.noted(flushed)
    }
}

impl<W> Checked<W> {
    /// Keeps an error for whoever asks why nothing was written, and passes its kind on.
    fn noted<T>(&mut self, result: std::io::Result<T>) -> std::io::Result<T> {
        result.map_err(|error| {
            let kind = error.kind();
            self.failed = Some(error);
            kind.into()
        })
    }
}

/// A name for what a computation is made of, the same on every machine and in every build: FNV-1a of 64 bits, of all of it and of each key of its scene.
#[derive(Clone, Debug)]
pub struct Fingerprint {
    value: u64,
    keys: Vec<(String, u64)>,
}

impl Default for Fingerprint {
    fn default() -> Self {
        Self {
            value: 0xcbf2_9ce4_8422_2325,
            keys: Vec::new(),
        }
    }
}

impl Fingerprint {
    /// Adds bytes, and where they end.
    pub fn add(&mut self, bytes: &[u8]) {
        let length = (bytes.len() as u64).to_le_bytes();
        for &byte in bytes.iter().chain(&length) {
            self.value = (self.value ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// Notes a key whose value has the fingerprint `of_value`, so that it can be named where it differs.
    pub fn note(&mut self, key: String, of_value: &Self) {
        self.keys.push((key, of_value.value));
    }

    /// The number for all that was added.
    pub fn value(&self) -> u64 {
        self.value
    }

    /// The keys whose values are others among `theirs`, or that one of the two lacks.
    fn differing(&self, theirs: &[(String, u64)]) -> Vec<String> {
        let lacks = |list: &[(String, u64)], entry: &(String, u64)| !list.contains(entry);
        let ours = self.keys.iter().filter(|k| lacks(theirs, k));
        let others = theirs.iter().filter(|k| lacks(&self.keys, k));
        let names: std::collections::BTreeSet<&String> =
            ours.chain(others).map(|(key, _)| key).collect();
        names.into_iter().cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type State = (u64, Vec<f64>);

    fn print(value: u64) -> Fingerprint {
        Fingerprint {
            value,
            keys: Vec::new(),
        }
    }

    fn state(step: u64) -> State {
        (step, vec![0.1 + step as f64, -0.0, f64::MIN_POSITIVE / 4.0])
    }

    #[test]
    fn states_read_back_bit_for_bit_and_the_one_before_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let file = CheckpointFile::new(folder.path().join("run.checkpoint"), print(7));
        assert!(matches!(
            file.read::<State>(),
            Err(CheckpointError::None { .. })
        ));
        for step in 1..4 {
            file.write(&state(step)).unwrap();
        }
        let (read, found): (State, Found) = file.read().unwrap();
        assert!(matches!(found, Found::Current));
        assert_eq!(read.0, 3);
        for (a, b) in read.1.iter().zip(state(3).1) {
            assert_eq!(a.to_bits(), b.to_bits());
        }
        // killed between the two renames
        std::fs::remove_file(file.path()).unwrap();
        let (read, found): (State, Found) = file.read().unwrap();
        assert!(matches!(
            found,
            Found::Previous(CheckpointError::None { .. })
        ));
        assert_eq!(read.0, 2);
    }

    #[test]
    fn whatever_is_wrong_has_a_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        let file = CheckpointFile::new(path.clone(), print(7));
        file.write(&state(1)).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let read = |bytes: &[u8]| -> CheckpointError {
            std::fs::write(&path, bytes).unwrap();
            file.read::<State>().unwrap_err()
        };
        // no length is taken for a whole file
        for length in 0..whole.len() {
            let error = read(&whole[..length]);
            assert!(
                matches!(error, CheckpointError::Truncated { .. }),
                "{length}: {error}"
            );
        }
        // every bit counts
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let error = read(&flipped);
            let named = match bit / 64 {
                0 => matches!(error, CheckpointError::Foreign { .. }),
                1 if bit / 8 < 12 => matches!(error, CheckpointError::Version { .. }),
                _ => matches!(
                    error,
                    CheckpointError::Damaged { .. } | CheckpointError::Truncated { .. }
                ),
            };
            assert!(named, "bit {bit}: {error}");
        }
        std::fs::write(&path, &whole).unwrap();
        let other = CheckpointFile::new(path.clone(), print(8));
        let error = other.read::<State>().unwrap_err();
        assert!(error.to_string().contains("another scene"), "{error}");
        let error = file.read::<(String, u8)>().unwrap_err();
        assert!(matches!(error, CheckpointError::Content { .. }), "{error}");
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        let error = file.read::<State>().unwrap_err();
        assert!(
            matches!(error, CheckpointError::Unreadable { .. }),
            "{error}"
        );
    }

    #[test]
    fn paces_are_steps_or_times() {
        assert_eq!("250".parse(), Ok(Pace::Steps(250)));
        for (text, seconds) in [
            ("30s", 30.0),
            ("0.5 s", 0.5),
            ("10 min", 600.0),
            ("2h", 7200.0),
        ] {
            let pace = Pace::Clock(Duration::from_secs_f64(seconds));
            assert_eq!(text.parse(), Ok(pace), "{text}");
        }
        for text in ["0", "1.5", "-3", "s", "3 days", "", "1e3", "0 s"] {
            let error = text.parse::<Pace>().unwrap_err();
            assert!(error.to_string().contains("number of steps"), "{error}");
        }
    }

    #[test]
    fn keys_that_differ_are_named() {
        let of = |keys: &[(&str, u64)]| Fingerprint {
            value: 0,
            keys: keys.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
        };
        let (ours, theirs) = (
            of(&[("a", 1), ("b.c", 2), ("d", 3)]),
            of(&[("a", 1), ("b.c", 4), ("e", 3)]),
        );
        let keys = ours.differing(&theirs.keys);
        assert_eq!(keys, ["b.c", "d", "e"]);
        assert_eq!(named(&keys), " (`b.c`, `d`, `e` differ)");
        assert_eq!(named(&keys[..1]), " (`b.c` differs)");
        let five: Vec<String> = (0..5).map(|k| k.to_string()).collect();
        assert_eq!(named(&five), " (`0`, `1`, `2` and 2 more differ)");
        assert!(ours.differing(&ours.keys).is_empty());
    }

    #[test]
    fn fingerprints_tell_apart_what_concatenates_alike() {
        let of = |parts: &[&str]| {
            let mut print = Fingerprint::default();
            parts.iter().for_each(|p| print.add(p.as_bytes()));
            print.value()
        };
        assert_ne!(of(&["ab", "c"]), of(&["a", "bc"]));
        assert_ne!(of(&["a"]), of(&["a", ""]));
        assert_eq!(of(&["a", "bc"]), of(&["a", "bc"]));
    }
}
