"""Campaigns: scenarios drawn many times, and how near each method comes to the Cramér–Rao bound.

`plan_of` says what to run, `run` carries out what is missing in a folder, `report` reads what has ended.
"""

from baryscope.study.campaign.case import Case, drawn, run_one
from baryscope.study.campaign.folder import begin, read_plan, read_runs
from baryscope.study.campaign.html_report import report_of_campaign
from baryscope.study.campaign.plan import VARIED, Plan, plan_of
from baryscope.study.campaign.pool import usable_cores
from baryscope.study.campaign.runner import campaign_paths, report, run
from baryscope.study.campaign.summary import CampaignSummary

__all__ = [
    "VARIED",
    "CampaignSummary",
    "Case",
    "Plan",
    "begin",
    "campaign_paths",
    "drawn",
    "plan_of",
    "read_plan",
    "read_runs",
    "report",
    "report_of_campaign",
    "run",
    "run_one",
    "usable_cores",
]
