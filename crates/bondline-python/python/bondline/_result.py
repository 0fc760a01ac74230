"""What a run gives: its solutions with fields by name, its tables, its summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import meshio
    import pyvista
    from matplotlib.axes import Axes

#: VTK's numbers of the types of cells, by their names in meshio.
VTK_TYPES: Mapping[str, int] = MappingProxyType(
    {
        "line": 3,
        "triangle": 5,
        "quad": 9,
        "tetra": 10,
        "hexahedron": 12,
        "line3": 21,
        "triangle6": 22,
        "quad8": 23,
        "tetra10": 24,
        "hexahedron20": 25,
        "vertex": 1,
    }
)


def _frozen(value: Any) -> Any:
    """Arrays that came through a pipe are as read-only as those that did not."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, dict):
        for inner in value.values():
            _frozen(inner)
    return value


@dataclass(frozen=True, repr=False, eq=False)
class Frame:
    """One solution: cells, points and fields, the same that a VTU file shows.

    Nodes of elements come first, then peridynamic points; each of these is a cell of type ``vertex``, or with ``output.points = "cells"`` the cell around it with corners of its own. Arrays cannot be written to; ``.copy()`` gives one that can.
    Lengths and forces are in the units of the scene.
    """

    #: Time, or load factor; None of a static solution.
    time: float | None
    #: Positions in the reference configuration, ``(n, 3)``.
    points: NDArray[np.float64]
    #: Points of the cells of each type, by the name of the type in meshio.
    cells: dict[str, NDArray[np.int64]]
    #: VTK's number of the type of each cell, in the order of ``cell_data``.
    cell_types: NDArray[np.uint8]
    #: Fields over points by name: ``(n,)``, or ``(n, 3)`` of vectors.
    point_data: dict[str, NDArray[Any]]
    #: Fields over cells by name: ``(m,)``, or ``(m, 9)`` of tensors by rows.
    cell_data: dict[str, NDArray[Any]]

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, _frozen(value))

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Displacement of the points, ``(n, 3)``."""
        return self.point_data["displacement"]

    def cell_data_of(self, name: str, cell_type: str) -> NDArray[Any]:
        """The field ``name`` over the cells of one type, in the order of ``cells[cell_type]``."""
        picked: NDArray[Any] = self.cell_data[name][self.cell_types == VTK_TYPES[cell_type]]
        return picked

    def to_meshio(self) -> meshio.Mesh:
        """The same as a ``meshio.Mesh``. Needs meshio."""
        try:
            import meshio
        except ImportError as error:
            raise ImportError("to_meshio() needs meshio: pip install meshio") from error
        data = {
            name: [self.cell_data_of(name, kind) for kind in self.cells] for name in self.cell_data
        }
        cells = list(self.cells.items())
        return meshio.Mesh(self.points, cells, point_data=dict(self.point_data), cell_data=data)

    def to_pyvista(self) -> pyvista.UnstructuredGrid:
        """The same as a ``pyvista.UnstructuredGrid``. Needs pyvista."""
        try:
            import pyvista
        except ImportError as error:
            raise ImportError("to_pyvista() needs pyvista: pip install pyvista") from error
        cells = {VTK_TYPES[kind]: nodes for kind, nodes in self.cells.items()}
        grid = pyvista.UnstructuredGrid(cells, self.points)
        for name, values in self.point_data.items():
            grid.point_data[name] = values
        for name in self.cell_data:
            # the grid has its cells type by type
            parts = [self.cell_data_of(name, kind) for kind in self.cells]
            grid.cell_data[name] = np.concatenate(parts)
        return grid

    def plot(
        self,
        name: str = "displacement",
        component: int | str | None = None,
        *,
        deformed: float = 0.0,
        ax: Axes | None = None,
        cmap: str | None = None,
    ) -> Axes:
        """Draws a field of a body of one or two dimensions and returns the axes; needs matplotlib.

        name: a field of ``point_data`` or ``cell_data``.
        component: of a vector ``"x"``, ``"y"`` or ``"z"``, of a tensor ``"xx"``, ``"xy"``, …, or its number. Left out, a vector is drawn by its length.
        deformed: factor of the displacement by which points are moved.
        ax: axes to draw in; new ones, with a bar of colours, if left out.

        Elements are coloured areas (in one dimension a line), peridynamic points dots.
        """
        from bondline._plot import drawn

        return drawn(self, name, component, deformed, ax, cmap)

    def __repr__(self) -> str:
        cells = ", ".join(f"{len(nodes)} {kind}" for kind, nodes in self.cells.items())
        when = "" if self.time is None else f", time {self.time:g}"
        return f"<{type(self).__name__}: {len(self.points)} points; {cells}{when}>"


@dataclass(frozen=True, repr=False, eq=False)
class Result(Frame):
    """What a run gives: the last solution, the ones before it, tables and the summary."""

    #: What ``bondline run --json`` prints.
    summary: dict[str, Any] = field(default_factory=dict)
    #: The columns of each table by name: lines, and ``probes`` of a static scene, ``history`` and ``tip_NAME`` of a run in time.
    tables: dict[str, dict[str, NDArray[Any]]] = field(default_factory=dict)
    #: All solutions that were kept.
    kept: tuple[Frame, ...] = ()
    #: The names of the probes of the scene, in the order in which it types them.
    probe_names: tuple[str, ...] = ()

    @property
    def probes(self) -> dict[str, dict[str, Any]]:
        """The quantities at each probe by their names, in the order in which the scene types the probes.

        A number each of a static scene, with the coordinates of the probe; of a scene in time or load steps an array over ``history["time"]``.
        """
        if "history" in self.tables:
            found: dict[str, dict[str, Any]] = {name: {} for name in self.probe_names}
            for column, values in self.history.items():
                owners = [name for name in self.probe_names if column.startswith(f"{name}_")]
                if owners:
                    owner = max(owners, key=len)
                    found[owner][column[len(owner) + 1 :]] = values
            return found
        table = self.tables.get("probes", {})
        # rows are in the order of the names
        row = {name: k for k, name in enumerate(sorted(self.probe_names))}
        return {
            name: {column: values[row[name]].item() for column, values in table.items()}
            for name in self.probe_names
        }

    @property
    def history(self) -> dict[str, NDArray[Any]]:
        """Energies, probes and reactions over time, by column; empty of a static scene."""
        return self.tables.get("history", {})

    def frames(self) -> Iterator[Frame]:
        """The solutions in order of time; the last one alone where the run kept no others."""
        return iter(self.kept)
