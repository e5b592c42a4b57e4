"""What the passes of `ekf` tell of the densities of the process noise."""

import numpy as np

from baryscope.estimator.ekf.bank import Bounds, Member
from baryscope.estimator.ekf.passes import Passes
from baryscope.estimator.result import ProcessNoise


def process_noise_of(found: Passes, density: float, bounds: Bounds) -> ProcessNoise:
    """The process noise of the path, of the likeliest density and its bounds if it is estimated."""
    on_position, options = found.problem.slips, found.problem.options
    if options.process_noise == "none":
        return ProcessNoise("none", 0.0, of_position=on_position)
    if not isinstance(options.process_noise, str):
        return ProcessNoise("given", options.process_noise, of_position=on_position)
    return ProcessNoise("estimated", density, bounds, significance_of(found), of_position=on_position)


def significance_of(found: Passes) -> float | None:
    """2 ln of the likelihood of the path's density over that of none; None where it is not estimated."""
    last, estimated = found.last, isinstance(found.problem.options.process_noise, str)
    return last.bank.significance(last.member) if last.bank and estimated else None


def likeliest_of(found: Passes) -> Member:
    """The most probable densities of path and rotation."""
    return _of_own_variance(found, found.members[int(np.argmax(found.probability))])


def bounds_of(found: Passes) -> tuple[Bounds, Bounds]:
    """The bounds that hold 90 % of the densities of path and rotation."""
    last = found.last
    if last.bank is None:
        return (last.member.path, last.member.path), (last.member.turn, last.member.turn)
    both = zip(*last.bank.bounds(last.member), strict=True)
    low, high = (_of_own_variance(found, Member(*densities)) for densities in both)
    return (low.path, high.path), (low.turn, high.turn)


def _of_own_variance(found: Passes, member: Member) -> Member:
    """Densities, which the passes take relative to their variance of an observation, for the likeliest member's."""
    axes, last = found.problem.axes(1.0), found.last
    ratio = float(found.variance[np.argmax(found.probability)] / (last.lasting * last.noise_variance))
    path, turn = (ratio if axis.free else 1.0 for axis in axes)
    return Member(path * member.path, turn * member.turn)
