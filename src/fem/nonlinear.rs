//! Finite elements whose stress is not linear in the displacement gradient, as their excess over the elements of the tangent at rest.
//!
//! ```text
//!   f_a = Σ_b K_ab u_b + ∫ (P(∇u, history) − C : ∇u) · ∂N_a/∂X dV
//! ```
//!
//! For a law that flows at constant volume, cells of first order with several quadrature points take the mean of their dilatation, `∇u + (θ̄ − θ)/D I`, in stress and virtual work alike (the B̄ method, \[Hughes1987\] section 4.5):
//! with the dilatation of each point they would resist the flow. Under affine fields the two are the same.
//! Cells of second order keep the dilatation of each point: with its mean they would not resist `u = 2 (a·x) x − |x|² a` at all, whose strain is a dilatation alone.
//!
//! All integrals are over the undeformed body (total Lagrangian); P is the first Piola–Kirchhoff stress, which for small strains is σ. The first term is that of the rows, as if all elements were linear; the integral is a sum over the quadrature points of the stiffness, each with what its law remembers. Elements that are linear do not appear here.

use std::sync::Arc;

mod expansion;
mod tangent;

use super::cell::{MAX_NODES, Rule};
use super::crack_band::{CellBandError, CellLaws};
use super::element::{displacement_gradient, for_each_point};
use crate::{
    material::LocalLaw,
    mesh::Mesh,
    parallel,
    tensor::{Tensor, Vector},
};

/// An element of a law that is not linear.
#[derive(Clone, Copy, Debug)]
struct Element {
    /// Its cell.
    cell: u32,
    /// The number of its law.
    law: u32,
    /// The first of its numbers of history.
    first: usize,
    /// The first of its nodes in the list of forces.
    node: usize,
    /// Numbers of history of each of its quadrature points.
    each: usize,
    /// True if its energy is part of the body's: an element that only overlaps has none.
    counts: bool,
}

/// The excess of one element but for its nodal forces.
#[derive(Clone, Copy, Debug)]
struct Excess<const D: usize> {
    /// Stored energy less that of the linear element \[J\].
    stored: f64,
    /// Stored energy \[J\].
    energy: f64,
    /// Energy dissipated within the interval \[J\].
    dissipated: f64,
    /// Integral of the Cauchy stress over the undeformed cell.
    stress: Tensor<D>,
    /// Integral of the normal stress out of the plane.
    across: f64,
    /// Its volume.
    volume: f64,
}

impl<const D: usize> Excess<D> {
    /// None.
    fn zero() -> Self {
        Self {
            stored: 0.0,
            energy: 0.0,
            dissipated: 0.0,
            stress: Tensor::zeros(),
            across: 0.0,
            volume: 0.0,
        }
    }
}

/// Elements of laws that are not linear, with the history variables of their quadrature points.
#[derive(Clone, Debug)]
pub struct NonlinearElements<const D: usize> {
    laws: Vec<Arc<dyn LocalLaw<D>>>,
    /// By ascending cell.
    elements: Vec<Element>,
    /// History variables: those committed last, and those of the last response.
    past: Vec<f64>,
    present: Vec<f64>,
    excess: Vec<Excess<D>>,
    /// Force of each node of each element \[N\], of the last response.
    forces: Vec<Vector<D>>,
    /// Displacement of each node of each element where it expands freely \[m\]; empty where nothing expands.
    expanded: Vec<Vector<D>>,
    /// For each node of the mesh where its elements begin in `of_node`.
    offsets: Vec<u32>,
    /// The places of the nodes in `forces`, by ascending element.
    of_node: Vec<u32>,
}

