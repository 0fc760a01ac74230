#!/usr/bin/env python3
"""compare_runs.py LIMIT ONE SEVERAL: whether two folders hold the same results.

With LIMIT 0 every file has the same bytes, those of checkpoints included. Else displacements in VTU and CSV files differ by at most LIMIT of the largest. With LIMIT
`readable` every VTU file of the first folder can be read, and that is all.
"""

import base64
import csv
import pathlib
import struct
import sys
import xml.etree.ElementTree as tree
import zlib

FORMATS = {"Float64": "d", "Float32": "f", "Int32": "i", "Int64": "q", "UInt8": "B", "UInt32": "I", "UInt64": "Q"}


def array(element, header):
    """The numbers of an inline array: as text, or compressed by zlib in blocks or not at all."""
    if element.get("format") == "ascii":
        return tuple(float(word) for word in element.text.split())
    text = "".join(element.text.split())
    size = struct.calcsize(header)
    count = struct.unpack("<" + header, base64.b64decode(text[: 4 * -(-size // 3)])[:size])[0]
    head = size * (3 + count)
    length = 4 * -(-head // 3)
    sizes = struct.unpack("<%d%s" % (3 + count, header), base64.b64decode(text[:length])[:head])[3:]
    data = base64.b64decode(text[length:])
    raw, start = b"", 0
    for block in sizes:
        raw += zlib.decompress(data[start : start + block])
        start += block
    kind = FORMATS[element.get("type")]
    return struct.unpack("<%d%s" % (len(raw) // struct.calcsize(kind), kind), raw)


def fields(path):
    """The real fields of a VTU file by name."""
    root = tree.parse(path).getroot()
    header = {"UInt32": "I", "UInt64": "Q"}[root.get("header_type", "UInt32")]
    arrays = root.iter("DataArray")
    return {a.get("Name"): array(a, header) for a in arrays if a.get("type") == "Float64"}


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
    names = {p.name for p in one.iterdir()}
    others = {p.name for p in several.iterdir()}
    wrong = [f"only in one of both: {n}" for n in sorted(names ^ others)]
    if not names:
        wrong.append("nothing was written")
    compared = 0
    for name in sorted(names & others):
        a, b = one / name, several / name
        if limit == 0:
            compared += 1
            if a.read_bytes() != b.read_bytes():
                wrong.append(f"{name}: other bytes")
            continue
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
