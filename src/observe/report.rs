//! Rows with a verdict, their table for people and their JSON for programs.
//!
//! A command prints one or more [`Table`]s; with `--json` all their rows form one array. A row's limit is part of the
//! row, so that a table can be judged without the code that made it.

use std::fmt::Write as _;

use serde::Serialize;

/// Verdict on a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The value keeps its limit, or has none.
    Pass,
    /// The value misses its limit, or is not a number.
    Short,
    /// The value misses its limit, and the run that it is from says so with place and number.
    Warned,
    /// The case is refused, for the reason given.
    Refused,
    /// A published figure cannot be reproduced as written, for the reason given.
    Differs,
}

impl Verdict {
    /// Its word in tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Short => "SHORT",
            Self::Warned => "warned",
            Self::Refused => "refused",
            Self::Differs => "differs",
        }
    }
}

/// Sense of a limit; only the text table shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// No limit.
    Free,
    /// The value must not exceed the limit.
    AtMost,
    /// The value must reach the limit.
    AtLeast,
    /// The distance from the reference, relative to it, must not exceed the limit.
    Within,
}

/// One figure of one case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableRow {
    /// Case that was run.
    pub case: String,
    /// Quantity that was measured, with its unit if it has one.
    pub quantity: String,
    /// The figure; `null` in JSON if it is not finite.
    pub value: f64,
    /// Value from an independent source.
    pub reference: Option<f64>,
    /// Limit that the value must keep; see [`Bound`].
    pub limit: Option<f64>,
    /// Verdict on the value.
    pub verdict: Verdict,
    /// Reason, where the verdict asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Sense of the limit.
    #[serde(skip)]
    pub bound: Bound,
}

impl TableRow {
    fn new(case: impl Into<String>, quantity: impl Into<String>, value: f64) -> Self {
        Self {
            case: case.into(),
            quantity: quantity.into(),
            value,
            reference: None,
            limit: None,
            verdict: Verdict::Pass,
            reason: None,
            bound: Bound::Free,
        }
    }

    /// Sets limit and verdict. Every comparison with NaN is false, hence short.
    fn judged(mut self, bound: Bound, limit: f64) -> Self {
        let kept = match (bound, self.reference) {
            (Bound::Free, _) => self.value.is_finite(),
            (Bound::AtMost, _) => self.value <= limit,
            (Bound::AtLeast, _) => self.value >= limit,
            (Bound::Within, Some(r)) if r != 0.0 => (self.value - r).abs() <= limit * r.abs(),
            (Bound::Within, _) => self.value.abs() <= limit,
        };
        self.limit = (bound != Bound::Free).then_some(limit);
        self.bound = bound;
        self.verdict = if kept && self.value.is_finite() {
            Verdict::Pass
        } else {
            Verdict::Short
        };
        self
    }

    /// A figure without a limit; short only if it is not finite.
    pub fn info(case: impl Into<String>, quantity: impl Into<String>, value: f64) -> Self {
        Self::new(case, quantity, value).judged(Bound::Free, 0.0)
    }

    /// A figure that must be `limit` or less.
    pub fn at_most(
        case: impl Into<String>,
        quantity: impl Into<String>,
        value: f64,
        limit: f64,
    ) -> Self {
        Self::new(case, quantity, value).judged(Bound::AtMost, limit)
    }

    /// A figure that must be `limit` or more.
    pub fn at_least(
        case: impl Into<String>,
        quantity: impl Into<String>,
        value: f64,
        limit: f64,
    ) -> Self {
        Self::new(case, quantity, value).judged(Bound::AtLeast, limit)
    }

    /// A figure whose distance from `reference` must be `limit` times `|reference|` or less (`limit` itself if the
    /// reference is zero).
    pub fn within(
        case: impl Into<String>,
        quantity: impl Into<String>,
        value: f64,
        reference: f64,
        limit: f64,
    ) -> Self {
        Self::new(case, quantity, value)
            .with_reference(reference)
            .judged(Bound::Within, limit)
    }

    /// A value that the run itself warns of, and in which words.
    pub fn warned(
        case: impl Into<String>,
        quantity: impl Into<String>,
        value: f64,
        reason: impl Into<String>,
    ) -> Self {
        Self {
            verdict: Verdict::Warned,
            reason: Some(reason.into()),
            ..Self::new(case, quantity, value)
        }
    }

    /// A case that is not run, and why; its value is NaN.
    pub fn refused(
        case: impl Into<String>,
        quantity: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        Self {
            verdict: Verdict::Refused,
            reason: Some(reason.into()),
            ..Self::new(case, quantity, f64::NAN)
        }
    }

