//! The stress error of a row that an affine field leaves out of balance: the sites around it are released and solved for, everything else keeps the field.

use super::surface::{Boundary, FacetKind, PLANE};
use crate::fem;
use crate::progress::Silent;
use crate::solve::FreeDofs;
use crate::solve::direct::{Analysis, Factor};
use crate::solve::direct_params::DirectParams;
use crate::solve::ordering::Ordering;
use crate::system::{BlockCsr, Spread, Symmetry};
use crate::tensor::{Tensor, Vector, padded};
use crate::{assembly::Row, parallel};
use crate::{
    coupling::Operator,
    model::{Model, SiteKind},
};

/// Most sites of a patch: in the plane some four horizons around its middle at m = 3, in space one and a half. With 300 in the plane the patch of a splice on scattered points came near to a singular one.
const SITES: [usize; 3] = [200, 500, 250];

/// Model and boundary from which patches are cut.
pub(super) struct Around<'a, const D: usize> {
    pub model: &'a Model<D>,
    pub operator: &'a Operator<'a, D>,
    /// The assembled stiffness, where the run has one.
    pub stiffness: Option<&'a BlockCsr>,
    pub boundary: &'a Boundary<'a, D>,
    /// True for each dof that is prescribed.
    pub held: &'a [bool],
    /// Reach of the families that enter the row of a site: sites nearer than this to a boundary lack bonds.
    pub reach: f64,
    /// The point that all fields leave in place.
    pub centre: Vector<D>,
    /// The sites over processes, where families are spread over these: rows and stresses of points are those of their own processes.
    pub spread: Option<Spread<'a>>,
}

/// The largest error of the stress in a patch.
#[derive(Clone, Copy, Debug)]
pub(super) struct StressError<const D: usize> {
    /// Difference of a stress component from that of the field, over the largest component of the field; signed where it is that component.
    pub relative: f64,
    /// Position of that error.
    pub at: Vector<D>,
}

/// A field of a patch: its gradient, and the difference of the displacement of a held dof from it.
pub(super) struct PatchField<'a, const D: usize> {
    pub gradient: Tensor<D>,
    /// Nodal forces of the field's stress on element boundaries, `D` numbers per site; none if they are zero.
    pub forces: &'a [f64],
    pub mismatch: &'a (dyn Fn(usize) -> f64 + Sync),
}

