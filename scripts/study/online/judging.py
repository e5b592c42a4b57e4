"""One flight of the online estimator as a line of numbers: errors, claims and causal bounds at some rotations."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from baryscope.estimator import PathOptions
from baryscope.estimator.methods import estimate
from baryscope.estimator.online import OnlineState, OnlineStatus
from baryscope.models.errors import ComputationError, InputError
from baryscope.study.online.flights import Flight, flight
from baryscope.study.population.consistency import WRONG, nees
from baryscope.study.population.judging import measured
from baryscope.study.population.running import Line

MARKS = (0.25, 0.5, 1.0, 2.0, 4.0)  # rotations; the last frame is one more
END = "end"


def judged(suite: str, seed: int, draw: int, beside: Sequence[str] = ()) -> Line:
    """The line of a draw: of each mark that it reaches, and of the whole run.

    At a mark: status, error, claimed deviation and bounds in m, NEES; beside: the errors in m of these methods from all
    frames up to it, None where one refuses. first: rotations at which it first tracks; wrong:
    the share of the frames that track whose NEES is one of a thousand; stray: tracks at the end, and is so wrong there.
    """
    made = flight(suite, seed, draw)
    line: Line = {"suite": suite, "seed": seed, "draw": draw}
    with measured(line):
        states = list(made.states())
    tracking = np.array([state.status is OnlineStatus.TRACKING for state in states])
    every = np.array([nees(s.position - p, s.covariance[:3, :3]) for s, p in zip(states, made.path, strict=True)])
    first = np.nonzero(tracking)[0]
    reached = {str(mark): int(np.argmax(made.rotations >= mark)) for mark in MARKS if made.rotations[-1] >= mark}
    return line | {
        "frames": len(states),
        "first": float(made.rotations[first[0]]) if len(first) else None,
        "wrong": float(np.mean(every[tracking] > WRONG)) if len(first) else 0.0,
        "stray": bool(tracking[-1] and every[-1] > WRONG),
        "density": states[-1].density,
        "marks": {name: _at(made, states[k], k, beside) for name, k in {**reached, END: len(states) - 1}.items()},
    }


def _at(made: Flight, state: OnlineState, k: int, beside: Sequence[str]) -> Line:
    error, covariance = state.position - made.path[k], state.covariance[:3, :3]
    return {
        "status": str(state.status),
        "error": float(np.linalg.norm(error)),
        "claimed": float(np.sqrt(max(np.trace(covariance), 0.0))),
        "nees": nees(error, covariance),
        "bounds": {"free": made.causal_bound(k, False), "tumble": made.causal_bound(k, True)},
        "beside": {method: _error_of(made, k, method) for method in beside},
    }


def _error_of(made: Flight, k: int, method: str) -> float | None:
    """The error in m at frame k of a method that is told the orbit and logged thrust; None if it refuses.

    It has the frames up to that.
    """
    tracks, end = made.tracks, k + 1
    covariance = None if tracks.covariance is None else tracks.covariance[:end]
    so_far = replace(tracks, time=tracks.time[:end], position=tracks.position[:end], covariance=covariance)
    try:
        found = estimate(so_far, method=method, orbit=made.orbit, options=PathOptions(acceleration=made.thrust))
    except (InputError, ComputationError):
        return None
    return float(np.linalg.norm(found.position[-1] - made.path[k]))
