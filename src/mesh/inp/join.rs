//! From bodies to a mesh: numbers of all instances, members of sets, faces of surfaces, and notes on the parts left out.

use std::collections::HashMap;

use rustc_hash::{FxHashMap, FxHashSet};

use super::body::{self, Body, Element, Members};
use super::kinds::Kind;
use super::text::REWRITE;
use super::{Reader, Scope};
use crate::mesh::raw::{RawMesh, RawNode, RawShape};
use crate::mesh::{CellShape, MeshError};

/// Largest number of lines that a note lists for a keyword that is left out.
const MOST_LINES: usize = 4;
/// The mesh of all bodies.
///
/// # Errors
/// [`MeshError`]: nodes that are not there, elements twice, sets of what is not there.
pub(super) fn join(reader: &Reader) -> Result<RawMesh, MeshError> {
    let mut join = Join {
        reader,
        offsets: offsets(&reader.bodies),
        raw: RawMesh::default(),
        dimension: 0,
        gaps: Vec::new(),
    };
    join.instances();
    join.nodes();
    join.elements()?;
    join.check_sections()?;
    join.node_sets()?;
    join.surfaces()?;
    join.tell();
    Ok(join.raw)
}

/// Offsets of the numbers of each body, so that no two share one: zero for the first that has nodes.
fn offsets(bodies: &[Body]) -> Vec<u64> {
    let numbers = |body: &Body| {
        let nodes = body.nodes.iter().map(|n| n.number);
        nodes.chain(body.elements.iter().map(|e| e.number)).max()
    };
    let largest = bodies.iter().filter_map(numbers).max().unwrap_or(0);
    let stride = 10_u64.pow(largest.max(1).ilog10() + 1);
    let mut before = 0;
    let mut offset = |body: &Body| {
        let offset = before * stride;
        before += u64::from(!body.nodes.is_empty());
        offset
    };
    bodies.iter().map(&mut offset).collect()
}

/// Index of the node of a line of second order that lies between the other two: the second by the manuals of Abaqus and CalculiX, as Gmsh writes it; meshio writes the third.
fn middle(body: &Body, nodes: &[u64]) -> usize {
    let places: Vec<[f64; 3]> = (nodes.iter())
        .map(|n| body.nodes[body.node_places[n] as usize].x)
        .collect();
    let off = |m: usize| -> f64 {
        let [a, b] = [(m + 1) % 3, (m + 2) % 3];
        (0..3)
            .map(|k| (places[a][k] + places[b][k] - 2.0 * places[m][k]).powi(2))
            .sum()
    };
    // the first is an end
    if off(2) < off(1) { 2 } else { 1 }
}

struct Join<'r, 'a> {
    reader: &'r Reader<'a>,
    offsets: Vec<u64>,
    raw: RawMesh,
    /// Largest dimension of an element.
    dimension: usize,
    /// Sets with ranges that have gaps: name, missing numbers, where.
    gaps: Vec<(String, u64, usize)>,
}

impl Join<'_, '_> {
    /// Keeps the names of instances, if there are several bodies with nodes.
    fn instances(&mut self) {
        let bodies = self.reader.bodies.iter().zip(&self.offsets);
        let with_nodes = bodies.filter(|(body, _)| !body.nodes.is_empty());
        let all: Vec<(u64, String)> = with_nodes
            .map(|(body, &offset)| (offset, body.name.clone()))
            .collect();
        if all.len() > 1 {
            self.raw.instances = all;
        }
    }

    fn nodes(&mut self) {
        for (body, &offset) in self.reader.bodies.iter().zip(&self.offsets) {
            for node in &body.nodes {
                self.raw.nodes.push(RawNode {
                    tag: offset + node.number,
                    x: body.motion.map_or(node.x, |motion| motion.apply(node.x)),
                    at: node.at,
                });
            }
        }
    }

    /// The name of a set: with that of its instance before it.
    fn name(&self, body: usize, set: &str) -> String {
        match self.reader.bodies[body].name.as_str() {
            "" => set.into(),
            instance => format!("{instance}.{set}"),
        }
    }

