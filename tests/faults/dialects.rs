//! Mesh files as other programs write them: line ends, comments, parts of meshes, cells that are hidden, cells of second order, two instances.

use std::fmt::Write as _;

use super::files::{is_pulled, right, run, strip};
use super::flat;

/// The numbers of the strip of a deck, `*KEYWORD` by `*KEYWORD`.
fn deck() -> String {
    strip(false) + &right(false)
}

#[test]
fn decks_of_other_editors_are_read() {
    let continued = deck().replace(
        "*ELEMENT, TYPE=CPS4, ELSET=A",
        "*Element, type=CPS4,\n** cells\nelset=A",
    );
    let comma = |line: &str| match line.starts_with('*') {
        true => format!("{line}\n"),
        false => format!("{line},\n"),
    };
    let with_commas: String = deck().lines().map(comma).collect();
    for (name, text) in [
        ("a carriage return alone", deck().replace('\n', "\r")),
        ("both", deck().replace('\n', "\r\n")),
        ("tabulators", deck().replace(", ", ",\t")),
        ("commas at the end", with_commas),
        (
            "exponents of Fortran",
            deck().replace("\n7, 1, 1\n", "\n7, 1.D0, 0.1d+01\n"),
        ),
        ("keywords over lines", continued),
        (
            "comments between",
            deck().replace("\n104, ", "\n**\n** a comment\n\n104, "),
        ),
    ] {
        let (told, u) = run("plane-stress", "strip.inp", text.as_bytes(), &[]);
        assert!(u.is_some(), "{name}: {told}");
        is_pulled(u, &told);
    }
}

/// Two instances that touch without a node in common: each node by the name of its instance.
#[test]
fn numbers_of_instances_have_their_names() {
    let part = strip(false).split("*NSET").next().unwrap().to_owned();
    let instances = |x: f64| {
        format!(
            "*PART, NAME=P\n{part}*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=lower, PART=P\n*END INSTANCE\n*INSTANCE, NAME=upper, PART=P\n{x}, 0\n*END INSTANCE\n*NSET, NSET=LEFT, INSTANCE=lower\n1, 6, 11\n*NSET, NSET=BOT\nlower.1, lower.2, upper.5\n*SURFACE, NAME=RIGHT\nupper.104, S2\nupper.108, S2\n*END ASSEMBLY\n"
        )
    };
    let (told, u) = run("plane-stress", "two.inp", instances(4.0).as_bytes(), &[]);
    let told = flat(&told);
    assert!(
        u.is_none() && told.contains("by the numbers of the file: node lower.5, node upper.1"),
        "{told}"
    );
    let merged = ["mesh.file.merge=1e-9", "output.probes.e.at=[8, 0.5]"];
    let (told, u) = run(
        "plane-stress",
        "two.inp",
        instances(4.0).as_bytes(),
        &merged,
    );
    let u = u.unwrap_or_else(|| panic!("{told}"));
    // twice as long
    assert!(
        (u[0] - 0.08).abs() < 1e-12 && told.contains("within 1e-9"),
        "{u:?} {told}"
    );
}

/// A strip of 4 by 2 squares of Gmsh's version 2.2 with edges at the left (1), the bottom (2) and the right (3).
fn gmsh(cell: &str, middle: bool, tags: impl Fn(usize) -> String) -> String {
    let (nx, ny) = if middle { (8, 4) } else { (4, 2) };
    let node = |i: usize, j: usize| 1 + i + (nx + 1) * j;
    let step = if middle { 2 } else { 1 };
    let mut nodes = String::new();
    for j in 0..=ny {
        for i in 0..=nx {
            let (x, y) = (4.0 * i as f64 / nx as f64, 2.0 * j as f64 / ny as f64);
            let _ = writeln!(nodes, "{} {x} {y} 0", node(i, j));
        }
    }
    let mut elements: Vec<String> = Vec::new();
    let mut edge = |group: usize, ends: [usize; 2]| {
        let number = elements.len() + 1;
        elements.push(format!(
            "{number} 1 2 {group} {group} {} {}",
            ends[0], ends[1]
        ));
    };
    for j in (0..ny).step_by(step) {
        edge(1, [node(0, j), node(0, j + step)]);
        edge(3, [node(nx, j), node(nx, j + step)]);
    }
    for i in (0..nx).step_by(step) {
        edge(2, [node(i, 0), node(i + step, 0)]);
    }
    for j in (0..ny).step_by(step) {
        for i in (0..nx).step_by(step) {
            let corners = [[0, 0], [2, 0], [2, 2], [0, 2]];
            let others = [[1, 0], [2, 1], [1, 2], [0, 1], [1, 1]];
            let count = if middle { 5 } else { 0 };
            let all = corners.iter().chain(&others[..count]);
            let own = all.map(|[a, b]| node(i + a * step / 2, j + b * step / 2).to_string());
            let own: Vec<String> = own.collect();
            let number = elements.len() + 1;
            elements.push(format!(
                "{number} {cell} {} {}",
                tags(elements.len()),
                own.join(" ")
            ));
        }
    }
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"LEFT\"\n1 2 \"BOT\"\n1 3 \"RIGHT\"\n$EndPhysicalNames\n$Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{}\n{}\n$EndElements\n",
        (nx + 1) * (ny + 1),
        elements.len(),
        elements.join("\n")
    )
}

