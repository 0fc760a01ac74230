//! Files as preprocessors and scanners write them: in any order, with marks and elements that no model has, with cracks of the mesher.

use std::fmt::Write as _;

use super::{Case, flat};

/// A scene of a strip in tension: E = 200, ν = 0.3, σ = 2.
const PULLED: &str = r#"
kinematics = "KINEMATICS"
coupling = "local"
mesh.file.path = "FILE"
materials.steel.lps = { youngs-modulus = 200, poisson-ratio = 0.3 }
conditions.l.displacement = { on = "LEFT", x = 0 }
conditions.b.displacement = { on = "BOT", y = 0 }
conditions.p.traction = { on = "RIGHT", x = 2 }
output.probes.e = { at = [4, 0.5] }
output.vtu = false
"#;

/// Nodes and cells, clockwise if wanted, of a strip of 4 by 2 squares.
pub(super) fn strip(is_clockwise: bool) -> String {
    let mut deck = String::from("*NODE\n");
    for k in 0..15 {
        let _ = writeln!(deck, "{}, {}, {}", k + 1, k % 5, k / 5);
    }
    deck.push_str("*ELEMENT, TYPE=CPS4, ELSET=A\n");
    for k in 0..8 {
        let a = k % 4 + 5 * (k / 4) + 1;
        let nodes = match is_clockwise {
            false => [a, a + 1, a + 6, a + 5],
            true => [a, a + 5, a + 6, a + 1],
        };
        let [a, b, c, d] = nodes;
        let _ = writeln!(deck, "{}, {a}, {b}, {c}, {d}", k + 101);
    }
    deck.push_str("*NSET, NSET=LEFT\n1, 6, 11\n*NSET, NSET=BOT, GENERATE\n1, 5, 1\n");
    deck
}

/// The face of each cell at the right, of both ways round.
pub(super) fn right(is_clockwise: bool) -> String {
    let face = if is_clockwise { "S3" } else { "S2" };
    format!("*SURFACE, NAME=RIGHT, TYPE=ELEMENT\nENDS, {face}\n*ELSET, ELSET=ENDS\n104, 108\n")
}

/// Runs a scene beside a file; returns its standard output and error, and the displacements of its probes.
fn run_scene(scene: &str, (name, content): (&str, &[u8]), set: &[&str]) -> (String, Vec<[f64; 2]>) {
    let case = Case::new(scene);
    let folder = case.folder.path();
    std::fs::write(folder.join(name), content).unwrap();
    let set: Vec<&str> = set.iter().flat_map(|s| ["--set", s]).collect();
    let out = case.command("run", &set);
    let told = [out.stdout, out.stderr].map(|t| String::from_utf8(t).unwrap());
    let text = std::fs::read_to_string(folder.join("out/scene_probes.csv")).unwrap_or_default();
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap_or_default();
    let columns = ["ux", "uy"].map(|name| header.iter().position(|h| *h == name));
    let at = |row: &[&str], k: Option<usize>| row[k.unwrap()].parse().unwrap();
    let probes = rows.map(|row| columns.map(|k| at(&row, k)));
    (told.concat(), probes.collect())
}

/// Runs the strip of a file; returns what was told, and the displacement of the probe.
pub(super) fn run(
    kinematics: &str,
    name: &str,
    content: &[u8],
    set: &[&str],
) -> (String, Option<[f64; 2]>) {
    let scene = PULLED
        .replace("KINEMATICS", kinematics)
        .replace("FILE", name);
    let (told, probes) = run_scene(&scene, (name, content), set);
    (told, probes.first().copied())
}

/// `σ L/E`, and `−ν σ y/E`.
pub(super) fn is_pulled(u: Option<[f64; 2]>, told: &str) {
    let u = u.unwrap_or_else(|| panic!("{told}"));
    let off = (u[0] - 0.04).abs().max((u[1] + 0.0015).abs());
    assert!(off < 1e-12, "{u:?}\n{told}");
}

