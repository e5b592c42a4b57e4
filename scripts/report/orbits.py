"""The orbit that tracks tell where none was given, for the axes of a scene."""

from baryscope.estimator.ekf.prediction import PredictedTumble
from baryscope.estimator.ml.two_models import PredictedMixture
from baryscope.estimator.orbits.estimated import estimated_orbit_in
from baryscope.estimator.prediction import PredictedBody, PredictedPath, Predictor
from baryscope.estimator.result import Estimate
from baryscope.models.orbit import Orbit

UP_TO_A_TURN = (
    "LVLH axes are those of the orbit that the tracks tell, or half a turn about the third from those: "
    "the gradient of gravity is the same."
)


def found_orbit(result: Estimate) -> Orbit | None:
    """The orbit that was found with the path; None if there is none among its unknowns."""
    return _orbit_in(result.predictor)


def _orbit_in(predictor: Predictor | None) -> Orbit | None:
    match predictor:
        case PredictedPath():
            path, x = predictor.path, predictor.x
        case PredictedBody():
            return _orbit_in(predictor.path)
        case PredictedMixture():
            return _orbit_in(predictor.likelier)
        case PredictedTumble():
            path, x = predictor.found.problem.path, predictor.found.shift + predictor.found.reference.x
        case _:
            return None
    part = estimated_orbit_in(path)
    return None if part is None else part.found(x)
