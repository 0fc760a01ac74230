//! One entry for all mesh files.
