"""Tables in CSV files, read by columns with a fast or a strict reader, and the rows of feature tracks as arrays.

`table` reads a table of any form; `tracks` has the form of feature tracks. Errors name file, line and column.
Uses geometry and limits.
"""

from baryscope.estimator.tables.form import Columns, Form
from baryscope.estimator.tables.strict import read_strict
from baryscope.estimator.tables.table import Table, read_table
from baryscope.estimator.tables.tracks import (
    COLUMNS,
    COVARIANCE_COLUMNS,
    FORM,
    arrays_of,
    refuse_covariances,
)

__all__ = [
    "COLUMNS",
    "COVARIANCE_COLUMNS",
    "FORM",
    "Columns",
    "Form",
    "Table",
    "arrays_of",
    "read_strict",
    "read_table",
    "refuse_covariances",
]