impl<const D: usize> NonlinearElements<D> {
    /// The elements among `cells` (ascending, with whether their energy counts) whose law `law_of` is not linear; none if there are none. A law that softens has the crack band of its cell.
    ///
    /// # Errors
    /// [`CellBandError`] for a cell in which a law that softens would not take its fracture energy.
    pub fn new(
        mesh: &Mesh<D>,
        cells: impl Iterator<Item = (usize, bool)>,
        law_of: impl Fn(usize) -> Option<Arc<dyn LocalLaw<D>>>,
    ) -> Result<Option<Self>, CellBandError> {
        let mut laws = CellLaws::new();
        let (mut elements, mut numbers, mut held) = (Vec::new(), 0, 0);
        let mut count = vec![0u32; mesh.nodes.len() + 1];
        for (cell, counts) in cells {
            let Some(law) = law_of(cell).filter(|law| !law.is_linear()) else {
                continue;
            };
            let each = law.history().len();
            let number = laws.number(law, mesh, cell)?;
            let mut points = 0;
            for_each_point(mesh, cell, Rule::Stiffness, |_| points += 1);
            elements.push(Element {
                cell: cell as u32,
                law: number,
                first: numbers,
                node: held,
                each,
                counts,
            });
            numbers += points * each;
            held += mesh.cell(cell).len();
            for &n in mesh.cell(cell) {
                count[n as usize + 1] += 1;
            }
        }
        if elements.is_empty() {
            return Ok(None);
        }
        for n in 1..count.len() {
            count[n] += count[n - 1];
        }
        let offsets = count.clone();
        let mut of_node = vec![0; held];
        for element in &elements {
            for (a, &n) in mesh.cell(element.cell as usize).iter().enumerate() {
                let next = &mut count[n as usize];
                of_node[*next as usize] = (element.node + a) as u32;
                *next += 1;
            }
        }
        Ok(Some(Self {
            laws: laws.laws,
            excess: vec![Excess::zero(); elements.len()],
            forces: vec![Vector::zeros(); held],
            expanded: Vec::new(),
            elements,
            past: vec![0.0; numbers],
            present: vec![0.0; numbers],
            offsets,
            of_node,
        }))
    }

    /// Returns true if quadrature points have history variables.
    pub fn remembers(&self) -> bool {
        !self.past.is_empty()
    }

    /// Returns true if any of the elements has the node.
    pub fn is_around(&self, node: u32) -> bool {
        self.offsets[node as usize] < self.offsets[node as usize + 1]
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.elements.len() * (size_of::<Element>() + size_of::<Excess<D>>())
            + 16 * self.past.len()
            + 4 * self.offsets.len()
            + (4 + size_of::<Vector<D>>()) * self.of_node.len()
    }

