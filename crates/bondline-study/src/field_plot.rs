//! A plane field as SVG: cells filled by a value, PD points as squares, a colour bar.
//!
//! Written by hand, because a plotting library rounds corners to whole pixels and repeats the style for every cell: here
//! all cells of one colour are one path, which makes the file about five times smaller.

use std::fmt::Write as _;
use std::path::Path;

use crate::line_plot::tick;
use bondline::observe::ObserveError;
use bondline::observe::atomic_file::write_whole;
use bondline::observe::vtu::escape;

/// A coloured plane field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldMap {
    /// Above the picture.
    pub title: String,
    /// Beside the colour bar: the quantity and its unit.
    pub label: String,
    /// Values of the first and the last colour; those of the data if not given. Values outside take the end colours.
    pub range: Option<(f64, f64)>,
    /// Corners of each cell in order, and its value.
    pub cells: Vec<(Vec<[f64; 2]>, f64)>,
    /// Centre of each PD point, the side of its square, and its value.
    pub points: Vec<([f64; 2], f64, f64)>,
    /// Lines drawn on top: zone boundaries, slits, cracks.
    pub lines: Vec<Vec<[f64; 2]>>,
}

/// Size of the picture proper, the longer side, in pixels.
const EXTENT: f64 = 640.0;
/// Space on the left and right, above, and below the picture.
const MARGIN: [f64; 3] = [16.0, 44.0, 16.0];
/// Space for the colour bar and its numbers.
const BAR: f64 = 120.0;
/// Number of colours.
const LEVELS: usize = 64;

/// A sequence of colours of steadily rising lightness, dark blue to yellow, sampled in equal steps.
const RAMP: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 45.0, 123.0],
    [59.0, 82.0, 139.0],
    [44.0, 114.0, 142.0],
    [33.0, 145.0, 140.0],
    [40.0, 174.0, 128.0],
    [94.0, 201.0, 98.0],
    [173.0, 220.0, 48.0],
    [253.0, 231.0, 37.0],
];

