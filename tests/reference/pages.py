"""Pages of reference, from the types of files and messages and the tables of columns and codes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from foretwin.contracts.exit_codes import EXIT_CODES
from foretwin.contracts.field_words import fields_of, summary_of, tables_of
from foretwin.contracts.keys import CHANNELS
from foretwin.orchestrator.commands.config import Key, keys_of, text_of
from foretwin.orchestrator.commands.config_formats import KINDS, RANGES
from foretwin.orchestrator.record.results import TABLES
from tests.reference.table_words import ROWS, meaning_of

FOLDER = Path(__file__).parents[2] / "docs" / "reference"
MADE = "<!-- Made by `python -m tests.reference`; change the types that it is made of. -->\n\n"


def pages() -> dict[str, str]:
    """Return every page by its name."""
    files = {f"{kind}.md": file_page(kind) for kind in KINDS}
    rest = {"channels.md": channels(), "tables.md": tables(), "exit-codes.md": exit_codes()}
    return {"index.md": index(), **files, **rest}


def index() -> str:
    """Return the page that leads to the others."""
    rows = [(f"[{kind}]({kind}.md)", one.what) for kind, one in KINDS.items()]
    rows += [
        ("[tables](tables.md)", "columns of a run's and a sweep's Parquet files"),
        ("[channels](channels.md)", "what is said on the bus"),
        ("[exit codes](exit-codes.md)", "how commands end"),
    ]
    return (
        f"{MADE}# Reference\n\n`foretwin config --explain KEY` says the same of keys of files.\n\n"
        f"{table(('page', 'what it tells'), rows)}"
    )


def file_page(kind: str) -> str:
    """Return the page of a kind of file: each table of it, key by key."""
    found, top = KINDS[kind], KINDS[kind].type
    text = (
        f"{MADE}# {kind}: {found.what}\n\n{summary_of(top)}\n\n"
        f"`foretwin config --example --kind {kind}` writes one, `foretwin config --check FILE` "
        "says whether one can be used.\n"
    )
    by_type: dict[type, list[Key]] = {}
    for key in keys_of(kind):
        by_type.setdefault(key.type, []).append(key)
    for struct in tables_of(top):
        keys = {key.field.name: key for key in by_type[struct]}
        title = "" if struct is top else f"\n## {struct.__name__}\n\n{summary_of(struct)}\n"
        rows = [
            (
                f"`{name}`",
                key.field.kind,
                _default(key),
                str(RANGES.get((struct, name), "")),
                text_of(key),
            )
            for name, key in keys.items()
        ]
        text += f"{title}\n{table(('key', 'kind', 'default', 'range', 'meaning'), rows)}"
    return text


def channels() -> str:
    """Return the page of the bus: each channel, and what its messages hold."""
    rows, kinds = [], dict[type[msgspec.Struct], None]()
    for name, channel in CHANNELS.items():
        kinds |= {one: None for one in (channel.kind, channel.reply) if one is not None}
        reply = "" if channel.reply is None else f"; answer {_link(channel.reply)}"
        rows.append(
            (
                f"`{name}`",
                f"`{channel.key}`",
                f"{_link(channel.kind)}{reply}",
                "on demand" if channel.rate_hz is None else f"{channel.rate_hz:g}",
                ", ".join(w.role if w.process is None else w.process for w in channel.writers),
                channel.purpose,
            )
        )
    head = ("channel", "key", "message", "Hz", "who says it", "what for")
    text = f"{MADE}# Channels of the bus\n\n{table(head, rows)}"
    for kind in kinds:
        fields = [(f"`{f.name}`", f.kind, f.text) for f in fields_of(kind)]
        text += f"\n## {kind.__name__}\n\n{summary_of(kind)}\n"
        if fields:
            text += f"\n{table(('field', 'kind', 'meaning'), fields)}"
    return text


def tables() -> str:
    """Return the page of Parquet files: each table, column by column."""
    text = (
        f"{MADE}# Columns of tables\n\nOf a drive they lie in `results/`, of a sweep in `rows/`, "
        "`jobs/` and `road_users/`. A column is null where it does not apply; its unit ends its "
        "name.\n"
    )
    for name, schema in TABLES.items():
        rows = [(f"`{one.name}`", str(one.type), meaning_of(name, one.name)) for one in schema]
        text += f"\n## {name}\n\nA row is {ROWS[name]}.\n\n"
        text += table(("column", "type", "meaning"), rows)
    return text


def exit_codes() -> str:
    """Return the page of exit codes."""
    rows = [(str(code), text) for code, text in EXIT_CODES.items()]
    return f"{MADE}# Exit codes\n\n{table(('code', 'meaning'), rows)}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(_cell(one) for one in line)} |\n" for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _default(key: Key) -> str:
    if key.field.required:
        return "needed"
    return f"`{key.field.shown_default}`" if key.field.shown_default else ""


def _link(kind: type) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"