/// Solves for the sites nearest to `place` under each of the fields.
///
/// `main` is the surface whose effect is asked for, a facet of it and which facets it goes on in: sites near facets that neither are of it, nor lie in the plane of that one, nor hold their normal displacement keep the field, as do all near
/// cracks. Without one, all sites near the boundary keep it. None if the patch has no unique solution.
pub(super) fn stress_errors<const D: usize>(
    around: &Around<'_, D>,
    place: &Vector<D>,
    main: Option<(usize, &[bool])>,
    fields: &[PatchField<'_, D>],
) -> Option<Vec<StressError<D>>> {
    let model = around.model;
    let mut list: Vec<u32> = (0..model.sites.len() as u32).collect();
    let distance = |s: &u32| (model.sites[*s as usize].position - place).norm_squared();
    let count = SITES[D - 1].min(list.len());
    if count < list.len() {
        list.select_nth_unstable_by(count, |a, b| {
            distance(a).total_cmp(&distance(b)).then(a.cmp(b))
        });
        list.truncate(count);
    }
    list.sort_unstable();
    let keeps: Vec<bool> = list.iter().map(|&s| keeps_field(around, s, main)).collect();
    let is_point = |s: u32| matches!(model.sites[s as usize].kind, SiteKind::Point(_));
    let mut points = list.iter().zip(&keeps).filter(|(s, _)| is_point(**s));
    // a patch that keeps the field everywhere would show no error whatever its rows are
    if main.is_some() && points.clone().next().is_some() && points.all(|(_, keeps)| *keeps) {
        return None;
    }
    let prescribed: Vec<Option<f64>> = (list.iter().zip(&keeps))
        .flat_map(|(&s, keeps)| {
            let held = &around.held[s as usize * D..][..D];
            held.iter().map(|h| (*h || *keeps).then_some(0.0))
        })
        .collect();
    let free = FreeDofs::from_prescribed(&prescribed, D);
    let of_field = |field: &PatchField<'_, D>| -> Mismatches<D> {
        list.iter().map(|&s| around.mismatch(field, s)).collect()
    };
    let mismatches: Vec<Mismatches<D>> = fields.iter().map(of_field).collect();
    let Rows { matrix, products } = rows(around, &list, fields, &mismatches);
    let positions: Vec<[f64; 3]> = list
        .iter()
        .map(|&s| padded(&model.sites[s as usize].position))
        .collect();
    let params = DirectParams {
        symmetry: Symmetry::Unsymmetric,
        ..DirectParams::default()
    };
    let analysis = Analysis::new(&matrix, &free, &positions, Ordering::default()).ok()?;
    let (factor, _) = Factor::new(&matrix, &free, analysis, &params, &Silent).ok()?;
    let errors = fields.iter().enumerate().map(|(number, field)| {
        let mut rhs = vec![0.0; count * D];
        for (local, &s) in list.iter().enumerate() {
            let force = &products[(local * fields.len() + number) * D..][..D];
            for a in (0..D).filter(|&a| free.is_free(local, a)) {
                let wanted = field.forces.get(s as usize * D + a).copied().unwrap_or(0.0);
                rhs[local * D + a] = wanted - force[a];
            }
        }
        let mut u = vec![0.0; model.sites.len() * D];
        parallel::for_each_chunk(&mut u, D, 1, |s, u| {
            let x = model.sites[s].position - around.centre;
            u.copy_from_slice((field.gradient * x).as_slice());
        });
        let change = factor.solve(&rhs);
        for (local, &s) in list.iter().enumerate() {
            let mismatch = &mismatches[number][local];
            for a in 0..D {
                u[s as usize * D + a] += mismatch[a] + change[local * D + a];
            }
        }
        largest(around, &list, &keeps, &field.gradient, &u)
    });
    Some(errors.collect())
}

/// Returns true if a site of a patch keeps the field whatever its row asks for.
fn keeps_field<const D: usize>(
    around: &Around<'_, D>,
    site: u32,
    main: Option<(usize, &[bool])>,
) -> bool {
    let boundary = around.boundary;
    let x = &around.model.sites[site as usize].position;
    let lies_in = |f: usize| {
        let n = &boundary.normals[f];
        main.is_some_and(|(m, surface)| {
            let is_plane = n.dot(&boundary.normals[m]) > PLANE;
            is_plane || surface[f] || boundary.kinds[f] == FacetKind::Held
        })
    };
    boundary.is_near_crack(x, around.reach)
        || boundary.is_near_border(x, around.reach)
        || (boundary.near_of(x, around.reach, |f| !lies_in(f)).next()).is_some()
}

/// [`Around::mismatch`] of each site of a patch: a search among the facets, so once for each.
type Mismatches<const D: usize> = Vec<Vector<D>>;

/// The rows of the sites of a patch, as far as they are needed: whole, those of a state-based law have a thousand blocks each.
struct Rows {
    /// The part among the sites of the patch, numbered within it.
    matrix: BlockCsr,
    /// The products of the whole rows with each field, `D` numbers for each, site by site.
    products: Vec<f64>,
}

impl<const D: usize> Around<'_, D> {
    /// Returns the excess of the held dofs of a site over the field.
    fn mismatch(&self, field: &PatchField<'_, D>, site: u32) -> Vector<D> {
        Vector::from_fn(|a, _| {
            let dof = site as usize * D + a;
            match self.held[dof] {
                true => (field.mismatch)(dof),
                false => 0.0,
            }
        })
    }
}

