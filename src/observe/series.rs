//! VTU files over time, and the collection by which ParaView opens them as one.

use std::path::{Path, PathBuf};

use super::ObserveError;
use super::pieces::{PieceFiles, agreed, stem, write_pieces};
use super::vtu::{Compression, Snapshot, write_pvd, write_vtu};
use crate::system::Ranks;

/// Files `NAME_0000.vtu`, `NAME_0001.vtu`, … and `NAME.pvd` over them; of several processes `NAME_0000.pvtu`, … over the pieces of each.
///
/// Each file appears whole, and the collection lists only files that are there; so a run that is killed leaves what
/// ParaView, VTK and meshio can read.
#[derive(Debug)]
pub struct Series {
    folder: PathBuf,
    name: String,
    times: Vec<f64>,
    /// The file of each time, as the collection names it.
    files: Vec<PathBuf>,
}

impl Series {
    /// An empty series; nothing is written yet.
    pub fn new(folder: &Path, name: &str) -> Self {
        Self::resumed(folder, name, Vec::new())
    }

    /// A series of which the files of `times` are there already, each written by one process or by several.
    pub fn resumed(folder: &Path, name: &str, times: Vec<f64>) -> Self {
        let mut series = Self {
            folder: folder.to_path_buf(),
            name: name.to_owned(),
            times: Vec::new(),
            files: Vec::new(),
        };
        for time in times {
            let whole = series.file(series.times.len());
            let list = PieceFiles::new(&whole).list();
            let is_in_pieces = list.exists();
            series.add(time, if is_in_pieces { list } else { whole });
        }
        series
    }

    fn add(&mut self, time: f64, file: PathBuf) {
        self.times.push(time);
        self.files.push(file);
    }

    /// The times so far.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The collection.
    pub fn collection(&self) -> PathBuf {
        self.folder.join(format!("{}.pvd", self.name))
    }

    /// The file of a time by its number, as one process writes it.
    pub fn file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("{}_{number:04}.vtu", self.name))
    }

    /// Removes the collection of a series that lay here before.
    pub fn remove_collection(&self) {
        // what cannot be removed will be written over, or says so then
        let _ = std::fs::remove_file(self.collection());
    }

    /// Removes the files of a series that lay here before, beyond those that this one has: another number of processes writes others.
    pub fn remove_later(&self) {
        let first = self.times.len();
        for number in first.. {
            let whole = self.file(number);
            let list = PieceFiles::new(&whole).list();
            // the list first: it names pieces
            let gone = [list, whole].map(|file| std::fs::remove_file(file).is_ok());
            if gone == [false; 2] {
                break;
            }
        }
        // pieces, also those of a process that was killed before there was a list
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten();
        for entry in entries.flatten() {
            let name = entry.file_name();
            let number = name.to_str().and_then(|name| self.number_of_piece(name));
            if number.is_some_and(|number| number >= first) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }

    /// The number of the time of a file, if it is a piece of this series.
    fn number_of_piece(&self, file: &str) -> Option<usize> {
        let stem = stem(file).filter(|stem| file.len() > stem.len() + ".pvtu".len())?;
        let number = stem.strip_prefix(&self.name)?.strip_prefix('_')?;
        let is_number = number.len() >= 4 && number.bytes().all(|b| b.is_ascii_digit());
        number.parse().ok().filter(|_| is_number)
    }

    /// Writes the next file and the collection over all; gives the snapshot back.
    ///
    /// # Errors
    /// As [`write_vtu`] and [`write_pvd`].
    pub fn push(&mut self, time: f64, mut snapshot: Snapshot) -> Result<Snapshot, ObserveError> {
        snapshot.time = Some(time);
        let file = self.file(self.times.len());
        write_vtu(&file, &snapshot, Compression::default())?;
        self.add(time, file);
        self.write_collection()?;
        Ok(snapshot)
    }

    /// Collective: writes the piece of each process and the list over them, the first process also the collection over all.
    ///
    /// # Errors
    /// The error of the first process that could not write, on all.
    pub fn push_pieces(
        &mut self,
        time: f64,
        mut own: Snapshot,
        ranks: &dyn Ranks,
    ) -> Result<(), ObserveError> {
        own.time = Some(time);
        let whole = self.file(self.times.len());
        write_pieces(&whole, &own, ranks)?;
        self.add(time, PieceFiles::new(&whole).list());
        let written = match ranks.rank() {
            0 => self.write_collection(),
            _ => Ok(()),
        };
        agreed(Some(ranks), written, &self.collection())
    }

    /// Writes the collection over the files so far, if there are any.
    ///
    /// # Errors
    /// As [`write_pvd`].
    pub fn write_collection(&self) -> Result<(), ObserveError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let times = self.times.iter().copied();
        let steps: Vec<(f64, PathBuf)> = times.zip(self.files.iter().cloned()).collect();
        write_pvd(&self.collection(), &steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(x: f64) -> Snapshot {
        let mut snapshot = Snapshot::default();
        snapshot.push_vertices(&[crate::tensor::Vector::<1>::new(x)]);
        snapshot
    }

    #[test]
    fn a_resumed_series_is_the_same_as_one_that_never_stopped() {
        let (whole, parts) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let times = [0.0, 0.5, 1.0];
        let mut series = Series::new(whole.path(), "wave");
        for t in times {
            series.push(t, snapshot(t)).unwrap();
        }
        let mut first = Series::new(parts.path(), "wave");
        for t in times {
            first.push(t, snapshot(t)).unwrap();
        }
        // back at the state after the first file
        let mut second = Series::resumed(parts.path(), "wave", times[..1].to_vec());
        second.write_collection().unwrap();
        let text = std::fs::read_to_string(second.collection()).unwrap();
        assert_eq!(text.matches("wave_").count(), 1, "{text}");
        for t in &times[1..] {
            second.push(*t, snapshot(*t)).unwrap();
        }
        for name in [
            "wave.pvd",
            "wave_0000.vtu",
            "wave_0001.vtu",
            "wave_0002.vtu",
        ] {
            let bytes =
                |folder: &tempfile::TempDir| std::fs::read(folder.path().join(name)).unwrap();
            assert!(bytes(&whole) == bytes(&parts), "{name}");
        }
        assert_eq!(second.times(), times);
    }

    #[test]
    fn files_of_other_processes_go_and_those_before_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let files = [
            "wave_0000.pvtu",
            "wave_0000_p1.vtu",
            "wave_0001.vtu",
            "wave_0002.pvtu",
            "wave_0002_p0.vtu",
            "wave_0002_p3.vtu",
            "wave_0003_p2.vtu",
            "wave_0007.vtu",
            "wave_12_p0.vtu",
            "waves_0002_p0.vtu",
            "wave_0002_plane.vtu",
        ];
        for file in files {
            std::fs::write(path(file), b"x").unwrap();
        }
        let series = Series::resumed(folder.path(), "wave", vec![0.0, 0.5]);
        series.remove_later();
        let left = files.map(|file| path(file).exists());
        let kept = [
            true, true, true, false, false, false, false, true, true, true, true,
        ];
        assert_eq!(left, kept);
        series.write_collection().unwrap();
        let text = std::fs::read_to_string(series.collection()).unwrap();
        let named = ["wave_0000.pvtu", "wave_0001.vtu"].map(|name| text.contains(name));
        assert!(named == [true; 2] && !text.contains("wave_0002"), "{text}");
    }
}
