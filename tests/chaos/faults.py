"""What may befall a drive, and which of it one drive meets, drawn from a seed.

A fault says what, to which kind of process, when and for how long; everything else is found out
when it happens, since only the run itself knows its processes.
"""

from __future__ import annotations

import random
from typing import Literal, NamedTuple

Source = Literal["standin", "log", "live"]
"""Where the samples of a drive come from; `live` is a car of somebody else's behind a link."""
BusKind = Literal["socket", "open", "tls"]
"""A socket with passwords, a network's endpoint that asks nobody, or one with certificates."""

ENDERS = ("kill", "segv", "term", "hup")
"""Signals that end who gets them."""
DEADLY = (*ENDERS, "memory")
"""What ends a process, or may."""
STARTED_AGAIN = (
    "w", "w", "mirror", "builder", "tuning", "recorder", "recorder", "viewer", "router",
)  # fmt: skip
"""Kinds of processes that the supervisor starts again, whatever ends them."""
OUTSIDE = {"live": "car", "planner": "planner"}
"""Who takes part and is none of the run's, by what brings it."""
LAST = ("supervisor", "supervisor", "orchestrator", "vehicle")
"""Whose end is, or may be, the end of the drive: the last of its faults."""

DRIVING_S = 22.0
_FIRST_S, _LAST_S = 0.5, DRIVING_S - 2.0
_FAULTS = 20

WEIGHTS = {
    "kill": 8, "segv": 4, "term": 3, "hup": 3, "stop": 5, "memory": 3, "full": 2, "read_only": 2,
    "power": 2, "cut": 4, "delay": 2, "loss": 2, "clock": 3, "host_clock": 2, "burst": 2,
    "messages": 4,
}  # fmt: skip
OF_LINKS = frozenset({"cut", "delay", "loss", "clock"})
"""What only a car behind a link meets."""


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
    """One drive and its faults, in their order."""

    seed: int
    number: int
    source: Source
    bus: BusKind
    planner: bool
    """Whether a driving stack in a process of somebody else's drives the futures."""
    faults: tuple[Fault, ...]

    @property
    def name(self) -> str:
        """How the case is had again."""
        return f"--seed {self.seed} --drive {self.number}"

    @property
    def kind(self) -> str:
        """What drives and how it is joined, in words."""
        return f"{self.source} {self.bus}{' planner' if self.planner else ''}"


def draw(seed: int, number: int) -> Case:
    """Return the drive of a number, the same for the same seed."""
    chance = random.Random(f"{seed}/{number}")
    source: Source = chance.choices(("standin", "log", "live"), (0.4, 0.25, 0.35))[0]
    bus: BusKind = chance.choices(("socket", "open"), (0.6, 0.4))[0]
    if source == "live":
        bus = chance.choices(("open", "tls"), (0.6, 0.4))[0]
    planner = bus != "tls" and chance.random() < 0.3
    there = [*STARTED_AGAIN, "orchestrator", "orchestrator"]
    there += ["car"] * (source == "live") + ["planner", "planner"] * planner
    stays = ["supervisor", *(["vehicle"] if source != "live" else []), *there]
    faults = [_draw_one(chance, source, bus, there, stays) for _ in range(_FAULTS)]
    faults = _apart(sorted(faults))
    if chance.random() < 0.5:
        last = Fault(chance.uniform(_LAST_S - 6.0, _LAST_S), chance.choice(DEADLY), "", 3.0)
        whose = [one for one in LAST if source != "live" or one != "vehicle"]
        last = last._replace(target=chance.choice(whose), strength=chance.random())
        faults = [one for one in faults if one.at_s < last.at_s]
        faults.append(last._replace(for_s=3.0 if last.what == "memory" else 0.0))
    return Case(seed, number, source, bus, planner, tuple(faults))


def _draw_one(
    chance: random.Random, source: Source, bus: BusKind, there: list[str], stays: list[str]
) -> Fault:
    at_s = chance.uniform(_FIRST_S, _LAST_S)
    what = chance.choices(tuple(WEIGHTS), tuple(WEIGHTS.values()))[0]
    if what in OF_LINKS and source != "live":
        what = "kill"
    if what == "loss" and bus == "tls":
        what = "cut"  # no certificate is for a host of the moment
    strength = chance.random()
    match what:
        case "kill" | "segv" | "term" | "hup":
            target = chance.choice(there)
            if target == "orchestrator" and what in ("term", "hup"):
                what = "kill"  # those ask it to end the drive
            return Fault(at_s, what, target)
        case "stop":
            return Fault(at_s, what, chance.choice(stays), chance.uniform(2.0, 10.0))
        case "memory":
            return Fault(at_s, what, chance.choice(there), chance.uniform(2.0, 5.0), strength)
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
        case "host_clock":
            return Fault(at_s, what, "host", 0.0, strength)
        case "burst":
            return Fault(at_s, what, "car" if source == "live" else "stranger", 2.0, strength)
        case "messages":
            return Fault(at_s, what, "stranger", 0.0, strength)
        case _:
            return Fault(at_s, what, "run", strength=strength)


def _apart(faults: list[Fault]) -> list[Fault]:
    """Leave out what would begin before the same thing, or the same target's, has ended.

    A process that dies more than five times in a minute is given up: four deaths at most.
    """
    kept: list[Fault] = []
    until_s: dict[str, float] = {}
    deaths: dict[str, int] = {}
    for one in faults:
        thing = f"{one.target} {one.what}" if one.target == "stranger" else one.target
        if one.at_s < until_s.get(thing, 0.0):
            continue
        deadly = one.what in DEADLY or one.what == "stop"
        if deadly and deaths.get(thing, 0) >= 4:
            continue
        deaths[thing] = deaths.get(thing, 0) + deadly
        until_s[thing] = one.at_s + one.for_s + 0.5
        kept.append(one)
    return kept
