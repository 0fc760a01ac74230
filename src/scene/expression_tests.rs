//! Expressions as scenes write them.

use super::{Expression, Table};

fn value(text: &str) -> f64 {
    Expression::parse(text).unwrap().eval(&[2.0, 3.0, 5.0])
}

#[test]
fn precedence_is_that_of_written_mathematics() {
    assert_eq!(value("-x^2"), -4.0);
    assert_eq!(value("2^3^2"), 512.0);
    assert_eq!(value("2^-x"), 0.25);
    assert_eq!(value("1 - 2 - 3"), -4.0);
    assert_eq!(value("12 / 2 / 3"), 2.0);
    assert_eq!(value("2 * -x^2"), -8.0);
    assert_eq!(value("1 + x * y ** 2"), 19.0);
    assert_eq!(value("1.5e-1*z"), 0.75);
    assert_eq!(value("(-x)^3"), -8.0);
    assert_eq!(value("1/120"), 1.0 / 120.0);
}

#[test]
fn functions_and_choices() {
    assert_eq!(value("if(x < y, 10, 20)"), 10.0);
    assert_eq!(value("if(x >= y, 10, 20)"), 20.0);
    assert_eq!(value("max(x, min(y, z)) + abs(-1)"), 4.0);
    assert!((value("sin(pi / 2)") - 1.0).abs() < 1e-15);
    assert_eq!(value("hypot(3, 4)"), 5.0);
    let signs = ["sign(y - x)", "sign(x - y)", "sign(x - 2)", "sign(-0)"];
    assert_eq!(signs.map(value), [1.0, -1.0, 0.0, 0.0]);
    assert!(value("sign(sqrt(-x))").is_nan());
}

#[test]
fn dependence_is_known() {
    let e = Expression::parse("1 + y").unwrap();
    assert!(e.depends_on(1) && !e.depends_on(0));
    assert_eq!(e.as_constant(), None);
    assert_eq!(Expression::parse("1/4").unwrap().as_constant(), Some(0.25));
    let e = Expression::parse("if(t < 2, x * t, -1)").unwrap();
    assert!(e.depends_on_time() && e.depends_on_position() && !e.depends_on(1));
    assert_eq!(e.as_constant(), None);
    assert_eq!(e.eval_at(&[4.0, 0.0, 0.0], 1.5), 6.0);
    assert_eq!(e.eval_at(&[4.0, 0.0, 0.0], 2.0), -1.0);
    assert!(!Expression::parse("2*t").unwrap().depends_on_position());
}

#[test]
fn wrong_text_is_located() {
    for (text, at, what) in [
        ("1 +", 4, "ends where"),
        ("2 x", 3, "operator"),
        ("sin x", 5, "expected `(`"),
        ("(1", 3, "expected `)`"),
        ("1 + foo", 5, "`foo` is unknown"),
        ("tt", 1, "`tt` is unknown"),
        ("1..2", 1, "no number"),
        ("1 # 2", 3, "operator"),
        ("", 1, "ends where"),
        ("min(1)", 6, "expected `,`"),
    ] {
        let error = Expression::parse(text).unwrap_err();
        assert_eq!(error.at, at, "{text}: {error}");
        assert!(error.to_string().contains(what), "{text}: {error}");
    }
    assert!(Expression::parse(&"(".repeat(100_000)).is_err());
    assert!(Expression::parse(&"-".repeat(100_000)).is_err());
}

#[test]
fn long_sums_and_products_are_read_and_longer_text_is_refused_by_name() {
    let sum = Expression::parse(&["0.5*x"; 50_000].join(" + ")).unwrap();
    assert_eq!(sum.clone().eval(&[2.0, 0.0, 0.0]), 50_000.0);
    assert!(sum.depends_on(0) && !sum.depends_on(1));
    let product = format!("y{}", "*2/2".repeat(50_000));
    assert_eq!(value(&product), 3.0);
    // from left to right: 1 - 2 - 3 … and not 1 - (2 - 3 …)
    assert_eq!(value(&format!("100{}", " - x".repeat(50))), 0.0);
    let error = Expression::parse(&"1+".repeat(600_000)).unwrap_err();
    assert!(error.to_string().len() < 400, "{error}");
    assert!(error.what.contains("1200000 bytes"), "{error}");
    let deep = format!("{}x{}", "(".repeat(65), ")".repeat(65));
    let error = Expression::parse(&deep).unwrap_err();
    assert!(error.what.contains("more than 64 deep"), "{error}");
}

#[test]
fn tables_are_functions_of_one_number() {
    let table = Table::named("load_curve");
    let tables = std::slice::from_ref(&table);
    let read = |text: &str| Expression::parse_with(text, tables);
    let e = read("2 * load_curve(t / 2) + x").unwrap();
    assert!(e.depends_on_time() && e.depends_on_position() && !e.depends_on(1));
    table.fill(vec![(0.0, 1.0), (1.0, 3.0)]);
    assert_eq!(e.eval_at(&[10.0, 0.0, 0.0], 1.0), 14.0);
    assert_eq!(e.tables().len(), 1);
    // a table is no constant, whatever it is asked for
    let at_one = read("load_curve(1)").unwrap();
    assert_eq!(at_one.as_constant(), None);
    assert!(!at_one.depends_on_time());
    for (text, what) in [
        ("load_curve", "expected `(`"),
        ("load_curve(t, x)", "expected `)`"),
        ("loadcurve(t)", "the tables are load_curve"),
    ] {
        let error = read(text).unwrap_err();
        assert!(error.to_string().contains(what), "{text}: {error}");
    }
    assert!(Expression::parse("load_curve(t)").is_err());
}
