"""Finds the centre of mass of a tumbling object from feature tracks, and ships the simulation it is tested against.

The repository's folders models/, fmu/, estimator/, scripts/ and scripts/study/ are its subpackages.
"""

from importlib.metadata import version

__all__ = ["__version__"]

__version__ = version("baryscope")
