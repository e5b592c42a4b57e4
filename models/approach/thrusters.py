"""Thrusters that are wrong: the command under which they push as is wanted, by what is known of what they are wrong by.

That is a scale s and a misalignment, a rotation vector m in the camera's axes, to which they are fixed: under the
command u they push by (1 + s) exp([m]×) u, so by a under u = exp(−[m]×) a / (1 + s).
"""

import casadi as ca

from baryscope.models.checks import DIRECTED
from baryscope.models.frames import Symbol, turned


def command_for(wanted: Symbol, scale: Symbol, misalignment: Symbol) -> Symbol:
    """u, m/s², in the axes of what is wanted; that itself, to the last bit, where thrusters are right.

    Of s ≤ −1 they push not at all or backwards, so that no command helps: it is then as long as numbers go.

    Args:
        wanted: a, the acceleration (3,), m/s².
        scale: s.
        misalignment: m (3,) in the axes of a, rad.
    """
    return turned(wanted, -misalignment) / ca.fmax(1 + scale, DIRECTED)


def believable(scale: Symbol, misalignment: Symbol, most: Symbol) -> tuple[Symbol, Symbol]:
    """What is told of thrusters, cut to a size: an estimate that fails tells of thrusters that push backwards.

    Args:
        scale: s.
        misalignment: m (3,), rad.
        most: the largest |s| and |m| that a command is corrected for.
    """
    share = ca.fmin(1, most / ca.fmax(ca.norm_2(misalignment), DIRECTED))
    return ca.fmax(ca.fmin(scale, most), -most), share * misalignment


def sight_rate(position: Symbol, velocity: Symbol, spin: Symbol) -> Symbol:
    """Inertial angular rate of a camera that looks at the CoM and does not roll: ρ × (ρ̇ + Ω × ρ) / |ρ|², rad/s in L.

    Args:
        position: ρ of the chaser in L, m.
        velocity: ρ̇ in L, m/s.
        spin: Ω of L, rad/s.
    """
    return ca.cross(position, velocity + ca.cross(spin, position)) / ca.fmax(ca.sumsqr(position), DIRECTED)
