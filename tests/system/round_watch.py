"""Writes when each round of a drive was there to be shown: `python -m tests.system.round_watch`.

One JSON line a round: `mono_s`, `round_id`, `late`. A process of its own, since it has to be in the
network of the drive.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from foretwin.contracts.bus import Mailbox, Received, ZenohBus
from foretwin.contracts.campaign import role_files
from foretwin.contracts.setup import BusSetup


def main(endpoint: str, campaign: str, file: str) -> None:
    """Watch until this process is ended."""
    rounds = Mailbox(256)
    tls = role_files(Path(campaign), "viewer")
    with ZenohBus(BusSetup(endpoint=endpoint, tls=tls)) as bus, Path(file).open("w") as out:
        bus.subscribe("round", rounds, run="*")
        while True:
            item = rounds.take(1.0)
            if isinstance(item, Received):
                view = item.message()
                row = {"mono_s": time.monotonic(), "round_id": view.round_id, "late": view.late}
                out.write(json.dumps(row) + "\n")
                out.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
