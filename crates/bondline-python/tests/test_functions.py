"""Functions of Python in the place of numbers of a scene."""

import copy
import threading
from typing import Any

import bondline
import numpy as np
import pytest

BAR: dict[str, Any] = {
    "kinematics": "bar",
    "mesh": {"line": {"min": 0, "max": 10, "x": {"cells": 40}}},
    "materials": {"bar": {"bond-based": {"youngs-modulus": 1, "density": 1}}},
    "peridynamics": {"horizon": 0.75, "points": {"lattice": {"spacing": 0.25}}},
    "zones": {"nonlocal": {"box": {"min": 4, "max": 6}}},
    "coupling": "splice",
    "conditions": {
        "left": {"displacement": {"on": "left", "x": 0}},
        "pull": {"body-force": {"x": "1e-3 * x"}},
    },
}


def with_force(force: Any, **more: Any) -> bondline.Scene:
    keys = copy.deepcopy(BAR) | more
    keys["conditions"]["pull"]["body-force"]["x"] = force
    return bondline.Scene.from_dict(keys)


def test_a_field_is_called_for_all_places_at_once() -> None:
    sizes: list[int] = []

    def force(x: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        sizes.append(len(x))
        return 1e-3 * x

    found = with_force(force).run(progress=False)
    assert np.array_equal(found.displacement, with_force("1e-3 * x").run(progress=False).displacement)
    assert max(sizes) > 1 and len(sizes) < 100
    # E = 1, no stress at the end: u(10) = 1e-3 · 10³ / 3
    assert found.displacement.max() == pytest.approx(1 / 3, rel=1e-3)


def test_functions_of_place_and_time() -> None:
    in_time = {"solve": {"explicit": {"duration": 2, "outputs": 2}}}
    for function, expression in [
        (lambda t: 1e-3 * t, "1e-3 * t"),
        (lambda x, t: 1e-4 * x * t, "1e-4 * x * t"),
        (lambda y, x, scale=1e-4: scale * x + y, "1e-4 * x"),
    ]:
        found = with_force(function, **in_time).run(progress=False)
        wanted = with_force(expression, **in_time).run(progress=False)
        assert found.displacement.any() and np.array_equal(found.displacement, wanted.displacement)
        work = found.history["external_work"]
        assert np.array_equal(work, wanted.history["external_work"]) and work[-1] > 0


def test_a_number_for_all_places_is_enough_and_overrides_may_be_functions() -> None:
    whole = bondline.Scene.from_dict(BAR, overrides={"conditions.pull.body-force.x": lambda x: 1e-3})
    exact = with_force(1e-3).run(progress=False).displacement
    assert np.array_equal(whole.run(progress=False).displacement, exact)


def test_what_a_function_raises_is_raised() -> None:
    def broken(x: Any) -> Any:
        raise ZeroDivisionError("no such load")

    with pytest.raises(ZeroDivisionError, match="no such load"):
        with_force(broken).run(progress=False)
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        with_force(lambda x: np.zeros(2)).run(progress=False)
    with pytest.raises(bondline.BondlineError):
        with_force(lambda x: np.nan * x).run(progress=False)

    with pytest.raises(ZeroDivisionError):
        with_force(lambda x, t: 1 / (t < 1) * x, solve={"explicit": {"duration": 2}}).run(progress=False)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda s: s, "parameter `s`"),
        (lambda: 1, "without parameters"),
        (lambda *x: x, "parameter `x`"),
        (np.sin, "function"),
    ],
)
def test_parameters_are_coordinates_and_the_time(function: Any, words: str) -> None:
    with pytest.raises(bondline.SceneError, match=words) as caught:
        with_force(function)
    assert caught.value.place == "conditions.pull.body-force.x"
    assert caught.value.help is not None and "lambda x, t" in caught.value.help


def test_a_function_is_no_constant() -> None:
    keys = copy.deepcopy(BAR)
    keys["peridynamics"]["points"]["lattice"]["spacing"] = lambda x: 0.25
    with pytest.raises(bondline.SceneError):
        bondline.Scene.from_dict(keys)


def test_runs_in_threads_call_their_own_functions() -> None:
    found: dict[int, float] = {}

    def run(k: int) -> None:
        force = k * 1e-3
        found[k] = with_force(lambda x: force * x).run(progress=False).displacement.max()

    threads = [threading.Thread(target=run, args=(k,)) for k in (1, 2, 3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found[2] == pytest.approx(2 * found[1]) and found[3] == pytest.approx(3 * found[1])


def linear(x: Any) -> Any:
    return 1e-3 * x


def test_a_sweep_takes_functions_of_modules() -> None:
    keys = copy.deepcopy(BAR)
    with pytest.raises(ValueError, match="module"):
        bondline.sweep(keys, {"conditions.pull.body-force.x": [lambda x: x]})
    found = bondline.sweep(keys, {"conditions.pull.body-force.x": [linear, "2e-3 * x"]}).results()
    assert np.allclose(2 * found[0].displacement, found[1].displacement)
