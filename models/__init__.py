"""The truth model: attitude and orbit dynamics in CasADi, the table of the unit's variables, and `Orbit` in SI units.

Rooms: `scenario` (scenario and orbit files) and `sensor` (simulated measurements). `sensor` imports `scenario`, which
imports the modules at this level.
"""
