//! Sections through the body: force and moment that the part beyond a plane exerts on the rest.
//!
//! A free body is cut: `S = Σ (F_i − f_i) + L` over the sites beyond the plane, with the internal forces `F`, the nodal forces `f` of the loads, and the
//! integral `L` of the loads over what of the mesh lies beyond the plane. Therefore `S = R + L − Σ m a` with the reactions R of what is held
//! beyond. It knows of no coupling: bonds, elements and seams are all in `F`. Nodal forces of a cell that the plane cuts belong to
//! both sides; `L − Σ f_i` puts that right, so that the weight of what stands on a section is exact wherever the plane lies. Sites that a
//! set holds count where the set lies, for the same reason.
//!
//! **Moments.** Forces of exact bonds act along the deformed bond, and those of laws for strains of any size turn with the element: they have no moment as a whole about the places that sites have moved to, and one of
//! the order of the displacement about those at rest. Linear forces have none about the places at rest. So a force acts where its site has moved to if that site's row is of the first kind, and else where the site
//! was; loads likewise, on the sites around.

#![deny(clippy::wildcard_enum_match_arm)]

use std::collections::BTreeMap;

use crate::model::{Model, Sampler};
use crate::observe::summary::SectionForce;
use crate::run::error::RunError;
use crate::run::loads::holders;
use crate::run::setup::RunSettings;
use crate::scene::conditions::{Condition, Support};
use crate::scene::load::Domain;
use crate::scene::section::Section;
use crate::tensor::{AXES, Vector, padded};

/// Axes along which there is a moment: none in 1D, z in 2D.
const fn moment_axes<const D: usize>() -> &'static [usize] {
    match D {
        1 => &[],
        2 => &[2],
        _ => &[0, 1, 2],
    }
}

/// Force and moment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Resultant<const D: usize> {
    force: Vector<D>,
    moment: [f64; 3],
}

impl<const D: usize> Resultant<D> {
    fn none() -> Self {
        Self {
            force: Vector::zeros(),
            moment: [0.0; 3],
        }
    }

    /// Adds a force at the place `arm` from where moments are taken about.
    fn add(&mut self, force: &Vector<D>, arm: &Vector<D>) {
        self.force += force;
        let (f, r) = (padded(force), padded(arm));
        for (k, moment) in self.moment.iter_mut().enumerate() {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            *moment += r[i] * f[j] - r[j] * f[i];
        }
    }

    fn add_times(&mut self, other: &Self, factor: f64) {
        self.force += other.force * factor;
        for (own, other) in self.moment.iter_mut().zip(other.moment) {
            *own += other * factor;
        }
    }

    /// Moves the place of a force that is counted already by `way`.
    fn shift(&mut self, force: &Vector<D>, way: &Vector<D>) {
        let mut moved = Self::none();
        moved.add(force, way);
        for (own, more) in self.moment.iter_mut().zip(moved.moment) {
            *own += more;
        }
    }
}

/// A point of a quadrature over the domain of a load.
struct LoadPoint<const D: usize> {
    place: Vector<D>,
    weight: f64,
    normal: Vector<D>,
    /// The sites that turn, with their weights, that the place follows.
    follows: Vec<(u32, f64)>,
}

/// Part of a model beyond a section.
struct Cut<const D: usize> {
    about: Vector<D>,
    sites: Vec<(u32, Vector<D>)>,
    /// Dofs that count on the other side of the section than their site, with the sign of the change.
    moved: Vec<(usize, Vector<D>, f64)>,
    loads: Vec<LoadBeyond<D>>,
}

/// A load as far as it acts beyond a section.
struct LoadBeyond<const D: usize> {
    condition: usize,
    share: Share<D>,
}

/// A force at rest, and its parts on the sites that turn.
struct Acting<const D: usize> {
    at_rest: Resultant<D>,
    moved: Vec<(u32, Vector<D>)>,
}

enum Share<const D: usize> {
    /// It does not change.
    Steady(Acting<D>),
    /// It depends on time alone: those of unit components.
    ByTime([Acting<D>; D]),
    /// It depends on time and place.
    Everywhere(Vec<LoadPoint<D>>),
}

/// The sections of a scene, and the part of its model beyond each.
pub(crate) struct Sections<'a, const D: usize> {
    sections: &'a [Section<D>],
    conditions: &'a [Condition<D>],
    /// Sites whose force acts where they have moved to; empty if that of none does.
    turns: Vec<bool>,
    cuts: Vec<Cut<D>>,
}

/// Marks the sites whose row is one of exact bonds or of elements whose law holds for rotations of any size; empty if none is.
fn turning<const D: usize>(model: &Model<D>, rest: &RunSettings<D>) -> Vec<bool> {
    let turns = |site: usize| match model.point_of(site) {
        Some((_, point)) => !rest.has_linear_point(model, point),
        None => {
            let mut cells = model.cells_of_site(site).map(|(cell, _)| cell).peekable();
            cells.peek().is_some() && cells.all(|cell| rest.is_objective(model, cell))
        }
    };
    let turns: Vec<bool> = (0..model.sites.len()).map(turns).collect();
    match turns.contains(&true) {
        true => turns,
        false => Vec::new(),
    }
}