    fn elements(&mut self) -> Result<(), MeshError> {
        let bodies = &self.reader.bodies;
        let shapes = bodies.iter().flat_map(|body| &body.elements);
        let dimensions = shapes.map(|e| e.kind.shape.dimension());
        self.dimension = dimensions.max().unwrap_or(0);
        let lists = self.lists()?;
        let mut groups: FxHashMap<&[u32], u32> = FxHashMap::default();
        let mut known: HashMap<Vec<u64>, u64> = HashMap::new();
        let names = self.element_set_names();
        for (b, body) in bodies.iter().enumerate() {
            let own = body.elements.iter().zip(&lists[b]);
            for (element, list) in own.filter(|(e, _)| e.kind != Kind::LEFT_OUT) {
                let mut nodes = Vec::with_capacity(20);
                for &node in body.nodes_of(element) {
                    if !body.node_places.contains_key(&node) {
                        return Err(MeshError::MissingNode {
                            path: self.reader.source.file(element.at),
                            place: self.reader.source.place(element.at),
                            element: element.number,
                            node,
                        });
                    }
                    nodes.push(self.offsets[b] + node);
                }
                let shape = element.kind.shape;
                if shape == RawShape::Cell(CellShape::Line3)
                    && middle(body, body.nodes_of(element)) == 1
                {
                    nodes.swap(1, 2);
                }
                if shape.dimension() == self.dimension {
                    let mut key = nodes.clone();
                    key.sort_unstable();
                    if let Some(first) = known.insert(key, element.number) {
                        return Err(MeshError::DuplicateElement {
                            path: self.reader.source.file(element.at),
                            place: self.reader.source.place(element.at),
                            element: element.number,
                            first,
                        });
                    }
                }
                let raw = &mut self.raw;
                let group = match list.is_empty() {
                    true => 0,
                    false => *groups.entry(list).or_insert_with(|| {
                        let named = list.iter().map(|&n| names[n as usize].clone());
                        raw.groups.push(named.collect());
                        raw.groups.len() as u32 - 1
                    }),
                };
                let tag = self.offsets[b] + element.number;
                raw.push((tag, group, element.at), shape, &nodes);
            }
        }
        Ok(())
    }

    fn element_set_names(&self) -> Vec<String> {
        let bodies = self.reader.bodies.iter().enumerate();
        bodies
            .flat_map(|(b, body)| body.element_sets.names.iter().map(move |set| (b, set)))
            .map(|(b, set)| self.name(b, set))
            .collect()
    }

    /// The element sets of each element of each body, by their numbers in [`Self::element_set_names`].
    fn lists(&mut self) -> Result<Vec<Vec<Vec<u32>>>, MeshError> {
        let bodies = &self.reader.bodies;
        let empty = bodies
            .iter()
            .map(|body| vec![Vec::new(); body.elements.len()]);
        let mut lists: Vec<Vec<Vec<u32>>> = empty.collect();
        let mut set = 0;
        for (b, body) in bodies.iter().enumerate() {
            for (name, members) in body
                .element_sets
                .names
                .iter()
                .zip(&body.element_sets.members)
            {
                let name = self.name(b, name);
                for members in members {
                    let of = members.body as usize;
                    for place in
                        self.found(members, &bodies[of].element_places, &name, "element")?
                    {
                        let list: &mut Vec<u32> = &mut lists[of][place as usize];
                        if list.last() != Some(&set) {
                            list.push(set);
                        }
                    }
                }
                set += 1;
            }
        }
        Ok(lists)
    }

    /// The members of a set that there are. A range may have gaps, which are noted; a single number may not be missing.
    fn found(
        &mut self,
        members: &Members,
        places: &FxHashMap<u64, u32>,
        set: &str,
        what: &str,
    ) -> Result<Vec<u32>, MeshError> {
        let (found, missing) = members.find(places);
        if missing > 0 && members.range {
            self.gaps.push((set.into(), missing, members.at));
        } else if missing > 0 {
            return Err(self.reader.source.syntax(
                members.at,
                &format!("{what} {} in the set {set}", members.first),
                &format!("the number of one of the {} {what}s", places.len()),
                REWRITE,
            ));
        }
        Ok(found)
    }

