"""A scene with many values of a key, on several processes."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock
from typing import Any

from bondline._errors import BondlineError, RunError
from bondline._result import Result


class _Processes:
    """Those that run, to be ended with the sweep."""

    def __init__(self) -> None:
        self.running: set[subprocess.Popen[bytes]] = set()
        self.lock = Lock()
        self.ended = False

    def outcome(self, task: bytes, environment: dict[str, str]) -> Any:
        with self.lock:
            if self.ended:
                return None
            process = subprocess.Popen(
                [sys.executable, "-m", "bondline._worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=environment,
            )
            self.running.add(process)
        out, _ = process.communicate(task)
        with self.lock:
            self.running.discard(process)
        if process.returncode != 0:
            return RunError(
                f"a process of the sweep ended with the status {process.returncode}; run the value alone to see why"
            )
        return pickle.loads(out)

    def end(self) -> None:
        with self.lock:
            self.ended = True
            for process in self.running:
                process.kill()


def sweep(
    scene: Mapping[str, Any] | str | os.PathLike[str],
    key: str,
    values: Sequence[Any],
    *,
    processes: int | None = None,
    directory: str | os.PathLike[str] = ".",
    overrides: Mapping[str, Any] | None = None,
) -> list[Result]:
    """Runs a scene once for each of ``values`` of the dotted ``key``; returns the results in the order of ``values``.

    scene: the keys of a scene, whose relative paths start in ``directory``; or a scene file.
    Functions in it must be defined at the top level of a module, where other processes find them.
    processes: how many run at once, each with its share of the cores; one per core if left out.

    Results hold the last solution only. Raises what the first value raises that fails; the others are ended then.
    """
    cores = os.cpu_count() or 1
    at_once = min(cores if processes is None else processes, max(len(values), 1))
    if at_once < 1:
        raise ValueError(f"processes is {processes}; give at least 1")
    shared = dict(scene) if isinstance(scene, Mapping) else Path(scene)
    # a process finds modules where this one does
    modules = os.pathsep.join(os.path.abspath(folder) for folder in sys.path)
    share = str(max(cores // at_once, 1))
    environment = dict(os.environ, PYTHONPATH=modules, RAYON_NUM_THREADS=share)
    try:
        tasks = [
            pickle.dumps((shared, str(directory), {**(overrides or {}), key: value})) for value in values
        ]
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        raise ValueError(
            f"a sweep hands scenes to other processes, which is not possible here ({error}); define functions at the top level of a module"
        ) from error
    started = _Processes()
    with ThreadPoolExecutor(at_once) as pool:
        try:
            outcomes = [pool.submit(started.outcome, task, environment) for task in tasks]
            results: list[Result] = []
            for value, outcome in zip(values, outcomes):
                found = outcome.result()
                if isinstance(found, BondlineError):
                    found.args = (f"{key} = {value}: {found.args[0]}",)
                if isinstance(found, BaseException):
                    raise found
                results.append(found)
        except BaseException:
            started.end()
            raise
    return results