fn colour(level: usize) -> String {
    let at = level as f64 / (LEVELS - 1) as f64 * (RAMP.len() - 1) as f64;
    let i = (at as usize).min(RAMP.len() - 2);
    let mix = |k: usize| {
        let (a, b) = (RAMP[i][k], RAMP[i + 1][k]);
        (a + (b - a) * (at - i as f64)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// A coordinate of the picture, to a hundredth of a pixel.
fn pixel(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// The colour of a level; grey beyond the last, of values that are not finite.
fn fill(level: usize) -> String {
    if level < LEVELS {
        colour(level)
    } else {
        "#b0b0b0".to_owned()
    }
}

/// A path along corners, that `place` puts on the page.
fn outline(corners: &[[f64; 2]], place: impl Fn(&[f64; 2]) -> [f64; 2]) -> String {
    // relative moves need fewer digits; they start from the rounded corner, so that errors do not add up
    let mut d = String::new();
    let mut last = [0.0, 0.0];
    for (i, corner) in corners.iter().enumerate() {
        let at = place(corner).map(|v| (v * 100.0).round() / 100.0);
        let command = if i == 0 { "M" } else { "l" };
        let _ = write!(
            d,
            "{command}{} {}",
            pixel(at[0] - last[0]),
            pixel(at[1] - last[1])
        );
        last = at;
    }
    d
}

impl FieldMap {
    /// Writes the picture; makes the folder if it is missing.
    ///
    /// Cells with a corner, and points with a place, that is not finite are an error; a value that is not finite is grey.
    ///
    /// # Errors
    /// [`ObserveError::Empty`] without cells and points, [`ObserveError::NotFinite`] for a place,
    /// [`ObserveError::Folder`], [`ObserveError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), ObserveError> {
        let svg = self.svg(path)?;
        write_whole(path, |out| std::io::Write::write_all(out, svg.as_bytes()))
    }

    /// The corners of all filled shapes with their values.
    fn polygons(&self) -> impl Iterator<Item = (Vec<[f64; 2]>, f64)> + '_ {
        let squares = self.points.iter().map(|&([x, y], side, value)| {
            let r = 0.5 * side;
            let corners = vec![
                [x - r, y - r],
                [x + r, y - r],
                [x + r, y + r],
                [x - r, y + r],
            ];
            (corners, value)
        });
        self.cells.iter().cloned().chain(squares)
    }

    /// First and last value of the colours.
    fn value_range(&self) -> (f64, f64) {
        let (lo, hi) = self.range.unwrap_or_else(|| {
            let values = self.cells.iter().map(|c| c.1);
            values
                .chain(self.points.iter().map(|p| p.2))
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
                    (lo.min(v), hi.max(v))
                })
        });
        if lo < hi && (hi - lo).is_finite() {
            (lo, hi)
        } else if lo == hi {
            let room = if lo == 0.0 { 1.0 } else { 0.5 * lo.abs() };
            (lo - room, hi + room)
        } else {
            (0.0, 1.0)
        }
    }

    fn svg(&self, path: &Path) -> Result<String, ObserveError> {
        let (lo, hi) = self.bounds(path)?;
        let span = (hi[0] - lo[0]).max(hi[1] - lo[1]);
        let scale = EXTENT / span;
        let [side, above, below] = MARGIN;
        let (w, h) = ((hi[0] - lo[0]) * scale, (hi[1] - lo[1]) * scale);
        let bar_height = h.max(200.0);
        let (width, height) = (side + w + BAR + side, above + bar_height + below);
        let place = |p: &[f64; 2]| {
            [
                side + (p[0] - lo[0]) * scale,
                above + (hi[1] - p[1]) * scale,
            ]
        };
        let outline = |corners: &[[f64; 2]]| outline(corners, place);

        let (first, last) = self.value_range();
        let mut paths = vec![String::new(); LEVELS + 1];
        for (corners, value) in self.polygons() {
            let level = if value.is_finite() {
                let share = ((value - first) / (last - first)).clamp(0.0, 1.0);
                (share * LEVELS as f64).min(LEVELS as f64 - 1.0) as usize
            } else {
                LEVELS
            };
            let _ = write!(paths[level], "{}z", outline(&corners));
        }

        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" \
             font-family=\"sans-serif\" font-size=\"14\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
             <text x=\"{2}\" y=\"28\" font-size=\"18\">{3}</text>\n",
            pixel(width),
            pixel(height),
            pixel(side),
            escape(&self.title)
        );
        // a hair of the same colour hides the gaps that a renderer leaves between neighbours
        svg.push_str("<g stroke-width=\"0.8\" stroke-linejoin=\"round\">\n");
        for (level, d) in paths.iter().enumerate().filter(|(_, d)| !d.is_empty()) {
            let fill = fill(level);
            let _ = writeln!(svg, "<path fill=\"{fill}\" stroke=\"{fill}\" d=\"{d}\"/>");
        }
        svg.push_str("</g>\n");
        for line in self
            .lines
            .iter()
            .filter(|l| l.iter().flatten().all(|v| v.is_finite()))
        {
            let d = outline(line);
            let _ = writeln!(
                svg,
                "<path fill=\"none\" stroke=\"#000000\" stroke-width=\"1.5\" d=\"{d}\"/>"
            );
        }

        self.write_bar(&mut svg, [side + w + 24.0, above, bar_height]);
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>\n</svg>",
            pixel(width - side),
            pixel(above - 14.0),
            escape(&self.label)
        );
        Ok(svg)
    }
    /// The bar of colours with values beside it: at `x`, from `above` down.
    fn write_bar(&self, svg: &mut String, [x, above, bar_height]: [f64; 3]) {
        let (first, last) = self.value_range();
        let step = bar_height / LEVELS as f64;
        for level in 0..LEVELS {
            let y = above + bar_height - (level + 1) as f64 * step;
            let _ = writeln!(
                svg,
                "<rect x=\"{}\" y=\"{}\" width=\"16\" height=\"{}\" fill=\"{}\"/>",
                pixel(x),
                pixel(y),
                pixel(step + 0.3),
                colour(level)
            );
        }
        for i in 0..=4 {
            let share = f64::from(i) / 4.0;
            let value = first + share * (last - first);
            // the middle of a symmetric range is zero but for round-off
            let value = if value.abs() < 1e-10 * (last - first).abs() {
                0.0
            } else {
                value
            };
            let digits = format!("{value:.2e}");
            let number = digits.parse().map_or(digits, tick);
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{}\">{number}</text>",
                pixel(x + 22.0),
                pixel(above + bar_height * (1.0 - share) + 5.0)
            );
        }
    }

    /// The corners of the box around all cells.
    ///
    /// # Errors
    /// [`ObserveError`] for a position that is not finite, and where nothing has any size.
    fn bounds(&self, path: &Path) -> Result<([f64; 2], [f64; 2]), ObserveError> {
        let mut lo = [f64::INFINITY; 2];
        let mut hi = [f64::NEG_INFINITY; 2];
        for (entry, (corners, _)) in self.polygons().enumerate() {
            for corner in corners {
                for k in 0..2 {
                    if !corner[k].is_finite() {
                        return Err(ObserveError::NotFinite {
                            path: path.to_path_buf(),
                            field: "position".to_owned(),
                            entry,
                            value: corner[k],
                        });
                    }
                    lo[k] = lo[k].min(corner[k]);
                    hi[k] = hi[k].max(corner[k]);
                }
            }
        }
        let span = (hi[0] - lo[0]).max(hi[1] - lo[1]);
        if span.is_nan() || span <= 0.0 {
            return Err(ObserveError::Empty {
                path: path.to_path_buf(),
                what: "the picture has no cells or points of any size",
            });
        }
        Ok((lo, hi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> FieldMap {
        let unit = |x: f64| vec![[x, 0.0], [x + 1.0, 0.0], [x + 1.0, 1.0], [x, 1.0]];
        FieldMap {
            title: "u & v".into(),
            label: "|u| [m]".into(),
            range: None,
            cells: vec![(unit(0.0), 0.0), (unit(1.0), 4.0)],
            points: vec![([2.5, 0.5], 1.0, 2.0), ([3.5, 0.5], 1.0, f64::NAN)],
            lines: vec![vec![[0.0, 0.0], [4.0, 1.0]]],
        }
    }

    #[test]
    fn cells_and_points_lie_where_they_belong_in_the_colour_of_their_value() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/map.svg");
        sample().write(&path).unwrap();
        let svg = std::fs::read_to_string(&path).unwrap();
        // four units over 640 pixels: 160 pixels each, the upper edge 44 below the top
        for (colour, d) in [
            ("#440154", "M16 204l160 0l0 -160l-160 0z"),
            ("#fde725", "M176 204l160 0l0 -160l-160 0z"),
            ("#b0b0b0", "M496 204l160 0l0 -160l-160 0z"),
        ] {
            let path = format!("<path fill=\"{colour}\" stroke=\"{colour}\" d=\"{d}\"/>");
            assert!(svg.contains(&path), "{path} is missing in\n{svg}");
        }
        assert!(svg.contains("d=\"M336 204l160 0l0 -160l-160 0z\""));
        assert!(svg.contains("d=\"M16 204l640 -160\""));
        assert!(svg.contains("u &amp; v") && svg.contains("|u| [m]"));
        for number in ["0", "1", "2", "3", "4"] {
            assert!(svg.contains(&format!(">{number}</text>")), "{number}");
        }
    }

    #[test]
    fn cells_of_one_colour_share_a_path() {
        let mut map = sample();
        map.lines.clear();
        for (_, value) in &mut map.cells {
            *value = 1.0;
        }
        map.points.clear();
        let svg = map.svg(Path::new("")).unwrap();
        assert_eq!(svg.matches("<path").count(), 1);
        assert!(
            svg.contains(">0.5</text>") && svg.contains(">1.5</text>"),
            "{svg}"
        );
    }

    #[test]
    fn nothing_or_nowhere_is_an_error() {
        let empty = FieldMap::default().svg(Path::new("a.svg"));
        assert!(matches!(empty, Err(ObserveError::Empty { .. })));
        let mut lost = sample();
        lost.points[1].0[1] = f64::NAN;
        let error = lost.svg(Path::new("a.svg")).unwrap_err().to_string();
        assert!(
            error.contains("a.svg") && error.contains("entry 3"),
            "{error}"
        );
        let mut unknown = sample();
        for (_, value) in &mut unknown.cells {
            *value = f64::NAN;
        }
        unknown.points[0].2 = f64::INFINITY;
        assert!(unknown.svg(Path::new("")).is_ok());
    }

    #[test]
    fn values_outside_the_range_take_the_end_colours() {
        let mut map = sample();
        map.range = Some((1.0, 2.0));
        let svg = map.svg(Path::new("")).unwrap();
        let last = svg
            .lines()
            .find(|l| l.contains("<path fill=\"#fde725\""))
            .unwrap();
        assert_eq!(last.matches('M').count(), 2);
    }
}
