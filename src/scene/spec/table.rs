//! Tables of a scene.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::scene::table::Table;
use crate::scene::value::{Coordinates, Text};

/// A function of one number by its values at some, linear between them and constant beyond: exactly one of `points` and `file`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct TableSpec {
    /// Pairs of argument and value, arguments increasing.
    pub points: Option<Vec<Coordinates>>,
    /// A file of two columns, relative to the scene; arguments increase.
    pub file: Option<Text>,
    /// The table that expressions share; its rows may come later.
    #[serde(skip)]
    pub(crate) held: Option<Table>,
}
