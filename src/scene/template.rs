//! Commented scenes to start from.

use std::io::Write;
use std::path::Path;

use super::error::SceneError;

/// A scene to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Template {
    /// A coupled bar in one dimension.
    Bar,
    /// A plate with a slit, on a generated mesh.
    #[default]
    Plate,
    /// A plate on a mesh from a file.
    File,
    /// A crack that runs and branches, in explicit dynamics.
    Dynamics,
    /// A crack that is opened in load steps.
    LoadSteps,
}

impl Template {
    /// All templates.
    pub const ALL: [Self; 5] = [
        Self::Bar,
        Self::Plate,
        Self::File,
        Self::Dynamics,
        Self::LoadSteps,
    ];

    /// Its text.
    pub fn text(self) -> &'static str {
        match self {
            Self::Bar => include_str!("templates/bar.toml"),
            Self::Plate => include_str!("templates/plate.toml"),
            Self::File => include_str!("templates/file.toml"),
            Self::Dynamics => include_str!("templates/dynamics.toml"),
            Self::LoadSteps => include_str!("templates/load-steps.toml"),
        }
    }

    /// Writes it to a new file.
    ///
    /// # Errors
    /// [`SceneErrorKind::File`](crate::scene::SceneErrorKind::File) if the file exists already or cannot be written.
    pub fn write(self, path: &Path) -> Result<(), SceneError> {
        let failed = |error: std::io::Error| {
            let help = match error.kind() {
                std::io::ErrorKind::AlreadyExists => {
                    "name another file, or remove this one; nothing is overwritten"
                }
                _ => "check that the folder exists and may be written to",
            };
            SceneError::file(format!(
                "cannot write the template {}: {error}",
                path.display()
            ))
            .help(help)
        };
        let mut file = std::fs::OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(path)
            .map_err(failed)?;
        file.write_all(self.text().as_bytes()).map_err(failed)
    }
}
