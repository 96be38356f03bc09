"""The gate towards a vehicle, whatever happens in whatever order."""

from __future__ import annotations

import itertools
import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.towards_vehicle import VehicleCommand
from foretwin.telemetry.ros2.safety import DEAD_MAN_NS, CommandLimits, GateTrouble, VehicleGate

LIMITS = CommandLimits()
MS = 1_000_000


def command(
    now_ns: int, tire: float = 0.0, accel: float = 0.0, speed: float = 1.0
) -> VehicleCommand:
    return VehicleCommand(
        stamp_ns=0, sent_mono_ns=now_ns, tire_angle_rad=tire, accel_mps2=accel, speed_mps=speed
    )


def admit(  # type: ignore[no-untyped-def]
    gate: VehicleGate,
    wished: VehicleCommand,
    now_ns: int,
    link_up: bool = True,
    tire: float | None = 0.0,
    speed: float | None = 1.0,
):
    return gate.admit(wished, now_ns=now_ns, link_up=link_up, tire_angle_rad=tire, speed_mps=speed)


def open_gate(now_ns: int = 0) -> VehicleGate:
    gate = VehicleGate(LIMITS, config_on=True, flag_on=True)
    gate.heartbeat(now_ns, now_ns=now_ns)
    return gate


@pytest.mark.parametrize(("config_on", "flag_on"), [(False, False), (True, False), (False, True)])
def test_nothing_without_both_switches(config_on: bool, flag_on: bool) -> None:
    gate = VehicleGate(LIMITS, config_on=config_on, flag_on=flag_on)
    gate.heartbeat(0, now_ns=0)
    assert gate.state == "off"
    assert admit(gate, command(0), 0) is None
    assert gate.reason == "switched off"
    assert "--towards-vehicle" in gate.why or "enabled" in gate.why


def test_nothing_before_the_first_word() -> None:
    gate = VehicleGate(LIMITS, config_on=True, flag_on=True)
    assert admit(gate, command(0), 0) is None
    gate.heartbeat(0, now_ns=0)
    assert admit(gate, command(0), 0) is not None


def test_what_else_is_wrong_keeps_it_from_opening_and_shuts_it() -> None:
    outside = GateTrouble("outside the fence", "the car is outside its fence")
    wrong: list[GateTrouble | None] = [outside]
    gate = VehicleGate(LIMITS, config_on=True, flag_on=True, trouble=lambda _: wrong[0])
    gate.heartbeat(0, now_ns=0)
    assert (gate.state, gate.why) == ("waiting", "the car is outside its fence")
    assert gate.counts == {"word before the car is ready": 1}
    wrong[0] = None
    gate.heartbeat(MS, now_ns=MS)
    assert (gate.look(now_ns=MS, link_up=True), gate.why) == ("open", "both switches are on")
    assert gate.reason == "well"
    wrong[0] = outside
    assert gate.look(now_ns=2 * MS, link_up=True) == "shut"
    wrong[0] = None
    gate.heartbeat(3 * MS, now_ns=3 * MS)
    assert (gate.state, gate.reason, gate.why) == ("shut", *outside)


@pytest.mark.parametrize("begin_ns", [0, 10 * 10**9])
def test_no_command_goes_out_sooner_than_its_rate_after_the_last(begin_ns: int) -> None:
    """Fifty a second, whatever the clock says."""
    gate = open_gate(begin_ns)
    for after_ns, goes in ((0, True), (19_999_999, False), (20 * MS, True), (39 * MS, False)):
        now = begin_ns + after_ns
        assert (admit(gate, command(now), now) is not None) is goes
    assert gate.counts["too soon after the last"] == 2


def test_what_has_shut_stays_shut() -> None:
    gate = open_gate()
    late = DEAD_MAN_NS + 1
    assert gate.look(now_ns=DEAD_MAN_NS, link_up=True) == "open"
    assert gate.look(now_ns=late, link_up=True) == "shut"
    gate.heartbeat(late, now_ns=late)
    assert admit(gate, command(late), late) is None
    assert "150 ms" in gate.why


