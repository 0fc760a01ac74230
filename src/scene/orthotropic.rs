//! Orthotropic materials of finite elements: their constants and their axes, checked.

use std::sync::Arc;

use super::bounds_checks;
use super::elasticity::Elasticity;
use super::error::SceneError;
use super::expression::Expression;
use super::solve::still;
use super::spec::OrthotropicSpec;
use super::value::{Number, Text};
use crate::material::{
    Axes, EngineeringConstants, Kinematics, Orthotropic, OrthotropicError, PAIRS,
};
use crate::tensor::{Tensor, Vector, padded};

/// Least sine of the angle between the two vectors that give the axes of a solid.
const PARALLEL: f64 = 1e-6;

/// An orthotropic material, as a scene types it.
struct Typed<'a> {
    name: &'a Text,
    spec: &'a OrthotropicSpec,
    kinematics: Kinematics,
}

/// The elasticity of an orthotropic material.
///
/// # Errors
/// A [`SceneError`] for a constant that is missing, out of its bounds, or at odds with others, and for axes that the kinematics do not have.
pub(super) fn elasticity<const D: usize>(
    name: &Text,
    spec: &OrthotropicSpec,
    kinematics: Kinematics,
) -> Result<Elasticity<D>, SceneError> {
    let typed = Typed {
        name,
        spec,
        kinematics,
    };
    let constants = typed.constants::<D>()?;
    let body =
        Orthotropic::new(&constants, kinematics).map_err(|error| typed.without_energy(error))?;
    Ok(Elasticity::Orthotropic {
        body,
        axes: typed.axes::<D>()?,
    })
}

/// Returns true if the material has an expansion.
pub(super) fn expands(spec: &OrthotropicSpec) -> bool {
    [&spec.alpha1, &spec.alpha2, &spec.alpha3]
        .into_iter()
        .any(Option::is_some)
}

