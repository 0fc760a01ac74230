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
pub fn write_whole(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), ObserveError> {
    static SERIAL: AtomicU64 = AtomicU64::new(0);
    create_parent(path)?;
    let fail = ObserveError::write(path);
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

/// Forces a renamed file's entry in its folder to the disk, where the system knows of such a thing.
pub(super) fn sync_folder(path: &Path) {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // not every system opens folders; the file itself is on the disk by then
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
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
}
