//! Thermal strain: effect on the sites of a model of a temperature that differs from the stress-free one.
//!
//! A body whose temperature is linear in space expands without stress by a displacement that is quadratic: with the rise τ and its gradient g at a place, `u = α (τ r + (g·r) r − ½ g |r|²)`, r from there. Its strain is `α (τ + g·r)` in
//! all directions. Source: [BoleyWeiner1960], the strain being compatible where the temperature is linear.
//!
//! The thermal force of a site is what its own row makes of that displacement, with the rise of both ends of every pair: `α ξ (τ_i + τ_j)/2` along a bond, so that the extension of a bond less its thermal part is what
//! stretches it. A finite element takes its own expansion, at its nodes. Every row, of a seam too, is then free of force where the body expands freely under a uniform or a linear temperature.

use std::borrow::Cow;
use std::sync::Arc;

use crate::assembly::{self, Counted, Row};
use crate::coupling::semidiscrete::FreeStretch;
use crate::fem;
use crate::run::error::RunError;
use crate::scene::temperature::Temperature;
use crate::system::BlockCsr;
use crate::tensor::{Tensor, Vector, padded};
use crate::{
    coupling::Operator,
    model::{CellRole, Model, SiteKind},
};

/// The temperature of a body, and how its materials expand.
#[derive(Clone, Debug)]
pub struct Thermal<const D: usize> {
    /// The temperature, and the one without stress.
    pub temperature: Temperature,
    /// Expansion per degree of each material within the dimensions of the scene: `(1 + ν) α` in plane strain.
    pub expansion: Vec<f64>,
    /// Expansion of the solid over that: 1, and 1/(1 + ν) in plane strain.
    pub solid: Vec<f64>,
    /// Half of the distance over which the temperature is differenced.
    pub reach: f64,
}

/// Rows that expand, with the expansion per degree of what is in them.
pub struct ExpandingRows<'r>(Vec<(f64, Cow<'r, BlockCsr>)>);

/// Rise of the temperature at a place, and its gradient.
#[derive(Clone, Copy, Debug)]
struct Rise<const D: usize> {
    value: f64,
    slope: Vector<D>,
}

impl<const D: usize> Thermal<D> {
    /// Temperature less that without stress.
    pub fn rise_at(&self, x: &Vector<D>, t: f64) -> f64 {
        self.temperature.value.eval_at(&padded(x), t) - self.temperature.reference
    }

    fn rise(&self, x: &Vector<D>, t: f64) -> Rise<D> {
        let slope = |k: usize| {
            let mut step = Vector::zeros();
            step[k] = self.reach;
            (self.rise_at(&(x + step), t) - self.rise_at(&(x - step), t)) / (2.0 * self.reach)
        };
        let varies = self.temperature.value.depends_on_position();
        Rise {
            value: self.rise_at(x, t),
            slope: Vector::from_fn(|k, _| if varies { slope(k) } else { 0.0 }),
        }
    }

    /// The stretch `α ΔT` of a material at a place.
    pub fn stretch_at(&self, x: &Vector<D>, material: u16, t: f64) -> f64 {
        self.expansion[usize::from(material)] * self.rise_at(x, t)
    }

    /// The stretch of points for bonds that know their temperature.
    pub fn free_stretch(&self) -> FreeStretch<D> {
        let (of_points, of_cells) = (self.clone(), self.clone());
        FreeStretch {
            varies_in_time: self.temperature.value.depends_on_time(),
            at: Arc::new(move |x, material, t| of_points.stretch_at(x, material, t)),
            of_cell: Arc::new(move |model, c, t| of_cells.expanded_nodes(model, c, t)),
            solid: self.solid.clone(),
        }
    }

