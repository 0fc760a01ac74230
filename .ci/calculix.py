#!/usr/bin/env python3
"""Solves elastic decks by CalculiX (ccx) and by bondline, and compares the displacements of all nodes.

    calculix.py BONDLINE FOLDER

Both read the same deck: nodes, elements, the fixed nodes and the loaded surface. The material, gravity and the pressure stand in the deck for CalculiX
and in a scene for bondline. CalculiX prints seven digits; a component may differ by one unit of the last, plus 2e-7 of the largest displacement
(its solver, and digits of nodes). Needs meshio. The exit status is 1 if any deck differs, 2 without ccx.
"""

import pathlib
import shutil
import subprocess
import sys

import meshio
import numpy as np

#: Of the blocks; Cook's membrane has E = 1, ν = 1/3 and a shear force of 1.
E, NU, RHO, GRAVITY, PULL = 210e3, 0.3, 7.8e-9, 9810.0, 40.0

#: Corners of the edges with a node, in the order of the nodes, by type.
EDGES = {
    "C3D4": [],
    "C3D10": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "C3D20": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
    "CPE6": [(0, 1), (1, 2), (2, 0)],
    "CPE8": [(0, 1), (1, 2), (2, 3), (3, 0)],
}

#: Corners of the faces in the order of their labels S1, S2, ...
FACES = {
    "C3D4": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    "C3D20": [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)],
    "CPE6": [(0, 1), (1, 2), (2, 0)],
    "CPE8": [(0, 1), (1, 2), (2, 3), (3, 0)],
}
FACES["C3D10"] = FACES["C3D4"]

SIX_TETS = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]


def block(kind, cells, size, bend):
    """Nodes and elements of a block divided along its axes: bent by `bend`, or tapered into Cook's membrane."""
    plane = kind.startswith("CPE")
    counts = [n + 1 for n in cells]
    grid = np.indices(counts[::-1]).reshape(3, -1)[::-1].T if not plane else None
    if plane:
        grid = np.indices(counts[1::-1]).reshape(2, -1)[::-1].T
        grid = np.column_stack([grid, np.zeros(len(grid), int)])
        cells = (*cells[:2], 1)
    nodes = [tuple(g[k] * size[k] / cells[k] for k in range(3)) for g in grid]

    def at(i, j, k):
        return (k * counts[1] + j) * counts[0] + i if not plane else j * counts[0] + i

    elements = []
    for k in range(cells[2]):
        for j in range(cells[1]):
            for i in range(cells[0]):
                quad = [at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k)]
                if plane:
                    elements += [quad] if kind == "CPE8" else [quad[:3], [quad[0], *quad[2:]]]
                    continue
                hexa = quad + [at(i, j, k + 1), at(i + 1, j, k + 1), at(i + 1, j + 1, k + 1), at(i, j + 1, k + 1)]
                elements += [hexa] if kind == "C3D20" else [[hexa[c] for c in tet] for tet in SIX_TETS]
    middle = {}
    for element in elements:
        corners = list(element)
        for p, q in EDGES[kind]:
            ends = tuple(sorted((corners[p], corners[q])))
            if ends not in middle:
                middle[ends] = len(nodes)
                nodes.append(tuple((a + b) / 2 for a, b in zip(nodes[ends[0]], nodes[ends[1]])))
            element.append(middle[ends])
    x = np.array(nodes)
    if bend == "cook":
        s, t = x[:, 0] / size[0], x[:, 1] / size[1]
        x[:, 0], x[:, 1] = 48 * s, 44 * s + t * (44 - 28 * s)
    else:
        x[:, 1] += bend * np.sin(np.pi * x[:, 0] / size[0])
    # CalculiX reads fields of 20 characters
    return np.round(x, 9) + 0.0, elements


