//! Tests of line plots.

use super::*;

fn plot(x_scale: Scale, y_scale: Scale) -> LinePlot {
    LinePlot {
        title: "Error < 1 & falling".into(),
        x_label: "h [m]".into(),
        y_label: "error".into(),
        x_scale,
        y_scale,
        series: [
            Stroke::Line,
            Stroke::Dashed,
            Stroke::Dots,
            Stroke::LineAndDots,
        ]
        .iter()
        .enumerate()
        .map(|(i, &stroke)| {
            let points = (0..5).map(|k| (0.1 * (k as f64), 10f64.powi(-k) * (i + 1) as f64));
            Series::new(format!("series {i}"), stroke, points.collect())
        })
        .collect(),
    }
}

#[test]
fn every_scale_draws_every_series_and_label() {
    let folder = tempfile::tempdir().unwrap();
    for x in [Scale::Linear, Scale::Log] {
        for y in [Scale::Linear, Scale::Log] {
            let path = folder.path().join(format!("new/{x:?}{y:?}.svg"));
            plot(x, y).write(&path).unwrap();
            let svg = std::fs::read_to_string(&path).unwrap();
            assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
            for part in [
                "h [m]",
                "error",
                "series 0",
                "series 3",
                "&lt; 1 &amp; falling",
            ] {
                assert!(svg.contains(part), "{part} is missing for {x:?} {y:?}");
            }
            // x = 0 has no logarithm: one dot fewer in each of the two series with dots (legend: four circles)
            let dots = svg.matches("<circle").count() - 4;
            assert_eq!(dots, if x == Scale::Log { 8 } else { 10 });
        }
    }
}

#[test]
fn a_png_holds_what_an_svg_holds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/plot.PNG");
    let p = plot(Scale::Linear, Scale::Log);
    p.write(&path).unwrap();
    let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((frame.width, frame.height), (2400, 1500));
    let count = |colour: RGBColor| {
        let (r, g, b) = (colour.0, colour.1, colour.2);
        pixels.chunks(3).filter(|p| *p == [r, g, b]).count()
    };
    // every series in its colour; black text of title, axes, ticks and legend, which without its font is not there
    for colour in &COLOURS[..4] {
        assert!(count(*colour) > 500);
    }
    assert!(count(RGBColor(0, 0, 0)) > 10_000);
    assert!(count(WHITE) > 2400 * 1500 / 2);
}

#[test]
fn nothing_to_draw_is_an_error() {
    let path = Path::new("never.svg");
    let mut empty = plot(Scale::Linear, Scale::Log);
    for series in &mut empty.series {
        series.points = vec![(1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)];
    }
    assert!(matches!(empty.write(path), Err(ObserveError::Empty { .. })));
    empty.series.clear();
    assert!(matches!(empty.write(path), Err(ObserveError::Empty { .. })));
    assert!(!path.exists());
}

#[test]
fn a_gap_and_a_constant_are_drawn() {
    let mut p = plot(Scale::Linear, Scale::Linear);
    p.series.truncate(1);
    p.series[0].points = vec![
        (0.0, 3e7),
        (1.0, 3e7),
        (2.0, f64::NAN),
        (3.0, 3e7),
        (4.0, 3e7),
    ];
    let gap = p.svg(Path::new("")).unwrap();
    p.series[0].points.remove(2);
    let whole = p.svg(Path::new("")).unwrap();
    assert_eq!(
        gap.matches("<polyline").count(),
        whole.matches("<polyline").count() + 1
    );
    p.series[0].points = vec![(0.0, 0.0)];
    assert!(p.svg(Path::new("")).is_ok());
}

#[test]
fn the_legend_leaves_the_data_alone() {
    let mut p = plot(Scale::Linear, Scale::Linear);
    p.series.truncate(1);
    // a line from corner to corner leaves the two others
    p.series[0].points = vec![(0.0, 0.0), (1.0, 1.0)];
    assert!(matches!(
        p.emptiest_corner(),
        SeriesLabelPosition::UpperLeft
    ));
    p.series[0].points = vec![(0.0, 1.0), (1.0, 0.0)];
    assert!(matches!(
        p.emptiest_corner(),
        SeriesLabelPosition::UpperRight
    ));
    p.series[0].points = vec![(0.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
    assert!(matches!(
        p.emptiest_corner(),
        SeriesLabelPosition::LowerRight
    ));
}

#[test]
fn a_logarithmic_axis_has_some_ticks_and_not_too_many() {
    assert_eq!(ticks_of_factors(&(0.14..3.1)), [0.2, 0.5, 1.0, 2.0]);
    assert_eq!(ticks_of_factors(&(0.0012..0.0049)), [0.002, 0.003, 0.004]);
    assert_eq!(
        ticks_of_factors(&(0.9e-5..0.9)),
        [1e-5, 1e-4, 1e-3, 1e-2, 0.1]
    );
}

#[test]
fn ticks_have_no_idle_digits() {
    let texts = [
        0.0,
        0.30000000000000004,
        -2.0,
        1e-5,
        2.5e-7,
        1e6,
        1500.0,
        0.001,
    ]
    .map(tick);
    assert_eq!(
        texts,
        ["0", "0.3", "-2", "1e-5", "2.5e-7", "1e6", "1500", "0.001"]
    );
}

#[test]
fn labels_stand_beside_their_points() {
    let points = vec![(1.0, 4.0), (2.0, 1.0), (f64::NAN, 1.0)];
    let labels = ["cheap", "exact", "nowhere"].map(str::to_owned).to_vec();
    let plot = LinePlot {
        series: vec![Series::new("front", Stroke::LineAndDots, points).labelled(labels)],
        ..LinePlot::default()
    };
    let svg = plot.svg(Path::new("plot.svg")).unwrap();
    // the left one begins at its point, the right one ends there
    let anchor = |label: &str| {
        svg[..svg.find(label).unwrap()]
            .rfind("text-anchor=")
            .map(|at| svg[at..].starts_with("text-anchor=\"start\""))
    };
    assert_eq!(anchor("cheap"), Some(true));
    assert_eq!(anchor("exact"), Some(false));
    assert!(!svg.contains("nowhere"));
}
