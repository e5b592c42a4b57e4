"""The truth model: attitude and orbits as CasADi symbols, the table of the unit's variables, the orbit in SI units.

Rooms: `scenario`, the files that say what is flown; `sensor`, what is measured of it. Imports run sensor → scenario →
the modules that stand here.
"""
