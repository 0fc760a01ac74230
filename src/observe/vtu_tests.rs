//! VTU files as another reader reads them, and what is refused.

use vtkio::model;

use super::*;

/// `n` vertices, one cell of every other shape, and a field of every kind.
fn sample(n: usize) -> Snapshot {
    let mut s = Snapshot {
        time: Some(0.125),
        ..Snapshot::default()
    };
    let cloud: Vec<Vector<3>> = (0..n)
        .map(|i| Vector::<3>::new(i as f64 / 7.0, (i as f64).sin(), -0.1 * i as f64))
        .collect();
    assert_eq!(s.push_vertices(&cloud), 0);
    for shape in [
        CellShape::Line2,
        CellShape::Tri3,
        CellShape::Quad4,
        CellShape::Tet4,
        CellShape::Hex8,
    ] {
        let nodes: Vec<u32> = (0..shape.node_count() as u32).collect();
        s.push_cell(shape, &nodes);
    }
    let m = s.shapes.len();
    s.point_fields = vec![
        Field::vector("displacement", &cloud),
        Field::labels("model", (0..n).map(|i| (i % 3) as u8).collect()),
        Field::integers("family size", (0..n as i32).map(|i| -i).collect()),
        Field::identifiers("GlobalPointIds", (0..n as i64).map(|i| i << 33).collect()),
    ];
    let tensors: Vec<Tensor<2>> = (0..m)
        .map(|i| Tensor::<2>::new(1.0, 2.0, 3.0, i as f64))
        .collect();
    s.cell_fields = vec![
        Field::tensor("stress", &tensors),
        Field::scalar(
            "beta < 1 & \"odd\"",
            (0..m).map(|i| 1.0 / (i + 1) as f64).collect(),
        ),
    ];
    s
}

fn read(path: &Path) -> model::UnstructuredGridPiece {
    let model::DataSet::UnstructuredGrid { mut pieces, .. } =
        model::Vtk::import(path).unwrap().data
    else {
        panic!("not an unstructured grid");
    };
    pieces.remove(0).into_loaded_piece_data(None).unwrap()
}

fn reals(attribute: &model::Attribute) -> Vec<f64> {
    let model::Attribute::DataArray(array) = attribute else {
        panic!("not a data array");
    };
    array.data.cast_into::<f64>().unwrap()
}

fn expected(field: &Field) -> Vec<f64> {
    match &field.values {
        Values::Real(v) => v.clone(),
        Values::Byte(v) => v.iter().map(|&x| f64::from(x)).collect(),
        Values::Integer(v) => v.iter().map(|&x| f64::from(x)).collect(),
        Values::Identifier(v) => v.iter().map(|&x| x as f64).collect(),
    }
}

#[test]
fn everything_comes_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    // 4096 reals fill one zlib block of 32 KiB to the last byte
    for (n, compression) in [
        (9, Compression::Plain),
        (9, Compression::Zlib),
        (4096, Compression::Zlib),
        (5000, Compression::Zlib),
    ] {
        let s = sample(n);
        let path = folder.path().join(format!("out/{n}.vtu"));
        write_vtu(&path, &s, compression).unwrap();
        let piece = read(&path);
        assert_eq!(
            piece.points.cast_into::<f64>().unwrap(),
            s.points.as_flattened()
        );
        let (connectivity, offsets) = piece.cells.cell_verts.into_xml();
        let connectivity: Vec<u32> = connectivity.iter().map(|&c| c as u32).collect();
        assert_eq!(connectivity, s.connectivity);
        assert_eq!(offsets[n..], [2, 5, 9, 13, 21].map(|o| o + n as u64));
        let codes: Vec<u8> = piece.cells.types.iter().map(|&t| t as u8).collect();
        assert_eq!(codes[n - 1..], [1, 3, 5, 9, 10, 12]);
        for (fields, read) in [
            (&s.point_fields, &piece.data.point),
            (&s.cell_fields, &piece.data.cell),
        ] {
            assert_eq!(fields.len(), read.len());
            for (field, read) in fields.iter().zip(read) {
                assert_eq!(field.name, read.name());
                assert_eq!(expected(field), reals(read));
            }
        }
        let text = std::fs::read(&path).unwrap();
        let text = String::from_utf8_lossy(&text);
        assert!(text.contains("\"TimeValue\"") && text.contains(">1.25e-1<"));
    }
}

