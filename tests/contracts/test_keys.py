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
)

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


def test_keys_in_full() -> None:
    assert key("gnss", vehicle="ego") == "foretwin/v1/vehicle/ego/telemetry/gnss"
    assert key("job", run="r1", process="w0") == "foretwin/v1/run/r1/worker/w0/job"
    assert key("job", run="r1", process="*") == "foretwin/v1/run/r1/worker/*/job"
    assert alive_key(run="r1", process="*") == "foretwin/v1/run/r1/alive/*"


@given(process=st.from_regex(r"[A-Za-z0-9_.-]{1,20}", fullmatch=True))
def test_the_process_comes_back_out_of_its_liveliness_key(process: str) -> None:
    assert process_of_alive_key(alive_key(run="r1", process=process)) == process


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
