"""The list of all methods, which the command line and the tests read, and the one way to call them."""

from dataclasses import dataclass

from baryscope.estimator import screw_gpa, screw_ls, screw_raw
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.result import Estimate
from baryscope.estimator.screw_pipeline import ScrewFunction, estimate_by_screws
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.scenario import Orbit


@dataclass(frozen=True)
class Method:
    """A method: its name on the command line, what it does in a line, and how it finds screws."""

    name: str
    summary: str
    screws: ScrewFunction

    def __call__(
        self, tracks: FeatureTracks, *, orbit: Orbit | None = None, options: ScrewOptions | None = None
    ) -> Estimate:
        """Estimate the path of the centre of mass; see `estimate`."""
        return estimate_by_screws(self.name, self.screws, tracks, orbit, options or ScrewOptions())


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method("screw-raw", "three-point Reuleaux on raw points", screw_raw.screws),
        Method("screw-ls", "least-squares screws of all features (CasADi)", screw_ls.screws),
        Method("screw-gpa", "screws of Procrustes-registered poses, as published", screw_gpa.screws),
    )
}


def estimate(
    tracks: FeatureTracks,
    *,
    method: str = "screw-gpa",
    orbit: Orbit | None = None,
    options: ScrewOptions | None = None,
) -> Estimate:
    """The path of the centre of mass in C at every time of the tracks, by the method of that name in METHODS.

    Raises:
        InputError: no such method, or options that do not go together.
        ComputationError: the tracks do not hold what it takes, in a sentence that says what is missing.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
    return METHODS[method](tracks, orbit=orbit, options=options)
