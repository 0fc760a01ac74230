#!/usr/bin/env python3
"""Writes decks (.inp) by other programs, and what those see in them, for the tests of the reader of decks.

    write_decks.py FOLDER MESH.msh... [DECK.inp[.gz]...]

Of each mesh of Gmsh: a copy, NAME_gmsh.inp written by Gmsh and NAME_meshio.inp written by meshio.
Of each deck: a copy, and NAME.json with what meshio reads in it; a deck that meshio cannot read is left out and named.
The exit status is 1 if nothing was written.
"""

import gzip
import json
import pathlib
import re
import shutil
import sys

import meshio
import numpy as np

DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3}
DIMENSION |= {"line3": 1, "triangle6": 2, "quad8": 2, "tetra10": 3, "hexahedron20": 3}


def write_mesh(path, folder):
    import gmsh

    shutil.copy(path, folder / path.name)
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
    gmsh.open(str(path))
    gmsh.write(str(folder / f"{path.stem}_gmsh.inp"))
    gmsh.finalize()
    mesh = meshio.read(path)
    # meshio's writer knows no single points, and `gmsh:…` holds numbers of entities, not of elements
    kept = [i for i, block in enumerate(mesh.cells) if block.type != "vertex"]
    sets = {k: [v[i] for i in kept] for k, v in mesh.cell_sets.items() if not k.startswith("gmsh:")}
    if not sets:  # of version 2 meshio gives the groups as numbers
        groups = mesh.cell_data["gmsh:physical"]
        for name, (tag, dimension) in mesh.field_data.items():
            fits = [DIMENSION[mesh.cells[i].type] == dimension for i in kept]
            sets[name] = [np.flatnonzero((groups[i] == tag) & fit) for i, fit in zip(kept, fits)]
    cells = [mesh.cells[i] for i in kept]
    meshio.Mesh(mesh.points, cells, cell_sets=sets).write(folder / f"{path.stem}_meshio.inp")


def times(text, name):
    """How many cards name a set of elements to put some there."""
    cards = re.findall(rb"^\*(?:ELEMENT|ELSET)\b[^\n]*ELSET\s*=\s*([^,\s]+)", text, re.IGNORECASE | re.MULTILINE)
    return sum(card.decode(errors="replace").upper() == name.upper() for card in cards)


def write_deck(path, folder):
    text = gzip.open(path).read() if path.suffix == ".gz" else path.read_bytes()
    name = path.name.removesuffix(".gz").removesuffix(".inp")
    deck = folder / f"{name}.inp"
    deck.write_bytes(text)
    try:
        mesh = meshio.read(deck)
        if not all(block.type in DIMENSION for block in mesh.cells):
            raise ValueError("elements of other shapes")
        numbers, starts = [], 0
        for block in mesh.cells:
            numbers.append(starts)
            starts += len(block.data)
        model = {
            "points": mesh.points.tolist(),
            "cells": [[block.type, block.data.tolist()] for block in mesh.cells],
            # a set that several cards name holds what all of them put there; meshio keeps what the last one did,
            # and of a set of sets more lists than it has blocks
            "cell_sets": {
                k: [int(i) + start for start, members in zip(numbers, v) for i in members]
                for k, v in mesh.cell_sets.items()
                if times(text, k) < 2 and len(v) == len(mesh.cells)
            },
            "point_sets": {k: [int(i) for i in v] for k, v in mesh.point_sets.items()},
        }
        if max((DIMENSION[kind] for kind, _ in model["cells"]), default=0) < 2:
            raise ValueError("no elements but lines")
    except (Exception, SystemExit) as error:
        deck.unlink()
        reason = re.sub(r"\s+", " ", repr(error))[:80]
        print(f"left out {name}: {reason}")
        return False
    (folder / f"{name}.json").write_text(json.dumps(model))
    return True


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    meshes = decks = 0
    for path in map(pathlib.Path, sys.argv[2:]):
        if path.suffix == ".msh":
            write_mesh(path, folder)
            meshes += 1
        else:
            decks += write_deck(path, folder)
    print(f"{meshes} meshes and {decks} decks written to {folder}")
    return 0 if meshes + decks else 1


if __name__ == "__main__":
    sys.exit(main())
