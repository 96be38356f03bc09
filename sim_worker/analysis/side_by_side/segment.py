"""Between two takeovers: plans that wait to be driven, disagreements that last, and figures."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple, get_args

from msgspec.structs import replace

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlMode
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.running import RunningQuantiles
from foretwin.contracts.side_by_side import Aspect, Disagreement, DisagreementKind, DrivenSegment
from foretwin.sim_worker.analysis.side_by_side.departure import Departure

BEGIN_NS = 400_000_000
"""Plans must be departed from for so long: one alone is a whim."""
END_NS = 1_000_000_000
"""A disagreement is over once plans have been followed, or been missing, for so long."""
_GRAVEST: tuple[DisagreementKind, ...] = get_args(DisagreementKind)
_FIGURES = ("lateral_m", "along_m", "speed_mps")


class DrivePlace(NamedTuple):
    """Where the car was: `junction_id` it was at or had before it, `route_m` along its route."""

    position: GeoPoint
    junction_id: str | None = None
    route_m: float | None = None


class Waiting(NamedTuple):
    """A plan until it has been driven: rows x, y, yaw, speed (N, 4) at stamps (N,) on a grid."""

    stamp_ns: int
    stamps_ns: Array
    planned: Array
    place: DrivePlace


@dataclass(slots=True)
class AspectWatch:
    """One aspect of a segment: whether human and ADS disagree, with hysteresis."""

    vehicle_id: str
    segment: int
    aspect: Aspect
    _now: Disagreement | None = None
    _reported: bool = False
    _last_over_ns: int = 0

    def take(
        self,
        stamp_ns: int,
        kind: DisagreementKind | None,
        within: bool,
        found: Departure,
        place: DrivePlace,
    ) -> list[Disagreement]:
        """Take one compared plan; `within` says that it lies below the lowered limits, too."""
        ended = []
        if self._now is not None and stamp_ns - self._last_over_ns > END_NS:
            ended = self.finish()
        if kind is None and (self._now is None or within):
            if self._now is not None and not self._reported:
                self._now = None  # departed from for too short a time
            return ended
        self._last_over_ns = stamp_ns
        self._now = self._joined(stamp_ns, kind, found, place)
        if not self._reported and stamp_ns - self._now.stamp_ns >= BEGIN_NS:
            self._reported = True
            return [*ended, self._now]
        return ended

    def finish(self) -> list[Disagreement]:
        """End what lasts; return it if it was reported."""
        now, reported = self._now, self._reported
        self._now, self._reported = None, False
        if now is None or not reported:
            return []
        return [replace(now, over=True)]

    def _joined(
        self, stamp_ns: int, kind: DisagreementKind | None, found: Departure, place: DrivePlace
    ) -> Disagreement:
        old, figures = self._now, {name: getattr(found, name) for name in _FIGURES}
        if old is None:
            assert kind is not None
            return Disagreement(
                vehicle_id=self.vehicle_id,
                segment=self.segment,
                aspect=self.aspect,
                kind=kind,
                stamp_ns=stamp_ns,
                end_stamp_ns=stamp_ns,
                over=False,
                **place._asdict(),
                **figures,
            )
        graver = kind is not None and _GRAVEST.index(kind) < _GRAVEST.index(old.kind)
        farthest = {name: _farther(getattr(old, name), here) for name, here in figures.items()}
        return replace(old, kind=kind if graver else old.kind, end_stamp_ns=stamp_ns, **farthest)


def _farther(one: float | None, other: float | None) -> float | None:
    return max((value for value in (one, other) if value is not None), key=abs, default=None)


@dataclass(slots=True)
class Segment:
    """One segment while it is driven."""

    number: int
    mode: ControlMode
    from_ns: int
    aspects: tuple[AspectWatch, AspectWatch]
    until_ns: int | None = None
    """The takeover that ended it."""
    waiting: deque[Waiting] = field(default_factory=deque)
    plans: int = 0
    """Compared with what was driven."""
    cut: int = 0
    too_short: int = 0
    disagreements: int = 0
    last_ns: int = 0
    _peaks: dict[str, RunningQuantiles] = field(
        default_factory=lambda: {name: RunningQuantiles() for name in _FIGURES}
    )

    def count(self, found: Departure) -> None:
        """Count one compared plan."""
        self.plans += 1
        for name, peaks in self._peaks.items():
            apart: float | None = getattr(found, name)
            if apart is not None:
                peaks.take(abs(apart))

    def record(self) -> DrivenSegment:
        """Return what is known of it so far."""
        figures = {name: peaks.percentile(95.0) for name, peaks in self._peaks.items()}
        return DrivenSegment(
            number=self.number,
            control_mode=self.mode,
            from_stamp_ns=self.from_ns,
            to_stamp_ns=self.last_ns if self.until_ns is None else self.until_ns,
            plans=self.plans,
            ways=self._peaks["lateral_m"].count,
            cut=self.cut,
            too_short=self.too_short,
            disagreements=self.disagreements,
            **figures,
        )
