"""Pictures of fields by matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bondline._result import VTK_TYPES, Frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Corners of the cells of a plane body, by the names of their types in meshio; nodes in the middle of edges come after them.
CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4}

#: Cells of a solid body.
SOLIDS = ("tetra", "tetra10", "hexahedron", "hexahedron20")


def _component(name: str, values: NDArray[Any], component: int | str | None) -> tuple[NDArray[np.float64], str]:
    """One number per entry of a field, and what it is called."""
    if values.ndim == 1:
        if component is not None:
            raise ValueError(f"{name} is a scalar; leave component out")
        return values.astype(np.float64), name
    letters = ["x", "y", "z"] if values.shape[1] == 3 else [a + b for a in "xyz" for b in "xyz"]
    if component is None and values.shape[1] == 3:
        return np.linalg.norm(values, axis=1), f"|{name}|"
    number = letters.index(component) if component in letters else component
    if not isinstance(number, int) or not 0 <= number < values.shape[1]:
        known = ", ".join(letters[: values.shape[1]])
        raise ValueError(f"component of {name} is {component!r}; give one of {known}")
    label = f"{name} {letters[number]}" if number < len(letters) else f"{name} {number}"
    return values[:, number].astype(np.float64), label


def drawn(
    frame: Frame, name: str, component: int | str | None, deformed: float, ax: Axes | None, cmap: str | None
) -> Axes:
    """Draws a field; see ``Frame.plot``."""
    try:
        import matplotlib.pyplot as plt
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import Normalize
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: pip install matplotlib") from error
    if any(kind in frame.cells for kind in SOLIDS) or np.ptp(frame.points[:, 2]) > 0:
        raise ValueError("plot() draws bodies of one and two dimensions; use to_pyvista().plot() for solids")
    on_points = name in frame.point_data
    if not on_points and name not in frame.cell_data:
        known = ", ".join([*frame.point_data, *frame.cell_data])
        raise ValueError(f"there is no field {name}; there are {known}")
    values, label = _component(name, frame.point_data[name] if on_points else frame.cell_data[name], component)
    x = frame.points + deformed * frame.displacement
    has_bar = ax is None
    if ax is None:
        _, ax = plt.subplots(layout="constrained")
    dots = frame.cells.get("vertex", np.empty((0, 1), dtype=np.int64))[:, 0]

    def of(kind: str, corners: NDArray[np.int64]) -> NDArray[np.float64]:
        """A number per cell of a type: its own, or the mean of its corners."""
        if on_points:
            means: NDArray[np.float64] = values[corners].mean(axis=1)
            return means
        own: NDArray[np.float64] = values[frame.cell_types == VTK_TYPES[kind]]
        return own

    of_dots = of("vertex", dots[:, None]) if len(dots) else np.empty(0)
    is_plane = any(kind in frame.cells for kind in CORNERS) or np.ptp(frame.points[:, 1]) > 0
    if not is_plane:
        for kind in ("line", "line3"):
            ends = frame.cells.get(kind, np.empty((0, 2), dtype=np.int64))[:, :2]
            if len(ends):
                heights = values[ends] if on_points else np.repeat(of(kind, ends)[:, None], 2, axis=1)
                gaps = np.full((len(ends), 1), np.nan)
                ax.plot(np.hstack([x[ends, 0], gaps]).ravel(), np.hstack([heights, gaps]).ravel(), color="C0")
        ax.plot(x[dots, 0], of_dots, ".", color="C1")
        ax.set_xlabel("x")
        ax.set_ylabel(label)
        return ax
    blocks = [(kind, nodes[:, : CORNERS[kind]]) for kind, nodes in frame.cells.items() if kind in CORNERS]
    numbers = [of(kind, corners) for kind, corners in blocks]
    all_numbers = np.concatenate([*numbers, of_dots])
    scale = Normalize(all_numbers.min(), all_numbers.max())
    shown: Any = None
    for (_, corners), number in zip(blocks, numbers):
        shown = PolyCollection(list(x[corners, :2]), array=number, norm=scale, cmap=cmap, edgecolor="face", linewidth=0.2)
        ax.add_collection(shown)
    if len(dots):
        shown = ax.scatter(x[dots, 0], x[dots, 1], c=of_dots, norm=scale, cmap=cmap, s=4, linewidth=0)
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_xlabel("x")
    ax.set_ylabel("y")
    if has_bar and shown is not None:
        ax.figure.colorbar(shown, ax=ax, label=label)
    return ax
