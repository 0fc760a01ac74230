"""Scenes that several tests use."""

from __future__ import annotations

import copy
import signal
from pathlib import Path
from typing import Any

import pytest

# a shell that starts the tests in the background lets them ignore interrupts, which some of them send
signal.signal(signal.SIGINT, signal.default_int_handler)

#: The repository: its examples and meshes are tested through the package too.
ROOT = Path(__file__).resolve().parents[3]

#: A bar of E = 2 with a peridynamic middle, pulled by 1e-3 at its right end: u = 5e-4 x.
BAR: dict[str, Any] = {
    "kinematics": "bar",
    "mesh": {"line": {"min": 0, "max": 1, "x": {"cells": 50}}},
    "materials": {"bar": {"bond-based": {"youngs-modulus": 2.0, "micromodulus": "inverted-triangular"}}},
    "peridynamics": {"horizon": 0.06, "points": {"lattice": {"spacing": 0.02}}},
    "zones": {"nonlocal": {"box": {"min": 0.4, "max": 0.6}}},
    "coupling": "truncated",
    "conditions": {
        "left": {"displacement": {"on": "left", "x": 0}},
        "right": {"traction": {"on": "right", "x": 1e-3}},
    },
    "output": {"lines": {"axis": {"from": 0, "to": 1, "samples": 11}}},
}

#: A pulse on a bar, E = ρ = 1, which splits in two.
PULSE: dict[str, Any] = {
    "kinematics": "bar",
    "mesh": {"line": {"min": 0, "max": 100, "x": {"cells": 400}}},
    "materials": {
        "bar": {"bond-based": {"youngs-modulus": 1, "density": 1, "micromodulus": "inverted-triangular"}}
    },
    "peridynamics": {"horizon": 0.75, "points": {"lattice": {"spacing": 0.25}}},
    "zones": {"nonlocal": {"box": {"min": 60, "max": 80}}},
    "coupling": "splice",
    "solve": {"explicit": {"duration": 30, "outputs": 6, "history-interval": 0.25}},
    "initial": {"hump": {"displacement": {"x": "0.01 * exp(-((x - 40) / 4)^2)"}}},
    "conditions": {"left": {"displacement": {"on": "left", "x": 0}}},
    "output": {"probes": {"within": {"at": 70}}},
}


@pytest.fixture
def bar() -> dict[str, Any]:
    return copy.deepcopy(BAR)


@pytest.fixture
def pulse() -> dict[str, Any]:
    return copy.deepcopy(PULSE)


@pytest.fixture
def endless(pulse: dict[str, Any]) -> dict[str, Any]:
    """A run in time that takes hours."""
    pulse["solve"]["explicit"] = {"duration": 1e7, "outputs": 1, "history-interval": 1e4}
    return pulse
