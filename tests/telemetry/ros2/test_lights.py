"""Lights between the World and the car's software: by their numbers, never back and forth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import SignalColour, SignalState
from foretwin.contracts.lights import ShownLight, ShownLights, WhyShown
from foretwin.contracts.towards_vehicle import Authority
from foretwin.telemetry.ros2.lights import LightIds
from foretwin.telemetry.ros2.mapping import MappingError, parse_mapping
from foretwin.telemetry.ros2.spat import V2xMovement, colours_from_spat, spat_json
from foretwin.telemetry.ros_messages.parts import STRING, TRAFFIC_LIGHTS, TRAFFIC_SIGNALS, typestore
from foretwin.telemetry.ros_messages.status import signals_from_ros
from tests.telemetry.autoware_messages import ros_from_signals
from tests.telemetry.ros2.gateway_ground import cdr, mapping_text
from tests.telemetry.ros2.test_gateway import Ground, S

COVERS = ("foretwin.telemetry.ros2.inwards",)

RECOGNISED, BY_V2X = "/perception/lights", "/v2x/spat_in"
TABLE = """
[[light]]
group = "n4:g0"
ids = [623]
ways = [580, 581]
signals = [1]
intersection = 12
signal_group = 1
[[light]]
group = "n4:g1"
ids = [627]
ways = [587]
"""
ROWS = f"""
[[in]]
topic = "{RECOGNISED}"
type = "{TRAFFIC_LIGHTS}"
channel = "signals"
[[in]]
topic = "{BY_V2X}"
type = "{STRING}"
channel = "signals"
[[out]]
topic = "/virtual/lights"
type = "{TRAFFIC_LIGHTS}"
source = "lights"
[[out]]
topic = "/virtual/lights_auto"
type = "{TRAFFIC_SIGNALS}"
source = "lights"
[[out]]
topic = "/v2x/spat_out"
type = "{STRING}"
source = "spat"
"""
OUT = ("/virtual/lights", "/virtual/lights_auto", "/v2x/spat_out")


class LightGround:
    """A gateway whose mapping has lights, both ways."""

    def __init__(self, *, enabled: bool = True, flag: bool = True, table: str = TABLE) -> None:
        self.ground = Ground(enabled=enabled, flag=flag, more=ROWS + table)
        self.heard = Mailbox(100)
        self.ground.bus.subscribe("signals", self.heard, vehicle="ego")

    def show(self, *lights: tuple[str, SignalColour, WhyShown], passed_ms: float = 30.0) -> None:
        """The orchestrator is in charge, and says what lights show."""
        ground = self.ground
        ground.orders.say(ground.bus, Authority(sent_mono_ns=ground.now_ns))
        ground.step()
        told = tuple(ShownLight(group_id=g, colour=c, why=w) for g, c, w in lights)
        shown = ShownLights(stamp_ns=5 * S, world_id="w", lights=told)
        ground.bus.publish("lights", shown, run="r")
        ground.step()
        ground.step(passed_ms)

    def out(self, topic: str = OUT[0]) -> list[list[tuple[str, str]]]:
        """Numbers and colours of each message that went out."""
        store = typestore()
        return [
            [
                (one.group_id, one.colour)
                for one in signals_from_ros(store.deserialize_cdr(data, TRAFFIC_LIGHTS), 0)
            ]
            for data in self.ground.foreign.on(topic)
        ]

    def recognise(self, number: int, colour: SignalColour) -> list[tuple[str, str]]:
        """The car's recognition says so; returns what is heard of it."""
        state = SignalState(stamp_ns=6 * S, group_id=str(number), colour=colour)
        data = typestore().serialize_cdr(ros_from_signals(6 * S, [state]), TRAFFIC_LIGHTS)
        self.ground.arrive(key_of(RECOGNISED, TRAFFIC_LIGHTS), bytes(data))
        return self.told()

    def v2x(self, text: str) -> list[tuple[str, str]]:
        self.ground.arrive(key_of(BY_V2X, STRING), cdr(STRING, data=text))
        return self.told()

    def told(self) -> list[tuple[str, str]]:
        found = []
        while (item := self.heard.take()) is not None:
            message = item.message()
            found.append((message.group_id, message.colour))
        return found


def key_of(topic: str, kind: str) -> str:
    package, _, name = kind.split("/")
    return f"0{topic}/{package}::msg::dds_::{name}_/RIHS01_x"


def test_plan_and_hand_go_out_by_their_numbers_and_nothing_that_came_in() -> None:
    lights = LightGround()
    lights.show(("n4:g0", "green", "plan"), ("n4:g1", "red", "set"), ("n9:g0", "red", "set"))
    lights.show(("n4:g0", "green", "heard"), ("n4:g1", "red", "learnt"))
    assert lights.out() == [[("623", "green"), ("627", "red")], []]
    auto = typestore().deserialize_cdr(lights.ground.foreign.on(OUT[1])[0], TRAFFIC_SIGNALS)
    assert [one.map_primitive_id for one in auto.signals] == [580, 581, 587]
    (spat,) = lights.ground.foreign.on(OUT[2])
    text = typestore().deserialize_cdr(spat, STRING).data
    assert colours_from_spat(text) == {V2xMovement(12, 1): "green"}