/// The columns of all sections: force, then moment of each.
pub(crate) fn header<const D: usize>(sections: &[Section<D>]) -> Vec<String> {
    let of_one = |s: &Section<D>| {
        let force = AXES[..D].iter().map(|a| format!("{}_force_{a}", s.name));
        let moment = moment_axes::<D>().iter();
        let moment = moment.map(|&k| format!("{}_moment_{}", s.name, AXES[k]));
        force.chain(moment).collect::<Vec<_>>()
    };
    sections.iter().flat_map(of_one).collect()
}

impl<'a, const D: usize> Sections<'a, D> {
    /// Finds the part of a model beyond each section.
    ///
    /// # Errors
    /// [`RunError::EmptySection`] for one beyond which no site lies.
    pub fn new(model: &Model<D>, rest: &'a RunSettings<D>) -> Result<Self, RunError> {
        let (sections, conditions) = (&rest.output.sections[..], &rest.conditions[..]);
        let turns = match sections {
            [] => Vec::new(),
            _ => turning(model, rest),
        };
        let sampler = (!turns.is_empty()).then(|| Sampler::new(model));
        let follows = |x: &Vector<D>| {
            let all = sampler.as_ref().and_then(|sampler| sampler.weights(x));
            let mut all = all.unwrap_or_default();
            all.retain(|(site, _)| turns[*site as usize]);
            all
        };
        let cut = |section: &Section<D>| -> Result<Cut<D>, RunError> {
            let sites = model.sites.iter().enumerate();
            let beyond = sites.filter(|(_, s)| section.holds(&s.position));
            let sites: Vec<(u32, Vector<D>)> = beyond
                .map(|(site, s)| (site as u32, s.position - section.about))
                .collect();
            if sites.is_empty() || sites.len() == model.sites.len() {
                return Err(RunError::EmptySection {
                    section: section.name.clone(),
                    sites: sites.len(),
                });
            }
            let loads = conditions.iter().enumerate();
            Ok(Cut {
                about: section.about,
                sites,
                moved: moved(model, section, conditions)?,
                loads: loads
                    .filter_map(|(number, c)| load_beyond(model, section, number, c, &follows))
                    .collect(),
            })
        };
        let cuts = sections.iter().map(cut).collect::<Result<_, _>>()?;
        Ok(Self {
            sections,
            conditions,
            turns,
            cuts,
        })
    }

    /// Force and moment of each section at the displacement `u` \[m\] and the time `t`; `excess` are internal less external forces \[N\] by dof, the forces of supports and the inertia.
    pub fn forces(&self, excess: &[f64], u: &[f64], t: f64) -> Vec<SectionForce> {
        let told = self.sections.iter().zip(&self.cuts).map(|(section, cut)| {
            let sum = self.resultant(cut, excess, u, t);
            SectionForce {
                section: section.name.clone(),
                force: sum.force.iter().copied().collect(),
                moment: moment_axes::<D>().iter().map(|&k| sum.moment[k]).collect(),
            }
        });
        told.collect()
    }

    /// Displacement of the force on a site.
    fn way(&self, site: usize, u: &[f64]) -> Vector<D> {
        match self.turns.get(site) {
            Some(true) => Vector::from_column_slice(&u[site * D..][..D]),
            _ => Vector::zeros(),
        }
    }

    fn resultant(&self, cut: &Cut<D>, excess: &[f64], u: &[f64], t: f64) -> Resultant<D> {
        let mut sum = Resultant::none();
        for (site, arm) in &cut.sites {
            let site = *site as usize;
            let own = &excess[site * D..][..D];
            sum.add(&Vector::from_column_slice(own), &(arm + self.way(site, u)));
        }
        for (dof, arm, sign) in &cut.moved {
            let force = Vector::from_fn(|k, _| {
                if k == dof % D {
                    sign * excess[*dof]
                } else {
                    0.0
                }
            });
            sum.add(&force, &(arm + self.way(dof / D, u)));
        }
        for load in &cut.loads {
            let condition = &self.conditions[load.condition];
            match &load.share {
                Share::Steady(own) => self.add_acting(own, 1.0, u, &mut sum),
                Share::ByTime(units) => {
                    let components = &condition.components;
                    for (axis, unit) in units.iter().enumerate() {
                        let value = components.at_time(axis, &Vector::zeros(), t);
                        self.add_acting(unit, value.unwrap_or(0.0), u, &mut sum);
                    }
                }
                Share::Everywhere(points) => {
                    for point in points {
                        let (x, normal) = (&point.place, &point.normal);
                        let force = condition.force_density(x, normal, t) * point.weight;
                        sum.add(&force, &(x - cut.about));
                        for &(site, w) in &point.follows {
                            sum.shift(&force, &(self.way(site as usize, u) * w));
                        }
                    }
                }
            }
        }
        sum
    }

