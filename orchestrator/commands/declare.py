"""The command `declare`: a table's declaration, proposed, proved, written, and read once."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.partial_file import partial_file
from foretwin.contracts.terminal import say
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.telemetry.logs.declare import Proposal, propose
from foretwin.telemetry.logs.declare.choice import OpenQuestion
from foretwin.telemetry.logs.write_declaration import comment_lines, declaration_toml
from foretwin.world_gen.countries.outlines import place_at

DECLARED_MARK = "# Proposed by foretwin declare"
"""How a declaration begins that `declare` may replace."""


def declare(file: Path, *, out: Path | None, answers: tuple[str, ...]) -> CommandResult:
    """Write the declaration of a table, and return it with on what grounds.

    Asks one question at most, and where there is a terminal alone. Raises UserError where a file
    would be replaced that somebody wrote, or what the data cannot answer was not answered either.
    """
    if not file.is_file():
        raise FileNotFoundError(f"table {file}: no such file")
    target = out or file.with_name(file.name + ".toml")
    _check_own(target)
    given = _answers(answers)
    found = propose(file, answers=given, country_of=lambda lat, lon: place_at(lat, lon).code)
    if found.question is not None:
        answer = _asked(file, found.question)
        found = propose(
            file,
            answers=given | {found.question.key: answer},
            country_of=lambda lat, lon: place_at(lat, lon).code,
        )
    text = text_of(file.name, found)
    with partial_file(target) as partial:
        partial.write_text(text, encoding="utf-8")
    from foretwin.telemetry.logs.csv_table import open_csv

    log = open_csv(file, declaration=target)
    lasts_s = ((log.info.end_stamp_ns or 0) - log.info.start_stamp_ns) * 1e-9
    read = f"{target}: read with it, {lasts_s:.1f} s of {', '.join(log.info.sends)}"
    body = {
        "table": file,
        "declaration": target,
        "declared": tomllib.loads(text),
        "evidence": found.evidence,
        "unknown": found.unknown,
        "lasts_s": round(lasts_s, 3),
        "sends": log.info.sends,
    }
    return CommandResult(body, f"{text.partition(chr(10))[2].strip()}\n\n{read}")


def text_of(name: str, found: Proposal) -> str:
    """Return the declaration's text: the mark, what is unknown, and each section's evidence."""
    assert found.declaration is not None
    text = f"{DECLARED_MARK}, which may replace it; without this line it is kept.\n"
    text += comment_lines([f"Columns of {name} by what they do. Unknown, and not guessed:"])
    text += comment_lines([f"- {line}" for line in found.unknown] or ["- nothing"])
    return text + declaration_toml(found.declaration, said=found.evidence)


def _answers(pairs: tuple[str, ...]) -> dict[str, str]:
    found = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not value:
            raise UserError(f"--answer {pair}: no KEY=VALUE")
        found[key.strip()] = value.strip()
    return found


def _asked(file: Path, question: OpenQuestion) -> str:
    choices = f" ({' or '.join(question.choices)})" if question.choices else ""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        example = question.choices[0] if question.choices else "…"
        raise UserError(
            f"{file}: {question.text}{choices}; the table does not tell: say it with"
            f" --answer {question.key}={example}"
        )
    say(f"{question.text}{choices}")
    return input(f"{question.key} = ").strip()


def _check_own(target: Path) -> None:
    if target.exists() and not target.read_bytes().startswith(DECLARED_MARK.encode()):
        raise UserError(
            f"{target}: is there and not of `declare`; name another with --out, or move it"
        )