    /// Displacement of each node of a cell that expands freely about its centroid; of a node that follows the ends of its edge, the mean of theirs.
    fn expanded_nodes(&self, model: &Model<D>, c: usize, t: f64) -> Vec<Vector<D>> {
        let mesh = &model.mesh;
        let alpha = self.expansion[model.material_of_cell(c) as usize];
        let middle = mesh.centroid(c);
        let here = self.rise(&middle, t);
        let free = |n: u32| {
            let x = mesh.nodes[n as usize];
            parted(&here, &self.rise(&x, t), &(x - middle)) * alpha
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
        let alpha = self.expansion[usize::from(material)];
        let rise = self.rise(x, t);
        let at_origin = rise.value - rise.slope.dot(x);
        let parts = std::iter::once(at_origin).chain(rise.slope.iter().copied());
        parts.map(|part| alpha * part).collect()
    }

    /// Force \[N\] by dof that free expansion would take: `F = K u − f`; `rows` are those of all sites, or of the sites `own`, of which alone the forces are then right.
    pub fn forces(
        &self,
        model: &Model<D>,
        rows: &ExpandingRows<'_>,
        own: Option<&[u32]>,
        t: f64,
    ) -> Vec<f64> {
        let mut forces = vec![0.0; model.sites.len() * D];
        let inner = inner_sites(model);
        if inner.contains(&false) {
            let rise: Vec<Rise<D>> = (model.sites.iter())
                .map(|s| self.rise(&s.position, t))
                .collect();
            let site_of = |row: usize| own.map_or(row, |own| own[row] as usize);
            for (alpha, rows) in &rows.0 {
                for row in (0..rows.rows()).filter(|&row| !inner[site_of(row)]) {
                    let site = site_of(row);
                    let x = &model.sites[site].position;
                    let (columns, blocks) = rows.row(row);
                    let mut sum = Vector::<D>::zeros();
                    for (&column, block) in columns.iter().zip(blocks.chunks_exact(D * D)) {
                        let other = column as usize;
                        let xi = model.sites[other].position - x;
                        sum +=
                            Tensor::from_row_slice(block) * parted(&rise[site], &rise[other], &xi);
                    }
                    for k in 0..D {
                        forces[site * D + k] += alpha * sum[k];
                    }
                }
            }
        }
        self.add_elements(model, &inner, t, &mut forces);
        forces
    }

    /// The rows by which the sites `own`, or all, expand. Where the materials in them expand alike, `alike` gives their rows; else they are assembled anew, those of each material for itself.
    ///
    /// With `knows_temperature` the bonds of rows that are those of the body alone do without.
    ///
    /// # Errors
    /// [`RunError::Later`] for a coupling whose rows are not those of materials.
    pub fn rows<'r>(
        &self,
        model: &Model<D>,
        operator: &Operator<'_, D>,
        own: Option<&[u32]>,
        knows_temperature: bool,
        alike: impl FnOnce() -> Cow<'r, BlockCsr>,
    ) -> Result<ExpandingRows<'r>, RunError> {
        let materials = self.materials_in_rows(model);
        let alpha = |m: u16| self.expansion[usize::from(m)];
        let first = materials.first().copied();
        let first = first.unwrap_or_else(|| model.peridynamic_material());
        if materials.iter().all(|&m| alpha(m) == alpha(first)) {
            return Ok(ExpandingRows(vec![(alpha(first), alike())]));
        }
        if !operator.counts_materials {
            return Err(RunError::Later {
                what: "materials that expand differently at the seam of this coupling, or among its points (in plane strain (1 + ν) α counts)",
                remedy: "use coupling = \"splice\" or \"nonlocal\", or enclose the zone in elements of the material of its points",
            });
        }
        let all: Vec<u32> = (0..model.sites.len() as u32).collect();
        let sites = own.unwrap_or(&all);
        let of_points = model.peridynamic_material();
        let of_material = |material: u16| {
            let rows = assembly::assemble_apart(sites.len(), all.len(), |r, row: &mut Row<D>| {
                let site = sites[r] as usize;
                row.count_only(Counted {
                    material,
                    of_points,
                });
                if !(knows_temperature && operator.is_body_row(site)) {
                    model.add_scaled_row(operator, site, row);
                }
            });
            (alpha(material), Cow::Owned(rows))
        };
        Ok(ExpandingRows(
            materials.into_iter().map(of_material).collect(),
        ))
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

/// The displacement of one place seen from another, `xi` apart, where the body between them expands freely by one per degree.
fn parted<const D: usize>(here: &Rise<D>, there: &Rise<D>, xi: &Vector<D>) -> Vector<D> {
    let slope = (here.slope + there.slope) * 0.5;
    let mean = 0.5 * (here.value + there.value);
    xi * (mean + 0.5 * slope.dot(xi)) - slope * (0.5 * xi.norm_squared())
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