    /// The same row with a figure to compare by; the verdict stays.
    pub fn with_reference(mut self, reference: f64) -> Self {
        self.reference = Some(reference);
        self
    }

    /// The same row with a remark; the verdict stays.
    pub fn because(mut self, reason: impl Into<String>) -> Self {
        self.reason = Some(reason.into());
        self
    }

    /// The same row as the record of a published figure that cannot be reproduced; a value that is not finite stays short.
    pub fn differs(mut self, reason: impl Into<String>) -> Self {
        if self.value.is_finite() {
            self.verdict = Verdict::Differs;
        }
        self.because(reason)
    }

    /// Value over reference, where there is one.
    pub fn ratio(&self) -> Option<f64> {
        self.reference.filter(|&r| r != 0.0).map(|r| self.value / r)
    }

    fn limit_text(&self) -> String {
        match (self.bound, self.limit) {
            (Bound::AtMost, Some(l)) => format!("<= {}", number(l)),
            (Bound::AtLeast, Some(l)) => format!(">= {}", number(l)),
            (Bound::Within, Some(l)) if self.reference == Some(0.0) => format!("+- {}", number(l)),
            (Bound::Within, Some(l)) => format!("+- {} %", number(100.0 * l)),
            _ => String::new(),
        }
    }
}

/// Layout of a table for people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Columns {
    /// One line per row, with reference, limit and verdict.
    #[default]
    Full,
    /// One line per case and one column per quantity; a letter marks what does not pass.
    ByQuantity,
}

/// Rows under a title.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Subject of the rows.
    pub title: String,
    /// The rows, in the order they are printed.
    pub rows: Vec<TableRow>,
    /// Layout for people.
    pub columns: Columns,
}

impl Table {
    /// An empty table.
    pub fn new(title: impl Into<String>, columns: Columns) -> Self {
        Self {
            title: title.into(),
            rows: Vec::new(),
            columns,
        }
    }

    /// Appends a row.
    pub fn push(&mut self, row: TableRow) {
        self.rows.push(row);
    }

    /// Number of rows with a verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.rows.iter().filter(|r| r.verdict == verdict).count()
    }

    /// The table for people, with a last line that counts the verdicts.
    pub fn text(&self) -> String {
        let mut text = format!("{}\n", self.title);
        let (grid, notes) = match self.columns {
            Columns::Full => self.full(),
            Columns::ByQuantity => self.by_quantity(),
        };
        text.push_str(&aligned(&grid));
        for note in notes {
            let _ = writeln!(text, "{note}");
        }
        let mut counts = format!(
            "{} pass, {} short",
            self.count(Verdict::Pass),
            self.count(Verdict::Short)
        );
        for (verdict, word) in [
            (Verdict::Warned, "warned of"),
            (Verdict::Refused, "refused"),
            (Verdict::Differs, "differ"),
        ] {
            if self.count(verdict) > 0 {
                let _ = write!(counts, ", {} {word}", self.count(verdict));
            }
        }
        let _ = writeln!(text, "{counts}");
        text
    }

    fn full(&self) -> (Vec<Vec<String>>, Vec<String>) {
        let mut grid = vec![
            [
                "case",
                "quantity",
                "value",
                "reference",
                "ratio",
                "limit",
                "verdict",
            ]
            .map(str::to_owned)
            .to_vec(),
        ];
        let mut reasons: Vec<&str> = Vec::new();
        for row in &self.rows {
            let mut verdict = row.verdict.word().to_owned();
            if let Some(reason) = &row.reason {
                let known = reasons.iter().position(|r| r == reason);
                let at = known.unwrap_or(reasons.len());
                if known.is_none() {
                    reasons.push(reason);
                }
                let _ = write!(verdict, " [{}]", at + 1);
            }
            grid.push(vec![
                row.case.clone(),
                row.quantity.clone(),
                number(row.value),
                row.reference.map(number).unwrap_or_default(),
                row.ratio().map(number).unwrap_or_default(),
                row.limit_text(),
                verdict,
            ]);
        }
        // a column that says nothing is left out
        for column in [5, 4, 3] {
            if grid[1..].iter().all(|line| line[column].is_empty()) {
                for line in &mut grid {
                    line.remove(column);
                }
            }
        }
        let notes = reasons
            .iter()
            .enumerate()
            .map(|(i, reason)| format!("[{}] {reason}", i + 1))
            .collect();
        (grid, notes)
    }

    fn by_quantity(&self) -> (Vec<Vec<String>>, Vec<String>) {
        let mut cases: Vec<&str> = Vec::new();
        let mut quantities: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !cases.contains(&row.case.as_str()) {
                cases.push(&row.case);
            }
            if !quantities.contains(&row.quantity.as_str()) {
                quantities.push(&row.quantity);
            }
        }
        let mut header = vec!["case".to_owned()];
        header.extend(quantities.iter().map(|&q| q.to_owned()));
        let mut grid = vec![header];
        grid.extend(cases.iter().map(|&case| {
            let mut line = vec![String::new(); quantities.len() + 1];
            line[0] = case.to_owned();
            line
        }));
        let mut notes = Vec::new();
        for row in &self.rows {
            let i = cases.iter().position(|&c| c == row.case).unwrap_or(0);
            let j = quantities
                .iter()
                .position(|&q| q == row.quantity)
                .unwrap_or(0);
            let cell = &mut grid[i + 1][j + 1];
            let separator = if cell.is_empty() { "" } else { " | " };
            let _ = write!(cell, "{separator}{}", number(row.value));
            let note = match row.verdict {
                Verdict::Pass => {
                    continue;
                }
                Verdict::Short => {
                    cell.push_str(" S");
                    format!(
                        "S  {}, {}: {} {}",
                        row.case,
                        row.quantity,
                        number(row.value),
                        row.limit_text()
                    )
                }
                Verdict::Warned => {
                    cell.push_str(" W");
                    format!("W  {}, {}", row.case, row.quantity)
                }
                Verdict::Refused => {
                    cell.push_str(" R");
                    format!("R  {}, {}", row.case, row.quantity)
                }
                Verdict::Differs => {
                    cell.push_str(" D");
                    format!("D  {}, {}", row.case, row.quantity)
                }
            };
            notes.push(match &row.reason {
                Some(reason) => format!("{note}: {reason}"),
                None => note,
            });
        }
        (grid, notes)
    }
}

