//! VTU files of several processes are the parts of that of one, by the numbers of their points and cells in it, as another program reads them.

use std::collections::BTreeMap;
use std::path::Path;

use bondline::observe::claim::{Claim, Files};
use vtkio::model::{Attribute, DataSet, UnstructuredGridPiece, Vtk};

use crate::threads::{ALONE, How, files, folder, run};
use crate::{bar, plate};

/// The fields by which a piece tells its numbers, of points and of cells.
const IDENTIFIERS: [&str; 2] = ["GlobalPointIds", "GlobalCellIds"];

/// Contents of a file, or of a part of it, as a reader sees them.
struct Grid {
    points: Vec<f64>,
    /// Type and points of each cell.
    cells: Vec<(u8, Vec<u64>)>,
    /// Numbers of each field, over points and over cells.
    fields: [BTreeMap<String, Vec<f64>>; 2],
}

impl Grid {
    fn of(piece: UnstructuredGridPiece) -> Self {
        let types = piece.cells.types.iter().map(|&t| t as u8);
        let (nodes, ends) = piece.cells.cell_verts.into_xml();
        let mut start = 0;
        let cells = types.zip(ends).map(|(kind, end)| {
            let of_cell = nodes[start..end as usize].to_vec();
            start = end as usize;
            (kind, of_cell)
        });
        let field = |attribute: Attribute| {
            let name = attribute.name().to_owned();
            let Attribute::DataArray(array) = attribute else {
                panic!("{name} is no array");
            };
            (name, array.data.cast_into::<f64>().expect("numbers"))
        };
        Self {
            points: piece.points.cast_into().expect("numbers"),
            cells: cells.collect(),
            fields: [piece.data.point, piece.data.cell]
                .map(|data| data.into_iter().map(field).collect()),
        }
    }

    /// Removes the numbers of points and of cells.
    fn take_identifiers(&mut self) -> [Vec<usize>; 2] {
        let mut of = |k: usize| {
            let numbers = self.fields[k].remove(IDENTIFIERS[k]).expect(IDENTIFIERS[k]);
            numbers.into_iter().map(|n| n as usize).collect()
        };
        [of(0), of(1)]
    }
}

/// The pieces of a file.
fn read(path: &Path) -> Vec<Grid> {
    let read = Vtk::import(path).expect("a file that can be read");
    let DataSet::UnstructuredGrid { pieces, .. } = read.data else {
        panic!("no cells in {}", path.display());
    };
    pieces
        .into_iter()
        .map(|piece| piece.into_loaded_piece_data(Some(path)).expect("a piece"))
        .map(Grid::of)
        .collect()
}

/// Test that a number of a field is that of one process.
pub type Agrees<'a> = &'a dyn Fn(&str, f64, f64) -> bool;

fn bits(_: &str, a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits()
}

/// The pieces together are the file `one`; returns their numbers of cells.
pub fn assert_joined(one: &Path, list: &Path, agrees: Agrees<'_>) -> Vec<usize> {
    let [whole] = &read(one)[..] else {
        panic!("one piece in {}", one.display());
    };
    let mut seen = [whole.points.len() / 3, whole.cells.len()].map(|n| vec![0; n]);
    let pieces = read(list).into_iter();
    let sizes = pieces.map(|mut piece| {
        let numbers = piece.take_identifiers();
        for (seen, numbers) in seen.iter_mut().zip(&numbers) {
            numbers.iter().for_each(|&n| seen[n] += 1);
        }
        for (x, &n) in piece.points.chunks_exact(3).zip(&numbers[0]) {
            assert_eq!(x, &whole.points[3 * n..][..3], "point {n}");
        }
        for ((kind, nodes), &n) in piece.cells.iter().zip(&numbers[1]) {
            let nodes: Vec<u64> = nodes
                .iter()
                .map(|&k| numbers[0][k as usize] as u64)
                .collect();
            assert_eq!((*kind, nodes), whole.cells[n], "cell {n}");
        }
        for ((fields, wanted), numbers) in piece.fields.iter().zip(&whole.fields).zip(&numbers) {
            assert!(fields.keys().eq(wanted.keys()), "{:?}", fields.keys());
            for ((name, values), wanted) in fields.iter().zip(wanted.values()) {
                let width = values.len() / numbers.len();
                for (values, &n) in values.chunks_exact(width).zip(numbers) {
                    let wanted = &wanted[n * width..][..width];
                    let mut pairs = values.iter().zip(wanted);
                    let alike = pairs.all(|(a, b)| agrees(name, *a, *b));
                    assert!(alike, "{name} of {n}: {values:?} where one has {wanted:?}");
                }
            }
        }
        piece.cells.len()
    });
    let sizes: Vec<usize> = sizes.collect();
    // nodes between two pieces stand in both, cells in one
    assert!(seen[0].iter().all(|&times| times > 0), "a point is missing");
    assert!(seen[1].iter().all(|&times| times == 1), "a cell");
    sizes
}

