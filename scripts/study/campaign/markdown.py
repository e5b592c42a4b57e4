"""A campaign as Markdown."""

from pathlib import Path

from baryscope.models.files import replacing
from baryscope.models.words import counted
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.statistics import Remark
from baryscope.study.campaign.summary import CampaignSummary

MOST_REMARKS = 60  # draws to list
LEGEND = (
    "RMSE is that of the path over all frames of the draws that gave a result, predicted RMSE the same as the",
    "covariances of the methods predict it. CRB is the Cramér–Rao bound on path RMSE of all draws without outliers,",
    "\"CRB, inliers\" that of the observations that outliers leave. RMSE/CRB is by the bound of those draws that gave",
    "a result, ± its standard error; target is what it should be at most.",
    "NEES is the mean of eᵀ P⁻¹ e of the position at the first, the middle and the last frame, and of the centre of",
    "mass in body axes (those that the features of the longest cluster hold).",
    "failed: how many draws gave no result, + how many were announced as not to be trusted.",
    "time is the median, with one thread.",
)  # fmt: skip


def write_summary(summary: CampaignSummary, path: Path) -> None:
    """Write what was run, a table for each scenario, and the draws to look at.

    Raises:
        InputError: the file cannot be written.
    """
    plan = summary.plan
    left = plan.total - summary.count
    missing = f" {left} of {counted(plan.total, 'run')} still missing." if left else ""
    lines = [
        "# Campaign",
        "",
        f"Made by baryscope {plan.version} (program {plan.program}):",
        "",
        f"    {plan.command}",
        "",
        f"{counted(plan.draws, 'draw')} of each scenario, each with its own {varied_words(plan)}.{missing}",
        "",
    ]
    for entry in plan.entries:
        table = summary.table(entry).markdown() if summary.draws(entry) else "No runs yet."
        lines += [f"## {entry.name}", "", f"{entry.description} (hash {entry.digest})".strip(), "", table, ""]
    lines += [
        *LEGEND,
        summary.about_nees(),
        "",
        *_remark_lines(summary.remarks, summary.remark_count),
    ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def varied_words(plan: Plan) -> str:
    """What each draw has of its own, in words: "attitude (uniform over all rotations), sensor.noise and noise"."""
    known = {"attitude": "attitude (uniform over all rotations)", "anomaly": "place on the orbit"}
    words = [known[item] for item in plan.vary if item in known]
    words += [
        f"{one.field} ({one.low:g} to {one.high:g}{', even in its logarithm' if one.log else ''})"
        for one in plan.ranges
    ]
    return f"{', '.join(words)} and noise" if words else "noise"


def _remark_lines(found: list[Remark], count: int) -> list[str]:
    if not found:
        return ["No single draw failed, was announced or is off by more than chance allows."]
    shown = found[:MOST_REMARKS]
    more = [f"- and {count - len(shown)} more"] if count > len(shown) else []
    return [
        "## Draws to look at",
        "",
        *(f"- {one.scenario} {one.case}, {one.method}: {one.text}" for one in shown),
        *more,
    ]