/// Format in which a command prints its tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// Text for people.
    #[default]
    Text,
    /// One JSON array of all rows.
    Json,
}

/// The tables as one text or as one JSON array of all their rows.
pub fn render(tables: &[Table], format: Format) -> String {
    match format {
        Format::Text => tables
            .iter()
            .map(Table::text)
            .collect::<Vec<_>>()
            .join("\n"),
        Format::Json => {
            // one row per line: readable, and a cut file still shows whole rows
            let rows: Vec<String> = tables
                .iter()
                .flat_map(|t| &t.rows)
                .map(|row| format!("  {}", row_json(row)))
                .collect();
            format!("[\n{}\n]\n", rows.join(",\n"))
        }
    }
}

fn row_json(row: &TableRow) -> String {
    // a row holds only strings and numbers, which always serialise
    serde_json::to_string(row).unwrap_or_else(|_| "null".to_owned())
}

/// The exit status of a command: 1 if any row is short, else 0.
pub fn exit_code(tables: &[Table]) -> u8 {
    u8::from(tables.iter().any(|t| t.count(Verdict::Short) > 0))
}

/// A number for people: integers whole, others with four significant digits.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        return if value.is_nan() {
            "-".to_owned()
        } else {
            value.to_string()
        };
    }
    if value.fract() == 0.0 && size < 1e12 {
        return (value as i64).to_string();
    }
    if (1e-2..1e5).contains(&size) {
        let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
        return format!("{value:.decimals$}");
    }
    format!("{value:.3e}")
}

/// Lines of words in columns; all but the first column to the right, unless they hold words.
pub fn aligned(grid: &[Vec<String>]) -> String {
    let columns = grid.first().map_or(0, Vec::len);
    let width = |j: usize| grid.iter().map(|l| l[j].chars().count()).max().unwrap_or(0);
    let numeric = |j: usize| {
        grid.iter().skip(1).all(|l| {
            l[j].is_empty() || l[j].starts_with(|c: char| c.is_ascii_digit() || "-<>+".contains(c))
        })
    };
    let layout: Vec<(usize, bool)> = (0..columns)
        .map(|j| (width(j), j > 0 && numeric(j)))
        .collect();
    let mut text = String::new();
    for (i, line) in grid.iter().enumerate() {
        let words: Vec<String> = line
            .iter()
            .zip(&layout)
            .map(|(word, &(w, right))| {
                if right {
                    format!("{word:>w$}")
                } else {
                    format!("{word:<w$}")
                }
            })
            .collect();
        text.push_str(words.join("  ").trim_end());
        text.push('\n');
        if i == 0 {
            let rule: Vec<String> = layout.iter().map(|&(w, _)| "-".repeat(w)).collect();
            text.push_str(&rule.join("  "));
            text.push('\n');
        }
    }
    text
}

/// A whole number in groups of three digits.
pub fn grouped(value: usize) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(c);
    }
    text
}

/// The components of a force in words.
pub(crate) fn components(force: &[f64]) -> String {
    let words: Vec<String> = force.iter().map(|&v| number(v)).collect();
    words.join(", ")
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod tests;
