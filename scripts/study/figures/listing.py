"""The list of the figures."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from baryscope.study.figures import the_axes, the_path, what_is_seen
from baryscope.study.figures.run import PaperRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class PaperFigure:
    """One figure of the paper.

    Attributes:
        number: in the paper.
        name: of its file, without the number.
        title: what it shows.
        draw: the picture.
        sentence: what ours shows where the paper shows another, with the numbers of the run.
    """

    number: int
    name: str
    title: str
    draw: "Callable[[PaperRun], Figure]"
    sentence: Callable[[PaperRun], str]

    @property
    def file(self) -> str:
        """The name of its picture."""
        return f"figure-{self.number}-{self.name}.png"


FIGURES = (
    PaperFigure(2, "visibility", "Which features are followed, and when", what_is_seen.bars, what_is_seen.of_bars),
    PaperFigure(3, "trajectory", "The relative trajectory", what_is_seen.trajectory, what_is_seen.of_trajectory),
    PaperFigure(
        4,
        "pseudo-intersection",
        "Two successive axes, and the shortest segment between them",
        the_axes.crossing,
        the_axes.of_crossing,
    ),
    PaperFigure(
        5, "velocity", "Error against the velocity normal to the axis", the_axes.against_velocity, the_axes.of_velocity
    ),
    PaperFigure(
        6, "procrustes", "What Procrustes analysis does to a noisy cluster", what_is_seen.rigid, what_is_seen.of_rigid
    ),
    PaperFigure(7, "axes", "The axes before and after the low-pass", the_axes.filtered, the_axes.of_filtered),
    PaperFigure(8, "fit", "The polynomial through the pseudo-intersections", the_path.fit, the_path.of_fit),
    PaperFigure(9, "error", "The error of the centre of mass", the_path.error, the_path.of_error),
)
