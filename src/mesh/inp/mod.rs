//! Decks of Abaqus and CalculiX (`.inp`): nodes, elements, sets, surfaces, parts and their instances.
//!
//! Sources: Abaqus Keywords Reference Guide; CalculiX CrunchiX user's manual, "Input deck format". Materials, conditions and
//! steps are left out with a note; keywords that would make or move nodes and are not read are refused.
//!
//! Element sets become sets of cells and facets by the dimension of their elements, surfaces of elements facet sets, node sets
//! and surfaces of nodes node sets. A set of an instance is called `instance.set`. Keywords and names do not mind capitals; a
//! set has the name under which it is first mentioned.
//!
//! | file | what |
//! |---|---|
//! | `text.rs` | included files, keyword lines |
//! | `kinds.rs` | types of elements, their faces |
//! | `body.rs` | content of a part or an instance |
//! | `sets.rs` | the keywords of sets and surfaces |
//! | `join.rs` | from bodies to a mesh |

mod body;
mod join;
mod kinds;
mod sets;
mod text;

use std::collections::BTreeMap;
use std::path::Path;

use body::{Body, Element, Members, Motion, Node, THIS};
use kinds::kind;
pub(super) use text::load;
use text::{Card, REWRITE, bytes_of_line};

use super::MeshError;
use super::raw::{Encoding, Piece, RawMesh, Source};

/// The largest number of a node or an element.
const MOST: u64 = 999_999_999;

/// Keywords that make or move nodes and elements.
const REFUSED: [&str; 14] = [
    "NGEN",
    "NFILL",
    "NCOPY",
    "NMAP",
    "ELGEN",
    "ELCOPY",
    "SYSTEM",
    "IMPERFECTION",
    "IMPORT",
    "PARAMETER",
    "SYMMETRICMODELGENERATION",
    "USERELEMENT",
    "SUBSTRUCTUREPATH",
    "MODELDEFINITION",
];

/// Keywords that say nothing, or that another keyword has dealt with.
const SILENT: [&str; 4] = ["HEADING", "PREPRINT", "INCLUDE", "ENDSTEP"];

/// Parses a deck whose included files are in `bytes`.
///
/// Elements of the types `ignore` are left out.
///
/// # Errors
/// See [`MeshError`].
pub(super) fn parse<'a>(
    path: &Path,
    (bytes, pieces): (&'a [u8], &'a [Piece]),
    ignore: &[String],
) -> Result<(RawMesh, Source<'a>), MeshError> {
    let mut reader = Reader {
        source: Source {
            path: path.into(),
            bytes,
            encoding: Encoding::Text,
            pieces,
        },
        at: 0,
        scope: Scope::Model,
        parts: Vec::new(),
        bodies: vec![Body::default()],
        ignored: BTreeMap::new(),
        axisymmetric: None,
        waiting: Vec::new(),
        sections: Vec::new(),
        unwanted: (ignore.iter())
            .map(|word| (word.to_ascii_uppercase(), 0))
            .collect(),
    };
    reader.deck()?;
    let raw = join::join(&reader)?;
    Ok((raw, reader.source))
}

/// Owner of nodes, elements and sets.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scope {
    Model,
    Part(usize),
    Instance(usize),
}

struct Reader<'a> {
    source: Source<'a>,
    at: usize,
    scope: Scope,
    parts: Vec<Body>,
    /// The model itself, then the instances.
    bodies: Vec<Body>,
    /// Keywords that are left out, with the bytes where they stand.
    ignored: BTreeMap<String, Vec<usize>>,
    /// Position of the first axisymmetric elements.
    axisymmetric: Option<usize>,
    /// Sets and surfaces that name what stands below them.
    waiting: Vec<Waiting>,
    /// Sets that a section gives a stiffness, with the keyword and the byte where it stands.
    sections: Vec<(Scope, &'a str, usize)>,
    /// Types of elements that are left out, in capitals, and how many there are.
    unwanted: Vec<(String, usize)>,
}

/// A set or a surface that could not be read yet.
struct Waiting {
    scope: Scope,
    /// Byte where it stands.
    at: usize,
    error: MeshError,
}

