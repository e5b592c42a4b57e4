"""What `baryscope fly` warns of: a system that is flown as it is, but not as its user will have meant it."""

import warnings
from collections.abc import Mapping

import numpy as np

from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.fmu.system import Master
from baryscope.fmu.system.master import Unit

STACK = 4  # from here to the caller of `fly_loop`
PUSH = "chaser.acceleration"


def warn_before(master: Master, units: Mapping[str, Unit]) -> None:
    """Of steps that are too long for the controller to be stable, and of thrust that nobody tells the estimator.

    Args:
        master: of the system.
        units: by their roles: target, rig, estimator and controller.
    """
    _warn_of_long_steps(units["controller"], master.step_size)
    _warn_of_untold_thrust(master, units)


def _warn_of_long_steps(controller: Unit, step: float) -> None:
    """The velocity of a chaser whose command is a step late follows z² − z + r h: from r h = 1 on it swings.

    r is the rate at which ApproachController corrects the velocity; other controllers do not tell theirs.
    """
    rate = sum(float(controller.vector(name).sum()) for name in ("control.rate", "guidance.rate"))
    if rate * step >= 1.0:
        warnings.warn(
            f"steps of {step:g} s: expected less than {1.0 / rate:.3g} s, one over control.rate and guidance.rate; "
            "commands come a step late, so that the chaser swings about its goal",
            stacklevel=STACK,
        )


def _warn_of_untold_thrust(master: Master, units: Mapping[str, Unit]) -> None:
    """An estimator that is not told of thrust takes it for the target's path, and says that it tracks."""
    target, estimator = units["target"], units["estimator"]
    lacking = [
        one for one in target.scalars(PUSH) if master.source_of(target, one) and not master.source_of(estimator, one)
    ]
    if lacking:
        start, output = master.source_of(target, lacking[0]) or ("", "")
        warnings.warn(
            f"{estimator.name}.{lacking[0]} is not connected, expected {start}.{output} or what commands the chaser: "
            "thrust of which the estimator is not told makes its estimates and claims wrong",
            stacklevel=STACK,
        )


def warn_of_blind_camera(units: Mapping[str, Unit]) -> None:
    """Of a camera in whose images no feature is, wherever it faces, once the controller has pointed it."""
    attitude = units["controller"].vector("camera.attitude")
    if not np.linalg.norm(attitude) > 0:
        return
    rig, target = units["rig"], units["target"]
    R = matrix_from_quaternion(attitude[None])[0]
    points = target.vector("features").reshape(-1, 3) @ R - rig.vector("camera.leverArm")
    focal, baseline = (float(rig.vector(f"camera.{name}")[0]) for name in ("focalLength", "baseline"))
    ahead = points[points[:, 2] > 0]
    pixels = focal * ahead[:, :2] / ahead[:, 2:] + rig.vector("camera.principalPoint")
    right = pixels - np.outer(focal * baseline / ahead[:, 2], [1.0, 0.0])
    size = rig.vector("camera.resolution")
    inside = (size == 0) | ((pixels >= 0) & (pixels <= size) & (right >= 0) & (right <= size))
    if inside.all(axis=1).any():
        return
    centre = target.vector("target.position")
    angle = np.rad2deg(np.arccos(np.clip(R[:, 2] @ centre / np.linalg.norm(centre), -1.0, 1.0)))
    place = "chaser.position0"
    told = units["controller"].vector(place)
    expected = (
        f"; it looks as from {place} of {units['controller'].name}, {told.tolist()} m, but the chaser starts at "
        f"{target.vector(place).tolist()} m"
        if told.size and not np.array_equal(told, target.vector(place))
        else ""
    )
    warnings.warn(
        f"at the start no feature can be in view: the camera looks {angle:.0f}° past the target{expected}",
        stacklevel=STACK - 1,
    )
