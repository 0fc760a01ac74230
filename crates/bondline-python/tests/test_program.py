"""The command line that the package brings, and runs that go on from a checkpoint."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bondline

SCRIPT = Path(sysconfig.get_path("scripts")) / "bondline"


def program(*arguments: str, by: list[str] | None = None) -> subprocess.CompletedProcess[str]:
    start = [str(SCRIPT)] if by is None else by
    return subprocess.run([*start, *arguments], capture_output=True, text=True, check=False, timeout=300)


def write(folder: Path, scene: dict[str, Any]) -> Path:
    path = folder / "scene.toml"
    path.write_text(bondline.Scene.from_dict(scene).to_toml())
    return path


def test_the_program_runs_scenes(bar: dict[str, Any], tmp_path: Path) -> None:
    path = str(write(tmp_path, bar))
    for by in [None, [sys.executable, "-m", "bondline"]]:
        ran = program("run", path, "--json", "--output", str(tmp_path / "out"), by=by)
        assert ran.returncode == 0, ran.stderr
        summary = json.loads(ran.stdout)
        assert summary["reactions"][0]["force"] == pytest.approx([-1e-3], rel=1e-10)
    assert (tmp_path / "out" / "scene.vtu").is_file()
    assert bondline.__version__ in program("--version").stdout
    checked = program("check", path)
    assert checked.returncode == 0 and "memory" in checked.stdout


def test_exit_statuses_are_those_of_the_program(bar: dict[str, Any], tmp_path: Path) -> None:
    bar["materials"]["bar"]["bond-based"]["youngs-modulus"] = 2.0
    path = write(tmp_path, bar)
    wrong = program("run", str(path), "--set", "peridynamics.horizon=-1")
    assert wrong.returncode == 1 and "horizon" in wrong.stderr
    assert program("run").returncode == 2
    little = program("run", str(path), "--memory", "1kB", "--output", str(tmp_path / "out"))
    assert little.returncode in (1, 4) and "memory" in little.stderr
    suites = program("verify", "patch")
    assert suites.returncode == 1 and "program of their own" in suites.stderr


def test_studies_start_the_program_again(bar: dict[str, Any], tmp_path: Path) -> None:
    path = str(write(tmp_path, bar))
    out = str(tmp_path / "trade")
    found = program("trade", path, "--knob", "coupling", "--budget", "60s", "--quiet", "--output", out)
    assert found.returncode == 0, found.stderr
    assert all(Path(line).is_file() for line in found.stdout.split("\n") if line)
    assert ".svg" in found.stdout or ".csv" in found.stdout


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
def test_ctrl_c_leaves_a_checkpoint_that_either_goes_on_from(endless: dict[str, Any], tmp_path: Path) -> None:
    path = write(tmp_path, endless)
    out = tmp_path / "out"
    started = subprocess.Popen(
        [str(SCRIPT), "run", str(path), "--output", str(out)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    for _ in range(600):
        if (out / "scene_history.csv").is_file():
            break
        time.sleep(0.1)
    time.sleep(0.5)
    started.send_signal(signal.SIGINT)
    said, _ = started.communicate(timeout=120)
    assert started.returncode == 130, said
    assert (out / "scene.checkpoint").is_file()
    with pytest.raises(ValueError, match="resume"):
        bondline.Scene.load(path).run(resume=True, progress=False)


def test_a_run_goes_on_from_its_checkpoint(pulse: dict[str, Any], tmp_path: Path) -> None:
    path = write(tmp_path, pulse)
    whole = bondline.Scene.load(path).run(progress=False)

    class Enough(Exception):
        pass

    def stop(frame: bondline.Frame) -> None:
        if frame.time is not None and frame.time > 10:
            raise Enough

    scene = bondline.Scene.load(path, overrides={"solve.explicit.checkpoint-every": 10})
    with pytest.raises(Enough):
        scene.run(progress=False, output=tmp_path / "out", on_frame=stop)
    rest = scene.run(progress=False, output=tmp_path / "out", resume=True)
    assert 0 < rest.history["time"][0] and rest.history["time"][-1] == whole.history["time"][-1]
    assert len(rest.history["time"]) < len(whole.history["time"])
    assert np.array_equal(rest.displacement, whole.displacement)
