"""Studies with simulated tracks: functions that return data and print nothing, for the command line and notebooks.

Here: flights, closed loops, comparisons, tables of bounds. In `baryscope.study.campaign`: scenarios drawn many times.
"""

from baryscope.study.bound_files import write_bounds
from baryscope.study.bounds import BoundTable, Grid, bound_table
from baryscope.study.comparison import Comparison, Outcome, compare
from baryscope.study.comparison_files import write_comparison
from baryscope.study.comparison_report import report_of_comparison
from baryscope.study.flight import Flight, build_unit, fly, write_flight
from baryscope.study.loop import Loop, fly_loop
from baryscope.study.loop_files import loop_figure, write_loop
from baryscope.study.loop_report import report_of_loop
from baryscope.study.pictures import comparison_figure, outcome_figure
from baryscope.table import Table

__all__ = [
    "BoundTable",
    "Comparison",
    "Flight",
    "Grid",
    "Loop",
    "Outcome",
    "Table",
    "bound_table",
    "build_unit",
    "compare",
    "comparison_figure",
    "fly",
    "fly_loop",
    "loop_figure",
    "outcome_figure",
    "report_of_comparison",
    "report_of_loop",
    "write_bounds",
    "write_comparison",
    "write_flight",
    "write_loop",
]
