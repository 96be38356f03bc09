"""Every exit code has words, and what ends a command is one of them."""

from __future__ import annotations

from foretwin.contracts.exit_codes import EXIT_CODES, INTERRUPTED, PARTLY, USER
from foretwin.orchestrator.commands.cli import EXIT_INTERRUPTED, EXIT_USER
from foretwin.orchestrator.drive.exit_words import exit_code


def test_every_code_has_words() -> None:
    assert sorted(EXIT_CODES) == [0, 1, 2, 3, 130]
    assert all(EXIT_CODES.values())


def test_commands_end_with_these() -> None:
    assert (EXIT_USER, EXIT_INTERRUPTED) == (USER, INTERRUPTED) == (2, 130)
    assert PARTLY == 3
    assert {exit_code(how, whole=True) for how in ("completed", "interrupted", "failed")} <= set(
        EXIT_CODES
    )
