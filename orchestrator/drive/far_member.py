"""One worker on another machine as the drive knows it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from foretwin.contracts.fleet import Enlisted, MachineInfo, machine_of
from foretwin.orchestrator.drive.clock_offset import ClockOffset

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
    clock: ClockOffset = field(default_factory=ClockOffset)
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
    def text(self) -> str:
        """What was measured, in words."""
        best, cores = self.clock.best, 0 if self.said is None else self.said.machine.cores
        return (
            f"{cores} cores, {self.futures_per_s:.0f} futures/s, link {1e3 * best.link_s:.1f} ms, "
            f"clock {1e3 * best.offset_s:+.1f} ms"
        )

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
            row |= {
                "link_ms": round(1e3 * self.clock.best.link_s, 3),
                "clock_offset_ms": round(1e3 * self.clock.best.offset_s, 3),
            }
        if self.futures_per_s:
            row["futures_per_s"] = round(self.futures_per_s, 1)
        return row | ({"refused": self.refused} if self.refused else {})
