"""Where something of ours may listen on this machine."""

from __future__ import annotations

import random
import socket

LOOPBACK = "127.0.0.1"
_PORTS = range(20_000, 32_000)
"""Below those that systems give to outgoing connections, any of which could take a port between
its choice and the moment at which it is listened on."""
_TRIES = 200

_random = random.SystemRandom()


def free_port() -> int:
    """Return a TCP port of the loopback interface that was free a moment ago.

    Raises OSError where two hundred ports in a row are taken.
    """
    for _ in range(_TRIES):
        port = _random.choice(_PORTS)
        with socket.socket() as probe:
            try:
                probe.bind((LOOPBACK, port))
            except OSError:
                continue
            return port
    raise OSError(f"no free port on {LOOPBACK} from {_PORTS.start} to {_PORTS.stop - 1}")


def free_endpoint() -> str:
    """Return a Zenoh endpoint on such a port."""
    return f"tcp/{LOOPBACK}:{free_port()}"
