"""Meshes in memory give the results of the same meshes from files."""

from __future__ import annotations

from typing import Any

import meshio
import numpy as np
import pytest

import bondline
from conftest import ROOT

EXAMPLE = ROOT / "examples" / "slit_plate_gmsh.toml"


def by_place(frame: bondline.Frame) -> np.ndarray[Any, Any]:
    """Points and displacements in the order of their positions; a node and a peridynamic point may share one."""
    rows = np.hstack([np.round(frame.points, 12), frame.point_data["horizon"][:, None], frame.displacement])
    return rows[np.lexsort(rows.T[::-1])]


def test_a_mesh_from_meshio_with_its_groups() -> None:
    keys = {
        "kinematics": "plane-stress",
        "materials": {"plate": {"bond-based": {"youngs-modulus": 1.0, "micromodulus": "inverse-distance"}}},
        "peridynamics": {"horizon": 0.05, "points": {"lattice": {"spacing": "1/120", "origin": [-0.5, -0.5]}}},
        "zones": {
            "nonlocal": {"box": {"min": [-0.2, "-1/120-0.1"], "max": [0.2, "1/120+0.1"]}},
            "transition": {"box": {"min": [-0.25, "-1/120-0.15"], "max": [0.25, "1/120+0.15"]}},
        },
        "coupling": {"blending": {"beta": "constant"}},
        "conditions": {
            "bottom": {"displacement": {"on": "bottom", "x": 0, "y": 0}},
            "top": {"displacement": {"on": "top", "x": 5e-4, "y": 5e-4}},
        },
    }
    wanted = bondline.run(EXAMPLE, progress=False)
    read = meshio.read(ROOT / "meshes" / "slit_plate.msh")
    mesh = bondline.Mesh.from_meshio(read)
    found = bondline.Scene.from_dict(keys, mesh=mesh).run(progress=False)
    assert found.summary["sizes"] == wanted.summary["sizes"]
    assert np.abs(by_place(found) - by_place(wanted)).max() < 1e-10


def test_cells_of_second_order_come_and_go() -> None:
    path = ROOT / "tests" / "fixtures" / "ring_hex20_41_ascii.msh"
    keys = {
        "kinematics": "solid",
        "coupling": "local",
        "materials": {"ring": {"lps": {"youngs-modulus": 1.0, "poisson-ratio": 0.3}}},
        "conditions": {
            "foot": {"displacement": {"on": "foot", "x": 0, "y": 0, "z": 0}},
            "outer": {"traction": {"on": "outer", "x": 1e-3}},
        },
    }
    mesh = bondline.Mesh.from_meshio(meshio.read(path))
    found = bondline.Scene.from_dict(keys, mesh=mesh).run(progress=False)
    wanted = bondline.Scene.from_dict({**keys, "mesh": {"file": {"path": str(path)}}}).run(progress=False)
    assert set(found.cells) == {"hexahedron20"}
    assert found.to_meshio().cells_dict["hexahedron20"].shape == (8, 20)

    def rows(frame: bondline.Frame) -> np.ndarray[Any, Any]:
        both = np.hstack([np.round(frame.points, 12), frame.displacement])
        return both[np.lexsort(both[:, :3].T[::-1])]

    assert np.abs(rows(found) - rows(wanted)).max() < 1e-10