    /// Node sets, as points that are in them.
    fn node_sets(&mut self) -> Result<(), MeshError> {
        let bodies = &self.reader.bodies;
        for (b, body) in bodies.iter().enumerate() {
            for (name, members) in body.node_sets.names.iter().zip(&body.node_sets.members) {
                let name = self.name(b, name);
                let group = self.group(name.clone());
                for members in members {
                    let of = members.body as usize;
                    for place in self.found(members, &bodies[of].node_places, &name, "node")? {
                        let node = bodies[of].nodes[place as usize].number;
                        let tag = self.offsets[of] + node;
                        self.push(CellShape::Vertex, &[tag], tag, group, members.at);
                    }
                }
            }
        }
        Ok(())
    }

    /// Surfaces of elements, as the facets that they name.
    fn surfaces(&mut self) -> Result<(), MeshError> {
        let bodies = &self.reader.bodies;
        for (b, body) in bodies.iter().enumerate() {
            for (name, sides) in body.surfaces.names.iter().zip(&body.surfaces.members) {
                let name = self.name(b, name);
                let group = self.group(name.clone());
                for sides in sides {
                    let of = sides.members.body as usize;
                    let places =
                        self.found(&sides.members, &bodies[of].element_places, &name, "element")?;
                    let elements = &bodies[of].elements;
                    let kept = places.iter().map(|&place| &elements[place as usize]);
                    for element in kept.filter(|e| e.kind != Kind::LEFT_OUT) {
                        let shape = sides.face.nodes(element.kind).map(<[usize]>::len);
                        let shape = match (shape, self.dimension) {
                            (Some(1), 1) => CellShape::Vertex,
                            (Some(2), 2) => CellShape::Line2,
                            (Some(3), 3) => CellShape::Tri3,
                            (Some(4), 3) => CellShape::Quad4,
                            (Some(3), 2) => CellShape::Line3,
                            (Some(6), 3) => CellShape::Tri6,
                            (Some(8), 3) => CellShape::Quad8,
                            _ => return Err(self.no_face(&name, element.number, sides.members.at)),
                        };
                        let nodes = bodies[of].nodes_of(element);
                        let local = sides.face.nodes(element.kind).into_iter().flatten();
                        let tags: Vec<u64> = local.map(|&i| self.offsets[of] + nodes[i]).collect();
                        let tag = self.offsets[of] + element.number;
                        self.push(shape, &tags, tag, group, sides.members.at);
                    }
                }
            }
        }
        Ok(())
    }

    /// Refuses elements of a lower dimension than the body's to which a section gives a stiffness: a model has none for them.
    fn check_sections(&self) -> Result<(), MeshError> {
        for &(scope, set, at) in &self.reader.sections {
            // a part has its instances
            let bodies = self.reader.bodies.iter();
            let members = match scope {
                Scope::Model => self.reader.bodies[0].element_sets.get(set),
                Scope::Part(part) => self.reader.parts[part].element_sets.get(set),
                Scope::Instance(i) => self.reader.bodies[i].element_sets.get(set),
            };
            let elements = match scope {
                Scope::Part(part) => &self.reader.parts[part],
                Scope::Instance(i) => &self.reader.bodies[i],
                Scope::Model => &self.reader.bodies[0],
            };
            let found = members.into_iter().flatten().flat_map(|members| {
                let body = match members.body {
                    body::THIS => elements,
                    body => bodies.clone().nth(body as usize).unwrap_or(elements),
                };
                let (places, _) = members.find(&body.element_places);
                places
                    .into_iter()
                    .map(|place| body.elements[place as usize])
            });
            let lower: Vec<Element> = found
                .filter(|e| (1..self.dimension).contains(&e.kind.shape.dimension()))
                .collect();
            if let Some(first) = lower.first() {
                return Err(MeshError::Unsupported {
                    path: self.reader.source.file(at),
                    place: self.reader.source.place(at),
                    what: format!(
                        "the stiffness of {} elements of type {} in the set {set} (the first: {}), beside a body of dimension {},",
                        lower.len(),
                        first.kind.stem,
                        first.number,
                        self.dimension
                    ),
                    remedy: "take them and their section out of the deck, or leave them out, with what they stiffen, by mesh.file.ignore = [\"…\"] with their type",
                });
            }
        }
        Ok(())
    }

