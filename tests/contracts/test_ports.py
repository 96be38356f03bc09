"""A port that is chosen must not go to somebody else before it is listened on."""

from __future__ import annotations

import socket

import pytest

from foretwin.contracts.ports import (
    LOOPBACK,
    free_endpoint,
    free_port,
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


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:7447",
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
        ("tcp/127.0.0.1:0", "tcp/HOST:PORT with a port of 1 to 65535"),
        ("udp/car", "udp/HOST:PORT with a port of 1 to 65535"),
    ],
)
def test_an_endpoint_that_is_none_is_told_what_it_lacks(endpoint: str, right: str) -> None:
    assert trouble_with_endpoint(endpoint) == right