#[test]
fn plane_vectors_and_tensors_are_filled_up_by_rows() {
    let v = Field::vector(
        "u",
        &[Vector::<2>::new(1.0, 2.0), Vector::<2>::new(3.0, 4.0)],
    );
    let vector = vec![1.0, 2.0, 0.0, 3.0, 4.0, 0.0];
    assert_eq!((v.components, v.values), (3, Values::Real(vector)));
    let t = Field::tensor("s", &[Tensor::<2>::new(1.0, 2.0, 3.0, 4.0)]);
    let rows = vec![1.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!((t.components, t.values), (9, Values::Real(rows)));
}

#[test]
fn zlib_is_smaller() {
    let folder = tempfile::tempdir().unwrap();
    let size = |compression| {
        let path = folder.path().join("a.vtu");
        write_vtu(&path, &sample(5000), compression).unwrap();
        std::fs::metadata(&path).unwrap().len()
    };
    assert!(size(Compression::Zlib) < size(Compression::Plain) * 3 / 4);
}

#[test]
fn what_does_not_fit_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.vtu");
    let message = |change: &dyn Fn(&mut Snapshot)| {
        let mut s = sample(9);
        change(&mut s);
        let error = write_vtu(&path, &s, Compression::Zlib).unwrap_err();
        assert!(!path.exists());
        error.to_string()
    };
    let short = message(&|s| s.point_fields[0].values = Values::Real(vec![0.0; 26]));
    assert!(
        short.contains("`displacement`") && short.contains("26 values where 27"),
        "{short}"
    );
    let nan = message(&|s| {
        let mut v = vec![0.0; 27];
        v[13] = f64::NAN;
        s.point_fields[0].values = Values::Real(v);
    });
    assert!(
        nan.contains("`displacement`") && nan.contains("NaN at entry 4"),
        "{nan}"
    );
    let stray = message(&|s| s.push_cell(CellShape::Line2, &[0, 9]));
    assert!(stray.contains("point 9 of 9"), "{stray}");
    let odd = message(&|s| s.shapes.push(CellShape::Tri3));
    assert!(odd.contains("ask for 33 node numbers, 30"), "{odd}");
    let twice = message(&|s| s.point_fields[1].name = "displacement".into());
    assert!(twice.contains("called `displacement`"), "{twice}");
    let none = message(&|s| *s = Snapshot::default());
    assert!(none.contains("no cells"), "{none}");
    let lost = message(&|s| s.points[3][1] = f64::INFINITY);
    assert!(
        lost.contains("`position`") && lost.contains("entry 3"),
        "{lost}"
    );
}

#[test]
fn a_collection_names_its_files_relative_to_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.pvd");
    let steps = [
        (0.0, folder.path().join("run/a&b.vtu")),
        (0.5, PathBuf::from("elsewhere.vtu")),
    ];
    write_pvd(&path, &steps).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("timestep=\"0e0\" group=\"\" part=\"0\" file=\"run/a&amp;b.vtu\""),
        "{text}"
    );
    assert!(
        text.contains("timestep=\"5e-1\" group=\"\" part=\"0\" file=\"elsewhere.vtu\""),
        "{text}"
    );
    assert!(matches!(
        write_pvd(&path, &[]),
        Err(ObserveError::Empty { .. })
    ));
    let late = write_pvd(&path, &[(f64::NAN, PathBuf::from("a.vtu"))]);
    assert!(matches!(late, Err(ObserveError::NotFinite { .. })));
}
