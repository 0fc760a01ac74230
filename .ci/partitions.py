#!/usr/bin/env python3
"""partitions.py: ghosts and balance of weighted coordinate bisection beside those of a graph partitioner (METIS, by pymetis), for points of some bodies in 2, 4 and 16 parts.

Needs numpy, scipy and pymetis. Bisection is that of `Partition::by_bisection`; the graph has a vertex for each point, weighted by its bonds, and an edge for each pair within a horizon.
"Ghosts" are the points of others in the families of a part: the most of any part, and the sum; "balance" is the bonds of the largest part over the mean.
"""

import sys

import numpy
import pymetis
import scipy.spatial

AS_LONG = 0.9


def bisected(points, work, count):
    """The part of each point: the longest side of a box is cut where the work on both sides is in the proportion of their parts, of sides of one length the last."""
    owner = numpy.zeros(len(points), int)

    def cut(some, first, count):
        if count == 1 or not len(some):
            owner[some] = first
            return
        x = points[some]
        sides = x.max(0) - x.min(0)
        axis = numpy.flatnonzero(sides >= AS_LONG * sides.max())[-1]
        some = some[numpy.lexsort((some, x[:, axis]))]
        below = count // 2
        done = numpy.cumsum(work[some]) - 0.5 * work[some]
        split = numpy.searchsorted(done, work[some].sum() * below / count)
        cut(some[:split], first, below)
        cut(some[split:], first + below, count - below)

    cut(numpy.arange(len(points)), 0, count)
    return owner


def grid(*counts):
    return numpy.stack(numpy.meshgrid(*map(numpy.arange, counts), indexing="ij"), -1).reshape(-1, len(counts)) + 0.5


def crosses(a, b, x, top):
    """Whether a bond crosses a slit up from the bottom at `x`."""
    left, right = a[:, 0], b[:, 0]
    with numpy.errstate(divide="ignore", invalid="ignore"):
        height = a[:, 1] + (b[:, 1] - a[:, 1]) * (x - left) / (right - left)
    return ((left < x) != (right < x)) & (height < top)


def bodies():
    """Points, their horizon (one for all, or of each), and whether a bond is cut."""
    whole = lambda a, b: numpy.zeros(len(a), bool)
    yield "cube", grid(32, 32, 32), 3, whole
    yield "bar, 8 × 1 × 1", grid(96, 12, 12), 3, whole
    yield "plate with a slit", grid(240, 160), 4, lambda a, b: crosses(a, b, 120, 80)
    p = grid(240, 240)
    yield "L-shaped plate", p[(p < 120).any(1)], 4, whole
    centres = numpy.array([[x, y] for x in (40, 120, 200) for y in (40, 120, 200)])
    far = numpy.linalg.norm(p[:, None] - centres, axis=2).min(1) > 25
    yield "plate with nine holes", p[far], 4, whole
    p = grid(200, 200) / 200
    # spacings from 0.2 to 1.8, and horizons that follow them
    graded = 200 * (0.2 * p + 0.8 * p**2)
    yield "graded plate, equal horizon", graded, 4, whole
    yield "graded plate, horizon by spacing", graded, 3 * (0.2 + 1.6 * p).max(1), whole
    x = numpy.random.default_rng(1).random((20000, 3)) * 27
    yield "scattered points in a ball", x[numpy.linalg.norm(x - 13.5, axis=1) < 13.5], 3, whole


def bonds_of(points, horizon, is_cut):
    tree = scipy.spatial.cKDTree(points)
    if numpy.ndim(horizon) == 0:
        pairs = tree.query_pairs(horizon * (1 + 1e-9), output_type="ndarray")
    else:
        found = tree.query_ball_point(points, horizon)
        pairs = numpy.array(sorted({(min(i, j), max(i, j)) for i, near in enumerate(found) for j in near if i != j}))
    return pairs[~is_cut(points[pairs[:, 0]], points[pairs[:, 1]])]


def ghosts(ends, owner, count):
    """Points of others in the families of each part."""
    a, b = ends[:, 0], ends[:, 1]
    far = owner[a] != owner[b]
    seen = numpy.unique(owner[a[far]] * len(owner) + b[far])
    return numpy.bincount(seen // len(owner), minlength=count)


def main():
    print("| body | points | parts | ghosts, most | of the graph | ghosts, sum | of the graph | balance | of the graph |\n|---|---|---|---|---|---|---|---|---|")
    for name, points, horizon, is_cut in bodies():
        pairs = bonds_of(points, horizon, is_cut)
        ends = numpy.concatenate([pairs, pairs[:, ::-1]])
        ends = ends[numpy.argsort(ends[:, 0], kind="stable")]
        work = numpy.bincount(ends[:, 0], minlength=len(points))
        starts = numpy.concatenate([[0], numpy.cumsum(work)])
        for count in (2, 4, 16):
            _, graph = pymetis.part_graph(count, pymetis.CSRAdjacency(starts, ends[:, 1]), vweights=work, recursive=False)
            found = []
            for owner in (bisected(points, work, count), numpy.array(graph)):
                each = ghosts(ends, owner, count)
                parts = numpy.bincount(owner, work, count)
                found.append((each.max(), each.sum(), parts.max() / parts.mean()))
            (most, total, balance), other = found
            words = [name, len(points), count, most, f"{other[0]} ({other[0] / most:.2f})", total, f"{other[1]} ({other[1] / total:.2f})", f"{balance:.3f}", f"{other[2]:.3f}"]
            print("| " + " | ".join(map(str, words)) + " |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
