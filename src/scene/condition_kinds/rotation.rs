//! Rigid rotations, as the displacements `(R(θ) − I)(x − c)` that they are.

use schemars::JsonSchema;
use serde::Deserialize;

use super::ConditionKind;
use crate::scene::components::Components;
use crate::scene::condition_at::ConditionAt;
use crate::scene::conditions::{Condition, Prescribed};
use crate::scene::error::SceneError;
use crate::scene::expression::Expression;
use crate::scene::region::position;
use crate::scene::spec::ShapeSpec;
use crate::scene::value::{Coordinates, Text};
use crate::tensor::{AXES, Tensor, Vector};

/// A rigid rotation: exactly one of `on` and `inside`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct RotationSpec {
    /// A named set of the mesh.
    pub on: Option<Text>,
    /// All sites inside a shape.
    pub inside: Option<ShapeSpec>,
    /// A point of the axis.
    pub center: Coordinates,
    /// Direction of the axis in 3D, of any length; in a plane the axis is z.
    pub axis: Option<Coordinates>,
    /// Angle in degrees, right-handed about the axis (counter-clockwise in a plane); may depend on the time.
    pub angle: Expression,
    /// Stages of the scene in which it acts; all if left out. After the stage in which it begins it keeps the values of its end.
    pub stages: Option<Vec<Text>>,
}

impl ConditionKind for RotationSpec {
    fn build<const D: usize>(&self, at: &ConditionAt<'_, D>) -> Result<Condition<D>, SceneError> {
        let (place, name) = (at.place, at.name);
        if D == 1 {
            return Err(
                SceneError::dimension(format!("`{place}` in a scene of dimension 1"))
                    .label(name.span.clone(), "a bar does not rotate")
                    .help("prescribe a displacement"),
            );
        }
        let angle = format!("{place}.angle");
        at.clock.admits(&angle, &self.angle)?;
        if self.angle.depends_on_position() {
            return Err(
                SceneError::conflict(format!("`{angle}` depends on position"))
                    .label(self.angle.span.clone(), "not a rigid rotation")
                    .help("let the angle be a number or depend on t only"),
            );
        }
        let centre = position::<D>(&format!("{place}.center"), &self.center)?;
        let axis = axis::<D>(place, name, self)?;
        let components = rotated(&axis, &centre, &self.angle);
        let support = at.support(self.on.as_ref(), self.inside.as_ref())?;
        let nodes = at.mesh.nodes.iter().copied().take(1);
        at.finite(&components, nodes)?;
        Ok(at.prescribes(Prescribed::Displacement(support), components))
    }

    fn stages(&self) -> Option<&[Text]> {
        self.stages.as_deref()
    }
}

/// The generator `W` of a rotation: `W r = k × r` with the unit vector k along the axis.
fn axis<const D: usize>(
    place: &str,
    name: &Text,
    spec: &RotationSpec,
) -> Result<Tensor<D>, SceneError> {
    let k = match (&spec.axis, D) {
        (None, 2) => [0.0, 0.0, 1.0],
        (Some(typed), 2) => {
            return Err(
                SceneError::dimension(format!("`{place}.axis` in a scene of dimension 2"))
                    .label(typed.span.clone(), "the axis of a plane is z")
                    .help("remove `axis`"),
            );
        }
        (None, _) => {
            return Err(SceneError::missing(format!("`{place}` has no `axis`"))
                .label(name.span.clone(), "about which axis?")
                .help("add axis = [0, 0, 1]"));
        }
        (Some(typed), _) => {
            let k = position::<D>(&format!("{place}.axis"), typed)?;
            match k
                .try_normalize(1e-300)
                .filter(|k| k.iter().all(|k| k.is_finite()))
            {
                Some(k) => std::array::from_fn(|i| k[i]),
                None => {
                    return Err(SceneError::wrong_value(format!(
                        "`{place}.axis` has no direction"
                    ))
                    .label(typed.span.clone(), "zero")
                    .help("write a direction such as [0, 0, 1]"));
                }
            }
        }
    };
    let cross = [[0.0, -k[2], k[1]], [k[2], 0.0, -k[0]], [-k[1], k[0], 0.0]];
    Ok(Tensor::from_fn(|i, j| cross[i][j]))
}

/// The displacements of a rotation by `angle` degrees, exact for any angle: `sin θ W r + 2 sin²(θ/2) W² r`.
///
/// Source: Rodrigues' formula, with `1 − cos θ` written so that small angles lose no digits.
fn rotated<const D: usize>(
    generator: &Tensor<D>,
    centre: &Vector<D>,
    angle: &Expression,
) -> Components<D> {
    let square = generator * generator;
    let of_radians = |factor: &str| format!("sin(({})*pi/{factor})", angle.text);
    let row = |matrix: &Tensor<D>, i: usize| {
        let term = |j: usize| format!("({:?})*({}-({:?}))", matrix[(i, j)], AXES[j], centre[j]);
        let used = (0..D).filter(|&j| matrix[(i, j)] != 0.0).map(term);
        let terms: Vec<String> = used.collect();
        match terms.is_empty() {
            true => "0".to_owned(),
            false => terms.join("+"),
        }
    };
    let component = |i: usize| {
        let text = format!(
            "{}*({})+2*{}^2*({})",
            of_radians("180"),
            row(generator, i),
            of_radians("360"),
            row(&square, i)
        );
        // made of an expression that has been read
        let read = Expression::parse_with(&text, angle.tables())
            .unwrap_or_else(|_| Expression::constant(f64::NAN));
        read.at(angle.span.clone())
    };
    Components(std::array::from_fn(|i| Some(component(i))))
}
