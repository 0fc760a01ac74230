//! Line plots as SVG and PNG.
//!
//! Text in a bitmap needs a font. It is part of the program: one that fails for want of a font of the system is no use.

use std::path::Path;
use std::sync::LazyLock;

use plotters::coord::{
    Shift,
    ranged1d::{AsRangedCoord, Ranged, ValueFormatter},
};
use plotters::prelude::{
    BindKeyPoints, BitMapBackend, Cartesian2d, ChartBuilder, ChartContext, Circle,
    DashedLineSeries, DrawingArea, DrawingBackend, EmptyElement, IntoDrawingArea, IntoLogRange,
    LineSeries, PathElement, RGBColor, SVGBackend, SeriesLabelPosition, Text, WHITE,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, ShapeStyle, TextStyle, register_font};

use bondline::observe::ObserveError;
use bondline::observe::atomic_file::write_whole;

/// Scale of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// In equal steps.
    #[default]
    Linear,
    /// In equal factors; values that are not positive are left out.
    Log,
}

/// Style of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stroke {
    /// A line.
    #[default]
    Line,
    /// A dashed line, for a reference.
    Dashed,
    /// A dot per point.
    Dots,
    /// A line with a dot per point, for measured figures.
    LineAndDots,
}

/// A named series of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; a series without a name is not in it.
    pub name: String,
    /// Points in the order in which a line joins them.
    pub points: Vec<(f64, f64)>,
    /// Style in which it is drawn.
    pub stroke: Stroke,
    /// Labels beside the points; empty if there are none.
    pub labels: Vec<String>,
}

impl Series {
    /// A series of points.
    pub fn new(name: impl Into<String>, stroke: Stroke, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.into(),
            points,
            stroke,
            labels: Vec::new(),
        }
    }

    /// The same with a label beside each point.
    #[must_use]
    pub fn labelled(self, labels: Vec<String>) -> Self {
        Self { labels, ..self }
    }
}

/// A plot of several series over one pair of axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinePlot {
    /// Above the plot.
    pub title: String,
    /// Below the horizontal axis, with its unit.
    pub x_label: String,
    /// Beside the vertical axis, with its unit.
    pub y_label: String,
    /// Division of the horizontal axis.
    pub x_scale: Scale,
    /// Division of the vertical axis.
    pub y_scale: Scale,
    /// The series, later ones on top.
    pub series: Vec<Series>,
}

/// Colours that stay apart for colour-blind readers (Okabe and Ito).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(60, 60, 60),
];

/// Width and height in pixels, of an SVG at its natural size.
const SIZE: (u32, u32) = (800, 500);

/// Pixels of a PNG per pixel of an SVG, so that it can be printed.
const PNG_SCALE: u32 = 3;

/// The family of all text: a font of the system in an SVG, DejaVu Sans in a PNG.
const FONT: &str = "sans-serif";

/// Registers the font of bitmaps, once; whether it can be read.
static FONT_READ: LazyLock<bool> =
    LazyLock::new(|| register_font(FONT, FontStyle::Normal, dejavu::sans::regular()).is_ok());

