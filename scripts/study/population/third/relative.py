"""The path of the target seen from the chaser, integrated as a difference (Encke): rounding stays below 1 nm."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from baryscope.study.population.interface import FloatArray
from baryscope.study.population.third.forces import MU, Forces, natural

WHITE_STEPS = 2000  # kicks that stand for white acceleration
TOLERANCE = 1e-12
ABSOLUTE = np.concatenate([np.full(3, 1e-5), np.full(3, 1e-8), np.full(3, 1e-10), np.full(3, 1e-13), np.full(36, 1e9)])


@dataclass(frozen=True, eq=False)
class Flown:
    """At n times: path (n, 3) and its velocity (n, 3) in C, m and m/s; transition (n, 6, 6) of both from the first
    time in two-body motion; target (n, 6) geocentric. way: what was flown.
    """

    path: FloatArray
    velocity: FloatArray
    transition: FloatArray
    target: FloatArray
    way: "Way"


@dataclass(frozen=True, eq=False)
class Way:
    """The motion of target and path from their states (6,) at a time `begin`, s, under forces and kicks (`_kicks`)."""

    begin: float
    target: FloatArray
    start: FloatArray
    forces: Forces
    kick_time: FloatArray
    kicks: FloatArray

    def at(self, time: FloatArray) -> Flown:
        """The motion at ascending times (n,) in s, from `begin` on."""
        kicked_by = self.kick_time <= time[-1]
        kick_time, kicks = self.kick_time[kicked_by], self.kicks[kicked_by]
        every, place = np.unique(np.concatenate([[self.begin], time, kick_time]), return_inverse=True)
        states = _integrated(np.concatenate([self.target, self.start, np.eye(6).ravel()]), every, self.forces)
        transition = states[:, 12:].reshape(-1, 6, 6)
        own, at_kick = place[1 : len(time) + 1], place[len(time) + 1 :]
        found = states[own, 6:12] + kicked(transition[own], transition[at_kick], (time, kick_time), kicks)
        return Flown(found[:, :3], found[:, 3:], transition[own], states[own, :6], self)


def flown(target: FloatArray, start: FloatArray, time: FloatArray, forces: Forces, rng: np.random.Generator) -> Flown:
    """The motion from the target's state (6,) and the path's (6,) at time[0]; the stream draws kicks' directions.

    For a span after the last time, pulses as frequent and white acceleration go on, and no burns.
    """
    kick_time, kicks = _kicks(forces, time, rng)
    further = rng.spawn(1)[0]  # of a stream of its own, so that the motion within the times stays as it is
    span = time[-1] - time[0]
    later_pulses = tuple(np.sort(time[-1] + span * further.random(len(forces.pulse_times))).tolist())
    later_time, later = _kicks(replace(forces, pulse_times=later_pulses), time[-1] + np.array([0.0, span]), further)
    every = np.concatenate([kick_time, later_time]), np.concatenate([kicks, later])
    return Way(float(time[0]), target, start, forces, *every).at(time)


def carried(target: FloatArray, begin: float, end: float, forces: Forces) -> FloatArray:
    """The target's state (6,) at another time."""
    if begin == end:
        return target
    state = np.concatenate([target, np.zeros(6), np.eye(6).ravel()])
    return _stretch(state, begin, np.array([end]), forces, np.zeros(3))[-1, :6]


def kicked(
    transition: FloatArray, at_kick: FloatArray, times: tuple[FloatArray, FloatArray], kicks: FloatArray
) -> FloatArray:
    """How sudden velocities (k, 3) of the chaser move the path's state (n, 6), in first order.

    transition (n, 6, 6) and at_kick (k, 6, 6) from one time to `times`: n of the path and k of the kicks, in order.
    """
    sudden = np.concatenate([np.zeros_like(kicks), -kicks], axis=1)
    at_start = np.linalg.solve(at_kick, sudden[..., None])[..., 0] if len(kicks) else sudden
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(at_start, axis=0)])
    before = np.searchsorted(times[1], times[0], side="left")
    return np.asarray(np.einsum("nij,nj->ni", transition, total[before]))