    /// The cells, ascending.
    pub fn cells(&self) -> impl Iterator<Item = usize> + '_ {
        self.elements.iter().map(|e| e.cell as usize)
    }

    /// Responds to the displacement of the nodes \[m\] at the end of an interval of the length `step` \[s\] that began with the last [`NonlinearElements::commit`].
    pub fn respond(
        &mut self,
        mesh: &Mesh<D>,
        displacement: impl Fn(u32) -> Vector<D> + Sync,
        step: f64,
    ) {
        let (laws, past, expanded) = (&self.laws, &self.past, &self.expanded);
        let of_element = |element: &Element, own: (&mut [f64], &mut [Vector<D>])| {
            let law = laws[element.law as usize].as_ref();
            let nodes = mesh.cell(element.cell as usize).len();
            let free = expanded.get(element.node..element.node + nodes);
            let known = (past.as_slice(), free);
            excess(mesh, element, law, &displacement, step, known, own)
        };
        let own = (
            &mut self.present[..],
            &mut self.forces[..],
            &mut self.excess[..],
        );
        each_element(&self.elements, own, &of_element);
    }

    /// Returns the force of the elements around a node beyond that of the linear ones \[N\], of the last response.
    pub fn force(&self, node: u32) -> Vector<D> {
        let n = node as usize;
        let around = &self.of_node[self.offsets[n] as usize..self.offsets[n + 1] as usize];
        let forces = around.iter();
        forces.map(|&place| self.forces[place as usize]).sum()
    }

    /// Ends an interval: the history of the last response is committed. Returns the energy dissipated \[J\].
    pub fn commit(&mut self) -> f64 {
        self.past.clone_from(&self.present);
        let own = self.elements.iter().zip(&self.excess);
        own.filter(|(element, _)| element.counts)
            .map(|(_, excess)| excess.dissipated)
            .sum()
    }

    /// Returns the stored energy beyond that of the linear elements \[J\], at a displacement of the nodes \[m\] and with the history committed last.
    pub fn stored(&self, mesh: &Mesh<D>, displacement: impl Fn(u32) -> Vector<D> + Sync) -> f64 {
        let counted = parallel::filter_map(self.elements.len(), 1, |e| {
            let element = &self.elements[e];
            (element.counts).then(|| self.of_element(mesh, &displacement, element).stored)
        });
        counted.iter().sum()
    }

    /// The mean Cauchy stress of a cell \[Pa\] and the one out of its plane, likewise; none of a cell that is not among them.
    pub fn stress(
        &self,
        mesh: &Mesh<D>,
        cell: usize,
        displacement: impl Fn(u32) -> Vector<D>,
    ) -> Option<(Tensor<D>, f64)> {
        let e = (self.elements).binary_search_by_key(&cell, |e| e.cell as usize);
        let found = self.of_element(mesh, &displacement, &self.elements[e.ok()?]);
        Some((found.stress / found.volume, found.across / found.volume))
    }

    /// The mean stored energy per volume of a cell \[J/m^D\], likewise.
    pub fn energy_density(
        &self,
        mesh: &Mesh<D>,
        cell: usize,
        displacement: impl Fn(u32) -> Vector<D>,
    ) -> Option<f64> {
        let e = (self.elements).binary_search_by_key(&cell, |e| e.cell as usize);
        let found = self.of_element(mesh, &displacement, &self.elements[e.ok()?]);
        Some(found.energy / found.volume)
    }

    /// Returns the excess of an element over the linear one, with the history committed last.
    fn of_element(
        &self,
        mesh: &Mesh<D>,
        displacement: &impl Fn(u32) -> Vector<D>,
        element: &Element,
    ) -> Excess<D> {
        let law = self.laws[element.law as usize].as_ref();
        let mut points = 0;
        let cell = element.cell as usize;
        for_each_point(mesh, cell, Rule::Stiffness, |_| points += 1);
        let mut present = vec![0.0; points * element.each];
        let mut force = [Vector::zeros(); MAX_NODES];
        let force = &mut force[..mesh.cell(cell).len()];
        let free = (self.expanded).get(element.node..element.node + force.len());
        let known = (self.past.as_slice(), free);
        let into = (present.as_mut_slice(), force);
        excess(mesh, element, law, displacement, 0.0, known, into)
    }

    /// Returns the history variables of each cell, by name: means over its volume, the names in the order of the laws.
    pub fn remembered(&self, mesh: &Mesh<D>) -> Vec<(&'static str, Vec<(u32, f64)>)> {
        let mut found: Vec<(&'static str, Vec<(u32, f64)>)> = Vec::new();
        for element in &self.elements {
            let names = self.laws[element.law as usize].history().names;
            let shown = names
                .iter()
                .enumerate()
                .filter(|(_, name)| !name.is_empty());
            for (k, name) in shown {
                let (mut sum, mut volume, mut point) = (0.0, 0.0, 0);
                for_each_point(mesh, element.cell as usize, Rule::Stiffness, |p| {
                    sum += p.weight * self.past[element.first + point * element.each + k];
                    volume += p.weight;
                    point += 1;
                });
                let entry = (element.cell, sum / volume);
                match found.iter_mut().find(|(n, _)| n == name) {
                    Some((_, values)) => values.push(entry),
                    None => found.push((name, vec![entry])),
                }
            }
        }
        found
    }

    /// All that was committed last, for a checkpoint.
    pub fn state(&self) -> impl Iterator<Item = u64> + '_ {
        self.past.iter().map(|x| x.to_bits())
    }

    /// Number of words of [`NonlinearElements::state`].
    pub fn words(&self) -> usize {
        self.past.len()
    }

    /// Puts back what [`NonlinearElements::state`] gave, of the same length.
    pub fn restore(&mut self, state: &[u64]) {
        for (number, word) in self.past.iter_mut().zip(state) {
            *number = f64::from_bits(*word);
        }
        self.present.clone_from(&self.past);
    }
}

