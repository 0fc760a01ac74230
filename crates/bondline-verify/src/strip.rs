//! A strip of finite elements, transition, peridynamics, transition and finite elements that moves, as a scene: that of the suites `spectrum`, `wave` and `reflection`.
//!
//! Units are those of the lattice: spacing h = 1, modulus `C_1111` = 1 and density 1, so that long waves run one spacing in a unit of time.

use std::fmt::Write as _;

use crate::enclosed::{Law, Method};
use crate::meshes::scene;
use crate::typed;
use bondline::system::LinearMotion;
use bondline::tensor::padded;

/// Model along the strip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Finite elements everywhere.
    Local,
    /// Peridynamics everywhere.
    Nonlocal,
    /// Both, by a method.
    Coupled(Method),
}

impl Kind {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Local => "finite elements",
            Self::Nonlocal => "peridynamics",
            Self::Coupled(method) => method.name(),
        }
    }

    /// The coupling as a scene has it.
    fn text(self) -> String {
        match self {
            Self::Local => "\"local\"".to_owned(),
            Self::Nonlocal => "\"nonlocal\"".to_owned(),
            Self::Coupled(method) => typed::coupling(method),
        }
    }
}

/// A strip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StripCase {
    /// Model along it.
    pub kind: Kind,
    /// The law of the points; λ = μ.
    pub law: Law,
    /// m = δ/h in the peridynamic zone.
    pub ratio: f64,
    /// δ/h where the transition meets the finite elements; the horizon runs straight between. Equal to `ratio` for a constant horizon.
    pub edge_ratio: f64,
    /// Lengths of local, transition, nonlocal, transition and local zones, in spacings.
    pub lengths: [u32; 5],
    /// Size of the finite elements in spacings; it divides the lengths.
    pub cell: u32,
    /// Cells across the strip, of which in 2D the sides are free.
    pub across: u32,
}

/// A strip that can move.
pub struct Strip {
    /// Stiffness and masses.
    pub motion: LinearMotion,
    /// Position of each site along the strip, in spacings.
    pub x: Vec<f64>,
    /// Position of each site across it; 0 in 1D.
    pub y: Vec<f64>,
    /// Blending function of each site: 1 where it is peridynamic, 0 where it is local.
    pub beta: Vec<f64>,
    /// Borders of the zones: local to transition, transition to nonlocal, and so on.
    pub borders: [f64; 4],
}

impl Strip {
    /// Builds and assembles a strip.
    ///
    /// # Errors
    /// The message of the refusal of its scene.
    pub fn new<const D: usize>(case: &StripCase) -> Result<Strip, String> {
        let borders = case.borders();
        let laid = scene::model::<D>(&case.text::<D>(), &[]).map_err(|e| e.to_string())?;
        let operator = laid.coupling.operator(&laid.model);
        let operator = operator.map_err(|e| e.to_string())?;
        let sites = &laid.model.sites;
        let along = |axis: usize| {
            let at = sites.iter().map(|s| padded(&s.position)[axis]);
            at.collect()
        };
        Ok(Strip {
            beta: (0..sites.len()).map(|s| (operator.beta)(s)).collect(),
            x: along(0),
            y: along(1),
            motion: laid.motion().map_err(|e| e.to_string())?,
            borders: [borders[1], borders[2], borders[3], borders[4]],
        })
    }
}

impl StripCase {
    /// Both ends, and where zones meet.
    fn borders(&self) -> [f64; 6] {
        let mut borders = [0.0; 6];
        for (k, length) in self.lengths.iter().enumerate() {
            borders[k + 1] = borders[k] + f64::from(*length);
        }
        borders
    }

    /// The strip as a scene.
    fn text<const D: usize>(&self) -> String {
        let borders = self.borders();
        let cell = self.cell.max(1);
        let width = self.across * cell;
        // λ = μ and C_1111 = 1: ν = 1/4 in the plane; in a bar 1/2, which no solid quite has
        let material = match D {
            1 => typed::material(self.law, 1.0, 0.4999999),
            _ => typed::material(self.law, 5.0 / 6.0, 0.25),
        };
        let influence = typed::law_line(self.law);
        let along = self.lengths.iter().sum::<u32>() / cell;
        let (length, width) = (borders[5], f64::from(width));
        let cells = [along as usize, self.across as usize];
        let mesh = typed::grid::<D>(
            [0.0; D],
            std::array::from_fn(|k| [length, width][k]),
            std::array::from_fn(|k| cells[k]),
        );
        let mut text = format!(
            "kinematics = \"{}\"\ncoupling = {}\n{mesh}{material}{}[output]\nvtu = false\n",
            typed::kinematics::<D>(),
            self.kind.text(),
            typed::FREE
        );
        if self.kind != Kind::Local {
            let horizon = match self.ratio == self.edge_ratio {
                true => self.ratio.to_string(),
                // straight from the edge ratio at the finite elements to the ratio of the points
                false => format!(
                    "\"{} + {} * max(0, min(1, min((x - {}) / {}, ({} - x) / {})))\"",
                    self.edge_ratio,
                    self.ratio - self.edge_ratio,
                    borders[1],
                    (borders[2] - borders[1]).max(1.0),
                    borders[4],
                    (borders[4] - borders[3]).max(1.0)
                ),
            };
            let origin = typed::place([0.0; D]);
            let _ = write!(
                text,
                "[peridynamics]\nhorizon = {horizon}\npoints.lattice = {{ spacing = 1, origin = {origin} }}\n{influence}"
            );
        }
        if let Kind::Coupled(method) = self.kind {
            let part = |from: f64, to: f64| {
                typed::cuboid::<D>(
                    std::array::from_fn(|k| [from, -1.0][k]),
                    std::array::from_fn(|k| [to, width + 1.0][k]),
                )
            };
            let _ = writeln!(text, "[zones]\nnonlocal = {}", part(borders[2], borders[3]));
            if method.has_transition() {
                let _ = writeln!(text, "transition = {}", part(borders[1], borders[4]));
            }
        }
        text
    }
}