#[test]
fn comments_parts_and_cells_of_nine_nodes_of_gmsh() {
    let whole = gmsh("3", false, |_| "2 9 1".to_owned());
    let commented = format!("$Comments\nmade by a program\n$EndComments\n{whole}");
    let (told, u) = run("plane-stress", "strip.msh", commented.as_bytes(), &[]);
    is_pulled(u, &told);
    // two partitions in one file, and one of them in a file of its own
    let both = gmsh("3", false, |k| format!("4 9 1 1 {}", 1 + k % 2));
    let (told, u) = run("plane-stress", "strip.msh", both.as_bytes(), &[]);
    is_pulled(u, &told);
    let one = gmsh("3", false, |_| "4 9 1 1 2".to_owned());
    let (told, u) = run("plane-stress", "strip_2.msh", one.as_bytes(), &[]);
    let told = flat(&told);
    assert!(
        u.is_none()
            && told.contains("the partition 2 alone of a partitioned mesh")
            && told.contains("PartitionSplitMeshFiles = 0"),
        "{told}"
    );
    // Gmsh's own cells of second order
    let nine = gmsh("10", true, |_| "2 9 1".to_owned());
    let (told, u) = run("plane-stress", "strip.msh", nine.as_bytes(), &[]);
    assert!(
        u.is_none() && flat(&told).contains("mesh.file.order = \"linear\""),
        "{told}"
    );
    let linear = ["mesh.file.order=\"linear\""];
    let (told, u) = run("plane-stress", "strip.msh", nine.as_bytes(), &linear);
    is_pulled(u, &told);
}

/// A structured grid of 5 by 2 squares of which the last column is hidden, as VTK's filters leave it.
#[test]
fn hidden_cells_are_left_out() {
    let points: Vec<String> = (0..18).map(|k| format!("{} {} 0", k % 6, k / 6)).collect();
    let marks = (0..10).map(|c| if c % 5 == 4 { "32" } else { "0" });
    let marks: Vec<&str> = marks.collect();
    let grid = format!(
        "<VTKFile type=\"StructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><StructuredGrid WholeExtent=\"0 5 0 2 0 0\"><Piece Extent=\"0 5 0 2 0 0\"><CellData><DataArray type=\"UInt8\" Name=\"vtkGhostType\" format=\"ascii\">{}</DataArray></CellData><Points><DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" format=\"ascii\">{}</DataArray></Points></Piece></StructuredGrid></VTKFile>",
        marks.join(" "),
        points.join(" ")
    );
    let plane = |axis: usize, at: f64| {
        let (mut low, mut high) = ([-9.0; 2], [9.0; 2]);
        (low[axis], high[axis]) = (at - 0.01, at + 0.01);
        format!("{{ inside.box = {{ min = {low:?}, max = {high:?} }}")
    };
    let set = [
        format!("conditions.l.displacement={}, x = 0 }}", plane(0, 0.0)),
        format!("conditions.b.displacement={}, y = 0 }}", plane(1, 0.0)),
        format!("conditions.p.displacement={}, x = 0.04 }}", plane(0, 4.0)),
    ];
    let set: Vec<&str> = set.iter().map(String::as_str).collect();
    let (told, u) = run("plane-stress", "grid.vts", grid.as_bytes(), &set);
    is_pulled(u, &told);
    let told = flat(&told);
    assert!(
        told.contains("FE cells 8") && told.contains("2 of 10 cells, which vtkGhostType marks"),
        "{told}"
    );
}
