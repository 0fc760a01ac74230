#!/usr/bin/env python3
"""compare_runs.py LIMIT ONE SEVERAL: whether two folders hold the same results.

With LIMIT 0 every file has the same bytes, those of checkpoints included, but for the provenance. Else displacements in VTU and CSV files differ by at most LIMIT of the largest. With LIMIT
`readable` every VTU file of the first folder can be read, and that is all.

A VTU file of one process may be a PVTU file of several. Its pieces together then hold each cell once and each point at least once, by their numbers in the file of one process; with
LIMIT 0 places, cells and all fields are the same bits. A PVD file names the one or the other.
"""

import base64
import csv
import pathlib
import struct
import sys
import xml.etree.ElementTree as tree
import zlib

FORMATS = {"Float64": "d", "Float32": "f", "Int32": "i", "Int64": "q", "UInt8": "B", "UInt32": "I", "UInt64": "Q"}


def raw(element, header):
    """The bytes of an inline array: compressed by zlib in blocks, or not at all."""
    text = "".join(element.text.split())
    size = struct.calcsize(header)
    count = struct.unpack("<" + header, base64.b64decode(text[: 4 * -(-size // 3)])[:size])[0]
    head = size * (3 + count)
    length = 4 * -(-head // 3)
    sizes = struct.unpack("<%d%s" % (3 + count, header), base64.b64decode(text[:length])[:head])[3:]
    data = base64.b64decode(text[length:])
    whole, start = b"", 0
    for block in sizes:
        whole += zlib.decompress(data[start : start + block])
        start += block
    return whole


def array(element, header):
    """The numbers of an inline array: as text, or of its bytes."""
    if element.get("format") == "ascii":
        return tuple(float(word) for word in element.text.split())
    return numbers(raw(element, header), FORMATS[element.get("type")])


def numbers(whole, kind):
    return struct.unpack("<%d%s" % (len(whole) // struct.calcsize(kind), kind), whole)


def fields(path):
    """The real fields of a VTU file by name."""
    root = tree.parse(path).getroot()
    header = {"UInt32": "I", "UInt64": "Q"}[root.get("header_type", "UInt32")]
    arrays = root.iter("DataArray")
    return {a.get("Name"): array(a, header) for a in arrays if a.get("type") == "Float64"}


def grid(path):
    """The arrays of a VTU file by element and name, each as a list of rows of bytes: those of points, of cells, and the numbers of the points of each cell."""
    root = tree.parse(path).getroot()
    header = {"UInt32": "I", "UInt64": "Q"}[root.get("header_type", "UInt32")]
    found = {}
    for kind in ("PointData", "CellData", "Points", "Cells"):
        for a in root.find(f".//{kind}").findall("DataArray"):
            # bytes, so that -0 is not 0
            whole, width = raw(a, header), int(a.get("NumberOfComponents", 1)) * struct.calcsize(FORMATS[a.get("type")])
            found[kind, a.get("Name")] = [whole[i : i + width] for i in range(0, len(whole), width)]
    nodes, ends = (numbers(b"".join(found.pop(("Cells", name))), "q") for name in ("connectivity", "offsets"))
    ends = (0, *ends)
    found["Cells", "nodes"] = [tuple(nodes[a:b]) for a, b in zip(ends, ends[1:])]
    return found


def reals(rows):
    """Rows of bytes as reals."""
    return [numbers(row, "d") for row in rows]


def pieces(path):
    """The files that a PVTU file names."""
    return [path.parent / p.get("Source") for p in tree.parse(path).getroot().iter("Piece")]


def joined(path, one):
    """The pieces of a PVTU file as one file, and what is wrong with them; `one` is the file of one process."""
    wanted, wrong = grid(one), []
    sizes = {"PointData": len(wanted["Points", "Points"]), "CellData": len(wanted["Cells", "types"])}
    sizes |= {"Points": sizes["PointData"], "Cells": sizes["CellData"]}
    whole = {key: [None] * sizes[key[0]] for key in wanted}
    declared = {
        (kind[1:], a.get("Name"))
        for kind in ("PPointData", "PCellData", "PPoints")
        for a in tree.parse(path).getroot().find(f".//{kind}")
    }
    for piece in pieces(path):
        found = grid(piece)
        if declared != {key for key in found if key[0] != "Cells"}:
            wrong.append(f"{path.name} does not declare the fields of {piece.name}")
        points = numbers(b"".join(found.pop(("PointData", "GlobalPointIds"))), "q")
        cells = numbers(b"".join(found.pop(("CellData", "GlobalCellIds"))), "q")
        found["Cells", "nodes"] = [tuple(points[k] for k in nodes) for nodes in found["Cells", "nodes"]]
        if found.keys() != wanted.keys():
            wrong.append(f"{piece.name}: fields {sorted(found.keys() ^ wanted.keys())} in one of both")
            continue
        for key, rows in found.items():
            own, of_points = whole[key], key[0] in ("PointData", "Points")
            for n, row in zip(points if of_points else cells, rows):
                # a node on the border of two pieces is in both
                if own[n] is not None and not (of_points and own[n] == row):
                    wrong.append(f"{piece.name}: {key[1]} of {n} is in another piece too")
                own[n] = row
    wrong += [f"{path.name}: {key[1]} lacks some" for key, rows in whole.items() if None in rows]
    return whole, wanted, wrong


def columns(path):
    """The columns of a CSV file by name, of those that are numbers."""
    rows = list(csv.reader(open(path)))
    found = {}
    for k, name in enumerate(rows[0]):
        try:
            found[name] = [float(r[k]) for r in rows[1:] if r[k]]
        except ValueError:
            pass
    return found


def main(limit, one, several):
    one, several = pathlib.Path(one), pathlib.Path(several)
    if limit == "readable":
        for path in one.glob("*.vtu"):
            fields(path)
        return 0
    limit = float(limit)
    # the provenance of a run has its times
    names, others = ({p.name for p in folder.iterdir() if not p.name.endswith(".run.json")} for folder in (one, several))
    lists = {p.with_suffix(".vtu").name: p for p in several.glob("*.pvtu")}
    for name, path in lists.items():
        # what the list does not name is left over
        others -= {path.name} | {p.name for p in pieces(path)}
        others.add(name)
    wrong = [f"only in one of both: {n}" for n in sorted(names ^ others)]
    if not names:
        wrong.append("nothing was written")
    compared = 0
    for name in sorted(names & others):
        a, b = one / name, several / name
        if name in lists:
            y, x, bad = joined(lists[name], a)
            wrong += bad
            if limit == 0:
                compared += 1
                wrong += [f"{name}: {key[1]} has other bits" for key in x if x[key] != y[key]]
                continue
            if any(x[key] != y[key] for key in (("Points", "Points"), ("Cells", "types"), ("Cells", "nodes"))):
                wrong.append(f"{name}: other cells")
            if bad:
                continue
            x, y = ({"displacement": [v for row in reals(g["PointData", "displacement"]) for v in row]} for g in (x, y))
        elif limit == 0:
            compared += 1
            found = b.read_bytes()
            if a.suffix == ".pvd":
                steps = tree.parse(b).getroot().iter("DataSet")
                wrong += [f"{name} names {s.get('file')}, which is not there" for s in steps if not (several / s.get("file")).exists()]
                found = found.replace(b".pvtu", b".vtu")
            if a.read_bytes() != found:
                wrong.append(f"{name}: other bytes")
            continue
        else:
            read = {".vtu": fields, ".csv": columns}.get(a.suffix)
            if read is None:
                continue
            x, y = read(a), read(b)
        if x.keys() != y.keys():
            wrong.append(f"{name}: fields {sorted(x.keys() ^ y.keys())} in one of both")
        # components of a vector are measured by the largest of all
        scale = max((abs(v) for f in x if f in ("displacement", "ux", "uy", "uz") for v in x[f]), default=0)
        for field in sorted(x.keys() & y.keys()):
            if field not in ("displacement", "ux", "uy", "uz"):
                continue
            compared += 1
            off = max((abs(v - w) for v, w in zip(x[field], y[field])), default=0)
            if len(x[field]) != len(y[field]) or not off <= limit * scale:
                wrong.append(f"{name}: {field} differs by {off / scale if scale else off:.1e} of the largest")
    if compared == 0:
        wrong.append("nothing was compared")
    for line in wrong:
        print(line)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