    /// Adds `factor` times a load.
    fn add_acting(&self, own: &Acting<D>, factor: f64, u: &[f64], sum: &mut Resultant<D>) {
        sum.add_times(&own.at_rest, factor);
        for (site, force) in &own.moved {
            sum.shift(&(force * factor), &self.way(*site as usize, u));
        }
    }
}

/// Returns the dofs that count on the side of the set that holds them: points that a support holds from beside it may lie on the other side of a plane than the support.
///
/// # Errors
/// As [`holders`].
fn moved<const D: usize>(
    model: &Model<D>,
    section: &Section<D>,
    conditions: &[Condition<D>],
) -> Result<Vec<(usize, Vector<D>, f64)>, RunError> {
    // of each set that lies on one side, whether that is beyond
    let side = |c: &Condition<D>| match c.support() {
        Some(Support::Set { nodes, .. }) => {
            let beyond = |n: &u32| section.holds(&model.mesh.nodes[*n as usize]);
            let first = nodes.first().map(beyond)?;
            nodes.iter().all(|n| beyond(n) == first).then_some(first)
        }
        _ => None,
    };
    let sides: Vec<Option<bool>> = conditions.iter().map(side).collect();
    let mut moved = Vec::new();
    for (dof, holder) in holders(model, conditions)?.into_iter().enumerate() {
        let x = &model.sites[dof / D].position;
        if let Some(set) = holder.and_then(|h| sides[h])
            && set != section.holds(x)
        {
            moved.push((dof, x - section.about, if set { 1.0 } else { -1.0 }));
        }
    }
    Ok(moved)
}

/// A load as far as it acts beyond a section; none of a condition that does not load, or not there. `follows` gives the sites that turn, with their weights, that a place follows.
fn load_beyond<const D: usize>(
    model: &Model<D>,
    section: &Section<D>,
    number: usize,
    condition: &Condition<D>,
    follows: &dyn Fn(&Vector<D>) -> Vec<(u32, f64)>,
) -> Option<LoadBeyond<D>> {
    let mut points = points_beyond(model, section, (number, condition));
    if points.is_empty() {
        return None;
    }
    for point in &mut points {
        point.follows = follows(&point.place);
    }
    let integral = |density: &dyn Fn(&Vector<D>, &Vector<D>) -> Vector<D>| {
        let (mut at_rest, mut moved) = (Resultant::none(), BTreeMap::new());
        for point in &points {
            let force = density(&point.place, &point.normal) * point.weight;
            at_rest.add(&force, &(point.place - section.about));
            for &(site, w) in &point.follows {
                *moved.entry(site).or_insert_with(Vector::zeros) += force * w;
            }
        }
        let moved = moved.into_iter().collect();
        Acting { at_rest, moved }
    };
    let components = &condition.components;
    let share = match (
        components.depends_on_time(),
        components.depends_on_position(),
    ) {
        (false, _) => Share::Steady(integral(&|x, n| condition.force_density(x, n, 0.0))),
        (true, false) => Share::ByTime(std::array::from_fn(|axis| {
            integral(&|_, n| condition.unit_density(axis, n))
        })),
        (true, true) => Share::Everywhere(points),
    };
    Some(LoadBeyond {
        condition: number,
        share,
    })
}

/// The quadrature over the domain of a load beyond a section.
fn points_beyond<const D: usize>(
    model: &Model<D>,
    section: &Section<D>,
    (number, condition): (usize, &Condition<D>),
) -> Vec<LoadPoint<D>> {
    let beyond = &section.beyond;
    let uncut = section.uncut.as_deref();
    let mesh = uncut.map_or(&model.mesh, |body| &body.mesh);
    let condition = uncut.map_or(condition, |body| &body.conditions[number]);
    let mut points = Vec::new();
    let mut add = |x: &Vector<D>, weight: f64, normal: &Vector<D>| {
        if section.inside.contains(x, beyond.tolerance) {
            points.push(LoadPoint {
                place: *x,
                weight,
                normal: *normal,
                follows: Vec::new(),
            });
        }
    };
    let none = Vector::zeros();
    let Some(load) = condition.load() else {
        return points;
    };
    match &load.on {
        Domain::Facets(facets) => {
            for facet in mesh.present_facets(facets.clone()) {
                beyond.facet_points(mesh, &facet, |x, w| add(x, w, &none));
            }
        }
        Domain::Surface(facets) => {
            for facet in facets {
                let facet = mesh.present_facet(facet);
                beyond.outward_points(mesh, &facet, |x, w, n| add(x, w, n));
            }
        }
        Domain::Cells(region) => {
            let inside = region.select_cells(mesh);
            let voids = model.peridynamics.as_ref().map_or(&[][..], |p| &p.voids);
            for c in (0..inside.len()).filter(|&c| inside[c]) {
                beyond.cell_points(mesh, c, |x, w| {
                    // a void in the zone has no weight
                    let is_void = voids.iter().any(|v| v.signed_distance(x) < 0.0);
                    if !is_void || uncut.is_none() && model.is_element(c) {
                        add(x, w, &none);
                    }
                });
            }
        }
    }
    points
}
