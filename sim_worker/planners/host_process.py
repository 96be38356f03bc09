"""`python -m foretwin.sim_worker.planners.host_process`: one foreign planner.

It answers on the link that its worker gave it, and ends when that is closed or the worker is gone.
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import threading
import time
from importlib.metadata import EntryPoint
from typing import Any

from foretwin.sim_worker.planner_interface import Planner, RemembersWithinJob
from foretwin.sim_worker.planners.host_link import (
    ANSWER,
    FAILURE,
    READY,
    LinkLost,
    pack_answer,
    read_question,
    receive,
    send,
)
from foretwin.sim_worker.planners.one_at_a_time import AnswersOne, OneAtATime

_LOOK_S = 0.5


def main() -> None:
    """Load the planner, say whether that worked, and answer until the link is closed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--link", type=int, required=True, help="file descriptor of the link")
    parser.add_argument("--parent", type=int, required=True, help="process of the worker")
    parser.add_argument("--name", required=True)
    parser.add_argument("--object", required=True, help="package.module:Class")
    arguments = parser.parse_args()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with, args=(arguments.parent,), daemon=True).start()
    link = socket.socket(fileno=arguments.link)
    try:
        planner = load(arguments.name, arguments.object)
    except BaseException as error:
        send(link, FAILURE, _error_text(error))
        return
    send(link, READY, b"")
    try:
        _answer(link, planner)
    except (LinkLost, ConnectionError):
        return


def load(name: str, value: str) -> Any:
    """Return an instance of the class an entry point names; raises what its package raises."""
    planner = EntryPoint(name=name, value=value, group="").load()()
    methods = ("plan", "plan_one", "begin")
    if not any(callable(getattr(planner, method, None)) for method in methods):
        raise TypeError("has no method plan(view), plan_one(view) or begin(count)")
    return planner


def _leave_with(parent: int) -> None:
    """End when the parent has: a planner that blocks would never see the link closed."""
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(0)


def _answer(link: socket.socket, planner: Any) -> None:
    driver: Planner | None = None
    shared: dict[str, Any] = {}
    while True:
        question = read_question(receive(link).body)
        shared = question.shared or shared
        try:
            if question.begins or driver is None:
                driver = _driver(planner, question.begins)
            answer = driver.plan(question.view._replace(**shared))
            body = pack_answer(answer, dict(getattr(driver, "remarks", {})))
        except Exception as error:
            send(link, FAILURE, _error_text(error))
            continue
        send(link, ANSWER, body)


def _driver(planner: Any, count: int) -> Planner:
    if isinstance(planner, RemembersWithinJob):
        planner = planner.begin(count)
        if not any(callable(getattr(planner, method, None)) for method in ("plan", "plan_one")):
            kind = type(planner).__name__
            raise TypeError(f"begin(count) returned {kind}: no method plan(view) or plan_one(view)")
    if isinstance(planner, AnswersOne) and not hasattr(planner, "plan"):
        return OneAtATime(planner)
    return planner  # type: ignore[no-any-return]


def _error_text(error: BaseException) -> bytes:
    return f"{type(error).__name__}: {' '.join(str(error).split())}".encode()


if __name__ == "__main__":
    main()