impl<'a> Reader<'a> {
    fn deck(&mut self) -> Result<(), MeshError> {
        if let Some((at, line)) = self.data()? {
            return Err(self.syntax(at, line, "a keyword such as *NODE"));
        }
        while self.at < self.source.bytes.len() {
            let card = Card::read(&self.source, self.at)?;
            self.at = card.next;
            self.card(&card)?;
            self.skip_data();
        }
        self.end_scope()?;
        self.read_waiting()?;
        match (self.parts.first(), self.bodies.len()) {
            (Some(part), 1) => Err(MeshError::Unsupported {
                path: self.source.path.clone(),
                place: self.source.place(self.source.bytes.len()),
                what: format!(
                    "a deck whose parts (the first: {}) no *INSTANCE places",
                    part.name
                ),
                remedy: "write the assembly too, or the nodes and elements without *PART",
            }),
            _ => Ok(()),
        }
    }

    fn card(&mut self, card: &Card<'a>) -> Result<(), MeshError> {
        match card.keyword.as_str() {
            "NODE" => self.nodes(card),
            "ELEMENT" => self.elements(card),
            "NSET" | "ELSET" | "SURFACE" => {
                if let Err(error) = self.set_or_surface(card) {
                    self.waiting.push(Waiting {
                        scope: self.scope,
                        at: card.at,
                        error,
                    });
                }
                Ok(())
            }
            "PART" => self.part(card),
            "INSTANCE" => self.instance(card),
            "ASSEMBLY" | "ENDASSEMBLY" | "ENDPART" | "ENDINSTANCE" => {
                self.end_scope()
            }
            word if SILENT.contains(&word) => Ok(()),
            word if REFUSED.contains(&word) => Err(self.unsupported(
                card.at,
                &format!("*{word}"),
                "it changes nodes or elements: write the deck with all of them, as a preprocessor does",
            )),
            word => {
                if let Some(set) = card.get("ELSET").filter(|_| word.ends_with("SECTION")) {
                    self.sections.push((self.scope, set, card.at));
                }
                self.ignore(word.into(), card.at);
                Ok(())
            }
        }
    }

    fn ignore(&mut self, keyword: String, at: usize) {
        self.ignored.entry(keyword).or_default().push(at);
    }

    fn part(&mut self, card: &Card) -> Result<(), MeshError> {
        let name = card.required("NAME", &self.source)?;
        if self
            .parts
            .iter()
            .any(|part| body::key(&part.name) == body::key(name))
        {
            return Err(self.syntax(card.at, name, "a part of another name"));
        }
        self.parts.push(Body {
            name: name.into(),
            ..Body::default()
        });
        self.scope = Scope::Part(self.parts.len() - 1);
        Ok(())
    }

    fn instance(&mut self, card: &Card) -> Result<(), MeshError> {
        self.end_scope()?;
        if card.get("LIBRARY").is_some() {
            return Err(self.unsupported(
                card.at,
                "an instance from another analysis (LIBRARY)",
                "write its part into this deck",
            ));
        }
        let name = card.required("NAME", &self.source)?;
        if self.find_instance(name).is_some() {
            return Err(self.syntax(card.at, name, "an instance of another name"));
        }
        let part = card.required("PART", &self.source)?;
        let same = |body: &&Body| body::key(&body.name) == body::key(part);
        let Some(part) = self.parts.iter().find(same) else {
            return Err(self.syntax(card.at, part, "the name of a part above"));
        };
        let mut body = part.clone();
        body.name = name.trim_matches('"').into();
        body.motion = self.motion()?;
        self.bodies.push(body);
        self.scope = Scope::Instance(self.bodies.len() - 1);
        Ok(())
    }

    /// The translation and the rotation of an instance, from its data lines.
    fn motion(&mut self) -> Result<Option<Motion>, MeshError> {
        let mut found = None;
        for (wanted, count) in [
            ("a translation of three numbers", 3),
            ("two points of the axis and an angle", 7),
        ] {
            let Some((at, line)) = self.data()? else {
                break;
            };
            let mut numbers: Vec<f64> = fields(line)
                .map(|word| self.real(at, word))
                .collect::<Result<_, _>>()?;
            if count == 3 && (1..3).contains(&numbers.len()) {
                // what a card leaves out is zero
                numbers.resize(3, 0.0);
            }
            let motion = found.get_or_insert(Motion::default());
            match (count, &numbers[..]) {
                (3, &[x, y, z]) => motion.translation = [x, y, z],
                (7, &[a, b, c, d, e, f, angle]) if [a, b, c] != [d, e, f] => {
                    motion.rotation = Some(([a, b, c], [d, e, f], angle));
                }
                _ => return Err(self.syntax(at, line, wanted)),
            }
        }
        Ok(found)
    }

