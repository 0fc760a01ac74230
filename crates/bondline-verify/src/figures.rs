//! Figures of papers drawn by our own runs, for `verify SUITE --figures FOLDER`.

use std::path::{Path, PathBuf};

use bondline::progress::Progress;

use crate::{bar, continuum_damage, position_aware, variable_horizon};

/// Draws the figures of a suite into a folder.
pub type Draw = fn(&Path, &dyn Progress) -> Result<Vec<PathBuf>, String>;

/// Suites that have figures.
pub const FIGURES: &[(&str, Draw)] = &[
    ("bar", |folder, progress| {
        bar::figures(folder, progress).map_err(|e| e.to_string())?;
        Ok(within(
            folder,
            &["bar_line.svg", "bar_slice.svg", "bar_deviation.svg"],
        ))
    }),
    ("variable-horizon", |folder, progress| {
        variable_horizon::figures(folder, progress).map_err(|e| e.to_string())?;
        Ok(within(
            folder,
            &["bar_horizon.svg", "bar_linear.svg", "bar_quadratic.svg"],
        ))
    }),
    ("pals", position_aware::figures),
    ("damage", continuum_damage::figures),
];

fn within(folder: &Path, names: &[&str]) -> Vec<PathBuf> {
    names.iter().map(|name| folder.join(name)).collect()
}

/// Returns the function that draws the figures of a suite; none if it has none.
pub fn figures(suite: &str) -> Option<Draw> {
    let found = FIGURES.iter().find(|(name, _)| *name == suite);
    found.map(|(_, draw)| *draw)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_belong_to_suites() {
        assert!(FIGURES.iter().all(|(name, _)| crate::suite(name).is_some()));
        assert!(figures("bar").is_some() && figures("patch").is_none());
    }
}
