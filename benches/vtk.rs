//! Files of VTK by the library's own reader and writer beside vtkio: seconds and bytes for a million points, which files of the repository vtkio reads, and what it
//! makes of damaged ones: `cargo bench --bench vtk`.

use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use bondline::mesh::CellShape;
use bondline::mesh::read::read;
use bondline::observe::vtu::{Compression, Field, Snapshot, write_vtu};
use bondline::tensor::Vector;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataSet, UnstructuredGridPiece, Version,
    VertexNumbers, Vtk,
};
use vtkio::xml::Compressor;

/// Nodes along each edge of the cube.
const EDGE: u32 = 100;

/// Copies of each file that are damaged.
const DAMAGED: usize = 300;

/// Readers of damaged files, as arguments of processes of their own.
const READERS: [&str; 2] = ["--read-by-library", "--read-by-vtkio"];

/// A cube of hexahedra with the fields of a default run: a vector, a scalar and a label of each node, a tensor of each cell.
fn cube() -> Snapshot {
    let node = |i: u32, j: u32, k: u32| (k * EDGE + j) * EDGE + i;
    let mut s = Snapshot::default();
    let place = |n: u32| {
        Vector::<3>::new(
            (n % EDGE).into(),
            (n / EDGE % EDGE).into(),
            (n / EDGE / EDGE).into(),
        )
    };
    let nodes: Vec<Vector<3>> = (0..EDGE.pow(3)).map(place).collect();
    s.points = nodes.iter().map(|x| [x[0], x[1], x[2]]).collect();
    for c in 0..(EDGE - 1).pow(3) {
        let n = EDGE - 1;
        let (i, j, k) = (c % n, c / n % n, c / n / n);
        let base = [(0, 0), (1, 0), (1, 1), (0, 1)];
        let corners = [0, 1].map(|up| base.map(|(a, b)| node(i + a, j + b, k + up)));
        s.push_cell(CellShape::Hex8, corners.as_flattened());
    }
    let wave =
        |x: &Vector<3>, a: f64| (a * x[0] / 17.0).sin() * (x[1] / 23.0 + a).cos() + 1e-3 * x[2];
    let moved: Vec<Vector<3>> = nodes
        .iter()
        .map(|x| Vector::<3>::new(wave(x, 1.0), wave(x, 2.0), wave(x, 3.0)))
        .collect();
    let damage = nodes.iter().map(|x| wave(x, 4.0).max(0.0)).collect();
    s.point_fields = vec![
        Field::vector("displacement", &moved),
        Field::scalar("damage", damage),
        Field::labels("model", (0..nodes.len()).map(|n| (n % 3) as u8).collect()),
    ];
    let stress = (0..s.shapes.len()).map(|c| {
        let x = &nodes[c];
        std::array::from_fn(|i| std::array::from_fn(|j| wave(x, (i + j) as f64)))
    });
    s.cell_fields = vec![Field::rows("stress", stress)];
    s
}

/// The same for vtkio.
fn for_vtkio(s: &Snapshot) -> Vtk {
    use bondline::observe::vtu::Values;
    let attribute = |f: &Field| {
        let array = vtkio::model::DataArray::new(f.name.clone(), f.components as u32);
        Attribute::DataArray(match &f.values {
            Values::Real(v) => array.with_vec(v.clone()),
            Values::Byte(v) => array.with_vec(v.clone()),
            Values::Integer(v) => array.with_vec(v.clone()),
            Values::Identifier(v) => array.with_vec(v.clone()),
        })
    };
    Vtk {
        version: Version::new_xml(1, 0),
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        file_path: None,
        data: DataSet::inline(UnstructuredGridPiece {
            points: s.points.as_flattened().to_vec().into(),
            cells: Cells {
                cell_verts: VertexNumbers::XML {
                    connectivity: s.connectivity.iter().map(|&n| n.into()).collect(),
                    offsets: (1..=s.shapes.len() as u64).map(|c| 8 * c).collect(),
                },
                types: vec![CellType::Hexahedron; s.shapes.len()],
            },
            data: Attributes {
                point: s.point_fields.iter().map(attribute).collect(),
                cell: s.cell_fields.iter().map(attribute).collect(),
            },
        }),
    }
}

/// Seconds of the faster of two times.
fn seconds(mut work: impl FnMut()) -> f64 {
    let mut once = || {
        let begun = Instant::now();
        work();
        begun.elapsed().as_secs_f64()
    };
    once().min(once())
}

fn row(what: &str, seconds: f64, path: &Path) {
    let bytes = std::fs::metadata(path).map_or(0, |m| m.len());
    println!("{what:44} {seconds:7.2} s {:8.1} MB", bytes as f64 / 1e6);
}

