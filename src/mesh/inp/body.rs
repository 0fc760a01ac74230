//! Content of a part, an instance or the model itself: nodes, elements, sets and surfaces by their numbers.

use rustc_hash::FxHashMap;

use super::kinds::{Face, Kind};

/// Stands for the body itself in its own sets, before it has a number.
pub(super) const THIS: u32 = u32::MAX;

/// A node.
#[derive(Clone, Copy)]
pub(super) struct Node {
    pub number: u64,
    pub x: [f64; 3],
    /// Byte where it stands.
    pub at: usize,
}

/// An element.
#[derive(Clone, Copy)]
pub(super) struct Element {
    pub number: u64,
    pub kind: Kind,
    /// Start of its nodes in [`Body::element_nodes`].
    pub start: usize,
    /// Byte where it stands.
    pub at: usize,
}

impl Element {
    /// One that is left out: sets may name it.
    pub fn left_out(number: u64, at: usize) -> Self {
        Self {
            number,
            kind: Kind::LEFT_OUT,
            start: 0,
            at,
        }
    }
}

/// Numbers `first, first + step, …, last` of nodes or elements.
#[derive(Clone, Copy)]
pub(super) struct Members {
    /// Their owner: a number in the list of bodies, or [`THIS`].
    pub body: u32,
    pub first: u64,
    pub last: u64,
    pub step: u64,
    /// True if a range was asked for, which may have gaps.
    pub range: bool,
    /// Byte where they stand.
    pub at: usize,
}

impl Members {
    /// Places of the members that there are, by the places of all numbers, and how many there are not.
    pub fn find(&self, places: &FxHashMap<u64, u32>) -> (Vec<u32>, u64) {
        let count = (self.last - self.first) / self.step + 1;
        let mut found: Vec<u32> = if count <= places.len() as u64 {
            let numbers = (0..count).map(|i| self.first + i * self.step);
            numbers.filter_map(|n| places.get(&n).copied()).collect()
        } else {
            // a range wider than the mesh
            let inside = |n: u64| {
                (self.first..=self.last).contains(&n) && (n - self.first).is_multiple_of(self.step)
            };
            let all = places.iter();
            all.filter(|(n, _)| inside(**n)).map(|(_, p)| *p).collect()
        };
        found.sort_unstable();
        let missing = count - found.len() as u64;
        (found, missing)
    }
}

/// Named sets in the order of their first mention; names do not mind capitals unless they are quoted.
#[derive(Clone)]
pub(super) struct Sets<T> {
    pub names: Vec<String>,
    pub members: Vec<Vec<T>>,
    keys: FxHashMap<String, usize>,
}

impl<T> Default for Sets<T> {
    fn default() -> Self {
        Self {
            names: Vec::new(),
            members: Vec::new(),
            keys: FxHashMap::default(),
        }
    }
}

/// Returns the key by which a name is looked up: quotes keep capitals, and are no part of it.
pub(super) fn key(name: &str) -> String {
    match unquoted(name) {
        Some(inner) => inner.into(),
        None => name.to_ascii_uppercase(),
    }
}

fn unquoted(name: &str) -> Option<&str> {
    name.strip_prefix('"')?.strip_suffix('"')
}

impl<T: Copy> Sets<T> {
    /// The members of a set, which is begun if there is none of that name.
    pub fn entry(&mut self, name: &str) -> &mut Vec<T> {
        let place = *self.keys.entry(key(name)).or_insert_with(|| {
            self.names.push(unquoted(name).unwrap_or(name).into());
            self.members.push(Vec::new());
            self.names.len() - 1
        });
        &mut self.members[place]
    }

    /// The members of a set.
    pub fn get(&self, name: &str) -> Option<&[T]> {
        let place = *self.keys.get(&key(name))?;
        Some(&self.members[place])
    }
}

/// Sides of elements.
#[derive(Clone, Copy)]
pub(super) struct Sides {
    pub members: Members,
    pub face: Face,
}

/// A part, an instance, or the model itself.
#[derive(Clone, Default)]
pub(super) struct Body {
    /// As first written; empty for the model.
    pub name: String,
    pub nodes: Vec<Node>,
    pub node_places: FxHashMap<u64, u32>,
    pub elements: Vec<Element>,
    pub element_nodes: Vec<u64>,
    pub element_places: FxHashMap<u64, u32>,
    pub node_sets: Sets<Members>,
    pub element_sets: Sets<Members>,
    pub surfaces: Sets<Sides>,
    /// Position of an instance, where it differs from that of its part.
    pub motion: Option<Motion>,
}

impl Body {
    /// The nodes of an element by their numbers.
    pub fn nodes_of(&self, element: &Element) -> &[u64] {
        let count = match element.kind == Kind::LEFT_OUT {
            true => 0,
            false => element.kind.shape.node_count(),
        };
        &self.element_nodes[element.start..][..count]
    }

    /// Gives the body its number, so that sets elsewhere can hold its members.
    pub fn number(&mut self, number: u32) {
        let own = |members: &mut Members| {
            if members.body == THIS {
                members.body = number;
            }
        };
        let sets = [&mut self.node_sets, &mut self.element_sets];
        for members in sets.into_iter().flat_map(|s| &mut s.members).flatten() {
            own(members);
        }
        for sides in self.surfaces.members.iter_mut().flatten() {
            own(&mut sides.members);
        }
    }
}

/// A translation, then a rotation about an axis.
#[derive(Clone, Copy, Default)]
pub(super) struct Motion {
    pub translation: [f64; 3],
    /// Two points of the axis and the angle in degrees.
    pub rotation: Option<([f64; 3], [f64; 3], f64)>,
}

impl Motion {
    /// Returns the position of a point after the motion; one that does not move keeps its bits.
    pub fn apply(&self, x: [f64; 3]) -> [f64; 3] {
        let x: [f64; 3] = std::array::from_fn(|k| x[k] + self.translation[k]);
        let Some((a, b, degrees)) = self.rotation else {
            return x;
        };
        // Rodrigues: v cos + (n × v) sin + n (n · v)(1 − cos)
        let axis: [f64; 3] = std::array::from_fn(|k| b[k] - a[k]);
        let length = dot(axis, axis).sqrt();
        let n = axis.map(|c| c / length);
        let v: [f64; 3] = std::array::from_fn(|k| x[k] - a[k]);
        let (sin, cos) = sine_and_cosine(degrees);
        let across = cross(n, v);
        let along = dot(n, v) * (1.0 - cos);
        std::array::from_fn(|k| a[k] + v[k] * cos + across[k] * sin + n[k] * along)
    }
}

/// Exact at multiples of a right angle, where a plane body has to stay plane.
fn sine_and_cosine(degrees: f64) -> (f64, f64) {
    let turn = degrees.rem_euclid(360.0);
    match turn {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => turn.to_radians().sin_cos(),
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
