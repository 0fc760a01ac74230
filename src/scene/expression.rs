//! Expressions in `x`, `y`, `z` and the time `t`, as scenes write them: `"-1e-3 * x^2"`, `"if(t < 1e-6, 1, exp(-x))"`.
//!
//! Precedence is that of written mathematics: `-x^2` is `-(x^2)` and `2^3^2` is `2^(3^2)`. A crate that read either
//! otherwise would set a wrong boundary condition without a word, so this parser is our own. Measured at `x = 3`:
//!
//! | crate | `-x^2` | `2^3^2` | error of `x+*2` |
//! |---|---|---|---|
//! | exmex 0.20.5, also with operators and priorities of one's own | 9 | 64 | no position |
//! | fasteval 0.2.4 (2020) | 9 | 512 | no position |
//! | meval 0.2.0 (2018; nom 1) | -9 | 512 | a position; `foo(2)` is read as right |
//! | this one | -9 | 512 | the character |
//!
//! In exmex a unary operator binds before any binary one and equal priorities associate to the left, whatever a custom
//! operator factory says; evalexpr is under the AGPL.

use std::fmt;

use super::function::Function;
use super::source::Span;
use super::table::{self, Table};

/// The deepest nesting of brackets, signs and powers that is read; deeper input is refused before it exhausts the stack.
const DEEPEST: usize = 64;

/// The longest expression that is read \[bytes\]: a sum of some hundred thousand terms. It is evaluated at every place and step.
const LONGEST: usize = 1 << 20;

/// The number of the variable `t` beside those of the axes.
const TIME: usize = 3;

/// A parsed expression in `x`, `y`, `z` and `t`.
#[derive(Clone)]
pub struct Expression {
    /// The expression as typed.
    pub text: String,
    /// Span in the text of the scene.
    pub span: Span,
    root: Term,
    /// The tables that it may name.
    tables: Vec<Table>,
    /// The time at which it is evaluated whatever the time is; none if it follows the time.
    held_at: Option<f64>,
}

impl fmt::Debug for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Expression({:?})", self.text)
    }
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Error in the text of an expression.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("in the expression `{text}`, character {at}: {what}")]
pub struct ExpressionError {
    /// The expression.
    pub text: String,
    /// The character where reading stopped, counted from one.
    pub at: usize,
    /// Description of the mistake, and what to write instead.
    pub what: String,
}

#[derive(Clone)]
enum Term {
    Constant(f64),
    Variable(usize),
    Unary(Unary, Box<Term>),
    Binary(Binary, Box<Term>, Box<Term>),
    /// Operators of one precedence, applied from left to right: as a list, so that a long sum nests no deeper than a short one.
    Chain(Box<Term>, Vec<(Binary, Term)>),
    If(Box<[Term; 3]>),
    /// A table at an argument.
    Table(Table, Box<Term>),
    /// A function of a program; it stands alone.
    Function(Function),
}

type Unary = fn(f64) -> f64;
type Binary = fn(f64, f64) -> f64;

/// The functions of one argument, by name.
const UNARY: &[(&str, Unary)] = &[
    ("abs", f64::abs),
    ("acos", f64::acos),
    ("asin", f64::asin),
    ("atan", f64::atan),
    ("cbrt", f64::cbrt),
    ("ceil", f64::ceil),
    ("cos", f64::cos),
    ("cosh", f64::cosh),
    ("exp", f64::exp),
    ("floor", f64::floor),
    ("ln", f64::ln),
    ("log10", f64::log10),
    ("sign", sign),
    ("sin", f64::sin),
    ("sinh", f64::sinh),
    ("sqrt", f64::sqrt),
    ("tan", f64::tan),
    ("tanh", f64::tanh),
];

/// The sign of a number: 0 of zero, of either sign, unlike [`f64::signum`].
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// The functions of two arguments, by name.
const BINARY: &[(&str, Binary)] = &[
    ("atan2", f64::atan2),
    ("hypot", f64::hypot),
    ("max", f64::max),
    ("min", f64::min),
];

/// Returns true if a name is that of a variable, a constant or a function.
pub(crate) fn knows(name: &str) -> bool {
    let is_variable = matches!(name, "x" | "y" | "z" | "t" | "pi" | "if");
    is_variable || UNARY.iter().any(|(n, _)| *n == name) || BINARY.iter().any(|(n, _)| *n == name)
}

impl Expression {
    /// Reads an expression in `x`, `y`, `z` and `t`, and in the tables of the scene that is read at present.
    ///
    /// # Errors
    /// [`ExpressionError`] with the character where the text stops making sense.
    pub fn parse(text: &str) -> Result<Self, ExpressionError> {
        Self::parse_with(text, &table::in_scope())
    }

