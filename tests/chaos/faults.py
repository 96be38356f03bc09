"""What may befall a drive, and which of it one drive meets, drawn from a seed.

A fault says what, to which kind of process, when and for how long; everything else is found out
when it happens, since only the run itself knows its processes.
"""

from __future__ import annotations

import random
from typing import NamedTuple

ENDERS = ("kill", "segv", "term", "hup")
"""Signals that end who gets them."""
SERVANTS = (
    "w", "w", "mirror", "builder", "tuning", "recorder", "recorder", "viewer", "router", "other",
)  # fmt: skip
"""Kinds of processes that are started again; `other` is any that stands in no table here."""
ALL = (*SERVANTS, "vehicle", "orchestrator")
LAST = ("orchestrator", "orchestrator", "vehicle", "command")
"""Of whom a signal is, or may be, the end of the drive: the last of its faults."""

DRIVING_S = 22.0
_FIRST_S, _LAST_S = 0.5, DRIVING_S - 2.0
_FAULTS = 10


class Fault(NamedTuple):
    """One fault, so long after the drive is under way; `for_s` is 0 where it is a moment.

    `strength` is drawn from 0 to 1 for what has one.
    """

    at_s: float
    what: str
    target: str = ""
    for_s: float = 0.0
    strength: float = 0.0

    def __str__(self) -> str:
        lasting = f" for {self.for_s:.1f} s" if self.for_s else ""
        return f"{self.at_s:5.1f} s  {self.what} {self.target}{lasting}".rstrip()


class Case(NamedTuple):
    """One drive and its faults, in their order; `linked` is a live car behind a link."""

    seed: int
    number: int
    linked: bool
    faults: tuple[Fault, ...]

    @property
    def name(self) -> str:
        """How the case is had again."""
        return f"--seed {self.seed} --drive {self.number}"


def draw(seed: int, number: int) -> Case:
    """Return the drive of a number, the same for the same seed."""
    chance = random.Random(f"{seed}/{number}")
    linked = chance.random() < 0.3
    faults = [_draw_one(chance, linked) for _ in range(_FAULTS - 1)]
    faults = _apart(sorted(faults))
    if not linked and chance.random() < 0.5:
        last = Fault(chance.uniform(_LAST_S - 8.0, _LAST_S), chance.choice(ENDERS), "")
        target = chance.choice(LAST)
        faults = [one for one in faults if one.at_s < last.at_s]
        faults.append(last._replace(target=target))
    return Case(seed, number, linked, tuple(faults))


def _draw_one(chance: random.Random, linked: bool) -> Fault:
    at_s = chance.uniform(_FIRST_S, _LAST_S)
    what = chance.choices(tuple(WEIGHTS), tuple(WEIGHTS.values()))[0]
    if what in OF_LINKS and not linked:
        what = "kill"
    strength = chance.random()
    match what:
        case "kill" | "segv" | "term" | "hup":
            return Fault(at_s, what, chance.choice(SERVANTS))
        case "stop":
            return Fault(at_s, what, chance.choice(ALL), chance.uniform(2.0, 10.0))
        case "memory":
            return Fault(at_s, what, chance.choice(SERVANTS), chance.uniform(2.0, 5.0), strength)
        case "full" | "read_only":
            return Fault(at_s, what, "disk", chance.uniform(2.0, 8.0))
        case "cut":
            return Fault(at_s, what, "link", chance.choice((1.5, 5.0)))
        case "delay":
            return Fault(at_s, what, "link", chance.uniform(2.0, 5.0))
        case "loss":
            return Fault(at_s, what, "link", chance.uniform(2.0, 8.0))
        case "clock":
            return Fault(at_s, what, "car", 0.0, strength)
        case "burst":
            return Fault(at_s, what, "car" if linked else "stranger", 2.0)
        case _:
            return Fault(at_s, what, strength=strength)


WEIGHTS = {
    "kill": 6, "segv": 2, "term": 2, "hup": 2, "stop": 4, "memory": 2, "full": 2, "read_only": 1,
    "power": 3, "cut": 4, "delay": 2, "loss": 2, "clock": 3, "burst": 2, "messages": 3,
}  # fmt: skip
OF_LINKS = frozenset({"cut", "delay", "loss", "clock"})
"""What only a car behind a link meets."""


def _apart(faults: list[Fault]) -> list[Fault]:
    """Leave out what would begin before the same thing, or the same target's, has ended.

    A process that dies more than five times in a minute is given up: four deaths at most.
    """
    kept: list[Fault] = []
    until_s: dict[str, float] = {}
    deaths: dict[str, int] = {}
    for one in faults:
        thing = one.target or one.what
        if one.at_s < until_s.get(thing, 0.0):
            continue
        deadly = one.what in ENDERS or one.what in ("memory", "stop")
        if deadly and deaths.get(thing, 0) >= 4:
            continue
        deaths[thing] = deaths.get(thing, 0) + deadly
        until_s[thing] = one.at_s + one.for_s + 0.5
        kept.append(one)
    return kept
