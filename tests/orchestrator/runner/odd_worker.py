"""A worker that does with its process what a question says: `die`, `die-once`, `hang`, …"""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path

from foretwin.contracts.bus import Bus, Mailbox, Request
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.setup import WorkerSetup
from foretwin.contracts.simulation import PrepareReply


def serve(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    mailbox = Mailbox(16)
    bus.serve("prepare", mailbox, run=setup.run_id, process=setup.process_id)
    if setup.role == "never up":
        raise OSError("no licence")
    life.ready()
    while not life.over:
        request = mailbox.take(0.1)
        if not isinstance(request, Request):
            continue
        asked = request.message().world_id
        died = Path(setup.worlds_dir) / "died"
        if asked == "die" or (asked == "die-once" and not died.exists()):
            if asked == "die-once":
                died.write_text(setup.process_id)
            os.kill(os.getpid(), signal.SIGKILL)
        if asked == "hang":
            threading.Event().wait()
        word, *who = asked.split("-")
        if word == "refuse" and (not who or setup.process_id in who):
            request.refuse("no such World")
        else:
            request.reply(PrepareReply(world_id=asked, worker_id=setup.process_id, seconds=0.0))


if __name__ == "__main__":
    run_process(WorkerSetup, serve)
