"""Tables of a scenario for forces besides point-mass gravity: [drag], [light], [eddy_currents]. J2 is in [orbit]."""

from typing import Annotated

import numpy as np
from pydantic import Field, field_validator

from baryscope.models.orbit import EARTH_RADIUS, EARTH_ROTATION_RATE
from baryscope.models.scenario.schema import FileModel, Unit, Vector

Coefficient = Annotated[float, Unit("m²/kg"), Field(ge=0, le=1e3)]
TensorElement = Annotated[float, Field(ge=-1e12, le=1e12)]
TensorRow = tuple[TensorElement, TensorElement, TensorElement]
Moment = Annotated[float, Field(ge=-1e22, le=1e22)]


class Drag(FileModel):
    """[drag]: an exponential atmosphere that turns about the z axis of I, and what of it each body feels.

    `target` and `chaser` are c_D A/m, drag coefficient times area over mass. The density holds at `reference_radius`
    from the centre, at the orbit's semi-major axis unless given. With a large `scale_height` it is the same everywhere.
    """

    density: Annotated[float, Unit("kg/m³"), Field(ge=0, le=1)]
    target: Coefficient
    chaser: Coefficient
    scale_height: Annotated[float, Unit("m"), Field(ge=1e2, le=1e15)] = 60e3
    reference_radius: Annotated[float | None, Unit("m"), Field(gt=0, le=1e12)] = None
    rotation_rate: Annotated[float, Unit("rad/s"), Field(ge=-0.01, le=0.01)] = EARTH_ROTATION_RATE


class Light(FileModel):
    """[light]: sunlight from a fixed direction in I, its pressure, and the sphere that shades it.

    `target` and `chaser` are c_R A/m, radiation coefficient times area over mass.
    """

    sun: Vector
    target: Coefficient
    chaser: Coefficient
    pressure: Annotated[float, Unit("N/m²"), Field(ge=0, le=1)] = 4.56e-6  # at one astronomical unit
    shadow_radius: Annotated[float, Unit("m"), Field(gt=0, le=1e12)] = EARTH_RADIUS

    @field_validator("sun")
    @classmethod
    def _unit_length(cls, sun: Vector) -> Vector:
        length = float(np.linalg.norm(sun))
        if length < 1e-9:
            raise ValueError(f"found {list(sun)}, expected a direction towards the Sun")
        x, y, z = (c / length for c in sun)
        return (x, y, z)


class EddyCurrents(FileModel):
    """[eddy_currents]: the target's magnetic tensor in body axes, and the dipole of the magnetic field in I.

    The dipole is μ₀/4π times its moment: for the Earth, 7.7e15 T m³ towards the south.
    """

    tensor: Annotated[tuple[TensorRow, TensorRow, TensorRow], Unit("S m⁴")]
    dipole: Annotated[tuple[Moment, Moment, Moment], Unit("T m³")] = (0.0, 0.0, -7.7e15)

    @field_validator("tensor")
    @classmethod
    def _symmetric(cls, rows: tuple[TensorRow, TensorRow, TensorRow]) -> tuple[TensorRow, TensorRow, TensorRow]:
        M = np.array(rows)
        if not np.allclose(M, M.T, rtol=1e-12, atol=0):
            raise ValueError("found an asymmetric tensor, expected a symmetric one in S m⁴")
        return rows