/// The rows of the sites of a patch.
fn rows<const D: usize>(
    around: &Around<'_, D>,
    list: &[u32],
    fields: &[PatchField<'_, D>],
    mismatches: &[Mismatches<D>],
) -> Rows {
    let Some(spread) = &around.spread else {
        return own_rows(around, list, list, fields, mismatches);
    };
    let rank = spread.ranks.rank();
    let own = list.iter().copied();
    let own: Vec<u32> = own.filter(|&s| spread.partition.owner(s) == rank).collect();
    let Rows { matrix, products } = own_rows(around, &own, list, fields, mismatches);
    let some_of_own = |some: &[u32]| {
        let mut rows = no_rows::<D>();
        for site in some {
            let (columns, values) = matrix.row(own.partition_point(|s| s < site));
            rows.columns.extend(columns);
            rows.values.extend(values);
            rows.row_offsets.push(rows.columns.len());
        }
        rows
    };
    Rows {
        matrix: spread.gather_rows(list, some_of_own),
        products: spread.of_sites(list, fields.len() * D, |_| products),
    }
}

/// A matrix without rows yet.
fn no_rows<const D: usize>() -> BlockCsr {
    BlockCsr {
        block: D,
        row_offsets: vec![0],
        ..BlockCsr::default()
    }
}

/// The rows of some sites of a patch, whose sites are `list`.
fn own_rows<const D: usize>(
    around: &Around<'_, D>,
    some: &[u32],
    list: &[u32],
    fields: &[PatchField<'_, D>],
    mismatches: &[Mismatches<D>],
) -> Rows {
    let model = around.model;
    let new_row = || Row::<D>::new(model.sites.len());
    let each = parallel::map_with(some.len(), 1, new_row, |row, k| {
        let site = some[k];
        match around.stiffness {
            Some(stiffness) => {
                let (columns, values) = stiffness.row(site as usize);
                for (&column, block) in columns.iter().zip(values.chunks_exact(D * D)) {
                    row.add_site(column, &Tensor::from_row_slice(block));
                }
            }
            None => model.add_scaled_row(around.operator, site as usize, row),
        }
        // Σ K x_c, by which the row of any gradient G is Σ_c (Σ K x_c) G_c: whatever the number of fields
        let mut moments = [Tensor::<D>::zeros(); D];
        let mut within: Vec<(u32, Tensor<D>)> = Vec::new();
        row.take_blocks(|column, block| {
            let x = model.sites[column as usize].position - around.centre;
            (moments.iter_mut().zip(x.iter())).for_each(|(moment, x)| *moment += block * *x);
            if let Ok(place) = list.binary_search(&column) {
                within.push((place as u32, *block));
            }
        });
        within.sort_unstable_by_key(|(place, _)| *place);
        let product = |(field, mismatches): (&PatchField<'_, D>, &Mismatches<D>)| {
            let of_gradient = (moments.iter().enumerate())
                .fold(Vector::<D>::zeros(), |sum, (c, moment)| {
                    sum + moment * field.gradient.column(c)
                });
            within.iter().fold(of_gradient, |sum, (place, block)| {
                sum + block * mismatches[*place as usize]
            })
        };
        let products: Vec<Vector<D>> = fields.iter().zip(mismatches).map(product).collect();
        (within, products)
    });
    let (mut matrix, mut products) = (no_rows::<D>(), Vec::new());
    for (within, of_fields) in each {
        for (place, block) in within {
            matrix.columns.push(place);
            // row by row
            matrix.values.extend(block.transpose().iter());
        }
        matrix.row_offsets.push(matrix.columns.len());
        products.extend(of_fields.iter().flat_map(|p| p.iter().copied()));
    }
    Rows { matrix, products }
}

/// The stresses of some points of the body at a displacement, from the processes that hold their families; empty where all are here.
fn spread_stresses<const D: usize>(
    around: &Around<'_, D>,
    list: &[u32],
    u: &[f64],
) -> Vec<Tensor<D>> {
    let stress = |&s: &u32| {
        let point = around.model.point_of(s as usize);
        point.map_or(Tensor::zeros(), |(body, p)| body.partial_stress(p, u))
    };
    let Some(spread) = &around.spread else {
        return Vec::new();
    };
    let numbers = spread.of_sites(list, D * D, |own| {
        let stresses: Vec<Tensor<D>> = own.iter().map(stress).collect();
        stresses.iter().flat_map(|t| t.iter()).copied().collect()
    });
    let stresses = numbers.chunks_exact(D * D);
    stresses.map(Tensor::from_column_slice).collect()
}

/// The largest difference of the stress of points and elements of a patch from that of the field.
fn largest<const D: usize>(
    around: &Around<'_, D>,
    list: &[u32],
    keeps: &[bool],
    gradient: &Tensor<D>,
    u: &[f64],
) -> StressError<D> {
    let model = around.model;
    let mut found = StressError {
        relative: 0.0,
        at: model.sites[list[0] as usize].position,
    };
    // over the stress of the place's own material
    let mut compare = |stress: Tensor<D>, cell: usize, at: Vector<D>| {
        let tensor = model.tensor_of_cell(cell);
        let (exact, scale) = (tensor.contract(gradient), tensor.amax());
        let difference = (stress - exact) / scale;
        for i in 0..D {
            for j in i..D {
                let size = difference[(i, j)].abs();
                if size.is_nan() || size > found.relative.abs() * (1.0 + 1e-9) {
                    let sign = exact[(i, j)].abs() > 0.5 * scale;
                    let signed = difference[(i, j)] * exact[(i, j)].signum();
                    found = StressError {
                        relative: if sign { signed } else { size },
                        at,
                    };
                }
            }
        }
    };
    let cell_of = |material: u16| {
        let mut cells = 0..model.mesh.cell_count();
        cells.find(|&c| model.material_of_cell(c) == material)
    };
    let materials = model.body().map_or(&[][..], |body| &body.cloud.material);
    // the first cell of each material in use
    let count = materials.iter().max().map_or(0, |m| usize::from(*m) + 1);
    let cells_of: Vec<Option<usize>> = (0..count as u16).map(cell_of).collect();
    let of_points = cell_of(model.peridynamic_material());
    let cell_of_point = |p: usize| match materials.get(p) {
        Some(&m) => cells_of[usize::from(m)],
        None => of_points,
    };
    let mut cells: Vec<usize> = Vec::new();
    let known = spread_stresses(around, list, u);
    for (place, (&s, keeps)) in list.iter().zip(keeps).enumerate() {
        let site = &model.sites[s as usize];
        // what families that other surfaces cut show is no error of this row
        if *keeps && matches!(site.kind, SiteKind::Point(_)) {
            continue;
        }
        match (site.kind, model.point_of(s as usize)) {
            (SiteKind::Point(_), Some((body, p))) => {
                let Some(c) = cell_of_point(p) else { continue };
                let known = known.get(place).copied();
                let stress = known.unwrap_or_else(|| body.partial_stress(p, u));
                compare(stress, c, site.position);
            }
            _ => cells.extend(model.cells_of_site(s as usize).map(|(c, _)| c)),
        }
    }
    cells.sort_unstable();
    cells.dedup();
    for c in cells.into_iter().filter(|&c| model.is_element(c)) {
        let node = |n: usize| model.node_transfer.displacement::<D>(n, u);
        let of_bonds = around.operator.cell_stress(c, u);
        let stress = of_bonds.unwrap_or_else(|| {
            let g = fem::displacement_gradient_at_centre(&model.mesh, c, node);
            model.tensor_of_cell(c).contract(&g)
        });
        compare(stress, c, model.mesh.centroid(c));
    }
    found
}
