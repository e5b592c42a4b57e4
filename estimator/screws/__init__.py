"""The published method and its baselines: screw axes, their pseudo-intersections, low-pass and polynomial.

`pipeline` is common to all of them, and `stages` are what it runs; `raw`, `gpa` and `least_squares` compute the screws.
Uses geometry, registration, tracks and result.
"""

from baryscope.estimator.screws.gpa import screws as gpa_screws
from baryscope.estimator.screws.least_squares import screws as least_squares_screws
from baryscope.estimator.screws.motion import Pairs
from baryscope.estimator.screws.pipeline import estimate_by_screws
from baryscope.estimator.screws.raw import screws as raw_screws
from baryscope.estimator.screws.screws import Screws
from baryscope.estimator.screws.stages import ScrewFunction, Stages, run_stages

__all__ = [
    "Pairs",
    "ScrewFunction",
    "Screws",
    "Stages",
    "estimate_by_screws",
    "gpa_screws",
    "least_squares_screws",
    "raw_screws",
    "run_stages",
]
