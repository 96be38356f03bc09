"""How a Zenoh session of ours is set: routers and clients alike; docs/bus.md says why."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foretwin.contracts.campaign import TlsFiles
from foretwin.contracts.credentials import read_credentials
from foretwin.contracts.process_setup import BusSetup

CONNECT_S = 5.0
"""How long a client looks for its router."""
LEASE_MS = 3000
"""A process that is silent for so long counts as lost."""
LOSSLESS_LEASE_MS = 60_000
LOSSLESS_WAIT_US = 600_000_000
"""How long a writer waits for a reader that stands still where nothing may be lost."""

_QUEUE_SIZES = {
    **dict.fromkeys(("real_time", "interactive_high", "data_high", "data"), 16),
    "interactive_low": 4,
    **dict.fromkeys(("control", "data_low", "background"), 2),
}
"""Batches that may wait to be sent, by priority; docs/bus.md."""


_THREADS, _ONE_READER = "ZENOH_RUNTIME", "(rx: (handover: app), app: (worker_threads: 1))"


@contextlib.contextmanager
def read_by_one_thread() -> Iterator[None]:
    """Let the first session that this process opens have its links read by the thread that waits
    for what comes: Zenoh wakes another one of two for each batch.

    Not where a mailbox may block: nothing would be sent meanwhile. Zenoh looks into the environment
    alone; who is started from here finds it as it was.
    """
    before = os.environ.get(_THREADS)
    os.environ[_THREADS] = before or _ONE_READER
    try:
        yield
    finally:
        if before is None:
            del os.environ[_THREADS]


def zenoh_config(setup: BusSetup, *, router: bool) -> Any:
    """Return the Zenoh configuration; docs/bus.md gives the reason for each setting."""
    import zenoh

    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": "router" if router else "client",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "timestamping/enabled": True,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LOSSLESS_LEASE_MS if setup.lossless else LEASE_MS,
        "transport/link/tx/queue/size": _QUEUE_SIZES,
        "listen/endpoints": [setup.endpoint] if router else [],
    }
    if setup.lossless:
        queue = "transport/link/tx/queue/congestion_control/block"
        settings[f"{queue}/wait_before_close"] = LOSSLESS_WAIT_US
    if not router:
        settings["connect/endpoints"] = [setup.endpoint]
        settings["connect/timeout_ms"] = round(1e3 * CONNECT_S)
        retry = {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 2}
        settings["connect/retry"] = retry
    if setup.credentials is not None:
        shown = read_credentials(Path(setup.credentials))
        settings["transport/auth/usrpwd"] = {"user": shown.user, "password": shown.password}
    if router and setup.admits is not None:
        settings["access_control"] = json.loads(setup.admits.access)
        if setup.admits.users_file is not None:
            settings["transport/auth/usrpwd"] = {"dictionary_file": setup.admits.users_file}
    if setup.tls is not None:
        settings |= tls_settings(setup.tls, router=router)
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    return config


def tls_settings(tls: TlsFiles, *, router: bool) -> dict[str, Any]:
    """Return the settings of a session that speaks TLS alone, in which both sides are known.

    Zenoh's clients trust the public web's authorities besides the one given here (1.10): the name
    of the router's host must not be one for which such an authority gives out certificates.
    """
    side = "listen" if router else "connect"
    return {
        "transport/link/protocols": ["tls"],
        "transport/link/tls": {
            "root_ca_certificate": tls.authority,
            f"{side}_certificate": tls.certificate,
            f"{side}_private_key": tls.key,
            "enable_mtls": True,
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        },
    }
