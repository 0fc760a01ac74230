//! Coulomb friction: places that touch hold on to each other until they slip.
//!
//! The force of friction is that of a spring between the place and the facet, of the stiffness `k` of the contact itself, as far as it is no larger than `μ` times the pressing force:
//!
//! ```text
//! t* = t_n − k Δ ,   t = t* min(1, μ k g / |t*|) ,
//! ```
//!
//! with the motion `Δ` of the place along the facet since the last step and the force `t_n` then. The work of the mean force, `−½ (t_n + t)·Δ`, less what the spring stores more, `½ t²/k`, is dissipated; of a place that opens, all that its spring stored.

use super::surface::Surface;
use super::touch::Touch;
use crate::tensor::Vector;

/// A place at the end of the last step.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Held<const D: usize> {
    place: u32,
    /// Position \[m\].
    at: Vector<D>,
    /// Force of friction \[N\], and the energy of its spring \[J\].
    force: Vector<D>,
    stored: f64,
}

/// Grip of the places that touched, or nearly, at the end of the last step.
#[derive(Clone, Debug, Default)]
pub(super) struct Grip<const D: usize> {
    /// Coefficient of friction.
    friction: f64,
    /// In the order of places.
    held: Vec<Held<D>>,
    /// Memory for the next.
    next: Vec<Held<D>>,
    /// Positions of the corners of facets \[m\]; empty before the first step.
    corners: Vec<Vector<D>>,
    /// Work of friction so far \[J\].
    pub work: f64,
}

impl<const D: usize> Grip<D> {
    pub fn new(friction: f64) -> Self {
        Self {
            friction,
            ..Self::default()
        }
    }

    /// Returns true if there is friction.
    pub fn is_rough(&self) -> bool {
        self.friction > 0.0
    }

    /// Force of friction on a place at the end of the last step.
    fn force_of(&self, place: u32) -> Vector<D> {
        let held = self.held.binary_search_by_key(&place, |held| held.place);
        held.map_or_else(|_| Vector::zeros(), |k| self.held[k].force)
    }

    /// The force that would be without slip: that of the last step, less that of the motion since along the surface.
    fn trial(
        &self,
        (place, x): (u32, &Vector<D>),
        touch: &Touch<D>,
        surface: &Surface<D>,
        corners: &[Vector<D>],
    ) -> Vector<D> {
        let Ok(k) = self.held.binary_search_by_key(&place, |held| held.place) else {
            return Vector::zeros();
        };
        let held = &self.held[k];
        let facet = &surface.facets[touch.facet as usize].corners;
        let moved = facet
            .iter()
            .zip(touch.weights)
            .map(|(&c, w)| (corners[c as usize] - self.corners[c as usize]) * w);
        let motion = x - held.at - moved.sum::<Vector<D>>();
        let force = held.force - motion * touch.stiffness;
        force - touch.normal * touch.normal.dot(&force)
    }

    /// Force of friction on a place at `x` that touches, corners being where they are now.
    pub fn force(
        &self,
        at: (u32, &Vector<D>),
        touch: &Touch<D>,
        surface: &Surface<D>,
        corners: &[Vector<D>],
    ) -> Vector<D> {
        if !self.is_rough() || self.corners.is_empty() {
            return Vector::zeros();
        }
        let trial = self.trial(at, touch, surface, corners);
        let (size, most) = (trial.norm(), self.friction * touch.stiffness * touch.depth);
        if size > most {
            trial * (most / size)
        } else {
            trial
        }
    }

    /// Ends a step, at whose end these places are near others, some of them in touch.
    pub fn commit<'t>(
        &mut self,
        places: impl Iterator<Item = (u32, Vector<D>, Option<&'t Touch<D>>)>,
        surface: &Surface<D>,
        corners: &[Vector<D>],
    ) {
        let mut next = std::mem::take(&mut self.next);
        next.clear();
        // what springs stored goes over into what they store, into the work of forces, and into slip
        let mut spent: f64 = self.held.iter().map(|held| held.stored).sum();
        for (place, at, touch) in places {
            let (mut force, mut stored) = (Vector::zeros(), 0.0);
            if let Some(touch) = touch {
                force = touch.friction;
                stored = 0.5 * force.norm_squared() / touch.stiffness;
                if !self.corners.is_empty() {
                    let before = self.force_of(place);
                    let trial = self.trial((place, &at), touch, surface, corners);
                    spent += 0.5 * (force + before).dot(&(trial - before)) / touch.stiffness;
                }
            }
            spent -= stored;
            next.push(Held {
                place,
                at,
                force,
                stored,
            });
        }
        if !self.corners.is_empty() {
            self.work += spent;
        }
        self.next = std::mem::replace(&mut self.held, next);
        self.corners.clear();
        self.corners.extend_from_slice(corners);
    }

    /// Words for a checkpoint; none without friction.
    pub fn state(&self) -> Vec<u64> {
        if !self.is_rough() {
            return Vec::new();
        }
        let mut words = vec![self.work.to_bits(), self.held.len() as u64];
        for held in &self.held {
            words.push(u64::from(held.place));
            let numbers = held
                .at
                .iter()
                .chain(held.force.iter())
                .chain([&held.stored]);
            words.extend(numbers.map(|x| x.to_bits()));
        }
        let corners = self.corners.iter().flat_map(|x| x.iter());
        words.extend(corners.map(|x| x.to_bits()));
        words
    }

    /// Restores the words of [`Grip::state`]; false if they are those of other surfaces.
    pub fn restore(&mut self, words: &[u64], surface: &Surface<D>) -> bool {
        if !self.is_rough() {
            return words.is_empty();
        }
        let [work, count, words @ ..] = words else {
            return false;
        };
        let size = 2 + 2 * D;
        let Some(end) = (*count as usize)
            .checked_mul(size)
            .filter(|end| *end <= words.len())
        else {
            return false;
        };
        let (of_places, of_corners) = words.split_at(end);
        let corners = surface.corners.len() * D;
        if !(of_corners.is_empty() || of_corners.len() == corners) {
            return false;
        }
        let vector = |words: &[u64]| Vector::from_fn(|a, _| f64::from_bits(words[a]));
        let all = of_places.chunks_exact(size).map(|own| Held {
            place: own[0] as u32,
            at: vector(&own[1..]),
            force: vector(&own[1 + D..]),
            stored: f64::from_bits(own[1 + 2 * D]),
        });
        let held: Vec<Held<D>> = all.collect();
        if held
            .iter()
            .any(|h| h.place as usize >= surface.places.len())
        {
            return false;
        }
        self.held = held;
        self.corners = of_corners.chunks_exact(D).map(vector).collect();
        self.work = f64::from_bits(*work);
        true
    }
}
