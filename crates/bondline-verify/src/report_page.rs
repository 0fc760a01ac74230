//! The page on the results of `verify`, for `verify --markdown FILE`.

use std::fmt::Write as _;

use super::{Effort, LONG_SUITES, Suite};
use bondline::observe::report::{Table, TableRow, Verdict, number};

/// Tables that would take more lines than this are counted, not printed; a line may hold many rows.
const MOST_LINES: usize = 80;

/// Results of a suite.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The suite.
    pub suite: &'static Suite,
    /// Its tables.
    pub tables: Vec<Table>,
    /// Time that it took on the clock \[s\].
    pub seconds: f64,
}

/// The page in Markdown: one section per suite, one table per table or figure of a paper, rows that a paper prints first.
pub fn page(outcomes: &[Outcome], effort: Effort) -> String {
    let option = match effort {
        Effort::Quick => " --quick",
        Effort::Full => "",
    };
    let mut text = format!(
        "# Verification\n\nWritten by `bondline verify{option} --markdown FILE`; change the suites, not this page.\n\n\
         Where a paper prints a value it stands beside ours with their ratio. *differs* marks what cannot be reproduced as written, *refused* what is not run, each with its\n\
         reason; *SHORT* is a row that misses its limit. Tables without a printed value show ours alone, long ones only their counts: the command prints them all.\n\n\
         | suite | what it measures | pass | short | differ | warned | refused |\n|---|---|---|---|---|---|---|\n"
    );
    for o in outcomes {
        let count = |v: Verdict| o.tables.iter().map(|t| t.count(v)).sum::<usize>();
        let _ = writeln!(
            text,
            "| [`{0}`](#{0}) | {1} | {2} | {3} | {4} | {5} | {6} |",
            o.suite.name,
            o.suite.about,
            count(Verdict::Pass),
            count(Verdict::Short),
            count(Verdict::Differs),
            count(Verdict::Warned),
            count(Verdict::Refused)
        );
    }
    for s in LONG_SUITES {
        let _ = writeln!(text, "| `{}` | {} | | | | | |", s.name, s.about);
    }
    for o in outcomes {
        let _ = write!(
            text,
            "\n## {}\n\n`bondline verify {0}{option}`\n",
            o.suite.name
        );
        for table in &o.tables {
            text.push_str(&section(table));
        }
    }
    text
}

fn section(table: &Table) -> String {
    let mut text = format!("\n### {}\n\n", table.title);
    if !table.rows.iter().any(|r| r.reference.is_some()) {
        let body = table.text();
        let body = body.split_once('\n').map_or("", |(_, rest)| rest);
        if body.lines().count() > MOST_LINES {
            let counts = [Verdict::Pass, Verdict::Short, Verdict::Refused].map(|v| table.count(v));
            let [pass, short, refused] = counts;
            let _ = writeln!(
                text,
                "{pass} rows pass, {short} are short, {refused} are refused."
            );
        } else {
            let _ = write!(text, "```text\n{body}```\n");
        }
        return text;
    }
    text.push_str("| case | quantity | printed, exact | ours | ratio | verdict | note |\n|---|---|---|---|---|---|---|\n");
    // what a paper prints first
    let printed = |r: &&TableRow| r.reference.is_some();
    let rows = table.rows.iter().filter(printed);
    for r in rows.chain(table.rows.iter().filter(|r| r.reference.is_none())) {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} |",
            cell(&r.case),
            cell(&r.quantity),
            r.reference.map(number).unwrap_or_default(),
            number(r.value),
            r.ratio().map(number).unwrap_or_default(),
            r.verdict.word(),
            cell(r.reason.as_deref().unwrap_or_default())
        );
    }
    text
}

/// Text that may stand in a cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite;
    use bondline::observe::report::Columns;

    #[test]
    fn printed_rows_come_first_with_their_ratio_and_note() {
        let mut table = Table::new("Table I", Columns::Full);
        table.push(TableRow::info("a", "time", 3.0));
        table.push(
            TableRow::info("b", "|u|", 2.0)
                .with_reference(4.0)
                .differs("misprint"),
        );
        let outcome = Outcome {
            suite: suite("bobaru").unwrap(),
            tables: vec![table, Table::new("Table II", Columns::Full)],
            seconds: 1.0,
        };
        let text = page(&[outcome], Effort::Quick);
        let b = text
            .find("| b | \\|u\\| | 4 | 2 | 0.5000 | differs | misprint |")
            .unwrap();
        assert!(
            b < text.find("| a | time |  | 3 |  | pass |  |").unwrap(),
            "{text}"
        );
        assert!(text.contains("| 1 | 0 | 1 | 0 |"), "{text}");
        assert!(text.contains("`bondline verify bobaru --quick`"));
        assert!(text.contains("`scale`"));
    }

    #[test]
    fn tables_are_folded_by_their_lines_not_their_rows() {
        let table = |columns, cases: usize, quantities: usize| {
            let mut table = Table::new("T", columns);
            for row in 0..cases * quantities {
                let (case, quantity) = (row / quantities, row % quantities);
                table.push(TableRow::info(
                    format!("case {case}"),
                    format!("q{quantity}"),
                    1.0,
                ));
            }
            section(&table)
        };
        // 13 lines of 8 figures are printed, 104 lines of one are not
        assert!(table(Columns::ByQuantity, 13, 8).contains("case 12"));
        assert!(table(Columns::Full, 13, 8).contains("104 rows pass"));
    }
}
