"""Sessions are set as docs/bus.md says, routers and clients, live and in lock step."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.campaign import TlsFiles
from foretwin.contracts.process_setup import Admission, BusSetup
from foretwin.contracts.zenoh_config import tls_settings, zenoh_config
from tests.test_layout import ROOT

ENDPOINT = "tcp/127.0.0.1:7447"
TX = "transport/link/tx"
TLS = TlsFiles(authority="ca.pem", certificate="car.pem", key="car.key")


def told(name: str, *, router: bool = False, **setup: Any) -> Any:
    config = zenoh_config(BusSetup(endpoint=ENDPOINT, **setup), router=router)
    return json.loads(config.get_json(name))


def documented() -> dict[str, str]:
    """What the page says of each setting, by its name."""
    found = {}
    for line in (ROOT / "docs" / "bus.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `") and "/" in cells[0]:
            found |= {name.strip("` "): cells[1] for name in cells[0].split(",")}
    return found


@pytest.mark.parametrize("name", ["scouting/multicast/enabled", "scouting/gossip/enabled"])
@pytest.mark.parametrize("router", [False, True])
def test_nobody_is_looked_for(name: str, router: bool) -> None:
    assert told(name, router=router) is False
    assert documented()[name] == "`false`"


@pytest.mark.parametrize(
    ("name", "set_to", "page"),
    [
        ("scouting/delay", 0, "`0`"),
        ("timestamping/enabled", True, "`true`"),
        ("transport/shared_memory/enabled", False, "`false`"),
        ("connect/timeout_ms", 5000, "`5000`"),
        (f"{TX}/lease", 3000, "`3000` ms"),
        (
            "connect/retry",
            {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 2.0},
            "100 ms, then every 200 ms",
        ),
    ],
)
def test_a_client_is_set_as_the_page_says(name: str, set_to: Any, page: str) -> None:
    assert told(name) == set_to
    assert documented()[name] == page


def test_a_burst_of_each_class_in_use_finds_room() -> None:
    sizes = told(f"{TX}/queue/size")
    assert documented()[f"{TX}/queue/size"] == "16 for the classes in use"
    assert {name for name, size in sizes.items() if size == 16} == {
        "real_time", "interactive_high", "data_high", "data",
    }  # fmt: skip
    assert {name: size for name, size in sizes.items() if size != 16} == {
        "control": 2, "interactive_low": 4, "data_low": 2, "background": 2,
    }  # fmt: skip


def test_where_nothing_may_be_lost_who_stands_still_is_waited_for() -> None:
    waits = f"{TX}/queue/congestion_control/block/wait_before_close"
    assert told(waits, lossless=True) == 600_000_000
    assert documented()[waits] == "lock step: 10 minutes"
    assert told(waits) < 600_000_000
    assert told(f"{TX}/lease", lossless=True) == 60_000


def test_a_router_listens_and_a_client_connects() -> None:
    places = [
        [told(f"{what}/endpoints", router=router) for what in ("listen", "connect")]
        for router in (True, False)
    ]
    assert places == [[[ENDPOINT], []], [[], [ENDPOINT]]]
    assert (told("mode", router=True), told("mode")) == ("router", "client")


def test_a_client_shows_its_password_and_a_router_asks_for_it(tmp_path: Path) -> None:
    shown, users = tmp_path / "worker-w0.json", tmp_path / "users"
    shown.write_text(json.dumps({"user": "worker-w0", "password": "secret"}), encoding="utf-8")
    users.write_text("worker-w0:secret\n", encoding="utf-8")
    shown.chmod(0o600)
    client = told("transport/auth/usrpwd", credentials=str(shown))
    assert (client["user"], client["password"]) == ("worker-w0", "secret")

    rules = '{"enabled": true, "default_permission": "deny"}'
    admits = Admission(access=rules, users_file=str(users))
    assert told("transport/auth/usrpwd", router=True, admits=admits)["dictionary_file"] == str(
        users
    )
    assert told("access_control", router=True, admits=admits)["default_permission"] == "deny"
    # Those known by certificates have no passwords, and a client decides over nobody.
    named = told("transport/auth/usrpwd", router=True, admits=Admission(access=rules))
    assert named["dictionary_file"] is None
    assert told("access_control", admits=admits)["enabled"] is False


@pytest.mark.parametrize(("router", "side"), [(True, "listen"), (False, "connect")])
def test_over_a_network_both_sides_are_known(router: bool, side: str) -> None:
    assert tls_settings(TLS, router=router) == {
        "transport/link/protocols": ["tls"],
        "transport/link/tls": {
            "root_ca_certificate": "ca.pem",
            f"{side}_certificate": "car.pem",
            f"{side}_private_key": "car.key",
            "enable_mtls": True,
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        },
    }
    assert told("transport/link/protocols", router=router, tls=TLS) == ["tls"]
    assert told("transport/link/protocols", router=router) != ["tls"]
