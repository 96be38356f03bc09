"""A clock, a mailbox and a conductor that a live loop is run with, second by second."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from types import SimpleNamespace

from foretwin.orchestrator.record.ledger import RoundTally
from foretwin.orchestrator.rounds.pace import Pace
from tests.contracts.memory_bus import MemoryBus


class Clock:
    """Stands in for the module `time`: moves when somebody waits."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


class Mailbox:
    """Items with the second at which each arrives; taking waits, and time passes."""

    def __init__(self, clock: Clock, items: list[tuple[float, str]]) -> None:
        self._clock = clock
        self._items = deque(sorted(items))
        self.gathered_s: list[float] = []
        self.answer_s: Callable[[], float | None] = lambda: None
        """When a worker answers, which ends gathering."""

    def __len__(self) -> int:
        return sum(at_s <= self._clock.now_s for at_s, _ in self._items)

    def answer_at(self, place: int) -> None:
        self._items.insert(place, (self._items[place][0], "answer"))

    def gather(self, most_s: float) -> None:
        self.gathered_s.append(most_s)
        until_s, answer_s = self._clock.now_s + most_s, self.answer_s()
        if answer_s is not None and answer_s > self._clock.now_s:
            until_s = min(until_s, answer_s)
        self._clock.now_s = until_s + 1e-6  # nobody wakes up too early

    def take(self, timeout_s: float = 0.0) -> str | None:
        until_s = self._clock.now_s + max(timeout_s, 1e-4)
        if self._items and self._items[0][0] <= until_s:
            at_s, item = self._items.popleft()
            self.arrived_s = at_s
            self._clock.now_s = max(self._clock.now_s, at_s)
            return item
        self._clock.now_s = until_s
        return None


class Conductor:
    """Takes states and runs rounds that last `round_s`, beginning at second 100."""

    def __init__(
        self,
        clock: Clock,
        *,
        states_s: list[float],
        end_s: float,
        round_s: float = 0.1,
        rate_hz: float = 2.0,
        handling: Callable[[float], None] = lambda _: None,
        one_of: int = 1,
        settled_s: float = 0.0,
        received: bool = False,
        wants_rounds: bool = True,
        towards_vehicle: bool = False,
        takers: bool = True,
    ) -> None:
        self._takers = takers
        """Whether anybody will complete a round that is open."""
        self._received = received
        """Whether a state counts as received when it came, not when it is handled."""
        self._clock = clock
        self._round_s = round_s
        self._handling = handling
        self._open_until_s: float | None = None
        config = SimpleNamespace(rate_hz=rate_hz, speed=1.0, vehicle_id="car")
        self.plan = SimpleNamespace(config=config, towards_vehicle=towards_vehicle)
        self.bus = MemoryBus()
        self.mailbox = Mailbox(clock, [(100 + s, "state") for s in states_s] + [(100 + end_s, "z")])
        self.mailbox.answer_s = lambda: self._open_until_s
        self.intake = SimpleNamespace(states=0, latest=None, end=None)
        self._settled_s = settled_s
        self.tuning = SimpleNamespace(parameters=self)
        self.rounds, self.pace = self, SimpleNamespace(now=Pace(64, one_of))
        self.mission = SimpleNamespace(wants_rounds=wants_rounds)
        self.tally = RoundTally()
        self.started_s: list[float] = []
        self.seeds_s: list[float] = []
        """When the states came from which rounds were started."""
        self.dropped_s, self.watched_s, self.changes_made_s = (list[float]() for _ in range(3))

    @property
    def open(self) -> bool:
        return self._open_until_s is not None and self._clock.now_s < self._open_until_s

    @property
    def settled(self) -> bool:
        return self._clock.now_s >= 100.0 + self._settled_s

    def next_is_due(self) -> None:
        if not self._takers or self._clock.now_s - 100 - self.started_s[-1] > 10.0:
            self.dropped_s.append(self._clock.now_s - 100)
            self._open_until_s = None

    def handle(self, item: str) -> None:
        self._handling(self._clock.now_s - 100)
        if item == "state":
            self.intake.states += 1
            at_s = self.mailbox.arrived_s if self._received else self._clock.now_s
            state = SimpleNamespace(stamp_ns=0)
            self.intake.latest = SimpleNamespace(receipt_mono_ns=at_s * 1e9, state=state)
        elif item == "z":
            self.intake.end = SimpleNamespace(stamp_ns=0)

    def make_changes(self) -> None:
        self.changes_made_s.append(self._clock.now_s - 100)

    def watch_telemetry(self, mono_ns: int) -> None:
        self.watched_s.append(mono_ns * 1e-9 - 100)

    def start_round(self) -> bool:
        self.started_s.append(self._clock.now_s - 100)
        self.seeds_s.append(self.intake.latest.receipt_mono_ns / 1e9 - 100)
        self._open_until_s = self._clock.now_s + self._round_s
        self.tally.run += 1
        return True


def every(period_s: float, until_s: float, *, start_s: float = 0.0) -> list[float]:
    return [start_s + k * period_s for k in range(int((until_s - start_s) / period_s))]
