"""The layout of our FMUs: platforms and their folders, value references, and the archive.

It holds what generate, runtime and check share; they import this room, and it imports none of them.
"""

from baryscope.fmu.layout.archive import MODEL_NAME, UnitFile, open_unit, unpack
from baryscope.fmu.layout.platforms import FmiVersion, Platform, host_platform
from baryscope.fmu.layout.references import Reference, reference_table

__all__ = [
    "MODEL_NAME",
    "FmiVersion",
    "Platform",
    "Reference",
    "UnitFile",
    "host_platform",
    "open_unit",
    "reference_table",
    "unpack",
]
