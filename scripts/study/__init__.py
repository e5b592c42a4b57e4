"""Studies with simulated tracks: functions that return data and print nothing, for the command line and notebooks.

Here: flights, comparisons and tables of bounds. In `baryscope.study.campaign`: scenarios drawn many times.
"""

from baryscope.study.bound_files import write_bounds
from baryscope.study.bounds import BoundTable, Grid, bound_table
from baryscope.study.comparison import Comparison, Outcome, compare
from baryscope.study.comparison_files import write_comparison
from baryscope.study.flight import Flight, build_unit, fly, write_flight
from baryscope.study.pictures import comparison_figure, outcome_figure
from baryscope.study.table import Table

__all__ = [
    "BoundTable",
    "Comparison",
    "Flight",
    "Grid",
    "Outcome",
    "Table",
    "bound_table",
    "build_unit",
    "compare",
    "comparison_figure",
    "fly",
    "outcome_figure",
    "write_bounds",
    "write_comparison",
    "write_flight",
]