/// A byte-order mark, a surface before the set that it names, cells clockwise.
#[test]
fn decks_are_read_in_the_order_and_sense_that_they_have() {
    for is_clockwise in [false, true] {
        let deck = strip(is_clockwise).replace(
            "*NSET, NSET=LEFT",
            &format!("{}*NSET, NSET=LEFT", right(is_clockwise)),
        );
        let marked = [b"\xef\xbb\xbf", deck.as_bytes()].concat();
        let (told, u) = run("plane-stress", "strip.inp", &marked, &[]);
        is_pulled(u, &told);
        let turned =
            flat(&told).contains("8 of 8 cells run the wrong way round (the first: element 101");
        assert_eq!(turned, is_clockwise, "{told}");
    }
    // a name that stands nowhere is still an error, with its line
    let (told, u) = run(
        "plane-stress",
        "strip.inp",
        (strip(false) + "*SURFACE, NAME=RIGHT\nNOWHERE, S2\n").as_bytes(),
        &[],
    );
    assert!(
        u.is_none() && flat(&told).contains("line 31: \"NOWHERE\""),
        "{told}"
    );
}

#[test]
fn bars_in_a_body_are_told_refused_or_left_out() {
    let bars = "*ELEMENT, TYPE=T2D2, ELSET=REBAR\n901, 6, 7\n902, 7, 8\n";
    let deck = strip(false) + bars + &right(false);
    let (told, u) = run("plane-stress", "bars.inp", deck.as_bytes(), &[]);
    is_pulled(u, &told);
    assert!(
        flat(&told).contains("2 elements of type T2D2 (the first: 901) have no stiffness here"),
        "{told}"
    );
    let stiff = deck
        + "*SOLID SECTION, ELSET=REBAR, MATERIAL=STEEL\n0.01\n*MATERIAL, NAME=STEEL\n*ELASTIC\n200, 0.3\n";
    let (told, u) = run("plane-stress", "bars.inp", stiff.as_bytes(), &[]);
    assert!(
        u.is_none()
            && flat(&told).contains(
                "the stiffness of 2 elements of type T2D2 in the set REBAR (the first: 901)"
            ),
        "{told}"
    );
    let (told, u) = run(
        "plane-stress",
        "bars.inp",
        stiff.as_bytes(),
        &["mesh.file.ignore=[\"t2d2\"]"],
    );
    is_pulled(u, &told);
    assert!(
        flat(&told).contains("2 elements of type T2D2 are left out"),
        "{told}"
    );
    // of a type that no program knows, over two lines, in a set of its own
    let springs = strip(false)
        + "*ELEMENT, TYPE=SPRINGA, ELSET=SPRINGS\n951, 1,\n2\n952, 2, 3\n"
        + &right(false);
    let (told, u) = run(
        "plane-stress",
        "bars.inp",
        springs.as_bytes(),
        &["mesh.file.ignore=[\"SPRINGA\"]"],
    );
    is_pulled(u, &told);
    let (told, u) = run(
        "plane-stress",
        "bars.inp",
        springs.as_bytes(),
        &["mesh.file.ignore=[\"SPRINGA\", \"SPRINGB\"]"],
    );
    assert!(
        u.is_none() && flat(&told).contains("`SPRINGB` in mesh.file.ignore"),
        "{told}"
    );
}

#[test]
fn messages_have_the_numbers_of_the_file() {
    // node 7 on node 6: cells without area
    let deck = strip(false).replace("\n7, 1, 1\n", "\n7, 0.5, 0\n") + &right(false);
    let (told, u) = run("plane-stress", "strip.inp", deck.as_bytes(), &[]);
    assert!(
        u.is_none() && flat(&told).contains("by the numbers of the file: element 101"),
        "{told}"
    );
}

/// Cells by VTK's numbers and their nodes.
type Cells = Vec<(u8, Vec<usize>)>;