impl LinePlot {
    /// Writes the plot, as PNG if the path ends so, else as SVG; makes the folder if it is missing.
    ///
    /// Points that are not finite, or not positive on a logarithmic axis, are left out and break their line.
    ///
    /// # Errors
    /// [`ObserveError::Empty`] if no point is left, [`ObserveError::Folder`], [`ObserveError::Write`].
    pub fn write(&self, path: &Path) -> Result<(), ObserveError> {
        let bytes = if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("png"))
        {
            self.png(path)?
        } else {
            self.svg(path)?.into_bytes()
        };
        write_whole(path, |out| std::io::Write::write_all(out, &bytes))
    }

    fn drawable(&self, (x, y): (f64, f64)) -> bool {
        let fits = |v: f64, scale| v.is_finite() && (scale == Scale::Linear || v > 0.0);
        fits(x, self.x_scale) && fits(y, self.y_scale)
    }

    /// The corner in which the legend hides the fewest points and pieces of line.
    fn emptiest_corner(&self) -> SeriesLabelPosition {
        let scaled = |v: f64, scale| if scale == Scale::Log { v.ln() } else { v };
        let runs: Vec<Vec<(f64, f64)>> = self
            .series
            .iter()
            .flat_map(|s| s.points.split(|&p: &(f64, f64)| !self.drawable(p)))
            .map(|run| {
                run.iter()
                    .map(|&(x, y)| (scaled(x, self.x_scale), scaled(y, self.y_scale)))
                    .collect()
            })
            .collect();
        let all = || runs.iter().flatten();
        let (Some(x), Some(y)) = (
            range(all().map(|p| p.0), Scale::Linear),
            range(all().map(|p| p.1), Scale::Linear),
        ) else {
            return SeriesLabelPosition::UpperRight;
        };
        let unit = |p: (f64, f64)| {
            (
                (p.0 - x.start) / (x.end - x.start),
                (p.1 - y.start) / (y.end - y.start),
            )
        };
        let mut hidden = [0usize; 4];
        for run in &runs {
            for (i, &a) in run.iter().enumerate() {
                let (a, b) = (unit(a), unit(run[(i + 1).min(run.len() - 1)]));
                // a long piece of line counts at ten places along it
                for k in 0..10 {
                    let t = f64::from(k) / 10.0;
                    let (u, v) = (a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1));
                    for (corner, count) in hidden.iter_mut().enumerate() {
                        let (u, v) = (
                            if corner % 2 == 0 { 1.0 - u } else { u },
                            if corner < 2 { 1.0 - v } else { v },
                        );
                        *count += usize::from(u < 0.3 && v < 0.3);
                    }
                }
            }
        }
        let corners = [
            SeriesLabelPosition::UpperRight,
            SeriesLabelPosition::UpperLeft,
            SeriesLabelPosition::LowerRight,
            SeriesLabelPosition::LowerLeft,
        ];
        corners
            .into_iter()
            .zip(hidden)
            .min_by_key(|c| c.1)
            .map_or(SeriesLabelPosition::UpperRight, |c| c.0)
    }

    fn svg(&self, path: &Path) -> Result<String, ObserveError> {
        let mut svg = String::new();
        self.drawn(
            path,
            SVGBackend::with_string(&mut svg, SIZE).into_drawing_area(),
            1,
        )?;
        Ok(svg)
    }

    fn png(&self, path: &Path) -> Result<Vec<u8>, ObserveError> {
        let encode = |message: String| ObserveError::Encode {
            path: path.to_path_buf(),
            format: "PNG",
            message,
        };
        let (width, height) = (PNG_SCALE * SIZE.0, PNG_SCALE * SIZE.1);
        let mut pixels = vec![0; 3 * width as usize * height as usize];
        self.drawn(
            path,
            BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area(),
            PNG_SCALE,
        )?;
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let written = encoder
            .write_header()
            .and_then(|mut out| out.write_image_data(&pixels));
        written.map_err(|e| encode(e.to_string()))?;
        Ok(bytes)
    }

    /// Draws the plot on an area of `scale` times [`SIZE`].
    fn drawn<B: DrawingBackend>(
        &self,
        path: &Path,
        root: DrawingArea<B, Shift>,
        scale: u32,
    ) -> Result<(), ObserveError> {
        let points = || {
            self.series
                .iter()
                .flat_map(|s| &s.points)
                .copied()
                .filter(|&p| self.drawable(p))
        };
        let (Some(x), Some(y)) = (
            range(points().map(|p| p.0), self.x_scale),
            range(points().map(|p| p.1), self.y_scale),
        ) else {
            return Err(ObserveError::Empty {
                path: path.to_path_buf(),
                what: "no point of the plot can be drawn (finite, and positive on a logarithmic axis)",
            });
        };
        let log = |range: &std::ops::Range<f64>| {
            let ticks = ticks_of_factors(range);
            (range.clone().log_scale()).with_key_points(ticks)
        };
        let (lx, ly) = (|| log(&x), || log(&y));
        // without it the size of a text is not known, in an SVG neither
        LazyLock::force(&FONT_READ);
        match (self.x_scale, self.y_scale) {
            (Scale::Linear, Scale::Linear) => self.draw(&root, scale, x.clone(), y.clone()),
            (Scale::Log, Scale::Linear) => self.draw(&root, scale, lx(), y.clone()),
            (Scale::Linear, Scale::Log) => self.draw(&root, scale, x.clone(), ly()),
            (Scale::Log, Scale::Log) => self.draw(&root, scale, lx(), ly()),
        }
        .map_err(|message| ObserveError::Encode {
            path: path.to_path_buf(),
            format: "a plot",
            message,
        })
    }

    fn draw<B: DrawingBackend, X, Y>(
        &self,
        root: &DrawingArea<B, Shift>,
        scale: u32,
        x: X,
        y: Y,
    ) -> Result<(), String>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let rounded = |v: f64, zero: f64| if v.abs() < zero { 0.0 } else { v };
        let pixels = |n: u32| n * scale;
        let text = |size: u32| (FONT, pixels(size));
        root.fill(&WHITE).map_err(|e| e.to_string())?;
        let mut chart = ChartBuilder::on(root)
            .margin(pixels(14))
            .caption(&self.title, text(20))
            .x_label_area_size(pixels(46))
            .y_label_area_size(pixels(74))
            .build_cartesian_2d(x, y)
            .map_err(|e| e.to_string())?;
        // a tick at zero comes out of the axis's arithmetic as round-off
        let zero = |scale: Scale, range: std::ops::Range<f64>| match scale {
            Scale::Linear => 1e-10 * (range.end - range.start).abs(),
            Scale::Log => 0.0,
        };
        let (zero_x, zero_y) = (
            zero(self.x_scale, chart.x_range()),
            zero(self.y_scale, chart.y_range()),
        );
        chart
            .configure_mesh()
            .max_light_lines(0)
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .axis_desc_style(text(15))
            .label_style(text(13))
            .light_line_style(RGBColor(244, 244, 244))
            .bold_line_style(RGBColor(225, 225, 225))
            .x_label_formatter(&|v| tick(rounded(*v, zero_x)))
            .y_label_formatter(&|v| tick(rounded(*v, zero_y)))
            .draw()
            .map_err(|e| e.to_string())?;
        self.draw_series(&mut chart, scale)?;
        chart
            .configure_series_labels()
            .position(self.emptiest_corner())
            .legend_area_size(pixels(30))
            .margin(pixels(10))
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font(text(14))
            .draw()
            .map_err(|e| e.to_string())?;
        root.present().map_err(|e| e.to_string())
    }

    /// Draws each series in its colour, and names it in the legend.
    fn draw_series<'a, B, X, Y>(
        &self,
        chart: &mut ChartContext<'a, B, Cartesian2d<X, Y>>,
        scale: u32,
    ) -> Result<(), String>
    where
        B: DrawingBackend + 'a,
        X: Ranged<ValueType = f64>,
        Y: Ranged<ValueType = f64>,
    {
        let pixels = |n: u32| n * scale;
        for (i, series) in self.series.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let line = colour.stroke_width(pixels(2));
            let mut named = series.name.is_empty();
            let runs = series.points.split(|&p: &(f64, f64)| !self.drawable(p));
            for run in runs.filter(|run| !run.is_empty()) {
                let run = run.to_vec();
                let entry = match series.stroke {
                    Stroke::Line => chart.draw_series(LineSeries::new(run, line)),
                    Stroke::Dashed => {
                        chart.draw_series(DashedLineSeries::new(run, pixels(7), pixels(5), line))
                    }
                    Stroke::Dots | Stroke::LineAndDots => {
                        let dots: Vec<_> = run
                            .iter()
                            .map(|&p| Circle::new(p, pixels(3), colour.filled()))
                            .collect();
                        if series.stroke == Stroke::LineAndDots {
                            chart
                                .draw_series(LineSeries::new(run, line))
                                .map_err(|e| e.to_string())?;
                        }
                        chart.draw_series(dots)
                    }
                }
                .map_err(|e| e.to_string())?;
                if !named {
                    named = true;
                    let stroke = series.stroke;
                    entry
                        .label(&series.name)
                        .legend(move |at| legend(at, stroke, line, scale));
                }
            }
            self.draw_labels(chart, series, scale)?;
        }
        Ok(())
    }

    /// Writes the labels of a series beside its points, towards the middle of the plot.
    fn draw_labels<'a, B, X, Y>(
        &self,
        chart: &mut ChartContext<'a, B, Cartesian2d<X, Y>>,
        series: &Series,
        scale: u32,
    ) -> Result<(), String>
    where
        B: DrawingBackend + 'a,
        X: Ranged<ValueType = f64>,
        Y: Ranged<ValueType = f64>,
    {
        let width = chart.plotting_area().dim_in_pixel().0 as i32;
        let left = chart.plotting_area().get_pixel_range().0.start;
        let away = 8 * scale as i32;
        for (&p, label) in series.points.iter().zip(&series.labels) {
            if !self.drawable(p) {
                continue;
            }
            let on_the_left = chart.backend_coord(&p).0 - left < width / 2;
            let (side, shift) = if on_the_left {
                (HPos::Left, away)
            } else {
                (HPos::Right, -away)
            };
            let style = TextStyle::from((FONT, 12 * scale)).pos(Pos::new(side, VPos::Center));
            let text = EmptyElement::at(p) + Text::new(label.clone(), (shift, -away / 2), style);
            chart.draw_series([text]).map_err(|e| e.to_string())?;
        }
        Ok(())
    }
}

