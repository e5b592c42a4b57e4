"""Arithmetic of pairs of nearly equal numbers, with their difference in full precision.

Two orbits of 7000 km radius that are 20 m apart agree to six digits. If both are computed and then subtracted, the
difference loses six of its 16 digits. A `Pair` holds one of the two numbers and the difference. Its arithmetic follows
(b + β)(c + γ) − b c = b γ + β c + β γ and so on: nearly equal numbers are never subtracted.
"""

from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca

from baryscope.models.frames import Symbol


@dataclass(frozen=True)
class Pair:
    """A quantity of two systems, scalar or vector.

    Attributes:
        base: its value in the first.
        excess: its value in the second, minus that.
    """

    base: Symbol
    excess: Symbol

    @property
    def other(self) -> Symbol:
        """The value in the second system."""
        return self.base + self.excess

    def __add__(self, right: "Operand") -> "Pair":
        right = _pair(right)
        return Pair(self.base + right.base, self.excess + right.excess)

    def __sub__(self, right: "Operand") -> "Pair":
        return self + -1 * _pair(right)

    def __rsub__(self, left: "Operand") -> "Pair":
        return _pair(left) - self

    def __mul__(self, right: "Operand") -> "Pair":
        right = _pair(right)
        return Pair(self.base * right.base, self.base * right.excess + self.excess * right.other)

    __rmul__ = __mul__

    def __truediv__(self, right: "Operand") -> "Pair":
        right = _pair(right)
        quotient = self.base / right.base
        return Pair(quotient, (self.excess - quotient * right.excess) / right.other)

    def __rtruediv__(self, left: "Operand") -> "Pair":
        return _pair(left) / self


Operand: TypeAlias = Pair | Symbol | float


def _pair(value: Operand) -> Pair:
    return value if isinstance(value, Pair) else Pair(ca.SX(value), ca.SX(0))


def dot(left: Pair, right: Pair) -> Pair:
    """Scalar product of two vectors."""
    return Pair(ca.dot(left.base, right.base), ca.dot(left.base, right.excess) + ca.dot(left.excess, right.other))


def sqrt(x: Pair) -> Pair:
    """Square root."""
    root = ca.sqrt(x.base)
    return Pair(root, x.excess / (root + ca.sqrt(x.other)))


def sin(angle: Pair) -> Pair:
    """Sine of an angle in rad."""
    return Pair(ca.sin(angle.base), 2 * ca.cos(angle.base + angle.excess / 2) * ca.sin(angle.excess / 2))


def cos(angle: Pair) -> Pair:
    """Cosine of an angle in rad."""
    return Pair(ca.cos(angle.base), -2 * ca.sin(angle.base + angle.excess / 2) * ca.sin(angle.excess / 2))
