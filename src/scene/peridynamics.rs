//! The peridynamic choices of a validated scene: horizon, points, weights, influence function, partial volumes.

use super::bounds_checks;
use super::default_horizon::horizon_of;
use super::default_points::{self, default_points};
use super::error::SceneError;
use super::expression::Expression;
use super::region::position;
use super::solve;
use super::spec::{InfluenceSpec, LatticeStart, PeridynamicsSpec, PointsSpec};
use super::value::Number;
use crate::mesh::Mesh;
use crate::model::{HorizonChange, PointSource, Surfaces, Zone};
use crate::peridynamics::{BondWeights, Influence, PartialVolume};
use crate::tensor::{Vector, padded};

/// The peridynamic choices of a scene.
#[derive(Clone, Debug)]
pub struct Peridynamics<const D: usize> {
    /// Horizon δ as a field.
    pub horizon: Expression,
    /// Reason for its size, if the scene does not type it.
    pub horizon_why: Option<String>,
    /// Rule for bonds between points of different horizons.
    pub horizon_change: HorizonChange,
    /// Positions of the points.
    pub points: PointSource<D>,
    /// Reason for their positions, as far as the scene does not type them.
    pub points_why: Option<String>,
    /// Bond weights.
    pub weights: BondWeights,
    /// Shares of the cells that the horizon cuts.
    pub volumes: PartialVolume,
    /// Treatment of bonds across the boundary of the mesh.
    pub surfaces: Surfaces,
}

impl<const D: usize> Peridynamics<D> {
    /// The horizon at a position.
    pub fn horizon_at(&self, x: &Vector<D>) -> f64 {
        self.horizon.eval(&crate::tensor::padded(x))
    }
}

/// The influence function typed at `place`.
pub(crate) fn influence(place: &str, spec: &InfluenceSpec) -> Result<Influence, SceneError> {
    let InfluenceSpec::Polynomial(p) = spec else {
        return Ok(Influence::Gaussian);
    };
    let small = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
    Influence::polynomial(small(p.degree.value), small(p.alpha.value)).map_err(|error| {
        let degree_is_wrong = Influence::polynomial(small(p.degree.value), 0).is_err();
        let span = if degree_is_wrong {
            &p.degree.span
        } else {
            &p.alpha.span
        };
        SceneError::wrong_value(format!("`{place}`: {error}"))
            .label(span.clone(), "not offered")
            .help("degree is 0, 1, 3, 5 or 7; alpha is 0 or 1")
    })
}

/// Reads `[peridynamics]`; a lattice starts at a corner of the mesh, or half a spacing inside. A lattice that is not typed is laid out for `zones`.
pub(crate) fn peridynamics<const D: usize>(
    spec: &PeridynamicsSpec,
    start: LatticeStart,
    mesh: &Mesh<D>,
    zones: &[Zone],
) -> Result<Peridynamics<D>, SceneError> {
    if let Some(typed) = &spec.horizon {
        check_horizon::<D>(typed)?;
    }
    let (horizon, horizon_why) = horizon_of(spec, mesh, zones);
    let mut points_why = None;
    let points = match &spec.points {
        None => {
            let of_cell = |c: usize| horizon.eval(&padded(&mesh.centroid(c)));
            let (points, why) = default_points(mesh, zones, start, of_cell);
            points_why = Some(why);
            points
        }
        Some(PointsSpec::Cells) if is_partial(spec) => {
            default_points::of_centroids(mesh).unwrap_or(PointSource::Cells)
        }
        // each point of a file has a cell of its own
        Some(PointsSpec::Cells | PointsSpec::File(_)) => PointSource::Cells,
        Some(PointsSpec::Lattice(lattice)) => {
            let spacing =
                bounds_checks::positive("peridynamics.points.lattice.spacing", &lattice.spacing)?;
            let (lo, hi) = mesh.bounds();
            let count: f64 = (hi - lo).iter().map(|l| l / spacing).product();
            if count > 1e9 {
                return Err(SceneError::wrong_value(format!(
                    "`peridynamics.points.lattice.spacing` is {spacing}: {count:.1e} points would fill the mesh"
                ))
                .label(lattice.spacing.span.clone(), "too fine")
                .help("use a larger spacing"));
            }
            let origin = match &lattice.origin {
                Some(o) => position("peridynamics.points.lattice.origin", o)?,
                None => {
                    let (origin, where_to) = match start {
                        // where the mesh follows the lattice, points and nodes coincide: the seam then interpolates nothing
                        LatticeStart::OnCorner => (lo, "at"),
                        LatticeStart::Halfway => {
                            (lo.add_scalar(0.5 * spacing), "half a spacing from")
                        }
                    };
                    points_why = Some(format!(
                        "the scene leaves `origin` out; the lattice starts {where_to} the lowest corner of the mesh"
                    ));
                    origin
                }
            };
            PointSource::Lattice { spacing, origin }
        }
    };
    let volumes = volumes(spec, matches!(points, PointSource::Lattice { .. }))?;
    Ok(Peridynamics {
        horizon,
        horizon_why,
        horizon_change: HorizonChange::default(),
        points,
        points_why,
        weights: spec.weights,
        volumes,
        // the cells of points from a file share no faces
        surfaces: match spec.points {
            Some(PointsSpec::File(_)) => Surfaces::Uncut,
            _ => spec
                .surfaces
                .as_ref()
                .map_or_else(Surfaces::default, |s| *s.get_ref()),
        },
    })
}

