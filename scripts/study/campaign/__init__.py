"""Campaigns: scenarios drawn many times, and how near each method comes to the Cramér–Rao bound.

`plan_of` says what to run, `campaign` carries out what is missing in a folder, here or on a dask cluster, `merge` puts
shards together, `report` reads what has ended, `read_runs` gives it as a table. `draws` and `flown` have those draws
that a report shows.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from baryscope.study.campaign.case import Case, drawn, run_one
from baryscope.study.campaign.engines import connected, usable_cores
from baryscope.study.campaign.folder import begin, read_plan
from baryscope.study.campaign.plan import Plan, plan_of
from baryscope.study.campaign.runner import campaign, campaign_paths, mended, report
from baryscope.study.campaign.shards import Shard, merge, shard_of
from baryscope.study.campaign.vary import VARIED

if TYPE_CHECKING:
    from baryscope.study.campaign.flown import with_draws
    from baryscope.study.campaign.html_report import report_of_campaign
    from baryscope.study.campaign.summary import CampaignSummary
    from baryscope.study.campaign.table import read_runs
else:
    # These need polars, which is slow to load, and workers do without: they make runs, and read none.
    LATE = {
        "report_of_campaign": "html_report",
        "with_draws": "flown",
        "CampaignSummary": "summary",
        "read_runs": "table",
    }

    def __getattr__(name):
        if name not in LATE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"{__name__}.{LATE[name]}"), name)


__all__ = [
    "VARIED",
    "CampaignSummary",
    "Case",
    "Plan",
    "Shard",
    "begin",
    "campaign",
    "campaign_paths",
    "connected",
    "drawn",
    "mended",
    "merge",
    "plan_of",
    "read_plan",
    "read_runs",
    "report",
    "report_of_campaign",
    "run_one",
    "shard_of",
    "usable_cores",
    "with_draws",
]
