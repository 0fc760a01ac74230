//! Whole files or none.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use super::ObserveError;

/// Makes the folder that `path` lies in.
///
/// # Errors
/// [`ObserveError::Folder`].
pub(super) fn create_parent(path: &Path) -> Result<(), ObserveError> {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => {
            std::fs::create_dir_all(folder).map_err(|source| ObserveError::Folder {
                path: folder.to_path_buf(),
                source,
            })
        }
        _ => Ok(()),
    }
}

/// Writes a file beside `path` and renames it, so that a reader (or a full disk) never leaves half a file there.
///
/// # Errors
/// [`ObserveError::Folder`] or [`ObserveError::Write`]; the file that lay at `path` before is then still there.
pub(super) fn write_whole(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), ObserveError> {
    static SERIAL: AtomicU64 = AtomicU64::new(0);
    create_parent(path)?;
    let fail = |source| ObserveError::Write {
        path: path.to_path_buf(),
        source,
    };
    let Some(name) = path.file_name() else {
        return Err(fail(std::io::ErrorKind::IsADirectory.into()));
    };
    let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
    let mut part = std::ffi::OsString::from(".");
    part.push(name);
    part.push(format!(".{}-{serial}.part", std::process::id()));
    let part = path.with_file_name(part);
    let written = (|| {
        let mut writer = BufWriter::with_capacity(1 << 20, File::create(&part)?);
        content(&mut writer)?;
        writer.flush()?;
        // some file systems report a full disk only here
        writer.get_ref().sync_all()?;
        std::fs::rename(&part, path)
    })();
    written.map_err(|source| {
        // the first error is the one to report
        let _ = std::fs::remove_file(&part);
        fail(source)
    })
}

/// Passes bytes on and puts `insert` behind the first `after`: vtkio writes no field data, where VTK looks for the time.
pub(super) struct Inserting<'a, W> {
    inner: W,
    head: Vec<u8>,
    after: &'static [u8],
    insert: &'a [u8],
    done: bool,
}

impl<'a, W> Inserting<'a, W> {
    /// Wraps a writer; with an empty `insert` bytes pass unchanged.
    pub(super) fn new(inner: W, after: &'static [u8], insert: &'a [u8]) -> Self {
        Self {
            inner,
            head: Vec::new(),
            after,
            insert,
            done: insert.is_empty(),
        }
    }
}

impl<W: Write> Write for Inserting<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.done {
            return self.inner.write(bytes);
        }
        self.head.extend_from_slice(bytes);
        let found = self
            .head
            .windows(self.after.len())
            .position(|w| w == self.after);
        if let Some(at) = found {
            let cut = at + self.after.len();
            self.inner.write_all(&self.head[..cut])?;
            self.inner.write_all(self.insert)?;
            self.inner.write_all(&self.head[cut..])?;
            self.head = Vec::new();
            self.done = true;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.write_all(&std::mem::take(&mut self.head))?;
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_nothing_beside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/er/table.txt");
        write_whole(&path, |w| w.write_all(b"old")).unwrap();
        let error = write_whole(&path, |w| {
            w.write_all(b"half")?;
            Err(std::io::ErrorKind::StorageFull.into())
        })
        .unwrap_err()
        .to_string();
        assert!(
            error.contains("table.txt") && error.contains("free some space"),
            "{error}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(
            std::fs::read_dir(path.parent().unwrap()).unwrap().count(),
            1
        );
    }

    #[test]
    fn a_file_in_place_of_a_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, b"x").unwrap();
        let error = write_whole(&file.join("out.vtu"), |_| Ok(())).unwrap_err();
        assert!(matches!(error, ObserveError::Folder { .. }), "{error:?}");
        assert!(
            error.to_string().contains("choose another output folder"),
            "{error}"
        );
        let error = write_whole(folder.path(), |_| Ok(())).unwrap_err();
        assert!(matches!(error, ObserveError::Write { .. }), "{error:?}");
    }

    #[test]
    fn an_insert_finds_its_place_across_pieces() {
        for pieces in [&["<a><b>x"][..], &["<a", "><", "b>", "x"], &["<a><b>", "x"]] {
            let mut out = Vec::new();
            let mut writer = Inserting::new(&mut out, b"<b>", b"NEW");
            for piece in pieces {
                writer.write_all(piece.as_bytes()).unwrap();
            }
            writer.flush().unwrap();
            assert_eq!(out, b"<a><b>NEWx");
        }
    }
}
