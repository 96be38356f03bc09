"""A runner whose workers are processes `foretwin.sim_worker` on a Zenoh router of their own."""

from __future__ import annotations

import logging
import secrets
import time
from collections import deque
from pathlib import Path
from typing import NamedTuple, Self

import msgspec

from foretwin.contracts.bus import Alive, Mailbox, Reply, ZenohBus
from foretwin.contracts.keys import alive_key, process_of_alive_key
from foretwin.contracts.local_bus import (
    LocalBus,
    make_local_bus,
    member_of,
    private_files,
)
from foretwin.contracts.runner import Answer, Task, TaskCount
from foretwin.contracts.setup import WorkerSetup
from foretwin.orchestrator.runner.bus_dispatcher import BusDispatcher
from foretwin.orchestrator.runner.launch import FreshInterpreter, Launcher
from foretwin.orchestrator.runner.supervisor import Death, Supervisor, WhenDead, fold_stderr

log = logging.getLogger("orchestrator")

IN_FLIGHT = 2
"""Tasks at a worker: one is played, the next lies there already."""
MAX_FAILED_STARTS = 3
"""A worker that ended so often in a row before it could take work is not started any more."""
_LOOK_S = 0.1
_GONE_S = 2.0
"""What a process that has left the bus may still take to end."""
_END_S = 0.5
"""What workers may take to end when nothing of them is waited for any more."""
_MAILBOX_DEPTH = 4096


class NoWorkerError(RuntimeError):
    """Every worker ended again and again before it could take work."""


class _WorkerRow(NamedTuple):
    module: str = "sim_worker"
    when_dead: WhenDead = "report"
    nice: int = 0


