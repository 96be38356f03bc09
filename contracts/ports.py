"""Where something of ours may listen."""

from __future__ import annotations

import random
import re
import socket
from typing import NamedTuple

from foretwin.contracts.errors import UserError

LOOPBACK = "127.0.0.1"
WEB_PORT = 9090
"""Of the viewer for browsers, where it is free."""
LOOPBACKS = frozenset({LOOPBACK, "::1", "localhost"})
_PORTS = range(20_000, 32_000)
"""Below those that systems give to outgoing connections, any of which could take a port between
its choice and the moment at which it is listened on."""
_TRIES = 200

_random = random.SystemRandom()


def free_or(port: int) -> int:
    """Return `port` where nobody listens there on this machine, else one that is free."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return free_port()
    return port


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


_ENDPOINT = re.compile(r"(?P<protocol>[a-z][a-z0-9-]*)/(?P<address>.+)")
_HOST_AND_PORT = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[^:/]+):(?P<port>[0-9]{1,5})")
_ON_IP = ("tcp", "udp", "tls", "quic", "ws")


def trouble_with_endpoint(endpoint: str) -> str | None:
    """Return what is wrong with the form of a Zenoh endpoint, None where nothing is."""
    found = _ENDPOINT.fullmatch(endpoint)
    if found is None:
        return f"PROTOCOL/ADDRESS, such as tcp/{LOOPBACK}:7447"
    if found["protocol"] not in _ON_IP:
        return None
    # What may follow are Zenoh's own metadata and settings of the link.
    place = _HOST_AND_PORT.fullmatch(re.split("[?#]", found["address"])[0])
    if place is None or not 0 < int(place["port"]) < 2**16:
        return f"{found['protocol']}/HOST:PORT with a port of 1 to 65535"
    return None


_TLS_PLACE = re.compile(r"tls/(?P<host>\[[0-9A-Fa-f:.]+\]|[^\[\]:/?#]+):(?P<port>[0-9]{1,5})")


class ListenPlace(NamedTuple):
    """Where something of ours listens."""

    host: str
    port: int


def tls_place(endpoint: str) -> ListenPlace | None:
    """Return host and port of `tls/HOST:PORT`, None for any other endpoint.

    What may stand behind ? or # are settings of the link, which could undo ours.
    """
    found = _TLS_PLACE.fullmatch(endpoint)
    return None if found is None else ListenPlace(found["host"].strip("[]"), int(found["port"]))


def tcp_place(endpoint: str) -> ListenPlace | None:
    """Return host and port of `tls/HOST:PORT` or `tcp/HOST:PORT`, None for any other endpoint."""
    return tls_place(re.sub("^tcp/", "tls/", endpoint))


def trouble_with_bus(endpoint: str | None, *, insecure: bool, secure: str | None) -> str | None:
    """Return what is wrong with where a drive's bus shall be, None where nothing is.

    `secure` is the folder of a campaign's certificates.
    """
    if endpoint is None:
        own = "without one the bus is a socket of this user's alone"
        if secure is not None:
            return f"--secure {secure}: needs an endpoint tls/HOST:PORT; {own}"
        return f"--insecure: needs an endpoint; {own}" if insecure else None
    if trouble := trouble_with_endpoint(endpoint):
        return f"endpoint {endpoint!r}: {trouble}"
    if secure is not None:
        if insecure:
            return f"--insecure: not with --secure {secure}"
        only = f"endpoint {endpoint!r}: with --secure tls/HOST:PORT and nothing else"
        return only if tls_place(endpoint) is None else None
    if endpoint.startswith("tls/"):
        return f"endpoint {endpoint}: needs --secure FOLDER (foretwin secure init)"
    if not insecure:
        open_to_all = "whoever reaches it may speak as the car and end the drive"
        return (
            f"endpoint {endpoint}: {open_to_all}; take tls/HOST:PORT with --secure FOLDER, or, if "
            "that shall be so, add --insecure"
        )
    return None


def listen_place(text: str) -> ListenPlace:
    """Return the host and port that `--listen` names.

    Raises UserError for what is no place.
    """
    named = _HOST_AND_PORT.fullmatch(text)
    if named is None or not 0 < int(named["port"]) < 65536:
        raise UserError(f"--listen {text}: must be HOST:PORT with a port of 1 to 65535")
    return ListenPlace(text.rpartition(":")[0].strip("[]"), int(named["port"]))


_PLACE = re.compile(r"(?:(?P<host>[^:\s]+):)?(?P<port>\d{1,5})")


def metrics_place(text: str) -> ListenPlace:
    """Return the place that `--metrics` names; of a port alone the loopback interface.

    Raises UserError for what is no place.
    """
    named = _PLACE.fullmatch(text)
    if named is None or not 0 < int(named["port"]) < 65536:
        raise UserError(f"--metrics {text}: must be a port from 1 to 65535, or HOST:PORT")
    return ListenPlace(named["host"] or LOOPBACK, int(named["port"]))
