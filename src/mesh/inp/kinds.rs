//! Types of elements in decks, and the numbers of their faces.
//!
//! Sources: Abaqus Analysis User's Guide, "Element library"; CalculiX CrunchiX user's manual, chapters "Element types" and "*SURFACE".

use crate::mesh::CellShape;
use crate::mesh::raw::{OtherShape, RawShape};

/// A type of elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kind {
    /// Its name without the letters of variants.
    pub stem: &'static str,
    pub shape: RawShape,
    /// True if its faces are counted as those of a shell: both sides first, then edges.
    pub shell: bool,
}

impl Kind {
    /// Of elements that are left out.
    pub const LEFT_OUT: Self = Self {
        stem: "",
        shape: RawShape::Cell(CellShape::Vertex),
        shell: false,
    };

    /// Returns true for bars and beams in the plane; those in space are what Gmsh and meshio write for the edges of a body.
    pub fn is_bar(self) -> bool {
        ["T2D2", "T2D3", "B21", "B22", "B23"].contains(&self.stem)
    }
}

/// A face of an element by its label in a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Face {
    /// `S1` to `S6`.
    Side(usize),
    /// `SPOS` or `SNEG`: a surface element itself.
    Whole,
    /// `E1` to `E4`: an edge of a surface element.
    Edge(usize),
    /// `END1` or `END2` of a line.
    End(usize),
}

impl Face {
    /// The face of this label.
    pub fn parse(label: &str) -> Option<Self> {
        let label = label.to_ascii_uppercase();
        let number = |prefix: &str, most: usize| {
            let n: usize = label.strip_prefix(prefix)?.parse().ok()?;
            (1..=most).contains(&n).then_some(n)
        };
        if label == "SPOS" || label == "SNEG" {
            return Some(Self::Whole);
        }
        number("S", 6)
            .map(Self::Side)
            .or_else(|| number("E", 4).map(Self::Edge))
            .or_else(|| number("END", 2).map(Self::End))
    }

    /// Local node numbers of the face of an element.
    pub fn nodes(self, kind: Kind) -> Option<&'static [usize]> {
        const HEX: [&[usize]; 6] = [
            &[0, 1, 2, 3],
            &[4, 7, 6, 5],
            &[0, 4, 5, 1],
            &[1, 5, 6, 2],
            &[2, 6, 7, 3],
            &[3, 7, 4, 0],
        ];
        const TET: [&[usize]; 4] = [&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]];
        const PRISM: [&[usize]; 5] = [
            &[0, 1, 2],
            &[3, 5, 4],
            &[0, 3, 4, 1],
            &[1, 4, 5, 2],
            &[2, 5, 3, 0],
        ];
        const PYRAMID: [&[usize]; 5] = [
            &[0, 1, 2, 3],
            &[0, 4, 1],
            &[1, 4, 2],
            &[2, 4, 3],
            &[3, 4, 0],
        ];
        const ENDS: [&[usize]; 2] = [&[0], &[1]];
        const ALL: &[usize] = &[0, 1, 2, 3, 4, 5, 6, 7];
        let shape = match (kind.shape, self) {
            (RawShape::Cell(shape), _) => shape,
            (RawShape::Other(OtherShape::Prism), Self::Side(n)) => {
                return PRISM.get(n - 1).copied();
            }
            (RawShape::Other(OtherShape::Pyramid), Self::Side(n)) => {
                return PYRAMID.get(n - 1).copied();
            }
            (RawShape::Other(_), _) => return None,
        };
        let plane = shape.dimension() == 2;
        // of a solid of second order the facet with the corners of that face
        let full = |corners: &[usize]| {
            let has_all = |f: &&&[usize]| corners.iter().all(|i| f.contains(i));
            shape.facets().iter().find(has_all).copied()
        };
        match (shape, self) {
            (CellShape::Hex20, Self::Side(n)) => full(HEX.get(n - 1)?),
            (CellShape::Tet10, Self::Side(n)) => full(TET.get(n - 1)?),
            (CellShape::Hex8, Self::Side(n)) => HEX.get(n - 1).copied(),
            (CellShape::Tet4, Self::Side(n)) => TET.get(n - 1).copied(),
            (CellShape::Line2 | CellShape::Line3, Self::End(n)) => ENDS.get(n - 1).copied(),
            (_, Self::Edge(n)) if plane => shape.facets().get(n - 1).copied(),
            (_, Self::Whole) if plane => ALL.get(..shape.node_count()),
            (_, Self::Side(1 | 2)) if plane && kind.shell => ALL.get(..shape.node_count()),
            (_, Self::Side(n)) if plane && kind.shell => shape.facets().get(n - 3).copied(),
            (_, Self::Side(n)) if plane => shape.facets().get(n - 1).copied(),
            _ => None,
        }
    }
}

