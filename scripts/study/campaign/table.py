"""The runs of a campaign as one table: a row for each run and method, columns of numbers.

It takes some 150 bytes a row, whatever the lines hold besides, and is written as runs.parquet.
"""

from pathlib import Path

import polars as pl

from baryscope.models.files import AnyPath, Whole, write_together
from baryscope.study.campaign.folder import read_plan
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.reading import NUMBERS, blocks_of, schema_of, varied_fields

NEES = ("nees_start", "nees_middle", "nees_end")


def read_runs(folder: AnyPath, plan: Plan | None = None) -> pl.DataFrame:
    """The runs that have ended, a row for each run and method, by scenario (as in the plan), draw and method.

    Columns: scenario, case (the draw), method; rmse, max_error, predicted_rmse, body_error (m); nees_start,
    nees_middle, nees_end and body_nees; trustworthy, rejected_share, failure; time (s), and flight_time, that of
    flight and bound (s); bound and bound_inliers, the Cramér–Rao bound on the path's RMSE without outliers and with
    them (m), bound_failure; warnings; and what varies, by its field.
    Null where a method does not say. `pandas.DataFrame(read_runs(folder).to_dict())` is the same for pandas.

    Args:
        folder: of a campaign, also while it runs.
        plan: that of the folder.

    Raises:
        InputError: the folder holds no campaign, or a line that is no run of it.
    """
    plan = read_plan(folder) if plan is None else plan
    parts = [_long(block.frame, plan) for block in blocks_of(folder, plan)]
    table = pl.concat(parts) if parts else _long(pl.DataFrame(schema=schema_of(plan)), plan)
    return table.sort("scenario", "case", "method")


def _long(frame: pl.DataFrame, plan: Plan) -> pl.DataFrame:
    """A row for each run and method out of a row for each run."""
    scenarios = pl.Enum([entry.name for entry in plan.entries])
    bound, varied, wall = pl.col("bound").struct, pl.col("varied").struct, pl.col("wall").struct
    return pl.concat(
        [
            frame.select(
                pl.col("scenario").cast(scenarios),
                pl.col("case").cast(pl.Int32),
                pl.lit(label, pl.Enum(plan.methods)).alias("method"),
                *(outcome.struct.field(name) for name in NUMBERS),
                *(
                    outcome.struct.field("nees").list.get(k, null_on_oob=True).alias(name)
                    for k, name in enumerate(NEES)
                ),
                outcome.struct.field("trustworthy"),
                outcome.struct.field("failure"),
                wall.field(label).alias("time"),
                (wall.field("flight") + wall.field("bound")).cast(pl.Float32).alias("flight_time"),
                bound.field("path_rmse_clean").alias("bound"),
                bound.field("path_rmse").alias("bound_inliers"),
                bound.field("failure").alias("bound_failure"),
                pl.col("warnings"),
                *(varied.field(name) for name in varied_fields(plan)),
            )
            for label, outcome in ((label, pl.col("methods").struct.field(label)) for label in plan.methods)
        ]
    )


def write_runs(table: pl.DataFrame, path: Path) -> None:
    """Write the table as Parquet, names as plain text.

    Raises:
        InputError, DiskError: the file cannot be written.
    """
    plain = table.with_columns(pl.col("scenario", "method").cast(pl.String))
    write_together({path: Whole(plain.write_parquet)})