    /// Ends a part or an instance.
    fn end_scope(&mut self) -> Result<(), MeshError> {
        if self.scope != Scope::Model {
            self.read_waiting()?;
        }
        if let Scope::Instance(i) = self.scope {
            self.bodies[i].number(i as u32);
        }
        self.scope = Scope::Model;
        Ok(())
    }

    fn find_instance(&self, name: &str) -> Option<usize> {
        let mut bodies = self.bodies.iter().skip(1);
        bodies
            .position(|body| body::key(&body.name) == body::key(name))
            .map(|i| i + 1)
    }

    /// The body that is being read.
    fn body(&mut self) -> &mut Body {
        match self.scope {
            Scope::Model => &mut self.bodies[0],
            Scope::Part(i) => &mut self.parts[i],
            Scope::Instance(i) => &mut self.bodies[i],
        }
    }

    /// Its number in sets.
    fn own(&self) -> u32 {
        if self.scope == Scope::Model { 0 } else { THIS }
    }

    fn nodes(&mut self, card: &Card) -> Result<(), MeshError> {
        if card
            .get("SYSTEM")
            .is_some_and(|s| !s.eq_ignore_ascii_case("R"))
        {
            return Err(self.unsupported(
                card.at,
                "*NODE with SYSTEM=C or S (cylindrical or spherical coordinates)",
                "write rectangular coordinates",
            ));
        }
        let set = card.get("NSET");
        let body = self.own();
        while let Some((at, line)) = self.data()? {
            let mut words = fields(line);
            let number = self.number(at, words.next().unwrap_or(""), "the number of a node")?;
            let mut x = [0.0; 3];
            for (k, word) in words.enumerate() {
                match x.get_mut(k) {
                    // what is left out is zero
                    Some(x) if !word.is_empty() => *x = self.real(at, word)?,
                    None if k >= 6 => {
                        return Err(self.syntax(
                            at,
                            line,
                            "at most three coordinates and a normal",
                        ));
                    }
                    _ => {}
                }
            }
            let place = self.body().nodes.len() as u32;
            if let Some(first) = self.body().node_places.insert(number, place) {
                let first = self.body().nodes[first as usize].at;
                return Err(MeshError::DuplicateTag {
                    path: self.source.file(at),
                    place: self.source.place(at),
                    node: number,
                    first: self.source.place(first),
                });
            }
            self.body().nodes.push(Node { number, x, at });
            if let Some(set) = set {
                self.body().node_sets.entry(set).push(one(body, number, at));
            }
        }
        Ok(())
    }

    fn elements(&mut self, card: &Card) -> Result<(), MeshError> {
        let word = card.required("TYPE", &self.source)?.to_ascii_uppercase();
        if word.starts_with("CAX") {
            self.axisymmetric.get_or_insert(card.at);
        }
        let set = card.get("ELSET");
        let body = self.own();
        let mut numbers: Vec<u64> = Vec::new();
        while let Some((at, line)) = self.data()? {
            numbers.clear();
            self.numbers(at, line, &mut numbers)?;
            let Some(&number) = numbers.first() else {
                return Err(self.syntax(at, line, "the number of an element"));
            };
            if let Some(unwanted) = self.unwanted.iter_mut().find(|(own, _)| *own == word) {
                unwanted.1 += 1;
                self.skip_element(line)?;
                let element = Element::left_out(number, at);
                self.element(element, &[])?;
                self.add_to_set(set, one(body, number, at));
                continue;
            }
            let kind = kind(&word).map_err(|(name, remedy)| MeshError::UnsupportedElement {
                path: self.source.file(at),
                place: self.source.place(at),
                element: number,
                kind: word.clone(),
                name,
                remedy,
            })?;
            let wanted = 1 + kind.shape.node_count();
            while numbers.len() < wanted {
                let Some((at, line)) = self.data()? else {
                    break;
                };
                self.numbers(at, line, &mut numbers)?;
            }
            if numbers.len() != wanted {
                return Err(self.syntax(
                    at,
                    &format!(
                        "element {number} of type {word} with {} nodes",
                        numbers.len() - 1
                    ),
                    &(wanted - 1).to_string(),
                ));
            }
            self.element(
                Element {
                    number,
                    kind,
                    start: 0,
                    at,
                },
                &numbers[1..],
            )?;
            self.add_to_set(set, one(body, number, at));
        }
        Ok(())
    }