@pytest.mark.parametrize(("enabled", "flag"), [(False, False), (True, False), (False, True)])
def test_without_both_switches_no_light_goes_out(enabled: bool, flag: bool) -> None:
    lights = LightGround(enabled=enabled, flag=flag)
    lights.show(("n4:g0", "green", "plan"))
    assert [lights.ground.foreign.on(topic) for topic in OUT] == [[], [], []]


def test_where_the_gate_shuts_one_list_without_lights_goes_out_then_nothing() -> None:
    lights = LightGround()
    lights.show(("n4:g0", "green", "plan"))
    lights.ground.step(151.0)
    for _ in range(3):
        lights.show(("n4:g0", "green", "plan"))
    assert lights.out() == [[("623", "green")], []]
    assert [len(lights.ground.foreign.on(topic)) for topic in OUT] == [2, 2, 1]


def test_what_is_heard_steers_the_groups_of_the_world() -> None:
    lights = LightGround()
    assert lights.recognise(627, "red") == [("n4:g1", "red")]
    assert lights.recognise(999, "red") == [("999", "red")], "a map of the World's own numbers"
    light = ShownLight(group_id="x", colour="amber", why="plan")
    for movement, heard in ((V2xMovement(12, 1), [("n4:g0", "amber")]), (V2xMovement(12, 2), [])):
        text = spat_json((light,), {"x": movement}, wall_ns=S, revision=0)
        assert text is not None
        assert lights.v2x(text) == heard
    assert lights.v2x("no SPAT") == []
    assert lights.ground.gateway.report()["unused"] == {f"{BY_V2X}: no SPAT as JSON": 1}


def test_v2x_is_no_sign_of_life_of_the_car() -> None:
    lights = LightGround()
    light = ShownLight(group_id="x", colour="amber", why="plan")
    text = spat_json((light,), {"x": V2xMovement(12, 1)}, wall_ns=S, revision=0)
    assert text is not None
    lights.v2x(text)
    assert lights.ground.gateway.inwards.heard_mono_ns == 0
    lights.recognise(627, "red")
    assert lights.ground.gateway.inwards.heard_mono_ns == lights.ground.now_ns


def test_what_was_said_is_not_heard_where_it_comes_back() -> None:
    lights = LightGround()
    lights.show(("n4:g0", "green", "plan"))
    assert lights.recognise(623, "green") == [], "its echo"
    lights.show(("n4:g0", "amber", "plan"))
    assert lights.recognise(623, "green") == [], "an echo that is late"
    assert lights.recognise(623, "red") == [("n4:g0", "red")], "the real one"
    assert lights.recognise(627, "green") == [("n4:g1", "green")], "nothing was said of it"
    lights.ground.step(2100.0)
    assert lights.recognise(623, "green") == [("n4:g0", "green")]
    unused = lights.ground.gateway.report()["unused"]
    assert unused == {f"{RECOGNISED}: lights that show what we have said of them": 2}


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([TABLE, '[[light]]\ngroup = "n4:g1"\n'], "group n4:g1 stands twice"),
        ([TABLE, '[[light]]\ngroup = "h"\nids = [623]\n'], "id 623 stands twice"),
        (
            [TABLE, '[[light]]\ngroup = "h"\nintersection = 12\nsignal_group = 1\n'],
            r"V2X \(12, 1\) stands twice",
        ),
        (['[[light]]\ngroup = "h"\nintersection = 12\n'], "both or none"),
        (['[[light]]\ngroup = "h"\nintersection = 1\nsignal_group = 255\n'], "1 to 254"),
        (['[[light]]\ngroup = "h"\nintersection = 70000\nsignal_group = 1\n'], "0 to 65535"),
        (['[[light]]\ngroup = "h"\nways = [2147483648]\n'], "ways"),
        (['[[light]]\ngroup = "h"\nids = [0]\n'], "ids"),
        (['[[light]]\ngroup = ""\n'], "name of a group"),
        ([], "foretwin lights"),
        ([TABLE, ROWS.split("[[out]]")[0].replace(RECOGNISED, OUT[0])], "would come back"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(rows: Sequence[str], text: str) -> None:
    out = ROWS[ROWS.index("[[out]]") :]
    with pytest.raises(MappingError, match=text):
        parse_mapping(mapping_text(enabled=True, more=out + "".join(rows)), name="m.toml")


@pytest.mark.parametrize(
    ("named", "wrong"),
    [
        ({"ids": (1, 2**63 - 1)}, ""), ({"ids": (2**63,)}, "ids"), ({"ids": (7, 0)}, "ids"),
        ({"ways": (1, 2**31 - 1)}, ""), ({"ways": (2**31,)}, "ways"),
        ({"signals": (1, 2**31 - 1)}, ""), ({"signals": (0,)}, "signals"),
        ({"intersection": 0, "signal_group": 1}, ""),
        ({"intersection": 65535, "signal_group": 254}, ""),
        ({"intersection": -1, "signal_group": 1}, "intersection -1: 0 to 65535"),
        ({"intersection": 65536, "signal_group": 1}, "intersection 65536: 0 to 65535"),
        ({"intersection": 1, "signal_group": 0}, "signal_group 0: 1 to 254"),
        ({"intersection": 1, "signal_group": 255}, "signal_group 255: 1 to 254"),
        ({"signal_group": 1}, "both or none"),
    ],
)  # fmt: skip
def test_numbers_are_those_of_their_standards(named: dict[str, Any], wrong: str) -> None:
    light = LightIds(group="g", **named)
    if not wrong:
        light.validate()
        return
    with pytest.raises(ValueError, match=wrong):
        light.validate()
