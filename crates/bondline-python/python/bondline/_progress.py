"""How a run stands, on one line of standard error."""

from __future__ import annotations

import sys
import time
from types import TracebackType

WIDTH = 24


class Line:
    """A line that is written over while a run goes on; where standard error is no terminal and no notebook, a line for each stage."""

    def __init__(self, wanted: bool) -> None:
        stream = sys.stderr
        self.wanted = wanted and stream is not None and not stream.closed
        notebook = type(stream).__module__.startswith("ipykernel")
        self.moves = self.wanted and (notebook or stream.isatty())
        self.stage = ""
        self.length = 0
        self.begun = time.monotonic()
        # a notebook keeps what was written over
        self.pause = 1.0 if notebook else 0.0
        self.shown = float("-inf")

    def __call__(self, stage: str, done: int, total: int | None, text: str) -> None:
        if not self.wanted:
            return
        if not self.moves:
            if stage != self.stage:
                self.stage = stage
                self._write(f"bondline: {stage}\n")
            return
        now = time.monotonic()
        if now - self.shown < self.pause:
            return
        self.shown = now
        line = f"bondline: {stage}"
        if total:
            part = min(done / total, 1.0)
            full = round(WIDTH * part)
            line += f" [{'#' * full}{'.' * (WIDTH - full)}] {100 * part:3.0f} %"
        line += f" {now - self.begun:.0f} s"
        if text:
            line += f", {text}"
        self._write("\r" + line.ljust(self.length))
        self.length = len(line)

    def _write(self, text: str) -> None:
        """A stream that is full or closed ends no run."""
        try:
            sys.stderr.write(text)
            sys.stderr.flush()
        except (OSError, ValueError):
            self.wanted = False

    def __enter__(self) -> Line:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.length:
            self._write("\r" + " " * self.length + "\r")
