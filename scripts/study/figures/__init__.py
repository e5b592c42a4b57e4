"""The paper's figures 2 to 9, drawn from own runs, each with a sentence on what ours shows.

`run` has what they show, `what_is_seen`, `the_axes` and `the_path` draw it and say it, `listing` is the list of them,
and `folder` writes them.
"""

from baryscope.study.figures.folder import figure_paths, write_figures
from baryscope.study.figures.listing import FIGURES, PaperFigure
from baryscope.study.figures.run import PaperRun, run_paper

__all__ = ["FIGURES", "PaperFigure", "PaperRun", "figure_paths", "run_paper", "write_figures"]
