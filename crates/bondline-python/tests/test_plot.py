"""Pictures of fields: what is drawn has the numbers of the field."""

from __future__ import annotations

import sys
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import PathCollection, PolyCollection

import bondline

matplotlib.use("Agg")


@pytest.fixture
def plate() -> bondline.Result:
    keys = {
        "kinematics": "plane-stress",
        "mesh": {"rectangle": {"min": [0, 0], "max": [2, 1], "x": {"cells": 20}, "y": {"cells": 10}}},
        "materials": {"plate": {"bond-based": {"youngs-modulus": 2.0}}},
        "peridynamics": {"horizon": 0.301, "points": {"lattice": {"spacing": 0.1}}},
        "zones": {"nonlocal": {"box": {"min": [0.8, 0.3], "max": [1.2, 0.7]}}},
        "coupling": "splice",
        "conditions": {
            "left": {"displacement": {"on": "left", "x": 0}},
            "bottom": {"displacement": {"on": "bottom", "y": 0}},
            "right": {"traction": {"on": "right", "x": 2e-3}},
        },
    }
    return bondline.run(keys, progress=False)


def test_a_plane_body_has_areas_and_dots(plate: bondline.Result) -> None:
    axes = plate.plot(component="x")
    areas = [c for c in axes.collections if isinstance(c, PolyCollection)]
    dots = [c for c in axes.collections if isinstance(c, PathCollection)]
    assert len(areas) == len(dots) == 1
    # u = 1e-3 x: the colour of a cell is that of its centre
    centres = plate.points[plate.cells["quad"]].mean(axis=1)
    assert np.asarray(areas[0].get_array()) == pytest.approx(1e-3 * centres[:, 0], abs=1e-12)
    points = plate.points[plate.cells["vertex"][:, 0]]
    assert np.asarray(dots[0].get_offsets()) == pytest.approx(points[:, :2])
    assert np.asarray(dots[0].get_array()) == pytest.approx(1e-3 * points[:, 0], abs=1e-12)
    moved = plate.plot("linear_stress", "xx", deformed=100, ax=axes)
    assert moved is axes
    corners = np.asarray(axes.collections[2].get_paths()[0].vertices)[:4]
    first = plate.cells["quad"][0]
    assert corners == pytest.approx((plate.points + 100 * plate.displacement)[first, :2])
    assert np.asarray(axes.collections[2].get_array()) == pytest.approx(2e-3, rel=1e-6)


def test_a_bar_is_a_line_with_dots(bar: dict[str, Any]) -> None:
    result = bondline.run(bar, progress=False)
    line, dots = result.plot().lines
    x, y = np.asarray(line.get_data())
    assert y[~np.isnan(y)] == pytest.approx(5e-4 * x[~np.isnan(x)], abs=1e-15)
    assert len(np.asarray(dots.get_xdata())) == len(result.cells["vertex"])


def test_what_cannot_be_drawn_is_named(plate: bondline.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="no field stres; there are"):
        plate.plot("stres")
    with pytest.raises(ValueError, match="give one of xx, xy"):
        plate.plot("linear_stress")
    with pytest.raises(ValueError, match="is a scalar"):
        plate.plot("volume", "x")
    solid = bondline.Frame(None, np.array([[0.0, 0, 0], [0, 0, 1]]), {"line": np.array([[0, 1]])}, np.array([3], dtype=np.uint8), {"displacement": np.zeros((2, 3))}, {})
    with pytest.raises(ValueError, match="to_pyvista"):
        solid.plot()
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        plate.plot()
