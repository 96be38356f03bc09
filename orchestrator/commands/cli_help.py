"""What all commands have: help in whole sentences, what this is, and options that stand once."""

from __future__ import annotations

import collections
from collections.abc import Callable
from typing import Annotated, Any

import typer
import typer.core
from typer.models import CommandFunctionType

from foretwin.contracts.terminal import say

EXAMPLE = "Example: "
"""Begins the paragraph of a command's docstring that shows how it is typed."""
SETTINGS = {"help_option_names": ["-h", "--help"]}


def _refuse_repeated(command: Any, ctx: Any, args: list[str]) -> None:
    """Refuse an option that takes one value and stands twice; click keeps the last, silently."""
    if ctx.resilient_parsing:  # nothing is refused while a shell completes
        return
    _, _, given = command.make_parser(ctx).parse_args(args=list(args))
    for one, count in collections.Counter(given).items():
        of_one_value = one.param_type_name == "option" and not (one.multiple or one.is_flag)
        if of_one_value and count > 1:
            name = max(one.opts, key=len)
            ctx.fail(f"{name}: takes one value, and is given {count} times")


class TakenOnce(typer.core.TyperCommand):
    """A command that refuses a second value of an option that takes one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command's words. Raises typer's usage error."""
        _refuse_repeated(self, ctx, args)
        return super().parse_args(ctx, args)


class WholeSentences(typer.core.TyperGroup):
    """A group that lists its commands with the whole first paragraph of each."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of the group itself. Raises typer's usage error."""
        _refuse_repeated(self, ctx, args)
        return super().parse_args(ctx, args)

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


class CommandGroup(typer.Typer):
    """Commands that all read their words and show their help in the same way."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(cls=WholeSentences, **settings)

    def command(
        self, name: str | None = None, **settings: Any
    ) -> Callable[[CommandFunctionType], CommandFunctionType]:
        """Return what registers a command under a name."""
        return super().command(name, cls=TakenOnce, **settings)


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
