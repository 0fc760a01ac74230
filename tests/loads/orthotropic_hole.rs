//! Rings of orthotropic elements on meshes in memory: a hole in an endless plate, and a ring whose axes follow it.

use nalgebra::Complex;

use bondline::mesh::MeshParts;
use bondline::progress::Silent;
use bondline::{CellShape, Condition, Function, Material, SceneBuilder, Solution};

/// A ring of quadrilaterals of second order between two radii, each layer `growth` times as thick as the one within, and its sets `bore` and `outer`; a quarter of one has the sets `along x` and `along y`.
fn ring(
    [inner, outer]: [f64; 2],
    [layers, around]: [u64; 2],
    growth: f64,
    is_quarter: bool,
) -> MeshParts {
    let mut mesh = MeshParts::default();
    let turn = std::f64::consts::TAU / if is_quarter { 4.0 } else { 1.0 };
    // half cells in both directions; of a whole ring the last ray is the first
    let rays = 2 * around + u64::from(is_quarter);
    let depth = |i: u64| (0..i / 2).map(|k| growth.powi(k as i32)).sum::<f64>();
    let radius = |i: u64| inner + (outer - inner) * depth(i) / depth(2 * layers);
    let mut number = std::collections::HashMap::new();
    for j in 0..rays {
        for i in 0..=2 * layers {
            if i % 2 == 1 && j % 2 == 1 {
                continue;
            }
            let angle = turn * j as f64 / (2 * around) as f64;
            // mid-side nodes along a ray lie halfway
            let r = match i % 2 {
                1 => 0.5 * (radius(i - 1) + radius(i + 1)),
                _ => radius(i),
            };
            number.insert((i, j), mesh.points.len() as u64);
            mesh.points.push([r * angle.cos(), r * angle.sin(), 0.0]);
        }
    }
    let at = |i: u64, j: u64| number[&(i, j % rays)];
    let (mut cells, mut bore, mut edge) = (Vec::new(), Vec::new(), Vec::new());
    for j in (0..2 * around).step_by(2) {
        for i in (0..2 * layers).step_by(2) {
            let corners = [at(i, j), at(i + 2, j), at(i + 2, j + 2), at(i, j + 2)];
            let middles = [
                at(i + 1, j),
                at(i + 2, j + 1),
                at(i + 1, j + 2),
                at(i, j + 1),
            ];
            cells.extend(corners.into_iter().chain(middles));
        }
        bore.extend([at(0, j), at(0, j + 2), at(0, j + 1)]);
        edge.extend([
            at(2 * layers, j),
            at(2 * layers, j + 2),
            at(2 * layers, j + 1),
        ]);
    }
    let count = layers * around;
    mesh.blocks = vec![
        (CellShape::Quad8, cells),
        (CellShape::Line3, bore),
        (CellShape::Line3, edge),
    ];
    mesh.element_sets = vec![
        ("bore".into(), (count..count + around).collect()),
        (
            "outer".into(),
            (count + around..count + 2 * around).collect(),
        ),
    ];
    let ray = |j: u64| (0..=2 * layers).map(|i| at(i, j)).collect();
    if is_quarter {
        mesh.point_sets = vec![
            ("along x".into(), ray(0)),
            ("along y".into(), ray(2 * around)),
        ];
    }
    mesh
}

/// An endless plate with a circular hole of radius 1 under the uniform stress 1 along the direction `load` from axis 1, in the axes of the material [Lekhnitskii1963]: functions `φ_k = C_k/ζ_k` of `z_k = x + μ_k y` beside the uniform field.
struct Hole {
    constants: [f64; 4],
    load: f64,
}

impl Hole {
    fn compliance(&self) -> [f64; 4] {
        let [e1, e2, nu, g] = self.constants;
        [1.0 / e1, -nu / e1, 1.0 / e2, 1.0 / g]
    }

    fn stress(&self) -> [f64; 3] {
        let (s, c) = self.load.sin_cos();
        [c * c, s * s, s * c]
    }

    /// The roots of `a₁₁ μ⁴ + (2 a₁₂ + a₆₆) μ² + a₂₂ = 0` above the real axis, which are imaginary here.
    fn roots(&self) -> [Complex<f64>; 2] {
        let [a11, a12, a22, a66] = self.compliance();
        let half = (2.0 * a12 + a66) / (2.0 * a11);
        let root = (half * half - a22 / a11).sqrt();
        assert!(root > 0.0);
        [half + root, half - root].map(|square| Complex::new(0.0, square.sqrt()))
    }

