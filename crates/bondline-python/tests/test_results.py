"""Results against closed forms, and against what the command line writes and other programs read."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import pyvista

import bondline
from bondline import _bondline
from conftest import ROOT


def test_a_bar_in_three_lines(bar: dict[str, Any]) -> None:
    result = bondline.run(bar, progress=False)
    exact = 5e-4 * result.points[:, 0]
    assert np.abs(result.displacement[:, 0] - exact).max() < 1e-15
    assert result.summary["reactions"][0]["force"] == pytest.approx([-1e-3], rel=1e-10)
    assert result.cell_data["linear_stress"][:, 0] == pytest.approx(1e-3, rel=1e-9)
    line = result.tables["axis"]
    assert line["ux"] == pytest.approx(5e-4 * line["x"], abs=1e-15)
    assert result.history == {} and list(result.frames())[0].time is None


def test_numpy_values_and_paths_are_values_of_a_scene(bar: dict[str, Any]) -> None:
    plain = bondline.run(bar, progress=False)
    bar["mesh"]["line"]["x"]["cells"] = np.int64(50)
    bar["peridynamics"]["horizon"] = np.float32(0.0625)
    bar["output"]["directory"] = Path("somewhere")
    bar["zones"]["nonlocal"] = {"box": {"min": np.array([0.4]), "max": (0.6,)}}
    other = bondline.Scene.from_dict(bar, overrides={"peridynamics.horizon": 0.06})
    assert np.array_equal(other.run(progress=False).displacement, plain.displacement)
    assert not Path("somewhere").exists()


def test_a_pulse_over_time(pulse: dict[str, Any]) -> None:
    seen: list[bondline.Frame] = []
    result = bondline.Scene.from_dict(pulse).run(progress=False, on_frame=seen.append)
    frames = list(result.frames())
    assert [f.time for f in frames] == pytest.approx([0, 5, 10, 15, 20, 25, 30], abs=0.25)  # after whole steps
    assert seen == frames and frames[-1].displacement is result.displacement
    # d'Alembert's solution with speed 1, before either half meets an end; the mesh is dispersive by less than 1 % of the height
    for frame in frames[1:]:
        assert frame.time is not None
        x = frame.points[:, 0]
        if frame.time < 26:
            right = np.exp(-(((x - 40 - frame.time) / 4) ** 2))
            left = np.exp(-(((x - 40 + frame.time) / 4) ** 2))
            assert np.abs(frame.displacement[:, 0] - 0.005 * (left + right)).max() < 1e-4
    history = result.history
    assert history["step"].dtype == np.int64 and len(history["time"]) > 100
    energy = history["kinetic_energy"] + history["stored_energy"]
    assert np.ptp(energy) < 0.02 * energy[0]
    assert history["within_ux"][np.searchsorted(history["time"], 29.9)] == pytest.approx(0.005, abs=1e-4)
    last = bondline.Scene.from_dict(pulse).run(progress=False, keep_frames=False)
    assert len(list(last.frames())) == 1
    assert np.array_equal(last.displacement, result.displacement)


def test_probes_have_names_in_the_order_in_which_they_are_typed(bar: dict[str, Any], pulse: dict[str, Any], tmp_path: Path) -> None:
    places = {"tip": 1.0, "middle": 0.5, "a": 0.25}
    bar["output"]["probes"] = {name: {"at": at} for name, at in places.items()}
    result = bondline.run(bar, progress=False)
    assert list(result.probes) == ["tip", "middle", "a"]
    for name, at in places.items():
        assert result.probes[name]["x"] == at and result.probes[name]["ux"] == pytest.approx(5e-4 * at, abs=1e-15)
    # of a file, too
    text = """kinematics = "bar"
