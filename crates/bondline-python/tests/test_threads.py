"""Runs let the interpreter go on, do not disturb each other, and end at Ctrl-C."""

from __future__ import annotations

import _thread
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bondline


def test_two_runs_at_once_are_those_of_each_alone(bar: dict[str, Any], pulse: dict[str, Any]) -> None:
    scenes = [bondline.Scene.from_dict(bar), bondline.Scene.from_dict(pulse)] * 2
    alone = [scene.run(progress=False) for scene in scenes[:2]] * 2
    found: list[bondline.Result | None] = [None] * 4

    def run(i: int) -> None:
        found[i] = scenes[i].run(progress=False)

    threads = [threading.Thread(target=run, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for result, wanted in zip(found, alone):
        assert result is not None
        assert np.array_equal(result.displacement, wanted.displacement)
        assert np.array_equal(result.cell_data["linear_stress"], wanted.cell_data["linear_stress"])


@pytest.mark.parametrize("threads", [1, 2])
def test_the_number_of_threads_changes_no_bit(pulse: dict[str, Any], threads: int) -> None:
    scene = bondline.Scene.from_dict(pulse)
    one = scene.run(progress=False, threads=threads)
    assert np.array_equal(one.displacement, scene.run(progress=False).displacement)


def test_the_interpreter_goes_on(pulse: dict[str, Any]) -> None:
    pulse["solve"]["explicit"] = {"duration": 5000, "outputs": 1, "history-interval": 1000}
    scene = bondline.Scene.from_dict(pulse)
    ended = threading.Event()
    ticks: list[float] = []

    def tick() -> None:
        while not ended.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    begun = time.monotonic()
    scene.run(progress=False)
    took = time.monotonic() - begun
    ended.set()
    thread.join()
    assert took > 0.2
    # far more than the few that a run that holds the interpreter lets through
    assert len(ticks) > 20 * took


def after(seconds: float, action: Callable[[], object]) -> threading.Timer:
    timer = threading.Timer(seconds, action)
    timer.daemon = True
    timer.start()
    return timer


def test_ctrl_c_ends_a_run_in_time_with_a_checkpoint(endless: dict[str, Any], tmp_path: Path) -> None:
    endless["solve"]["explicit"]["outputs"] = 50_000
    scene = bondline.Scene.from_dict(endless, name="long")
    times: list[float] = []

    def press(frame: bondline.Frame) -> None:
        # the first one is shown before the first step
        times.append(time.monotonic())
        if len(times) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        scene.run(progress=False, output=tmp_path, on_frame=press)
    assert time.monotonic() - times[1] < 5
    assert (tmp_path / "long.checkpoint").exists()
    assert (tmp_path / "long.pvd").exists()


def test_ctrl_c_ends_a_run_within_a_load_step(pulse: dict[str, Any], tmp_path: Path) -> None:
    pulse["mesh"]["line"]["x"]["cells"] = 40_000
    pulse["peridynamics"] = {"horizon": 0.0075, "points": {"lattice": {"spacing": 0.0025}}}
    del pulse["initial"]
    pulse["conditions"]["right"] = {"displacement": {"on": "right", "x": "1e-3 * t"}}
    # so many passes take an hour
    pulse["solve"] = {"quasi-static": {"steps": 1, "method": "relaxation", "tolerance": 1e-10, "max-iterations": 100_000_000}}
    scene = bondline.Scene.from_dict(pulse, name="long")
    times: list[float | None] = []
    timer = after(1.0, _thread.interrupt_main)
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        scene.run(progress=False, output=tmp_path, on_frame=lambda frame: times.append(frame.time))
    timer.join()
    assert time.monotonic() - begun < 10
    assert times == [0.0]
    assert (tmp_path / "long.checkpoint").exists()


def test_ctrl_c_ends_a_static_run(tmp_path: Path) -> None:
    keys = {
        "kinematics": "solid",
        "mesh": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "x": {"cells": 60}, "y": {"cells": 60}, "z": {"cells": 60}}},
        "materials": {"m": {"lps": {"youngs-modulus": 1, "poisson-ratio": 0.3}}},
        "coupling": "local",
        "conditions": {"left": {"displacement": {"on": "left", "x": 0, "y": 0, "z": 0}}, "right": {"traction": {"on": "right", "x": 1}}},
        "solver": {"method": "direct"},
    }
    scene = bondline.Scene.from_dict(keys)
    timer = after(1.0, _thread.interrupt_main)
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        scene.run(progress=False, output=tmp_path)
    timer.join()
    assert time.monotonic() - begun < 20
    assert list(tmp_path.glob("*.vtu")) == []


def test_a_callback_ends_the_run(endless: dict[str, Any]) -> None:
    endless["solve"]["explicit"]["outputs"] = 100_000

    class Enough(Exception):
        pass

    seen = []

    def look(frame: bondline.Frame) -> None:
        seen.append(frame.time)
        if len(seen) == 3:
            raise Enough

    with pytest.raises(Enough):
        bondline.Scene.from_dict(endless).run(progress=False, on_frame=look)
    assert len(seen) == 3
    assert threading.active_count() < 10


def test_a_run_after_an_interrupt_is_a_run_like_any(bar: dict[str, Any], endless: dict[str, Any]) -> None:
    wanted = bondline.run(bar, progress=False)
    timer = after(0.2, _thread.interrupt_main)
    with pytest.raises(KeyboardInterrupt):
        bondline.run(endless, progress=False)
    timer.join()
    assert np.array_equal(bondline.run(bar, progress=False).displacement, wanted.displacement)


def test_two_runs_write_no_common_file(bar: dict[str, Any], pulse: dict[str, Any], tmp_path: Path) -> None:
    seen: list[bondline.Result] = []

    def again(frame: bondline.Frame) -> None:
        # a run within a run: elsewhere it is one like any other, in the same files it is refused
        seen.append(bondline.run(bar, progress=False, output=tmp_path / "other"))
        bondline.run(pulse, progress=False, output=tmp_path / "own")

    with pytest.raises(bondline.RunError, match="another run writes"):
        bondline.Scene.from_dict(pulse).run(progress=False, output=tmp_path / "own", on_frame=again)
    assert len(seen) == 1 and (tmp_path / "other" / "scene.vtu").exists()