    fn displacement(&self, x: f64, y: f64) -> [f64; 2] {
        let [a11, a12, a22, a66] = self.compliance();
        let [xx, yy, xy] = self.stress();
        let i = Complex::new(0.0, 1.0);
        let [m1, m2] = self.roots();
        // free of traction on the circle: C_1 + C_2 and μ_1 C_1 + μ_2 C_2
        let (sum, turned) = ((i * xy - yy) * 0.5, (-i * xx + xy) * 0.5);
        let c = [
            (turned - m2 * sum) / (m1 - m2),
            (turned - m1 * sum) / (m2 - m1),
        ];
        let mut u = [
            (a11 * xx + a12 * yy) * x + 0.5 * a66 * xy * y,
            (a12 * xx + a22 * yy) * y + 0.5 * a66 * xy * x,
        ];
        for (m, c) in [m1, m2].into_iter().zip(c) {
            let z = m * y + x;
            let root = (z * z - (m * m + 1.0)).sqrt();
            let zeta = [z + root, z - root].map(|top| top / (Complex::new(1.0, 0.0) - i * m));
            let zeta = zeta
                .into_iter()
                .max_by(|a, b| a.norm().total_cmp(&b.norm()))
                .unwrap();
            let phi = c / zeta;
            u[0] += 2.0 * ((m * m * a11 + a12) * phi).re;
            u[1] += 2.0 * ((m * a12 + Complex::new(a22, 0.0) / m) * phi).re;
        }
        u
    }

    /// The stress along the edge of the hole at the angle θ from axis 1, in closed form.
    fn hoop(&self, theta: f64) -> f64 {
        let [e1, e2, nu, g] = self.constants;
        let k = (e1 / e2).sqrt();
        let n = (2.0 * (k - nu) + e1 / g).sqrt();
        let ((s, c), (sp, cp)) = (theta.sin_cos(), self.load.sin_cos());
        let along = s.powi(4) / e1 + (1.0 / g - 2.0 * nu / e1) * s * s * c * c + c.powi(4) / e2;
        let parts = (-cp * cp + (k + n) * sp * sp) * k * c * c
            + ((1.0 + n) * cp * cp - k * sp * sp) * s * s
            - n * (1.0 + k + n) * sp * cp * s * c;
        parts / (e1 * along)
    }
}

/// The stress along a circle about the origin at a row of a table with the columns `sxx`, `sxy`, `syy`, at the angle from x.
fn along_circle(stress: [f64; 3], angle: f64) -> f64 {
    let ([xx, xy, yy], (s, c)) = (stress, angle.sin_cos());
    s * s * xx - 2.0 * s * c * xy + c * c * yy
}

fn stresses(solution: &Solution) -> Vec<[f64; 3]> {
    let table = solution.table("probes").unwrap();
    let columns = ["sxx", "sxy", "syy"].map(|name| table.column(name).unwrap());
    (0..columns[0].len())
        .map(|k| [0, 1, 2].map(|c: usize| columns[c][k]))
        .collect()
}

