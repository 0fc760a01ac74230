#!/usr/bin/env python3
"""petsc_patch.py PROGRAM FOLDER PROCESSES COMMAND...: blocks as those of the suites `patch` and `balance`, run as scenes on several processes, within the limits of these suites.

PROGRAM is built with the feature petsc; COMMAND starts PROCESSES of it (`mpirun -n 3`). Displacement is given on the outer boundary and nowhere else. Each block prints a line and
fails beyond a limit:

residual   largest affine internal force per volume over E|G|/h: 1e-11, or 1e-9 with jittered cells (`bondline verify patch`); no row is out of balance
error      of the displacement of an affine field over the largest displacement, at any point of the pieces: 1e-9 (`bondline verify patch`)
balance    sum of internal forces over the sizes of nodal forces: of every coupling under an affine field, of `truncated` under a body force that is a square too, where a splice has to be
           out of balance: 1e-12 (`bondline verify balance`); solved by factors, for an iteration leaves what its tolerance lets
"""

import json
import pathlib
import random
import subprocess
import sys

from compare_runs import grid, pieces, reals

SPACING = 0.01
MODULUS = 2e11
ALIGNED, IRREGULAR, SOLUTION, EQUILIBRIUM = 1e-11, 1e-9, 1e-9, 1e-12
FACES = [["left", "right"], ["bottom", "top"], ["back", "front"]]
COUPLINGS = {
    "splice": '"splice"',
    "truncated": '"truncated"',
    "blending": '{ blending = { beta = "smooth" } }',
    "balanced": '"balanced"',
    "meshfree partial stress": '{ partial-stress = { form = "meshfree" } }',
    "partial stress in elements": '{ partial-stress = { interface = "quadratic" } }',
}
LAWS = {
    "bond-based": ("bond-based", 'micromodulus = "inverse-distance"', ""),
    "LPS": ("lps", "poisson-ratio = 0.3", "influence = { degree = 1, alpha = 1 }"),
    "correspondence": ("correspondence", "poisson-ratio = 0.3", "influence = { degree = 1, alpha = 1 }"),
}
# every entry is another one
GRADIENT = [[1e-3, -4e-4, 3e-4], [7e-4, -6e-4, 2e-4], [-5e-4, 8e-4, 9e-4]]


def jittered(path, half, cells):
    """A mesh of Gmsh of a square of quadrilaterals whose inner nodes are moved by up to a fifth of a cell."""
    size, drawn = 2 * half / cells, random.Random(7)
    inner = lambda i: 0 < i < cells
    moved = lambda i, j: 0.2 * size * drawn.uniform(-1, 1) if inner(i) and inner(j) else 0.0
    across = range(cells + 1)
    nodes = [(-half + i * size + moved(i, j), -half + j * size + moved(i, j)) for j in across for i in across]
    at = lambda i, j: 1 + i + (cells + 1) * j
    sides = [[(at(i, 0), at(i + 1, 0)) for i in range(cells)], [(at(i, cells), at(i + 1, cells)) for i in range(cells)]]
    sides = [[(at(0, j), at(0, j + 1)) for j in range(cells)], [(at(cells, j), at(cells, j + 1)) for j in range(cells)]] + sides
    elements = [f"1 2 {tag} {tag} {a} {b}" for tag, side in enumerate(sides, 1) for a, b in side]
    elements += [f"3 2 5 5 {at(i, j)} {at(i + 1, j)} {at(i + 1, j + 1)} {at(i, j + 1)}" for j in range(cells) for i in range(cells)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "5"]
    lines += [f'1 {tag} "{name}"' for tag, name in enumerate(FACES[0] + FACES[1], 1)] + ['2 5 "block"', "$EndPhysicalNames", "$Nodes", str(len(nodes))]
    lines += [f"{n} {x!r} {y!r} 0" for n, (x, y) in enumerate(nodes, 1)] + ["$EndNodes", "$Elements", str(len(elements))]
    lines += [f"{n} {e}" for n, e in enumerate(elements, 1)] + ["$EndElements", ""]
    path.write_text("\n".join(lines))


def box(half, dimension):
    return f"{{ box = {{ min = {[-half] * dimension}, max = {[half] * dimension} }} }}"


