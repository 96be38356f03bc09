"""SPAT as JSON: what it says, when it says nothing, and that it is read as it was meant."""

from __future__ import annotations

import datetime
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import SignalColour
from foretwin.contracts.lights import ShownLight
from foretwin.telemetry.ros2.spat import V2xMovement, colours_from_spat, spat_json

AT = datetime.datetime(2026, 1, 2, 3, 59, 58, 250_000, tzinfo=datetime.UTC)
WALL_NS = int(AT.timestamp()) * 10**9 + 250_000_000
MOVEMENTS = {"n4:g0": V2xMovement(12, 3), "n4:g1": V2xMovement(12, 4), "n9:g0": V2xMovement(13, 1)}


def spat(*lights: ShownLight, revision: int = 0) -> dict[str, Any]:
    text = spat_json(lights, MOVEMENTS, wall_ns=WALL_NS, revision=revision)
    assert text is not None
    found: dict[str, Any] = msgspec.json.decode(text)
    return found


def test_a_plan_tells_when_its_colours_end_and_a_light_that_was_set_does_not() -> None:
    found = spat(
        ShownLight(
            group_id="n4:g0", colour="green", why="plan", next_colour="amber", changes_in_s=2.4
        ),
        ShownLight(group_id="n9:g0", colour="red", why="set"),
        ShownLight(group_id="of nobody", colour="red", why="set"),
        revision=130,
    )
    minute = 24 * 60 + 3 * 60 + 59
    head = {"revision": 2, "moy": minute, "timeStamp": 58_250}
    assert found == {
        "timeStamp": minute,
        "intersections": [
            {
                "id": {"id": 12},
                **head,
                "status": "0400",
                "states": [
                    {
                        "movementName": "n4:g0",
                        "signalGroup": 3,
                        # Of the next hour: 58.2 s and 2.4 s after 59 min.
                        "state-time-speed": [
                            {
                                "eventState": "permissive-Movement-Allowed",
                                "timing": {"minEndTime": 6, "maxEndTime": 6},
                            }
                        ],
                    }
                ],
            },
            {
                "id": {"id": 13},
                **head,
                "status": "8000",
                "states": [
                    {
                        "movementName": "n9:g0",
                        "signalGroup": 1,
                        "state-time-speed": [{"eventState": "stop-And-Remain"}],
                    }
                ],
            },
        ],
    }


def test_without_a_light_that_has_a_number_nothing_is_said() -> None:
    light = ShownLight(group_id="of nobody", colour="red", why="set")
    assert spat_json((light,), MOVEMENTS, wall_ns=WALL_NS, revision=0) is None


COLOURS = st.sampled_from(("red", "amber", "green", "red_amber", "dark", "unknown"))


@given(st.lists(COLOURS, min_size=3, max_size=3))
def test_what_is_said_is_read(colours: list[SignalColour]) -> None:
    lights = [
        ShownLight(group_id=group, colour=colour, why="set")
        for group, colour in zip(MOVEMENTS, colours, strict=True)
    ]
    text = spat_json(lights, MOVEMENTS, wall_ns=WALL_NS, revision=0)
    assert text is not None
    assert colours_from_spat(text) == dict(zip(MOVEMENTS.values(), colours, strict=True))


def test_events_of_others_are_read_and_what_has_no_colour_is_left_out() -> None:
    events = ("protected-Movement-Allowed", "protected-clearance", "stop-Then-Proceed",
              "caution-Conflicting-Traffic")  # fmt: skip
    states = [
        {"signalGroup": number, "state-time-speed": [{"eventState": event}]}
        for number, event in enumerate(events, 1)
    ]
    text = msgspec.json.encode({"intersections": [{"id": {"id": 5}, "states": states}]}).decode()
    assert colours_from_spat(text) == {
        V2xMovement(5, 1): "green", V2xMovement(5, 2): "amber", V2xMovement(5, 3): "red",
    }  # fmt: skip


@pytest.mark.parametrize("text", ["", "{}", '{"intersections": [{"id": 5, "states": []}]}'])
def test_another_text_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="no SPAT"):
        colours_from_spat(text)


def test_a_message_is_as_large_as_the_standard_lets_it_be() -> None:
    """255 groups of each of 32 intersections, names of 63 letters."""
    movements = {f"{n:03}{'x' * 80}": V2xMovement(n // 300, n % 300) for n in range(40 * 300)}
    lights = [ShownLight(group_id=name, colour="red", why="plan") for name in movements]
    text = spat_json(lights, movements, wall_ns=WALL_NS, revision=127)
    assert text is not None
    found = msgspec.json.decode(text)["intersections"]
    assert [one["id"]["id"] for one in found] == list(range(32))
    assert {len(one["states"]) for one in found} == {255}
    assert {one["revision"] for one in found} == {127}
    assert found[0]["states"][7]["movementName"] == "007" + "x" * 60
    assert len(colours_from_spat(text)) == 32 * 255


def test_of_what_others_say_no_more_is_read() -> None:
    states = [{"signalGroup": n, "state-time-speed": [{"eventState": "dark"}]} for n in range(256)]
    crossings = [{"id": {"id": n}, "states": states} for n in range(33)]
    found = colours_from_spat(msgspec.json.encode({"intersections": crossings}).decode())
    assert found.keys() == {V2xMovement(n, group) for n in range(32) for group in range(255)}


def test_of_events_the_first_is_that_of_now_and_without_one_nothing_is_known() -> None:
    events = [{"eventState": "dark"}, {"eventState": "stop-And-Remain"}]
    states = [{"signalGroup": 1, "state-time-speed": events},
              {"signalGroup": 2, "state-time-speed": []}]  # fmt: skip
    text = msgspec.json.encode({"intersections": [{"id": {"id": 5}, "states": states}]}).decode()
    assert colours_from_spat(text) == {V2xMovement(5, 1): "dark"}


@pytest.mark.parametrize(
    ("wall_ns", "in_s", "tenths"),
    [(0, 0.0, 0), (0, 3599.94, 35_999), (0, 3599.96, 0), (199_999_999, 0.04, 1), (10**9, 7.36, 84)],
)
def test_a_change_is_told_in_tenths_of_a_second_of_the_hour(
    wall_ns: int, in_s: float, tenths: int
) -> None:
    light = ShownLight(group_id="n4:g0", colour="red", why="plan", changes_in_s=in_s)
    text = spat_json((light,), MOVEMENTS, wall_ns=wall_ns, revision=0)
    assert text is not None
    message = msgspec.json.decode(text)
    (event,) = message["intersections"][0]["states"][0]["state-time-speed"]
    assert event["timing"] == {"minEndTime": tenths, "maxEndTime": tenths}
    assert message["intersections"][0]["timeStamp"] == wall_ns // 10**6
    assert message["timeStamp"] == 0, "the first minute of 1970"
