//! What of a model makes its results doubtful, and is told by `check` and by `run`.

use crate::coupling::{CellRole, Model};

/// What partial stress does where its elements meet the surface of the body: measured in `docs/bars.md`.
pub(super) fn one_sided<const D: usize>(model: &Model<D>) -> Option<String> {
    if D == 1 || !model.roles.contains(&CellRole::StressElement) {
        return None;
    }
    let at_surface = model.mesh.cells_at_boundary();
    let cells = at_surface.iter().zip(&model.roles);
    let count = cells
        .filter(|(outer, role)| **outer && **role == CellRole::StressElement)
        .count();
    (count > 0).then(|| {
        format!(
            "{count} elements with a partial stress lie at the surface of the body, where families are one-sided: strains of the transition zone may alternate from element to element, the more the wider it is and the larger the horizon over spacing (docs/bars.md); enclose it in elements, or use another coupling"
        )
    })
}
