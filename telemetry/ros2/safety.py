"""What may go towards a vehicle, and when no more: two switches, bounds, rates, a dead man.

Pure: time comes in as monotonic nanoseconds of one host. `VehicleGate` lets nothing through unless
both switches are on, the orchestrator's word is fresh and the link is up; once it has shut it
stays shut: only a new drive with both switches opens another.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from foretwin.contracts.towards_vehicle import GateReason, GateState, VehicleCommand

DEAD_MAN_NS = 150_000_000
"""Without a fresh word of the orchestrator for so long, nothing goes out any more."""
_FROM_THE_FUTURE_NS = 1_000_000
"""A word sent later than now, by the same host's clock, is none."""


class GateTrouble(NamedTuple):
    """What keeps the gate from opening: a word of the table, and all of it."""

    reason: GateReason
    text: str


class CommandLimits(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Bounds of a command: values, how fast they may change, and how often one is sent."""

    max_speed_mps: float = 8.0
    """The most that is asked for; at or above it, and where the speed is not known, nothing is
    accelerated."""
    max_accel_mps2: float = 1.5
    """The most that is asked for."""
    max_decel_mps2: float = 4.0
    """The most that is asked for."""
    max_jerk_mps3: float = 4.0
    """How fast the acceleration may change."""
    max_tire_angle_rad: float = 0.5
    """To either side."""
    max_tire_rate_radps: float = 0.3
    """How fast the tyre angle may change."""
    max_rate_hz: float = 50.0
    """How often a command is sent at most."""

    def validate(self) -> CommandLimits:
        """Return self; raises ValueError naming the first limit that is not positive and finite."""
        for name in CommandLimits.__struct_fields__:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value}: positive and finite")
        return self


class VehicleGate:
    """Decides over each command; asked with the time of every look at it.

    `config_on` is the mapping's switch, `flag_on` the command line's; `trouble` says what else, at
    a time, keeps it from opening and shuts it. `counts` says what was held back and why, and what
    was bounded.
    """

    def __init__(
        self,
        limits: CommandLimits,
        *,
        config_on: bool,
        flag_on: bool,
        trouble: Callable[[int], GateTrouble | None] = lambda _: None,
    ) -> None:
        self.why: str
        self.reason: GateReason
        self._limits, self._trouble = limits.validate(), trouble
        self._state: GateState = "waiting" if config_on and flag_on else "off"
        self._last_heartbeat_ns: int | None = None
        self._last_sent: tuple[int, VehicleCommand] | None = None
        self.why, self.reason = "both switches are on", "no word yet"
        if self._state == "off":
            self.why, self.reason = _missing_switch(config_on), "switched off"
        self.counts: Counter[str] = Counter()

    @property
    def state(self) -> GateState:
        """off: a switch is missing; waiting: no word yet; open; shut: for good."""
        return self._state

    def heartbeat(self, sent_ns: int, *, now_ns: int) -> None:
        """Take a heartbeat of the orchestrator, sent at `sent_ns`; one that is too old is none."""
        self.look(now_ns=now_ns, link_up=True)
        if self._state not in ("waiting", "open"):
            return
        if not _is_fresh(sent_ns, now_ns):
            self.counts["word too old or not yet due"] += 1
            return
        if (trouble := self._trouble(now_ns)) is not None:
            self.reason, self.why = trouble
            self.counts["word before the car is ready"] += 1
            return
        self._state, self.reason, self.why = "open", "well", "both switches are on"
        self._last_heartbeat_ns = max(sent_ns, self._last_heartbeat_ns or sent_ns)

    def look(self, *, now_ns: int, link_up: bool) -> GateState:
        """Shut where the word is overdue or the link down; return the state at `now_ns`."""
        if self._state == "open":
            assert self._last_heartbeat_ns is not None
            if not link_up:
                self.shut(GateTrouble("link down", "the link is down"))
            elif not _is_fresh(self._last_heartbeat_ns, now_ns):
                why = f"no word of the orchestrator for {DEAD_MAN_NS / 1e6:.0f} ms"
                self.shut(GateTrouble("word overdue", why))
            elif (trouble := self._trouble(now_ns)) is not None:
                self.shut(trouble)
        return self._state

    def shut(self, trouble: GateTrouble) -> None:
        """Shut for good."""
        if self._state != "off":
            self._state, (self.reason, self.why) = "shut", trouble

    def admit(
        self,
        command: VehicleCommand,
        *,
        now_ns: int,
        link_up: bool,
        tire_angle_rad: float | None,
        speed_mps: float | None,
    ) -> VehicleCommand | None:
        """Return the command within its bounds, or None where nothing may be sent now.

        `tire_angle_rad` and `speed_mps` are what the vehicle measures now. The first command starts
        from that angle, so that nothing jumps; who obeys the acceleration alone has no other bound
        than that speed. A number that is not finite is refused and shuts the gate.
        """
        if self.look(now_ns=now_ns, link_up=link_up) != "open":
            return self._held("gate " + self._state)
        numbers = (command.tire_angle_rad, command.accel_mps2, command.speed_mps)
        if not all(math.isfinite(number) for number in numbers):
            self.shut(GateTrouble("command not finite", "a command that is not finite"))
            return self._held("not finite")
        if not _is_fresh(command.sent_mono_ns, now_ns):
            return self._held("command too old")
        limits = self._limits
        if self._last_sent is None:
            if tire_angle_rad is None or not math.isfinite(tire_angle_rad):
                return self._held("measured steering not known")
            if abs(tire_angle_rad) > limits.max_tire_angle_rad:
                return self._held("measured steering beyond its bound")
            before_tire, before_accel, passed_s = tire_angle_rad, 0.0, 1.0 / limits.max_rate_hz
        else:
            sent_ns, before = self._last_sent
            if (now_ns - sent_ns) * limits.max_rate_hz < 1e9:
                return self._held("too soon after the last")
            before_tire, before_accel = before.tire_angle_rad, before.accel_mps2
            # A pause gives no leave to jump.
            passed_s = min((now_ns - sent_ns) / 1e9, 0.1)
        wished_accel = command.accel_mps2
        if speed_mps is None or not abs(speed_mps) < limits.max_speed_mps:
            wished_accel = min(wished_accel, 0.0)
        bounded = msgspec.structs.replace(
            command,
            tire_angle_rad=_within(
                _near(command.tire_angle_rad, before_tire, limits.max_tire_rate_radps * passed_s),
                -limits.max_tire_angle_rad,
                limits.max_tire_angle_rad,
            ),
            accel_mps2=_within(
                _near(wished_accel, before_accel, limits.max_jerk_mps3 * passed_s),
                -limits.max_decel_mps2,
                limits.max_accel_mps2,
            ),
            speed_mps=_within(command.speed_mps, 0.0, limits.max_speed_mps),
        )
        self.counts["bounded" if bounded != command else "as asked"] += 1
        self._last_sent = (now_ns, bounded)
        return bounded

    def _held(self, reason: str) -> VehicleCommand | None:
        self.counts[reason] += 1
        return None


def _missing_switch(config_on: bool) -> str:
    if config_on:
        return "off: the command line lacks --towards-vehicle"
    return "off: the mapping lacks [towards_vehicle] enabled = true"


def _is_fresh(sent_ns: int, now_ns: int) -> bool:
    return -_FROM_THE_FUTURE_NS <= now_ns - sent_ns <= DEAD_MAN_NS


def _near(wished: float, before: float, most: float) -> float:
    return _within(wished, before - most, before + most)


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