    /// As [`Expression::parse`], with these tables.
    pub(crate) fn parse_with(text: &str, tables: &[Table]) -> Result<Self, ExpressionError> {
        let mut parser = Parser {
            text,
            at: 0,
            depth: 0,
            tables,
        };
        if text.len() > LONGEST {
            return Err(ExpressionError {
                text: format!("{} …", text.chars().take(40).collect::<String>()),
                at: text.chars().count(),
                what: format!(
                    "{} bytes are longer than the {LONGEST} that are read; use functions such as exp or if, or several conditions",
                    text.len()
                ),
            });
        }
        let root = parser.comparison()?;
        parser.skip_blanks();
        if parser.at < text.len() {
            let is_word = text[parser.at..].starts_with(char::is_alphabetic);
            return Err(parser.error(match is_word && matches!(root, Term::Constant(_)) {
                true => "a number has no unit here: type it in the units of the scene, which are yours and consistent throughout; between factors an operator such as `*` is missing",
                false => "an operator such as `*` is missing here, or this is one bracket too many",
            }));
        }
        Ok(Self {
            text: text.to_owned(),
            span: Span::default(),
            root,
            tables: tables.to_vec(),
            held_at: None,
        })
    }

    /// The expression that is `value` everywhere.
    pub fn constant(value: f64) -> Self {
        Self {
            text: value.to_string(),
            span: Span::default(),
            root: Term::Constant(value),
            tables: Vec::new(),
            held_at: None,
        }
    }

    /// A function of a program, for which `text` stands in the scene.
    pub(crate) fn of_function(text: &str, function: Function) -> Self {
        Self {
            text: text.to_owned(),
            span: Span::default(),
            root: Term::Function(function),
            tables: Vec::new(),
            held_at: None,
        }
    }

    /// The function of a program that this is, if it is one.
    pub fn function(&self) -> Option<&Function> {
        match &self.root {
            Term::Function(function) => Some(function),
            _ => None,
        }
    }

    /// The tables that it may name.
    pub(crate) fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// The values at some positions (components beyond the dimension are zero) at the time `t`.
    pub fn values_at(&self, places: &[[f64; 3]], t: f64) -> Vec<f64> {
        let t = self.held_at.unwrap_or(t);
        match &self.root {
            Term::Function(function) => function.values(places, t),
            _ => places.iter().map(|x| self.eval_at(x, t)).collect(),
        }
    }

    /// The time at which it is held, if it is.
    pub(crate) fn held(&self) -> Option<f64> {
        self.held_at
    }

    /// The same expression with the values that it has at the time `t`, at any time.
    pub(crate) fn held_at(mut self, t: f64) -> Self {
        // the first to hold it holds it for good
        self.held_at.get_or_insert(t);
        self
    }

    /// The same expression, found at `span`.
    pub fn at(mut self, span: Span) -> Self {
        self.span = span;
        self
    }

    /// The value at the position `x` (components beyond the dimension are zero) at time zero.
    pub fn eval(&self, x: &[f64; 3]) -> f64 {
        self.eval_at(x, 0.0)
    }

    /// The value at the position `x` (components beyond the dimension are zero) and the time `t`.
    pub fn eval_at(&self, x: &[f64; 3], t: f64) -> f64 {
        self.root
            .eval(&[x[0], x[1], x[2], self.held_at.unwrap_or(t)])
    }

    /// The value, if the expression has no variable and no table.
    pub fn as_constant(&self) -> Option<f64> {
        (!self.root.has_table() && (0..=TIME).all(|variable| !self.depends_on(variable)))
            .then(|| self.eval(&[0.0; 3]))
    }

    /// Returns true if the time `t` appears.
    pub fn depends_on_time(&self) -> bool {
        self.depends_on(TIME)
    }

    /// Returns true if a coordinate appears.
    pub fn depends_on_position(&self) -> bool {
        (0..TIME).any(|axis| self.depends_on(axis))
    }

    /// Returns true if the variable of `axis` (0 for `x`, 1 for `y`, 2 for `z`, 3 for `t`) appears.
    pub fn depends_on(&self, axis: usize) -> bool {
        !(axis == TIME && self.held_at.is_some()) && self.root.depends_on(axis)
    }
}