/// Refuses a horizon that varies in time or along axes that there are not, or a number that is not positive.
fn check_horizon<const D: usize>(typed: &Expression) -> Result<(), SceneError> {
    bounds_checks::no_further_axes::<D>("peridynamics.horizon", typed)?;
    solve::still("peridynamics.horizon", typed)?;
    if let Some(value) = typed.as_constant() {
        let number = Number {
            value,
            span: typed.span.clone(),
        };
        bounds_checks::positive("peridynamics.horizon", &number)?;
    }
    Ok(())
}

/// Returns true if cells are typed to count in part.
fn is_partial(spec: &PeridynamicsSpec) -> bool {
    let typed = spec.volumes.as_ref().map(|typed| *typed.get_ref());
    typed.is_some_and(|volumes| volumes != PartialVolume::Full)
}

/// The partial volumes typed; they need to know the cells of a lattice.
fn volumes(spec: &PeridynamicsSpec, is_lattice: bool) -> Result<PartialVolume, SceneError> {
    let typed = spec.volumes.as_ref().filter(|_| is_partial(spec));
    let Some(typed) = typed else {
        return Ok(PartialVolume::Full);
    };
    let conflict = |message: &str, help: &str| {
        Err(SceneError::conflict(message)
            .label(typed.span(), "needs a lattice of points")
            .help(help))
    };
    if !is_lattice {
        return conflict(
            "`peridynamics.volumes` is partial, and the points are those of a file, or of cells that are not all equal cubes of one grid",
            "give peridynamics.points.lattice a spacing, or use volumes = \"full\"",
        );
    }
    if spec.weights == BondWeights::Fitted {
        return conflict(
            "`peridynamics.volumes` is partial, and the weights are fitted to full volumes",
            "use weights = \"isotropic\" or \"plain\", or volumes = \"full\"",
        );
    }
    Ok(*typed.get_ref())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::coupling::semidiscrete::behaviour::{BondBehaviour, BondThreshold};
    use crate::peridynamics::bond_force::BondKinematics;
    use crate::progress::Silent;
    use crate::run::AnyScene;
    use crate::run::{Solved, solve_with};
    use crate::scene::Source;
    use crate::system::{FailureUpdate, Interval, SemiDiscrete, Symmetry};
    use crate::tensor::Tensor4;
    use crate::{coupling::CoupledSystem, model::Sampler};

    /// A plate whose edge moves as `u = G x`; a lattice with δ/h = 3.3 in its middle.
    const PLATE: &str = r#"
kinematics = "plane-stress"
coupling.splice = {}
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 40 }
y = { cells = 40 }
[materials.plate.lps]
youngs-modulus = 2
poisson-ratio = 0.25
[peridynamics]
horizon = "3.3/40"
points.lattice = { spacing = "1/40" }
[zones.nonlocal]
box = { min = [0.4, 0.4], max = [0.6, 0.6] }
[zones.transition]
box = { min = [0.25, 0.25], max = [0.75, 0.75] }
[conditions.left.displacement]
on = "left"
x = "2e-3*x+1e-3*y"
y = "-5e-4*x+1e-3*y"
[conditions.right.displacement]
on = "right"
x = "2e-3*x+1e-3*y"
y = "-5e-4*x+1e-3*y"
"#;

    fn plate(overrides: &[&str]) -> Result<Scene2, SceneError> {
        plate_of(PLATE, overrides)
    }

    fn plate_of(text: &str, overrides: &[&str]) -> Result<Scene2, SceneError> {
        let mut source = Source::new("plate.toml", text);
        for o in overrides {
            source.push_override(o)?;
        }
        match AnyScene::from_source(&source, Path::new(""), "plate")? {
            AnyScene::Plane(scene) => Ok(scene.scene),
            _ => unreachable!("a plate is plane"),
        }
    }

    type Scene2 = crate::scene::Scene<2>;

    /// Largest distance from `u = G x` over the displacement, the material's `C_1111` and `C_1122` in the middle, the elements', and the bonds.
    fn pulled(overrides: &[&str]) -> (f64, [f64; 2], [f64; 2], usize, Vec<String>) {
        let mut found = (f64::NAN, [0.0; 2], [0.0; 2]);
        let summary = solve_with(
            plate(overrides).unwrap(),
            &Silent,
            |_, solved: &Solved<'_, 2>| {
                let sampler = Sampler::new(solved.model);
                let mut miss: f64 = 0.0;
                for site in &solved.model.sites {
                    let x = site.position;
                    let u = sampler.displacement(&x, solved.displacement).unwrap();
                    let wanted =
                        Vector::<2>::new(2e-3 * x[0] + 1e-3 * x[1], -5e-4 * x[0] + 1e-3 * x[1]);
                    miss = miss.max((u - wanted).norm() / 2e-3);
                }
                let body = solved.model.body().unwrap();
                let middle = Vector::<2>::new(0.5, 0.5);
                let nearest = (0..body.cloud.position.len())
                    .min_by(|&a, &b| {
                        let distance = |i: usize| (body.cloud.position[i] - middle).norm();
                        distance(a).total_cmp(&distance(b))
                    })
                    .unwrap();
                let two = |c: &Tensor4<2>| [c.get(0, 0, 0, 0), c.get(0, 0, 1, 1)];
                found = (
                    miss,
                    two(&body.collapsed_tensor(nearest)),
                    two(solved.model.tensor_of_cell(0)),
                );
                Ok(Vec::new())
            },
        )
        .unwrap();
        let choices = summary.choices.into_iter().map(|c| c.choice).collect();
        (found.0, found.1, found.2, summary.sizes.bonds, choices)
    }

    #[test]
    fn nothing_is_interpolated_across_a_crack() {
        // two halves of a plate that a crack parts, between two layers of points but not halfway, move as rigid bodies
        let (crack, lift) = (0.5062, 0.01);
        let text = r#"
kinematics = "plane-stress"
coupling = "nonlocal"
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 20 }
y = { cells = 20 }
[materials.plate.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = "3.2/20"
points.lattice = { spacing = "1/20", origin = ["1/40", "1/40"] }
[cracks.through]
segment = { from = [-1, 0.5062], to = [2, 0.5062] }
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.displacement]
on = "top"
x = 0
y = 0.01
"#;
        let mut worst: f64 = 0.0;
        solve_with(plate_of(text, &[]).unwrap(), &Silent, |_, solved| {
            let sampler = Sampler::new(solved.model);
            for k in 1..400 {
                let y = f64::from(k) / 400.0;
                let u = sampler.displacement(&Vector::<2>::new(0.41, y), solved.displacement);
                let wanted = if y < crack { 0.0 } else { lift };
                worst = worst.max((u.unwrap() - Vector::<2>::new(0.0, wanted)).norm());
            }
            Ok(Vec::new())
        })
        .unwrap();
        assert!(worst < 1e-11 * lift, "{worst:e}");
    }

    #[test]
    fn a_single_layer_of_points_between_seam_and_void_or_crack_is_sampled() {
        // a splice has points within the zone only: one layer of them at x = 0.375 beside a hole of the points, or a piece cut off, that begins at 0.4
        let text = r#"
kinematics = "plane-stress"
coupling = "splice"
[mesh.rectangle]
min = [0, 0]
max = [1, 1]
x = { cells = 24 }
y = { cells = 24 }
[materials.plate.bond-based]
youngs-modulus = 1
[peridynamics]
horizon = "2/24"
points.lattice = { spacing = "1/24" }
[zones.nonlocal]
box = { min = [0.3329, 0.3329], max = [0.6671, 0.6671] }
[voids.hole.inside]
box = { min = [0.4, 0.4], max = [0.6, 0.6] }
[conditions.bottom.displacement]
on = "bottom"
x = 0
y = 0
[conditions.top.displacement]
on = "top"
x = 0
y = 0.01
"#;
        // whatever the displacement is, between two sites of a layer and the seam it lies between theirs
        solve_with(plate_of(text, &[]).unwrap(), &Silent, |_, solved| {
            let sampler = Sampler::new(solved.model);
            let at = |x: f64, y: f64| {
                let u = sampler.displacement(&Vector::<2>::new(x, y), solved.displacement);
                u.expect("in the body")[1]
            };
            let y = 0.51;
            let (seam, layer) = (at(8.0 / 24.0, y), at(9.0 / 24.0, y));
            let between = at(0.36, y);
            let wanted = seam + (0.36 - 8.0 / 24.0) * 24.0 * (layer - seam);
            assert!((between - wanted).abs() < 1e-4, "{between} {wanted}");
            Ok(Vec::new())
        })
        .unwrap();
        let probe = plate_of(text, &["output.probes.in={at=[0.5,0.5]}"]).unwrap_err();
        assert!(probe.message().contains("lies in a void"), "{probe}");
    }

    #[test]
    fn partial_volumes_reach_scenes_and_the_seam_stays_exact() {
        // plane stress, E = 2 and nu = 1/4
        let typed = [2.0 / (1.0 - 0.0625), 0.5 / (1.0 - 0.0625)];
        let all_free = [
            "conditions.bottom.displacement={on=\"bottom\",x=\"2e-3*x+1e-3*y\",y=\"-5e-4*x+1e-3*y\"}",
            "conditions.top.displacement={on=\"top\",x=\"2e-3*x+1e-3*y\",y=\"-5e-4*x+1e-3*y\"}",
        ];
        let mut bonds = Vec::new();
        for volumes in ["full", "pdlammps", "hhb", "exact"] {
            for coupling in ["splice", "blending", "partial-stress"] {
                for weights in ["isotropic", "plain"] {
                    // Gauss points of elements have families fitted to the typed constants, not to a plain lattice
                    if (coupling, weights) == ("partial-stress", "plain") {
                        continue;
                    }
                    let set = [
                        all_free[0].to_owned(),
                        all_free[1].to_owned(),
                        format!("peridynamics.volumes={volumes}"),
                        format!("peridynamics.weights={weights}"),
                        format!("coupling={coupling}"),
                    ];
                    let set: Vec<&str> = set.iter().map(String::as_str).collect();
                    let (miss, points, elements, count, choices) = pulled(&set);
                    let case = format!("{volumes}, {coupling}, {weights}");
                    assert!(miss < 1e-10, "{case}: {miss:e}");
                    let both = points.iter().zip(&elements);
                    assert!(
                        both.clone().all(|(p, e)| (p - e).abs() < 1e-11),
                        "{case}: {points:?} {elements:?}"
                    );
                    let off = points[0] - typed[0];
                    assert_eq!(off.abs() < 1e-11, weights == "isotropic", "{case}: {off:e}");
                    let said = choices.iter().any(|c| c.contains("partial volumes"));
                    assert_eq!(said, volumes != "full", "{choices:?}");
                    if (coupling, weights) == ("splice", "plain") {
                        bonds.push((count, off.abs()));
                    }
                }
            }
        }
        // the ramp of PDLAMMPS is zero for no point of the family, HHB and exact areas count cells beyond it
        assert_eq!(bonds[0].0, bonds[1].0);
        assert!(
            bonds[2].0 > bonds[0].0 && bonds[3].0 > bonds[0].0,
            "{bonds:?}"
        );
    }

    /// Largest difference between the force of a model that moves and its assembled rows, over the largest force; the stretch of bonds is small enough for both kinematics.
    fn moving_off(text: &str, overrides: &[&str], kinematics: BondKinematics) -> f64 {
        let mut found = f64::NAN;
        solve_with(
            plate_of(text, overrides).unwrap(),
            &Silent,
            |_, solved: &Solved<'_, 2>| {
                let model = solved.model;
                let behaviour = BondBehaviour {
                    kinematics,
                    failure: Some(BondThreshold::Uniform(1.0)),
                    softening: None,
                    no_fail: &|_| false,
                    contact: None,
                    storage: crate::peridynamics::bond_force::Storage::Double,
                    broken: None,
                    heat: None,
                };
                let operator = solved.operator;
                let mut motion =
                    CoupledSystem::new(model, operator, Symmetry::Unsymmetric, |_| 1.0, &behaviour)
                        .unwrap();
                let wave = |s: &crate::model::Site<2>| {
                    let x = s.position;
                    [1e-9 * (7.0 * x[0] + x[1]).sin(), 1e-9 * (9.0 * x[1]).cos()]
                };
                let u: Vec<f64> = model.sites.iter().flat_map(wave).collect();
                let mut force = vec![0.0; u.len()];
                motion.internal_force_into(
                    &u,
                    &mut force,
                    Interval::AT_ONCE,
                    FailureUpdate::Update,
                );
                let wanted = model.assemble(operator, &Silent).multiply(&u);
                let largest =
                    |v: &mut dyn Iterator<Item = f64>| v.fold(0.0, |m: f64, v| m.max(v.abs()));
                found = largest(&mut force.iter().zip(&wanted).map(|(a, b)| a - b))
                    / largest(&mut wanted.iter().copied());
                Ok(Vec::new())
            },
        )
        .unwrap();
        found
    }

    #[test]
    fn partial_volumes_move_as_they_rest() {
        let bond_based = PLATE
            .replace("plate.lps", "plate.bond-based")
            .replace("poisson-ratio = 0.25\n", "");
        for volumes in ["full", "pdlammps", "hhb", "exact"] {
            for text in [PLATE, &bond_based] {
                for weights in ["isotropic", "plain"] {
                    let set = [
                        format!("peridynamics.volumes={volumes}"),
                        format!("peridynamics.weights={weights}"),
                    ];
                    let set: Vec<&str> = set.iter().map(String::as_str).collect();
                    let linear = moving_off(text, &set, BondKinematics::Linear);
                    assert!(linear < 1e-12, "{set:?}: {linear:e}");
                    let exact = moving_off(text, &set, BondKinematics::Exact);
                    assert!(exact < 1e-5, "{set:?}: {exact:e}");
                }
            }
        }
    }

    #[test]
    fn partial_volumes_without_their_lattice_are_refused() {
        let oblong = "mesh.rectangle.max=[1, 0.9]";
        for (sets, word) in [
            (["peridynamics.points=cells", oblong], "lattice"),
            (["peridynamics.weights=fitted", oblong], "fitted"),
        ] {
            let all = [&["peridynamics.volumes=hhb"], &sets[..]].concat();
            let error = plate(&all).err().unwrap();
            assert!(error.to_string().contains(word), "{sets:?}: {error}");
        }
    }
}
