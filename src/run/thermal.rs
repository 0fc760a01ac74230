//! Thermal strain: effect on the sites of a model of a temperature that differs from the stress-free one.
//!
//! A body whose temperature is linear in space expands without stress by a displacement that is quadratic: with the rise τ and its gradient g at a place, `u = α (τ r + (g·r) r − ½ g |r|²)`, r from there. Its strain is `α (τ + g·r)` in
//! all directions. Source: [BoleyWeiner1960], the strain being compatible where the temperature is linear. Where the expansion is a tensor A, `u = τ A r + (g·r) A r − ½ g (r·A r)` has the strain `A (τ + g·r)`.
//!
//! The thermal force is the gradient of the energy that is left of the stored one by a displacement under which each part of it (a bond, a family, a piece of a bond at a seam, an element) expands freely about its own
//! middle, with the rise of both ends of every pair: `α ξ (τ_i + τ_j)/2`, so that the extension of a bond less its thermal part is what stretches it. A part takes no force from a translation, so its forces add up to zero at any
//! temperature. Under a uniform or a linear one the parts expand by the same field but for rigid motions, and every row, of a seam too, is free of force where the body expands freely.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::assembly::{Centre, Counted, Row, RowPart};
use crate::coupling::semidiscrete::FreeStretch;
use crate::fem;
use crate::material::{Axes, Orthotropic};
use crate::parallel;
use crate::run::error::RunError;
use crate::scene::expression::Expression;
use crate::tensor::{Tensor, Vector, padded};
use crate::{
    coupling::Operator,
    model::{CellRole, Model, SiteKind},
};

/// Temperature of a place at a time.
#[derive(Clone, Debug)]
pub enum TemperatureField<const D: usize> {
    /// An expression.
    Typed(Expression),
    /// A solution of heat conduction.
    Solved(Arc<fem::NodalField<D>>),
}

impl<const D: usize> TemperatureField<D> {
    /// The temperature at `x` and the time `t`.
    pub fn at(&self, x: &Vector<D>, t: f64) -> f64 {
        match self {
            Self::Typed(value) => value.eval_at(&padded(x), t),
            Self::Solved(field) => field.value(x, t),
        }
    }

    /// Returns true if it changes in time.
    pub fn varies_in_time(&self) -> bool {
        match self {
            Self::Typed(value) => value.depends_on_time(),
            Self::Solved(field) => field.varies_in_time(),
        }
    }
}

/// The temperature of a body, and how its materials expand.
#[derive(Clone, Debug)]
pub struct Thermal<const D: usize> {
    /// The temperature.
    pub temperature: TemperatureField<D>,
    /// The temperature without thermal strain.
    pub reference: f64,
    /// Expansion of each material within the dimensions of the scene.
    pub expansion: Vec<Expansion<D>>,
    /// Twice the energy per volume and squared degree of each material that plane strain holds back across its plane and that is free within \[Pa\]; zero otherwise.
    pub held: Vec<f64>,
    /// Expansion of the solid over that: 1, and 1/(1 + ν) in plane strain.
    pub solid: Vec<f64>,
    /// Half of the distance over which the temperature is differenced.
    pub reach: f64,
}

/// Expansion of a material per degree within the dimensions of a scene.
#[derive(Clone, Debug)]
pub enum Expansion<const D: usize> {
    /// The same in all directions: α, `(1 + ν) α` in plane strain.
    Isotropic(f64),
    /// Along the axes of the material.
    Orthotropic(Orthotropic<D>, Axes<D>),
}

impl<const D: usize> Expansion<D> {
    /// The strain of a rise by one degree; axes are those at `x`.
    fn at(&self, x: &Vector<D>) -> Tensor<D> {
        match self {
            Self::Isotropic(alpha) => Tensor::from_diagonal_element(*alpha),
            Self::Orthotropic(body, axes) => body.expansion(&axes.at(x)),
        }
    }

