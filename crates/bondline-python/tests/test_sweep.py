"""Studies on several processes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas
import pytest

import bondline

HORIZON, COUPLING, SPACING = "peridynamics.horizon", "coupling", "peridynamics.points.lattice.spacing"


def test_a_sweep_gives_what_each_run_gives(bar: dict[str, Any]) -> None:
    horizons = [0.04, 0.06, 0.08]
    found = bondline.sweep(bar, {HORIZON: horizons}, processes=2)
    assert len(found) == 3 and [case.keys for case in found] == [{HORIZON: h} for h in horizons]
    for horizon, result in zip(horizons, found.results()):
        bar["peridynamics"]["horizon"] = horizon
        alone = bondline.run(bar, progress=False)
        assert np.array_equal(result.displacement, alone.displacement)
        assert result.summary["sizes"] == alone.summary["sizes"]
        assert not result.displacement.flags.writeable
        assert np.array_equal(result.tables["axis"]["ux"], alone.tables["axis"]["ux"])


def finer(keys: dict[str, Any]) -> dict[str, Any]:
    return {SPACING: keys[HORIZON] / 3}


def test_several_keys_with_conditions_and_keys_that_follow(bar: dict[str, Any]) -> None:
    del bar["peridynamics"]["points"]
    found = bondline.sweep(
        bar,
        {COUPLING: ["truncated", "splice", "nonlocal"], HORIZON: [0.06, 0.12]},
        where=lambda keys: not (keys[COUPLING] == "nonlocal" and keys[HORIZON] > 0.1),
        also=finer,
        processes=1,
    )
    tried = [(case.keys[COUPLING], case.keys[HORIZON]) for case in found]
    assert tried == [("truncated", 0.06), ("truncated", 0.12), ("splice", 0.06), ("splice", 0.12), ("nonlocal", 0.06)]
    for case in found:
        assert case.result is not None and case.keys[SPACING] == case.keys[HORIZON] / 3
        assert case.result.summary["coupling"] == case.keys[COUPLING]
        sizes = case.result.point_data["size"][case.result.cells["vertex"][:, 0]]
        assert sizes == pytest.approx(case.keys[SPACING])
    assert len(found[1:3]) == 2 and found[1:3][0] is found[1]


def test_a_value_that_is_refused_has_a_row_with_the_reason(bar: dict[str, Any]) -> None:
    found = bondline.sweep(bar, {HORIZON: [0.06, -1, 0.04]}, processes=1)
    refused = found[1]
    assert refused.result is None and isinstance(refused.error, bondline.SceneError)
    table = pandas.DataFrame(found.table(end=lambda r: r.displacement.max(), bonds=lambda r: r.summary["sizes"]["bonds"]))
    assert list(table.columns) == [HORIZON, "end", "bonds", "reason"]
    assert table["end"][[0, 2]].to_numpy() == pytest.approx(5e-4, rel=1e-12) and math.isnan(table["end"][1])
    assert table["reason"].isna().tolist() == [True, False, True] and "must be positive" in table["reason"][1]
    # δ = 0.06 is three spacings, 0.04 two: 2 m bonds of each point within
    assert table["bonds"][0] > table["bonds"][2] > 0
    with pytest.raises(bondline.SceneError, match="horizon"):
        found.results()
    with pytest.raises(ValueError, match="name of a key"):
        found.table(**{HORIZON: lambda r: 0})


def test_tables_of_keys_may_differ(bar: dict[str, Any]) -> None:
    found = bondline.sweep(bar, [{COUPLING: "splice"}, {COUPLING: "local", "zones": {}}], processes=1)
    assert [r.summary["coupling"] for r in found.results()] == ["splice", "local"]
    assert found.table()["zones"] == [None, {}]
    with pytest.raises(ValueError, match="processes is 0"):
        bondline.sweep(bar, {HORIZON: [0.06]}, processes=0)
    assert list(bondline.sweep(bar, {HORIZON: []})) == []
