#!/usr/bin/env python3
"""processes.py PROGRAM [CELLS] [STEPS]: what a block of points takes on one program and on 1, 2 and 4 processes under mpirun.
processes.py --coupled PROGRAM [CELLS] [STEPS]: the same of a block twice as long with elements at both ends, in motion and at rest.
processes.py --speed PROGRAM [CELLS] [STEPS] [ROUNDS] [COUNTS...]: how fast its steps are on 1 process, on COUNTS (2) processes, and on these with a block as many times as long.

The block has CELLS (48) points along each edge, three spacings in a horizon, bond-based and LPS. For each run: the peak memory of each process, the same less that of a block with the
same points and one spacing in a horizon, which is what bonds take, and the user and system seconds of each process. Times are those of a machine on which nothing else runs, or none.
PROGRAM is built with the feature petsc; every process has one thread.

A table of speed is that of STEPS (100) steps, ROUNDS (3) times in turn, of a block of CELLS (56, which has 2e7 bonds) points along each edge: the run with so many steps less that
with two, over the steps between, the least of all rounds. So set-up, files and the energies of the last row are left out. Seconds are those of the clock in steps, as the first process
tells, and of the processor (user and system, waiting included) of the process that takes most. "Speed" is the bonds that pass in a second over those of one process: at most the number
of processes. "apart" are as many programs at once, each with a block of its own, which have nothing to do with each other: what cores, caches and memory of the machine allow. Ghosts
and bytes of a step are the most that a process has, counted in the run; it fails where `bondline check --processes` predicts others.
"""

import itertools
import json
import math
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

SCENE = """
kinematics = "solid"
coupling = "{coupling}"

[mesh.box]
min = [0, 0, 0]
max = [{long}, {n}, {n}]
x = {{ cells = {long} }}
y = {{ cells = {n} }}
z = {{ cells = {n} }}

[materials.block.{law}]
youngs-modulus = 1
density = 1
{more}

[peridynamics]
horizon = {spacings}
points.lattice = {{ spacing = 1, origin = [0.5, 0.5, 0.5] }}

{zone}
{motion}

[output]
name = "block"
vtu = false
"""


MOTION = """
[solve.explicit]
duration = {duration}
outputs = 1
history-interval = {duration}

[initial.hump.displacement]
x = "0.01 * exp(-((x - 8) / 4)^2)"
"""

REST = """
[conditions.left.displacement]
on = "left"
x = 0
y = 0
z = 0

[conditions.right.traction]
on = "right"
x = 1e-3

[solver]
method = "krylov"
unproven = "warn"
"""


