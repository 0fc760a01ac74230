"""Scenes and their runs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from bondline import _bondline
from bondline._errors import BondlineError
from bondline._mesh import Mesh
from bondline._progress import Line
from bondline._result import Frame, Result


class Scene:
    """What is computed: mesh, materials, zones, coupling, conditions, solution.

    Made by :meth:`load` or :meth:`from_dict`; it is validated then and does not change.
    """

    def __init__(self, native: _bondline.Scene, probes: Iterable[str] | None = None) -> None:
        self._native = native
        # as they are typed; a table of TOML that is made of a dictionary has its keys sorted
        self._probes = tuple(native.probes if probes is None else probes)

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], *, overrides: Mapping[str, Any] | None = None
    ) -> Scene:
        """Reads a TOML scene; ``overrides`` are keys with other values, ``{"peridynamics.horizon": 0.04}``.

        Raises :class:`SceneError` with place and remedy.
        """
        return cls(_bondline.Scene.load(Path(path), dict(overrides or {})))

    @classmethod
    def from_dict(
        cls,
        keys: Mapping[str, Any],
        *,
        directory: str | os.PathLike[str] = ".",
        name: str = "scene",
        mesh: Mesh | None = None,
        overrides: Mapping[str, Any] | None = None,
    ) -> Scene:
        """Takes the keys of a TOML scene from a dictionary.

        Relative paths in it start in ``directory``; files are called ``name``. A ``mesh`` in memory stands for the key ``mesh``.

        Raises :class:`SceneError` with place and remedy.
        """
        native = None if mesh is None else mesh._native
        found = _bondline.Scene.from_table(
            dict(keys), Path(directory), name, native, dict(overrides or {})
        )
        names = found.probes
        typed = list(keys.get("output", {}).get("probes", {})) if isinstance(keys.get("output"), Mapping) else []
        return cls(found, sorted(names, key=lambda name: typed.index(name) if name in typed else len(typed)))

    @property
    def name(self) -> str:
        """What files are called."""
        return self._native.name

    @property
    def in_time(self) -> bool:
        """Whether the scene runs in time or load steps."""
        return self._native.moves

    def to_toml(self) -> str:
        """The scene as the text of a TOML file, with its overrides; a mesh in memory is named there, not written."""
        return self._native.text()

    def check(self, *, pilots: float | None = None, progress: bool = False) -> dict[str, Any]:
        """Predicts size, memory, time and error, and says what the program chooses, without a run: what ``bondline check --json`` prints.

        Runs with other spacings, which the error is predicted from, may take ``pilots`` seconds.
        """
        with Line(progress) as line:
            found: dict[str, Any] = json.loads(self._native.check(pilots, line))
        return found

    def run(
        self,
        *,
        progress: bool = True,
        output: str | os.PathLike[str] | None = None,
        threads: int | None = None,
        resume: bool = False,
        on_frame: Callable[[Frame], object] | None = None,
        keep_frames: bool = True,
    ) -> Result:
        """Solves the scene. Other threads of the interpreter go on meanwhile.

        progress: shows on standard error how the run stands.
        output: a folder for the files that the command line writes; no file is written without one.
        threads: threads to compute with, instead of one per core.
        resume: goes on from the last checkpoint in ``output``, or from the beginning if there is none; of scenes in time or load steps. Frames and tables are those from there on.
        on_frame: called with each solution as it is there.
        keep_frames: keeps all of them for :meth:`Result.frames`; without it, the last one.

        Ctrl-C ends the run where it next reports progress and raises ``KeyboardInterrupt``; a run in time ends after its step, and leaves a checkpoint in ``output``.
        Raises :class:`RunError`.
        """
        if threads is not None and threads < 1:
            raise ValueError(f"threads is {threads}; give at least 1, or leave it out for one per core")
        if resume and (output is None or not self.in_time):
            raise ValueError(
                "resume goes on from a checkpoint: give the folder that holds it as output, and a scene in time or load steps"
            )
        frames: list[Frame] = []

        def take(*parts: Any) -> None:
            frame = Frame(*parts)
            if not keep_frames:
                frames.clear()
            frames.append(frame)
            if on_frame is not None:
                on_frame(frame)

        folder = None if output is None else Path(output)
        with Line(progress) as line:
            summary, tables = self._native.run(folder, threads, resume, line if progress else None, take)
        if not frames:
            raise BondlineError("the run showed no solution; please report this with the scene")
        last = frames[-1]
        return Result(
            time=last.time,
            points=last.points,
            cells=last.cells,
            cell_types=last.cell_types,
            point_data=last.point_data,
            cell_data=last.cell_data,
            summary=json.loads(summary),
            tables=tables,
            kept=tuple(frames),
            probe_names=self._probes,
        )

    def __repr__(self) -> str:
        return f"<Scene {self.name!r}>"


def run(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    *,
    overrides: Mapping[str, Any] | None = None,
    progress: bool = True,
    output: str | os.PathLike[str] | None = None,
) -> Result:
    """Runs a scene file, or a dictionary with the keys of one."""
    if isinstance(scene, Mapping):
        found = Scene.from_dict(scene, overrides=overrides)
    else:
        found = Scene.load(scene, overrides=overrides)
    return found.run(progress=progress, output=output)
