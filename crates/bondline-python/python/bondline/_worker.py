"""A process of a sweep: reads a scene from standard input, runs it, writes the result to standard output."""

from __future__ import annotations

import os
import pickle
import sys
from typing import Any

from bondline._scene import Scene


def _outcome(keys: Any, directory: str, overrides: dict[str, Any]) -> Any:
    try:
        if isinstance(keys, dict):
            scene = Scene.from_dict(keys, directory=directory, overrides=overrides)
        else:
            scene = Scene.load(keys, overrides=overrides)
        return scene.run(progress=False, keep_frames=False)
    except Exception as error:
        return error


def main() -> None:
    task = pickle.load(sys.stdin.buffer)
    # nothing else may write where the result goes
    result = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    with result:
        pickle.dump(_outcome(*task), result, protocol=pickle.HIGHEST_PROTOCOL)


if __name__ == "__main__":
    main()