/// Means of the gradients of the shape functions, where an element of a law takes the mean dilatation of its cell.
fn mean_gradients<const D: usize>(
    mesh: &Mesh<D>,
    element: &Element,
    law: &dyn LocalLaw<D>,
) -> Option<[Vector<D>; MAX_NODES]> {
    let cell = element.cell as usize;
    if !law.flows_at_constant_volume() || mesh.shapes[cell].is_quadratic() {
        return None;
    }
    let mut mean = [Vector::<D>::zeros(); MAX_NODES];
    let mut volume = 0.0;
    for_each_point(mesh, cell, Rule::Stiffness, |p| {
        for (mean, g) in mean.iter_mut().zip(&p.gradient).take(p.nodes) {
            *mean += g * p.weight;
        }
        volume += p.weight;
    });
    mean[..mesh.cell(cell).len()]
        .iter_mut()
        .for_each(|mean| *mean /= volume);
    Some(mean)
}

/// Memory that elements write to: the numbers that their points remember at present, their nodal forces, and the rest.
type Written<'a, const D: usize> = (&'a mut [f64], &'a mut [Vector<D>], &'a mut [Excess<D>]);

/// Elements of a task.
const ELEMENTS: usize = 64;

/// Responses of some elements, halved until each part is a task: none makes a list of what it writes to.
fn each_element<const D: usize>(
    elements: &[Element],
    (present, forces, excess): Written<'_, D>,
    of: &(impl Fn(&Element, (&mut [f64], &mut [Vector<D>])) -> Excess<D> + Sync),
) {
    let Some(begin) = elements.first() else {
        return;
    };
    if elements.len() > ELEMENTS {
        let half = elements.len() / 2;
        let (left, right) = elements.split_at(half);
        let (present, more) = present.split_at_mut(right[0].first - begin.first);
        let (forces, further) = forces.split_at_mut(right[0].node - begin.node);
        let (excess, rest) = excess.split_at_mut(half);
        rayon::join(
            || each_element(left, (present, forces, excess), of),
            || each_element(right, (more, further, rest), of),
        );
        return;
    }
    for (e, element) in elements.iter().enumerate() {
        let next = elements.get(e + 1);
        let numbers = element.first - begin.first
            ..next.map_or(present.len(), |next| next.first - begin.first);
        let nodes =
            element.node - begin.node..next.map_or(forces.len(), |next| next.node - begin.node);
        excess[e] = of(element, (&mut present[numbers], &mut forces[nodes]));
    }
}

/// Excess of an element over the linear one, which expands by the same displacements of its nodes; overwrites the present history variables of its points, and its nodal forces \[N\].
fn excess<const D: usize>(
    mesh: &Mesh<D>,
    element: &Element,
    law: &dyn LocalLaw<D>,
    displacement: &impl Fn(u32) -> Vector<D>,
    step: f64,
    (past, expanded): (&[f64], Option<&[Vector<D>]>),
    (present, forces): (&mut [f64], &mut [Vector<D>]),
) -> Excess<D> {
    let nodes = mesh.cell(element.cell as usize);
    let mut u = [Vector::zeros(); MAX_NODES];
    for (u, &n) in u.iter_mut().zip(nodes) {
        *u = displacement(n);
    }
    let mut sum = Excess::zero();
    forces.fill(Vector::zeros());
    let each = element.each;
    let mut point = 0;
    let is_objective = law.is_objective();
    let mean = mean_gradients(mesh, element, law);
    let has_mean_dilatation = mean.is_some();
    let mean = mean.unwrap_or([Vector::zeros(); MAX_NODES]);
    let mean_dilatation: f64 = mean[..nodes.len()]
        .iter()
        .zip(&u)
        .map(|(g, u)| g.dot(u))
        .sum();
    for_each_point(mesh, element.cell as usize, Rule::Stiffness, |p| {
        let gradient = displacement_gradient(p, |a| u[a]);
        let own = point * each..(point + 1) * each;
        let past = &past[element.first..][own.clone()];
        let mechanical = match expanded {
            Some(free) => gradient - displacement_gradient(p, |a| free[a]),
            None => gradient,
        };
        let linear = law.tangent().contract(&mechanical);
        let shift = match has_mean_dilatation {
            true => (mean_dilatation - gradient.trace()) / D as f64,
            false => 0.0,
        };
        let taken = gradient + Tensor::identity() * shift;
        let found = law.respond(&taken, step, past, &mut present[own]);
        let beyond = (found.stress - linear) * p.weight;
        for (force, g) in forces.iter_mut().zip(&p.gradient) {
            *force += beyond * g;
        }
        if has_mean_dilatation {
            let pressure = found.stress.trace() / D as f64 * p.weight;
            let gradients = mean.iter().zip(&p.gradient);
            for (force, (mean, g)) in forces.iter_mut().zip(gradients) {
                *force += (mean - g) * pressure;
            }
        }
        sum.stored += p.weight * (found.stored - 0.5 * linear.dot(&mechanical));
        sum.energy += p.weight * found.stored;
        sum.dissipated += p.weight * found.dissipated;
        sum.stress += found.cauchy(&taken, is_objective) * p.weight;
        sum.across += found.across * p.weight;
        sum.volume += p.weight;
        point += 1;
    });
    sum
}

