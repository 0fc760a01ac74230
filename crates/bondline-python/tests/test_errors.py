"""Errors are exceptions with place, value and remedy."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import pytest

import bondline


def test_a_mistake_in_a_file_has_its_line(tmp_path: Path) -> None:
    path = tmp_path / "bar.toml"
    path.write_text('kinematics = "bar"\n[mesh.line]\nmin = 0\nmax = 1\nx = { cels = 50 }\n')
    with pytest.raises(bondline.SceneError) as caught:
        bondline.Scene.load(path)
    error = caught.value
    assert error.place == f"{path}:5"
    assert "`cels`" in error.message
    assert error.help is not None and "`cells`" in error.help
    text = str(error)
    assert error.message in text and "x = { cels = 50 }" in text and "did you mean `cells`" in text
    assert "\x1b" not in text


def test_a_mistake_in_a_dictionary_is_shown(bar: dict[str, Any]) -> None:
    bar["peridynamics"]["horizn"] = bar["peridynamics"].pop("horizon")
    with pytest.raises(bondline.SceneError, match="did you mean `horizon`") as caught:
        bondline.Scene.from_dict(bar, name="my bar")
    assert caught.value.place is not None and caught.value.place.startswith("my bar:")


def test_a_mistake_in_an_override_is_shown(bar: dict[str, Any]) -> None:
    with pytest.raises(bondline.SceneError, match="did you mean `splice`"):
        bondline.Scene.from_dict(bar, overrides={"coupling": "spilce"})


@pytest.mark.parametrize(
    ("value", "words"),
    [(None, "NoneType"), (1 << 70, "beyond 64 bits"), ({1: 2}, "key 1"), (object(), "object"), (float("nan"), "NaN|nan")],
)
def test_values_that_no_scene_holds(bar: dict[str, Any], value: Any, words: str) -> None:
    bar["peridynamics"]["horizon"] = value
    with pytest.raises(bondline.SceneError, match=words) as caught:
        bondline.Scene.from_dict(bar)
    assert caught.value.help


def test_a_dictionary_that_holds_itself(bar: dict[str, Any]) -> None:
    bar["materials"]["bar"] = bar["materials"]
    with pytest.raises(bondline.SceneError, match="nested"):
        bondline.Scene.from_dict(bar)


def test_a_scene_that_cannot_be_run(bar: dict[str, Any]) -> None:
    # nothing holds the plate in y
    plate = {
        "kinematics": "plane-stress",
        "mesh": {"rectangle": {"min": [0, 0], "max": [1, 1], "x": {"cells": 4}, "y": {"cells": 4}}},
        "materials": bar["materials"],
        "coupling": "local",
        "conditions": {"left": {"displacement": {"on": "left", "x": 0}}},
    }
    with pytest.raises(bondline.RunError) as caught:
        bondline.run(plate, progress=False)
    error = caught.value
    assert isinstance(error, bondline.BondlineError)
    assert error.help and error.message and error.help in str(error) and error.message in str(error)
    # the first node that is free to move
    assert error.place == "(0.0000e0, 0.0000e0, 0.0000e0)"


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(bondline.SceneError, match="nowhere.toml"):
        bondline.run("nowhere.toml")


def test_a_folder_that_cannot_be_made(bar: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(bondline.RunError, match="file") as caught:
        bondline.run(bar, progress=False, output=tmp_path / "file" / "out")
    assert caught.value.place is not None and caught.value.place.startswith(str(tmp_path / "file"))


def test_threads_below_one(bar: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="threads is 0"):
        bondline.Scene.from_dict(bar).run(threads=0)


def test_errors_cross_processes() -> None:
    error = bondline.SceneError("a; b", message="a", place="scene:3", help="b")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), again.message, again.place, again.help) == (
        bondline.SceneError, "a; b", "a", "scene:3", "b",
    )


@pytest.mark.parametrize("files", [True, False])
def test_a_solution_that_is_no_number_is_refused(bar: dict[str, Any], files: bool, tmp_path: Path) -> None:
    bar["materials"]["bar"]["bond-based"]["youngs-modulus"] = 1e90
    bar["coupling"] = "local"
    del bar["zones"], bar["peridynamics"]
    bar["conditions"]["right"] = {"displacement": {"on": "right", "x": 1e250}}
    with pytest.raises(bondline.RunError) as caught:
        bondline.run(bar, progress=False, output=tmp_path if files else None)
    assert "NaN" in caught.value.message and caught.value.help