def write(kind, path, nodes, elements, length, cook):
    """The deck, as both programs read it."""
    right = {n for n in range(len(nodes)) if abs(nodes[n][0] - length) < 1e-9}
    left = [n + 1 for n in range(len(nodes)) if abs(nodes[n][0]) < 1e-9]
    pulled = [
        (e + 1, f + 1)
        for e, element in enumerate(elements)
        for f, face in enumerate(FACES[kind])
        if all(element[c] in right for c in face)
    ]
    lines = ["*HEADING", f"{kind} between CalculiX and bondline", "*NODE, NSET=NALL"]
    lines += [f"{n + 1}, {x[0]!r}, {x[1]!r}, {x[2]!r}" for n, x in enumerate(nodes.tolist())]
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=BODY"]
    for e, element in enumerate(elements):
        numbers = [e + 1] + [n + 1 for n in element]
        lines += [", ".join(map(str, numbers[i : i + 10])) + ("," if i + 10 < len(numbers) else "") for i in range(0, len(numbers), 10)]
    lines += ["*NSET, NSET=FIXED"] + [f"{n}," for n in left]
    lines += ["*SURFACE, NAME=PULLED, TYPE=ELEMENT"] + [f"{e}, S{f}" for e, f in pulled]
    section = ["*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL"] + (["1."] if kind.startswith("CPE") else [])
    elastic = "1., 0.3333333333333333" if cook else f"{E}, {NU}"
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", elastic, "*DENSITY", f"{RHO}"] + section
    lines += ["*BOUNDARY", "FIXED, 1, 3" if kind.startswith("C3D") else "FIXED, 1, 2"]
    lines += ["*STEP", "*STATIC"]
    if cook:  # a unit of shear, as Simpson's rule shares it out on each edge
        force = {}
        for e, f in pulled:
            p, q = FACES[kind][f - 1]
            middle = elements[e - 1][len(FACES[kind]) + EDGES[kind].index((p, q))]
            for node, part in [(elements[e - 1][p], 1 / 6), (elements[e - 1][q], 1 / 6), (middle, 4 / 6)]:
                force[node] = force.get(node, 0) + part / len(pulled)
        lines += ["*CLOAD"] + [f"{n + 1}, 2, {f:.12e}" for n, f in force.items()]
    else:
        lines += ["*DLOAD", f"BODY, GRAV, {GRAVITY}, 0., -1., 0."]
        lines += [f"{e}, P{f}, {-PULL}" for e, f in pulled]
    lines += ["*NODE PRINT, NSET=NALL", "U", "*END STEP"]
    path.write_text("\n".join(lines) + "\n")


def scene(kind, name, cook):
    if cook:
        loads = '[conditions.shear.traction]\non = "PULLED"\ny = 0.0625'
    else:
        loads = f"""
[conditions.pulled.traction]
on = "PULLED"
x = {PULL}
[conditions.weight.body-force]
inside = {{ everywhere = true }}
y = {-RHO * GRAVITY!r}"""
    axes = "xyz" if kind.startswith("C3D") else "xy"
    held = "\n".join(f"{k} = 0" for k in axes)
    return f"""
kinematics = "{'solid' if kind.startswith('C3D') else 'plane-strain'}"
coupling = "local"
[mesh.file]
path = "{name}.inp"
[materials.steel.lps]
youngs-modulus = {1 if cook else E}
poisson-ratio = {0.3333333333333333 if cook else NU}
density = {RHO}
[conditions.fixed.displacement]
on = "FIXED"
{held}
{loads}
[solver]
tolerance = 1e-12
"""


def of_calculix(folder, name, count):
    subprocess.run(["ccx", name], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    found = np.full((count, 3), np.nan)
    for line in (folder / f"{name}.dat").read_text().splitlines():
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            found[int(words[0]) - 1] = [float(w) for w in words[1:]]
    return found


def of_bondline(program, folder, name, nodes):
    subprocess.run([program, "run", f"{name}.toml", "--json", "--output", "out"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    mesh = meshio.read(folder / "out" / f"{name}.vtu")
    # points come in the order in which cells use them
    place = {tuple(np.round(x, 6) + 0.0): p for p, x in enumerate(mesh.points)}
    return mesh.point_data["displacement"][[place[tuple(np.round(x, 6) + 0.0)] for x in nodes]]


def main():
    program, folder = str(pathlib.Path(sys.argv[1]).resolve()), pathlib.Path(sys.argv[2])
    if shutil.which("ccx") is None:
        print("no ccx: apt-get install calculix-ccx")
        return 2
    folder.mkdir(parents=True, exist_ok=True)
    failed = False
    # CalculiX has another rule for gravity on curved cells of triangles and tetrahedra: those are straight
    for kind, cells, bend in [
        ("C3D4", (8, 3, 3), 0.0),
        ("C3D10", (6, 2, 2), 0.0),
        ("C3D20", (6, 2, 2), 3.0),
        ("CPE6", (10, 4, 1), 0.0),
        ("CPE8", (10, 4, 1), 3.0),
        ("CPE8", (8, 8, 1), "cook"),
    ]:
        cook = bend == "cook"
        size = (48.0, 44.0, 1.0) if cook else (40.0, 10.0, 8.0)
        name = "cook" if cook else kind.lower()
        nodes, elements = block(kind, cells, size, bend)
        write(kind, folder / f"{name}.inp", nodes, elements, size[0], cook)
        (folder / f"{name}.toml").write_text(scene(kind, name, cook))
        theirs = of_calculix(folder, name, len(nodes))
        ours = of_bondline(program, folder, name, nodes)
        largest = np.abs(theirs).max()
        # one unit of the last of seven digits
        digit = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(theirs), 1e-300))) - 6)
        away = np.abs(ours - theirs)
        ok = bool((away <= digit + 2e-7 * largest).all())
        failed |= not ok
        print(
            f"{name:6} {len(nodes):5} nodes, {len(elements):4} elements: largest displacement {largest:.6e}, "
            f"largest difference {away.max() / largest:.1e} of it{'' if ok else '  DIFFERS'}"
        )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
