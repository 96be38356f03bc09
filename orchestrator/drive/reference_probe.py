"""The drive's probe as its own workers play it: what others must come to."""

from __future__ import annotations

from foretwin.contracts.runner import Answer, Task
from foretwin.contracts.world import World
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.rounds.probe import probe_task
from foretwin.orchestrator.rounds.runner import RoundRunner
from foretwin.orchestrator.tuning.parameter_versions import ParameterVersions
from foretwin.sim_worker.futures.result_digest import result_digest


class ReferenceProbe:
    """Played once for each set of parameters, and only where somebody is to be tried."""

    def __init__(self, config: DriveConfig, rounds: RoundRunner) -> None:
        self._config, self._rounds = config, rounds
        self._world: World | None = None
        self._version = -1
        self._task: Task | None = None
        self._digests: dict[str, str] = {}

    @property
    def world_id(self) -> str:
        """The World of the probe, empty before there is one."""
        return "" if self._world is None else self._world.id

    def use(self, world: World) -> None:
        """Take the first World in which anything can be driven."""
        if self._world is None and world.connections:
            self._world = world

    def task(self, parameters: ParameterVersions) -> Task | None:
        """Return the probe once it has been played here; None before, and it is begun."""
        if self._world is None:
            return None
        if self._version != parameters.version:
            self._version = parameters.version
            vehicle = parameters.in_force.vehicle
            self._task = probe_task(self._config, self._world, vehicle, parameters.version)
            if self._task is None:
                self._world = None
            elif self._task.key not in self._digests:
                self._rounds.dispatcher.submit(self._task, near=True)
                self._rounds.dispatcher.give_out()
        task = self._task
        return task if task is not None and task.key in self._digests else None

    def digest(self, key: str) -> str:
        """Return what the probe of this key came to here."""
        return self._digests[key]

    def take(self, answer: Answer) -> None:
        """Take what one of ours came to; where it could not, it is tried again when asked for."""
        if self._task is None or answer.task.key != self._task.key:
            return
        if answer.message is None or answer.message.result is None:
            self._version = -1
        else:
            self._digests[answer.task.key] = result_digest(answer.message.result)
