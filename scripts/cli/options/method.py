"""Options of the command line for the method and its model of path, noise and torque, or for its screws."""

from dataclasses import asdict, dataclass, fields
from typing import Any

from cyclopts import Parameter

from baryscope.estimator.methods import METHODS, PREDICTING, TURNING
from baryscope.estimator.options import Axes, Burns, Density, Noise, Options, Reference, Torque
from baryscope.models.errors import InputError
from baryscope.scripts.cli.options.whole import Whole

# Options that bear on some of the methods only that have them; and choices that need an orbit.
BEARING = {
    "sigma": PREDICTING,
    "noise": PREDICTING,
    "process_noise": PREDICTING,
    "unknown_burns": PREDICTING,
    "torque": TURNING,
    "torque_noise": TURNING,
}
ON_ORBIT = {"axes": "lvlh", "trajectory": "relative-orbit", "torque": "gravity-gradient"}


@Parameter(name="*")
@dataclass(frozen=True)
class PathChoices:
    """What is known of path, noise and torque.

    Parameters
    ----------
    trajectory
        Model of the path (pivot, ml, ekf): fixed, polynomial (of a degree that the data choose), polynomial:N, or
        relative-orbit, which needs --orbit. Default: relative-orbit with an orbit, or where the tracks tell one, else
        polynomial. For score: fixed, at rest in inertial axes even with an orbit.
    sigma
        Standard deviation of an observation's coordinate (pivot, ml, ekf), m. If the tracks have covariances, a factor
        on their standard deviations. One that the residuals exceed is named and not used. Default: estimated from the
        residuals.
    noise
        Covariances of the tracks (pivot, ml, ekf): stereo, evaluated again at the estimated point since they grow with
        range; fixed, used as they are; or auto, as they tell themselves. Default: auto.
    torque
        Torque on the target (ml, ekf): none or gravity-gradient, which needs --orbit. Default: the likelier one;
        with ml both are in the covariance where the tracks do not decide.
    process_noise
        What the model of the path leaves out (pivot, ml, ekf), as white acceleration: its density in m²/s³, or,
        of a fixed one, as white noise of the position: its variance in m²; auto, estimated from the tracks; or none,
        the model holds exactly. Default: auto.
    unknown_burns
        Burns of the chaser that no log tells of (pivot, ml, ekf; on a relative orbit, or a polynomial whose degree the
        data choose): auto, found in the tracks and listed, their cost being in the covariance; or none. Default: auto.
    torque_noise
        What the model of the tumble leaves out (ml, ekf), as white angular acceleration: its density in rad²/s³; auto,
        estimated from the tracks; or none. Default: auto.
    """

    trajectory: str | None = None
    sigma: float | None = None
    noise: Noise | None = None
    torque: Torque | None = None
    process_noise: Density | None = None
    unknown_burns: Burns | None = None
    torque_noise: Density | None = None


@Parameter(name="*")
@dataclass(frozen=True)
class ScrewChoices:
    """Settings of the screw methods.

    Parameters
    ----------
    axes
        Axes in which the tracks are registered (screw methods): inertial, as published, or lvlh, which needs --orbit.
        Default: inertial.
    lag
        Time between the two poses of a screw, s (screw methods). Default: chosen from the data.
    cutoff
        Cut-off of the zero-phase low-pass, Hz (screw methods). Default: chosen from the data.
    degree
        Degree of the polynomial path (screw methods). Default: chosen from the data.
    reference
        What Procrustes analysis maps the poses of an interval to (screw methods): mean, their mean shape, or first, the
        first pose, as published. Default: mean.
    """

    axes: Axes | None = None
    lag: float | None = None
    cutoff: float | None = None
    degree: Whole | None = None
    reference: Reference | None = None


def method_options(
    method: str | None, path: PathChoices, screws: ScrewChoices, forces: dict[str, Any], *, orbit: bool
) -> tuple[str, Options]:
    """The method, and its options from those that were given on the command line.

    Args:
        method: its name; None: the default, which depends on the options.
        path, screws: the options that were given.
        forces: those on forces, by name; None where not given. The acceleration is not among the options returned.
        orbit: whether there is one.

    Raises:
        InputError: there is no such method, or it has no such option, or has it without use or without its orbit.
    """
    for_path, for_screws = asdict(path) | forces, asdict(screws)
    if method is not None and method not in METHODS:
        raise InputError(f"--method: found {method!r}, expected one of {', '.join(METHODS)}")
    chosen = {name: value for name, value in (for_path | for_screws).items() if value is not None}
    first_for_screws = next((name for name in chosen if name in for_screws), None)
    default = "pivot" if first_for_screws is None else "screw-gpa"
    for name in chosen:
        having = BEARING.get(name) or _having(name)
        if (method or default) in having:
            continue
        name = name.replace("_", "-")
        if method is None and first_for_screws is None:
            raise InputError(f"--{name}: found with {default}, the default, expected --method {' or '.join(having)}")
        if method is None:
            raise InputError(
                f"--{name}: found beside --{first_for_screws}, expected one of the two: no method has both"
            )
        raise InputError(f"--{name}: found with --method {method}, expected one of {', '.join(having)}")
    for name, value in ON_ORBIT.items():
        if chosen.get(name) == value and not orbit:
            raise InputError(f"--{name} {value}: needs the target's orbit, expected --orbit ORBIT.toml")
    chosen.pop("acceleration", None)  # which is still a file
    return method or default, METHODS[method or default].options(**chosen)


def _having(option: str) -> list[str]:
    """The methods that have an option."""
    return [method.name for method in METHODS.values() if option in {field.name for field in fields(method.options)}]
