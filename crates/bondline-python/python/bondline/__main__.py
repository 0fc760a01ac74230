"""The command line: what the program ``bondline`` does, from the package."""

from __future__ import annotations

import os
import signal
import sys
import sysconfig
from pathlib import Path
from typing import NoReturn

from bondline import _bondline


def main() -> NoReturn:
    """Does what ``sys.argv`` says and ends with the exit status of the program."""
    # the interpreter would see Ctrl-C only after the run
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    name = "bondline.exe" if os.name == "nt" else "bondline"
    script = Path(sysconfig.get_path("scripts")) / name
    program = script if script.is_file() else Path(sys.argv[0]).resolve()
    sys.exit(_bondline.command(program, ["bondline", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
