"""A port that is chosen must not go to somebody else before it is listened on."""

from __future__ import annotations

import socket

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.ports import (
    LOOPBACK,
    WEB_PORT,
    free_endpoint,
    free_or,
    free_port,
    listen_place,
    metrics_place,
    tcp_place,
    tls_place,
    trouble_with_bus,
    trouble_with_endpoint,
)


def test_a_free_port_can_be_listened_on_and_is_none_that_connections_are_given() -> None:
    given = []
    for _ in range(20):
        port = free_port()
        with socket.socket() as listener, socket.socket() as outgoing:
            listener.bind((LOOPBACK, port))
            listener.listen()
            outgoing.connect((LOOPBACK, port))
            given.append((port, outgoing.getsockname()[1]))
    assert max(port for port, _ in given) < min(outgoing for _, outgoing in given)
    assert free_endpoint().startswith("tcp/127.0.0.1:")


def test_a_port_is_free_again_as_soon_as_nobody_listens_there() -> None:
    with socket.create_server((LOOPBACK, 0)) as listener:
        port = listener.getsockname()[1]
        assert free_or(port) != port
        with socket.create_connection((LOOPBACK, port)) as client:
            served, _ = listener.accept()
            served.close()  # the first to close: the port stays in TIME_WAIT
            assert client.recv(1) == b""
    assert free_or(port) == port


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:7447",
        "tcp/127.0.0.1:65535",
        "tcp/[::1]:7447",
        "quic/car.local:1?rel=1#a=b",
        "unixsock-stream/a.sock",
    ],
)
def test_endpoints_of_zenoh_are_taken(endpoint: str) -> None:
    assert trouble_with_endpoint(endpoint) is None


@pytest.mark.parametrize(
    ("endpoint", "right"),
    [
        ("foo", "PROTOCOL/ADDRESS, such as tcp/127.0.0.1:7447"),
        ("tcp/127.0.0.1:99999", "tcp/HOST:PORT with a port of 1 to 65535"),
        ("tcp/127.0.0.1:65536", "tcp/HOST:PORT with a port of 1 to 65535"),
        ("tcp/127.0.0.1:0", "tcp/HOST:PORT with a port of 1 to 65535"),
        ("udp/car", "udp/HOST:PORT with a port of 1 to 65535"),
    ],
)
def test_an_endpoint_that_is_none_is_told_what_it_lacks(endpoint: str, right: str) -> None:
    assert trouble_with_endpoint(endpoint) == right


def test_the_viewer_for_browsers_is_where_links_of_before_lead() -> None:
    assert WEB_PORT == 9090


TLS = "tls/localhost:7447"


@pytest.mark.parametrize(
    ("endpoint", "insecure", "secure", "said"),
    [
        (None, False, None, None),
        ("tcp/127.0.0.1:7447", True, None, None),
        ("tcp/127.0.0.1:7447", False, None, "whoever reaches it may speak as the car"),
        (TLS, False, "c", None),
        (TLS, True, "c", "--insecure: not with --secure c"),
        (TLS, False, None, "needs --secure FOLDER"),
        (TLS, True, None, "needs --secure FOLDER"),
        (None, False, "c", "needs an endpoint tls/HOST:PORT"),
        ("tcp/127.0.0.1:7447", False, "c", "with --secure tls/HOST:PORT and nothing else"),
        (f"{TLS}#enable_mtls=false", False, "c", "with --secure tls/HOST:PORT and nothing else"),
        ("tls/localhost", False, "c", "HOST:PORT with a port"),
    ],
)
def test_where_a_bus_may_be(
    endpoint: str | None, insecure: bool, secure: str | None, said: str | None
) -> None:
    trouble = trouble_with_bus(endpoint, insecure=insecure, secure=secure)
    assert trouble == said or (trouble is not None and said is not None and said in trouble)


@pytest.mark.parametrize(
    ("endpoint", "place"),
    [
        (TLS, ("localhost", 7447)),
        ("tls/[::1]:7447", ("::1", 7447)),
        (f"{TLS}#enable_mtls=false", None),
        (f"{TLS}?rel=1", None),
        ("quic/localhost:7447", None),
    ],
)
def test_a_place_is_host_and_port_and_nothing_else(
    endpoint: str, place: tuple[str, int] | None
) -> None:
    assert tls_place(endpoint) == place
    assert tcp_place(endpoint.replace("tls/", "tcp/")) == place


def test_a_place_is_where_tcp_connects_to() -> None:
    assert tcp_place("tcp/localhost:7447") == tcp_place(TLS) == ("localhost", 7447)
    assert tcp_place("unixsock-stream//tmp/bus") is None


def test_metrics_are_told_on_the_loopback_interface_unless_a_host_is_named() -> None:
    assert metrics_place("9464") == (LOOPBACK, 9464)
    assert metrics_place("0.0.0.0:9464") == ("0.0.0.0", 9464)


@pytest.mark.parametrize("text", ["", "0", "65536", "port", ":9464", "a b:9464", "9464:", "1.5"])
def test_what_is_no_place_for_metrics_is_told(text: str) -> None:
    with pytest.raises(UserError, match="must be a port from 1 to 65535, or HOST:PORT"):
        metrics_place(text)


def test_whoever_lets_others_join_names_host_and_port() -> None:
    assert listen_place("car.local:1") == ("car.local", 1)
    assert listen_place("[::1]:65535") == ("::1", 65535)


@pytest.mark.parametrize("text", ["", "7447", "car.local:0", "car.local:65536", "car.local:99999"])
def test_what_is_no_place_to_listen_at_is_told(text: str) -> None:
    with pytest.raises(UserError, match="must be HOST:PORT with a port of 1 to 65535"):
        listen_place(text)


def test_where_every_port_is_taken_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    class Taken(socket.socket):
        def bind(self, address: tuple[str, int]) -> None:  # type: ignore[override]
            tried.append(address)
            raise OSError("in use")

    monkeypatch.setattr(socket, "socket", Taken)
    with pytest.raises(OSError, match=r"no free port on 127\.0\.0\.1 from 20000 to 31999"):
        free_port()
    assert len(tried) == 200
    assert {host for host, _ in tried} == {LOOPBACK}
    assert all(20_000 <= port < 32_000 for _, port in tried)