impl Term {
    fn eval(&self, x: &[f64; 4]) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Variable(axis) => x[*axis],
            Self::Unary(f, a) => f(a.eval(x)),
            Self::Binary(f, a, b) => f(a.eval(x), b.eval(x)),
            Self::Chain(first, rest) => rest
                .iter()
                .fold(first.eval(x), |left, (f, term)| f(left, term.eval(x))),
            Self::If(parts) => {
                let chosen = if parts[0].eval(x) != 0.0 { 1 } else { 2 };
                parts[chosen].eval(x)
            }
            Self::Table(table, argument) => table.at(argument.eval(x)),
            Self::Function(function) => function.values(&[[x[0], x[1], x[2]]], x[TIME])[0],
        }
    }

    fn has_table(&self) -> bool {
        match self {
            Self::Table(..) => true,
            Self::Constant(_) | Self::Variable(_) | Self::Function(_) => false,
            Self::Unary(_, a) => a.has_table(),
            Self::Binary(_, a, b) => a.has_table() || b.has_table(),
            Self::Chain(first, rest) => {
                first.has_table() || rest.iter().any(|(_, term)| term.has_table())
            }
            Self::If(parts) => parts.iter().any(Self::has_table),
        }
    }

    fn depends_on(&self, axis: usize) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::Variable(a) => *a == axis,
            Self::Unary(_, a) | Self::Table(_, a) => a.depends_on(axis),
            Self::Binary(_, a, b) => a.depends_on(axis) || b.depends_on(axis),
            Self::Chain(first, rest) => {
                first.depends_on(axis) || rest.iter().any(|(_, term)| term.depends_on(axis))
            }
            Self::If(parts) => parts.iter().any(|p| p.depends_on(axis)),
            Self::Function(function) if axis == TIME => function.depends_on_time(),
            Self::Function(function) => function.depends_on_position(),
        }
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    tables: &'a [Table],
}

