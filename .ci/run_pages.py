"""Runs what the pages of the manual say, as a reader would: files are saved, commands typed, pictures made, and what the text quotes is compared.

    python .ci/run_pages.py WORK [--keep] [--update] [PAGE...]

The pages are those of docs/manual in the order of docs/SUMMARY.md; all share the folder WORK/run. `bondline`, `gmsh` and `python` must be on the path.
With names of pages only these are run, in the folder as it is if `--keep` is given. `--update` copies the figures that were made beside the pages.

A fenced block says in its first line what becomes of it:

    toml file=plate.toml    any language: the block is saved under this name
    sh                      commands, run one after another; `sh fails`: the last one has to end with an error; `sh skip`: only shown
    python                  run as in a notebook: names live until the end of the page; `python skip`: only shown
    text                    lines of what the last block printed, in this order; `…` stands for anything; `text skip`: only shown

Numbers in such lines may differ by two units of their last digit. A number in prose is checked by a comment after it:

    <!-- check: 5.31 = column("out/beam_history.csv", "load_reaction_y").min() / 1e3 -->

The text before the colon's number must hold it, and the Python expression must round to it. Figures are the files that the page shows; each has to be made by the
page, and has to look like the one that lies beside the page.
"""

import contextlib
import io
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Fault(Exception):
    """What does not hold, with the line of the page."""


def column(path, name):
    """A column of a CSV file as a numpy array."""
    import numpy

    table = numpy.genfromtxt(path, delimiter=",", names=True, deletechars="")
    return table[name]


def load(path):
    """A JSON file."""
    return json.loads(Path(path).read_text())


def tolerance(literal):
    """One unit of the last digit of a number as it is written."""
    mantissa, _, exponent = literal.replace("−", "-").partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)


def value(literal):
    return float(literal.replace("−", "-"))


def line_matches(expected, actual):
    """Whether a printed line is the expected one, up to spaces, `…` and the last digits of numbers."""
    expected, actual = " ".join(expected.split()), " ".join(actual.split())
    pattern, last, numbers = "", 0, []
    for found in re.finditer(f"…|{NUMBER.pattern}", expected):
        pattern += re.escape(expected[last : found.start()])
        last = found.end()
        if found.group() == "…":
            pattern += ".*?"
        else:
            pattern += f"({NUMBER.pattern})"
            numbers.append(found.group())
    pattern += re.escape(expected[last:])
    match = re.fullmatch(pattern, actual)
    if not match:
        return False
    return all(abs(value(a) - value(b)) <= 2.01 * tolerance(b) for a, b in zip(match.groups(), numbers))


def blocks(text):
    """Fenced blocks and comments of a page: (line, kind, words, content), the kind being `block` or `check`."""
    found, lines, i = [], text.split("\n"), 0
    while i < len(lines):
        fence = re.match(r"(`{3,})(.*)", lines[i])
        check = re.match(r"<!-- check: (\S+) = (.*) -->$", lines[i])
        if fence:
            begin = i
            i += 1
            while lines[i] != fence.group(1):
                i += 1
            found.append((begin + 1, "block", fence.group(2).split(), "\n".join(lines[begin + 1 : i]) + "\n"))
        elif check:
            found.append((i + 1, "check", list(check.groups()), "\n".join(lines[:i])))
        elif lines[i].startswith("<!-- check"):
            raise Fault(f"line {i + 1}: not `<!-- check: NUMBER = EXPRESSION -->`")
        i += 1
    return found