    /// That of a material that has points, which are isotropic; zero of others.
    fn of_points(&self) -> f64 {
        match self {
            Self::Isotropic(alpha) => *alpha,
            Self::Orthotropic(..) => 0.0,
        }
    }
}

/// Forces of free expansion as products with the temperature, of the sites whose rows are not those of elements alone.
///
/// Shapes: a row for each of `sites`; `columns` are sites, and from their number on the entries of `cells`; `value` and `slope` have one entry per column. Units: `value` \[N/K\], `slope` \[N m/K\].
#[derive(Clone, Debug, Default)]
pub struct ExpandingRows<const D: usize> {
    sites: Vec<u32>,
    offsets: Vec<usize>,
    columns: Vec<u32>,
    value: Vec<Vector<D>>,
    slope: Vec<Tensor<D>>,
    cells: Vec<u32>,
}

/// Force of free expansion by the rise of the temperature at a place, and by its gradient there.
type ByRise<const D: usize> = (Vector<D>, Tensor<D>);

/// Rise of the temperature at a place, and its gradient.
#[derive(Clone, Copy, Debug)]
struct Rise<const D: usize> {
    value: f64,
    slope: Vector<D>,
}

impl<const D: usize> Thermal<D> {
    /// Temperature less that without stress.
    pub fn rise_at(&self, x: &Vector<D>, t: f64) -> f64 {
        self.temperature.at(x, t) - self.reference
    }

    fn rise(&self, x: &Vector<D>, t: f64) -> Rise<D> {
        let typed = match &self.temperature {
            TemperatureField::Typed(value) => value,
            TemperatureField::Solved(field) => {
                let (value, slope) = field.value_and_gradient(x, t);
                let value = value - self.reference;
                return Rise { value, slope };
            }
        };
        let slope = |k: usize| {
            let mut step = Vector::zeros();
            step[k] = self.reach;
            (self.rise_at(&(x + step), t) - self.rise_at(&(x - step), t)) / (2.0 * self.reach)
        };
        let varies = typed.depends_on_position();
        Rise {
            value: self.rise_at(x, t),
            slope: Vector::from_fn(|k, _| if varies { slope(k) } else { 0.0 }),
        }
    }

    /// The stretch `α ΔT` of a material that has points, at a place.
    pub fn stretch_at(&self, x: &Vector<D>, material: u16, t: f64) -> f64 {
        self.expansion[usize::from(material)].of_points() * self.rise_at(x, t)
    }

    /// Energy per volume \[J/m^D\] of a cell that is held back across its plane and free within, by the temperature at its centroid.
    pub fn held_energy(&self, model: &Model<D>, c: usize, t: f64) -> f64 {
        let rise = self.rise_at(&model.mesh.centroid(c), t);
        0.5 * self.held[usize::from(model.material_of_cell(c))] * rise * rise
    }

    /// The stretch of points for bonds that know their temperature.
    pub fn free_stretch(&self) -> FreeStretch<D> {
        let (of_points, of_cells) = (self.clone(), self.clone());
        FreeStretch {
            varies_in_time: self.temperature.varies_in_time(),
            at: Arc::new(move |x, material, t| of_points.stretch_at(x, material, t)),
            of_cell: Arc::new(move |model, c, t| of_cells.expanded_nodes(model, c, t)),
            solid: self.solid.clone(),
        }
    }

    /// Displacement of each node of a cell that expands freely about its centroid; of a node that follows the ends of its edge, the mean of theirs.
    fn expanded_nodes(&self, model: &Model<D>, c: usize, t: f64) -> Vec<Vector<D>> {
        let mesh = &model.mesh;
        let middle = mesh.centroid(c);
        let alpha = self.expansion[model.material_of_cell(c) as usize].at(&middle);
        let here = self.rise(&middle, t);
        let free = |n: u32| {
            let x = mesh.nodes[n as usize];
            parted(&here, &self.rise(&x, t), &(x - middle), &alpha)
        };
        let nodes = mesh.cell(c).iter();
        nodes
            .map(|&n| match model.followed_nodes(n) {
                Some(followed) => followed.iter().map(|&(m, w)| free(m) * w).sum(),
                None => free(n),
            })
            .collect()
    }

