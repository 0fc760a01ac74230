//! The keywords of sets and surfaces.

use super::body::{Members, Sets, Sides, key};
use super::kinds::Face;
use super::text::Card;
use super::{Reader, Waiting, fields, one};
use crate::mesh::MeshError;

/// Kind of a set's members.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Of {
    Nodes,
    Elements,
}

impl<'a> Reader<'a> {
    /// `*NSET`, `*ELSET` or `*SURFACE`, as far as what it names stands above.
    ///
    /// # Errors
    /// [`MeshError`], among them that of a name that may stand below; nothing is read then.
    pub(super) fn set_or_surface(&mut self, card: &Card<'a>) -> Result<(), MeshError> {
        match card.keyword.as_str() {
            "SURFACE" => self.surface(card),
            _ => self.set(card),
        }
    }

    /// Reads the sets and surfaces of the scope at hand that waited for what stands below them.
    ///
    /// # Errors
    /// That of the first one that names what stands nowhere.
    pub(super) fn read_waiting(&mut self) -> Result<(), MeshError> {
        let at = self.at;
        loop {
            let scope = self.scope;
            let (own, others): (Vec<_>, Vec<_>) = std::mem::take(&mut self.waiting)
                .into_iter()
                .partition(|waiting| waiting.scope == scope);
            self.waiting = others;
            let count = own.len();
            let mut left = Vec::new();
            // what is named stands below: the last ones first
            for mut waiting in own.into_iter().rev() {
                let card = Card::read(&self.source, waiting.at)?;
                self.at = card.next;
                if let Err(error) = self.set_or_surface(&card) {
                    waiting.error = error;
                    left.push(waiting);
                }
            }
            left.reverse();
            if left.len() == count {
                self.at = at;
                return self.unread(left);
            }
            self.waiting.extend(left);
        }
    }

    /// Fails for sets that were not read, if there are any: for the first that names what stands nowhere, else for one in a circle.
    fn unread(&self, left: Vec<Waiting>) -> Result<(), MeshError> {
        let Some(first) = left.first().map(|waiting| waiting.at) else {
            return Ok(());
        };
        let mut names = Vec::new();
        for waiting in &left {
            let card = Card::read(&self.source, waiting.at)?;
            let name = ["NSET", "ELSET", "NAME"]
                .into_iter()
                .find_map(|key| card.get(key));
            names.extend(name.map(|name| format!("\"{}\"", key(name))));
        }
        let is_known = |error: &MeshError| match error {
            MeshError::Syntax { found, .. } => names.contains(&found.to_ascii_uppercase()),
            _ => false,
        };
        match left.into_iter().find(|waiting| !is_known(&waiting.error)) {
            Some(waiting) => Err(waiting.error),
            None => Err(self.syntax(
                first,
                "a set that names itself, or sets that name each other in a circle",
                "sets that end in numbers",
            )),
        }
    }

    /// `*NSET` and `*ELSET`: numbers, ranges, and names of sets.
    fn set(&mut self, card: &Card<'a>) -> Result<(), MeshError> {
        let of = match card.keyword.as_str() {
            "NSET" => Of::Nodes,
            _ => Of::Elements,
        };
        let name = card.required(&card.keyword, &self.source)?;
        // meshio hands on what a file of Gmsh says of its geometry as a set, with negative numbers
        if name.eq_ignore_ascii_case("gmsh:bounding_entities") {
            self.ignore(format!("{}={name}", card.keyword), card.at);
            while self.data()?.is_some() {}
            return Ok(());
        }
        let body = self.body_named(card)?;
        let mut members = Vec::new();
        if let Some(cells) = card.get("ELSET").filter(|_| of == Of::Nodes) {
            let cells = self.named(card.at, cells, body, Of::Elements)?;
            members = self.nodes_of(card.at, &cells)?;
        }
        let generate = card.get("GENERATE").is_some();
        while let Some((at, line)) = self.data()? {
            if generate {
                members.push(self.range(at, line, body)?);
                continue;
            }
            for word in fields(line) {
                members.extend(self.named(at, word, body, of)?);
            }
        }
        self.sets(of).entry(name).extend(members);
        Ok(())
    }

    fn sets(&mut self, of: Of) -> &mut Sets<Members> {
        let body = self.body();
        match of {
            Of::Nodes => &mut body.node_sets,
            Of::Elements => &mut body.element_sets,
        }
    }

    /// Returns the body to which numbers belong: the one that is being read, or that of the parameter INSTANCE.
    fn body_named(&self, card: &Card) -> Result<u32, MeshError> {
        let Some(name) = card.get("INSTANCE") else {
            return Ok(self.own());
        };
        match self.find_instance(name) {
            Some(i) => Ok(i as u32),
            None => Err(self.syntax(card.at, name, "the name of an instance above")),
        }
    }