/// The sample of a stroke in the legend: two dashes and a dot, of which a stroke shows what it has.
fn legend<'e, B: DrawingBackend + 'e>(
    at: (i32, i32),
    stroke: Stroke,
    line: ShapeStyle,
    scale: u32,
) -> impl plotters::element::IntoDynElement<'e, B, (i32, i32)> {
    let (first, second) = match stroke {
        Stroke::Line | Stroke::LineAndDots => (0..10, 10..20),
        Stroke::Dashed => (0..8, 12..20),
        Stroke::Dots => (10..10, 10..10),
    };
    let radius = match stroke {
        Stroke::Line | Stroke::Dashed => 0,
        Stroke::Dots | Stroke::LineAndDots => 3 * scale,
    };
    let along = |x: i32| (x * scale as i32, 0);
    let dash = |r: std::ops::Range<i32>| PathElement::new(vec![along(r.start), along(r.end)], line);
    EmptyElement::at(at)
        + dash(first)
        + dash(second)
        + Circle::new(along(10), radius, line.color.filled())
}

/// The range of an axis with a margin; none without values.
pub(super) fn range(
    values: impl Iterator<Item = f64>,
    scale: Scale,
) -> Option<std::ops::Range<f64>> {
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
        (lo.min(v), hi.max(v))
    });
    if lo > hi {
        return None;
    }
    match scale {
        Scale::Linear => {
            // a constant needs room too, more than its own rounding
            let margin = (0.04 * (hi - lo)).max(1e-9 * lo.abs().max(hi.abs()));
            let margin = if margin > 0.0 { margin } else { 1.0 };
            Some(lo - margin..hi + margin)
        }
        Scale::Log => {
            let factor = (hi / lo).powf(0.04).max(1.2);
            Some(lo / factor..hi * factor)
        }
    }
}

