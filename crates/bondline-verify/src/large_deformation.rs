//! Large uniform deformations through the seam of points and elements that follow their bonds, `elements = "cauchy-born"`, or that have one local law.

use rayon::prelude::*;

use crate::{Effort, meshes::scene};
use bondline::{
    coupling::{
        CoupledSystem,
        semidiscrete::{BondBehaviour, SystemError},
    },
    model::SiteKind,
    observe::report::{Columns, Table, TableRow},
    peridynamics::{
        PdBody,
        bond_force::{BondKinematics, Storage},
    },
    progress::Progress,
    run::SceneModel,
    system::{FailureUpdate, Interval, SemiDiscrete},
    tensor::{Tensor, Vector},
};

/// Largest force per volume over E|G|/h, and largest difference of stresses over E.
pub const LIMIT: f64 = 1e-10;

/// Young's modulus of all scenes \[Pa\].
const YOUNG: f64 = 7.0;

/// Stretch along x, others, and the angle of the rotation in the plane.
const STRETCH: f64 = 1.3;
const ROTATION: f64 = 0.7;

/// A mesh with a zone that elements enclose, four horizons and more from the boundary: there families of neighbours of transition points would be cut, and fitted to first order.
struct Body {
    name: &'static str,
    mesh: &'static str,
    files: &'static [(&'static str, &'static str)],
    kinematics: &'static str,
    zone: [f64; 2],
    spacing: f64,
}

/// Meshes that follow the lattice, and that do not.
const BODIES: [Body; 4] = [
    Body {
        name: "quadrilaterals",
        mesh: "rectangle = { min = [0, 0], max = [16, 16], x.cells = 32, y.cells = 32 }",
        files: &[],
        kinematics: "plane-strain",
        zone: [6.0, 10.0],
        spacing: 0.5,
    },
    Body {
        name: "Delaunay triangles",
        mesh: "file.path = \"m.msh\"",
        files: &[(
            "m.msh",
            include_str!("../../../meshes/graded_triangles.msh"),
        )],
        kinematics: "plane-stress",
        zone: [8.0, 12.0],
        spacing: 0.4,
    },
    Body {
        name: "a bar",
        mesh: "line = { min = 0, max = 16, x.cells = 32 }",
        files: &[],
        kinematics: "bar",
        zone: [6.0, 10.0],
        spacing: 0.5,
    },
    Body {
        name: "hexahedra",
        mesh: "box = { min = [0, 0, 0], max = [14, 14, 14], x.cells = 14, y.cells = 14, z.cells = 14 }",
        files: &[],
        kinematics: "solid",
        zone: [6.0, 8.0],
        spacing: 0.5,
    },
];

const LAWS: [(&str, &str); 5] = [
    ("bond-based", "bond-based]"),
    ("LPS, 0.4", "lps]\npoisson-ratio = 0.4"),
    ("hardening", "hardening]\nhardening = 3"),
    ("PALS", "pals]\npoisson-ratio = 0.3"),
    (NEO_HOOKE, "neo-hooke]\npoisson-ratio = 0.3"),
];

/// Points and elements have one local law.
const NEO_HOOKE: &str = "neo-Hooke";

const COUPLINGS: [&str; 6] = [
    "splice",
    "truncated",
    ELEMENTWISE,
    MESHFREE,
    "balanced",
    "blending",
];

const ELEMENTWISE: &str = "partial-stress in elements";
const MESHFREE: &str = "meshfree partial-stress";