fn size_and_time(folder: &Path) {
    let shown = cube();
    println!(
        "{} points, {} hexahedra, written:",
        shown.points.len(),
        shown.shapes.len()
    );
    let path = |name: &str| folder.join(name);
    for (name, file, compression) in [
        (
            "own, base64 by zlib, as runs write",
            "own.vtu",
            Compression::Zlib,
        ),
        ("own, base64", "own_plain.vtu", Compression::Plain),
    ] {
        row(
            name,
            seconds(|| write_vtu(&path(file), &shown, compression).unwrap()),
            &path(file),
        );
    }
    // what it takes is made before the time begins
    let mut copies = vec![for_vtkio(&shown); 6];
    let mut next = || copies.pop().unwrap();
    let file = path("vtkio.vtu");
    row(
        "vtkio, base64",
        seconds(|| next().export(&file).unwrap()),
        &file,
    );
    let file = path("vtkio_zlib.vtu");
    let zlib = |vtk: Vtk| {
        vtk.try_into_xml_format(Compressor::ZLib, 1)
            .unwrap()
            .export(&file)
            .unwrap()
    };
    row("vtkio, asked for zlib", seconds(|| zlib(next())), &file);
    let file = path("vtkio.vtk");
    row(
        "vtkio, legacy, binary",
        seconds(|| next().export(&file).unwrap()),
        &file,
    );
    println!("read:");
    for file in [
        "own.vtu",
        "own_plain.vtu",
        "vtkio.vtu",
        "vtkio_zlib.vtu",
        "vtkio.vtk",
    ] {
        let at = path(file);
        let own = seconds(|| drop(read::<3>(&at).map(|m| m.cell_count())));
        row(&format!("{file}, mesh alone by the library"), own, &at);
        let other = seconds(|| drop(loaded(&at)));
        row(&format!("{file}, all fields by vtkio"), other, &at);
    }
}

/// Number of cells that vtkio finds.
fn loaded(path: &Path) -> Result<usize, String> {
    let vtk = Vtk::import(path).map_err(|e| e.to_string())?;
    let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else {
        return Err("no unstructured grid".to_owned());
    };
    let mut cells = 0;
    for piece in pieces {
        let piece = piece
            .into_loaded_piece_data(None)
            .map_err(|e| e.to_string())?;
        cells += piece.cells.types.len();
    }
    Ok(cells)
}

/// All files of VTK in `tests/fixtures`, then damaged copies: a byte that is another one, or the end missing.
fn fixtures(folder: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let is_vtk = |p: &PathBuf| p.extension().is_some_and(|e| e == "vtu" || e == "vtk");
    let entries = std::fs::read_dir(root).unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(is_vtk).collect();
    files.sort();
    std::panic::set_hook(Box::new(|_| ()));
    let mut random: u64 = 1;
    let mut draw = |below: usize| {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as usize % below
    };
    println!(
        "\nfile, cells by the library, by vtkio; of {DAMAGED} damaged copies, by the library and by vtkio: ended by a panic or for want of memory, refused, with the place named"
    );
    for file in &files {
        let own = read::<2>(file).map_or_else(|_| "refused".into(), |m| m.cell_count().to_string());
        let other = catch_unwind(|| loaded(file)).map_or_else(
            |_| "panics".to_owned(),
            |found| found.map_or_else(|e| e, |n| format!("{n} elements")),
        );
        let bytes = std::fs::read(file).unwrap();
        let damaged = folder.join(file.file_name().unwrap());
        let mut ended = [[0; 3]; 2];
        for copy in 0..DAMAGED {
            let mut bytes = bytes.clone();
            if copy % 10 == 0 {
                bytes.truncate(draw(bytes.len()));
            } else {
                let at = draw(bytes.len());
                bytes[at] = draw(256) as u8;
            }
            std::fs::write(&damaged, bytes).unwrap();
            for (reader, ended) in READERS.iter().zip(&mut ended) {
                // memory that cannot be had ends the process
                let mut child = Command::new(std::env::current_exe().unwrap());
                child.args([reader.as_ref(), damaged.as_os_str()]);
                let output = child.stderr(Stdio::null()).output().unwrap();
                let said = String::from_utf8_lossy(&output.stdout);
                let has_place = ["line ", "byte ", "cell ", "node "]
                    .iter()
                    .any(|w| said.contains(w));
                ended[0] += usize::from(!output.status.success());
                ended[1] += usize::from(!said.is_empty());
                ended[2] += usize::from(has_place);
            }
        }
        let name = file.file_name().unwrap().to_string_lossy();
        println!(
            "{name:22} {own:>8} {other:>24}   {:?} {:?}",
            ended[0], ended[1]
        );
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [reader, file] = arguments.as_slice() {
        let file = Path::new(file);
        let refused = match reader == READERS[0] {
            true => read::<2>(file).err().map(|e| e.to_string()),
            false => loaded(file).err(),
        };
        return print!("{}", refused.unwrap_or_default());
    }
    let folder = tempfile::tempdir().unwrap();
    size_and_time(folder.path());
    fixtures(folder.path());
}
