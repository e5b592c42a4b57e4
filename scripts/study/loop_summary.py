"""What came of a flown loop, in numbers."""

from typing import Any

import numpy as np

from baryscope import __version__
from baryscope.models.approach.reckoning import RECKONING, RETREAT
from baryscope.models.sensor.navigation import STATUSES
from baryscope.study.loop import Loop

WRONG = 16.266  # the 99.9 % quantile of χ² of 3 degrees of freedom
# What the fields of a summary are, in words; with the unit for readers, and by what to multiply the value in SI units.
QUANTITIES: dict[str, tuple[str, str, float]] = {
    "version": ("baryscope", "", 1),
    "duration": ("flown for", "s", 1),
    "step": ("communication step", "s", 1),
    "samples": ("samples of the rig", "", 1),
    "tracking_since": ("target tracked since", "s", 1),
    "tumble_known_since": ("tumble known since", "s", 1),
    "synchronised_since": ("goal turns with the target since", "s", 1),
    "tracking_share": ("target tracked in the second half", "%", 100),
    "untracked": ("not tracked after it first was, in all", "s", 1),
    "untracked_since": ("not tracked at last, since", "s", 1),
    "reckoned": ("controller by dead reckoning, in all", "s", 1),
    "retreated": ("controller in retreat, in all", "s", 1),
    "retreating_since": ("in retreat at last, since", "s", 1),
    "position_rmse": ("RMSE of the centre of mass, second half", "mm", 1e3),
    "claimed_rmse": ("the same by its covariance", "mm", 1e3),
    "mean_nees": ("NEES, mean of the second half (3 expected)", "", 1),
    "largest_nees": ("NEES, at most while tracking", "", 1),
    "wrong_share": ("claims too small (NEES that true ones exceed once in 1000), of all tracking", "%", 100),
    "last_claim": ("deviation of the centre of mass by its covariance, at last", "m", 1),
    "last_range": ("chaser from the centre of mass, at last", "m", 1),
    "largest_miss": ("chaser from its goal, at most in the last tenth", "m", 1),
    "last_miss": ("chaser from its goal, at last", "m", 1),
    "nearest": ("chaser nearest to the centre of mass", "m", 1),
    "nearest_feature": ("chaser nearest to a feature", "m", 1),
    "inside": ("chaser in the features' convex hull, in all", "s", 1),
    "inside_since": ("chaser in the features' convex hull, first", "s", 1),
    "velocity_change": ("velocity change by the commands", "m/s", 1),
    "status": ("estimator at last", "", 1),
}


def summary_of(loop: Loop) -> dict[str, Any]:
    """What came of a flight, in SI units, by the names of QUANTITIES; None where there is no value.

    The second half of the flight counts for errors and the mean NEES, which is of 3 degrees of freedom, all of it for
    the largest one, and for wrong_share, in which part of the time of tracking it was beyond WRONG; the last tenth for
    the largest miss. untracked is for how long the estimator, once it had tracked the target, did not, untracked_since
    from when on at last; reckoned and retreated for how long the controller was in these modes, retreating_since from
    when on at last, None of one without modes. nearest is to the centre of mass, nearest_feature to any feature; inside
    for how long the chaser was in the features' convex hull.
    """
    half = slice(len(loop.time) // 2, None)
    known = loop.tracking[half]
    step = float(loop.time[0])
    before, nees = np.flatnonzero(loop.tracking), loop.nees[loop.tracking]
    moded, retreats = bool(np.isfinite(loop.mode).any()), loop.mode == RETREAT
    on_course = np.flatnonzero(~retreats)

    def first(flags: Any) -> float | None:
        return float(loop.time[np.argmax(flags)]) if flags.any() else None

    def rms(values: Any) -> float | None:
        return float(np.sqrt(np.mean(values[half][known] ** 2))) if known.any() else None

    return {
        "version": __version__,
        "duration": float(loop.time[-1]),
        "step": step,
        "samples": len(loop.tracks.time),
        "tracking_since": first(loop.tracking),
        "tumble_known_since": first(loop.tumble),
        "synchronised_since": first(loop.synchronised),
        "tracking_share": float(known.mean()),
        "untracked": float((~loop.tracking[before[0] :]).sum() * step) if before.size else None,
        "untracked_since": float(loop.time[before[-1] + 1]) if before.size and not loop.tracking[-1] else None,
        "reckoned": float((loop.mode == RECKONING).sum() * step) if moded else None,
        "retreated": float(retreats.sum() * step) if moded else None,
        "retreating_since": float(loop.time[on_course[-1] + 1]) if retreats[-1] else None,
        "position_rmse": rms(loop.error),
        "claimed_rmse": rms(loop.deviation),
        "mean_nees": float(loop.nees[half][known].mean()) if known.any() else None,
        "largest_nees": float(nees.max()) if nees.size else None,
        "wrong_share": float((nees > WRONG).mean()) if nees.size else None,
        "last_claim": float(loop.deviation[-1]) if loop.status[-1] else None,
        "last_range": float(np.linalg.norm(loop.chaser[-1])),
        "largest_miss": float(loop.miss[-max(1, len(loop.time) // 10) :].max()),
        "last_miss": float(loop.miss[-1]),
        "nearest": float(np.linalg.norm(loop.chaser, axis=1).min()),
        "nearest_feature": float(loop.clearance.min()),
        "inside": float(loop.inside.sum() * step),
        "inside_since": first(loop.inside),
        "velocity_change": float(np.linalg.norm(loop.command, axis=1).sum() * step),
        "status": STATUSES[loop.status[-1]],
    }
