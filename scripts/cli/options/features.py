"""Options of the command line that name features of the tracks."""

from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.words import counted


def named_features(data: FeatureTracks, text: str, option: str, least: int, what: str = "feature") -> FeatureTracks:
    """The tracks of the features that an option names, a,b,c, in that order.

    least: how many it has to name; what: what a feature is called there.

    Raises:
        InputError: there is no such feature, one is named twice, or they are fewer.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in data.labels:
            raise InputError(f"{option}: found {name!r}, expected some of {', '.join(data.labels)}")
        if names.count(name) > 1:
            raise InputError(f"{option}: found {name!r} twice, expected each {what} once")
    if len(names) < least:
        raise InputError(f"{option}: found {counted(len(names), what)}, expected at least {least}")
    return data.of_features(names)
