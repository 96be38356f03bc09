"""The table of channels: every key has its place, its id and one meaning."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.keys import (
    CHANNELS,
    PREFIX,
    TELEMETRY_CHANNELS,
    alive_key,
    key,
    process_of_alive_key,
    run_of_alive_key,
    vehicle_of_key,
    vehicle_that_joins,
)

COVERS = ("foretwin.contracts.bounds", "foretwin.contracts.channel")

IDS = {"vehicle": "ego", "run": "r1", "process": "w0"}


@pytest.mark.parametrize("channel", CHANNELS.values(), ids=CHANNELS.keys())
def test_every_key_lies_under_the_prefix_with_an_id(channel: object) -> None:
    assert channel.key.startswith(f"{PREFIX}/")
    assert "{vehicle}" in channel.key or "{run}" in channel.key
    assert issubclass(channel.kind, msgspec.Struct)
    assert channel.rate_hz is None or channel.rate_hz > 0
    assert (channel.reply is not None) == channel.qos.block


def test_no_two_channels_share_a_key() -> None:
    assert PREFIX == "foretwin/v1"
    assert len({key(name, **IDS) for name in CHANNELS}) == len(CHANNELS)


def test_what_a_vehicle_sends() -> None:
    assert TELEMETRY_CHANNELS == (
        "gnss",
        "imu",
        "speed",
        "heading",
        "steering",
        "control",
        "plan",
        "status",
        "objects",
        "signals",
        "end",
    )


def test_how_often_each_is_said() -> None:
    """What is kept for who missed it is as much as is said at these rates."""
    by_rate: dict[float, set[str]] = {}
    for name, channel in CHANNELS.items():
        if channel.rate_hz is not None:
            by_rate.setdefault(channel.rate_hz, set()).add(name)
    assert by_rate == {
        100: {"imu"},
        50: {
            "speed",
            "steering",
            "control",
            "state",
            "other_vehicles",
            "vehicle_command",
            "sensed_imu",
        },
        20: {"authority", "virtual_traffic", "surroundings", "radar_list"},
        10: {
            "gnss",
            "heading",
            "plan",
            "status",
            "objects",
            "mirror",
            "virtual_objects",
            "lights",
            "point_cloud",
            "camera_image",
            "sensed_gnss",
            "real_cloud",
        },
        8: {"comparison"},
        5: {"injection", "progress"},
        4: {"gap", "sibling"},
        2: {"use_course", "job", "round", "plan_comparison", "worker_status"},
        1: {"signals", "route", "clock", "vehicle_clock", "join"},
        0.2: {"identification"},
    }


def test_only_questions_wait_and_what_a_car_says_is_kept_for_who_missed_it() -> None:
    for name, channel in CHANNELS.items():
        asked = channel.reply is not None
        at_once = asked or name in ("planner_scene", "planned_motions", "planner_joined")
        assert (channel.qos.block, channel.qos.express) == (asked, at_once)
        kept_s = 20.0 if name in (*TELEMETRY_CHANNELS, "state", "injection") else 0.0
        assert channel.qos.kept_s == kept_s


@pytest.mark.parametrize(
    ("name", "server"),
    [("job", "worker"), ("build", "worker"), ("info", "car"), ("set", "orchestrator"),
     ("join", "orchestrator"),
     ("world_file", "orchestrator"), ("gnss", None), ("planner_scene", None)],
)  # fmt: skip
def test_a_question_is_answered_by_whom_its_key_names(name: str, server: str | None) -> None:
    assert CHANNELS[name].server == server


def test_keys_in_full() -> None:
    assert key("gnss", vehicle="ego") == "foretwin/v1/vehicle/ego/telemetry/gnss"
    assert key("job", run="r1", process="w0") == "foretwin/v1/run/r1/worker/w0/job"
    assert key("job", run="r1", process="*") == "foretwin/v1/run/r1/worker/*/job"
    assert alive_key(run="r1", process="*") == "foretwin/v1/run/r1/alive/*"


@given(process=st.from_regex(r"[A-Za-z0-9_.-]{1,20}", fullmatch=True))
def test_the_process_comes_back_out_of_its_liveliness_key(process: str) -> None:
    alive = alive_key(run="r1", process=process)
    assert (run_of_alive_key(alive), process_of_alive_key(alive)) == ("r1", process)


def test_the_vehicle_comes_back_out_of_its_keys() -> None:
    for name in (*TELEMETRY_CHANNELS, "state", "info"):
        assert vehicle_of_key(key(name, vehicle="ego")) == "ego"
    assert vehicle_that_joins(key("join", run="r1", vehicle="second")) == "second"


@given(
    word=st.text(max_size=8),
    bad=st.sampled_from(["/", "*", "$", "#", "?", "{", "}", " "]),
    end=st.text(min_size=1, max_size=8),
)
def test_ids_are_one_word(word: str, bad: str, end: str) -> None:
    with pytest.raises(ValueError, match="must be one word"):
        key("gnss", vehicle=word + bad + end)


def test_an_empty_or_missing_id_is_named() -> None:
    with pytest.raises(ValueError, match="vehicle id ''"):
        key("gnss", vehicle="")
    with pytest.raises(ValueError, match="needs an id for 'run'"):
        key("round", vehicle="ego")


def test_an_unknown_channel_names_the_known_ones() -> None:
    with pytest.raises(KeyError, match=r"unknown channel 'gps'; known: active_world, .*gnss"):
        key("gps", vehicle="ego")


@pytest.mark.parametrize("name", [*TELEMETRY_CHANNELS, "state", "route", "authority"])
def test_what_comes_often_is_small(name: str) -> None:
    assert CHANNELS[name].most_bytes == 2**20


@pytest.mark.parametrize("name", ["job", "round", "mirror"])
def test_results_may_be_large(name: str) -> None:
    assert CHANNELS[name].most_bytes == 32 * 2**20
