"""`foretwin recover`: makes readable what a run left that did not come to its end."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foretwin.contracts.credentials import runtime_folder
from foretwin.contracts.errors import UserError
from foretwin.contracts.owned_folder import remove_left
from foretwin.orchestrator.agreement.recovered import recovered_agreement
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.record.recovery import RECOVERED, recover

SOME_LOST = 3


def recover_run(run: Path) -> CommandResult:
    """Recover a run and return what became of each of its parts; its code is 0, or 3 where
    something of it is lost.

    Raises UserError in one line for what is no run, or goes on.
    """
    done = recover(run, judge=recovered_agreement)
    with contextlib.suppress(UserError):
        remove_left(runtime_folder())  # with the passwords of drives that were killed
    parts = [part._asdict() for part in done.parts]
    body = {"run": run, "exit": done.exit_word, "whole": done.healthy, "parts": parts}
    if done.healthy:
        return CommandResult(body, f"{run}: whole (exit: {done.exit_word}); nothing to recover")
    body |= {"ledger": done.record.get("ledger"), RECOVERED: done.record.get(RECOVERED)}
    lines = [*(part.text for part in done.parts), *ledger_lines(done.record)]
    how = "all that was written can be read"
    if done.lost:
        how = f"lost in part: {len(done.lost)} of {len(done.parts)}"
    lines.append(f"{run}: {done.exit_word}; {how}")
    return CommandResult(body, "\n".join(lines), SOME_LOST if done.lost else 0)


def ledger_lines(record: Mapping[str, Any]) -> list[str]:
    """Return what became of everything that was to be done, as far as anybody knows."""
    ledger, words = record.get("ledger") or {}, record.get(RECOVERED) or {}
    lines = []
    for name, counts in ledger.items():
        if counts is None:
            continue
        numbers = [f"{count} {of}" for of, count in counts.items() if isinstance(count, int)]
        lines.append(f"{name}: {numbers[0]} = {' + '.join(numbers[1:])}")
    if (until_s := words.get("told_until_s")) is not None:
        lines.append(f"what no table tells is known up to {until_s:.1f} s of the drive")
    if unknown := words.get("unknown"):
        lines.append(f"unknown: {', '.join(unknown)}")
    return [line.replace("_", " ") for line in lines]
