"""What is known of a task that is not ended, and of a worker that is up; see Dispatch."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from foretwin.contracts.runner import Task


@dataclass(slots=True)
class WorkerAtWork:
    """A worker that is up, and its tasks."""

    at_work: deque[Task] = field(default_factory=deque)
    """In the order in which it answers: it is at the first one."""
    world_id: str = ""
    turn: int = 0
    """Grows with each task given: who has the least was given one longest ago."""
    silent: set[str] = field(default_factory=set)
    """Keys of those tasks at work whose questions ended without an answer."""

    def take(self, task: Task, *, turn: int) -> None:
        """Have one task more, and be at its World from then on."""
        self.at_work.append(task)
        self.world_id, self.turn = task.world_id, turn


@dataclass(slots=True)
class OpenTask:
    """A task that is neither answered nor given up."""

    task: Task
    due_s: float | None = None
    """When its answer is late, `span_s` after its start; None: never."""
    span_s: float = 0.0
    near: bool = False
    """Whether no worker on another machine may have it."""
    waits: bool = True
    deaths: int = 0
    refused_by: set[str] = field(default_factory=set)
    """Workers that are not asked for it again."""
    refusal: str = ""
    """The last of their reasons."""
