#!/usr/bin/env python3
"""processes.py PROGRAM [CELLS] [STEPS]: what a block of points takes on one program and on 1, 2 and 4 processes under mpirun.

The block has CELLS (48) points along each edge, three spacings in a horizon, bond-based and LPS. For each run: the peak memory of each process, the same less that of a block with the
same points and one spacing in a horizon, which is what bonds take, and the user and system seconds of each process. Times are those of a machine on which nothing else runs, or none.
PROGRAM is built with the feature petsc; every process has one thread.
"""

import os
import pathlib
import resource
import subprocess
import sys
import tempfile

SCENE = """
kinematics = "solid"
coupling = "nonlocal"

[mesh.box]
min = [0, 0, 0]
max = [{n}, {n}, {n}]
x = {{ cells = {n} }}
y = {{ cells = {n} }}
z = {{ cells = {n} }}

[materials.block.{law}]
youngs-modulus = 1
density = 1
{more}

[peridynamics]
horizon = {spacings}
points.lattice = {{ spacing = 1, origin = [0.5, 0.5, 0.5] }}

[solve.explicit]
duration = {duration}
outputs = 1
history-interval = {duration}

[initial.hump.displacement]
x = "0.01 * exp(-((x - 8) / 4)^2)"

[output]
name = "block"
vtu = false
"""


def measured(command):
    """Runs a command, and prints its peak memory and seconds: a process of the job."""
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    rank = os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK", "0"))
    print("process", rank, used.ru_maxrss, used.ru_utime, used.ru_stime, flush=True)
    if done.returncode:
        print(done.stderr, file=sys.stderr)
    return done.returncode


def run(program, scene, folder, count):
    """Peak memory [MiB], user and system seconds of each process; of one program, if count is none."""
    command = [sys.executable, __file__, "--measured", program, "run", scene, "--output", folder]
    if count:
        command = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(count)] + command
    threads = {"RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}
    done = subprocess.run(command, env={**os.environ, **threads}, stdout=subprocess.PIPE, text=True, check=True)
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith("process ")]
    return [(int(peak) / 1024, float(user), float(system)) for _, _, peak, user, system in sorted(lines)]


def main(program, n=48, steps=4):
    print("| law | processes | peak memory [MiB] | of bonds [MiB] | user + system [s] |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        scene = os.path.join(folder, "block.toml")
        for law, more in (("bond-based", "critical-stretch = 0.5"), ("lps", "poisson-ratio = 0.3\ncritical-stretch = 0.5")):
            for count in (None, 1, 2, 4):
                runs = []
                for spacings in (1.5, 3):
                    # the step is about half a spacing over the speed of waves, which is one
                    text = SCENE.format(n=n, law=law, more=more, spacings=spacings, duration=0.5 * steps)
                    pathlib.Path(scene).write_text(text)
                    runs.append(run(program, scene, os.path.join(folder, "out"), count))
                few, many = runs
                words = [" ".join(f"{a[0]:.0f}" for a in many), " ".join(f"{a[0] - b[0]:.0f}" for a, b in zip(many, few))]
                words.append(" ".join(f"{user:.1f}+{system:.1f}" for _, user, system in many))
                print(f"| {law} | {count or 'one program'} | {' | '.join(words)} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "--measured":
        sys.exit(measured(sys.argv[2:]))
    main(os.path.abspath(sys.argv[1]), *map(int, sys.argv[2:]))