/// A column of four cubes along x: two voxels, two prisms, six pyramids.
fn column() -> (Vec<[f64; 3]>, Cells) {
    let mut points: Vec<[f64; 3]> = Vec::new();
    for i in 0..5 {
        for j in 0..4 {
            points.push([f64::from(i), f64::from(j % 2), f64::from(j / 2)]);
        }
    }
    points.push([3.5, 0.45, 0.55]);
    let at = |i: usize, j: usize, k: usize| 4 * i + j + 2 * k;
    let voxel = |i| -> Vec<usize> {
        // x fastest
        (0..8)
            .map(|n: usize| at(i + (n & 1), n >> 1 & 1, n >> 2))
            .collect()
    };
    let prism = |corners: [[usize; 2]; 3]| -> Vec<usize> {
        let face = |i: usize| corners.map(|[j, k]| at(i, j, k));
        [face(2), face(3)].concat()
    };
    let pyramid = |base: [[usize; 3]; 4]| -> Vec<usize> {
        base.map(|[i, j, k]| at(i, j, k))
            .into_iter()
            .chain([20])
            .collect()
    };
    let mut cells: Cells = vec![
        (11, voxel(0)),
        (11, voxel(1)),
        (13, prism([[0, 0], [1, 0], [1, 1]])),
        (13, prism([[0, 0], [1, 1], [0, 1]])),
    ];
    for base in [
        [[3, 0, 0], [3, 1, 0], [3, 1, 1], [3, 0, 1]],
        [[4, 0, 0], [4, 1, 0], [4, 1, 1], [4, 0, 1]],
        [[3, 0, 0], [4, 0, 0], [4, 0, 1], [3, 0, 1]],
        [[3, 1, 0], [4, 1, 0], [4, 1, 1], [3, 1, 1]],
        [[3, 0, 0], [4, 0, 0], [4, 1, 0], [3, 1, 0]],
        [[3, 0, 1], [4, 0, 1], [4, 1, 1], [3, 1, 1]],
    ] {
        cells.push((14, pyramid(base)));
    }
    (points, cells)
}

/// The column as a file of VTK.
fn column_of_vtk() -> String {
    let (points, cells) = column();
    let words = |list: Vec<String>| list.join(" ");
    let places = words(points.iter().flatten().map(f64::to_string).collect());
    let nodes = words(
        cells
            .iter()
            .flat_map(|c| &c.1)
            .map(usize::to_string)
            .collect(),
    );
    let mut end = 0;
    let ends = cells.iter().map(|c| {
        end += c.1.len();
        end.to_string()
    });
    let ends = words(ends.collect());
    let types = words(cells.iter().map(|c| c.0.to_string()).collect());
    let array = |kind: &str, name: &str, extra: &str, data: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" {extra} format=\"ascii\">{data}</DataArray>"
        )
    };
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid><Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\"><Points>{}</Points><Cells>{}{}{}</Cells></Piece></UnstructuredGrid></VTKFile>",
        points.len(),
        cells.len(),
        array("Float64", "Points", "NumberOfComponents=\"3\"", &places),
        array("Int64", "connectivity", "", &nodes),
        array("Int64", "offsets", "", &ends),
        array("UInt8", "types", "", &types)
    )
}

/// The column as a deck, with the face at its end.
fn column_of_abaqus() -> String {
    let (points, cells) = column();
    let mut deck = String::from("*NODE\n");
    for (k, [x, y, z]) in points.iter().enumerate() {
        let _ = writeln!(deck, "{}, {x}, {y}, {z}", k + 1);
    }
    for (k, (kind, mut nodes)) in cells.into_iter().enumerate() {
        let name = match kind {
            11 => "C3D8",
            13 => "C3D6",
            _ => "C3D5",
        };
        if kind == 11 {
            nodes.swap(2, 3);
            nodes.swap(6, 7);
        }
        let nodes: Vec<String> = nodes.iter().map(|n| (n + 1).to_string()).collect();
        let _ = writeln!(
            deck,
            "*ELEMENT, TYPE={name}\n{}, {}",
            k + 1,
            nodes.join(", ")
        );
    }
    deck + "*SURFACE, NAME=RIGHT\n6, S1\n"
}