def _kicks(forces: Forces, time: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Times (k,) in order, and velocities (k, 3) of the chaser."""
    if not forces.bit and not forces.white:
        return np.zeros(0), np.zeros((0, 3))
    pulses = (
        np.eye(3)[rng.integers(0, 3, len(forces.pulse_times))] * rng.choice([-1, 1], len(forces.pulse_times))[:, None]
    )
    edges = np.linspace(time[0], time[-1], WHITE_STEPS + 1)
    steady = edges[:-1] if forces.white else edges[:0]
    noise = forces.white * np.sqrt(edges[1] - edges[0]) * rng.standard_normal((len(steady), 3))
    when = np.concatenate([forces.pulse_times, steady])
    order = np.argsort(when, kind="stable")
    return when[order], np.concatenate([forces.bit * pulses, noise])[order]


def _integrated(state: FloatArray, time: FloatArray, forces: Forces) -> FloatArray:
    """States (n, 48) from that at time[0]; a new stretch begins where a burn begins or ends."""
    edges = {edge for burn in forces.burns for edge in (burn.start, burn.start + burn.length)}
    inner = sorted(edge for edge in edges if time[0] < edge < time[-1])
    found = [state[None]]
    bounds = [float(time[0]), *inner, float(time[-1])]
    for begin, end in pairwise(bounds):
        thrust = np.zeros(3)
        for burn in forces.burns:
            if burn.start <= (begin + end) / 2 < burn.start + burn.length:
                thrust = thrust + np.array(burn.acceleration)
        wanted = time[(time > begin) & (time <= end)]
        at = wanted if len(wanted) and wanted[-1] == end else np.append(wanted, end)
        states = _stretch(state, begin, at, forces, thrust)
        found.append(states[: len(wanted)])
        state = states[-1]
    return np.concatenate(found)


def _stretch(state: FloatArray, begin: float, at: FloatArray, forces: Forces, thrust: FloatArray) -> FloatArray:
    """States (n, 48) at the times `at`, the last of which ends the stretch; thrust (3,): of the chaser, m/s²."""
    span = (begin, float(at[-1]))
    found = solve_ivp(_slope, span, state, "DOP853", at, args=(forces, thrust), rtol=TOLERANCE, atol=ABSOLUTE)
    if not found.success:
        raise RuntimeError(found.message)
    return np.asarray(found.y.T)


def _slope(_: float, state: FloatArray, forces: Forces, thrust: FloatArray) -> FloatArray:
    r, v, p, w = state[:12].reshape(4, 3)
    chaser = r - p
    pull = two_body(r)
    change = difference(r, p) - thrust
    if forces.j2 or forces.drag or forces.light:
        of_target = natural(forces, r, v, 0)
        pull = pull + of_target
        change = change + of_target - natural(forces, chaser, v - w, 1)
    squared = chaser @ chaser
    gradient = MU / squared**1.5 * (3 * np.outer(chaser, chaser) / squared - np.eye(3))
    transition = state[12:].reshape(6, 6)
    return np.concatenate([v, pull, w, change, transition[3:].ravel(), (gradient @ transition[:3]).ravel()])


def two_body(r: FloatArray) -> FloatArray:
    """The Earth's attraction (3,) as a point mass at r (3,)."""
    return np.asarray(-MU / (r @ r) ** 1.5 * r)


def difference(r: FloatArray, p: FloatArray) -> FloatArray:
    """The attraction at r less that at r − p, without loss of digits (Battin, An Introduction to the Mathematics and
    Methods of Astrodynamics, 8.4).
    """
    c = r - p
    q = p @ (2 * c + p) / (c @ c)
    F = q * (3 + 3 * q + q**2) / (1 + (1 + q) ** 1.5)
    return np.asarray(-MU / (r @ r) ** 1.5 * (p - F * c))
