"""A collect that ends as by a kill, at one of its steps or after so much processor time.

`python -P -m tests.orchestrator.lake.killed_collect JSON` (`Killing`). Steps are what it asks of
the file system below the lake: no clock, and no load of the machine, moves them.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from foretwin.orchestrator.lake import collect as collecting
from foretwin.orchestrator.lake.manifest import MANIFEST, read_manifest
from foretwin.orchestrator.lake.store import STAGED, FolderStore
from foretwin.orchestrator.record.durable import WRITING

PHASES = {
    "before anything", "in staging", "in a manifest", "before a first publication",
    "between publications", "after publications",
}  # fmt: skip
_WRITING = f"{MANIFEST}{WRITING}"
_WORDS = {"open": "open", "os.rename": "rename", "os.mkdir": "mkdir", "os.remove": "remove"}


class Killing(msgspec.Struct, frozen=True, kw_only=True):
    """What to collect into which lake, and when to end."""

    lake: str
    runs: str
    step_bytes: int
    """See `collect.STEP_BYTES`."""
    before_event: int | None = None
    """Ends before the event of this number."""
    after_cpu_s: float | None = None
    told: str
    """Where a collect that comes to its end writes `Whole`."""


class Step(NamedTuple):
    """The events with which a step's manifest is put in its place, and then its files."""

    manifest: int
    published: list[int]


class Whole(msgspec.Struct, frozen=True, kw_only=True):
    """What a whole collect did: its events (word, name below the lake), and what it took."""

    events: list[tuple[str, str]]
    cpu_s: float

    @property
    def steps(self) -> list[Step]:
        """Return the steps in which it was done."""
        found: list[Step] = []
        for at, (word, name) in enumerate(self.events):
            if word == "rename" and name == _WRITING:
                found.append(Step(at, []))
            elif word == "rename" and name.startswith(f"{STAGED}/"):
                found[-1].published.append(at)
        return found

    def published(self, step: Step) -> set[str]:
        """Return the names of the files that a step publishes."""
        return {self.events[at][1].removeprefix(f"{STAGED}/") for at in step.published}


class Events:
    """What the file system below a lake is asked for, as Python's audit events tell."""

    def __init__(self, lake: Path, dies_before: int | None) -> None:
        self._root, self._dies_before = f"{lake}/", dies_before
        self.seen: list[tuple[str, str]] = []

    def __call__(self, event: str, given: tuple[Any, ...]) -> None:
        """Take one; ends the process where that is the one."""
        word = _WORDS.get(event)
        if word is None or not (path := str(given[0])).startswith(self._root):
            return
        if len(self.seen) == self._dies_before:
            os.kill(os.getpid(), signal.SIGKILL)
        self.seen.append((word, path.removeprefix(self._root)))


def phase_of(lake: Path, whole: Whole) -> str:
    """Return in which part of its work whoever collected there was ended, one of `PHASES`, by what
    is left.

    All that the manifest names must be there, published or staged.
    """
    store = FolderStore(lake)
    manifest, staged = read_manifest(store), set(store.staged())
    files = {name: file.sha256 for name, file in manifest.files.items()}
    waiting = {name for name in staged if store.sha256(name, staged=True) == files.get(name)}
    assert {name for name in files if not _is(store, name, files[name])} == waiting
    if (lake / _WRITING).exists():
        return "in a manifest"
    if waiting < staged:
        return "in staging"
    if waiting:
        whole_step = any(waiting == whole.published(step) for step in whole.steps)
        return "before a first publication" if whole_step else "between publications"
    return "after publications" if files else "before anything"


def _is(store: FolderStore, name: str, sha256: str) -> bool:
    try:
        return store.sha256(name) == sha256
    except FileNotFoundError:
        return False


def main(text: str) -> None:
    """Collect, unless ended before."""
    asked = msgspec.json.decode(text, type=Killing)
    lake = Path(asked.lake)
    collecting.STEP_BYTES = asked.step_bytes
    folders = sorted(Path(asked.runs).iterdir())
    events, begun_s = Events(lake, asked.before_event), time.process_time()
    sys.addaudithook(events)
    if asked.after_cpu_s is not None:
        signal.setitimer(signal.ITIMER_PROF, asked.after_cpu_s)  # unhandled, it ends the process
    collecting.collect(FolderStore(lake), folders)
    whole = Whole(events=events.seen, cpu_s=time.process_time() - begun_s)
    Path(asked.told).write_bytes(msgspec.json.encode(whole))


if __name__ == "__main__":
    main(sys.argv[1])
