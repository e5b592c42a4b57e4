"""How an FMU of ours is laid out: its platforms and their folders, its value references, and opening its file.

The other rooms of baryscope.fmu import this one; it imports none of them.
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
