"""Meshes in memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bondline import _bondline
from bondline._errors import SceneError
from bondline._result import VTK_TYPES

if TYPE_CHECKING:
    import meshio

#: Data over cells in which meshio keeps the numbers of physical groups.
PHYSICAL = "gmsh:physical"


def _wrong(place: str, message: str, help: str) -> SceneError:
    return SceneError(f"{place}: {message}; {help}", message=message, place=place, help=help)


def _numbers(values: ArrayLike, place: str) -> NDArray[np.uint64]:
    """Numbers of nodes or elements."""
    found = np.asarray(values)
    if found.size and (found.dtype.kind not in "iu" or found.min() < 0):
        raise _wrong(place, "holds what are no numbers of nodes or elements", "count from 0")
    return np.ascontiguousarray(found, dtype=np.uint64)


class Mesh:
    """Positions, cells and named sets, for :meth:`Scene.from_dict`.

    Cells of the largest dimension are the body. Sets of them are its cell sets, sets of their faces (edges, points in one dimension) its facet sets;
    conditions, materials and zones name both. Sets of points are node sets.
    """

    def __init__(
        self,
        points: ArrayLike,
        cells: Iterable[tuple[str, ArrayLike]] | Mapping[str, ArrayLike],
        *,
        cell_sets: Mapping[str, ArrayLike] | None = None,
        point_sets: Mapping[str, ArrayLike] | None = None,
        name: str = "mesh in memory",
    ) -> None:
        """Takes positions ``(n, 2)`` or ``(n, 3)``, cells by the names of their types in meshio, and sets.

        cell_sets: numbers of cells, counted from 0 through all blocks of ``cells``.
        point_sets: numbers of points.
        name: what messages call the mesh.
        """
        x = np.asarray(points, dtype=np.float64)
        if x.ndim != 2 or not 1 <= x.shape[1] <= 3:
            raise _wrong(name, f"points are of shape {x.shape}", "give (n, 2) or (n, 3)")
        filled = np.zeros((len(x), 3))
        filled[:, : x.shape[1]] = x
        blocks: list[tuple[str, NDArray[np.uint64]]] = []
        pairs = cells.items() if isinstance(cells, Mapping) else cells
        for kind, nodes in pairs:
            if kind not in VTK_TYPES:
                known = ", ".join(VTK_TYPES)
                raise _wrong(name, f"cells of the type {kind} are not known", f"use {known}")
            block = _numbers(nodes, name)
            if block.ndim != 2:
                raise _wrong(name, f"cells of the type {kind} are of shape {block.shape}", "give one row per cell")
            blocks.append((kind, block))
        self.name = name
        self._native = _bondline.Mesh(
            name,
            filled,
            blocks,
            [(set_name, _numbers(of, f"{name}, set {set_name}")) for set_name, of in (cell_sets or {}).items()],
            [(set_name, _numbers(of, f"{name}, set {set_name}")) for set_name, of in (point_sets or {}).items()],
        )

    @classmethod
    def from_meshio(cls, mesh: meshio.Mesh, *, name: str = "mesh in memory") -> Mesh:
        """Takes a ``meshio.Mesh`` with its cell sets, point sets and physical groups of Gmsh.

        Raises :class:`SceneError` for cells of other types than vertex, line, triangle, quad, tetra and hexahedron, and of these with nodes in the middle of edges
        (line3, triangle6, quad8, tetra10, hexahedron20).
        """
        starts = np.cumsum([0] + [len(block.data) for block in mesh.cells])
        sets: dict[str, list[NDArray[Any]]] = {}
        for set_name, of_blocks in mesh.cell_sets.items():
            # bounding entities of Gmsh are no set of cells
            if set_name.startswith("gmsh:"):
                continue
            for start, of_block in zip(starts, of_blocks):
                if of_block is not None and len(of_block):
                    sets.setdefault(set_name, []).append(np.asarray(of_block) + start)
        for group, (number, dimension) in _groups(mesh).items():
            if group in sets:
                continue
            for start, block, tags in zip(starts, mesh.cells, mesh.cell_data[PHYSICAL]):
                if block.dim == dimension:
                    inside = np.flatnonzero(np.asarray(tags) == number)
                    sets.setdefault(group, []).append(inside + start)
        return cls(
            mesh.points,
            [(block.type, block.data) for block in mesh.cells],
            cell_sets={k: np.concatenate(v).astype(np.int64) for k, v in sets.items()},
            point_sets=dict(mesh.point_sets),
            name=name,
        )


def _groups(mesh: meshio.Mesh) -> dict[str, tuple[int, int]]:
    """Number and dimension of the physical groups."""
    if PHYSICAL not in mesh.cell_data:
        return {}
    return {name: (int(of[0]), int(of[1])) for name, of in mesh.field_data.items()}