def square(n: int = 8) -> meshio.Mesh:
    """A square of triangles with an edge set, a cell set and a point set."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="xy")
    points = np.column_stack([x.ravel(), y.ravel()])
    corner = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    a, b, c, d = corner, corner + 1, corner + n + 2, corner + n + 1
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    bottom = np.column_stack([np.arange(n), np.arange(1, n + 1)])
    top = bottom + n * (n + 1)
    return meshio.Mesh(
        points,
        [("line", np.vstack([bottom, top])), ("triangle", triangles)],
        cell_sets={
            "foot": [np.arange(n), np.array([], dtype=int)],
            "head": [np.arange(n, 2 * n), np.array([], dtype=int)],
            "soft": [np.array([], dtype=int), np.flatnonzero(points[triangles].mean(axis=1)[:, 1] > 0.5)],
        },
        point_sets={"pin": np.array([0])},
    )


def keys() -> dict[str, Any]:
    return {
        "kinematics": "plane-stress",
        "materials": {
            "lower": {"lps": {"youngs-modulus": 2, "poisson-ratio": 0}},
            "upper": {"lps": {"youngs-modulus": 1, "poisson-ratio": 0, "cells": "soft"}},
        },
        "coupling": "local",
        "conditions": {
            "foot": {"displacement": {"on": "foot", "y": 0}},
            "pin": {"displacement": {"on": "pin", "x": 0}},
            "head": {"traction": {"on": "head", "y": 1e-3}},
        },
    }


def test_sets_of_edges_cells_and_points_are_known() -> None:
    scene = bondline.Scene.from_dict(keys(), mesh=bondline.Mesh.from_meshio(square()))
    result = scene.run(progress=False)
    assert scene.check()["sizes"] == result.summary["sizes"]
    # two bars of E = 2 and 1, each half as long, one behind the other
    y = result.points[:, 1]
    exact = 1e-3 * np.where(y < 0.5, y / 2, 0.25 + (y - 0.5))
    assert result.displacement[:, 1] == pytest.approx(exact, abs=1e-14)
    assert np.abs(result.displacement[:, 0]).max() < 1e-14


def test_what_a_run_gives_is_a_mesh_again() -> None:
    first = bondline.Scene.from_dict(keys(), mesh=bondline.Mesh.from_meshio(square())).run(progress=False)
    plain = {key: of for key, of in keys().items() if key in ("kinematics", "coupling")}
    # arrays of a result, with the field as a function of the place: the same displacement, everywhere
    at = {tuple(x): u for x, u in zip(np.round(first.points[:, :2], 9).tolist(), first.displacement[:, 1].tolist())}

    def known(x: np.ndarray[Any, Any], y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return np.array([at[place] for place in zip(np.round(x, 9).tolist(), np.round(y, 9).tolist())])

    second = bondline.Scene.from_dict(
        plain
        | {
            "materials": {"all": {"lps": {"youngs-modulus": 1, "poisson-ratio": 0}}},
            "conditions": {"all": {"displacement": {"inside": {"everywhere": True}, "x": 0, "y": known}}},
        },
        mesh=bondline.Mesh.from_meshio(first.to_meshio()),
    ).run(progress=False)
    assert np.array_equal(second.points, first.points)
    assert second.displacement[:, 1] == pytest.approx(first.displacement[:, 1], abs=1e-15)


def test_a_mesh_of_ones_own() -> None:
    plain = square()
    offset = len(plain.cells[0].data)
    mesh = bondline.Mesh(
        plain.points,
        {block.type: block.data for block in plain.cells},
        cell_sets={"foot": range(8), "head": range(8, 16), "soft": offset + plain.cell_sets["soft"][1]},
        point_sets={"pin": [0]},
    )
    own = bondline.Scene.from_dict(keys(), mesh=mesh).run(progress=False)
    other = bondline.Scene.from_dict(keys(), mesh=bondline.Mesh.from_meshio(plain)).run(progress=False)
    assert np.array_equal(own.displacement, other.displacement)


def test_an_unknown_set_is_named() -> None:
    wrong = keys()
    wrong["conditions"]["foot"]["displacement"]["on"] = "feet"
    with pytest.raises(bondline.SceneError, match="feet") as caught:
        bondline.Scene.from_dict(wrong, mesh=bondline.Mesh.from_meshio(square()))
    assert caught.value.help is not None and "foot" in caught.value.help


def test_two_meshes_are_one_too_many() -> None:
    wrong = keys() | {"mesh": {"file": {"path": "plate.msh"}}}
    with pytest.raises(bondline.SceneError, match="one in memory"):
        bondline.Scene.from_dict(wrong, mesh=bondline.Mesh.from_meshio(square()))


@pytest.mark.parametrize(
    ("points", "cells", "words"),
    [
        (np.zeros((3, 4)), {"triangle": [[0, 1, 2]]}, "shape"),
        ([[0, 0], [1, 0], [0, 1]], {"triangle6": [[0, 1, 2, 3, 4, 5]]}, "node 3"),
        ([[0, 0], [1, 0], [0, 1]], {"triangle10": [list(range(10))]}, "triangle10"),
        ([[0, 0], [1, 0], [0, 1]], {"triangle": [[0, 1, -1]]}, "no numbers"),
        ([[0, 0], [1, 0], [0, 1]], {"triangle": [[0, 1, 7]]}, "node 7"),
        ([[0, 0], [1, 0], [0, float("nan")]], {"triangle": [[0, 1, 2]]}, "NaN"),
        ([[0, 0], [1, 0], [2, 0]], {"triangle": [[0, 1, 2]]}, "mesh in memory"),
    ],
)
def test_meshes_that_are_wrong(points: Any, cells: Any, words: str) -> None:
    plain = keys()
    del plain["conditions"], plain["materials"]["upper"]
    with pytest.raises(bondline.SceneError, match=words):
        bondline.Scene.from_dict(plain, mesh=bondline.Mesh(points, cells))


def test_an_accuracy_is_chosen_on_a_mesh_in_memory() -> None:
    wanted = keys() | {"accuracy": 0.05}
    del wanted["coupling"]
    scene = bondline.Scene.from_dict(wanted, mesh=bondline.Mesh.from_meshio(square()))
    assert scene.run(progress=False).summary["coupling"] == "local"
