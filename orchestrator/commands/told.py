"""What a command came to, and the one way in which all of them say it: in words, or as JSON."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Annotated, Any, NamedTuple

import typer

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import say

_JSON = "as_json"
_WRITTEN = {"out": "--out", "target": "TARGET"}
"""What names a file or folder to write, and how it is called."""
JsonOption = Annotated[
    bool, typer.Option("--json", help="say what it came to as JSON, and nothing else on stdout")
]


class CommandResult(NamedTuple):
    """What a command came to: for programs, in words, and as an exit code.

    `body` is what `print_json` takes, or makes that where it takes long; `words` are lines of text,
    or print themselves.
    """

    body: object
    words: str | Callable[[], None] = ""
    code: int = 0


def told(command: Callable[..., CommandResult | None]) -> Callable[..., None]:
    """Return a command with the option --json, which says what it came to and ends with its code.

    A group that leaves the word to one of its commands returns None, and says nothing.
    """

    @functools.wraps(command)
    def saying(**asked: Any) -> None:
        as_json = asked.pop(_JSON)
        _refuse(asked, as_json=as_json)
        came_to = command(**asked)
        if came_to is not None:
            print_told(came_to, as_json=as_json)
            raise typer.Exit(came_to.code)

    taken = inspect.signature(command, eval_str=True)
    option = inspect.Parameter(_JSON, inspect.Parameter.KEYWORD_ONLY, default=False)
    parameters = (*taken.parameters.values(), option.replace(annotation=JsonOption))
    saying.__signature__ = taken.replace(parameters=parameters)  # type: ignore[attr-defined]
    saying.__annotations__ = {one.name: one.annotation for one in parameters}
    return saying


def _refuse(asked: Mapping[str, object], *, as_json: bool) -> None:
    """Raise UserError for what no command can do with what is asked for on its line."""
    if as_json and asked.get("as_csv"):
        raise UserError("--csv and --json: name one of them")
    for name, option in _WRITTEN.items():
        if str(asked.get(name)) == "-":
            raise UserError(f"{option} -: a name is needed; no file is written to stdout")


def print_told(came_to: CommandResult, *, as_json: bool) -> None:
    """Print what a command came to, as JSON or in words."""
    if as_json:
        from foretwin.orchestrator.commands.output import print_json

        print_json(came_to.body() if callable(came_to.body) else came_to.body)
    elif callable(came_to.words):
        came_to.words()
    elif came_to.words:
        say(came_to.words)
