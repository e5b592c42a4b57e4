"""How many modes of a torque the tracks tell: those of low frequency, and those at which the body turns."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.dynamics.torque import Torque

FloatArray = NDArray[np.float64]

FEWEST_MODES, MANY_MODES, MOST_MODES = 6, 36, 100  # of each axis: always, to begin with, at all
RESOLVED = 3.0  # highest frequency of the modes over that at which the noise of the attitudes hides the torque's


def with_modes(rotation: Rotation, time: FloatArray) -> Rotation:
    """The rotation with the modes, over times (n,) in s, of a torque that changes slowly in axes of body or chaser.

    The latter are as many as half turns; of many, only those that are strong in the elements of the attitude.
    """
    span = float(time[-1] - time[0])
    if span <= 0:
        return rotation
    count = max(min(FEWEST_MODES + _half_turns(rotation, span), len(time) // 4), 1)
    orders = np.arange(count)
    if count > MANY_MODES:
        even = np.linspace(time[0], time[-1], 8 * count)
        power = (dct(rotation.at(even).attitude.reshape(-1, 9), axis=0, norm="ortho")[:count] ** 2).sum(axis=1)
        strong = np.argsort(power)[::-1][: MANY_MODES - FEWEST_MODES]
        orders = np.union1d(np.arange(FEWEST_MODES), strong)
    return replace(rotation, torque=Torque.none(float(time[0]), float(time[-1]), orders))


def with_needed_modes(
    rotation: Rotation, torque: Torque, time: FloatArray, density: float, information: float
) -> Rotation | None:
    """The rotation with more modes of its torque over times (n,) in s, if those there do not suffice; None if they do.

    density: of the white torque, rad²/s³; information: on the attitude in all frames, 1/rad² per axis.
    """
    span = float(time[-1] - time[0])
    # White noise of density q, twice integrated, has the spectrum q/f⁴; that of the attitudes' noise is 1/information.
    corner = (density * information / span) ** 0.25
    waves = int(np.ceil(RESOLVED * corner * span / np.pi))
    if waves <= FEWEST_MODES:
        return None
    highest = min(waves + _half_turns(rotation, span), MOST_MODES, len(time) // 4)
    orders = np.union1d(torque.orders, np.arange(highest))
    if len(orders) <= len(torque.orders):
        return None
    return replace(rotation, torque=torque.with_orders(orders))


def _half_turns(rotation: Rotation, span: float) -> int:
    """The number of half turns in a span in s, at the rate at the epoch."""
    return int(np.ceil(float(np.linalg.norm(rotation.rate)) * span / np.pi))
