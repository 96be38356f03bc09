"""One worker on another machine as the drive knows it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from foretwin.contracts.fleet import MOST_CLOCK_OFFSET_S, Enlisted, MachineInfo, machine_of
from foretwin.orchestrator.record.machine import differences, other_arithmetic
from foretwin.telemetry.estimator.far_clock import FarClock

_NAMED = 4
"""So many functions are named."""
Stage = Literal["asked", "clock", "waiting", "probing", "playing", "refused", "gone"]
"""In the order in which a worker goes through them; it waits for a World to be tried in."""


class FleetTag(NamedTuple):
    """Of which member's question an answer is; one of an earlier `turn` says nothing any more."""

    worker_id: str
    channel: str
    turn: int
    asked_s: float
    detail: str


@dataclass(slots=True)
class FarMember:
    """How far a worker has come."""

    worker_id: str
    stage: Stage = "asked"
    turn: int = 0
    """Counts how often it was told with what the drive plays."""
    version: int = -1
    """Of the parameters that it was told."""
    said: Enlisted | None = None
    clock: FarClock = field(default_factory=FarClock)
    clock_asked: bool = False
    next_clock_s: float = 0.0
    again_s: float | None = None
    """When to begin anew with it, on the monotonic clock."""
    probes: int = 0
    work_s: float = 0.0
    """What the probe cost it, without the link."""
    futures_per_s: float = 0.0
    """Of the probe, with the link."""
    refused: str = ""

    def begin(self, version: int) -> None:
        """It is told anew with what the drive plays."""
        self.stage, self.again_s, self.probes = "asked", None, 0
        self.turn, self.version = self.turn + 1, version

    @property
    def machine(self) -> str:
        """The name of its machine."""
        return machine_of(self.worker_id)

    @property
    def instance(self) -> str:
        """The word of the process that it is; empty before it has said one."""
        return "" if self.said is None else self.said.instance

    def version_trouble(self, ours: MachineInfo) -> str | None:
        """Return why its program does not fit ours, None where it does."""
        assert self.said is not None
        theirs = self.said.machine.versions.get("foretwin", "of no version")
        if theirs == ours.versions["foretwin"]:
            return None
        here = ours.versions["foretwin"]
        return f"{self.machine} runs foretwin {theirs}, this drive {here}: install the same"

    def arithmetic_trouble(self, ours: MachineInfo) -> str | None:
        """Return which functions come to other bits there, None where none does."""
        assert self.said is not None
        found = other_arithmetic(self.said.machine, ours)
        if not found:
            return None
        more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
        return (
            f"{self.machine} computes other bits than this machine ({', '.join(found[:_NAMED])}"
            f"{more}): {differences(self.said.machine, ours)}"
        )

    def clock_trouble(self) -> str | None:
        """Return how far its clock is off, None where that is near enough."""
        if not self.clock.beyond(MOST_CLOCK_OFFSET_S):
            return None
        return (
            f"the clock of {self.machine} is {self.clock.best.offset_s:+z.3f} s off, at most "
            f"{MOST_CLOCK_OFFSET_S:g} s is allowed: set it (timedatectl set-ntp true)"
        )

    def bits_trouble(self, ours: MachineInfo) -> str:
        """Return in words that its probe came to other bits, and what may have made them."""
        assert self.said is not None
        why = differences(self.said.machine, ours)
        return f"{self.machine} plays other bits than this machine: {why}"

    def measured(self, took_s: float, *, futures: int) -> None:
        """Take how long the probe took from question to answer."""
        self.work_s = max(took_s - self.clock.last.link_s, 0.0)
        self.futures_per_s = futures / took_s

    @property
    def text(self) -> str:
        """What was measured, in words."""
        best, cores = self.clock.best, 0 if self.said is None else self.said.machine.cores
        return (
            f"{cores} cores, {self.futures_per_s:.0f} futures/s, link {1e3 * best.link_s:.1f} ms, "
            f"clock {1e3 * best.offset_s:+z.1f} ms"
        )

    @property
    def link_ms(self) -> float:
        """What a question takes there and back, of late."""
        return round(1e3 * self.clock.last.link_s, 3)

    @property
    def clock_offset_ms(self) -> float:
        """Its clock less ours."""
        return round(1e3 * self.clock.best.offset_s, 3)

    def record(self, ours: MachineInfo) -> dict[str, Any]:
        """Return what run.json says of it."""
        row: dict[str, Any] = {"worker": self.worker_id, "stage": self.stage}
        if self.said is not None:
            machine = self.said.machine
            row |= {
                "cores": machine.cores,
                "cpu": machine.cpu,
                "versions_that_differ": {
                    name: version
                    for name, version in machine.versions.items()
                    if ours.versions.get(name) != version
                },
            }
        if len(self.clock):
            row |= {"link_ms": self.link_ms, "clock_offset_ms": self.clock_offset_ms}
        if self.futures_per_s:
            row["futures_per_s"] = round(self.futures_per_s, 1)
        return row | ({"refused": self.refused} if self.refused else {})
