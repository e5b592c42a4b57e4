"""Which departures from the estimators' models a case has, and where it takes place."""

from dataclasses import dataclass

import numpy as np

from baryscope.study.population.third.dice import stream

LOW, MIDDLE, HIGH, HAND, BEARING = "low orbit", "orbit", "high orbit", "hand", "air bearing"
PLACES = {LOW: 0.34, MIDDLE: 0.26, HIGH: 0.20, HAND: 0.12, BEARING: 0.08}
ORBITS = (LOW, MIDDLE, HIGH)
LABORATORY = (HAND, BEARING)
SIGMA, NOTHING, RIG, UNTOLD_RIG = "sigma", "nothing", "rig", "untold rig"
TELLINGS = {SIGMA: 0.4, NOTHING: 0.2, RIG: 0.3, UNTOLD_RIG: 0.1}
IN_LABORATORY = {SIGMA: 0.6, NOTHING: 0.4}
COUNTS = {0: 0.1, 1: 0.3, 2: 0.35, 3: 0.25}  # of mismatches, by their probability
MANY_AT_ONCE = 0.35  # share of the low orbits that have all of CROWD besides
CROWD = ("J2", "drag", "pulses")

ANYWHERE = (*ORBITS, *LABORATORY)
KINDS: dict[str, tuple[float, tuple[str, ...]]] = {  # weight, and where it occurs
    "J2": (1.5, ORBITS),
    "drag": (3, (LOW,)),
    "light pressure": (3, (HIGH,)),
    "burns": (2, ORBITS),
    "pulses": (1.5, ORBITS),
    "white acceleration": (1.5, ORBITS),
    "orbit told wrong": (3, ORBITS),
    "eddy currents": (1, (LOW, MIDDLE)),
    "gravity gradient": (1, (LOW, MIDDLE)),
    "body torque": (1, (*ORBITS, BEARING)),
    "slosh": (1, ORBITS),
    "inertia change": (1, ORBITS),
    "flexible wing": (1.5, ORBITS),
    "unbalance": (6, (BEARING,)),
    "Student noise": (1, ANYWHERE),
    "drifting templates": (1.5, ANYWHERE),
    "noise by view angle": (1, ANYWHERE),
    "noise by edge": (1, ANYWHERE),
    "uneven noise": (1, ANYWHERE),
    "common mode": (1, ANYWHERE),
    "wrong sigma": (2, ANYWHERE),
    "wrong rig": (2, ANYWHERE),
    "jitter": (1, ANYWHERE),
    "gross outliers": (1, ANYWHERE),
    "near outliers": (1.5, ANYWHERE),
    "swapped labels": (1, ANYWHERE),
    "sliding feature": (1, ANYWHERE),
    "glint": (1, ANYWHERE),
    "slipping pivot": (5, LABORATORY),
    "soft tissue": (7, (HAND,)),
    "limited joint": (7, (HAND,)),
}
NEEDS = {"wrong sigma": SIGMA, "wrong rig": RIG}  # what must be told, so that it can be wrong


@dataclass(frozen=True)
class Plan:
    """place and telling (what an estimator is told of the noise): of those above; mismatches: names of KINDS."""

    place: str
    telling: str
    mismatches: tuple[str, ...]

    @property
    def orbital(self) -> bool:
        """Whether the target flies; in a laboratory an orbit means nothing."""
        return self.place in ORBITS


def planned(seed: int, index: int) -> Plan:
    """The plan of a case."""
    rng = stream(seed, index, "plan")
    place = _one(rng, PLACES)
    telling = _one(rng, TELLINGS if place in ORBITS else IN_LABORATORY)
    fitting = {
        name: weight
        for name, (weight, places) in KINDS.items()
        if place in places and NEEDS.get(name, telling) == telling
    }
    weights = np.array(list(fitting.values()))
    count = int(_one(rng, {str(number): share for number, share in COUNTS.items()}))
    chosen = set(rng.choice(list(fitting), size=count, replace=False, p=weights / weights.sum()).tolist())
    if place == LOW and count and rng.random() < MANY_AT_ONCE:
        chosen |= set(CROWD)
    return Plan(place, telling, tuple(name for name in KINDS if name in chosen))


def _one(rng: np.random.Generator, shares: dict[str, float]) -> str:
    return str(rng.choice(list(shares), p=list(shares.values())))