class WorkerProcesses:
    """Up to `count` workers, each started when there is a task for it; see Runner.

    `setup` is that of each but for its id and the bus, which is theirs alone. A task is given up
    where its worker does not answer within `task_timeout_s` of beginning it, after
    `dispatch.ATTEMPTS` workers died of it, or once every worker refused it. Use it as a context:
    whatever ends it, all processes end. `folder` takes their files.
    """

    def __init__(
        self,
        count: int,
        setup: WorkerSetup,
        *,
        task_timeout_s: float,
        folder: Path,
        launch: Launcher | None = None,
    ) -> None:
        self._count, self._timeout_s, self._folder = count, task_timeout_s, folder
        self._names = tuple(f"w{number}" for number in range(count))
        self._setup = setup
        self._bus: ZenohBus | None = None
        self._local: LocalBus | None = None
        self._mailbox = Mailbox(_MAILBOX_DEPTH)
        self._supervisor = Supervisor(FreshInterpreter(folder) if launch is None else launch)
        self._answers: deque[Answer] = deque()
        self._up: set[str] = set()
        self._strangers = 0
        self._failed_starts: dict[str, int] = {}
        self._at: dict[str, tuple[str, float]] = {}
        """At which task each worker is, and since when."""
        self._next_look_s = 0.0

    def __enter__(self) -> Self:
        self._folder.mkdir(parents=True, exist_ok=True)
        run_id = self._setup.run_id
        self._local = make_local_bus(
            f"{run_id}-{secrets.token_hex(4)}",
            [member_of("worker", name) for name in self._names],
            run_id=run_id,
            lossless=True,
            instead=self._folder,
        )
        with private_files():
            self._bus = ZenohBus(self._local.router, router=True)
        self._dispatcher = BusDispatcher(
            self._bus,
            self._mailbox,
            run_id=run_id,
            expected=self._names,
            in_flight=IN_FLIGHT,
            longest_s=(IN_FLIGHT + 1) * self._timeout_s,  # One waits behind those before it.
        )
        self._bus.watch_alive(alive_key(run=run_id, process="*"), self._mailbox)
        return self

    def __exit__(self, *what: object) -> None:
        self._supervisor.stop(grace_s=0.0, term_s=_END_S)
        assert self._bus is not None
        self._bus.close()
        assert self._local is not None
        self._local.remove()
        if self._supervisor.started:
            fold_stderr(self._folder, Path(self._setup.log_file))

    @property
    def capacity(self) -> int:
        """How many tasks can be at workers at once."""
        return IN_FLIGHT * self._count

    @property
    def workers(self) -> tuple[str, ...]:
        """Ids of the workers that can take work now."""
        return self._dispatcher.workers

    @property
    def count(self) -> TaskCount:
        """What became of the tasks submitted so far."""
        return self._dispatcher.dispatch.count

    @property
    def pids(self) -> list[int]:
        """The operating system's ids of the processes that run."""
        return list(self._supervisor.running().values())

    def submit(self, task: Task) -> None:
        """Take a task; see Runner."""
        self._dispatcher.submit(task)

    def cancel(self, key: str) -> None:
        """Forget a task; see Runner."""
        self._dispatcher.cancel(key)

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        """Return one answer; see Runner. Raises NoWorkerError where no worker can be started."""
        until_s = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._answers:
            if not self._dispatcher.dispatch.open:
                return None
            now_s = time.monotonic()
            if now_s >= self._next_look_s:
                self._look_after(now_s)
                self._next_look_s = now_s + _LOOK_S
            self._dispatcher.give_out()
            left_s = _LOOK_S if until_s is None else min(_LOOK_S, until_s - now_s)
            item = self._mailbox.take(max(left_s, 0.0))
            if item is not None:
                self._handle(item)
            elif until_s is not None and time.monotonic() >= until_s:
                return None
        self._dispatcher.give_out()  # Before the answer is worked on: nobody waits for that.
        return self._answers.popleft()

    def _handle(self, item: object) -> None:
        if isinstance(item, Reply):
            self._answers.extend(self._dispatcher.reply(item))
        elif isinstance(item, Alive):
            worker_id = process_of_alive_key(item.key)
            if worker_id not in self._names:
                self._strangers += item.up
                if item.up and self._strangers == 1:
                    log.warning("%s is no worker of this sweep: it gets no work", ascii(worker_id))
            elif item.up:
                self._up.add(worker_id)
                self._failed_starts.pop(worker_id, None)
                self._answers.extend(self._dispatcher.worker_up(worker_id))
            elif worker_id in self._up:
                # No use any more: its end says of what.
                self._supervisor.end(worker_id, grace_s=_GONE_S)
                self._bury(time.monotonic())

    def _look_after(self, now_s: float) -> None:
        self._bury(now_s)
        self._start_missing()
        for worker_id, task in self._dispatcher.dispatch.busy.items():
            at, since_s = self._at.get(worker_id, ("", now_s))
            if at != task.key:
                self._at[worker_id] = (task.key, now_s)
            elif now_s - since_s > self._timeout_s:
                reason = f"no answer in {self._timeout_s:g} s"
                self._answers.extend(self._dispatcher.give_up(task.key, reason))
                self._supervisor.kill(worker_id)

    def _bury(self, now_s: float) -> None:
        for death in self._supervisor.poll(now_s):
            worker_id = death.process_id
            if worker_id in self._up:
                self._up.discard(worker_id)
            else:
                self._failed_starts[worker_id] = self._failed_starts.get(worker_id, 0) + 1
            self._at.pop(worker_id, None)
            self._answers.extend(self._dispatcher.worker_down(worker_id, how=_how(death)))

    def _start_missing(self) -> None:
        """Start as many workers as there is work for, one of them for what all others refused."""
        assert self._local is not None
        running = set(self._supervisor.running())
        able = [
            name for name in self._names if self._failed_starts.get(name, 0) < MAX_FAILED_STARTS
        ]
        if not able and not running:
            raise NoWorkerError(f"no worker can be started; see {self._setup.log_file}")
        self._answers.extend(self._dispatcher.expect({*able, *running}))
        dispatch = self._dispatcher.dispatch
        wanted = min(self._count, max(dispatch.open, dispatch.most_refusals + 1))
        for name in [name for name in able if name not in running][: max(wanted - len(running), 0)]:
            bus = self._local.setup_of(member_of("worker", name).name)
            setup = msgspec.structs.replace(self._setup, process_id=name, bus=bus)
            self._supervisor.start(_WorkerRow(), setup)


def _how(death: Death) -> str:
    code = death.exit_code
    return f"signal {-code}" if code < 0 else f"exit code {code}"
