"""Exceptions. Each says where, what and what to do, as the command line prints it."""

from __future__ import annotations

from typing import Any


class BondlineError(Exception):
    """Anything that bondline refuses.

    ``str(error)`` is all of it. ``message`` says what is wrong and by how much, ``place`` where (the file and line of a scene, a key, a position
    in the body, or a file of results), ``help`` what to do; the last two are None where they are not known.
    """

    def __init__(
        self, text: str, *, message: str | None = None, place: str | None = None, help: str | None = None
    ) -> None:
        super().__init__(text)
        self.message: str = text if message is None else message
        self.place: str | None = place
        self.help: str | None = help

    def __reduce__(self) -> tuple[Any, ...]:
        parts = {"message": self.message, "place": self.place, "help": self.help}
        return (_made, (type(self), self.args[0], parts))


class SceneError(BondlineError):
    """A scene or a mesh that is wrong."""


class RunError(BondlineError):
    """A scene that is right and could not be run."""


def _made(kind: type[BondlineError], text: str, parts: dict[str, Any]) -> BondlineError:
    return kind(text, **parts)
