//! Numbers, and zones of every shape and place, that are drawn by a seed.

use crate::{meshes::affine::Family, tangents::Numbers};

/// Places of zones: about the middle, on a side, on a corner, and from side to side.
pub(super) const PLACES: [&str; 4] = ["inside", "at a side", "in a corner", "across"];

/// Numbers that are drawn.
pub(crate) struct Draw(Numbers);

impl Draw {
    /// Numbers of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Numbers(seed))
    }

    /// A number between two others.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (1.0 + self.0.draw()) * (high - low)
    }

    /// One of a list.
    pub fn one<T: Copy>(&mut self, list: &[T]) -> T {
        let k = self.within(0.0, list.len() as f64) as usize;
        list[k.min(list.len() - 1)]
    }

    /// A ball, or a box of about its size, as it is typed.
    pub fn ball_or_box(&mut self, middle: &[f64], radius: f64) -> String {
        if self.one(&[true, false]) {
            return format!("ball = {{ center = {middle:?}, radius = {radius} }}");
        }
        let mut at = |by: f64| -> Vec<f64> {
            let each = middle.iter();
            each.map(|x| x + by * radius * self.within(0.7, 1.2))
                .collect()
        };
        format!("box = {{ min = {:?}, max = {:?} }}", at(-1.0), at(1.0))
    }
}

/// Draws the zone of a scene, as it is typed.
pub(super) fn zone<const D: usize>(
    draw: &mut Draw,
    family: &Family,
    place: &str,
    radius: f64,
) -> String {
    let [low, high] = family.extent;
    let mut middle = [0.0; D];
    for i in 0..D {
        let off = 0.05 * (high[i] - low[i]);
        middle[i] = 0.5 * (low[i] + high[i]) + draw.within(-off, off);
    }
    let sided = match place {
        "at a side" => 1,
        "in a corner" => D,
        _ => 0,
    };
    let first = draw.within(0.0, D as f64) as usize;
    for k in 0..sided {
        let i = (first + k) % D;
        middle[i] = draw.one(&[low[i], high[i]]) + draw.within(-0.25, 0.25) * radius;
    }
    let mut block = [0.0; 3];
    block[..D].copy_from_slice(&middle);
    middle.copy_from_slice(&(family.place)(block)[..D]);
    let list = |x: &[f64]| format!("{x:?}");
    let shape = match place {
        "across" => "box",
        _ if D == 2 => draw.one(&["box", "ball", "polygon"]),
        _ => draw.one(&["box", "ball"]),
    };
    match shape {
        "ball" => format!("ball = {{ center = {}, radius = {radius} }}", list(&middle)),
        "polygon" => {
            let turned = draw.within(0.0, 1.2);
            let corners: Vec<String> = (0..5)
                .map(|k| {
                    let (angle, r) = (turned + 1.2566 * k as f64, radius * draw.within(0.8, 1.2));
                    format!(
                        "[{}, {}]",
                        middle[0] + r * angle.cos(),
                        middle[1] + r * angle.sin()
                    )
                })
                .collect();
            format!("polygon = [{}]", corners.join(", "))
        }
        _ => {
            let mut corners = [middle; 2];
            for i in 0..D {
                corners[0][i] -= radius * draw.within(0.8, 1.1);
                corners[1][i] += radius * draw.within(0.8, 1.1);
            }
            if place == "across" {
                let i = first % D;
                let whole = high[i] - low[i];
                (corners[0][i], corners[1][i]) = (low[i] - whole, high[i] + whole);
            }
            format!(
                "box = {{ min = {}, max = {} }}",
                list(&corners[0]),
                list(&corners[1])
            )
        }
    }
}
