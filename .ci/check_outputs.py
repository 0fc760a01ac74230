#!/usr/bin/env python3
"""Reads output files with meshio and with VTK's own reader and compares what both see, number by number.

    check_outputs.py FILE...

.vtu: points, cells and every field are equal in both readers, and finite.
.pvtu: VTK's own reader sees the points, cells and fields of the pieces one after another, as meshio sees each; no cell is in two pieces, and a point that is in two is the same in both.
.pvd: every file that it names exists, and times do not fall.
.csv: every row has as many entries as the header, and every number is finite.

One line per file; the last line counts. The exit status is 1 if a file fails or if none was given.
"""

import csv
import math
import pathlib
import sys
import xml.etree.ElementTree as xml

import meshio
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

VTK_TYPE = {
    "vertex": 1, "line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12,
    "line3": 21, "triangle6": 22, "quad8": 23, "tetra10": 24, "hexahedron20": 25,
}


class Wrong(Exception):
    """What is wrong with a file."""


def same(what, a, b):
    a, b = np.asarray(a), np.asarray(b)
    if a.shape != b.shape:
        raise Wrong(f"{what}: shape {a.shape} in meshio, {b.shape} in VTK")
    if not np.array_equal(a, b):
        at = np.unravel_index(np.argmax(a != b), a.shape)
        raise Wrong(f"{what}: {a[at]} in meshio, {b[at]} in VTK at {tuple(int(i) for i in at)}")
    if not np.all(np.isfinite(a.astype(float))):
        raise Wrong(f"{what}: not finite")


def vtk_arrays(data):
    return {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}


def read_by_meshio(path):
    try:
        return meshio.read(path)
    except SystemExit:  # meshio leaves the interpreter on a file it cannot read
        raise Wrong(f"meshio cannot read {path.name}") from None


def read_by_vtk(path, reader):
    complaints = []

    def complain(_caller, _event, text="") -> None:
        complaints.append(text.strip())

    complain.CallDataType = vtk.VTK_STRING
    reader.AddObserver("ErrorEvent", complain)
    reader.SetFileName(str(path))
    reader.Update()
    if complaints or reader.GetErrorCode():
        raise Wrong("VTK cannot read it: " + (complaints[0] if complaints else "no reason given"))
    grid = reader.GetOutput()
    if grid.GetNumberOfPoints() == 0 or grid.GetNumberOfCells() == 0:
        raise Wrong("no points or no cells")
    return grid


def check_pvtu(path):
    grid = read_by_vtk(path, vtk.vtkXMLPUnstructuredGridReader())
    sources = [path.parent / p.attrib["Source"] for p in xml.parse(path).getroot().iter("Piece")]
    meshes = [read_by_meshio(source) for source in sources]
    same("points", np.concatenate([m.points for m in meshes]), vtk_to_numpy(grid.GetPoints().GetData()))
    starts = np.cumsum([0] + [len(m.points) for m in meshes])
    nodes = [np.asarray(block.data).ravel() + start for m, start in zip(meshes, starts) for block in m.cells]
    same("cells", np.concatenate(nodes), vtk_to_numpy(grid.GetCells().GetConnectivityArray()))
    seen = [vtk_arrays(grid.GetPointData()), vtk_arrays(grid.GetCellData())]
    for kind, arrays, values in (
        ("point field", seen[0], lambda m, name: m.point_data[name]),
        ("cell field", seen[1], lambda m, name: np.concatenate(m.cell_data[name])),
    ):
        for m in meshes:
            if set(arrays) != set(m.point_data if kind == "point field" else m.cell_data):
                raise Wrong(f"{kind}s: other ones in a piece than {sorted(arrays)}")
        for name, found in arrays.items():
            same(f"{kind} {name}", np.concatenate([values(m, name) for m in meshes]), found)
    for data, name in ((grid.GetPointData(), "GlobalPointIds"), (grid.GetCellData(), "GlobalCellIds")):
        if data.GetGlobalIds() is None or data.GetGlobalIds().GetName() != name:
            raise Wrong(f"VTK does not take {name} for identifiers")
    cells, (points, first, back) = seen[1]["GlobalCellIds"], np.unique(seen[0]["GlobalPointIds"], return_index=True, return_inverse=True)
    for what, numbers in (("cells", np.sort(cells)), ("points", points)):
        if not np.array_equal(numbers, np.arange(len(numbers))):
            raise Wrong(f"{what} are not numbered each once from zero")
    for name, values in seen[0].items():
        if not np.array_equal(values, values[first][back]):
            raise Wrong(f"{name} differs at a point that is in two pieces")
    return f"{len(sources)} pieces, {len(points)} points, {len(cells)} cells, {len(seen[0]) + len(seen[1])} fields"