/// Ticks of a logarithmic axis: powers of ten, with twice and five times each, or all digits, where these are few.
pub(super) fn ticks_of_factors(range: &std::ops::Range<f64>) -> Vec<f64> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    let ticks = |digits: &[i32]| -> Vec<f64> {
        let all = decades.clone().flat_map(|k| {
            // a power of ten, as it is typed, is the nearest number to it
            (digits.iter()).filter_map(move |d| format!("{d}e{k}").parse().ok())
        });
        all.filter(|t| range.contains(t)).collect()
    };
    let finer = [&[1][..], &[1, 2, 5], &[1, 2, 3, 4, 5, 6, 7, 8, 9]].map(ticks);
    let enough = finer.iter().position(|t| t.len() >= 4).unwrap_or(2);
    finer.into_iter().nth(enough).unwrap_or_default()
}

/// A number beside a tick: no more digits than it has.
pub(super) fn tick(value: f64) -> String {
    let size = value.abs();
    if size < 1e-300 {
        return "0".to_owned();
    }
    let trimmed = |text: &str| text.trim_end_matches('0').trim_end_matches('.').to_owned();
    if (1e-3..1e5).contains(&size) {
        return trimmed(&format!("{value:.6}"));
    }
    let text = format!("{value:.4e}");
    match text.split_once('e') {
        Some((digits, power)) => format!("{}e{power}", trimmed(digits)),
        None => text,
    }
}

#[cfg(test)]
#[path = "line_plot_tests.rs"]
mod tests;
