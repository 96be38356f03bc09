"""A port that is chosen must not go to somebody else before it is listened on."""

from __future__ import annotations

import socket

from foretwin.contracts.ports import LOOPBACK, free_endpoint, free_port


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
