"""Workers that answer every job at once with the same bytes: what is left is the way to them."""

from __future__ import annotations

import functools
from pathlib import Path

from foretwin.contracts.bus import Bus, Mailbox, Request
from foretwin.contracts.codec import decode
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.runner import JobAnswer
from foretwin.contracts.setup import WorkerSetup
from foretwin.sim_worker.seat import SeatAnswer, SeatQuestion

ANSWER = "answer"
"""The file of the bytes, in the folder of the Worlds."""


@functools.cache
def answer_in(folder: str) -> bytes:
    return (Path(folder) / ANSWER).read_bytes()


def answer_here(setup: bytes, question: SeatQuestion, world: bytes | None) -> SeatAnswer:
    """In place of a seat's; `setup` names the folder."""
    return SeatAnswer("canned", answer_in(setup.decode()))


def serve(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """In place of a worker process's."""
    mailbox = Mailbox(16)
    bus.serve("job", mailbox, run=setup.run_id, process=setup.process_id)
    answer = decode(answer_in(setup.worlds_dir), JobAnswer).message
    life.ready()
    while not life.over:
        request = mailbox.take(0.1)
        if isinstance(request, Request):
            request.message()
            request.reply(answer)


if __name__ == "__main__":
    run_process(WorkerSetup, serve)
