"""Which World counts, told to the mirror and to those who watch."""

from __future__ import annotations

from collections.abc import Callable

from foretwin.contracts.simulation import ActiveWorld
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive.processes import MIRROR
from foretwin.orchestrator.drive.questions import Questions


class ActiveWorldNews:
    """Tells each change once; `next_stamp_ns` is that of the next state."""

    def __init__(
        self, context: DriveContext, questions: Questions, *, next_stamp_ns: Callable[[], int]
    ) -> None:
        self._context, self._questions, self._next_stamp_ns = context, questions, next_stamp_ns
        self._world_id: str | None = None
        self._untold = False
        self._told: ActiveWorld | None = None

    def use(self, world_id: str | None) -> None:
        """Another World counts, or none."""
        self._world_id, self._untold = world_id, True

    def announce(self) -> None:
        """Tell which World counts from the next state on, where that is news.

        In lock step only between steps, when no state is on its way that may overtake this.
        """
        if not self._untold:
            return
        self._untold = False
        self._told = ActiveWorld(stamp_ns=self._next_stamp_ns(), world_id=self._world_id)
        self._context.publish("active_world", self._told)
        self._questions.ask(MIRROR, "use_world", self._told)

    def mirror_up(self) -> None:
        """The mirror has come up and knows of none."""
        self._untold = True
        self.announce()

    def viewer_up(self) -> None:
        """A viewer that was started again has missed the last."""
        if self._told is not None:
            self._context.publish("active_world", self._told)
