"""Zero-phase low-pass filter of screw axes, for each run without gaps."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

ORDER = 2  # applied forward and backward, which doubles it
MIN_SAMPLES = 8  # of a run that is filtered
MIN_CUTOFF = 1e-6  # over the sampling rate: lower ones have the same effect, but lose their coefficients to rounding


def low_pass(values: FloatArray, step: float, cutoff: float) -> FloatArray:
    """Butterworth low-pass without phase shift of values (n, k), sampled every `step` s; cutoff in Hz.

    The values are unchanged if the cut-off is not below the Nyquist frequency or there are fewer than MIN_SAMPLES.
    """
    if cutoff * step >= 0.5 or len(values) < MIN_SAMPLES:
        return values
    from scipy.signal import butter, sosfiltfilt  # slow to load, and other methods do without

    cutoff = max(cutoff, MIN_CUTOFF / step)
    sections = butter(ORDER, cutoff, fs=1.0 / step, output="sos")
    # The padding is one period of the cut-off, which covers the filter's memory, if the run is long enough.
    padding = min(len(values) - 1, int(np.ceil(1.0 / (cutoff * step))))
    return np.asarray(sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=padding))


def low_pass_axes(axis: FloatArray, point: FloatArray, step: float, cutoff: float) -> tuple[FloatArray, FloatArray]:
    """Low-pass the lines of one run without gaps: axis (n, 3), unit, and point (n, 3) in m.

    The filter acts on the axis a and the moment (p − o) × a, o the run's mean point. Lines through a fixed point c have
    moments (c − o) × a, linear in a, so the filtered lines still pass through c. Filtering the points instead would
    move the lines away from c, most at the ends of a run.
    """
    origin = point.mean(axis=0)
    # The sense of rotation determines the sign, which may flip from one frame to the next near 180°.
    flips = np.einsum("ni,ni->n", axis[1:], axis[:-1]) < 0
    sign = np.concatenate([[1.0], np.where(flips, -1.0, 1.0)]).cumprod()[:, None]
    lines = np.concatenate([axis * sign, np.cross(point - origin, axis * sign)], axis=1)
    smooth = low_pass(lines, step, cutoff)
    length = np.linalg.norm(smooth[:, :3], axis=1, keepdims=True)
    smooth = smooth / np.where(length > 0, length, 1.0)
    new_axis, moment = smooth[:, :3], smooth[:, 3:]
    foot = np.cross(new_axis, moment) + origin
    # The new point is the one nearest to the old point.
    along = np.einsum("ni,ni->n", point - foot, new_axis)
    return new_axis * sign, foot + along[:, None] * new_axis