def test_a_word_that_comes_late_does_not_bridge_the_gap() -> None:
    """A gateway that was stopped finds words in its mailbox that were in time when sent."""
    gate = open_gate()
    gate.heartbeat(100 * MS, now_ns=400 * MS)
    assert gate.state == "shut"


def test_a_stale_word_and_one_from_the_future_open_nothing_and_are_counted() -> None:
    gate = VehicleGate(LIMITS, config_on=True, flag_on=True)
    now = 10 * DEAD_MAN_NS
    gate.heartbeat(now - DEAD_MAN_NS - 1, now_ns=now)
    gate.heartbeat(now + 2 * MS, now_ns=now)
    assert gate.state == "waiting"
    assert gate.counts == {"word too old or not yet due": 2}
    gate.heartbeat(now - DEAD_MAN_NS, now_ns=now)
    assert gate.state == "open"


@pytest.mark.parametrize("speed", [LIMITS.max_speed_mps, -9.0, 30.0, math.nan, None])
def test_a_car_that_is_too_fast_or_whose_speed_is_not_known_is_not_accelerated(
    speed: float | None,
) -> None:
    gate, sent, now = open_gate(), [], 0
    for number in range(60):
        now = number * 20 * MS
        gate.heartbeat(now, now_ns=now)
        measured = LIMITS.max_speed_mps - 0.01 if number < 25 else speed
        sent.append(admit(gate, command(now, accel=9.0), now, speed=measured).accel_mps2)
    assert sent[24] == LIMITS.max_accel_mps2, "for half a second it is slow enough"
    assert all(later <= before for before, later in itertools.pairwise(sent[24:]))
    assert sent[-1] == 0.0
    now += 20 * MS
    assert admit(gate, command(now, accel=-9.0), now, speed=speed).accel_mps2 < 0.0, "it may brake"


DEFAULTS = {
    "max_speed_mps": 8.0, "max_accel_mps2": 1.5, "max_decel_mps2": 4.0, "max_jerk_mps3": 4.0,
    "max_tire_angle_rad": 0.5, "max_tire_rate_radps": 0.3, "max_rate_hz": 50.0,
}  # fmt: skip


def test_the_bounds_where_a_mapping_says_nothing() -> None:
    """Numbers that a person relies on: whoever changes one changes it here too."""
    assert msgspec.structs.asdict(LIMITS) == DEFAULTS


def test_after_a_pause_a_command_jumps_no_further_than_after_a_tenth_of_a_second() -> None:
    gate, now = open_gate(), 0
    assert admit(gate, command(now), now) is not None
    for _ in range(20):
        now += 100 * MS
        gate.heartbeat(now, now_ns=now)
    out = admit(gate, command(now, tire=3.0, accel=-100.0), now)
    assert out is not None
    assert out.tire_angle_rad == pytest.approx(0.1 * LIMITS.max_tire_rate_radps)
    assert out.accel_mps2 == pytest.approx(-0.1 * LIMITS.max_jerk_mps3)


def test_a_lost_link_shuts() -> None:
    gate = open_gate()
    assert admit(gate, command(0), 0, link_up=False) is None
    assert admit(gate, command(0), 0) is None


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["tire_angle_rad", "accel_mps2", "speed_mps"])
def test_a_number_that_is_none_shuts(field: str, number: float) -> None:
    gate = open_gate()
    assert admit(gate, msgspec.structs.replace(command(0), **{field: number}), 0) is None
    assert gate.state == "shut"


def test_the_first_command_starts_from_the_measured_angle() -> None:
    gate = open_gate()
    wished = command(0, tire=-0.4)
    assert admit(gate, wished, 0, tire=None) is None
    first = admit(gate, wished, 0, tire=0.2)
    assert first is not None
    assert first.tire_angle_rad == pytest.approx(0.2 - LIMITS.max_tire_rate_radps / 50.0)


@pytest.mark.parametrize(
    ("ago_ns", "admitted"),
    [(0, True), (DEAD_MAN_NS, True), (DEAD_MAN_NS + 1, False), (-MS, True), (-MS - 1, False)],
)
def test_a_command_is_as_fresh_as_the_word_must_be(ago_ns: int, admitted: bool) -> None:
    now = 10 * DEAD_MAN_NS
    gate = open_gate(now)
    assert (admit(gate, command(now - ago_ns), now) is not None) is admitted
    assert gate.state == "open", "a replayed command shuts nothing"
    assert gate.counts["command too old"] == (not admitted)


