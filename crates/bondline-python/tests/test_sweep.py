"""Studies on several processes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bondline


def test_a_sweep_gives_what_each_run_gives(bar: dict[str, Any]) -> None:
    horizons = [0.04, 0.06, 0.08]
    found = bondline.sweep(bar, "peridynamics.horizon", horizons, processes=2)
    for horizon, result in zip(horizons, found):
        bar["peridynamics"]["horizon"] = horizon
        alone = bondline.run(bar, progress=False)
        assert np.array_equal(result.displacement, alone.displacement)
        assert result.summary["sizes"] == alone.summary["sizes"]
        assert not result.displacement.flags.writeable
        assert np.array_equal(result.tables["axis"]["ux"], alone.tables["axis"]["ux"])


def test_a_value_that_fails_is_named(bar: dict[str, Any]) -> None:
    with pytest.raises(bondline.SceneError, match="peridynamics.horizon = -1"):
        bondline.sweep(bar, "peridynamics.horizon", [0.06, -1], processes=1)
    with pytest.raises(ValueError, match="processes is 0"):
        bondline.sweep(bar, "peridynamics.horizon", [0.06], processes=0)
    assert bondline.sweep(bar, "peridynamics.horizon", []) == []