def measured(command):
    """Runs a command, and writes down its peak memory and seconds: a process of the job."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    rank = os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK", "0"))
    # in files: mpirun mixes the lines of its processes
    told = pathlib.Path(os.environ["BONDLINE_MEASURED"])
    told.with_suffix(f".{rank}").write_text(json.dumps([used.ru_maxrss / 1024, used.ru_utime, used.ru_stime]))
    if done.returncode:
        print(done.stderr, file=sys.stderr)
    if done.stdout:
        # the summary of the first process
        told.write_text(done.stdout)
    return done.returncode


THREADS = {"RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}


def run(program, scene, folder, count):
    """Peak memory [MiB], user and system seconds of each process, of one program if count is none; and the summary."""
    command = [sys.executable, __file__, "--measured", program, "run", scene, "--json", "--output", folder]
    if count:
        command = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(count)] + command
    told = pathlib.Path(folder + ".json")
    subprocess.run(command, env={**os.environ, **THREADS, "BONDLINE_MEASURED": str(told)}, stdout=subprocess.DEVNULL, check=True)
    each = [json.loads(told.with_suffix(f".{rank}").read_text()) for rank in range(count or 1)]
    return each, json.loads(told.read_text())


LAWS = (("bond-based", "critical-stretch = 0.5"), ("lps", "poisson-ratio = 0.3\ncritical-stretch = 0.5"))


def text_of(law, more, n, steps, spacings=3, times=1, coupling="nonlocal"):
    """The scene; the step is about half a spacing over the speed of waves, which is one. It is at rest without steps, and coupled has four layers of elements at either end."""
    long = n * times
    motion = MOTION.format(duration=0.5 * steps) if steps else REST
    zone = "" if coupling == "nonlocal" else f"[zones.nonlocal]\nbox = {{ min = [4, 0, 0], max = [{long - 4}, {n}, {n}] }}"
    return SCENE.format(n=n, long=long, law=law, more=more, spacings=spacings, coupling=coupling, zone=zone, motion=motion)


def memory(program, n=48, steps=4):
    print("| law | processes | peak memory [MiB] | of bonds [MiB] | user + system [s] |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        scene = os.path.join(folder, "block.toml")
        for law, more in LAWS:
            for count in (None, 1, 2, 4):
                runs = []
                for spacings in (1.5, 3):
                    pathlib.Path(scene).write_text(text_of(law, more, n, steps, spacings))
                    runs.append(run(program, scene, os.path.join(folder, "out"), count)[0])
                few, many = runs
                words = [" ".join(f"{a[0]:.0f}" for a in many), " ".join(f"{a[0] - b[0]:.0f}" for a, b in zip(many, few))]
                words.append(" ".join(f"{user:.1f}+{system:.1f}" for _, user, system in many))
                print(f"| {law} | {count or 'one program'} | {' | '.join(words)} |", flush=True)


def coupled(program, n=24, steps=4):
    print("| block | law | processes | peak memory [MiB] | predicted [MiB] | bonds held [%] | user + system [s] |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        scene = os.path.join(folder, "block.toml")
        for (law, more), coupling, moves in itertools.product(LAWS, ("nonlocal", "splice", "truncated"), (steps, 0)):
            # bonds that break have no place at rest
            pathlib.Path(scene).write_text(text_of(law, more if moves else more.replace("critical-stretch = 0.5", ""), n, moves, 3, 2, coupling))
            for count in (None, 1, 2, 4):
                each, summary = run(program, scene, os.path.join(folder, "out"), count)
                shares = json.loads(checked(program, scene, count or 1))["processes"] if count else []
                words = [" ".join(f"{a[0]:.0f}" for a in each), " ".join(f"{share['memory_bytes'] / 2**20:.0f}" for share in shares)]
                words.append(" ".join(f"{100 * share['bonds'] / summary['sizes']['bonds']:.0f}" for share in shares))
                words.append(" ".join(f"{user:.1f}+{system:.1f}" for _, user, system in each))
                print(f"| {coupling}, {'in motion' if moves else 'at rest'} | {law} | {count or 'one program'} | {' | '.join(words)} |", flush=True)


def of_steps(runs):
    """Seconds of a step by the clock, and by the processor of the process that takes most, from two runs of few and of many steps."""
    (few, first), (many, last) = runs
    steps = [summary["motion"]["steps"] for summary in (first, last)]
    clock = [sum(stage["seconds"] for stage in summary["timings"] if stage["name"] == "steps") for summary in (first, last)]
    between = steps[1] - steps[0]
    used = max(b[1] + b[2] - a[1] - a[2] for a, b in zip(few, many))
    return (clock[1] - clock[0]) / between, used / between


def apart(program, scene, folder, count):
    """As many programs at once: the slowest of them."""
    with ThreadPoolExecutor(count) as pool:
        runs = list(pool.map(lambda k: run(program, scene, f"{folder}{k}", None), range(count)))
    return max(runs, key=lambda one: sum(stage["seconds"] for stage in one[1]["timings"] if stage["name"] == "steps"))


def checked(program, scene, count):
    """What a check tells of so many processes."""
    command = [program, "check", scene, "--json", "--processes", str(count)]
    return subprocess.run(command, env={**os.environ, **THREADS}, stdout=subprocess.PIPE, text=True, check=True).stdout


def predicted(program, scene, count):
    """Sites, ghosts and bytes of a step of each process, as a check tells."""
    shares = json.loads(checked(program, scene, count))["processes"]
    return [(share["sites"], share["ghosts"], share["received_bytes"]) for share in shares]


def speed(program, n=56, steps=100, rounds=3, *counts):
    counts = counts or (2,)
    cases = [(1, 1, run)] + [(count, *how) for count in counts for how in ((1, run), (count, run), (1, apart))]
    print("| law | points along the edges | bonds | processes | clock [ms/step] | processor [ms/step] | speed | ghosts | received [kB/step] |\n|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        scene = os.path.join(folder, "block.toml")
        for law, more in LAWS:
            least, told = {}, {}
            for _ in range(rounds):
                for case in cases:
                    count, times, how = case
                    runs = []
                    for length in (2, steps):
                        pathlib.Path(scene).write_text(text_of(law, more, n, length, times=times))
                        runs.append(how(program, scene, os.path.join(folder, "out"), count))
                    least[case] = [min(pair) for pair in zip(least.get(case, (math.inf,) * 2), of_steps(runs))]
                    told[case] = runs[1][1]
            for case in cases:
                count, times, how = case
                pathlib.Path(scene).write_text(text_of(law, more, n, steps, times=times))
                motion, bonds = told[case]["motion"], told[case]["sizes"]["bonds"]
                exchanged = ("", "") if how is apart else exchanges(program, scene, count, motion)
                bodies = count if how is apart else 1
                clock, used = least[case]
                rate = (bodies * bonds / clock) / (told[cases[0]]["sizes"]["bonds"] / least[cases[0]][0])
                words = [law, f"{n * times} × {n} × {n}", f"{bonds:.3g}", f"{count} apart" if how is apart else str(count), f"{1e3 * clock:.1f}", f"{1e3 * used:.1f}", f"{rate:.2f}"]
                print("| " + " | ".join([*words, *exchanged]) + " |", flush=True)


def exchanges(program, scene, count, motion):
    """The most ghosts of a process and kB that it receives in a step, which are those predicted."""
    of_step = [(p["sites"], p["ghosts"], p["received_bytes"] // motion["steps"]) for p in motion["processes"]]
    if of_step != predicted(program, scene, count) or any(p["exchanges"] != motion["steps"] for p in motion["processes"]):
        sys.exit(f"{scene}, {count} processes: {motion['processes']} is not what was predicted: {predicted(program, scene, count)}")
    return [str(max(ghosts for _, ghosts, _ in of_step)), f"{1e-3 * max(received for _, _, received in of_step):.0f}"]


if __name__ == "__main__":
    if sys.argv[1] == "--measured":
        sys.exit(measured(sys.argv[2:]))
    tables = {"--speed": speed, "--coupled": coupled}
    what, rest = (tables[sys.argv[1]], sys.argv[2:]) if sys.argv[1] in tables else (memory, sys.argv[1:])
    what(os.path.abspath(rest[0]), *map(int, rest[1:]))
