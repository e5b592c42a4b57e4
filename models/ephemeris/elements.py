"""Keplerian elements from position and velocity."""

from dataclasses import fields
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.keplerian import Elements, osculating

FloatArray = NDArray[np.float64]

NAMES = [field.name for field in fields(Elements)][:-1]  # without the gravitational parameter


def elements_of(state: FloatArray, mu: float) -> dict[str, float]:
    """The osculating elements, by the names of the fields of `Orbit`, in m and rad: those of `keplerian.osculating`.

    Args:
        state: (6,), position and velocity from the central body's centre in I, m and m/s.
        mu: gravitational parameter, m³/s².
    """
    return dict(zip(NAMES, _elements()(state, [mu])[0].tolist(), strict=True))


@cache
def _elements() -> ColumnFunction:
    """(state, μ) → the elements without μ."""
    state, mu = ca.SX.sym("state", 6), ca.SX.sym("mu")
    return ColumnFunction("elements", [state, mu], osculating(state, mu).column[:-1])