    /// Passes over the other lines of an element, of any number of nodes.
    fn skip_element(&mut self, first: &str) -> Result<(), MeshError> {
        let mut goes_on = first.ends_with(',');
        while goes_on {
            goes_on = (self.data()?).is_some_and(|(_, line)| line.ends_with(','));
        }
        Ok(())
    }

    fn add_to_set(&mut self, set: Option<&str>, member: Members) {
        if let Some(set) = set {
            self.body().element_sets.entry(set).push(member);
        }
    }

    fn element(&mut self, mut element: Element, nodes: &[u64]) -> Result<(), MeshError> {
        let body = self.body();
        element.start = body.element_nodes.len();
        let place = body.elements.len() as u32;
        if let Some(first) = body.element_places.insert(element.number, place) {
            let first = body.elements[first as usize].at;
            return Err(MeshError::DuplicateElementNumber {
                path: self.source.file(element.at),
                place: self.source.place(element.at),
                element: element.number,
                first: self.source.place(first),
            });
        }
        body.element_nodes.extend_from_slice(nodes);
        body.elements.push(element);
        Ok(())
    }

    /// The next data line of the keyword; comments and empty lines are skipped.
    fn data(&mut self) -> Result<Option<(usize, &'a str)>, MeshError> {
        loop {
            let at = self.at;
            let bytes: &'a [u8] = self.source.bytes;
            if at >= bytes.len() {
                return Ok(None);
            }
            let (line, next) = bytes_of_line(bytes, at);
            if line.starts_with(b"*") && !line.starts_with(b"**") {
                return Ok(None);
            }
            self.at = next;
            if !line.is_empty() && !line.starts_with(b"*") {
                return Ok(Some((at, text::text(&self.source, at, line)?)));
            }
        }
    }

    /// Skips the rest of the keyword's lines, whatever they hold.
    fn skip_data(&mut self) {
        let bytes = self.source.bytes;
        while self.at < bytes.len() {
            let (line, next) = bytes_of_line(bytes, self.at);
            if line.starts_with(b"*") && !line.starts_with(b"**") {
                return;
            }
            self.at = next;
        }
    }

    /// The numbers of a line.
    fn numbers(&self, at: usize, line: &str, into: &mut Vec<u64>) -> Result<(), MeshError> {
        for word in fields(line) {
            into.push(self.number(at, word, "the number of a node or an element")?);
        }
        Ok(())
    }

    fn number(&self, at: usize, word: &str, wanted: &str) -> Result<u64, MeshError> {
        match word.parse() {
            Ok(number) if (1..=MOST).contains(&number) => Ok(number),
            _ => Err(self.syntax(at, word, &format!("{wanted}, from 1 to {MOST},"))),
        }
    }

    /// A real number, its exponent after E or Fortran's D.
    fn real(&self, at: usize, word: &str) -> Result<f64, MeshError> {
        let value = word
            .parse()
            .or_else(|_| word.replace(['d', 'D'], "e").parse());
        match value {
            Ok(value) if f64::is_finite(value) => Ok(value),
            _ => Err(self.syntax(at, word, "a finite number")),
        }
    }

    fn syntax(&self, at: usize, found: &str, wanted: &str) -> MeshError {
        self.source.syntax(at, found, wanted, REWRITE)
    }

    fn unsupported(&self, at: usize, what: &str, remedy: &'static str) -> MeshError {
        MeshError::Unsupported {
            path: self.source.file(at),
            place: self.source.place(at),
            what: what.into(),
            remedy,
        }
    }
}

/// A single member of a set.
fn one(body: u32, number: u64, at: usize) -> Members {
    Members {
        body,
        first: number,
        last: number,
        step: 1,
        range: false,
        at,
    }
}

/// The fields of a data line; commas at its end begin no more.
fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.trim_end_matches([',', ' ', '\t'])
        .split(',')
        .map(str::trim)
}

#[cfg(test)]
mod tests;
