"""Zero-phase low-pass of screw axes, run by run between the gaps."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

FloatArray = NDArray[np.float64]

ORDER = 2  # run forward and backward, which doubles it
SHORTEST = 8  # samples in a run that is filtered at all
LOWEST = 1e-6  # cut-off over sampling rate: lower ones act alike, but their coefficients vanish beside 1


def low_pass(values: FloatArray, step: float, cutoff: float) -> FloatArray:
    """Butterworth low-pass without phase shift of values (n, k), sampled every `step` s; cutoff in Hz.

    A cut-off at or above the Nyquist frequency, and a run too short to be filtered, leave the values as they are.
    """
    if cutoff * step >= 0.5 or len(values) < SHORTEST:
        return values
    cutoff = max(cutoff, LOWEST / step)
    sections = butter(ORDER, cutoff, fs=1.0 / step, output="sos")
    # The padding is what the filter remembers, about a third of the cut-off's period, if the run has as much.
    padding = min(len(values) - 1, int(np.ceil(1.0 / (cutoff * step))))
    return np.asarray(sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=padding))


def low_pass_axes(axis: FloatArray, point: FloatArray, step: float, cutoff: float) -> tuple[FloatArray, FloatArray]:
    """Low-pass the lines of one gap-free run: axis (n, 3), unit, and point (n, 3) in m.

    What is filtered is axis a and moment (p − o) × a, o the run's mean point. Lines through one fixed point c have
    moments (c − o) × a, linear in a: whatever the filter does to a, they still pass through c. Filtering the
    points themselves would bend the lines away from it, most at the ends of a run.
    """
    origin = point.mean(axis=0)
    # The sense of rotation fixes the signs already; near 180° it may flip from one frame to the next.
    flips = np.einsum("ni,ni->n", axis[1:], axis[:-1]) < 0
    sign = np.concatenate([[1.0], np.where(flips, -1.0, 1.0)]).cumprod()[:, None]
    lines = np.concatenate([axis * sign, np.cross(point - origin, axis * sign)], axis=1)
    smooth = low_pass(lines, step, cutoff)
    length = np.linalg.norm(smooth[:, :3], axis=1, keepdims=True)
    smooth = smooth / np.where(length > 0, length, 1.0)
    new_axis, moment = smooth[:, :3], smooth[:, 3:]
    foot = np.cross(new_axis, moment) + origin
    # Keep each line's own place along the axis: the point nearest to where it was.
    along = np.einsum("ni,ni->n", point - foot, new_axis)
    return new_axis * sign, foot + along[:, None] * new_axis