@pytest.mark.parametrize("measured", [0.51, -0.51, math.nan, math.inf, None])
def test_no_first_command_from_an_angle_beyond_the_bound_or_unknown(measured: float | None) -> None:
    gate = open_gate()
    sent = admit(gate, command(0), 0, tire=measured)
    assert sent is None
    within = admit(gate, command(0), 0, tire=0.5)
    assert within is not None
    assert within.tire_angle_rad == pytest.approx(0.5 - LIMITS.max_tire_rate_radps / 50.0)


@pytest.mark.parametrize("wished", [-30.0, 30.0])
def test_who_asks_for_too_much_for_long_gets_the_bound_and_no_more(wished: float) -> None:
    """Bounds of change alone let any value through in the end."""
    gate = open_gate()
    for tick in range(150):
        now = tick * 20 * MS
        gate.heartbeat(now, now_ns=now)
        sent = admit(gate, command(now, tire=wished, accel=wished, speed=wished), now)
        assert sent is not None
    assert sent.accel_mps2 == (-4.0 if wished < 0.0 else 1.5)
    assert sent.tire_angle_rad == math.copysign(0.5, wished)
    assert sent.speed_mps == (0.0 if wished < 0.0 else 8.0)


@pytest.mark.parametrize("name", LIMITS.__struct_fields__)
def test_limits_are_positive(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        msgspec.structs.replace(LIMITS, **{name: 0.0}).validate()


NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-2.0, 2.0)
STEPS = st.tuples(
    st.integers(0, 200 * MS),  # passes first
    st.sampled_from(["word", "stale word", "command", "link down", "command", "word"]),
    NUMBERS,
    NUMBERS,
    NUMBERS,
)


@settings(max_examples=300, deadline=None)
@given(
    st.booleans(),
    st.booleans(),
    st.floats(-0.5, 0.5),
    st.lists(st.tuples(st.integers(0, 60 * MS), STEPS), max_size=40),
)
def test_never_outside_the_bounds_and_never_after_the_dead_mans_time(
    config_on: bool,
    flag_on: bool,
    measured: float,
    steps: list[tuple[int, tuple[int, str, float, float, float]]],
) -> None:
    gate = VehicleGate(LIMITS, config_on=config_on, flag_on=flag_on)
    now, word, down = 1, None, False
    sent: list[tuple[int, VehicleCommand]] = []
    silent = False
    for short, (long, what, tire, accel, speed) in steps:
        now += long if tire > 1.0 else short
        silent = silent or (word is not None and now - word > DEAD_MAN_NS)
        if what == "word":
            gate.heartbeat(now, now_ns=now)
            word = now
        elif what == "stale word":
            gate.heartbeat(now - DEAD_MAN_NS - 1, now_ns=now)
        elif what == "link down" and accel > 1.0:
            gate.look(now_ns=now, link_up=False)
            down = down or word is not None
        elif what == "command":
            wished = command(now, tire, accel, speed)
            out = admit(gate, wished, now, tire=measured)
            if out is not None:
                assert config_on
                assert flag_on
                assert word is not None
                assert not silent
                assert not down
                sent.append((now, out))
    for at, out in sent:
        assert abs(out.tire_angle_rad) <= LIMITS.max_tire_angle_rad
        assert -LIMITS.max_decel_mps2 <= out.accel_mps2 <= LIMITS.max_accel_mps2
        assert 0.0 <= out.speed_mps <= LIMITS.max_speed_mps
        assert at > 0
    for (before, old), (after, new) in itertools.pairwise(sent):
        passed_s = (after - before) / 1e9
        assert passed_s * LIMITS.max_rate_hz >= 1.0 - 1e-9
        tire_step = abs(new.tire_angle_rad - old.tire_angle_rad)
        assert tire_step <= LIMITS.max_tire_rate_radps * passed_s + 1e-9
        accel_step = abs(new.accel_mps2 - old.accel_mps2)
        assert accel_step <= LIMITS.max_jerk_mps3 * passed_s + 1e-9
