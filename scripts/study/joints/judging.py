"""One recording's joint by a method as a line of numbers, and lines as a table."""

from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from baryscope.estimator import FeatureTracks
from baryscope.estimator.joint import Method, joint
from baryscope.models.errors import ComputationError, InputError
from baryscope.study.joints.recordings import recorded
from baryscope.study.population.running import Line
from baryscope.table import Table

FloatArray = NDArray[np.float64]

LABELS = ("a", "b", "c", "d")
FAR = 1e-3  # of true answers have a NEES beyond the limit of "far off"
SHARES = (0.5, 0.9, 0.95, 0.99)  # of true answers, in the regions of which is told how many hold the centre


def judged(motion: str, noise: str, seed: int, draw: int, method: Method) -> Line:
    """The line of a draw.

    The truth is the centre, and the axis, in the child as its markers were on average: skin that stays to one side for
    the whole recording is part of where the markers are.
    """
    made = recorded(motion, noise, 100_000 * seed + draw)
    parent, child = (FeatureTracks(made.time, markers, LABELS) for markers in (made.parent, made.child))
    line: Line = {"motion": motion, "noise": noise, "seed": seed, "draw": draw, "method": method}
    begin = perf_counter()
    try:
        found = joint(parent, child, method=method)
    except (ComputationError, InputError) as refused:
        return line | {"failure": str(refused), "wall": perf_counter() - begin}
    line["wall"] = perf_counter() - begin
    body = found.pair.child
    used = np.isin(made.time, found.time)
    back = np.swapaxes(body.rotation, 1, 2)
    error = found.in_child - np.einsum("kij,kj->ki", back, made.joint[used] - body.place).mean(axis=0)
    claimed = found.covariance[3:, 3:]
    line |= {
        "hinge": found.hinge,
        "error": float(np.linalg.norm(error)),
        "claimed": float(np.sqrt(np.trace(claimed))),
        "nees": float(error @ np.linalg.solve(claimed, error)),
    }
    if found.hinge_axis is not None and motion == "hinge":
        axis = np.einsum("kij,kj->ki", back, made.axis[used]).mean(axis=0)
        line |= _of_axis(found.hinge_axis.in_child, found.hinge_axis.covariance_in_child, axis)
    return line


def _of_axis(found: FloatArray, covariance: FloatArray, truth: FloatArray) -> Line:
    """The normalised square of an axis's error across it, of two degrees of freedom, and the angle, rad."""
    values, across = np.linalg.eigh(covariance)
    error = across[:, 1:].T @ (truth * np.sign(truth @ found))
    return {"axis_error": float(np.linalg.norm(error)), "axis_nees": float(np.sum(error**2 / values[1:]))}


def table(lines: Sequence[Line]) -> Table:
    """A row for each motion, noise and method."""
    headings = "motion, noise, method, draws, median error mm, median claim mm, NEES, 95 % band, median NEES, far off"
    more = "hinges, axis ° rms, its NEES, time s"
    rows = tuple(_row(names, group) for names, group in _groups(lines).items())
    return Table(tuple(f"{headings}, {more}".split(", ")), rows, left=3)


def regions(lines: Sequence[Line]) -> Table:
    """How often the ellipsoid that should hold the centre with a probability does, by motion, noise and method.

    The mean of NEES follows the few answers that are farthest off; these shares tell of the others.
    """
    rows = []
    for names, group in _groups(lines).items():
        nees = np.array([line["nees"] for line in group if "nees" in line])
        held = [np.mean(nees < chdtri(3, 1 - share)) for share in SHARES] if len(nees) else []
        rows.append((*names, str(len(nees)), *([f"{100 * share:.1f} %" for share in held] or ["-"] * len(SHARES))))
    headings = [f"in {100 * share:g} %" for share in SHARES]
    return Table(("motion", "noise", "method", "draws", *headings), tuple(rows), left=3)


def _groups(lines: Sequence[Line]) -> dict[tuple[str, str, str], list[Line]]:
    groups: dict[tuple[str, str, str], list[Line]] = {}
    for line in lines:
        groups.setdefault((line["motion"], line["noise"], line["method"]), []).append(line)
    return groups


def _row(names: tuple[str, str, str], group: list[Line]) -> tuple[str, ...]:
    answers = [line for line in group if "nees" in line]
    if not answers:
        return (*names, "0", *["-"] * 10)
    nees = np.array([line["nees"] for line in answers])
    low, high = chdtri(3 * len(answers), [0.975, 0.025]) / len(answers)
    axes = [line for line in answers if "axis_nees" in line]
    turned = np.rad2deg(np.sqrt(np.mean([line["axis_error"] ** 2 for line in axes]))) if axes else None
    return (
        *names,
        str(len(answers)),
        f"{1e3 * np.median([line['error'] for line in answers]):.2f}",
        f"{1e3 * np.median([line['claimed'] for line in answers]):.2f}",
        f"{nees.mean():.2f}",
        f"{low:.2f}–{high:.2f}",
        f"{np.median(nees):.2f}",
        f"{100 * np.mean(nees > chdtri(3, FAR)):.1f} %",
        str(sum(line["hinge"] for line in answers)),
        "-" if turned is None else f"{turned:.2f}",
        "-" if not axes else f"{np.mean([line['axis_nees'] for line in axes]):.2f}",
        f"{np.median([line['wall'] for line in group]):.2f}",
    )
