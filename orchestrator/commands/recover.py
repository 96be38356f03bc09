"""`foretwin recover`: makes readable what a run left that did not come to its end."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.terminal import say
from foretwin.orchestrator.record.recovery import recover

SOME_LOST = 3


def recover_run(run: Path) -> int:
    """Recover a run and print what became of each of its parts; returns 0, or 3 where something of
    it is lost.

    Raises UserError in one line for what is no run, or goes on.
    """
    done = recover(run)
    if done.healthy:
        say(f"{run}: whole (exit: {done.exit_word}); nothing to recover")
        return 0
    for part in done.parts:
        say(part.text)
    if done.lost:
        say(f"{run}: {done.exit_word}; lost in part: {len(done.lost)} of {len(done.parts)}")
        return SOME_LOST
    say(f"{run}: {done.exit_word}; all that was written can be read")
    return 0
