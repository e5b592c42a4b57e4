"""The bank of hypotheses of `ekf`: process noise of path and rate, and whether there is a gravity-gradient torque."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.ekf.filter import ProcessNoise
from baryscope.estimator.ekf.motion import gravity_gradient_axis, white_noise
from baryscope.estimator.tracks import FloatArray
from baryscope.models.orbit import Orbit

PENALTY = 3.0  # of the log-likelihood for a process noise or a torque, against none
ORDERS = (1, 2, 3)  # of the noisy derivative of the path, if the path model is not given
# Noise of the path: standard deviation of the position in m after the whole time span.
UNKNOWN_PATH = (1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3)  # path model not given
LONG_PATH = (1.0, 3e1, 1e3)  # over all frames
KNOWN_PATH = (1e-1, 1e1)  # path model given
# Noise of the rate: relative standard deviation after a rotation by a radian.
FIRST_TURN = (0.01, 0.03, 0.1, 0.3, 1.0)
TURN_WITH_PATH = 0.1  # if the path has noise, too
LEAST_PATH, LEAST_TURN = 1e-2, 1e-4  # first values to try after zero noise
NEXT_TURN = (0.0, 1e-4, 1e-3, 1e-2)


@dataclass(frozen=True)
class Member:
    """A hypothesis.

    order of the noisy derivative of the path; path: standard deviation of the position in m after the time span due to
    this noise; turn: relative standard deviation of the rate after a rotation by a radian; gravity_gradient: whether
    there is a gravity-gradient torque.
    """

    order: int
    path: float
    turn: float
    gravity_gradient: bool = False

    @property
    def penalty(self) -> float:
        """The penalty of the log-likelihood for the noises and the torque of this hypothesis."""
        return PENALTY * ((self.path > 0) + (self.turn > 0) + self.gravity_gradient)


def first_members(degree: int | None) -> list[Member]:
    """The bank of the first pass, with noise that covers the error of the initial inertia.

    degree: of the path's derivative that is constant or noisy, None if the path model is not given.
    """
    if degree is None:
        return [Member(order, path, TURN_WITH_PATH) for order in ORDERS for path in UNKNOWN_PATH]
    noiseless, noisy = [(0.0, turn) for turn in FIRST_TURN], [(path, TURN_WITH_PATH) for path in KNOWN_PATH]
    return [Member(degree, path, turn) for path, turn in noiseless + noisy]


def next_members(best: Member, gravity_gradients: Sequence[bool], orders: Sequence[int]) -> list[Member]:
    """The bank around the best member of the previous pass: other noise of path or rate, or another torque."""
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
    """The first bank over all frames: the best member for the first frames, and paths with more noise and derivatives.

    A short time may need no noise, or may choose few derivatives with much noise, which cannot predict over a gap.
    """
    others = [replace(best, order=order, path=path) for order in orders[1:] for path in LONG_PATH]
    return list(dict.fromkeys([best, *(others or [replace(best, path=best.path or LONG_PATH[0])])]))


def last_members(best: Member, gravity_gradients: Sequence[bool]) -> list[Member]:
    """The bank over all frames: the last best member, and variations whose effect shows only over a long time."""
    paths = [best.path / 3, best.path * 3] if best.path else [LEAST_PATH]
    members = [
        best,
        *(replace(best, gravity_gradient=gravity_gradient) for gravity_gradient in gravity_gradients),
        *(replace(best, path=path) for path in paths),
        *(replace(best, turn=turn) for turn in ([best.turn / 3, 0.0] if best.turn else [LEAST_TURN])),
    ]
    return [member for member in dict.fromkeys(members) if member.gravity_gradient in gravity_gradients]


def bank_noise(
    members: Sequence[Member], size: int, time: FloatArray, speed: float, orbit: Orbit | None
) -> ProcessNoise:
    """The process noise of the bank, for paths of `size` derivatives and a rotation at `speed`, rad/s."""
    orders = sorted({member.order for member in members})
    gravity_gradient = (
        np.zeros((len(time) - 1, 3)) if orbit is None else gravity_gradient_axis(orbit, (time[1:] + time[:-1]) / 2)
    )
    return ProcessNoise(
        np.stack([white_noise(order, size, time) for order in orders]),
        np.array([orders.index(member.order) for member in members]),
        np.array([member.path**2 for member in members]),
        np.array([member.turn**2 * speed**3 for member in members]),
        np.stack([member.gravity_gradient * gravity_gradient for member in members]),
    )
