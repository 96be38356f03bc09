"""How commands show their help: each in one sentence, none cut short, and what this is."""

from __future__ import annotations

from typing import Annotated, Any

import typer
import typer.core

from foretwin.contracts.terminal import say

EXAMPLE = "Example: "
"""Begins the paragraph of a command's docstring that shows how it is typed."""
SETTINGS = {"help_option_names": ["-h", "--help"]}


class WholeSentences(typer.core.TyperGroup):
    """A group that lists its commands with the whole first paragraph of each."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a row for each command, wrapped at the width of the terminal."""
        rows = []
        for name in self.list_commands(ctx):
            command = self.get_command(ctx, name)
            if command is not None and not command.hidden:
                summary = (command.help or "").split("\n\n")[0]
                rows.append((name, " ".join(summary.split())))
        if rows:
            with formatter.section("Commands"):
                formatter.write_dl(rows)


def _say_version(asked: bool) -> None:
    if not asked:
        return
    from foretwin.contracts.versions import versions

    found = versions()
    shown = {
        "python": "Python",
        "mujoco": "mujoco",
        "eclipse-zenoh": "zenoh",
        "rerun-sdk": "rerun",
    }
    of_libraries = ", ".join(f"{name} {found[key]}" for key, name in shown.items())
    say(f"foretwin {found['foretwin']} ({of_libraries})")
    raise typer.Exit


VersionOption = Annotated[
    bool,
    typer.Option(
        "--version",
        is_eager=True,
        callback=_say_version,
        help="say which foretwin this is, with which mujoco, zenoh and rerun",
    ),
]
