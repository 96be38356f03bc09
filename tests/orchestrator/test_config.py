"""The configuration: what is read, what flags override, what is refused and how."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.siblings import Siblings
from foretwin.orchestrator.config import ConfigError, DriveConfig
from foretwin.orchestrator.config_file import load_config, parse_speed

COVERS = (
    "foretwin.orchestrator.config_file",
    "foretwin.orchestrator.other_vehicle_config",
    "foretwin.orchestrator.settings",
)


def test_flags_lie_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text('map = "town.osm"\nlog = "drive.gpx"\nfutures = 32\nspeed = "max"\n')
    config = load_config(file, {"futures": 16, "rate_hz": None})
    assert (config.futures, config.map, config.rate_hz) == (16, "town.osm", 2.0)
    assert config.lock_step


def test_no_file_and_no_flags_is_the_embedded_drive() -> None:
    config = load_config(None, {})
    assert config == DriveConfig()
    assert config.resolved_source == "standin"


@pytest.mark.parametrize(
    ("flags", "named"),
    [
        ({"workers": 0}, "--workers 0"),
        ({"least_futures": 0}, "--least-futures 0"),
        ({"futures": 8, "least_futures": 9}, "--least-futures 9: 1 to --futures, which is 8"),
        ({"seed": -1}, "--seed -1: 0 to 9223"),
        ({"seed": 2**70}, "--seed 1180591620717411303424: 0 to 9223"),
        ({"rate_hz": 0.0}, "--rate 0.0"),
        ({"speed": "fast"}, "--speed fast"),
        ({"speed": -1.0}, "--speed -1.0"),
        ({"log": "a", "map": "a", "start_s": 5.0, "end_s": 4.0}, "--end 4.0"),
        ({"route": "from-log"}, "--log FILE"),
        ({"log": "a.gpx"}, "--map FILE"),
        ({"map": "a.osm"}, "--log FILE"),
        ({"view": "hologram"}, "--view hologram: one of"),
        ({"siblings": "ode"}, "--siblings ode: one of gazebo, multibody, off"),
        ({"virtual_traffic": "none"}, "--virtual-traffic none: one of model"),
        ({"ros2": "autoware"}, "--source live"),
        ({"ros2": "autoware", "source": "live", "speed": "max"}, "--speed max"),
        ({"source": "live", "map": "a", "speed": "max"}, "--speed max: not of --source live"),
        ({"source": "live", "map": "a", "end_s": 3.0}, "--end 3.0: not of --source live"),
        ({"source": "standin", "log": "a", "map": "a"}, "--source standin: takes no --log"),
        ({"source": "live", "log": "a", "map": "a"}, "--source live: takes no --log"),
        ({"start_s": 5.0}, "--start 5.0: needs --log FILE"),
        ({"standin_plan_shift_m": float("nan")}, "standin_plan_shift_m nan: a finite number"),
        ({"endpoint": "foo"}, "endpoint 'foo': PROTOCOL/ADDRESS"),
        ({"endpoint": "tcp/127.0.0.1:7447"}, "whoever reaches it may speak as the car"),
        ({"insecure": True}, "--insecure: needs an endpoint"),
        ({"tuning": "maybe"}, "--tuning maybe: one of apply, off, report"),
        ({"towards_vehicle": True, "source": "live"}, "--towards-vehicle needs --ros2"),
    ],
)
def test_what_cannot_be_used_is_named_in_one_line(flags: dict[str, object], named: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(None, flags)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_setting_lists_the_known_ones(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text("futurs = 3\n")
    with pytest.raises(
        ConfigError,
        match=r"line 1: unknown key 'futurs'; did you mean futures\? one of map, .*futures",
    ):
        load_config(file, {})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rate_hz = nan", "line 1: rate_hz nan: above 0, at most 50"),
        ("workers = 0", "workers 0: 1 to"),
        ('speed = "fast"', "speed fast: a number above 0, or max"),
        ("radius_m = 5", "radius_m 5.0: 20 to 2000"),
        ("[follow]\naccel_mps2 = -1", "follow: accel_mps2"),
        ("[follow]\nx = 1", "line 2: unknown key 'x' in follow; one of accel_mps2, jerk_mps3"),
        ('[[vehicles]]\nid = "v"\nrole = "x"', "vehicles[0].role 'x': one of all, ghost"),
        ("futures = 'x'", "line 1: futures 'x': must be a whole number"),
    ],
)
def test_what_a_file_says_is_told_with_its_name_and_not_as_a_flag(
    text: str, said: str, tmp_path: Path
) -> None:
    file = tmp_path / "drive.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(file, {"horizon_s": 8.0})
    assert str(caught.value).startswith(f"{file}: ")
    assert said in str(caught.value)
    assert "--" not in str(caught.value)


def test_a_flag_over_a_file_is_told_as_the_flag(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text("rate_hz = 1.0\n")
    with pytest.raises(ConfigError, match=r"^--rate nan"):
        load_config(file, {"rate_hz": float("nan")})
    with pytest.raises(ConfigError, match=r"^--tuning maybe: one of"):
        load_config(file, {"tuning": "maybe"})


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.toml"):
        load_config(tmp_path / "nowhere.toml", {})


def test_speed_is_a_number_or_max() -> None:
    assert parse_speed("max") is None
    assert parse_speed("2.5") == 2.5


@pytest.mark.parametrize(
    ("settings", "fewest"),
    [
        ({}, 16),
        ({"futures": 3}, 1),
        ({"least_futures": 40}, 40),
        ({"least_futures": 64}, 64),
        ({"speed": "max"}, 64),
        ({"speed": "max", "least_futures": 8}, 64),
    ],
)
def test_how_few_futures_a_slow_machine_may_run(settings: dict[str, object], fewest: int) -> None:
    assert load_config(None, settings).fewest_futures == fewest


def test_no_file_can_hold_the_command_lines_switch_towards_the_vehicle(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text('source = "live"\nros2 = "autoware"\ntowards_vehicle = true\n')
    with pytest.raises(ConfigError, match="towards_vehicle: on the command line alone"):
        load_config(file, {"towards_vehicle": True})


def test_a_flag_names_the_engine_of_siblings_and_the_file_its_share(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text("[siblings]\nshare = 0.05\n")
    config = load_config(file, {"siblings": "multibody"})
    assert config.siblings == Siblings(engine="multibody", share=0.05)
    assert load_config(None, {}).siblings == Siblings(engine="off")
