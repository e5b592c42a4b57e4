"""OpenCV, of the extra `images`: imported where images are read, not before."""

from importlib.util import find_spec
from typing import Any

from baryscope.models.errors import InputError


def opencv() -> Any:
    """The module cv2.

    Raises:
        InputError: it is not installed.
    """
    if find_spec("cv2") is None:
        raise InputError("images need OpenCV, expected it installed: pip install 'baryscope[images]'")
    import cv2

    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what cannot be read is told by whoever reads
    return cv2