impl Typed<'_> {
    fn place(&self, key: &str) -> String {
        format!("materials.{}.orthotropic.{key}", self.name)
    }

    /// The number of a key that the kinematics need; zero of one that they do not.
    fn needed(
        &self,
        (key, number): (&str, Option<&Number>),
        is_needed: bool,
        check: impl Fn(&str, &Number) -> Result<f64, SceneError>,
    ) -> Result<f64, SceneError> {
        match number {
            Some(number) => check(&self.place(key), number),
            None if !is_needed => Ok(0.0),
            None => Err(SceneError::missing(format!(
                "`materials.{}.orthotropic` lacks `{key}`, which kinematics = \"{}\" need",
                self.name,
                self.kinematics.name()
            ))
            .label(self.name.span.clone(), format!("`{key}` belongs here"))
            .help(format!("add `{key} = ...`"))),
        }
    }

    fn constants<const D: usize>(&self) -> Result<EngineeringConstants, SceneError> {
        let spec = self.spec;
        let normals = Orthotropic::<D>::normals(self.kinematics);
        let young = [
            ("e1", Some(&spec.e1)),
            ("e2", spec.e2.as_ref()),
            ("e3", spec.e3.as_ref()),
        ];
        let poisson = [
            ("nu12", &spec.nu12),
            ("nu13", &spec.nu13),
            ("nu23", &spec.nu23),
        ];
        let shear = [("g12", &spec.g12), ("g13", &spec.g13), ("g23", &spec.g23)];
        let expansion = [
            ("alpha1", &spec.alpha1),
            ("alpha2", &spec.alpha2),
            ("alpha3", &spec.alpha3),
        ];
        let finite = |place: &str, number: &Number| {
            bounds_checks::within(
                place,
                number,
                number.value.is_finite(),
                "must be a number",
                "give a finite number",
            )
        };
        let mut found = EngineeringConstants::default();
        let is_heated = expands(spec);
        for k in 0..3 {
            let (first, second) = PAIRS[k];
            debug_assert!(first < second);
            found.young[k] = self.needed(young[k], k < normals, bounds_checks::modulus)?;
            let (key, number) = poisson[k];
            found.poisson[k] = self.needed((key, number.as_ref()), second < normals, finite)?;
            let (key, number) = shear[k];
            found.shear[k] =
                self.needed((key, number.as_ref()), second < D, bounds_checks::modulus)?;
            let (key, number) = expansion[k];
            found.expansion[k] =
                self.needed((key, number.as_ref()), is_heated && k < normals, finite)?;
        }
        Ok(found)
    }

    fn without_energy(&self, error: OrthotropicError) -> SceneError {
        let spec = self.spec;
        let (number, help) = match error {
            OrthotropicError::Ratio { pair, .. } => {
                let number = match pair {
                    "12" => &spec.nu12,
                    "13" => &spec.nu13,
                    _ => &spec.nu23,
                };
                (
                    number,
                    "nu12 is the contraction along 2 under a stress along 1; of tables that give nu21, nu12 = nu21 E1/E2",
                )
            }
            OrthotropicError::Determinant { .. } => {
                (&spec.nu23, "make one of the Poisson's ratios smaller")
            }
        };
        let span = number
            .as_ref()
            .map_or(self.name.span.clone(), |n| n.span.clone());
        SceneError::wrong_value(format!("`materials.{}.orthotropic`: {error}", self.name))
            .label(span, "no elastic material")
            .help(help)
    }

    /// Refuses axes of another dimension.
    fn refuse_axes(
        &self,
        typed: Option<(&str, &Expression)>,
        why: &str,
        help: &str,
    ) -> Result<(), SceneError> {
        let Some((key, expression)) = typed else {
            return Ok(());
        };
        Err(
            SceneError::dimension(format!("`{}` is set, and {why}", self.place(key)))
                .label(expression.span.clone(), "no such axes")
                .help(help.to_owned()),
        )
    }

    fn axes<const D: usize>(&self) -> Result<Axes<D>, SceneError> {
        let spec = self.spec;
        let angle = spec.angle.as_ref().map(|angle| ("angle", angle));
        let first =
            |typed: &Option<Vec<Expression>>| typed.as_ref().and_then(|list| list.first().cloned());
        let (one, two) = (first(&spec.axis_1), first(&spec.axis_2));
        let vector = (one.as_ref().map(|e| ("axis-1", e))).or(two.as_ref().map(|e| ("axis-2", e)));
        match D {
            1 => {
                self.refuse_axes(angle.or(vector), "a bar runs along axis 1", "remove it")?;
                Ok(Axes::Fixed(Tensor::identity()))
            }
            2 => {
                self.refuse_axes(
                    vector,
                    "axes in the plane are given by an angle",
                    "use angle = ..., in degrees from x towards y",
                )?;
                self.by_angle()
            }
            _ => {
                self.refuse_axes(
                    angle,
                    "axes in space are given by two vectors",
                    "use axis-1 = [...] and axis-2 = [...]",
                )?;
                self.by_vectors()
            }
        }
    }

    fn field<const D: usize>(&self, key: &str, expression: &Expression) -> Result<(), SceneError> {
        bounds_checks::no_further_axes::<D>(&self.place(key), expression)?;
        still(&self.place(key), expression)
    }

    fn by_angle<const D: usize>(&self) -> Result<Axes<D>, SceneError> {
        let Some(angle) = self.spec.angle.clone() else {
            return Ok(Axes::Fixed(Tensor::identity()));
        };
        self.field::<D>("angle", &angle)?;
        let turned = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Tensor::from_fn(|i, j| [[cos, -sin], [sin, cos]][i.min(1)][j.min(1)])
        };
        match angle.as_constant() {
            Some(degrees) => self.checked("angle", turned(degrees), &angle),
            None => Ok(Axes::Field(Arc::new(move |x| {
                turned(angle.eval(&padded(x)))
            }))),
        }
    }

    fn by_vectors<const D: usize>(&self) -> Result<Axes<D>, SceneError> {
        let (one, two) = match (&self.spec.axis_1, &self.spec.axis_2) {
            (None, None) => return Ok(Axes::Fixed(Tensor::identity())),
            (Some(one), Some(two)) => (one.clone(), two.clone()),
            (one, _) => {
                let [there, missing] = match one {
                    Some(_) => ["axis-1", "axis-2"],
                    None => ["axis-2", "axis-1"],
                };
                return Err(SceneError::missing(format!(
                    "`materials.{}.orthotropic` has `{there}` and lacks `{missing}`",
                    self.name
                ))
                .label(self.name.span.clone(), "axes by two vectors")
                .help(format!("add `{missing} = [...]`")));
            }
        };
        for (key, list) in [("axis-1", &one), ("axis-2", &two)] {
            if list.len() != 3 {
                return Err(SceneError::wrong_value(format!(
                    "`{}` has {} components",
                    self.place(key),
                    list.len()
                ))
                .label(self.name.span.clone(), "a vector in space")
                .help("give three components, numbers or expressions in x, y and z"));
            }
            list.iter().try_for_each(|e| self.field::<D>(key, e))?;
        }
        let is_fixed = one.iter().chain(&two).all(|e| e.as_constant().is_some());
        let label = one[0].clone();
        let at = move |x: &Vector<D>| {
            let x = padded(x);
            let of = |list: &[Expression]| Vector::<3>::from_fn(|k, _| list[k].eval(&x));
            perpendicular(&of(&one), &of(&two))
        };
        match is_fixed {
            true => self.checked("axis-1", at(&Vector::zeros()), &label),
            false => Ok(Axes::Field(Arc::new(at))),
        }
    }

    /// Axes that are the same everywhere.
    fn checked<const D: usize>(
        &self,
        key: &str,
        axes: Tensor<D>,
        typed: &Expression,
    ) -> Result<Axes<D>, SceneError> {
        match axes.iter().all(|x| x.is_finite()) {
            true => Ok(Axes::Fixed(axes)),
            false => Err(no_axes(&self.place(key), typed, "")),
        }
    }
}

/// The axes of two vectors as columns: along the first, along the part of the second perpendicular to it, and along their vector product; not numbers of vectors that are zero or parallel.
fn perpendicular<const D: usize>(one: &Vector<3>, two: &Vector<3>) -> Tensor<D> {
    let first = one.normalize();
    let rest = two - first * first.dot(two);
    let is_plain = rest.norm() > PARALLEL * two.norm();
    let second = if is_plain {
        rest.normalize()
    } else {
        rest * f64::NAN
    };
    // once more, for the digits that a small part has lost
    let second = (second - first * first.dot(&second)).normalize();
    let columns = [first, second, first.cross(&second)];
    Tensor::from_fn(|i, j| columns[j][i])
}

/// The error of axes that are none.
pub(super) fn no_axes(place: &str, typed: &Expression, at: &str) -> SceneError {
    SceneError::wrong_value(format!("`{place}` gives no axes{at}"))
        .label(typed.span.clone(), "not a number, zero, or parallel to the other vector")
        .help("give an angle that is a number, or two vectors that are neither zero nor parallel, wherever the material is")
}
