"""A scene with many values of its keys, on several processes."""

from __future__ import annotations

import itertools
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, overload

from bondline._errors import BondlineError, RunError
from bondline._result import Result


@dataclass(frozen=True, repr=False, eq=False)
class Case:
    """One run of a sweep: its keys, and its result or the reason why it has none."""

    #: The keys that the sweep set, by their dotted names.
    keys: dict[str, Any]
    #: The last solution, the tables and the summary; None of a case that was refused or failed.
    result: Result | None
    #: Why there is no result; None where there is one.
    error: BondlineError | None

    def __repr__(self) -> str:
        end = "done" if self.error is None else str(self.error).splitlines()[0]
        return f"<Case {self.keys}: {end}>"


class Sweep(Sequence[Case]):
    """The cases of a sweep, in their order."""

    def __init__(self, cases: Iterable[Case]) -> None:
        self._cases = tuple(cases)

    def __len__(self) -> int:
        return len(self._cases)

    @overload
    def __getitem__(self, index: int) -> Case: ...
    @overload
    def __getitem__(self, index: slice) -> Sweep: ...
    def __getitem__(self, index: int | slice) -> Case | Sweep:
        if isinstance(index, slice):
            return Sweep(self._cases[index])
        return self._cases[index]

    def results(self) -> list[Result]:
        """The results of all cases; raises the error of the first case without one."""
        found = []
        for case in self._cases:
            if case.error is not None:
                raise case.error
            assert case.result is not None
            found.append(case.result)
        return found

    def table(self, **quantities: Callable[[Result], Any]) -> dict[str, list[Any]]:
        """Columns for ``pandas.DataFrame``: a row for each case, with its keys, ``quantities`` of its result by name, and ``reason``.

        Where a case has no result, quantities are not a number and ``reason`` says why; elsewhere ``reason`` is None.
        A key that a case leaves out is None.
        """
        names = dict.fromkeys(key for case in self._cases for key in case.keys)
        columns: dict[str, list[Any]] = {key: [case.keys.get(key) for case in self._cases] for key in names}
        for name in [*quantities, "reason"]:
            if name in columns:
                raise ValueError(f"the quantity {name} has the name of a key; give it another one")
        for name, of in quantities.items():
            columns[name] = [float("nan") if case.result is None else of(case.result) for case in self._cases]
        columns["reason"] = [None if case.error is None else str(case.error) for case in self._cases]
        return columns

    def __repr__(self) -> str:
        failed = sum(case.error is not None for case in self._cases)
        return f"<Sweep: {len(self)} cases, {failed} without a result>"


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
                f"a process of the sweep ended with the status {process.returncode}; run the case alone to see why"
            )
        return pickle.loads(out)

    def end(self) -> None:
        with self.lock:
            self.ended = True
            for process in self.running:
                process.kill()


def _listed(
    values: Mapping[str, Any] | Iterable[Mapping[str, Any]],
    where: Callable[[dict[str, Any]], bool] | None,
    also: Callable[[dict[str, Any]], Mapping[str, Any]] | None,
) -> Iterator[dict[str, Any]]:
    """The keys of each case."""
    listed: Iterable[Mapping[str, Any]]
    if isinstance(values, Mapping):
        listed = (dict(zip(values, of)) for of in itertools.product(*values.values()))
    else:
        listed = values
    for keys in map(dict, listed):
        if where is None or where(keys):
            yield keys if also is None else {**keys, **also(keys)}


def sweep(
    scene: Mapping[str, Any] | str | os.PathLike[str],
    values: Mapping[str, Any] | Iterable[Mapping[str, Any]],
    *,
    where: Callable[[dict[str, Any]], bool] | None = None,
    also: Callable[[dict[str, Any]], Mapping[str, Any]] | None = None,
    processes: int | None = None,
    directory: str | os.PathLike[str] = ".",
    overrides: Mapping[str, Any] | None = None,
) -> Sweep:
    """Runs a scene once for each case: each combination of the values of some dotted keys, or each of the given tables of keys.

    scene: the keys of a scene, whose relative paths start in ``directory``; or a scene file.
    Functions in it must be defined at the top level of a module, where other processes find them.
    values: ``{"coupling": ["splice", "truncated"], "peridynamics.horizon": [0.1, 0.2]}`` for all four, the last key the fastest; or ``[{"coupling": "splice"}, …]``.
    where: takes the keys of a case and says whether it is run.
    also: takes the keys of a case and gives further ones that follow from them.
    processes: how many run at once, each with its share of the cores; one per core if left out.

    A case that is refused or fails has the reason in place of a result, and the others go on. Results hold the last solution only.
    What is no error of a scene, such as one that a function in it raises, ends the sweep.
    """
    cases = list(_listed(values, where, also))
    cores = os.cpu_count() or 1
    at_once = min(cores if processes is None else processes, max(len(cases), 1))
    if at_once < 1:
        raise ValueError(f"processes is {processes}; give at least 1")
    shared = dict(scene) if isinstance(scene, Mapping) else Path(scene)
    # a process finds modules where this one does
    modules = os.pathsep.join(os.path.abspath(folder) for folder in sys.path)
    share = str(max(cores // at_once, 1))
    environment = dict(os.environ, PYTHONPATH=modules, RAYON_NUM_THREADS=share)
    try:
        tasks = [pickle.dumps((shared, str(directory), {**(overrides or {}), **keys})) for keys in cases]
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        raise ValueError(
            f"a sweep hands scenes to other processes, which is not possible here ({error}); define functions at the top level of a module"
        ) from error
    started = _Processes()
    with ThreadPoolExecutor(at_once) as pool:
        try:
            outcomes = [pool.submit(started.outcome, task, environment) for task in tasks]
            found: list[Case] = []
            for keys, outcome in zip(cases, outcomes):
                end = outcome.result()
                if isinstance(end, BondlineError):
                    found.append(Case(keys, None, end))
                elif isinstance(end, BaseException):
                    raise end
                else:
                    found.append(Case(keys, end, None))
        except BaseException:
            started.end()
            raise
    return Sweep(found)
