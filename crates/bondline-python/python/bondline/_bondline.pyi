"""The native half of the package. Private: what it takes and gives may change."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mesh", "Scene", "__version__", "command", "frame_of_vertices"]

__version__: str

_Progress = Callable[[str, int, int | None, str], None]
_Frame = tuple[
    float | None,
    NDArray[np.float64],
    dict[str, NDArray[np.int64]],
    NDArray[np.uint8],
    dict[str, NDArray[Any]],
    dict[str, NDArray[Any]],
]

@final
class Scene:
    @staticmethod
    def load(path: str | os.PathLike[str], overrides: Mapping[str, Any]) -> Scene: ...
    @staticmethod
    def from_table(
        keys: dict[str, Any],
        directory: str | os.PathLike[str],
        name: str,
        mesh: Mesh | None,
        overrides: Mapping[str, Any],
    ) -> Scene: ...
    @property
    def moves(self) -> bool: ...
    @property
    def name(self) -> str: ...
    @property
    def probes(self) -> list[str]: ...
    def text(self) -> str: ...
    def check(self, pilots: float | None, progress: _Progress | None) -> str: ...
    def run(
        self,
        output: str | os.PathLike[str] | None,
        threads: int | None,
        resume: bool,
        progress: _Progress | None,
        take: Callable[..., None],
    ) -> tuple[str, dict[str, dict[str, NDArray[Any]]]]: ...

@final
class Mesh:
    def __new__(
        cls,
        name: str,
        points: NDArray[np.float64],
        blocks: Sequence[tuple[str, NDArray[np.uint64]]],
        element_sets: Sequence[tuple[str, NDArray[np.uint64]]],
        point_sets: Sequence[tuple[str, NDArray[np.uint64]]],
    ) -> Mesh: ...

def command(
    program: str | os.PathLike[str], arguments: Sequence[str]
) -> int: ...
def frame_of_vertices(count: int) -> tuple[_Frame, int]: ...
