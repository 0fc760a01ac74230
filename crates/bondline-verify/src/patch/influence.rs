//! Influence functions that leave a coupled bar well posed: the spectrum of its stiffness per volume, and its solution.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::{
    enclosed::{Case, Cells, Enclosed, Law, Method, SPACING, YOUNGS_MODULUS},
    patch::{solution_error, widths},
};
use bondline::{
    model::FitDegree,
    observe::report::{Columns, Table, TableRow},
    peridynamics::{
        Influence, Micromodulus,
        influence::{Alpha, Degree},
    },
    progress::Progress,
};

/// Extremes of the eigenvalues of `K_ij / V_i` on the dofs that are not on the outer boundary, times `h²/E`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrum {
    /// Smallest real part; negative where a wave would grow.
    pub smallest: f64,
    /// Largest real part.
    pub largest: f64,
    /// Largest imaginary part.
    pub imaginary: f64,
}

/// The spectrum of a bar; dense, so for small bars only.
pub fn spectrum(bar: &Enclosed<1>) -> Spectrum {
    let free: Vec<usize> = (0..bar.model.sites.len())
        .filter(|&s| !bar.is_outer(s))
        .collect();
    let mut number = vec![usize::MAX; bar.model.sites.len()];
    for (n, &s) in free.iter().enumerate() {
        number[s] = n;
    }
    let mut dense = DMatrix::zeros(free.len(), free.len());
    for (n, &s) in free.iter().enumerate() {
        let (columns, blocks) = bar.stiffness.row(s);
        let scale = SPACING * SPACING / YOUNGS_MODULUS * bar.per_volume(s);
        for (&c, k) in columns.iter().zip(blocks) {
            if number[c as usize] != usize::MAX {
                dense[(n, number[c as usize])] = k * scale;
            }
        }
    }
    let values = dense.complex_eigenvalues();
    Spectrum {
        smallest: values.iter().map(|z| z.re).fold(f64::INFINITY, f64::min),
        largest: values.iter().map(|z| z.re).fold(0.0, f64::max),
        imaginary: values.iter().map(|z| z.im.abs()).fold(0.0, f64::max),
    }
}

/// Every influence function of [SAND2015-7998] eq. (5.8), with its name.
pub fn influences() -> impl Iterator<Item = (String, Influence)> {
    Alpha::ALL.into_iter().flat_map(|alpha| {
        Degree::ALL.into_iter().map(move |degree| {
            (
                format!("n={} alpha={}", degree.order(), alpha.exponent()),
                Influence::Polynomial { degree, alpha },
            )
        })
    })
}

/// Bars with every influence function in the law, and with partial stress in the divergence.
pub fn table(progress: &dyn Progress) -> Table {
    let mut cases = Vec::new();
    for (name, influence) in influences() {
        for law in [Law::StateBased(influence), Law::Correspondence(influence)] {
            for method in [
                Method::Splice,
                Method::ALL[3],
                Method::Meshfree,
                Method::Elements(FitDegree::Quadratic),
            ] {
                cases.push((name.clone(), law, method));
            }
        }
    }
    progress.stage("influence functions", Some(cases.len() as u64));
    let rows: Vec<Vec<TableRow>> = cases
        .into_par_iter()
        .map(|(name, law, method)| {
            let case = Case {
                method,
                law,
                cells: Cells::Matching,
                widths: widths::<1>(method, Cells::Matching),
                ratio: 3,
            };
            let name = format!("1D {}, {}, {name}", method.name(), law.name());
            progress.advance(1);
            let bar = match Enclosed::<1>::new(&case) {
                Ok(bar) => bar,
                Err(e) => return vec![TableRow::refused(name, "solution error", e.to_string())],
            };
            let s = spectrum(&bar);
            let mut rows = vec![
                TableRow::info(&name, "smallest real", s.smallest),
                TableRow::info(&name, "largest imaginary", s.imaginary),
                TableRow::info(&name, "largest real", s.largest),
            ];
            rows.push(match solution_error(&bar) {
                Ok(error) => TableRow::info(&name, "solution error", error),
                Err(why) => TableRow::refused(&name, "solution error", why),
            });
            rows
        })
        .collect();
    let mut table = Table::new(
        "Influence functions (m = 3, matching): eigenvalues of a bar's stiffness per volume times h^2/E, error of the solved affine field",
        Columns::ByQuantity,
    );
    rows.into_iter().flatten().for_each(|row| table.push(row));
    meshfree(progress)
        .into_iter()
        .for_each(|row| table.push(row));
    table
}

/// Meshfree partial stress in 2D, where the solution loses digits: which ω of the law, and with it of the divergence, loses how many.
///
/// A scene has no key for an ω of the divergence alone; a bond-based law has its own for each kind of micromodulus.
fn meshfree(progress: &dyn Progress) -> Vec<TableRow> {
    let kernels = [
        ("inverse distance", Micromodulus::InverseDistance),
        ("triangular", Micromodulus::Triangular),
    ];
    let cases: Vec<(String, Law)> = influences()
        .map(|(name, w)| (name, Law::StateBased(w)))
        .chain(kernels.map(|(name, k)| (name.to_owned(), Law::BondBased(k))))
        .collect();
    progress.stage("influence functions, 2D", Some(cases.len() as u64));
    cases
        .into_par_iter()
        .map(|(name, law)| {
            let method = Method::Meshfree;
            let case = Case {
                method,
                law,
                cells: Cells::Matching,
                widths: widths::<2>(method, Cells::Matching),
                ratio: 3,
            };
            let name = format!("2D {}, {}, {name}", method.name(), law.name());
            progress.advance(1);
            let solved = Enclosed::<2>::new(&case)
                .map_err(|e| e.to_string())
                .and_then(|block| solution_error(&block));
            match solved {
                Ok(error) => TableRow::info(name, "solution error", error),
                Err(why) => TableRow::refused(name, "solution error", why),
            }
        })
        .collect()
}
