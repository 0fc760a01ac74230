//! The elastic tensor of a full lattice family, with isotropic and with plain weights.

use rayon::prelude::*;

use crate::{
    Effort,
    enclosed::{Law, SPACING},
    patch::influence::influences,
};
use bondline::{
    observe::report::{Columns, Table, TableRow},
    peridynamics::{
        Influence, LatticeFamily, Micromodulus, ShellTarget, TIE_TOLERANCE, isotropic_shell_factors,
    },
    progress::Progress,
    tensor::{Tensor, Tensor4, Vector},
};

/// Largest component of the difference from the typed tensor, relative to its largest component.
pub const TENSOR_LIMIT: f64 = 1e-12;

/// The elastic tensor that a family of `(ξ, factor)`, all of volume `V`, gives a bond-based law: `½ Σ λ ξ⊗ξ⊗ξ⊗ξ V`.
///
/// Source: [SAND2015-7998] eq. (3.6).
fn bond_based_tensor<const D: usize>(
    kernel: Micromodulus,
    c1111: f64,
    horizon: f64,
    bonds: &[(Vector<D>, f64)],
    volume: f64,
) -> Tensor4<D> {
    let c = kernel.constant::<D>(horizon, c1111);
    let mut tensor = Tensor4::zeros();
    for (xi, factor) in bonds {
        tensor.add_fourth_power(
            0.5 * c * kernel.shape(xi.norm(), horizon) * factor * volume,
            xi,
        );
    }
    tensor
}

/// The same for an LPS: `ν⁰ = Σ T⟨ξ⟩ ⊗ ξ V` under each displacement gradient, written out from eq. (5.16)–(5.18).
fn state_based_tensor<const D: usize>(
    influence: Influence,
    lambda: f64,
    mu: f64,
    horizon: f64,
    bonds: &[(Vector<D>, f64)],
    volume: f64,
) -> Tensor4<D> {
    let d = D as f64;
    let bulk = lambda + 2.0 * mu / d;
    let omega = |xi: &Vector<D>, factor: f64| factor * influence.value(xi.norm(), horizon) * volume;
    let m: f64 = bonds
        .iter()
        .map(|(xi, f)| omega(xi, *f) * xi.norm_squared())
        .sum();
    let mut tensor = Tensor4::zeros();
    for k in 0..D {
        for l in 0..D {
            let mut g = Tensor::<D>::zeros();
            g[(k, l)] = 1.0;
            let theta: f64 = d / m
                * bonds
                    .iter()
                    .map(|(xi, f)| omega(xi, *f) * xi.dot(&(g * xi)))
                    .sum::<f64>();
            let mut stress = Tensor::<D>::zeros();
            for (xi, f) in bonds {
                // t along the bond, times |ξ|: bulk part and extension part
                let t = (d * bulk - (d + 2.0) * mu) / m * theta
                    + d * (d + 2.0) * mu / m * xi.dot(&(g * xi)) / xi.norm_squared();
                stress += xi * xi.transpose() * (t * omega(xi, *f));
            }
            for i in 0..D {
                for j in 0..D {
                    tensor.0[i][j][(k, l)] = stress[(i, j)];
                }
            }
        }
    }
    tensor
}