class Page:
    """A page, and what its last block printed."""

    def __init__(self, path, folder, update):
        self.path, self.folder, self.update = path, folder, update
        self.text = path.read_text()
        self.names = {"column": column, "load": load, "__name__": "__main__"}
        self.printed = ""
        self.counts = {"files": 0, "commands": 0, "lines": 0, "numbers": 0, "figures": 0}

    def run(self):
        for line, kind, words, content in blocks(self.text):
            try:
                if kind == "check":
                    self.check(words[0], words[1], content)
                else:
                    self.block(words, content)
            except Fault as fault:
                raise Fault(f"{self.path.relative_to(ROOT)}:{line}: {fault}") from None
        self.figures()

    def block(self, words, content):
        language, options = words[0] if words else "", words[1:]
        name = next((o[5:] for o in options if o.startswith("file=")), None)
        if "skip" in options:
            return
        if name:
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / name).write_text(content)
            self.counts["files"] += 1
        elif language == "sh":
            self.shell(content, "fails" in options)
        elif language == "python":
            self.python(content)
        elif language == "text":
            self.compare(content)
        elif language != "toml":
            raise Fault(f"a block of `{language}` is neither saved, run nor compared: add `file=NAME` or `skip`")

    def shell(self, content, fails):
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", content], cwd=self.folder, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )
        self.printed = done.stdout
        self.counts["commands"] += 1
        if (done.returncode != 0) != fails:
            raise Fault(f"exit status {done.returncode} of\n{content}{done.stdout}")

    def python(self, content):
        printed = io.StringIO()
        with contextlib.chdir(self.folder) if hasattr(contextlib, "chdir") else changed(self.folder), contextlib.redirect_stdout(printed):
            try:
                exec(compile(content, str(self.path), "exec"), self.names)
            except Exception:
                raise Fault(traceback.format_exc()) from None
        self.printed = printed.getvalue()
        self.counts["commands"] += 1

    def compare(self, content):
        lines = re.sub(r"\x1b\[[0-9;]*m", "", self.printed).split("\n")
        at = 0
        for expected in filter(str.strip, content.split("\n")):
            while at < len(lines) and not line_matches(expected, lines[at]):
                at += 1
            if at == len(lines):
                raise Fault(f"not printed, or not in this order:\n    {expected}\nof\n{self.printed}")
            at += 1
            self.counts["lines"] += 1

    def check(self, literal, expression, before):
        if not re.search(rf"(?<![\d.]){re.escape(literal)}(?![\d]|\.\d)", before[-900:]):
            raise Fault(f"the text before does not hold {literal}")
        with contextlib.chdir(self.folder) if hasattr(contextlib, "chdir") else changed(self.folder):
            try:
                found = float(eval(expression, self.names))
            except Exception:
                raise Fault(traceback.format_exc()) from None
        if abs(found - value(literal)) > 1.001 * tolerance(literal):
            raise Fault(f"the text has {literal}, `{expression}` is {found}")
        self.counts["numbers"] += 1

    def figures(self):
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", self.text):
            made, kept = self.folder / target, self.path.parent / target
            if not made.exists():
                raise Fault(f"{self.path.name}: nothing made {target}")
            if self.update:
                kept.parent.mkdir(exist_ok=True)
                shutil.copy(made, kept)
            elif not kept.exists() or unlike(made, kept):
                raise Fault(f"{self.path.name}: {target} does not look as the text makes it now: {made}; run with --update and look at it")
            self.counts["figures"] += 1


@contextlib.contextmanager
def changed(folder):
    """contextlib.chdir of Python 3.11."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def unlike(one, other):
    """Whether two pictures differ by more than fonts and versions of matplotlib explain: in size, frames, or many pixels of a small copy."""
    import numpy
    from PIL import Image

    with Image.open(one) as a, Image.open(other) as b:
        frames = getattr(a, "n_frames", 1)
        if frames != getattr(b, "n_frames", 1) or max(abs(p - q) for p, q in zip(a.size, b.size)) > 20:
            return True
        for frame in {0, frames // 2, frames - 1}:
            small = []
            for picture in (a, b):
                picture.seek(frame)
                small.append(numpy.asarray(picture.convert("RGB").resize((80, 60), Image.Resampling.BOX), dtype=float))
            if (abs(small[0] - small[1]).max(axis=2) > 48).mean() > 0.02:
                return True
    return False


def pages():
    listed = re.findall(r"\]\((manual/[^)#]+\.md)\)", (DOCS / "SUMMARY.md").read_text())
    lying = {f"manual/{p.name}" for p in (DOCS / "manual").glob("*.md")}
    if lying != set(listed):
        raise Fault(f"docs/SUMMARY.md and docs/manual differ: {sorted(lying ^ set(listed))}")
    return [DOCS / page for page in listed]


def main(arguments):
    work = Path(arguments[0]).resolve()
    wanted = [a.removesuffix(".md") for a in arguments[1:] if not a.startswith("--")]
    folder = work / "run"
    if "--keep" not in arguments:
        shutil.rmtree(folder, ignore_errors=True)
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("MPLBACKEND", "Agg")
    sys.path.insert(0, str(folder))
    faults = []
    for path in pages():
        if wanted and path.stem not in wanted:
            continue
        page, begin = Page(path, folder, "--update" in arguments), time.time()
        before = sum(resource.getrusage(who).ru_utime for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        try:
            page.run()
        except Fault as fault:
            faults.append(str(fault))
        cpu = sum(resource.getrusage(who).ru_utime for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) - before
        counts = ", ".join(f"{n} {what}" for what, n in page.counts.items() if n)
        print(f"{path.stem:18} {time.time() - begin:5.1f} s, {cpu:5.1f} of CPU: {counts}", flush=True)
    for fault in faults:
        print(f"\n{fault}", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Fault as fault:
        sys.exit(str(fault))
