"""The hypotheses that `ekf` runs side by side: how noisy path and rate are, and whether gravity turns the target."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.ekf.filter import ProcessNoise
from baryscope.estimator.ekf.motion import gravity_gradient_axis, white_noise
from baryscope.estimator.tracks import FloatArray
from baryscope.models.orbit import Orbit

PENALTY = 3.0  # of log-likelihood, that a process noise or a torque has to bring to be preferred to none
ORDERS = (1, 2, 3)  # of the derivative of the path that noise drives, where nothing is known of it
# m by which noise carries the path off within the span of the time
UNKNOWN_PATH = (1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3)
LONG_PATH = (1.0, 3e1, 1e3)  # over all frames
KNOWN_PATH = (1e-1, 1e1)
# share of itself by which noise changes the rate while the target turns by a radian
FIRST_TURN = (0.01, 0.03, 0.1, 0.3, 1.0)
USUAL_TURN = 0.1  # where the path has noise, too
LEAST_PATH, LEAST_TURN = 1e-2, 1e-4  # where there was none before
NEXT_TURN = (0.0, 1e-4, 1e-3, 1e-2)


@dataclass(frozen=True)
class Member:
    """A hypothesis.

    order of the path's derivative that noise drives; path: m by which it carries the centre of mass off within the span
    of the time; turn: by how much of itself noise changes the rate while the target turns by a radian;
    gravity_gradient: whether the gravity gradient turns it.
    """

    order: int
    path: float
    turn: float
    gravity_gradient: bool = False

    @property
    def penalty(self) -> float:
        """What its freedoms cost of the log-likelihood."""
        return PENALTY * ((self.path > 0) + (self.turn > 0) + self.gravity_gradient)


def first_members(degree: int | None) -> list[Member]:
    """The bank of the first pass, with noise enough for a poor first inertia.

    degree: of the path's derivative that is constant or noisy, None where that is open.
    """
    if degree is None:
        return [Member(order, path, USUAL_TURN) for order in ORDERS for path in UNKNOWN_PATH]
    steady, noisy = [(0.0, turn) for turn in FIRST_TURN], [(path, USUAL_TURN) for path in KNOWN_PATH]
    return [Member(degree, path, turn) for path, turn in steady + noisy]


def next_members(best: Member, gravity_gradients: Sequence[bool], orders: Sequence[int]) -> list[Member]:
    """The bank around the best member of the pass before: other noise of the path, of the rate, or another torque."""
    paths = (0.0, best.path / 3, best.path * 3) if best.path else (0.0, 1e-2)
    members = [
        best,
        *(replace(best, path=path) for path in paths),
        *(replace(best, turn=turn) for turn in (*NEXT_TURN, best.turn / 3)),
        *(replace(best, order=order, path=path) for order in orders for path in (best.path / 3, best.path)),
        *(
            replace(best, turn=turn, gravity_gradient=gravity_gradient)
            for gravity_gradient in gravity_gradients
            for turn in (0.0, best.turn)
        ),
    ]
    return [member for member in dict.fromkeys(members) if member.gravity_gradient in gravity_gradients]


def middle_members(best: Member, orders: Sequence[int]) -> list[Member]:
    """The first bank over all frames: the best of the first ones, and paths that these do not call for.

    Over a short time no noise may do, or a path of few derivatives and much noise, which predicts nothing over a gap.
    """
    others = [replace(best, order=order, path=path) for order in orders[1:] for path in LONG_PATH]
    return list(dict.fromkeys([best, *(others or [replace(best, path=best.path or LONG_PATH[0])])]))


def last_members(best: Member, gravity_gradients: Sequence[bool]) -> list[Member]:
    """The bank over all frames: what these tell from the best member of the first ones, by its small effect."""
    paths = [best.path / 3, best.path * 3] if best.path else [LEAST_PATH]
    members = [
        best,
        *(replace(best, gravity_gradient=gravity_gradient) for gravity_gradient in gravity_gradients),
        *(replace(best, path=path) for path in paths),
        *(replace(best, turn=turn) for turn in ([best.turn / 3, 0.0] if best.turn else [LEAST_TURN])),
    ]
    return [member for member in dict.fromkeys(members) if member.gravity_gradient in gravity_gradients]


def bank_noise(
    members: Sequence[Member], size: int, time: FloatArray, pace: float, orbit: Orbit | None
) -> ProcessNoise:
    """The process noise of the bank, for paths of `size` derivatives and a target that turns at `pace`, rad/s."""
    orders = sorted({member.order for member in members})
    gravity_gradient = (
        np.zeros((len(time) - 1, 3)) if orbit is None else gravity_gradient_axis(orbit, (time[1:] + time[:-1]) / 2)
    )
    return ProcessNoise(
        np.stack([white_noise(order, size, time) for order in orders]),
        np.array([orders.index(member.order) for member in members]),
        np.array([member.path**2 for member in members]),
        np.array([member.turn**2 * pace**3 for member in members]),
        np.stack([member.gravity_gradient * gravity_gradient for member in members]),
    )
