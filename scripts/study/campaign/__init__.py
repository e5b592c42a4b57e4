"""Campaigns: scenarios drawn many times, and how near each method comes to the Cramér–Rao bound.

`plan_of` says what to run, `campaign` carries out what is missing in a folder, here or on a dask cluster, `merge` puts
shards together, `report` reads what has ended, `read_runs` gives it as a table.
"""

from baryscope.study.campaign.case import Case, drawn, run_one
from baryscope.study.campaign.engines import connected, usable_cores
from baryscope.study.campaign.folder import begin, read_plan
from baryscope.study.campaign.html_report import report_of_campaign
from baryscope.study.campaign.plan import Plan, plan_of
from baryscope.study.campaign.runner import campaign, campaign_paths, mended, report
from baryscope.study.campaign.shards import Shard, merge, shard_of
from baryscope.study.campaign.summary import CampaignSummary
from baryscope.study.campaign.table import read_runs
from baryscope.study.campaign.vary import VARIED

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
]
