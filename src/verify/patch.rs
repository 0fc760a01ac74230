//! Patch test.
use crate::{
    coupling::*,
    mesh::{CellShape, Mesh},
    peridynamics::*,
    progress::Silent,
    tensor::*,
};
use std::sync::Arc;

fn block<const D: usize>(n: usize, h: f64) -> Mesh<D> {
    let mut mesh = Mesh::default();
    let m = n + 1;
    for i in 0..m.pow(D as u32) {
        let mut r = i;
        mesh.nodes.push(Vector::from_fn(|_, _| {
            let k = r % m;
            r /= m;
            k as f64 * h
        }));
    }
    for i in 0..n.pow(D as u32) {
        let mut r = i;
        let mut base = 0;
        let mut stride = [0usize; 3];
        let mut s = 1;
        for a in 0..D {
            base += (r % n) * s;
            r /= n;
            stride[a] = s;
            s *= m;
        }
        let b = base as u32;
        let (x, y, z) = (stride[0] as u32, stride[1] as u32, stride[2] as u32);
        match D {
            1 => mesh.push_cell(CellShape::Line2, &[b, b + x]),
            2 => mesh.push_cell(CellShape::Quad4, &[b, b + x, b + x + y, b + y]),
            _ => mesh.push_cell(
                CellShape::Hex8,
                &[
                    b,
                    b + x,
                    b + x + y,
                    b + y,
                    b + z,
                    b + x + z,
                    b + x + y + z,
                    b + y + z,
                ],
            ),
        }
    }
    mesh
}

