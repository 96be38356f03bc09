"""Ray as a runner needs it; nothing else imports Ray, and this only where it is wanted.

Ray's own words go to the log of the run: it would print them among what the command says.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import logging
import math
import os
import re
import signal
import socket
import time
from collections.abc import Collection, Iterator
from concurrent.futures import Future
from typing import Any

from foretwin.contracts.codec import content_bytes
from foretwin.contracts.errors import UserError
from foretwin.orchestrator.runner.dispatch import ATTEMPTS
from foretwin.orchestrator.runner.ray_runner import Ended
from foretwin.sim_worker.seat import SeatAnswer, SeatQuestion, SeatSetup, answer_here

log = logging.getLogger("orchestrator")

_CONNECT_S = 5.0
_SEATS_STAY_S = 2.0
"""To ask for the nodes takes a millisecond, and more in a large cluster."""
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_MOST_CHARACTERS = 500
_NODE_DIGITS = 6
"""Of a node's id: one that comes back at its address is another one."""
_SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # An address where no Ray is keeps it for minutes else.
    "RAY_NUM_REDIS_GET_RETRIES": "1",
}


class RayCluster:
    """A cluster that this process is connected to; see SeatCluster."""

    def __init__(self, ray: Any, setup: SeatSetup) -> None:
        self._ray = ray
        self._setup = ray.put(content_bytes(setup))
        self._seats: tuple[str, ...] = ()
        self._look_again_s, self._lost_s = 0.0, -math.inf
        self._refs: dict[Future[Ended], Any] = {}
        self._turns = itertools.count()
        # A node or process that dies costs a life, a mistake of ours none: it is an answer.
        self._answer = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_answer_on_node)

    def seats(self) -> tuple[str, ...]:
        """Return a name for each processor of the nodes that live; see SeatCluster."""
        now_s = time.monotonic()
        if now_s >= self._look_again_s:
            self._look_again_s = now_s + _SEATS_STAY_S
            before, self._seats = self._seats, self._seats_now()
            if set(before) - set(self._seats):
                self._lost_s = now_s
        return self._seats

    @property
    def lost_s(self) -> float:
        """When a node was last found to be gone; see SeatCluster."""
        return self._lost_s

    def _seats_now(self) -> tuple[str, ...]:
        return tuple(
            f"{node['NodeManagerAddress']} {node['NodeID'][:_NODE_DIGITS]}-{number}"
            for node in self._ray.nodes()
            if node["Alive"]
            for number in range(int(node["Resources"].get("CPU", 0.0)))
        )

    def put(self, data: bytes) -> Any:
        """Store bytes; see SeatCluster."""
        return self._ray.put(data)

    def ask(
        self, question: SeatQuestion, world: Any | None, *, away_from: Collection[str] = ()
    ) -> Future[Ended]:
        """Have a question answered; see SeatCluster."""
        answer = self._answer
        if away_from and (node := self._node_but(away_from)):
            from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

            there = NodeAffinitySchedulingStrategy(node, soft=True)
            answer = answer.options(scheduling_strategy=there)
        ref = answer.remote(self._setup, question, world)
        ended: Future[Ended] = Future()
        self._refs[ended] = ref
        ref.future().add_done_callback(lambda done: self._end(ended, done))
        return ended

    def _node_but(self, these: Collection[str]) -> str | None:
        """Return the id of a node that lives and is none of these, each in its turn."""
        others = [
            node["NodeID"]
            for node in self._ray.nodes()
            if node["Alive"] and node["Resources"].get("CPU") and node["NodeID"] not in these
        ]
        return others[next(self._turns) % len(others)] if others else None

    def forget(self, asked: Future[Ended]) -> None:
        """Let a question not be begun; see SeatCluster."""
        ref = self._refs.get(asked)
        if ref is not None:
            self._ray.cancel(ref)

    def _end(self, ended: Future[Ended], done: Future[tuple[str, SeatAnswer]]) -> None:
        self._refs.pop(ended, None)
        error = done.exception()
        if error is not None:
            ended.set_result(Ended(None, self._trouble(error)))
        else:
            node, answer = done.result()
            ended.set_result(Ended(answer, node=node))

    def _trouble(self, error: BaseException) -> str:
        """Return in one line what became of those who were to answer."""
        errors = self._ray.exceptions
        if isinstance(error, (errors.WorkerCrashedError, errors.NodeDiedError)):
            return f"{ATTEMPTS} workers died of it"
        if isinstance(error, errors.OutOfMemoryError):
            return "no node has the memory for it"
        cause = getattr(error, "cause", None) or error
        lines = [line.strip() for line in str(cause).splitlines() if line.strip()]
        return f"{type(cause).__name__}: {lines[-1] if lines else 'no more is said'}"


def _answer_on_node(
    setup: bytes, question: SeatQuestion, world: bytes | None
) -> tuple[str, SeatAnswer]:
    """Return the id of this node, and what is answered here."""
    import ray

    return ray.get_runtime_context().get_node_id(), answer_here(setup, question, world)


@contextlib.contextmanager
def ray_cluster(
    setup: SeatSetup, *, address: str | None, processors: int | None
) -> Iterator[RayCluster]:
    """Connect to the cluster at an address (`auto`: of this node), or start one for as long.

    Raises UserError, in one line, without Ray, where none is there, or one of another version.
    """
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    try:
        import ray
    except ImportError as error:
        raise UserError(
            "--engine ray needs Ray, which is not installed: pip install 'foretwin[ray]'"
        ) from error
    if address not in (None, "auto"):
        _see_whether_there(str(address))
    handlers = {one: signal.getsignal(one) for one in (signal.SIGTERM, signal.SIGINT)}
    with contextlib.redirect_stdout(_RaysWords()):
        try:
            ray.init(
                address="local" if address is None else address,
                num_cpus=processors if address is None else None,
                include_dashboard=False if address is None else None,
                log_to_driver=False,
                logging_level=logging.ERROR,
            )
        except (ConnectionError, RuntimeError, ValueError) as error:
            where = "no Ray could be started" if address is None else f"--address {address}"
            raise UserError(f"{where}: {' '.join(str(error).split())}") from error
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)  # How a command ends is not Ray's business.
        try:
            yield RayCluster(ray, setup)
        finally:
            ray.shutdown()


def _see_whether_there(address: str) -> None:
    """Raise UserError, soon, where nobody listens: Ray asks for two minutes, and ends all."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        raise UserError(f"--address {address}: HOST:PORT, or auto for the cluster of this node")
    try:
        socket.create_connection((host, int(port)), timeout=_CONNECT_S).close()
    except (OSError, OverflowError) as error:
        raise UserError(f"--address {address}: no Ray is there: {error}") from error


class _RaysWords(io.TextIOBase):
    """Takes what would be printed, line by line, into the log, but for the state of a dead node."""

    def write(self, text: str) -> int:
        for line in _COLOURS.sub("", text).splitlines():
            if line.strip() and "[state-dump]" not in line:
                log.warning("ray: %s", line.strip()[:_MOST_CHARACTERS])
        return len(text)
