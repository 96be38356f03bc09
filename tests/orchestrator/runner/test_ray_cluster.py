"""Ray, or that there is none; what needs Ray itself is in tests/system/test_sweep_on_ray.py."""

from __future__ import annotations

import logging
import socket
import subprocess
import sys

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.ports import free_port
from foretwin.orchestrator.runner.ray_cluster import _RaysWords, ray_cluster
from tests.sim_worker.test_seat import setup
from tests.test_layout import ROOT


def connected(address: str | None) -> None:
    with ray_cluster(setup(), address=address, processors=1):
        raise AssertionError("nobody is there")


def test_without_ray_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(
        UserError, match=r"^--engine ray needs Ray, .*pip install 'foretwin\[ray\]'"
    ):
        connected(None)


@pytest.mark.parametrize("address", ["junk", "host:port", ":6379", "", "1.2.3.4:"])
def test_an_address_that_is_none_is_refused(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", object())
    with pytest.raises(UserError, match=r"HOST:PORT, or auto for the cluster of this node$"):
        connected(address)


@pytest.mark.parametrize("host", ["127.0.0.1", "ray://127.0.0.1"])
def test_where_nobody_listens_is_told_at_once(host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", object())
    address = f"{host}:{free_port()}"
    with pytest.raises(UserError, match=rf"^--address {address}: no Ray is there: .*refused"):
        connected(address)


def test_a_port_beyond_all_ports_is_no_internal_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", object())
    with pytest.raises(UserError, match="no Ray is there"):
        connected("127.0.0.1:99999")


def test_what_ray_says_no_to_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    class Other:
        @staticmethod
        def init(**_: object) -> None:
            raise RuntimeError("Version mismatch: The cluster was started with:\n    Ray: 2.9")

    monkeypatch.setitem(sys.modules, "ray", Other)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        address = f"127.0.0.1:{listener.getsockname()[1]}"
        with pytest.raises(UserError) as caught:
            connected(address)
    said = "Version mismatch: The cluster was started with: Ray: 2.9"
    assert str(caught.value) == f"--address {address}: {said}"


def test_what_ray_prints_goes_to_the_log(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "orchestrator"):
        print("\x1b[33m(raylet)\x1b[0m node died\n\n  [state-dump] 7\n  really", file=_RaysWords())
    told = [one.getMessage() for one in caplog.records]
    assert told == ["ray: (raylet) node died", "ray: really"]


def test_ray_is_imported_by_who_wants_it_alone() -> None:
    code = (
        "import sys; sys.modules['ray'] = None; import foretwin.orchestrator.commands.sweep, "
        "foretwin.orchestrator.runner.ray_cluster, foretwin.sim_worker.seat"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, timeout=60.0)