pub fn trial<const D: usize>(name: &str, ratio: usize, law: &str, jitter: f64) {
    let m = if D == 3 { 2.0 } else { 3.0 };
    let cell = ratio as f64;
    let (pd, ts, fe) = match (D, ratio) {
        (3, 1) => (2.0, 2.0, 4.0),
        (3, _) => (3.0, 3.0, 6.0),
        _ => (6.0, 6.0, 12.0),
    };
    let half = pd + ts + fe;
    let n = (2.0 * half / cell).round() as usize;
    let mut mesh = block::<D>(n, cell);
    for x in &mut mesh.nodes {
        for a in 0..D {
            x[a] -= half;
        }
    }
    let zones: Vec<Zone> = (0..mesh.cell_count())
        .map(|c| {
            let r = mesh.centroid(c).amax();
            if r < pd {
                Zone::Nonlocal
            } else if r < pd + ts {
                Zone::Transition
            } else {
                Zone::Local
            }
        })
        .collect();
    let mut seed = 1u64;
    for x in &mut mesh.nodes {
        if x.amax() < half - 0.5 {
            for a in 0..D {
                seed = seed
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                x[a] += jitter * cell * ((seed >> 33) as f64 / 2f64.powi(31) * 2.0 - 1.0) * 0.5;
            }
        }
    }
    let e = 1.0;
    let (lam, mu) = match D {
        1 => (1.0 / 3.0, 1.0 / 3.0),
        2 => (0.375, 0.375),
        _ => (0.4, 0.4),
    };
    let (lam, mu) = if law == "lps" {
        (0.5 * lam, mu)
    } else {
        (lam, mu)
    };
    let inf = Influence::polynomial(1, 1).unwrap();
    let law: Box<dyn BondLaw<D>> = match law {
        "bond" => Box::new(BondBased::<D>::new(Micromodulus::InverseDistance, mu)),
        "lps" => Box::new(LinearPeridynamicSolid::<D>::new(inf, lam, mu)),
        _ => Box::new(Correspondence::<D>::new(inf, lam, mu, 1.0)),
    };
    let coupling: Box<dyn Coupling<D>> = match name {
        "splice" => Box::new(Splice),
        "blend-constant" => Box::new(Blending {
            function: BlendingFunction::Constant,
        }),
        "blend-smooth" => Box::new(Blending {
            function: BlendingFunction::Smooth,
        }),
        "ps-meshfree" => Box::new(PartialStressMeshfree { influence: inf }),
        "ps-elements" => Box::new(PartialStressElements {
            fit: FitDegree::Quadratic,
        }),
        "local" => Box::new(Local),
        _ => Box::new(Nonlocal),
    };
    let tensor = Tensor4::isotropic(lam, mu);
    let cells = mesh.cell_count();
    let problem = Problem {
        mesh,
        zones,
        tensors: vec![tensor],
        cell_material: vec![0; cells],
        peridynamic_material: 0,
        peridynamics: Some(Peridynamics {
            law,
            horizon: Arc::new(move |_| m),
            points: PointSource::Lattice {
                spacing: 1.0,
                origin: Vector::zeros(),
            },
            weights: BondWeights::Isotropic,
            barriers: vec![],
            voids: vec![],
            surfaces: Surfaces::Uncut,
        }),
        coupling,
    };
    let (model, coupling) = match Model::new(problem, &Silent) {
        Ok(m) => m,
        Err(e) => {
            println!("{D}D {name} x{ratio}: ERROR {e}");
            return;
        }
    };
    let operator = match coupling.operator(&model) {
        Ok(m) => m,
        Err(e) => {
            println!("{D}D {name} x{ratio}: ERROR {e}");
            return;
        }
    };
    let k = model.assemble(operator.as_ref(), &Silent);
    let inner: Vec<usize> = (0..model.sites.len())
        .filter(|&s| model.sites[s].position.amax() < half - 1e-9)
        .collect();
    let mut worst: f64 = 0.0;
    let mut at = 0;
    for a in 0..D {
        for b in 0..D {
            let u: Vec<f64> = model
                .sites
                .iter()
                .flat_map(|s| (0..D).map(move |c| if c == a { s.position[b] } else { 0.0 }))
                .collect();
            let r = k.multiply(&u);
            for &s in &inner {
                for c in 0..D {
                    let v = r[s * D + c].abs() / model.sites[s].volume / e;
                    if !(v <= worst) {
                        worst = v;
                        at = s;
                    }
                }
            }
        }
    }
    let mut err: f64 = f64::NAN;
    let nf = inner.len() * D;
    if nf < 1500 && std::env::var("SOLVE").is_ok() {
        let mut index = vec![usize::MAX; model.sites.len()];
        for (q, &s) in inner.iter().enumerate() {
            index[s] = q;
        }
        let mut mat = nalgebra::DMatrix::<f64>::zeros(nf, nf);
        let u: Vec<f64> = model
            .sites
            .iter()
            .flat_map(|s| (0..D).map(move |c| s.position[(c + 1) % D] + 0.3 * s.position[c]))
            .collect();
        let mut rhs = nalgebra::DVector::<f64>::zeros(nf);
        for (q, &s) in inner.iter().enumerate() {
            let (cols, bl) = k.row(s);
            for (x, &c) in cols.iter().enumerate() {
                for i in 0..D {
                    for j in 0..D {
                        let v = bl[x * D * D + i * D + j];
                        if index[c as usize] != usize::MAX {
                            mat[(q * D + i, index[c as usize] * D + j)] += v;
                        } else {
                            rhs[q * D + i] -= v * u[c as usize * D + j];
                        }
                    }
                }
            }
        }
        if let Some(x) = mat.clone().lu().solve(&rhs) {
            let umax = u.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            err = inner
                .iter()
                .enumerate()
                .flat_map(|(q, &s)| (0..D).map(move |c| (q * D + c, s * D + c)))
                .map(|(q, s)| (x[q] - u[s]).abs())
                .fold(0.0, f64::max)
                / umax;
        }
        if nf < 2000 {
            let sv = mat.complex_eigenvalues();
            let lo = sv.iter().map(|z| z.re).fold(f64::INFINITY, f64::min);
            let im = sv.iter().map(|z| z.im.abs()).fold(0.0, f64::max);
            let hi = sv.iter().map(|z| z.re).fold(0.0, f64::max);
            print!("[eig re {lo:.2e}..{hi:.2e} im {im:.1e}] ");
        }
    }
    let vol = model.volumes();
    println!(
        "{D}D {name:15} x{ratio} jit {jitter} {:28} sites {} bonds {} nnz {} patch {worst:.2e} at {:?} err {err:.2e} asym {:.1e} vol {:.2e}",
        model.peridynamics.as_ref().unwrap().law.name(),
        model.sites.len(),
        model.body().map_or(0, |b| b.bond_count()),
        k.nonzeros(),
        model.sites[at].position.as_slice(),
        k.asymmetry(),
        vol.points / vol.region - 1.0
    );
}

#[cfg(test)]
mod tests {
    #[test]
    fn go() {
        for ratio in [1, 3] {
            for jitter in [0.0, 0.2] {
                for law in ["bond", "lps", "corr"] {
                    for name in [
                        "local",
                        "nonlocal",
                        "splice",
                        "blend-constant",
                        "blend-smooth",
                        "ps-meshfree",
                        "ps-elements",
                    ] {
                        super::trial::<1>(name, ratio, law, jitter);
                        super::trial::<2>(name, ratio, law, jitter);
                    }
                }
            }
        }
    }
    #[test]
    fn go3() {
        for ratio in [1, 3] {
            for law in ["bond", "lps", "corr"] {
                for name in [
                    "local",
                    "splice",
                    "blend-constant",
                    "ps-meshfree",
                    "ps-elements",
                ] {
                    super::trial::<3>(name, ratio, law, 0.0);
                }
            }
        }
    }
}