#[test]
fn voxels_prisms_and_pyramids_carry_a_uniform_stress() {
    let plane = |axis: usize, at: f64| {
        let (mut low, mut high) = ([-9.0; 3], [9.0; 3]);
        (low[axis], high[axis]) = (at - 0.01, at + 0.01);
        format!("{{ inside.box = {{ min = {low:?}, max = {high:?} }}")
    };
    let set = [
        format!("conditions.l.displacement={}, x = 0 }}", plane(0, 0.0)),
        format!("conditions.b.displacement={}, y = 0 }}", plane(1, 0.0)),
        format!("conditions.c.displacement={}, z = 0 }}", plane(2, 0.0)),
        format!("conditions.p.displacement={}, x = 0.04 }}", plane(0, 4.0)),
        "output.probes.e.at=[4, 0.5, 0]".to_owned(),
    ];
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let (told, u) = run("solid", "column.vtu", column_of_vtk().as_bytes(), &set);
    is_pulled(u, &told);
    // hexahedra 2 × 6, prisms 2 × 3, pyramids 6 × 2
    assert!(
        flat(&told).contains("8 prisms and pyramids and 2 hexahedra are read as 30 tetrahedra"),
        "{told}"
    );
    // pulled by a traction on the base of a pyramid
    let (told, u) = run(
        "solid",
        "column.inp",
        column_of_abaqus().as_bytes(),
        &[set[0], set[1], set[2], set[4]],
    );
    is_pulled(u, &told);
}

/// Pixels of two phases, and of a background that is left out.
#[test]
fn a_picture_is_a_mesh() {
    // x fastest: 4 by 2 pixels of phases 1 and 2, below 4 of the background
    let phases = "1 1 2 2 2 1 1 2 0 0 0 0";
    let image = |data: &str| {
        format!(
            "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"2 6 0 3 0 0\" Origin=\"-2 0 0\" Spacing=\"1 1 1\"><Piece Extent=\"2 6 0 3 0 0\"><{data}><DataArray type=\"UInt8\" Name=\"phase\" format=\"ascii\">{phases}</DataArray></{data}></Piece></ImageData></VTKFile>"
        )
    };
    let plane = |axis: usize, at: f64| {
        let (mut low, mut high) = ([-9.0; 2], [9.0; 2]);
        (low[axis], high[axis]) = (at - 0.01, at + 0.01);
        format!("{{ inside.box = {{ min = {low:?}, max = {high:?} }}")
    };
    let set = [
        format!("conditions.l.displacement={}, x = 0 }}", plane(0, 0.0)),
        format!("conditions.b.displacement={}, y = 0 }}", plane(1, 0.0)),
        format!("conditions.p.displacement={}, x = 0.04 }}", plane(0, 4.0)),
        "mesh.file.ignore=[\"phase_0\"]".to_owned(),
        "materials={a={lps={youngs-modulus=200,poisson-ratio=0.3,cells.set=\"phase_1\"}},b={lps={youngs-modulus=200,poisson-ratio=0.3,cells.set=\"phase_2\"}}}".to_owned(),
    ];
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let (told, u) = run(
        "plane-stress",
        "picture.vti",
        image("CellData").as_bytes(),
        &set,
    );
    is_pulled(u, &told);
    assert!(
        told.contains("FE cells") && flat(&told).contains("FE cells 8"),
        "{told}"
    );
    let (told, u) = run(
        "plane-stress",
        "picture.vti",
        image("PointData").as_bytes(),
        &set,
    );
    assert!(
        u.is_none() && flat(&told).contains("PointDataToCellData"),
        "{told}"
    );
    let (told, u) = run(
        "plane-stress",
        "picture.vti",
        image("CellData").as_bytes(),
        &["mesh.file.ignore=[\"phase_9\"]"],
    );
    assert!(
        u.is_none() && flat(&told).contains("phase_9") && told.contains("phase_2"),
        "{told}"
    );
}

#[test]
fn groups_that_saveall_drops_are_named() {
    let mesh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n1 1 \"LEFT\"\n$EndPhysicalNames\n$Nodes\n4\n1 0 0 0\n2 4 0 0\n3 4 1 0\n4 0 1 0\n$EndNodes\n$Elements\n1\n1 3 2 0 1 1 2 3 4\n$EndElements\n";
    let (told, _) = run("plane-stress", "plate.msh", mesh.as_bytes(), &[]);
    assert!(
        flat(&told).contains(
            "the physical groups LEFT: in version 2.2 Gmsh writes none with Mesh.SaveAll"
        ),
        "{told}"
    );
}