def scene(folder, dimension, coupling, law, cells, field, more=""):
    """Writes a block of the suites; `field` has a function of the place for each component of the displacement."""
    kind, constant, weights = LAWS[law]
    core, transition, local = (6, 6, 12) if dimension < 3 else (3, 3, 6)
    # some have no use for a transition zone
    if coupling in ("splice", "truncated", "balanced"):
        transition = 0
    half = SPACING * (core + transition + local)
    size = {"matching": 1, "coarse": 3, "jittered": 2}[cells]
    count = round(2 * half / SPACING / size)
    origin = [0.5 * SPACING if coupling == "truncated" else 0.0] * dimension
    if cells == "jittered":
        jittered(folder / "mesh.msh", half, count)
        mesh = '[mesh.file]\npath = "mesh.msh"\n'
    else:
        mesh = f"[mesh.{['line', 'rectangle', 'box'][dimension - 1]}]\nmin = {[-half] * dimension}\nmax = {[half] * dimension}\n"
        mesh += "".join(f"{axis}.cells = {count}\n" for axis in "xyz"[:dimension])
    text = f'kinematics = "{["bar", "plane-strain", "solid"][dimension - 1]}"\ncoupling = {COUPLINGS[coupling]}\n{mesh}'
    text += f"[materials.m.{kind}]\nyoungs-modulus = {MODULUS}\n{constant}\n"
    text += f"[peridynamics]\nhorizon = {(2 if dimension == 3 else 3) * SPACING}\npoints.lattice = {{ spacing = {SPACING}, origin = {origin} }}\n{weights}\n"
    text += f'surfaces = "uncut"\n[zones]\nnonlocal = {box(core * SPACING, dimension)}\n'
    if transition:
        text += f"transition = {box((core + transition) * SPACING, dimension)}\n"
    for face in sum(FACES[:dimension], []):
        given = "".join(f"{axis} = {json.dumps(of)}\n" for axis, of in zip("xyz", field))
        text += f'[conditions.{face}.displacement]\non = "{face}"\n{given}'
    (folder / "block.toml").write_text(text + more)


def run(command, folder, more=()):
    """Runs the block, and returns its summary and the list of its pieces."""
    out = folder / "out"
    words = [*command, "run", str(folder / "block.toml"), "--json", "--output", str(out), *more]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        sys.exit(f"{' '.join(words)}: not done in two minutes; processes that wait lose their core to other programs")
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return json.loads(done.stdout), out / "block.pvtu"


def affine(dimension):
    rows = [GRADIENT[i][:dimension] for i in range(dimension)]
    field = [" + ".join(f"({g})*{x}" for g, x in zip(row, "xyz")) for row in rows]
    return rows, field


def error(path, rows):
    """The largest error of an affine displacement over the largest displacement, and the number of pieces."""
    off = size = 0.0
    sources = pieces(path)
    for source in sources:
        found = grid(source)
        for x, u in zip(reals(found["Points", "Points"]), reals(found["PointData", "displacement"])):
            for i, row in enumerate(rows):
                wanted = sum(g * c for g, c in zip(row, x))
                off, size = max(off, abs(u[i] - wanted)), max(size, abs(wanted))
    return off / size, len(sources)


def main(program, folder, processes, *command):
    command, folder, wrong = [*command, program], pathlib.Path(folder), 0
    folder.mkdir(parents=True, exist_ok=True)

    def told(name, figures):
        """Prints figures with their limits, and counts those beyond; what is not a number is."""
        nonlocal wrong
        beyond = [what for what, (value, limit) in figures.items() if limit is not None and not abs(value) <= limit]
        wrong += len(beyond)
        text = ", ".join(f"{what} {value:.1e}" for what, (value, _) in figures.items())
        print(f"{'FAILED: ' + ', '.join(beyond) + ': ' if beyond else ''}{name}: {text}", flush=True)

    blocks = [(1, c, law, "coarse") for c in COUPLINGS for law in ("bond-based", "LPS")]
    blocks += [(2, c, "LPS", "matching") for c in COUPLINGS]
    blocks += [(2, "splice", "correspondence", "matching"), (2, "blending", "bond-based", "jittered")]
    blocks += [(3, c, "bond-based", "coarse") for c in ("splice", "truncated", "blending")]
    for dimension, coupling, law, cells in blocks:
        rows, field = affine(dimension)
        scene(folder, dimension, coupling, law, cells, field)
        summary, path = run(command, folder)
        figures = {f["name"]: f["value"] for part in summary["proof"] if part["name"] == "affine" for f in part["figures"]}
        found, count = error(path, rows)
        told(f"{dimension}D {coupling}, {law}, {cells}", {
            "residual": (figures["residual of rows in balance"], IRREGULAR if cells == "jittered" else ALIGNED),
            "rows out of balance": (figures["rows out of balance"], 0),
            "error": (found, SOLUTION),
            "pieces missing": (int(processes) - count, 0),
        })

    direct = ("--set", "solver.method=direct")
    for dimension in (1, 2):
        for coupling in COUPLINGS:
            scene(folder, dimension, coupling, "LPS", "matching", affine(dimension)[1])
            summary, _ = run(command, folder, direct)
            told(f"{dimension}D {coupling}, affine", {"balance": (summary["out_of_balance_relative"], EQUILIBRIUM)})
        # of a quartic in x, whose forces at the two seams do not cancel
        load = f'[conditions.load.body-force]\nx = "{MODULUS}*x^2"\n'
        off = {}
        for coupling in ("truncated", "splice"):
            scene(folder, dimension, coupling, "LPS", "matching", ["0"] * dimension, load)
            off[coupling] = run(command, folder, direct)[0]["out_of_balance_relative"]
        told(f"{dimension}D truncated, quartic", {"balance": (off["truncated"], EQUILIBRIUM)})
        # else the figure would not tell
        told(f"{dimension}D splice, quartic", {"balance": (off["splice"], None), "in balance": (float(off["splice"] < 1e-6), 0)})
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
