"""Where the co-pilot display of a run is opened: an address whose path nobody else knows.

Whoever reaches the port sees nothing without it: other users of this machine, and pages of others
in the same browser. It follows from what the process shows on the bus, so that it stays the same
where the process is started again, and stands in no file of the run.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from foretwin.contracts.ports import LOOPBACK
from foretwin.contracts.process_setup import BusSetup

USUAL_PORT = 8790
FRAMES_FILE = "copilot.jsonl.zst"
"""In a run's folder: what its co-pilot display showed."""
_KEY_BYTES = 8


def page_key(bus: BusSetup, run_id: str) -> str:
    """Return the secret part of the path: of who joins with a password or a certificate.

    Where the bus asks nobody who speaks, it hides nothing. Raises OSError where the file that
    proves who this is cannot be read.
    """
    file = bus.credentials if bus.tls is None else bus.tls.key
    secret = b"" if file is None else Path(file).read_bytes()
    digest = hashlib.blake2b(secret, digest_size=_KEY_BYTES, person=b"page", salt=_salt(run_id))
    return digest.hexdigest()


def page_address(key: str, *, host: str = LOOPBACK, port: int, secure: bool = False) -> str:
    """Return the address to open in a browser."""
    shown = f"[{host}]" if ":" in host else host
    return f"{'https' if secure else 'http'}://{shown}:{port}/{key}/"


def _salt(run_id: str) -> bytes:
    return hashlib.blake2b(run_id.encode(), digest_size=16).digest()
