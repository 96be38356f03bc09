"""Cycles of traffic lights, learnt from the colours that a car receives.

Where a group of lights was heard to run through two whole cycles that are alike it is taken for
one with fixed times: futures then know when it changes. Of all others no more is known than the
colour they show. A colour that the cycle does not say ends what was learnt.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from foretwin.contracts.drive import SignalColour, SignalState
from foretwin.contracts.signals import LearntSignal
from foretwin.contracts.too_old import LIGHT_FOR_S
from foretwin.world_gen.rules.signal_state import heard_cycle

MOST_SIGNALS = 1000
"""Signal groups that are listened to."""
AGREE_S = 0.5
"""Fixed times stray no farther, beyond what the pace of reports hides."""
LEAST_CYCLES, MOST_CYCLES = 2, 6
SILENT_CYCLES = 10
"""What was learnt counts for so many cycles after the last word."""
_MOST_CHANGES = 8 * MOST_CYCLES
_BEGINS: SignalColour = "green"
_NO_CYCLE: tuple[SignalColour, ...] = ("unknown", "dark")


class _Change(NamedTuple):
    """A change to a colour, between two reports `unsure_s` apart; `follows` tells that none was
    missed since the change before."""

    at_ns: int
    unsure_s: float
    colour: SignalColour
    follows: bool


class _Cycle(NamedTuple):
    """One cycle as it was heard, from a beginning of green to the next."""

    begins_ns: int
    length_s: float
    from_s: tuple[float, ...]
    colours: tuple[SignalColour, ...]
    unsure_s: float


class _Group:
    """What was heard of one group."""

    def __init__(self, first: SignalState) -> None:
        self.last = first
        self._changes: deque[_Change] = deque(maxlen=_MOST_CHANGES)
        self._follows = False
        self._learnt: LearntSignal | None = None

    def take(self, signal: SignalState) -> None:
        """Take a report; one that is not newer says nothing of changes."""
        known = self.last
        gap_s = (signal.stamp_ns - known.stamp_ns) / 1e9
        if gap_s <= 0.0:
            return
        self.last = signal
        if self._learnt is not None and not _as_foretold(signal, self._learnt):
            # Another plan, or none: what was heard before says nothing of it.
            self._learnt = None
            self._changes.clear()
        if gap_s > LIGHT_FOR_S or signal.colour in _NO_CYCLE or known.colour in _NO_CYCLE:
            self._follows = False
        elif signal.colour != known.colour:
            at_ns = (known.stamp_ns + signal.stamp_ns) // 2
            self._changes.append(_Change(at_ns, gap_s, signal.colour, self._follows))
            self._follows = True
            self._learnt = _learnt(signal.group_id, list(_cycles(self._changes)))

    @property
    def has_cycle(self) -> bool:
        """Whether a cycle was learnt, though it may not hold any more."""
        return self._learnt is not None

    def learnt(self, now_ns: int) -> LearntSignal | None:
        """Return the group's cycle if it is known and holds still."""
        found = self._learnt
        if found is None:
            return None
        silent_s = (now_ns - self.last.stamp_ns) / 1e9
        if silent_s > SILENT_CYCLES * found.cycle_s or self.last.colour in _NO_CYCLE:
            return None
        return found


def _as_foretold(signal: SignalState, learnt: LearntSignal) -> bool:
    """Return whether a colour is what a cycle says, give or take how far it strays."""
    if signal.colour in _NO_CYCLE:
        return True
    cycle = heard_cycle(learnt, signal.stamp_ns)
    most_s = learnt.spread_s + AGREE_S
    return any(signal.colour == cycle.colour_at(most_s * k / 8.0) for k in range(-8, 9))