/// Families of types by their stem, their shape and whether they are counted as shells; variants follow by the letters below.
const STEMS: [(&str, CellShape, bool); 43] = [
    ("T2D2", CellShape::Line2, false),
    ("T3D2", CellShape::Line2, false),
    ("B21", CellShape::Line2, false),
    ("B23", CellShape::Line2, false),
    ("B31", CellShape::Line2, false),
    ("B33", CellShape::Line2, false),
    ("CPS3", CellShape::Tri3, false),
    ("CPE3", CellShape::Tri3, false),
    ("CPEG3", CellShape::Tri3, false),
    ("CPS4", CellShape::Quad4, false),
    ("CPE4", CellShape::Quad4, false),
    ("CPEG4", CellShape::Quad4, false),
    ("CAX3", CellShape::Tri3, false),
    ("CAX4", CellShape::Quad4, false),
    ("S3", CellShape::Tri3, true),
    ("STRI3", CellShape::Tri3, true),
    ("M3D3", CellShape::Tri3, true),
    ("R3D3", CellShape::Tri3, true),
    ("S4", CellShape::Quad4, true),
    ("M3D4", CellShape::Quad4, true),
    ("R3D4", CellShape::Quad4, true),
    ("SFM3D4", CellShape::Quad4, true),
    ("T2D3", CellShape::Line3, false),
    ("T3D3", CellShape::Line3, false),
    ("B22", CellShape::Line3, false),
    ("B32", CellShape::Line3, false),
    ("CAX6", CellShape::Tri6, false),
    ("CAX8", CellShape::Quad8, false),
    ("CPS6", CellShape::Tri6, false),
    ("CPE6", CellShape::Tri6, false),
    ("CPEG6", CellShape::Tri6, false),
    ("CPS8", CellShape::Quad8, false),
    ("CPE8", CellShape::Quad8, false),
    ("CPEG8", CellShape::Quad8, false),
    ("S6", CellShape::Tri6, true),
    ("STRI65", CellShape::Tri6, true),
    ("S8", CellShape::Quad8, true),
    ("M3D6", CellShape::Tri6, true),
    ("M3D8", CellShape::Quad8, true),
    ("C3D10", CellShape::Tet10, false),
    ("C3D20", CellShape::Hex20, false),
    ("C3D4", CellShape::Tet4, false),
    ("C3D8", CellShape::Hex8, false),
];

/// Letters after a stem: reduced integration, incompatible modes, hybrid, with temperature or pore pressure, modified, and what shells add.
const VARIANTS: [&str; 20] = [
    "", "R", "I", "H", "T", "P", "S", "RH", "IH", "RT", "HT", "RP", "PH", "RHT", "RPH", "RS",
    "RSW", "R5", "M", "MH",
];

/// Stems of elements of second order that are not read, with their names.
const SECOND_ORDER: [(&str, &str); 3] = [
    ("C3D27", "second-order hexahedron"),
    ("C3D15", "second-order prism"),
    ("S9", "second-order shell"),
];

/// Our shape for a type in capitals, or its name and a remedy.
pub(super) fn kind(word: &str) -> Result<Kind, (&'static str, &'static str)> {
    const ORDER: &str =
        "mesh again with elements of first order, or convert the mesh (in Gmsh: SetOrder 1)";
    const SHAPE: &str = "supported are lines, triangles, quadrilaterals, tetrahedra and hexahedra of first and second order, prisms and pyramids of first: mesh without it, or leave it out, with what it stiffens, by mesh.file.ignore";
    let stem = |stem: &str| {
        let rest = word.strip_prefix(stem)?;
        VARIANTS.contains(&rest).then_some(())
    };
    for (name, shape, shell) in STEMS {
        if stem(name).is_some() {
            return Ok(Kind {
                stem: name,
                shape: RawShape::Cell(shape),
                shell,
            });
        }
    }
    for (name, shape) in [("C3D6", OtherShape::Prism), ("C3D5", OtherShape::Pyramid)] {
        if stem(name).is_some() {
            return Ok(Kind {
                stem: name,
                shape: RawShape::Other(shape),
                shell: false,
            });
        }
    }
    for (name, told) in SECOND_ORDER {
        if word.starts_with(name) {
            return Err((told, ORDER));
        }
    }
    Err(("no continuum element that is known here", SHAPE))
}