    /// The gradient at the centre of a cell of the displacement by which it expands freely.
    pub fn cell_gradient(&self, model: &Model<D>, c: usize, t: f64) -> Tensor<D> {
        fem::displacement_gradient_at_centre(&model.mesh, c, self.expanded_in(model, c, t))
    }

    /// The same at reference coordinates `xi`.
    pub fn gradient_in(&self, model: &Model<D>, c: usize, xi: &[f64; 3], t: f64) -> Tensor<D> {
        fem::superconvergent_gradient(&model.mesh, c, xi, self.expanded_in(model, c, t))
    }

    /// The displacement by which a cell expands freely, of its nodes by their numbers in the mesh.
    fn expanded_in<'a>(
        &self,
        model: &'a Model<D>,
        c: usize,
        t: f64,
    ) -> impl Fn(usize) -> Vector<D> + use<'a, D> {
        let expanded = self.expanded_nodes(model, c, t);
        let nodes = model.mesh.cell(c);
        move |n| {
            let place = nodes.iter().position(|&m| m as usize == n);
            place.map_or(Vector::zeros(), |place| expanded[place])
        }
    }

    /// Coefficients of the free expansion around `x` in the [`unit_expansions`]; rigid motions are left out.
    pub fn parts(&self, material: u16, x: &Vector<D>, t: f64) -> Vec<f64> {
        let alpha = self.expansion[usize::from(material)].of_points();
        let rise = self.rise(x, t);
        let at_origin = rise.value - rise.slope.dot(x);
        let parts = std::iter::once(at_origin).chain(rise.slope.iter().copied());
        parts.map(|part| alpha * part).collect()
    }

    /// Force \[N\] by dof that free expansion would take: `F = K u − f`; `rows` are those of all sites, or of some, of which alone the forces are then right.
    pub fn forces(&self, model: &Model<D>, rows: &ExpandingRows<D>, t: f64) -> Vec<f64> {
        let mut forces = vec![0.0; model.sites.len() * D];
        if !rows.sites.is_empty() {
            let of_sites = model.sites.iter().map(|s| s.position);
            let of_cells = rows.cells.iter().map(|&c| model.mesh.centroid(c as usize));
            let rise: Vec<Rise<D>> = (of_sites.chain(of_cells))
                .map(|x| self.rise(&x, t))
                .collect();
            for (row, &site) in rows.sites.iter().enumerate() {
                let mut sum = Vector::<D>::zeros();
                for k in rows.offsets[row]..rows.offsets[row + 1] {
                    let rise = &rise[rows.columns[k] as usize];
                    sum += rows.value[k] * rise.value + rows.slope[k] * rise.slope;
                }
                let force = &mut forces[site as usize * D..][..D];
                force.copy_from_slice(sum.as_slice());
            }
        }
        self.add_elements(model, &inner_sites(model), t, &mut forces);
        forces
    }

    /// Those of one temperature, without rows; of the sites `own`, or all. With `knows_temperature` the bonds of the body do without.
    ///
    /// # Errors
    /// [`RunError::Later`] for materials that expand differently in a coupling whose rows are not those of materials.
    pub fn forces_at(
        &self,
        model: &Model<D>,
        rows: (&Operator<'_, D>, Option<&[u32]>),
        knows_temperature: bool,
        t: f64,
    ) -> Result<Vec<f64>, RunError> {
        let mut forces = vec![0.0; model.sites.len() * D];
        let rise_at = |x: &Vector<D>| self.rise(x, t);
        let rise: Vec<Rise<D>> = match inner_sites(model).contains(&false) {
            true => (model.sites.iter().map(|s| rise_at(&s.position))).collect(),
            false => Vec::new(),
        };
        let add = |sum: &mut Vector<D>, part: &RowPart<D>, alpha: f64| {
            let (here, x) = match part.centre {
                Some(Centre::Site(s)) => (rise[s as usize], model.sites[s as usize].position),
                Some(Centre::Cell(cell)) => {
                    let x = model.mesh.centroid(cell as usize);
                    (rise_at(&x), x)
                }
                None => return,
            };
            for (&column, block) in part.columns.iter().zip(&part.blocks) {
                let column = column as usize;
                let xi = model.sites[column].position - x;
                *sum += block
                    * parted(
                        &here,
                        &rise[column],
                        &xi,
                        &Tensor::from_diagonal_element(alpha),
                    );
            }
        };
        let (sites, sums) =
            self.each_part(model, rows, knows_temperature, (Vector::zeros(), add))?;
        for (&site, sum) in sites.iter().zip(&sums) {
            forces[site as usize * D..][..D].copy_from_slice(sum.as_slice());
        }
        self.add_elements(model, &inner_sites(model), t, &mut forces);
        Ok(forces)
    }

    /// The rows by which the sites `own`, or all, expand at temperatures that vary in time. With `knows_temperature` the bonds of the body do without.
    ///
    /// # Errors
    /// [`RunError::Later`] for materials that expand differently in a coupling whose rows are not those of materials.
    pub fn rows(
        &self,
        model: &Model<D>,
        rows: (&Operator<'_, D>, Option<&[u32]>),
        knows_temperature: bool,
    ) -> Result<ExpandingRows<D>, RunError> {
        let add = |found: &mut FxHashMap<u32, ByRise<D>>, part: &RowPart<D>, alpha: f64| {
            add_part(model, part, alpha, found);
        };
        let (sites, found) =
            self.each_part(model, rows, knows_temperature, (FxHashMap::default(), add))?;
        let each = found.into_iter().map(|found| {
            let mut entries: Vec<_> = found.into_iter().collect();
            entries.sort_unstable_by_key(|entry| entry.0);
            entries
        });
        let each = each.collect();
        Ok(ExpandingRows::new(sites, each, model.sites.len() as u32))
    }

    /// Gives `add` each part of the rows of the sites `own`, or all, that are not those of elements alone, with the expansion of the material that it counts; returns these sites and what `add` made of `start` at each.
    fn each_part<T: Clone + Send + Sync>(
        &self,
        model: &Model<D>,
        (operator, own): (&Operator<'_, D>, Option<&[u32]>),
        knows_temperature: bool,
        (start, add): (T, impl Fn(&mut T, &RowPart<D>, f64) + Sync),
    ) -> Result<(Vec<u32>, Vec<T>), RunError> {
        let materials = self.materials_in_rows(model);
        let alpha = |m: u16| self.expansion[usize::from(m)].of_points();
        let is_orthotropic =
            |m: &u16| matches!(self.expansion[usize::from(*m)], Expansion::Orthotropic(..));
        if model.body().is_some() && materials.iter().any(is_orthotropic) {
            return Err(RunError::Later {
                what: "a temperature in orthotropic elements that share nodes with the zone of points",
                remedy: "enclose the zone in elements of the material of its points, one cell thick",
            });
        }
        let first = materials.first().copied();
        let first = first.unwrap_or_else(|| model.peridynamic_material());
        let of_points = model.peridynamic_material();
        // materials that expand alike need not be told apart
        let counted: Vec<(Option<Counted>, f64)> = match materials
            .iter()
            .all(|&m| alpha(m) == alpha(first))
        {
            true => vec![(None, alpha(first))],
            false if operator.counts_materials => (materials.iter())
                .map(|&material| {
                    let counted = Counted {
                        material,
                        of_points,
                    };
                    (Some(counted), alpha(material))
                })
                .collect(),
            false => {
                return Err(RunError::Later {
                    what: "materials that expand differently at the seam of this coupling, or among its points (in plane strain (1 + ν) α counts)",
                    remedy: "use coupling = \"splice\" or \"nonlocal\", or enclose the zone in elements of the material of its points",
                });
            }
        };
        let all: Vec<u32> = (0..model.sites.len() as u32).collect();
        let inner = inner_sites(model);
        let sites = own.unwrap_or(&all).iter().copied();
        let sites: Vec<u32> = sites.filter(|&site| !inner[site as usize]).collect();
        let new_row = || Row::in_parts(all.len());
        let each = parallel::map_with(sites.len(), 16, new_row, |row, r| {
            let mut found = start.clone();
            let site = sites[r] as usize;
            for &(counted, alpha) in &counted {
                row.count_only(counted);
                row.part(
                    || Some(Centre::Site(sites[r])),
                    |row| match knows_temperature {
                        true => operator.add_row_beside_bonds(site, false, row),
                        false => operator.add_row(site, row),
                    },
                );
                row.scale(model.row_scale().map_or(1.0, |scale| scale[site]));
                for part in row.take_parts() {
                    add(&mut found, &part, alpha);
                }
            }
            found
        });
        Ok((sites, each))
    }

    /// The materials of points and of the elements in rows that are not those of elements alone, ascending.
    fn materials_in_rows(&self, model: &Model<D>) -> Vec<u16> {
        let inner = inner_sites(model);
        let mut found: Vec<u16> = match model.body() {
            Some(body) if body.cloud.material.is_empty() => vec![model.peridynamic_material()],
            Some(body) => body.cloud.material.clone(),
            None => Vec::new(),
        };
        for site in (0..inner.len()).filter(|&site| !inner[site]) {
            let cells = model.cells_of_site(site);
            found.extend(cells.map(|(c, _)| model.material_of_cell(c)));
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Adds what elements exert on the sites whose rows are theirs alone.
    fn add_elements(&self, model: &Model<D>, inner: &[bool], t: f64, forces: &mut [f64]) {
        let mesh = &model.mesh;
        let scale = model.row_scale();
        let takers = takers(model, inner);
        for c in (0..mesh.cell_count()).filter(|&c| model.roles[c] == CellRole::Element) {
            let nodes = mesh.cell(c);
            if nodes.iter().all(|&n| takers[n as usize].is_empty()) {
                continue;
            }
            let expanded = self.expanded_nodes(model, c, t);
            let tensor = model.tensor_of_cell(c);
            fem::for_each_point(mesh, c, fem::Rule::Stiffness, |p| {
                let stress = tensor.contract(&fem::displacement_gradient(p, |a| expanded[a]));
                for (a, &n) in nodes.iter().enumerate() {
                    for &(site, part) in &takers[n as usize] {
                        let f = stress * p.gradient[a] * p.weight;
                        let scale = part * scale.map_or(1.0, |scale| scale[site]);
                        (0..D).for_each(|k| forces[site * D + k] += scale * f[k]);
                    }
                }
            });
        }
    }
}

impl<const D: usize> ExpandingRows<D> {
    /// By the entries of each row, ascending by column; a cell has the number `of_sites` and its own.
    fn new(sites: Vec<u32>, each: Vec<Vec<(u32, ByRise<D>)>>, of_sites: u32) -> Self {
        let columns = each.iter().flatten().map(|entry| entry.0);
        let mut cells: Vec<u32> = columns.filter_map(|c| c.checked_sub(of_sites)).collect();
        cells.sort_unstable();
        cells.dedup();
        let mut rows = Self {
            sites,
            offsets: vec![0],
            cells,
            ..Self::default()
        };
        for (column, (value, slope)) in each.iter().flatten() {
            let cell = column.checked_sub(of_sites);
            let place = cell.and_then(|cell| rows.cells.binary_search(&cell).ok());
            let column = place.map_or(*column, |place| of_sites + place as u32);
            rows.columns.push(column);
            rows.value.push(*value);
            rows.slope.push(*slope);
        }
        for entries in &each {
            let end = rows.offsets.last().copied().unwrap_or(0) + entries.len();
            rows.offsets.push(end);
        }
        rows
    }
}

/// Adds what a part of a row that expands by `alpha` per degree makes of the temperature, by site and by cell, a cell having the number of sites and its own: its block of each site times [`parted`] from its centre.
fn add_part<const D: usize>(
    model: &Model<D>,
    part: &RowPart<D>,
    alpha: f64,
    found: &mut FxHashMap<u32, ByRise<D>>,
) {
    let (centre, x) = match part.centre {
        Some(Centre::Site(site)) => (site, model.sites[site as usize].position),
        Some(Centre::Cell(cell)) => {
            let number = model.sites.len() as u32 + cell;
            (number, model.mesh.centroid(cell as usize))
        }
        None => return,
    };
    for (&column, block) in part.columns.iter().zip(&part.blocks) {
        let xi = model.sites[column as usize].position - x;
        if column == centre {
            continue;
        }
        let value = block * xi * (0.5 * alpha);
        let shape = xi * xi.transpose() - Tensor::identity() * xi.norm_squared();
        let slope = block * shape * (0.25 * alpha);
        for place in [centre, column] {
            let (of_value, of_slope) = found
                .entry(place)
                .or_insert((Vector::zeros(), Tensor::zeros()));
            *of_value += value;
            *of_slope += slope;
        }
    }
}

/// The displacements of all sites by which a body expands freely: x by a unit rise, `x_k x − ½ |x|² e_k` by a unit gradient along each axis.
pub fn unit_expansions<const D: usize>(model: &Model<D>) -> Vec<Vec<f64>> {
    let of = |field: &dyn Fn(&Vector<D>) -> Vector<D>| -> Vec<f64> {
        let mut u = Vec::with_capacity(model.sites.len() * D);
        for site in &model.sites {
            u.extend(field(&site.position).iter());
        }
        u
    };
    let by_slope = |k: usize| {
        of(&|x| {
            let mut u = x * x[k];
            u[k] -= 0.5 * x.norm_squared();
            u
        })
    };
    std::iter::once(of(&|x| *x))
        .chain((0..D).map(by_slope))
        .collect()
}

/// The displacement of one place seen from another, `xi` apart, where the body between them expands freely by `alpha` per degree.
fn parted<const D: usize>(
    here: &Rise<D>,
    there: &Rise<D>,
    xi: &Vector<D>,
    alpha: &Tensor<D>,
) -> Vector<D> {
    let slope = (here.slope + there.slope) * 0.5;
    let mean = 0.5 * (here.value + there.value);
    let stretched = alpha * xi;
    stretched * (mean + 0.5 * slope.dot(xi)) - slope * (0.5 * xi.dot(&stretched))
}

/// The sites whose rows are those of elements alone that take the force of each node, with the part of it: its own, or those that it follows.
fn takers<const D: usize>(model: &Model<D>, inner: &[bool]) -> Vec<Vec<(usize, f64)>> {
    let mut takers = vec![Vec::new(); model.mesh.nodes.len()];
    for (site, s) in model.sites.iter().enumerate().filter(|s| inner[s.0]) {
        if let SiteKind::Node(n) = s.kind {
            takers[n as usize].push((site, 1.0));
            for &(follower, weight) in model.followers_of_site(site) {
                takers[follower as usize].push((site, weight));
            }
        }
    }
    takers
}

/// The sites whose rows are those of finite elements alone.
fn inner_sites<const D: usize>(model: &Model<D>) -> Vec<bool> {
    let mut whole = vec![true; model.mesh.nodes.len()];
    for c in 0..model.mesh.cell_count() {
        if model.roles[c] != CellRole::Element {
            let nodes = model.mesh.cell(c).iter();
            nodes.for_each(|&n| whole[n as usize] = false);
        }
    }
    let is_inner = |kind: SiteKind| match kind {
        SiteKind::Node(n) => whole[n as usize],
        SiteKind::Point(_) => false,
    };
    model.sites.iter().map(|s| is_inner(s.kind)).collect()
}