#[cfg(test)]
mod tests {
    use super::super::element::{cell_volume, stiffness_into};
    use super::super::sample::{boxes, noise};
    use super::*;
    use crate::material::J2;
    use crate::tensor::Tensor4;

    const LAME: (f64, f64) = (600.0, 400.0);

    /// Forces of all nodes, and the energy stored and dissipated, after one interval from rest.
    fn responded<const D: usize>(
        mesh: &Mesh<D>,
        elements: &mut NonlinearElements<D>,
        u: &[Vector<D>],
    ) -> (Vec<Vector<D>>, f64) {
        let at = |n: u32| u[n as usize];
        elements.respond(mesh, at, 1.0);
        let tangent = Tensor4::isotropic(LAME.0, LAME.1);
        let nodes = 0..mesh.nodes.len() as u32;
        let mut force: Vec<Vector<D>> = nodes.map(|n| elements.force(n)).collect();
        let mut energy: f64 = elements
            .excess
            .iter()
            .map(|e| e.stored + e.dissipated)
            .sum();
        for c in 0..mesh.cell_count() {
            let nodes = mesh.cell(c).len();
            let mut blocks = Vec::new();
            stiffness_into(mesh, c, &tangent, &mut blocks);
            for (a, &n) in mesh.cell(c).iter().enumerate() {
                let pull: Vector<D> = (mesh.cell(c).iter().enumerate())
                    .map(|(b, &m)| blocks[a * nodes + b] * u[m as usize])
                    .sum();
                energy += 0.5 * pull.dot(&u[n as usize]);
                force[n as usize] += pull;
            }
        }
        (force, energy)
    }

