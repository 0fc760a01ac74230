//! Vector fields of a scene, component by component.

use std::cell::{Cell, RefCell};

use super::bounds_checks;
use super::condition_at::ConditionAt;
use super::error::SceneError;
use super::expression::Expression;
use super::source::Span;
use super::value::Text;
use crate::tensor::{AXES, Vector, padded};

/// A vector field, component by component; components left out are free or zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Components<const D: usize>(pub [Option<Expression>; D]);

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
            && self.function() == other.function()
            && self.held() == other.held()
    }
}

impl<const D: usize> Components<D> {
    /// A field with one component.
    pub fn only(axis: usize, value: Expression) -> Self {
        Self(std::array::from_fn(|k| (k == axis).then(|| value.clone())))
    }

    /// The component along `axis` at `x`, if it is given.
    pub fn at(&self, axis: usize, x: &Vector<D>) -> Option<f64> {
        self.0[axis].as_ref().map(|e| e.eval(&padded(x)))
    }

    /// The component along `axis` at `x` and time `t`, if it is given.
    pub fn at_time(&self, axis: usize, x: &Vector<D>, t: f64) -> Option<f64> {
        self.0[axis].as_ref().map(|e| e.eval_at(&padded(x), t))
    }

    /// The vector at `x` and time `t`, zero where nothing is given.
    pub fn vector(&self, x: &Vector<D>, t: f64) -> Vector<D> {
        Vector::from_fn(|k, _| self.at_time(k, x, t).unwrap_or(0.0))
    }

    /// The component along `axis` at some places and the time `t`, if it is given.
    pub fn values(&self, axis: usize, places: &[Vector<D>], t: f64) -> Option<Vec<f64>> {
        let places: Vec<[f64; 3]> = places.iter().map(padded).collect();
        Some(self.0[axis].as_ref()?.values_at(&places, t))
    }

    /// Hands the field at the time `t` to `pass`, which asks for its values in the same order whenever it is called.
    ///
    /// Functions are asked for all of them at once: `pass` is then called twice, first with a field of zeros.
    pub fn visit<T>(
        &self,
        t: f64,
        mut pass: impl FnMut(&dyn Fn(&Vector<D>) -> Vector<D>) -> T,
    ) -> T {
        if !self.0.iter().flatten().any(|e| e.function().is_some()) {
            return pass(&|x| self.vector(x, t));
        }
        let places = RefCell::new(Vec::new());
        pass(&|x| {
            places.borrow_mut().push(*x);
            Vector::zeros()
        });
        let places = places.into_inner();
        let values: [_; D] = std::array::from_fn(|k| self.values(k, &places, t));
        let next = Cell::new(0..places.len());
        pass(&|x| {
            let mut rest = next.take();
            let at = rest.next().filter(|&i| places[i] == *x);
            next.set(rest);
            Vector::from_fn(|k, _| match (&values[k], at) {
                (Some(values), Some(i)) => values[i],
                (Some(_), None) => self.at_time(k, x, t).unwrap_or(0.0),
                (None, _) => 0.0,
            })
        })
    }

    /// The same field with the values that it has at the time `t`, at any time.
    pub(crate) fn held_at(self, t: f64) -> Self {
        Self(self.0.map(|component| Some(component?.held_at(t))))
    }

    /// Returns true if any component changes with time.
    pub fn depends_on_time(&self) -> bool {
        self.0.iter().flatten().any(Expression::depends_on_time)
    }

    /// Returns true if any component changes in space.
    pub fn depends_on_position(&self) -> bool {
        self.0.iter().flatten().any(Expression::depends_on_position)
    }
}

/// The error of a component along an axis that the scene does not have.
pub(super) fn no_such_axis<const D: usize>(place: &str, axis: usize, span: &Span) -> SceneError {
    let axis = AXES[axis];
    SceneError::dimension(format!("`{place}.{axis}` in a scene of dimension {D}"))
        .label(span.clone(), "no such axis")
        .help(format!("remove `{axis}`"))
}

/// The components that a scene types, of which there is one at least.
pub(crate) fn components<const D: usize>(
    place: &str,
    name: &Text,
    given: [&Option<Expression>; 3],
) -> Result<Components<D>, SceneError> {
    if let Some((k, e)) = (D..3).find_map(|k| given[k].as_ref().map(|e| (k, e))) {
        return Err(no_such_axis::<D>(place, k, &e.span));
    }
    for (axis, expression) in AXES.iter().zip(given) {
        if let Some(e) = expression {
            bounds_checks::no_further_axes::<D>(&format!("{place}.{axis}"), e)?;
        }
    }
    if given.iter().all(|e| e.is_none()) {
        return Err(
            SceneError::missing(format!("`{place}` prescribes no component"))
                .label(name.span.clone(), "nothing prescribed")
                .help(format!(
                    "add {}",
                    ["x = 0", "x = 0 or y = 0", "x = 0, y = 0 or z = 0"][D - 1]
                )),
        );
    }
    Ok(Components(std::array::from_fn(|k| given[k].clone())))
}

impl<const D: usize> ConditionAt<'_, D> {
    /// The components that a condition types, as [`components`], each admitted by the clock of the scene.
    pub fn components(&self, given: [&Option<Expression>; 3]) -> Result<Components<D>, SceneError> {
        let components = components::<D>(self.place, self.name, given)?;
        for (axis, e) in AXES.iter().zip(&components.0) {
            if let Some(e) = e {
                self.clock.admits(&format!("{}.{axis}", self.place), e)?;
            }
        }
        Ok(components)
    }

    /// Checks that all components are numbers at some places.
    pub fn finite(
        &self,
        components: &Components<D>,
        positions: impl Iterator<Item = Vector<D>>,
    ) -> Result<(), SceneError> {
        let moving = components.depends_on_time();
        let instants = self.clock.instants(moving);
        let all: Vec<Vector<D>> = positions.collect();
        for positions in all.chunks(TOGETHER) {
            let of_instant = |&t: &f64| -> [Option<Vec<f64>>; D] {
                std::array::from_fn(|k| components.values(k, positions, t))
            };
            let values: Vec<_> = instants.iter().map(of_instant).collect();
            for (i, x) in positions.iter().enumerate() {
                for (t, values) in instants.iter().zip(&values) {
                    for k in 0..D {
                        let value = values[k].as_ref().map_or(0.0, |v| v[i]);
                        if !value.is_finite() {
                            let when = match moving {
                                true => format!(", t = {t}"),
                                false => String::new(),
                            };
                            let at = format!("{:?}{when}", x.as_slice());
                            return Err(self.not_finite(components, k, value, &at));
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// The error of a component that is no number `at` a place.
    fn not_finite(
        &self,
        components: &Components<D>,
        axis: usize,
        value: f64,
        at: &str,
    ) -> SceneError {
        let typed = components.0[axis].as_ref();
        let span = typed.map_or(self.name.span.clone(), |e| e.span.clone());
        SceneError::wrong_value(format!(
            "`{}.{}` is {value} at {at}",
            self.place, AXES[axis]
        ))
        .label(span, "no finite number there")
        .help("choose between branches with if(condition, a, b), or restrict the condition")
    }
}

/// Positions whose values are looked at together.
const TOGETHER: usize = 4096;
