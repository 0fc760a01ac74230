//! One snapshot as several VTU files, one of each process, and the PVTU that makes one data set of them.
//!
//! The PVTU appears when all of its pieces are there, and an older one goes before they do: it never names a piece of another snapshot.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::ObserveError;
use super::vtu::{Compression, Snapshot, escape, write_pvtu, write_vtu};
use crate::regular_file;
use crate::system::{Ranks, first_text};

/// Number of times that the first process looks for the pieces of others, which a file system may show late.
const LOOKS: u32 = 20;

/// Time between two looks.
const LOOK: Duration = Duration::from_millis(100);

/// The files that several processes write in place of `STEM.vtu`: `STEM_p0.vtu`, `STEM_p1.vtu`, … of those that have cells, and `STEM.pvtu` over them.
#[derive(Clone, Copy, Debug)]
pub struct PieceFiles<'a> {
    whole: &'a Path,
}

impl<'a> PieceFiles<'a> {
    /// Those in place of a file of one process.
    pub fn new(whole: &'a Path) -> Self {
        Self { whole }
    }

    /// The file that names the pieces.
    pub fn list(&self) -> PathBuf {
        self.whole.with_extension("pvtu")
    }

    /// The file of a process.
    pub fn piece(&self, rank: usize) -> PathBuf {
        let stem = self.whole.file_stem().unwrap_or_default();
        let name = format!("{}_p{rank}.vtu", stem.to_string_lossy());
        self.whole.with_file_name(name)
    }

    /// Removes a list that lies here, and the pieces that it names.
    ///
    /// # Errors
    /// [`ObserveError::Write`] for a list that cannot be removed.
    pub fn remove(&self) -> Result<(), ObserveError> {
        let list = self.list();
        if !list.exists() {
            return Ok(());
        }
        let named = regular_file::read_to_string(&list).unwrap_or_default();
        std::fs::remove_file(&list).map_err(|source| ObserveError::Write { path: list, source })?;
        let stem = self.whole.file_stem().unwrap_or_default();
        let begin = format!("{}_p", escape(&stem.to_string_lossy()));
        let sources = named.split("Source=\"").skip(1);
        let rank_of = |source: &str| -> Option<usize> {
            let name = source.split('"').next()?;
            let rank = name.strip_prefix(&begin)?.strip_suffix(".vtu")?;
            rank.parse().ok()
        };
        for rank in sources.filter_map(rank_of) {
            // without a list, a piece that cannot be removed does no harm
            let _ = std::fs::remove_file(self.piece(rank));
        }
        Ok(())
    }

    /// Writes the list over the pieces of some processes, whose fields are those of `like`.
    ///
    /// # Errors
    /// [`ObserveError::NotShared`] for a piece that is not there, or as [`write_pvtu`].
    fn write_list(&self, ranks: &[usize], like: &Snapshot) -> Result<(), ObserveError> {
        let pieces: Vec<PathBuf> = ranks.iter().map(|&rank| self.piece(rank)).collect();
        match missing(&pieces) {
            Some(path) => Err(ObserveError::NotShared { path }),
            None => write_pvtu(&self.list(), &pieces, like),
        }
    }
}

/// The first of some files of one folder that does not appear there.
fn missing(files: &[PathBuf]) -> Option<PathBuf> {
    let name = files.first()?.parent()?;
    let folder = match name.as_os_str().is_empty() {
        true => Path::new("."),
        false => name,
    };
    for look in 0.. {
        // a list of the folder is fresh where what is known of a single name need not be
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let names: HashSet<_> = entries.map(|entry| entry.file_name()).collect();
        let is_there = |file: &Path| file.file_name().is_some_and(|name| names.contains(name));
        let lost = files.iter().find(|file| !is_there(file))?;
        if look == LOOKS {
            return Some(lost.clone());
        }
        std::thread::sleep(LOOK);
    }
    None
}

/// Collective where there are several processes: the result of this one, or the error of the first that failed, on all.
///
/// # Errors
/// Its own without others, else [`ObserveError::OfProcess`], which names `path` to a program.
pub fn agreed<T>(
    ranks: Option<&dyn Ranks>,
    own: Result<T, ObserveError>,
    path: &Path,
) -> Result<T, ObserveError> {
    let Some(ranks) = ranks else {
        return own;
    };
    let told = own
        .as_ref()
        .err()
        .map(|error| format!("process {} of {}: {error}", ranks.rank(), ranks.count()));
    match first_text(ranks, told.as_deref()) {
        Some(message) => Err(ObserveError::OfProcess {
            path: path.to_path_buf(),
            message,
        }),
        None => own,
    }
}