/// A folder of several processes holds the results of one: pieces where VTU files are, and else the same bytes. Files of which each process does not have a piece are those of one process, where
/// a run went on from such. Returns the numbers of cells in the pieces of each file.
pub fn assert_same_files(one: &Path, several: &Path, agrees: Agrees<'_>) -> Vec<Vec<usize>> {
    let (wanted, mut found) = (files(one), files(several));
    let mut sizes = Vec::new();
    for (name, bytes) in &wanted {
        let list = name.replace(".vtu", ".pvtu");
        if let Some(own) = found.remove(name) {
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).replace(".pvtu", ".vtu");
            match name.ends_with(".pvd") {
                true => {
                    assert_eq!(text(&own), text(bytes));
                    let named = String::from_utf8(own).expect("text");
                    let named = named.split("file=\"").skip(1);
                    for file in named.map(|s| s.split('"').next().unwrap()) {
                        assert!(several.join(file).exists(), "{name} names {file}");
                    }
                }
                false => assert!(own == *bytes, "{name}"),
            }
        } else {
            let text = found.remove(&list).expect("a list of pieces");
            let text = String::from_utf8(text).expect("text");
            sizes.push(assert_joined(&one.join(name), &several.join(&list), agrees));
            let sources = text.split("Source=\"").skip(1);
            for piece in sources.map(|s| s.split('"').next().unwrap()) {
                assert!(found.remove(piece).is_some(), "{piece}");
            }
        }
        if let (Some(list), true) = (found.get(&list), name.ends_with(".vtu")) {
            panic!("{name} twice: {}", String::from_utf8_lossy(list));
        }
    }
    assert!(found.is_empty(), "left over: {:?}", found.keys());
    sizes
}

/// As [`assert_same_files`], to the last bit.
pub fn assert_same_numbers(one: &Path, several: &Path) -> Vec<Vec<usize>> {
    assert_same_files(one, several, &bits)
}

fn several(ranks: usize) -> How {
    How { ranks, ..ALONE }
}

#[test]
fn each_process_writes_its_part_of_cells_and_points() {
    let text = plate("bond-based", "[coupling.truncated]", "");
    let whole = folder();
    run(&text, whole.path(), ALONE).expect("one process");
    let parts = folder();
    run(&text, parts.path(), several(3)).expect("several processes");
    let sizes = assert_same_numbers(whole.path(), parts.path());
    assert_eq!(sizes.len(), 4);
    let all: usize = sizes[0].iter().sum();
    for of_file in sizes {
        assert_eq!(of_file.len(), 3);
        let share = |&n: &usize| (0.2..0.5).contains(&(n as f64 / all as f64));
        assert!(of_file.iter().all(share), "{of_file:?} of {all}");
    }
}

#[test]
fn points_shown_as_cells_keep_their_corners() {
    let text = plate("lps", "[coupling.splice]", "").replace(
        "[output]",
        "[output]\npoints = \"cells\"\nenergy-density = true\nstresses = [\"von-mises\"]",
    );
    let text = text.replace("duration = 10e-6", "duration = 2e-6");
    // energies of points are not those of exact bonds
    let text = text.replace("points.lattice", "bonds = \"linear\"\npoints.lattice");
    let whole = folder();
    run(&text, whole.path(), ALONE).expect("one process");
    let parts = folder();
    run(&text, parts.path(), several(2)).expect("several processes");
    assert_same_numbers(whole.path(), parts.path());
}

