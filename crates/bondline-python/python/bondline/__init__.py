"""Couples classical finite elements to meshfree peridynamics.

A :class:`Scene` says what is computed, with the keys of a TOML scene file. Its run gives a :class:`Result`, whose fields are numpy arrays::

    import bondline

    result = bondline.run("plate.toml")
    print(result.displacement.max(), result.summary["reactions"])
"""

from bondline._bondline import __version__
from bondline._errors import BondlineError, RunError, SceneError
from bondline._mesh import Mesh
from bondline._result import Frame, Result
from bondline._scene import Scene, run
from bondline._sweep import Case, Sweep, sweep

__all__ = [
    "BondlineError",
    "Case",
    "Frame",
    "Mesh",
    "Result",
    "RunError",
    "Scene",
    "SceneError",
    "Sweep",
    "__version__",
    "run",
    "sweep",
]