/// The scene of one case.
fn text(body: &Body, law: &str, coupling: &str) -> String {
    let dimensions = match body.kinematics {
        "bar" => 1,
        "solid" => 3,
        _ => 2,
    };
    let at = |x: f64| format!("{:?}", &[x; 3][..dimensions]);
    let around = match coupling {
        "blending" | ELEMENTWISE | MESHFREE => "transition = { around = 2 }\n",
        _ => "",
    };
    let coupling = match coupling {
        ELEMENTWISE => "{ partial-stress = { form = \"elements\" } }".to_owned(),
        MESHFREE => "{ partial-stress = { form = \"meshfree\" } }".to_owned(),
        name => format!("{name:?}"),
    };
    let elements = match law.starts_with("neo-hooke") {
        true => "",
        false => "bonds = \"exact\"\nelements = \"cauchy-born\"\n",
    };
    // a bar has no lateral strain
    let law = match body.kinematics {
        "bar" => law.replace("0.4", "0.25").replace("0.3", "0.25"),
        _ => law.to_owned(),
    };
    format!(
        "kinematics = \"{}\"\ncoupling = {coupling}\n[mesh]\n{}\n[materials.m.{law}\nyoungs-modulus = {YOUNG}\ndensity = 1\n[solve.explicit]\nduration = 1\n[peridynamics]\nhorizon = {}\n{elements}points.lattice = {{ spacing = {} }}\n[zones]\nnonlocal.box = {{ min = {}, max = {} }}\n{around}",
        body.kinematics,
        body.mesh,
        3.0 * body.spacing,
        body.spacing,
        at(body.zone[0]),
        at(body.zone[1]),
    )
}

/// Results of one case.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Largest internal force of a site inside, per volume over E|G|/h.
    pub residual: f64,
    /// Largest difference of the first Piola–Kirchhoff stress of points from that of elements, over E.
    pub stress: f64,
    /// Largest force under the rotation alone, likewise.
    pub rotation: f64,
    /// Energy stored under the rotation alone, over E and the volume.
    pub energy: f64,
    /// Largest difference of the force of a site, in a bent body that is rotated, from the rotated force, over the largest force.
    pub turned: f64,
}

/// The displacement gradients: stretch with rotation, and rotation alone.
fn gradients<const D: usize>() -> [Tensor<D>; 2] {
    let mut stretch = Tensor::<D>::from_fn(|i, j| match i == j {
        true => 0.95,
        false => 0.05,
    });
    stretch[(0, 0)] = STRETCH;
    let mut rotation = Tensor::<D>::identity();
    if D > 1 {
        let (sin, cos) = ROTATION.sin_cos();
        (rotation[(0, 0)], rotation[(1, 1)]) = (cos, cos);
        (rotation[(0, 1)], rotation[(1, 0)]) = (-sin, sin);
    }
    [rotation * stretch, rotation].map(|f| f - Tensor::identity())
}

/// `Σ T⟨ξ⟩ ⊗ ξ V` of a point by its own bonds, of a law whose force is linear in the extension: \[SAND2015-7998\] eq. (3.1) with a geometrically exact stretch, (5.16).
fn stress_of_point<const D: usize>(body: &PdBody<D>, i: usize, f: &Tensor<D>) -> Tensor<D> {
    let (pair, omega) = body.kernel(i);
    let family = body.families.of(i);
    let bond = |k: usize| {
        let xi = body.bond(i, family[k] as usize);
        let y = f * xi;
        let volume = body.cloud.volume[family[k] as usize];
        (xi, y, y.norm() - xi.norm(), volume)
    };
    let state = body.state(i);
    let modulus = state.map_or(0.0, |s| s.modulus.get(0, 0, 0, 0));
    let omega = |k: usize| omega.get(k).copied().unwrap_or(0.0);
    let theta: f64 = (0..family.len())
        .map(|k| {
            let (xi, _, e, volume) = bond(k);
            omega(k) * xi.norm() * e * volume
        })
        .sum();
    let mut stress = Tensor::zeros();
    for (k, p) in pair.iter().enumerate() {
        let (xi, y, e, volume) = bond(k);
        let r = xi.norm();
        let t = p * r * r * e + modulus * theta * omega(k) * r;
        stress += y / y.norm() * xi.transpose() * (t * volume);
    }
    stress
}

/// Displacements of the sites, and their internal forces.
fn internal<const D: usize>(
    laid: &SceneModel<D>,
    system: &mut CoupledSystem<'_, D>,
    displacement: impl Fn(&Vector<D>) -> Vector<D>,
) -> (Vec<f64>, Vec<f64>) {
    let displacements = (laid.model.sites.iter()).map(|s| displacement(&s.position));
    let u: Vec<f64> = displacements
        .flat_map(|u| u.iter().copied().collect::<Vec<_>>())
        .collect();
    let mut force = vec![0.0; u.len()];
    system.internal_force_into(&u, &mut force, Interval::AT_ONCE, FailureUpdate::Frozen);
    (u, force)
}

