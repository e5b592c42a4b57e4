"""A campaign as Markdown."""

from pathlib import Path

from baryscope.models.files import replacing
from baryscope.models.words import counted
from baryscope.study.campaign.statistics import Remark
from baryscope.study.campaign.summary import CampaignSummary

MOST_REMARKS = 60  # draws to list
LEGEND = (
    "RMSE is that of the path over all frames and draws, predicted RMSE the same as the covariances of the methods",
    "predict it. CRB is the Cramér–Rao bound on path RMSE of the same draws without outliers, \"CRB, inliers\" that of",
    "the observations that outliers leave. RMSE/CRB has ± as its standard error; target is what it should be at most.",
    "NEES is the mean of eᵀ P⁻¹ e of the position at the first, the middle and the last frame, and of the centre of",
    "mass in body axes (those that the features of the longest cluster hold).",
)  # fmt: skip


def write_summary(summary: CampaignSummary, path: Path) -> None:
    """Write what was run, a table for each scenario, and the draws to look at.

    Raises:
        InputError: the file cannot be written.
    """
    plan = summary.plan
    left = plan.total - len(summary.runs)
    missing = f" {left} of {counted(plan.total, 'run')} still missing." if left else ""
    varied = {
        ("attitude", "anomaly"): "attitude (uniform over all rotations), place on the orbit and noise",
        ("attitude",): "attitude (uniform over all rotations) and noise",
        ("anomaly",): "place on the orbit and noise",
    }.get(plan.vary, "noise")
    lines = [
        "# Campaign",
        "",
        f"Made by baryscope {plan.version} (program {plan.program}):",
        "",
        f"    {plan.command}",
        "",
        f"{counted(plan.draws, 'draw')} of each scenario, each with its own {varied}.{missing}",
        "",
    ]
    for entry in plan.entries:
        table = summary.table(entry).markdown() if summary.draws(entry) else "No runs yet."
        lines += [f"## {entry.name}", "", f"{entry.description} (hash {entry.digest})".strip(), "", table, ""]
    lines += [
        *LEGEND,
        summary.about_nees(),
        "failed: how many draws gave no result, + how many were announced as not to be trusted.",
        "time is the median, with one thread.",
        "",
        *_remark_lines(summary.remarks),
    ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _remark_lines(found: list[Remark]) -> list[str]:
    if not found:
        return ["No single draw failed, was announced or is off by more than chance allows."]
    more = [f"- and {len(found) - MOST_REMARKS} more"] if len(found) > MOST_REMARKS else []
    return [
        "## Draws to look at",
        "",
        *(f"- {one.scenario} {one.case}, {one.method}: {one.text}" for one in found[:MOST_REMARKS]),
        *more,
    ]
