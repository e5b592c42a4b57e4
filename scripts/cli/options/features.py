"""Options of the command line that name features of the tracks."""

import csv

from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.words import counted


def named_features(data: FeatureTracks, text: str, option: str, least: int, what: str = "feature") -> FeatureTracks:
    """The tracks of the features that an option names, a,b,c, in that order; a label with a comma in quotes, "a,b",c.

    least: how many it has to name; what: what a feature is called there.

    Raises:
        InputError: there is no such feature, one is named twice, or they are fewer.
    """
    (fields,) = csv.reader([text], skipinitialspace=True)
    names = [name.strip() for name in fields if name.strip()]
    for name in names:
        if name not in data.labels:
            raise InputError(f"{option}: found {name!r}, expected some of {', '.join(map(_as_typed, data.labels))}")
        if names.count(name) > 1:
            raise InputError(f"{option}: found {name!r} twice, expected each {what} once")
    if len(names) < least:
        raise InputError(f"{option}: found {counted(len(names), what)}, expected at least {least}")
    return data.of_features(names)


def _as_typed(label: str) -> str:
    """A label as the option takes it."""
    if "," not in label:
        return label
    doubled = label.replace('"', '""')
    return f'"{doubled}"'