#[test]
fn the_edge_of_a_hole_is_stressed_as_lekhnitskii_says() {
    const OUTER: f64 = 2.0;
    const PROBES: u32 = 72;
    let constants = [100.0, 10.0, 0.3, 4.0];
    // the angle of axis 1 from x
    let axis = 0.4f64;
    // across the fibres, along them and between
    for load in [90.0, 0.0, 45.0f64].map(f64::to_radians) {
        let displacement = move |x: &[f64; 3]| {
            let (s, c) = axis.sin_cos();
            let [u, v] =
                Hole { constants, load }.displacement(c * x[0] + s * x[1], -s * x[0] + c * x[1]);
            [c * u - s * v, s * u + c * v]
        };
        let material = Material::of("orthotropic")
            .set("e1", constants[0])
            .set("e2", constants[1])
            .set("nu12", constants[2])
            .set("g12", constants[3])
            .set("angle", axis.to_degrees());
        let held = Condition::displacement("outer")
            .x(Function::of_position(move |x| displacement(x)[0]))
            .y(Function::of_position(move |x| displacement(x)[1]));
        let mut scene = SceneBuilder::plane_stress("hole")
            .mesh(ring([1.0, OUTER], [20, 160], 1.2, false))
            .material("ply", material)
            .coupling("local")
            .set("output.stresses", toml::Value::from(vec!["von-mises"]))
            .condition("held", held);
        let angle = |k: u32| std::f64::consts::TAU * f64::from(k) / f64::from(PROBES);
        for k in 0..PROBES {
            // where the load along an axis has its peak there is a probe
            let place = angle(k) + axis;
            scene = scene.probe(&format!("p{k:02}"), [place.cos(), place.sin()]);
        }
        let solution = scene.solve(&Silent).unwrap();
        // the foci of the functions lie 0.02 below the edge at the ends of the fibres: cells there are 0.004 thick
        let hole = Hole { constants, load };
        let exact: Vec<f64> = (0..PROBES).map(|k| hole.hoop(angle(k))).collect();
        let peak = exact.iter().map(|s| s.abs()).fold(0.0, f64::max);
        let found = stresses(&solution);
        let found: Vec<f64> = (0..PROBES)
            .map(|k| along_circle(found[k as usize], angle(k) + axis))
            .collect();
        let off = found
            .iter()
            .zip(&exact)
            .map(|(f, e)| (f - e).abs())
            .fold(0.0, f64::max);
        println!(
            "load at {:.0}: peak {peak:.4}, largest error {off:.4}",
            load.to_degrees()
        );
        assert!(off < 0.01 * peak, "{load}: {off} of {peak}");
        let (points, displaced) = (solution.points(), solution.displacement().unwrap());
        let error = points.iter().zip(displaced).map(|(x, u)| {
            let exact = displacement(x);
            (u[0] - exact[0]).hypot(u[1] - exact[1])
        });
        let most = displaced
            .iter()
            .map(|u| u[0].hypot(u[1]))
            .fold(0.0, f64::max);
        assert!(error.fold(0.0, f64::max) < 1e-3 * most);
    }
}

#[test]
fn a_ring_whose_axes_follow_it_widens_as_lekhnitskii_says() {
    let ([inner, outer], [er, et, nu]) = ([1.0, 2.0], [10.0, 90.0, 0.02]);
    let k = f64::sqrt(et / er);
    let c: f64 = inner / outer;
    let factor = c.powf(k + 1.0) / (1.0 - c.powf(2.0 * k));
    let radial = |r: f64| factor * ((r / outer).powf(k - 1.0) - (outer / r).powf(k + 1.0));
    let hoop = |r: f64| factor * k * ((r / outer).powf(k - 1.0) + (outer / r).powf(k + 1.0));
    let widened = |r: f64| r * (hoop(r) / et - nu * radial(r) / er);
    let error = |cells: u64| {
        let material = Material::of("orthotropic")
            .set("e1", er)
            .set("e2", et)
            .set("nu12", nu)
            .set("g12", 4.0)
            .set("angle", "atan2(y, x) * 180/pi");
        let solution = SceneBuilder::plane_stress("ring")
            .mesh(ring([inner, outer], [cells, cells], 1.0, true))
            .material("hoop", material)
            .coupling("local")
            .set("output.stresses", toml::Value::from(vec!["von-mises"]))
            .condition(
                "pressed",
                Condition::of("pressure")
                    .set("on", "bore")
                    .set("value", 1.0),
            )
            .condition("low", Condition::displacement("along x").y(0))
            .condition("side", Condition::displacement("along y").x(0))
            .probe("middle", [1.5 * 0.5f64.sqrt(), 1.5 * 0.5f64.sqrt()])
            .solve(&Silent)
            .unwrap();
        let (points, displaced) = (solution.points(), solution.displacement().unwrap());
        let at_bore = |x: &[f64; 3]| (x[0] - inner).hypot(x[1]) < 1e-9;
        let node = points.iter().position(at_bore).unwrap();
        let stress = along_circle(stresses(&solution)[0], std::f64::consts::FRAC_PI_4);
        println!("{cells}: {stress} {}", hoop(1.5));
        assert!((stress / hoop(1.5) - 1.0).abs() < 0.04, "{stress}");
        displaced[node][0] / widened(inner) - 1.0
    };
    let (coarse, fine) = (error(16), error(32));
    println!("{coarse:.3e} {fine:.3e}");
    // axes are those of the centroid of each cell: of second order
    assert!(fine.abs() < 2e-3 && coarse / fine > 3.0, "{coarse} {fine}");
}