/// The forces of a body that is stretched and bent, beside those of the same body rotated: a field that is not affine shows whether force states turn with it.
fn turned<const D: usize>(laid: &SceneModel<D>, system: &mut CoupledSystem<'_, D>) -> f64 {
    let [large, rotation] = gradients::<D>();
    let length = laid.model.mesh.bounds().1.amax();
    let bent = |x: &Vector<D>| {
        let s = x / length;
        large * x + Vector::from_fn(|a, _| 0.05 * length * s[a] * s[D - 1 - a])
    };
    let (_, force) = internal(laid, system, bent);
    let turn = Tensor::identity() + rotation;
    let (_, of_turned) = internal(laid, system, |x| turn * (x + bent(x)) - x);
    let (mut largest, mut off) = (0.0f64, 0.0f64);
    for (f, turned) in force.chunks_exact(D).zip(of_turned.chunks_exact(D)) {
        let f = turn * Vector::<D>::from_column_slice(f);
        largest = largest.max(f.norm());
        off = off.max((Vector::from_column_slice(turned) - f).norm());
    }
    off / largest
}

/// Forces of the sites inside, and the energy, under a uniform gradient.
fn forces<const D: usize>(
    laid: &SceneModel<D>,
    system: &mut CoupledSystem<'_, D>,
    g: &Tensor<D>,
) -> (f64, f64) {
    let model = &laid.model;
    let (u, force) = internal(laid, system, |x| g * x);
    let mut is_outer = vec![false; model.mesh.nodes.len()];
    for facet in model.mesh.outer_facets() {
        facet
            .nodes
            .iter()
            .for_each(|&n| is_outer[n as usize] = true);
    }
    let size = model.spacing() / (YOUNG * g.norm());
    let inside = (model.sites.iter().zip(force.chunks_exact(D)))
        .filter(|(site, _)| !matches!(site.kind, SiteKind::Node(n) if is_outer[n as usize]));
    let largest = inside
        .map(|(site, f)| Vector::<D>::from_column_slice(f).norm() / site.volume * size)
        .fold(0.0, f64::max);
    (largest, system.stored_energy(&u))
}

/// Measures one scene.
///
/// # Errors
/// The message of a refusal.
pub fn measured<const D: usize>(
    text: &str,
    files: &[(&str, &str)],
    has_linear_extensions: bool,
) -> Result<Found, String> {
    let laid = scene::model::<D>(text, files).map_err(|e| e.to_string())?;
    let operator = laid
        .coupling
        .operator(&laid.model)
        .map_err(|e| e.to_string())?;
    let behaviour = BondBehaviour {
        kinematics: BondKinematics::Exact,
        failure: None,
        softening: None,
        no_fail: &|_| false,
        contact: None,
        storage: Storage::Double,
        broken: None,
        heat: None,
    };
    let symmetry = laid.coupling.symmetry();
    let system = CoupledSystem::new(&laid.model, &operator, symmetry, |_| 1.0, &behaviour);
    let laws = laid.model.local_laws(&laid.local_laws);
    let mut system = system
        .and_then(|system| system.with_local_laws(&laws))
        .map_err(|e: SystemError| e.to_string())?;
    let [large, rotation] = gradients::<D>();
    let (residual, _) = forces(&laid, &mut system, &large);
    let (rotated, energy) = match D {
        1 => (0.0, 0.0),
        _ => forces(&laid, &mut system, &rotation),
    };
    let law = laws.first().and_then(Option::as_ref);
    let law = law.ok_or("the elements are linear")?;
    let element = law.respond(&large, 0.0, &[], &mut []).stress;
    let f = Tensor::identity() + large;
    let body = laid.model.body().ok_or("there are no points")?;
    let points = (laid.model.sites.iter()).filter_map(|s| match s.kind {
        SiteKind::Point(p) if has_linear_extensions => Some(p as usize),
        _ => None,
    });
    let whole = points.clone().map(|p| body.families.of(p).len()).max();
    let stress = points
        .filter(|&p| Some(body.families.of(p).len()) == whole)
        .map(|p| (stress_of_point(body, p, &f) - element).amax() / YOUNG)
        .fold(0.0, f64::max);
    let volume: f64 = laid.model.sites.iter().map(|s| s.volume).sum();
    Ok(Found {
        residual,
        stress,
        rotation: rotated,
        energy: energy.abs() / (YOUNG * volume),
        turned: match D {
            1 => 0.0,
            _ => turned(&laid, &mut system),
        },
    })
}