    fn yields<const D: usize>() {
        for mesh in boxes::<D>(3, 0.3) {
            let law: Arc<dyn LocalLaw<D>> = Arc::new(J2::<D>::new(LAME.0, LAME.1, 2.0, 50.0));
            let cells = || (0..mesh.cell_count()).map(|c| (c, true));
            let mut elements = NonlinearElements::new(&mesh, cells(), |_| Some(Arc::clone(&law)))
                .unwrap()
                .unwrap();
            let name = format!("{:?}", mesh.shapes[0]);

            // a uniform gradient: nodes within are in equilibrium, and the virial is the stress of the law times the volume
            let g =
                Tensor::<D>::from_fn(|i, j| 0.02 * noise(i, j) + if i == j { 0.01 } else { 0.0 });
            let affine: Vec<Vector<D>> = mesh.nodes.iter().map(|x| g * x).collect();
            let (force, _) = responded(&mesh, &mut elements, &affine);
            let numbers = law.history().len();
            let (past, mut present) = (vec![0.0; numbers], vec![0.0; numbers]);
            let found = law.respond(&g, 1.0, &past, &mut present);
            assert!(present[numbers - 1] > 1e-3, "{name}: does not yield");
            let volume: f64 = (0..mesh.cell_count()).map(|c| cell_volume(&mesh, c)).sum();
            let virial: Tensor<D> = force
                .iter()
                .zip(&mesh.nodes)
                .map(|(f, x)| f * x.transpose())
                .sum();
            assert!((virial - found.stress * volume).amax() < 1e-12, "{name}");
            for (f, x) in force.iter().zip(&mesh.nodes) {
                let inside = x.iter().all(|x| *x > 1e-9 && *x < 1.0 - 1e-9);
                assert!(!inside || f.amax() < 1e-13, "{name}: {f:?} at {x:?}");
            }
            // what flowed is kept once it is committed, and only then
            assert!(elements.past.iter().all(|x| *x == 0.0));
            for cell in 0..mesh.cell_count() {
                let stress = elements.stress(&mesh, cell, |n| affine[n as usize]);
                assert!((stress.unwrap().0 - found.stress).amax() < 1e-12);
            }
            let lost = elements.commit();
            assert!((lost - found.dissipated * volume).abs() < 1e-13, "{name}");
            let (_, kept) = elements.remembered(&mesh).pop().unwrap();
            assert!(
                kept.iter()
                    .all(|(_, a)| (a - present[numbers - 1]).abs() < 1e-15)
            );

            // the stress is the derivative of the energy stored and dissipated over an interval
            let mut fresh = NonlinearElements::new(&mesh, cells(), |_| Some(Arc::clone(&law)))
                .unwrap()
                .unwrap();
            let bent: Vec<Vector<D>> = (affine.iter().enumerate())
                .map(|(n, u)| u + Vector::from_fn(|i, _| 2e-3 * noise(n, i)))
                .collect();
            let along: Vec<Vector<D>> = (0..bent.len())
                .map(|n| Vector::from_fn(|i, _| noise(n + 7, i)))
                .collect();
            let moved = |by: f64| -> Vec<Vector<D>> {
                bent.iter().zip(&along).map(|(u, d)| u + d * by).collect()
            };
            let (force, _) = responded(&mesh, &mut fresh, &bent);
            let work: f64 = force.iter().zip(&along).map(|(f, d)| f.dot(d)).sum();
            let step = 1e-6;
            let mut energy = |by: f64| responded(&mesh, &mut fresh, &moved(by)).1;
            let slope = (energy(step) - energy(-step)) / (2.0 * step);
            assert!(
                (slope - work).abs() < 1e-6 * work.abs().max(1.0),
                "{name}: {slope} {work}"
            );
        }
    }

    #[test]
    fn flow_at_constant_volume_meets_the_mean_dilatation_of_a_cell() {
        use super::super::sample::unit_box;
        use crate::mesh::CellShape;
        // u = (x − ½)(y − ½) e_x within one cell, far below yield: θ = y − ½, its mean zero, and what is left is ε̄ = [y', x'; x', −y']/2
        let mesh = unit_box::<2>(CellShape::Quad4, 1, 0.0);
        let law: Arc<dyn LocalLaw<2>> = Arc::new(J2::<2>::new(LAME.0, LAME.1, 1e9, 0.0));
        let mut elements =
            NonlinearElements::new(&mesh, [(0, true)].into_iter(), |_| Some(Arc::clone(&law)))
                .unwrap()
                .unwrap();
        let u: Vec<Vector<2>> = (mesh.nodes.iter())
            .map(|x| Vector::<2>::new((x[0] - 0.5) * (x[1] - 0.5), 0.0))
            .collect();
        let (_, energy) = responded(&mesh, &mut elements, &u);
        assert!((energy - LAME.1 / 12.0).abs() < 1e-13, "{energy}");
    }

    #[test]
    fn elements_that_yield_have_the_stress_of_their_law_and_remember() {
        yields::<1>();
        yields::<2>();
        yields::<3>();
    }
}