    /// Notes elements that are left out, and bars that have no stiffness.
    fn tell_elements(&mut self) {
        let bodies = self.reader.bodies.iter();
        let all: Vec<&Element> = bodies.flat_map(|body| &body.elements).collect();
        let path = self.reader.source.path.display();
        let unwanted = self.reader.unwanted.iter();
        let unwanted = unwanted.filter(|(_, count)| *count > 0);
        self.raw.left_out = unwanted.clone().map(|(word, _)| word.clone()).collect();
        let counts: Vec<String> = unwanted
            .map(|(word, count)| format!("{count} elements of type {word}"))
            .collect();
        if !counts.is_empty() {
            self.raw.notes.push(format!(
                "{path}: {} are left out, and what they stiffen is missing (mesh.file.ignore)",
                counts.join(", ")
            ));
        }
        let bars = all.iter().filter(|e| e.kind.is_bar() && self.dimension > 1);
        let bars: Vec<_> = bars.collect();
        if let Some(first) = bars.first() {
            self.raw.notes.push(format!(
                "{path}: {} elements of type {} (the first: {}) have no stiffness here: bars and beams name edges and nodes of a body alone",
                bars.len(),
                first.kind.stem,
                first.number
            ));
        }
    }

    fn no_face(&self, surface: &str, element: u64, at: usize) -> MeshError {
        let dimension = self.dimension;
        self.reader.source.syntax(
            at,
            &format!("a face of element {element} in the surface {surface}"),
            &format!(
                "one of dimension {} that its type has",
                dimension.saturating_sub(1)
            ),
            REWRITE,
        )
    }

    fn group(&mut self, name: String) -> u32 {
        self.raw.groups.push(vec![name]);
        self.raw.groups.len() as u32 - 1
    }

    fn push(&mut self, shape: CellShape, nodes: &[u64], tag: u64, group: u32, at: usize) {
        self.raw
            .push((tag, group, at), RawShape::Cell(shape), nodes);
    }

    /// Adds notes on the parts of the deck that are left out.
    fn tell(&mut self) {
        let source = &self.reader.source;
        let path = source.path.display();
        let ignored = &self.reader.ignored;
        if !ignored.is_empty() {
            let told: Vec<String> = ignored
                .iter()
                .map(|(word, at)| {
                    let places = at.iter().take(MOST_LINES);
                    let mut places: Vec<String> =
                        places.map(|&at| source.place(at).to_string()).collect();
                    if at.len() > MOST_LINES {
                        places.push(format!("{} more", at.len() - MOST_LINES));
                    }
                    format!("*{word} ({})", places.join(", "))
                })
                .collect();
            self.raw.notes.push(format!(
                "{path}: only nodes, elements, sets and surfaces are read; left out are {}: give materials, conditions and steps in the scene",
                told.join(", ")
            ));
        }
        self.tell_elements();
        if let Some(at) = self.reader.axisymmetric.filter(|_| self.dimension == 2) {
            self.raw.notes.push(format!(
                "{}: {}: axisymmetric elements are read as plane ones; there is no axisymmetric model",
                source.file(at).display(),
                source.place(at)
            ));
        }
        let mut sets: FxHashSet<String> = FxHashSet::default();
        for (set, missing, at) in std::mem::take(&mut self.gaps) {
            if sets.insert(set.clone()) {
                self.raw.notes.push(format!(
                    "{}: {}: {missing} numbers of a range of the set {set} are not in the mesh and are passed over",
                    source.file(at).display(),
                    source.place(at)
                ));
            }
        }
    }
}