/// Collective: writes the piece of each process, which has none where its snapshot has no cells, and the list over all; in place of the file `whole`.
///
/// # Errors
/// The error of the first process that could not write, on all.
pub fn write_pieces(whole: &Path, own: &Snapshot, ranks: &dyn Ranks) -> Result<(), ObserveError> {
    let files = PieceFiles::new(whole);
    let cells = own.shapes.len();
    let written = match cells {
        0 => Ok(()),
        _ => write_vtu(&files.piece(ranks.rank()), own, Compression::default()),
    };
    agreed(Some(ranks), written, whole)?;
    let cells = ranks.gather_words(&[cells as u64]);
    let having: Vec<usize> = (0..cells.len()).filter(|&r| cells[r] != [0]).collect();
    let listed = match ranks.rank() {
        0 => files.write_list(&having, own),
        _ => Ok(()),
    };
    agreed(Some(ranks), listed, whole)
}

/// Name of a VTU or PVTU file without its extension and without the number of a process.
pub(super) fn stem(file: &str) -> Option<&str> {
    if let Some(stem) = file.strip_suffix(".pvtu") {
        return Some(stem);
    }
    let stem = file.strip_suffix(".vtu")?;
    let is_number = |n: &str| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit());
    let of_process = stem.rsplit_once("_p").filter(|(_, rank)| is_number(rank));
    Some(of_process.map_or(stem, |(whole, _)| whole))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::vtu::Field;
    use crate::tensor::Vector;

    fn snapshot() -> Snapshot {
        let mut snapshot = Snapshot::default();
        snapshot.push_vertices(&[Vector::<1>::new(0.5)]);
        snapshot.point_fields = vec![
            Field::vector("u", &[Vector::<1>::new(2.0)]),
            Field::identifiers("GlobalPointIds", vec![7]),
        ];
        snapshot
    }

    #[test]
    fn a_list_names_pieces_and_the_type_of_each_field() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("a.b.vtu");
        let files = PieceFiles::new(&whole);
        for rank in [0, 12] {
            write_vtu(&files.piece(rank), &snapshot(), Compression::default()).unwrap();
        }
        files.write_list(&[0, 12], &snapshot()).unwrap();
        let text = std::fs::read_to_string(folder.path().join("a.b.pvtu")).unwrap();
        for wanted in [
            "<PPointData Vectors=\"u\" GlobalIds=\"GlobalPointIds\">",
            "<PDataArray type=\"Float64\" Name=\"u\" NumberOfComponents=\"3\"/>",
            "<PDataArray type=\"Int64\" IdType=\"1\" Name=\"GlobalPointIds\"/>",
            "<Piece Source=\"a.b_p0.vtu\"/>\n    <Piece Source=\"a.b_p12.vtu\"/>",
        ] {
            assert!(text.contains(wanted), "{wanted} in {text}");
        }
        // what it does not name stays
        let other = files.piece(3);
        std::fs::write(&other, b"another").unwrap();
        files.remove().unwrap();
        assert!(!files.piece(0).exists() && !files.piece(12).exists() && !files.list().exists());
        assert!(other.exists());
    }

    #[test]
    fn a_piece_that_is_not_there_is_named_and_no_list_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("a.vtu");
        let files = PieceFiles::new(&whole);
        write_vtu(&files.piece(0), &snapshot(), Compression::default()).unwrap();
        let error = files.write_list(&[0, 1], &snapshot()).unwrap_err();
        let said = error.to_string();
        assert!(
            said.contains("a_p1.vtu") && said.contains("--output"),
            "{said}"
        );
        assert!(!files.list().exists());
    }

    #[test]
    fn stems_are_those_of_the_file_of_one_process() {
        let stems = ["a_0001.vtu", "a_0001.pvtu", "a_0001_p12.vtu"].map(stem);
        assert_eq!(stems, [Some("a_0001"); 3]);
        assert_eq!(stem("a_plate.vtu"), Some("a_plate"));
        assert_eq!(stem("a_0001.csv"), None);
    }
}
