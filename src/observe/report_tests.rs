//! Tests of tables, their verdicts and their printed form.

use super::*;

fn sample() -> Table {
    let mut table = Table::new("Patch tests", Columns::Full);
    table.push(TableRow::at_most("splice 2d", "residual", 3e-13, 1e-11));
    table.push(TableRow::at_most("blending 2d", "residual", 2e-9, 1e-11));
    table.push(TableRow::at_least("plate", "speed-up", 12.5, 11.0).with_reference(11.0));
    table.push(TableRow::within("plate", "opening", 1.004, 1.0, 0.005));
    table.push(TableRow::refused("tets", "residual", "too few bonds"));
    table.push(TableRow::info("plate", "bonds", 1_234_567.0).differs("the figure counts halves"));
    table
}

#[test]
fn verdicts_follow_the_limits() {
    let verdicts: Vec<Verdict> = sample().rows.iter().map(|r| r.verdict).collect();
    use Verdict::{Differs, Pass, Refused, Short};
    assert_eq!(verdicts, [Pass, Short, Pass, Pass, Refused, Differs]);
    assert_eq!(TableRow::at_most("", "", 1.0, 1.0).verdict, Pass);
    assert_eq!(TableRow::at_least("", "", 10.99, 11.0).verdict, Short);
    assert_eq!(TableRow::within("", "", -1.02, -1.0, 0.01).verdict, Short);
    assert_eq!(TableRow::within("", "", -0.995, -1.0, 0.01).verdict, Pass);
    assert_eq!(TableRow::within("", "", 2e-9, 0.0, 1e-9).verdict, Short);
    assert_eq!(TableRow::within("", "", 5e-10, 0.0, 1e-9).verdict, Pass);
}

#[test]
fn what_is_not_finite_is_short_whatever_the_limit() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for row in [
            TableRow::info("", "", bad),
            TableRow::at_most("", "", bad, 1.0),
            TableRow::at_least("", "", bad, 1.0),
            TableRow::within("", "", bad, 1.0, 1.0),
            TableRow::within("", "", bad, 0.0, 1.0),
            TableRow::info("", "", bad).differs("no"),
        ] {
            assert_eq!(row.verdict, Verdict::Short, "{row:?}");
        }
    }
    assert_eq!(
        TableRow::at_most("", "", 1.0, f64::NAN).verdict,
        Verdict::Short
    );
    assert_eq!(
        TableRow::within("", "", 1.0, f64::NAN, 1.0).verdict,
        Verdict::Short
    );
}

#[test]
fn json_is_one_array_with_the_fields_promised() {
    let json = render(&[sample(), sample()], Format::Json);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&json).unwrap();
    assert_eq!(rows.len(), 12);
    for row in &rows {
        for field in ["case", "quantity", "value", "reference", "limit", "verdict"] {
            assert!(row.get(field).is_some(), "{field} is missing in {row}");
        }
        assert!(row.get("bound").is_none());
    }
    assert_eq!(rows[0]["value"], 3e-13);
    assert_eq!(rows[0]["reference"], serde_json::Value::Null);
    assert_eq!(rows[1]["verdict"], "short");
    assert_eq!(rows[4]["value"], serde_json::Value::Null);
    assert_eq!(rows[4]["verdict"], "refused");
    assert_eq!(rows[4]["reason"], "too few bonds");
    assert_eq!(rows[5]["verdict"], "differs");
    let none: Vec<serde_json::Value> = serde_json::from_str(&render(&[], Format::Json)).unwrap();
    assert!(none.is_empty());
}

#[test]
fn only_short_rows_fail_a_command() {
    let mut table = sample();
    assert_eq!(exit_code(&[Table::default(), table.clone()]), 1);
    table.rows.remove(1);
    assert_eq!(exit_code(&[table]), 0);
}

#[test]
fn text_names_every_row_its_limit_and_its_reason() {
    let text = sample().text();
    for part in [
        "Patch tests",
        "<= 1.000e-11",
        ">= 11",
        "+- 0.5000 %",
        "SHORT",
        "[1] too few bonds",
        "[2] the figure counts halves",
        "1234567",
        "3 pass, 1 short, 1 refused, 1 differ",
    ] {
        assert!(text.contains(part), "{part} is missing in\n{text}");
    }
    let mut pivot = sample();
    pivot.columns = Columns::ByQuantity;
    let text = pivot.text();
    let plate = text.lines().find(|l| l.starts_with("plate")).unwrap();
    assert_eq!(
        plate.split_whitespace().collect::<Vec<_>>(),
        ["plate", "12.50", "1.004", "1234567", "D"]
    );
    assert!(
        text.contains("S  blending 2d, residual: 2.000e-9 <= 1.000e-11"),
        "{text}"
    );
}

#[test]
fn numbers_for_people() {
    for (value, text) in [
        (0.0, "0"),
        (-0.0, "0"),
        (-10.0, "-10"),
        (1.0e9, "1000000000"),
        (0.012345, "0.01235"),
        (1234.56, "1235"),
        (-0.5, "-0.5000"),
        (1.5e-13, "1.500e-13"),
        (f64::NAN, "-"),
    ] {
        assert_eq!(number(value), text);
    }
}