impl Parser<'_> {
    fn error(&self, what: impl Into<String>) -> ExpressionError {
        ExpressionError {
            text: self.text.to_owned(),
            at: self.text[..self.at].chars().count() + 1,
            what: what.into(),
        }
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn skip_blanks(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    /// Consumes the first of `tokens` that stands here.
    fn take<'t>(&mut self, tokens: &[&'t str]) -> Option<&'t str> {
        self.skip_blanks();
        let found = tokens
            .iter()
            .copied()
            .find(|t| self.rest().starts_with(t))?;
        self.at += found.len();
        Some(found)
    }

    fn expect(&mut self, token: &str) -> Result<(), ExpressionError> {
        match self.take(&[token]) {
            Some(_) => Ok(()),
            None => Err(self.error(format!("expected `{token}`"))),
        }
    }

    fn comparison(&mut self) -> Result<Term, ExpressionError> {
        let left = self.sum()?;
        let f: Binary = match self.take(&["<=", ">=", "<", ">"]) {
            None => return Ok(left),
            Some("<=") => |a, b| f64::from(u8::from(a <= b)),
            Some(">=") => |a, b| f64::from(u8::from(a >= b)),
            Some("<") => |a, b| f64::from(u8::from(a < b)),
            Some(_) => |a, b| f64::from(u8::from(a > b)),
        };
        Ok(binary(f, left, self.sum()?))
    }

    fn sum(&mut self) -> Result<Term, ExpressionError> {
        let first = self.product()?;
        let mut rest: Vec<(Binary, Term)> = Vec::new();
        while let Some(sign) = self.take(&["+", "-"]) {
            let f: Binary = if sign == "+" {
                |a, b| a + b
            } else {
                |a, b| a - b
            };
            rest.push((f, self.product()?));
        }
        Ok(chain(first, rest))
    }

    fn product(&mut self) -> Result<Term, ExpressionError> {
        let first = self.signed()?;
        let mut rest: Vec<(Binary, Term)> = Vec::new();
        while let Some(sign) = self.take(&["*", "/"]) {
            let f: Binary = if sign == "*" {
                |a, b| a * b
            } else {
                |a, b| a / b
            };
            rest.push((f, self.signed()?));
        }
        Ok(chain(first, rest))
    }

    fn signed(&mut self) -> Result<Term, ExpressionError> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.error(format!(
                "nested more than {DEEPEST} deep; take some brackets, signs or powers apart"
            )));
        }
        let term = match self.take(&["+", "-"]) {
            Some("-") => Term::Unary(|a| -a, Box::new(self.signed()?)),
            Some(_) => self.signed()?,
            None => self.power()?,
        };
        self.depth -= 1;
        Ok(term)
    }

    fn power(&mut self) -> Result<Term, ExpressionError> {
        let base = self.atom()?;
        if self.take(&["**", "^"]).is_none() {
            return Ok(base);
        }
        let exponent = self.signed()?;
        // an integer power by multiplication: exact for small bases, and defined for negative ones
        if let Term::Constant(n) = exponent
            && n == 2.0
        {
            return Ok(Term::Unary(|a| a * a, Box::new(base)));
        }
        Ok(binary(f64::powf, base, exponent))
    }

    fn atom(&mut self) -> Result<Term, ExpressionError> {
        if self.take(&["("]).is_some() {
            let inner = self.comparison()?;
            self.expect(")")?;
            return Ok(inner);
        }
        let first = self.rest().chars().next();
        match first {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name(),
            Some(c) => Err(self.error(format!(
                "a number, x, y, z, t or a bracket is expected, not `{c}`"
            ))),
            None => Err(self
                .error("the expression ends where a number, x, y, z, t or a bracket is expected")),
        }
    }

    fn number(&mut self) -> Result<Term, ExpressionError> {
        let bytes = self.rest().as_bytes();
        let digits = |from: usize| {
            from + bytes[from..]
                .iter()
                .take_while(|b| b.is_ascii_digit() || **b == b'.')
                .count()
        };
        let mut end = digits(0);
        if bytes.get(end).is_some_and(|b| matches!(b, b'e' | b'E')) {
            let sign = usize::from(bytes.get(end + 1).is_some_and(|b| matches!(b, b'+' | b'-')));
            let exponent = digits(end + 1 + sign);
            if exponent > end + 1 + sign {
                end = exponent;
            }
        }
        let text = &self.rest()[..end];
        let value = text
            .parse()
            .map_err(|_| self.error(format!("`{text}` is no number")))?;
        self.at += end;
        Ok(Term::Constant(value))
    }

    fn name(&mut self) -> Result<Term, ExpressionError> {
        let rest = self.rest();
        let length = rest
            .find(|c: char| !(c.is_alphanumeric() || c == '_'))
            .unwrap_or(rest.len());
        let name = rest[..length].to_owned();
        match name.as_str() {
            "x" => return Ok(self.advance(length, Term::Variable(0))),
            "y" => return Ok(self.advance(length, Term::Variable(1))),
            "z" => return Ok(self.advance(length, Term::Variable(2))),
            "pi" => return Ok(self.advance(length, Term::Constant(std::f64::consts::PI))),
            "t" => return Ok(self.advance(length, Term::Variable(TIME))),
            _ => {}
        }
        if let Some(table) = self.tables.iter().find(|t| t.name() == name) {
            self.at += length;
            self.expect("(")?;
            let argument = self.comparison()?;
            self.expect(")")?;
            return Ok(Term::Table(table.clone(), Box::new(argument)));
        }
        let unary = UNARY.iter().find(|(n, _)| *n == name);
        let two = BINARY.iter().find(|(n, _)| *n == name);
        if unary.is_none() && two.is_none() && name != "if" {
            let known = UNARY
                .iter()
                .map(|(n, _)| *n)
                .chain(BINARY.iter().map(|(n, _)| *n))
                .collect::<Vec<_>>()
                .join(", ");
            let tables: Vec<&str> = self.tables.iter().map(Table::name).collect();
            let tables = match tables.is_empty() {
                true => String::new(),
                false => format!("; the tables are {}", tables.join(", ")),
            };
            return Err(self.error(format!(
                "`{name}` is unknown; the variables are x, y, z, t, the constant is pi, the functions are {known} and if{tables}"
            )));
        }
        self.at += length;
        self.expect("(")?;
        let first = self.comparison()?;
        let term = if let Some((_, f)) = unary {
            Term::Unary(*f, Box::new(first))
        } else {
            self.expect(",")?;
            let second = self.comparison()?;
            if let Some((_, f)) = two {
                binary(*f, first, second)
            } else {
                self.expect(",")?;
                let third = self.comparison()?;
                Term::If(Box::new([first, second, third]))
            }
        };
        self.expect(")")?;
        Ok(term)
    }

    fn advance(&mut self, length: usize, term: Term) -> Term {
        self.at += length;
        term
    }
}

fn binary(f: Binary, a: Term, b: Term) -> Term {
    Term::Binary(f, Box::new(a), Box::new(b))
}

/// Terms that are joined from left to right.
fn chain(first: Term, mut rest: Vec<(Binary, Term)>) -> Term {
    if rest.len() > 1 {
        return Term::Chain(Box::new(first), rest);
    }
    match rest.pop() {
        Some((f, second)) => binary(f, first, second),
        None => first,
    }
}

#[cfg(test)]
#[path = "expression_tests.rs"]
mod tests;