def check_vtu(path):
    mesh = read_by_meshio(path)
    grid = read_by_vtk(path, vtk.vtkXMLUnstructuredGridReader())

    same("points", mesh.points, vtk_to_numpy(grid.GetPoints().GetData()))
    types = np.concatenate([np.full(len(block.data), VTK_TYPE[block.type]) for block in mesh.cells])
    same("cell types", types, vtk_to_numpy(grid.GetCellTypes()))
    if not all(np.issubdtype(block.data.dtype, np.integer) for block in mesh.cells):
        raise Wrong("meshio reads node numbers that are no integers")
    nodes = np.concatenate([np.asarray(block.data).ravel() for block in mesh.cells])
    same("cells", nodes, vtk_to_numpy(grid.GetCells().GetConnectivityArray()))

    fields = 0
    cell_data = {name: np.concatenate(blocks) for name, blocks in mesh.cell_data.items()}
    for kind, ours, theirs in (
        ("point field", mesh.point_data, vtk_arrays(grid.GetPointData())),
        ("cell field", cell_data, vtk_arrays(grid.GetCellData())),
    ):
        if set(ours) != set(theirs):
            raise Wrong(f"{kind}s: {sorted(ours)} in meshio, {sorted(theirs)} in VTK")
        for name, values in ours.items():
            same(f"{kind} {name}", values, theirs[name])
            fields += 1
    kinds = ", ".join(f"{int((types == code).sum())} {name}" for name, code in VTK_TYPE.items() if (types == code).any())
    return f"{len(mesh.points)} points, {kinds}, {fields} fields"


def check_pvd(path):
    steps = xml.parse(path).getroot().findall("./Collection/DataSet")
    if not steps:
        raise Wrong("lists no files")
    for step in steps:
        if not (path.parent / step.attrib["file"]).is_file():
            raise Wrong(f"{step.attrib['file']} is missing")
    times = [float(step.attrib["timestep"]) for step in steps]
    if times != sorted(times) or not all(map(math.isfinite, times)):
        raise Wrong(f"times fall or are not finite: {times}")
    return f"{len(steps)} files"


def check_csv(path):
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    # a tip has rows from the first damage on
    if len(rows) == 1 and "_tip_" in path.name:
        return f"no rows, {len(rows[0])} columns"
    if len(rows) < 2:
        raise Wrong("no rows")
    header, numbers = rows[0], 0
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(header):
            raise Wrong(f"line {line} has {len(row)} entries, the header {len(header)}")
        for name, word in zip(header, row):
            try:
                value = float(word)
            except ValueError:
                if word == "":
                    raise Wrong(f"line {line}: {name} is empty") from None
                continue
            if not math.isfinite(value):
                raise Wrong(f"line {line}: {name} is {word}")
            numbers += 1
    if numbers == 0:
        raise Wrong("no numbers")
    return f"{len(rows) - 1} rows, {len(header)} columns"


CHECKS = {".vtu": check_vtu, ".pvtu": check_pvtu, ".pvd": check_pvd, ".csv": check_csv}


def main(names):
    passed = failed = 0
    for name in names:
        path = pathlib.Path(name)
        try:
            if path.suffix not in CHECKS:
                raise Wrong(f"no check for {path.suffix or 'a name without suffix'}")
            print(f"passed  {name}: {CHECKS[path.suffix](path)}")
            passed += 1
        except Exception as error:  # whatever a reader throws, the file has failed
            print(f"FAILED  {name}: {type(error).__name__}: {error}")
            failed += 1
    print(f"{passed} passed, {failed} failed")
    return 0 if failed == 0 and passed > 0 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