    /// `first, last[, step]`.
    fn range(&self, at: usize, line: &str, body: u32) -> Result<Members, MeshError> {
        let mut numbers = Vec::new();
        self.numbers(at, line, &mut numbers)?;
        let (first, last, step) = match numbers[..] {
            [first, last] => (first, last, 1),
            [first, last, step] => (first, last, step),
            _ => return Err(self.syntax(at, line, "first, last and step of a range")),
        };
        if last < first {
            return Err(self.syntax(at, line, "a range that ends after its beginning"));
        }
        Ok(Members {
            body,
            first,
            last,
            step,
            range: true,
            at,
        })
    }

    /// Returns the members that a word in a set stands for: a number, a set, or either of an instance.
    fn named(
        &mut self,
        at: usize,
        word: &str,
        body: u32,
        of: Of,
    ) -> Result<Vec<Members>, MeshError> {
        let of_body = |this: &mut Self, body: u32, word: &str| {
            if word.starts_with(|c: char| c.is_ascii_digit()) && word.parse::<u64>().is_ok() {
                let number = this.number(at, word, "a number of a set")?;
                return Ok(Some(vec![one(body, number, at)]));
            }
            let sets = if body == this.own() {
                this.sets(of)
            } else {
                let body = &mut this.bodies[body as usize];
                match of {
                    Of::Nodes => &mut body.node_sets,
                    Of::Elements => &mut body.element_sets,
                }
            };
            Ok(sets.get(word).map(<[Members]>::to_vec))
        };
        if let Some(members) = of_body(self, body, word)? {
            return Ok(members);
        }
        let ends = word.match_indices('.').map(|(i, _)| i);
        for end in ends.collect::<Vec<_>>() {
            let Some(i) = self.find_instance(&word[..end]) else {
                continue;
            };
            if let Some(members) = of_body(self, i as u32, &word[end + 1..])? {
                return Ok(members);
            }
        }
        Err(self.syntax(at, word, "a number, or the name of a set of the deck"))
    }

    /// The nodes of elements, which have to stand above.
    fn nodes_of(&mut self, at: usize, cells: &[Members]) -> Result<Vec<Members>, MeshError> {
        let own = self.own();
        let mut all = Vec::new();
        for members in cells {
            let body = if members.body == own {
                &*self.body()
            } else {
                &self.bodies[members.body as usize]
            };
            let (places, missing) = members.find(&body.element_places);
            if missing > 0 && !members.range {
                let found = format!("element {} of the set", members.first);
                return Err(self.syntax(at, &found, "an element that stands above"));
            }
            for place in places {
                let nodes = body.nodes_of(&body.elements[place as usize]);
                all.extend(nodes.iter().map(|&n| one(members.body, n, members.at)));
            }
        }
        Ok(all)
    }

    /// `*SURFACE` of elements or nodes.
    fn surface(&mut self, card: &Card<'a>) -> Result<(), MeshError> {
        let kind = card.get("TYPE").unwrap_or("ELEMENT").to_ascii_uppercase();
        if !["ELEMENT", "NODE"].contains(&kind.as_str()) {
            self.ignore(format!("SURFACE, TYPE={kind}"), card.at);
            return Ok(());
        }
        for word in ["COMBINE", "CROP"] {
            if card.get(word).is_some() {
                return Err(self.unsupported(
                    card.at,
                    &format!("*SURFACE with {word}"),
                    "write the surface by its elements and their faces",
                ));
            }
        }
        let name = card.required("NAME", &self.source)?;
        let body = self.body_named(card)?;
        let mut all = Vec::new();
        while let Some((at, line)) = self.data()? {
            let mut words = fields(line);
            let whose = words.next().unwrap_or("");
            if kind == "NODE" {
                self.surface_of_nodes(at, name, whose, body)?;
                continue;
            }
            let Some(label) = words.next() else {
                return Err(self.unsupported(
                    at,
                    &format!("a surface of all free faces of {whose}"),
                    "name the faces, S1 to S6, behind the element or its set",
                ));
            };
            let Some(face) = Face::parse(label) else {
                return Err(self.syntax(
                    at,
                    label,
                    "a face (S1 to S6, SPOS, SNEG, E1 to E4, END1 or END2)",
                ));
            };
            let members = self.named(at, whose, body, Of::Elements)?;
            let sides = members.into_iter().map(|members| Sides {
                members: Members { at, ..members },
                face,
            });
            all.extend(sides);
        }
        if kind == "ELEMENT" {
            self.body().surfaces.entry(name).extend(all);
        }
        Ok(())
    }

    fn surface_of_nodes(
        &mut self,
        at: usize,
        name: &str,
        whose: &str,
        body: u32,
    ) -> Result<(), MeshError> {
        let same = super::body::key(name) == super::body::key(whose);
        let members = self.named(at, whose, body, Of::Nodes)?;
        let known = self.sets(Of::Nodes).entry(name);
        // a surface of the set of its own name adds nothing to it
        if !same || known.is_empty() {
            known.extend(members);
        }
        Ok(())
    }
}