/// A strip of 1 by 4 with an edge crack of half its width at its middle, along which nodes lie in pairs.
fn cracked(cells: usize) -> String {
    let (nx, ny) = (cells, 4 * cells);
    let row = nx + 1;
    let mut deck = String::from("*NODE\n");
    for j in 0..=ny {
        for i in 0..=nx {
            let (x, y) = (i as f64 / cells as f64, j as f64 / cells as f64 - 2.0);
            let _ = writeln!(deck, "{}, {x}, {y}", j * row + i + 1);
        }
    }
    // the upper face
    let upper = |i: usize| 100_000 + i;
    for i in 0..nx / 2 {
        let _ = writeln!(deck, "{}, {}, 0", upper(i), i as f64 / cells as f64);
    }
    deck.push_str("*ELEMENT, TYPE=CPS4\n");
    for j in 0..ny {
        for i in 0..nx {
            let at = |i: usize, k: usize| match j == ny / 2 && k == 0 && i < nx / 2 {
                true => upper(i),
                false => (j + k) * row + i + 1,
            };
            let [a, b, c, d] = [at(i, 0), at(i + 1, 0), at(i + 1, 1), at(i, 1)];
            let _ = writeln!(deck, "{}, {a}, {b}, {c}, {d}", j * nx + i + 1);
        }
    }
    deck
}

/// The strip with its crack, pulled by 2 along y.
const CRACKED: &str = r#"
kinematics = "plane-stress"
coupling = "local"
mesh.file.path = "cracked.inp"
materials.steel.bond-based.youngs-modulus = 200
peridynamics = { horizon = 0.075, points.lattice = { spacing = 0.025, origin = [0.0125, 0.0125] } }
conditions.b.displacement = { inside.box = { min = [-1, -2.001], max = [9, -1.999] }, y = 0 }
conditions.c.displacement = { inside.box = { min = [0.99, -2.1], max = [1.01, -1.99] }, x = 0 }
conditions.p.traction = { on = "top", y = 2 }
output.probes.above = { at = [0, 0.0625] }
output.probes.below = { at = [0, -0.0625] }
output.vtu = false
"#;

#[test]
fn a_crack_of_the_mesher_opens_in_elements_and_in_points() {
    let cells = 40;
    let mut deck = cracked(cells);
    deck.push_str("*SURFACE, NAME=top\n");
    let first = 4 * cells * cells - cells + 1;
    for element in first..first + cells {
        let _ = writeln!(deck, "{element}, S3");
    }
    // Tada: 4 σ a V/E, V = (1.46 + 3.42 (1 − cos(π/4)))/cos²(π/4), of a long strip
    let closed = 4.0 * 2.0 * 0.5 / 200.0 * (1.46 + 3.42 * (1.0 - 0.5f64.sqrt())) / 0.5;
    let zone = "zones.nonlocal.box={ min = [-1, -0.4], max = [0.8, 0.4] }";
    let opening = |set: &[&str]| {
        let (told, u) = run_scene(CRACKED, ("cracked.inp", deck.as_bytes()), set);
        assert!(u.len() == 2, "{told}");
        (u[0][1] - u[1][1], told)
    };
    let (local, told) = opening(&[]);
    assert!(
        flat(&told).contains("20 pairs of nodes lie at one place each"),
        "{told}"
    );
    // bilinear elements, 20 along the crack: 3.5 %
    assert!((local / closed - 1.0).abs() < 0.05, "{local} {closed}");
    let typed = "cracks.c.segment={ from = [-0.1, 0], to = [0.5, 0] }";
    for coupling in ["coupling=truncated", "coupling=splice"] {
        // the crack cuts bonds as one that the scene types
        let (coupled, told) = opening(&[coupling, zone]);
        let (cut, _) = opening(&[coupling, zone, "mesh.file.merge=1e-9", typed]);
        assert!(
            (coupled / cut - 1.0).abs() < 1e-9,
            "{coupling} {coupled} {cut}"
        );
        // points of h = a/20: 7.4 %
        assert!(
            (coupled / closed - 1.0).abs() < 0.1,
            "{coupled} {closed}\n{told}"
        );
    }
    let (merged, told) = opening(&["mesh.file.merge=1e-9"]);
    assert!(
        (merged / (2.0 * 0.125 / 200.0) - 1.0).abs() < 1e-9,
        "{merged}\n{told}"
    );
    let (kept, told) = opening(&["mesh.file.merge=false"]);
    assert!(kept == local && !told.contains("pairs of nodes"), "{told}");
}