#[test]
fn so_do_parts_of_elements_that_a_rim_cuts() {
    let text = plate("bond-based", "[coupling.truncated]", "")
        .replace("[zones]", "[zones]\nrim = \"own\"")
        .replace("x = { cells = 40 }", "x = { cells = 31 }")
        .replace("min = [0, 0.0061]", "min = [0.008, 0.0061]")
        .replace("from = [-0.01, 0.01]", "from = [0.012, 0.01]")
        .replace(
            "spacing = \"1e-3/3\"",
            "spacing = \"1e-3/3\", origin = [1e-4, 2e-4]",
        )
        .replace(
            "sections.cut = { point = [0.02, 0.01], normal = [1, 0] }",
            "",
        )
        .replace("duration = 10e-6", "duration = 2e-6");
    let whole = folder();
    run(&text, whole.path(), ALONE).expect("one process");
    let shown = read(&whole.path().join("scene_0000.vtu"));
    let labels = &shown[0].fields[1]["model"];
    for label in [3.0, 4.0] {
        let count = labels.iter().filter(|found| **found == label).count();
        assert!(count > 50, "{count} of {label}");
    }
    let parts = folder();
    run(&text, parts.path(), several(3)).expect("several processes");
    assert_same_numbers(whole.path(), parts.path());
}

/// A static scene is solved again in the same folder, on other processes: nothing of the earlier ones is left.
#[test]
fn files_of_a_scene_at_rest_replace_those_of_other_processes() {
    let text = bar("[coupling.blending]") + "energy-density = true\n";
    let one = folder();
    run(&text, one.path(), ALONE).expect("one process");
    let again = folder();
    // solvers of several processes end at another last digit
    let close = |name: &str, a: f64, b: f64| match name {
        "displacement" => (a - b).abs() < 1e-9 * 5e-4,
        "strain" => (a - b).abs() < 1e-8 * 1e-3,
        "energy-density" => (a - b).abs() < 1e-7 * 1e5,
        "residual" | "linear_stress" => true,
        _ => a == b,
    };
    for ranks in [4, 2, 3] {
        run(&text, again.path(), several(ranks)).expect("several processes");
        let names: Vec<String> = files(again.path()).into_keys().collect();
        let vtk = names.iter().filter(|name| name.contains("vtu")).count();
        assert_eq!(vtk, ranks + 1, "{names:?}");
        let list = again.path().join("scene.pvtu");
        let sizes = assert_joined(&one.path().join("scene.vtu"), &list, &close);
        assert_eq!(sizes.len(), ranks);
    }
    run(&text, again.path(), ALONE).expect("one process");
    assert!(files(again.path()).keys().eq(files(one.path()).keys()));
}

/// A folder stands where the piece of one process would: all of them end with what that one says, and no list names what is not there.
#[test]
fn a_process_that_cannot_write_ends_all_with_its_words() {
    let text = plate("bond-based", "[coupling.truncated]", "");
    let blocked = folder();
    let inside = blocked.path().join("scene_0000_p1.vtu/inside");
    std::fs::create_dir_all(inside).expect("a folder");
    let told = run(&text, blocked.path(), several(3)).expect_err("no file");
    assert!(
        told.starts_with("process 1 of 3: cannot write") && told.contains("scene_0000_p1.vtu"),
        "{told}"
    );
    for name in ["scene_0000.pvtu", "scene.pvd"] {
        assert!(!blocked.path().join(name).exists(), "{name}");
    }
    std::fs::remove_dir_all(blocked.path().join("scene_0000_p1.vtu")).expect("a folder");
    // and where another run holds the files of the scene
    let held = Files {
        name: "scene".to_owned(),
        series: true,
        ..Files::default()
    };
    let held = Claim::take(blocked.path(), "another", &held).expect("a claim");
    let told = run(&text, blocked.path(), several(2)).expect_err("another run");
    assert!(told.starts_with("process 0 of 2: another run"), "{told}");
    drop(held);
    run(&text, blocked.path(), several(2)).expect("a run");
}
