"""Which methods a study runs: labels, each a method with its options."""

from collections.abc import Sequence

from baryscope.estimator.methods import METHODS
from baryscope.estimator.options import ScrewOptions
from baryscope.models.errors import InputError

LVLH = "-lvlh"  # ends the label of a screw method that registers in LVLH axes


def labels_of(methods: Sequence[str]) -> tuple[str, ...]:
    """What to run, by label: a method's name, with LVLH at its end if in LVLH axes; screw-gpa runs in both.

    Raises:
        InputError: there is no such method, or none.
    """
    names = [name.strip() for name in methods if name.strip()]
    unknown = [name for name in names if name not in METHODS]
    if unknown or not names:
        found = repr(unknown[0]) if unknown else "none"
        raise InputError(f"methods: found {found}, expected some of {', '.join(METHODS)}")
    return tuple(
        label for name in dict.fromkeys(names) for label in ((name, name + LVLH) if name == "screw-gpa" else (name,))
    )


def options_of(label: str) -> tuple[str, ScrewOptions | None]:
    """The method of a label, and its options where they are not the usual ones."""
    if label.endswith(LVLH):
        return label.removesuffix(LVLH), ScrewOptions(axes="lvlh")
    return label, None


def axes_of(label: str) -> str | None:
    """The axes in which a screw method registers the tracks: inertial or lvlh; None for the other methods."""
    method, options = options_of(label)
    if METHODS[method].options is not ScrewOptions:
        return None
    return "inertial" if options is None else options.axes


COLOURS = {label: number for number, label in enumerate(labels_of(tuple(METHODS)))}
"""For each label its place in the palette of pictures and reports, the same in all of them."""