fn rows(body: &Body, law: (&str, &str), coupling: &str) -> Vec<TableRow> {
    let case = format!("{}, {coupling}, {}", body.name, law.0);
    let typed = text(body, law.1, coupling);
    let linear = matches!(law.0, "bond-based" | "LPS, 0.4");
    let found = match body.kinematics {
        "bar" => measured::<1>(&typed, body.files, linear),
        "solid" => measured::<3>(&typed, body.files, linear),
        _ => measured::<2>(&typed, body.files, linear),
    };
    let is_refused = matches!(coupling, "balanced" | "blending")
        || (coupling == "truncated" && !linear && law.0 != NEO_HOOKE)
        || (matches!(coupling, ELEMENTWISE | MESHFREE) && law.0 == NEO_HOOKE)
        || (body.kinematics == "bar" && law.0 == "PALS");
    let found = match found {
        Ok(found) => found,
        Err(why) if is_refused => return vec![TableRow::refused(case, "residual", why)],
        Err(why) => return vec![TableRow::at_most(case, "residual", f64::NAN, LIMIT).because(why)],
    };
    // where faces do not follow the lattice, and at edges in space, bonds that end on faces balance to first order
    let is_exact = coupling != "truncated"
        || law.0 == NEO_HOOKE
        || matches!(body.kinematics, "bar" | "plane-strain");
    let residual = match !is_exact {
        true => TableRow::info(&case, "residual", found.residual),
        false => TableRow::at_most(&case, "residual", found.residual, LIMIT),
    };
    let mut rows = vec![residual];
    if linear {
        rows.push(TableRow::at_most(
            &case,
            "stress, points less elements",
            found.stress,
            LIMIT,
        ));
    }
    if body.kinematics != "bar" {
        rows.push(TableRow::at_most(
            &case,
            "residual under rotation",
            found.rotation,
            LIMIT,
        ));
        rows.push(TableRow::at_most(
            &case,
            "energy of rotation",
            found.energy,
            LIMIT,
        ));
        // strings along the edges of a zone in space are linear
        let has_strings =
            coupling == "truncated" && law.0 != NEO_HOOKE && body.kinematics == "solid";
        rows.push(match has_strings {
            true => TableRow::info(&case, "bent body, rotated", found.turned),
            false => TableRow::at_most(&case, "bent body, rotated", found.turned, LIMIT),
        });
    }
    rows
}

/// Large deformations at each seam.
pub fn run(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    progress.stage("large deformations", None);
    let mut cases = Vec::new();
    for body in &BODIES {
        for (l, law) in LAWS.into_iter().enumerate() {
            for (c, coupling) in COUPLINGS.into_iter().enumerate() {
                // one law says what a coupling refuses
                let is_one = law.0 == NEO_HOOKE;
                let quick = (c < 2 && (l < 2 || is_one || body.kinematics != "solid")) || l == 0;
                if (effort == Effort::Full || quick) && (c < 4 || body.kinematics == "plane-strain")
                {
                    cases.push((body, law, coupling));
                }
            }
        }
    }
    let rows: Vec<Vec<TableRow>> = cases
        .into_par_iter()
        .map(|(body, law, coupling)| rows(body, law, coupling))
        .collect();
    let mut table = Table::new(
        format!(
            "A stretch of {STRETCH} with shear, rotated by {ROTATION} rad, and the rotation alone; elements follow the bonds. Largest force of a site per volume over E|G|/h, difference of stresses over E, energy over E V; of a bent body, force rotated with it less its rotated force, over the largest force"
        ),
        Columns::ByQuantity,
    );
    rows.into_iter().flatten().for_each(|row| table.push(row));
    vec![table]
}