class SignalLearner:
    """Listens to all groups of lights."""

    def __init__(self) -> None:
        self._groups: dict[str, _Group] = {}
        self._cyclic: dict[str, _Group] = {}
        """Those of a known cycle, in the order of their names."""
        self._heard: dict[str, SignalState] = {}

    def take(self, signal: SignalState) -> None:
        """Take a report; of too many groups the one silent for longest is forgotten."""
        name = signal.group_id
        group = self._groups.get(name)
        if group is None:
            group = self._groups[name] = _Group(signal)
        else:
            group.take(signal)
        self._heard[name] = group.last
        if group.has_cycle != (name in self._cyclic):
            self._cyclic = {n: one for n, one in sorted(self._groups.items()) if one.has_cycle}
        if len(self._groups) > MOST_SIGNALS:
            silent = min(self._heard, key=lambda i: self._heard[i].stamp_ns)
            del self._groups[silent], self._heard[silent]
            self._cyclic.pop(silent, None)

    @property
    def heard(self) -> Mapping[str, SignalState]:
        """The newest report of each group, by its name."""
        return self._heard

    @property
    def newest(self) -> tuple[SignalState, ...]:
        """The newest report of each group."""
        return tuple(self._heard.values())

    def learnt(self, now_ns: int) -> tuple[LearntSignal, ...]:
        """Return the cycles that hold at a time of the vehicle's clock, by group."""
        found = (group.learnt(now_ns) for group in self._cyclic.values())
        return tuple(one for one in found if one is not None)

    def record(self, now_ns: int, start_ns: int) -> dict[str, dict[str, Any]]:
        """Return what is known of each group for run.json.

        Groups of one cycle run in step: what their `green_from_s`, seconds after the drive's
        start modulo the cycle, differ by is the offset from one to the other.
        """
        return {one.group_id: _words(one, start_ns) for one in self.learnt(now_ns)}


def _words(one: LearntSignal, start_ns: int) -> dict[str, Any]:
    ends_s = (*one.from_s[1:], one.cycle_s)
    lasts_s: dict[str, float] = {}
    for colour, begin_s, end_s in zip(one.colours, one.from_s, ends_s, strict=True):
        lasts_s[colour] = round(lasts_s.get(colour, 0.0) + end_s - begin_s, 1)
    return {
        "cycle_s": round(one.cycle_s, 2),
        "green_from_s": round((one.begins_ns - start_ns) / 1e9 % one.cycle_s, 1),
        "lasts_s": lasts_s,
        "cycles": one.cycles,
        "spread_s": round(one.spread_s, 2),
    }


def _cycles(changes: deque[_Change]) -> Iterator[_Cycle]:
    """Yield the whole cycles among changes, none of whose changes was missed."""
    parts: list[_Change] = []
    for change in changes:
        if parts and not change.follows:
            parts = []
        if change.colour == _BEGINS:
            if parts:
                yield _cycle(parts, change)
            parts = [change]
        elif parts:
            parts.append(change)


def _cycle(parts: list[_Change], end: _Change) -> _Cycle:
    first = parts[0]
    return _Cycle(
        begins_ns=first.at_ns,
        length_s=(end.at_ns - first.at_ns) / 1e9,
        from_s=tuple((part.at_ns - first.at_ns) / 1e9 for part in parts),
        colours=tuple(part.colour for part in parts),
        unsure_s=max(part.unsure_s for part in (*parts, end)),
    )


def _learnt(group_id: str, cycles: list[_Cycle]) -> LearntSignal | None:
    """Return what the newest cycles have in common; None where they are no fixed ones."""
    alike = cycles[-1:]
    for cycle in reversed(cycles[-MOST_CYCLES:-1]):
        if not all(_agree(cycle, other) for other in alike):
            break
        alike.insert(0, cycle)
    if len(alike) < LEAST_CYCLES:
        return None
    last = alike[-1]
    length_s = sum(cycle.length_s for cycle in alike) / len(alike)
    span_s = (last.begins_ns - alike[0].begins_ns) / 1e9 + last.length_s
    count = round(span_s / length_s)
    # Some cycles may have gone unheard between those that were.
    if abs(span_s - count * length_s) > _tolerance_s(last):
        return None
    length_s = span_s / count
    ages = [round((last.begins_ns - c.begins_ns) / 1e9 / length_s) for c in alike]
    begins = [c.begins_ns + age * length_s * 1e9 for c, age in zip(alike, ages, strict=True)]
    begins_ns = round(sum(begins) / len(begins))
    from_s = tuple(
        sum(times) / len(alike) for times in zip(*(c.from_s for c in alike), strict=True)
    )
    return LearntSignal(
        group_id=group_id,
        begins_ns=begins_ns,
        cycle_s=length_s,
        from_s=from_s,
        colours=last.colours,
        cycles=len(alike),
        spread_s=max(
            max(abs(begin - begins_ns) / 1e9 for begin in begins),
            max(abs(t - mean) for c in alike for t, mean in zip(c.from_s, from_s, strict=True)),
            max(c.unsure_s for c in alike),
        ),
    )


def _agree(a: _Cycle, b: _Cycle) -> bool:
    most_s = max(_tolerance_s(a), _tolerance_s(b))
    if a.colours != b.colours or abs(a.length_s - b.length_s) > most_s:
        return False
    return all(abs(s - t) <= most_s for s, t in zip(a.from_s, b.from_s, strict=True))


def _tolerance_s(cycle: _Cycle) -> float:
    return AGREE_S + cycle.unsure_s
