//! Generated meshes of scenes, as their knobs see them.

use bondline::scene::spec::{AxisSpec, MeshSpec, SceneSpec};

/// A generated mesh: the table's name, its corners, its axes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Generated {
    pub shape: &'static str,
    pub min: Vec<f64>,
    pub max: Vec<f64>,
    pub axes: Vec<(&'static str, Axis)>,
}

impl Generated {
    /// Edge of the first cells along the first axis.
    pub fn cell(&self) -> Option<f64> {
        let length = self.max.first()? - self.min.first()?;
        Some(match self.axes.first()?.1 {
            Axis::Cells(n) => length / n.max(1) as f64,
            Axis::Spacing(s) | Axis::Graded { spacing: s, .. } => s,
        })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Axis {
    Cells(usize),
    Spacing(f64),
    Graded { spacing: f64, largest: Option<f64> },
}

/// The generated mesh of a scene; none for one from a file, or for points from one.
pub(super) fn generated(spec: &SceneSpec) -> Option<Generated> {
    let axis = |a: &AxisSpec| match a {
        AxisSpec::Cells(n) => Axis::Cells(n.value),
        AxisSpec::Spacing(s) => Axis::Spacing(s.value),
        AxisSpec::Graded(g) => Axis::Graded {
            spacing: g.spacing.value,
            largest: g.largest.as_ref().map(|l| l.value),
        },
    };
    Some(match spec.mesh.as_ref()? {
        MeshSpec::Line(m) => Generated {
            shape: "line",
            min: m.min.values.clone(),
            max: m.max.values.clone(),
            axes: vec![("x", axis(m.x.get_ref()))],
        },
        MeshSpec::Rectangle(m) => Generated {
            shape: "rectangle",
            min: m.min.values.clone(),
            max: m.max.values.clone(),
            axes: vec![("x", axis(m.x.get_ref())), ("y", axis(m.y.get_ref()))],
        },
        MeshSpec::Box(m) => Generated {
            shape: "box",
            min: m.min.values.clone(),
            max: m.max.values.clone(),
            axes: vec![
                ("x", axis(m.x.get_ref())),
                ("y", axis(m.y.get_ref())),
                ("z", axis(m.z.get_ref())),
            ],
        },
        MeshSpec::File(_) => return None,
    })
}

/// Corners of the cut-outs of a generated mesh.
pub(crate) fn cutouts(spec: &SceneSpec) -> Vec<(Vec<f64>, Vec<f64>)> {
    let cutouts = match &spec.mesh {
        Some(MeshSpec::Line(m)) => &m.cutouts,
        Some(MeshSpec::Rectangle(m)) => &m.cutouts,
        Some(MeshSpec::Box(m)) => &m.cutouts,
        Some(MeshSpec::File(_)) | None => return Vec::new(),
    };
    let corners = cutouts.values();
    corners
        .map(|c| (c.min.values.clone(), c.max.values.clone()))
        .collect()
}

/// Corners of a generated mesh.
pub(crate) fn corners(spec: &SceneSpec) -> Option<(Vec<f64>, Vec<f64>)> {
    generated(spec).map(|m| (m.min, m.max))
}