/// Relative difference of the lattice's tensor from the typed one; `Err` is the refusal of the weights.
fn deviation<const D: usize>(law: Law, ratio: u32, plain: Plain) -> Result<f64, String> {
    let horizon = f64::from(ratio) * SPACING;
    let lattice =
        LatticeFamily::<D>::new(f64::from(ratio), TIE_TOLERANCE).map_err(|e| e.to_string())?;
    let (lambda, mu) = law.lame::<D>();
    let typed = Tensor4::<D>::isotropic(lambda, mu);
    let (base, target): (Vec<f64>, ShellTarget) = match law {
        Law::BondBased(kernel) => (
            lattice
                .shells
                .iter()
                .map(|s| {
                    kernel.constant::<D>(horizon, 3.0 * mu)
                        * kernel.shape(s.length(SPACING), horizon)
                })
                .collect(),
            ShellTarget::Strength(6.0 * mu),
        ),
        Law::StateBased(w) | Law::Correspondence(w) | Law::PositionAware(w) => (
            lattice
                .shells
                .iter()
                .map(|s| w.value(s.length(SPACING), horizon) / s.length(SPACING).powi(2))
                .collect(),
            ShellTarget::Isotropy,
        ),
    };
    let factors = match plain {
        Plain::Yes => vec![1.0; base.len()],
        Plain::No => {
            isotropic_shell_factors(&lattice, SPACING, &base, target).map_err(|e| e.to_string())?
        }
    };
    let bonds: Vec<(Vector<D>, f64)> = lattice
        .shells
        .iter()
        .zip(&factors)
        .flat_map(|(shell, &factor)| {
            shell
                .offsets
                .iter()
                .map(move |k| (Vector::from_fn(|i, _| f64::from(k[i]) * SPACING), factor))
        })
        .collect();
    let volume = SPACING.powi(D as i32);
    let mut difference = match law {
        Law::BondBased(kernel) => bond_based_tensor(kernel, 3.0 * mu, horizon, &bonds, volume),
        Law::StateBased(w) | Law::Correspondence(w) | Law::PositionAware(w) => {
            state_based_tensor(w, lambda, mu, horizon, &bonds, volume)
        }
    };
    difference.add_scaled(-1.0, &typed);
    Ok(difference.amax() / typed.amax())
}

#[derive(Clone, Copy, PartialEq)]
enum Plain {
    Yes,
    No,
}

fn kernels() -> Vec<(String, Law)> {
    let mut kernels: Vec<(String, Law)> = influences()
        .map(|(name, w)| (format!("LPS {name}"), Law::StateBased(w)))
        .collect();
    kernels.push(("LPS Gaussian".into(), Law::StateBased(Influence::Gaussian)));
    for (name, kernel) in [
        ("c", Micromodulus::Uniform),
        ("c/|xi|^2", Micromodulus::Constant),
        ("c/|xi|^3", Micromodulus::InverseDistance),
        ("triangular", Micromodulus::Triangular),
    ] {
        kernels.push((format!("bond-based {name}"), Law::BondBased(kernel)));
    }
    kernels.extend(influences().map(|(name, w)| {
        (
            format!("bond-based {name}"),
            Law::BondBased(Micromodulus::Influence(w)),
        )
    }));
    kernels
}

/// The table of a dimension.
pub fn table<const D: usize>(effort: Effort, progress: &dyn Progress) -> Table {
    let ratios = if effort == Effort::Full { 2..=6 } else { 2..=3 };
    let cases: Vec<(String, Law, u32)> = kernels()
        .into_iter()
        .flat_map(|(name, law)| ratios.clone().map(move |m| (name.clone(), law, m)))
        .collect();
    let stage = format!("lattice weights, {D}D");
    progress.stage(&stage, Some(cases.len() as u64));
    let rows: Vec<[TableRow; 2]> = cases
        .par_iter()
        .map(|(name, law, m)| {
            progress.advance(1);
            let case = format!("{D}D {name}, m = {m}");
            let isotropic = match deviation::<D>(*law, *m, Plain::No) {
                Ok(value) => TableRow::at_most(&case, "isotropic", value, TENSOR_LIMIT),
                Err(why) => TableRow::refused(&case, "isotropic", why),
            };
            let plain = match deviation::<D>(*law, *m, Plain::Yes) {
                Ok(value) if value.is_finite() => TableRow::info(&case, "plain", value),
                Ok(_) => TableRow::refused(&case, "plain", "no bond of the family has weight"),
                Err(why) => TableRow::refused(&case, "plain", why),
            };
            [isotropic, plain]
        })
        .collect();
    let mut table = Table::new(
        format!(
            "Elastic tensor of the lattice in {D}D: largest difference from the typed tensor over its largest component"
        ),
        Columns::ByQuantity,
    );
    rows.into_iter().flatten().for_each(|row| table.push(row));
    table
}

/// The suite `weights`.
pub fn weights(effort: Effort, progress: &dyn Progress) -> Vec<Table> {
    let tables = vec![table::<2>(effort, progress), table::<3>(effort, progress)];
    progress.finish();
    tables
}
