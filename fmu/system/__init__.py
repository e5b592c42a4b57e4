"""Whole systems: units and their connections as an SSP 1.0 archive, and a master that steps one.

`chain` says which units are connected how, `structure` writes the .ssd, `package` builds and packs; `opening` reads and
checks any such archive, and `master` steps it.
"""

from baryscope.fmu.system.master import Master
from baryscope.fmu.system.opening import open_system, refuse_step
from baryscope.fmu.system.package import build_system

__all__ = ["Master", "build_system", "open_system", "refuse_step"]