coupling = "local"
mesh.line = { min = 0, max = 1, x = { cells = 4 } }
materials.bar.bond-based.youngs-modulus = 2.0
conditions.left.displacement = { on = "left", x = 0 }
conditions.right.traction = { on = "right", x = 1e-3 }
[output]
probes.tip = { at = 1 }
probes.middle = { at = 0.5 }
"""
    (tmp_path / "bar.toml").write_text(text)
    of_file = bondline.Scene.load(tmp_path / "bar.toml", overrides={"output.probes.a": {"at": 0.25}}).run(progress=False)
    assert {name: of["ux"] for name, of in of_file.probes.items()} == pytest.approx({"tip": 5e-4, "middle": 2.5e-4, "a": 1.25e-4})
    assert list(of_file.probes) == ["tip", "middle", "a"]
    # over time: columns of the history
    pulse["output"]["probes"] = {"within": {"at": 70}, "within_a": {"at": 50}}
    moving = bondline.run(pulse, progress=False)
    assert list(moving.probes) == ["within", "within_a"] and set(moving.probes["within"]) == {"ux", "vx"}
    assert np.array_equal(moving.probes["within_a"]["ux"], moving.history["within_a_ux"])


def test_files_hold_the_same(pulse: dict[str, Any], tmp_path: Path) -> None:
    result = bondline.Scene.from_dict(pulse, name="pulse").run(progress=False, output=tmp_path)
    files = sorted(tmp_path.glob("pulse_*.vtu"))
    frames = list(result.frames())
    assert len(files) == len(frames) == 7
    for path, frame in zip(files, frames):
        read = meshio.read(path)
        assert np.array_equal(read.points, frame.points)
        assert set(read.point_data) == set(frame.point_data)
        for name, values in frame.point_data.items():
            assert np.array_equal(read.point_data[name], values), name
    table = np.genfromtxt(tmp_path / "pulse_history.csv", delimiter=",", names=True)
    assert table.dtype.names == tuple(result.history)
    for name, column in result.history.items():
        assert np.array_equal(table[name], column), name
    assert [Path(f).name for f in result.summary["files"]] == ["pulse.pvd", "pulse_history.csv"]


def test_meshio_and_pyvista_see_what_the_file_holds(tmp_path: Path) -> None:
    scene = bondline.Scene.load(ROOT / "examples" / "slit_plate.toml", overrides={"mesh.rectangle.x.cells": 60, "mesh.rectangle.y.cells": 60,
                                "mesh.rectangle.cutouts": {}, "peridynamics.horizon": 0.1, "peridynamics.points.lattice.spacing": "1/60"})
    result = scene.run(progress=False, output=tmp_path)
    path = tmp_path / "slit_plate.vtu"
    ours, read = result.to_meshio(), meshio.read(path)
    assert [c.type for c in ours.cells] == [c.type for c in read.cells] == ["quad", "vertex"]
    for name in read.cell_data:
        for a, b in zip(ours.cell_data[name], read.cell_data[name]):
            assert np.array_equal(a, b), name
    grid, known = result.to_pyvista(), pyvista.read(path)
    assert grid.n_points == known.n_points == len(result.points)
    assert np.array_equal(grid.celltypes, known.celltypes)
    assert np.array_equal(grid.cell_centers().points, known.cell_centers().points)
    for name in known.cell_data:
        assert np.array_equal(grid.cell_data[name], known.cell_data[name]), name
    assert np.array_equal(grid.point_data["displacement"], known.point_data["displacement"])


def address(array: np.ndarray[Any, Any]) -> int:
    found: int = array.__array_interface__["data"][0]
    return found


def test_ten_million_numbers_are_not_copied() -> None:
    count = 10_000_000 // 3 + 1
    parts, where = _bondline.frame_of_vertices(count)
    frame = bondline.Frame(*parts)
    assert frame.displacement.shape == (count, 3) and frame.displacement.size > 10_000_000
    assert address(frame.displacement) == where
    assert address(frame.displacement) == address(frame.point_data["displacement"]) == where
    assert frame.displacement[-1, 0] == count - 1
    fields: list[np.ndarray[Any, Any]] = [frame.points, frame.cell_types, *frame.cells.values(), *frame.point_data.values()]
    for array in fields:
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    # the memory lives as long as the array
    field = frame.displacement
    del parts, frame, fields, array
    assert field[-1, 0] == count - 1


def test_results_of_a_run_are_read_only(bar: dict[str, Any]) -> None:
    result = bondline.run(bar, progress=False)
    arrays = [result.points, result.displacement, *result.cell_data.values(), *result.cells.values()]
    assert not any(a.flags.writeable for a in arrays)
    assert address(result.displacement) == address(result.displacement)
    assert result.displacement.copy().flags.writeable


def test_what_is_not_installed_is_named(bar: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    result = bondline.run(bar, progress=False)
    for name in ["meshio", "pyvista"]:
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(ImportError, match=f"pip install {name}"):
            getattr(result, f"to_{name}")()


def test_a_prediction_comes_true(bar: dict[str, Any]) -> None:
    scene = bondline.Scene.from_dict(bar)
    found, done = scene.check(), scene.run(progress=False).summary
    assert found["sizes"] == done["sizes"]
    assert found["peak_memory_bytes"] > 0 and found["total_seconds"] < 10
    assert not scene.in_time and "nonlocal" in scene.to_toml()


def test_progress_is_shown_or_not(pulse: dict[str, Any], capfd: pytest.CaptureFixture[str]) -> None:
    # long enough to be seen on a busy machine too
    pulse["solve"]["explicit"]["duration"] = 10_000
    scene = bondline.Scene.from_dict(pulse)
    scene.run(progress=False)
    assert capfd.readouterr() == ("", "")
    scene.run()
    out, err = capfd.readouterr()
    assert out == "" and "bondline: steps\n" in err


class Broken(io.StringIO):
    """A stream whose reader has gone after the first line."""

    def write(self, text: str) -> int:
        if self.getvalue():
            raise BrokenPipeError
        return super().write(text)


@pytest.mark.parametrize("closed", [True, False])
def test_a_broken_stream_ends_no_run(pulse: dict[str, Any], monkeypatch: pytest.MonkeyPatch, closed: bool) -> None:
    pulse["solve"]["explicit"]["duration"] = 2000
    stream = Broken()
    if closed:
        stream.close()
    monkeypatch.setattr(sys, "stderr", stream)
    assert bondline.run(pulse).summary["motion"]["ended"] == "finished"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_one_line(pulse: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    pulse["solve"]["explicit"]["duration"] = 15_000
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    bondline.run(pulse)
    shown = stream.getvalue()
    assert "\n" not in shown and shown.startswith("\rbondline: ") and shown.endswith(" \r")
    assert "steps [####" in shown and " % " in shown
