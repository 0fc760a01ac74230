#!/usr/bin/env python3
"""partitions.py PROGRAM: the most sites of others beside those of a process, ghosts of a bond-based law, by weighted coordinate bisection, and by PT-Scotch, as `bondline check --processes` finds them for scenes at rest on 2, 4 and 16 processes.

PROGRAM is a `bondline` that was built with the feature petsc. Prints a table in Markdown.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

MATERIAL = "\n[materials.body.bond-based]\nyoungs-modulus = 1\n[solve.static]\n[conditions.left.displacement]\non = 'left'\nx = 0\ny = 0\n"
PLATE = "coupling = '{coupling}'\nkinematics = 'plane-stress'\n[mesh.rectangle]\nmin = [0, 0]\nmax = [{w}, {h}]\n{axes}\n[peridynamics]\nhorizon = {horizon}\n{points}\n"
LATTICE = "points.lattice = { spacing = 1, origin = [0.5, 0.5] }"


def plate(w, h, more="", horizon="4", axes=None, points=LATTICE, coupling="nonlocal"):
    axes = axes or f"x = {{ cells = {w} }}\ny = {{ cells = {h} }}"
    return PLATE.format(coupling=coupling, w=w, h=h, axes=axes, horizon=horizon, points=points) + MATERIAL + more


def graded():
    """Cells from 0.25 to 2, as points."""
    axis = "{ graded = { fine = [0, 12], spacing = 0.25, growth = 1.03, largest = 2 } }"
    return {"w": 120, "h": 120, "axes": f"x = {axis}\ny = {axis}", "points": "points = 'cells'"}


def scenes():
    yield "square plate", plate(200, 200)
    yield "plate with a slit of one spacing", plate(240, 160, "[voids.slit]\ninside.box = { min = [119, -1], max = [120, 80] }\n")
    yield "L-shaped plate", plate(240, 240, "[voids.corner]\ninside.box = { min = [120, 120], max = [241, 241] }\n")
    holes = [f"[voids.hole{x}_{y}]\ninside.ball = {{ center = [{x}, {y}], radius = 25 }}\n" for x in (40, 120, 200) for y in (40, 120, 200)]
    yield "plate with nine holes", plate(240, 240, "".join(holes))
    yield "graded plate, equal horizon", plate(**graded(), horizon="4")
    yield "graded plate, horizon by spacing", plate(**graded(), horizon="'1 + 0.09 * max(x, y)'")
    zone = "[zones.nonlocal]\nbox = { min = [60, 60], max = [120, 120] }\n"
    axes = "x = { cells = 60 }\ny = { cells = 60 }"
    yield "plate of elements of 4 × 4 spacings, points in its middle", plate(240, 240, zone.replace("120, 120", "180, 180"), axes=axes, coupling="truncated")
    yield "the same, points in a corner", plate(240, 240, zone.replace("60, 60", "160, 160").replace("120, 120", "241, 241"), axes=axes, coupling="truncated")


def main():
    program = str(Path(sys.argv[1]).resolve())
    print("| body | sites | 2 | 4 | 16 |\n|---|---|---|---|---|")
    for name, text in scenes():
        cells = []
        for count in (2, 4, 16):
            with tempfile.TemporaryDirectory() as folder:
                scene = Path(folder, "scene.toml")
                scene.write_text(text)
                found = subprocess.run([program, "check", scene, "--processes", str(count), "--json"], capture_output=True, text=True)
            if found.returncode:
                raise SystemExit(f"{name}: {found.stderr}")
            found = json.loads(found.stdout)
            most = max(share["ghosts"] for share in found["processes"])
            graph = re.search(r"than (\d+) sites of others beside its own, (\d+) by coordinate bisection", found["distribution"])
            kept = re.search(r"than (\d+) sites of others beside its own, (\d+) by a graph partitioner", found["distribution"])
            if graph:
                cells.append(f"{graph[2]}, **{graph[1]}**")
            elif kept:
                cells.append(f"**{kept[1]}**, {kept[2]}")
            else:
                cells.append(f"**{most}**")
        sites = sum(share["sites"] for share in found["processes"])
        print(f"| {name} | {sites} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
