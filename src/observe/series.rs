//! VTU files over time, and the collection by which ParaView opens them as one.

use std::path::{Path, PathBuf};

use super::ObserveError;
use super::vtu::{Compression, Snapshot, write_pvd, write_vtu};

/// Files `NAME_0000.vtu`, `NAME_0001.vtu`, … and `NAME.pvd` over them.
///
/// Each file appears whole, and the collection lists only files that are there; so a run that is killed leaves what
/// ParaView, VTK and meshio can read.
#[derive(Debug)]
pub struct Series {
    folder: PathBuf,
    name: String,
    times: Vec<f64>,
}

impl Series {
    /// An empty series; nothing is written yet.
    pub fn new(folder: &Path, name: &str) -> Self {
        Self::resumed(folder, name, Vec::new())
    }

    /// A series of which the files of `times` are there already.
    pub fn resumed(folder: &Path, name: &str, times: Vec<f64>) -> Self {
        Self {
            folder: folder.to_path_buf(),
            name: name.to_owned(),
            times,
        }
    }

    /// The times so far.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The collection.
    pub fn collection(&self) -> PathBuf {
        self.folder.join(format!("{}.pvd", self.name))
    }

    /// The file of a time, by its number.
    pub fn file(&self, number: usize) -> PathBuf {
        self.folder.join(format!("{}_{number:04}.vtu", self.name))
    }

    /// Removes the files of a series that lay here before.
    pub fn remove_old(&self) {
        // what cannot be removed will be written over, or says so then
        let _ = std::fs::remove_file(self.collection());
        let mut number = 0;
        while std::fs::remove_file(self.file(number)).is_ok() {
            number += 1;
        }
    }

    /// Writes the next file and the collection over all; gives the snapshot back.
    ///
    /// # Errors
    /// As [`write_vtu`] and [`write_pvd`].
    pub fn push(&mut self, time: f64, mut snapshot: Snapshot) -> Result<Snapshot, ObserveError> {
        snapshot.time = Some(time);
        write_vtu(
            &self.file(self.times.len()),
            &snapshot,
            Compression::default(),
        )?;
        self.times.push(time);
        self.write_collection()?;
        Ok(snapshot)
    }

    /// Writes the collection over the files so far, if there are any.
    ///
    /// # Errors
    /// As [`write_pvd`].
    pub fn write_collection(&self) -> Result<(), ObserveError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let steps: Vec<(f64, PathBuf)> = self
            .times
            .iter()
            .enumerate()
            .map(|(number, &time)| (time, self.file(number)))
            .collect();
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
}
