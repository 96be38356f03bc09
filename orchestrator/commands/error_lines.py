"""How a command that cannot be carried out says so: in one line."""

from __future__ import annotations

import errno
import sys
from collections.abc import Sequence
from typing import Any

from foretwin.contracts.did_you_mean import meant
from foretwin.contracts.exit_codes import INTERNAL
from foretwin.contracts.terminal import say, write_nowhere

NO_PLACE = (
    errno.ENAMETOOLONG, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.ELOOP,
)  # fmt: skip
"""Errors of a place where nothing can be written; the user may find another."""
_OF_PYDANTIC = "Input should be "
_NO_OPTION = "No such option: "


def usage_line(error: Any, arguments: Sequence[str]) -> str:
    """Return a usage error of typer as a line, with the value that was given for the option at
    fault; empty for one that has shown the help already.
    """
    text = " ".join(error.format_message().split())
    if not text:
        return ""
    command = "foretwin" if error.ctx is None else error.ctx.command_path
    if text.startswith(_NO_OPTION):
        given = error.option_name
        known = [name for one in error.ctx.command.params for name in one.opts]
        text = f"{_NO_OPTION}{given}; {meant(given, known)}".removesuffix("; ").strip()
    for option in getattr(getattr(error, "param", None), "opts", ()):
        given = _given_for(option, arguments)
        if given is not None and error.message:
            right = error.message.split(", unable")[0]
            if right.startswith(_OF_PYDANTIC):
                right = f"must be {right.removeprefix(_OF_PYDANTIC)}"
            text = f"{option} {given}: {right}"
    return f"{command}: {text.removesuffix('.')} (see {command} --help)"


def _given_for(option: str, arguments: Sequence[str]) -> str | None:
    for place, argument in enumerate(arguments):
        if argument == option and place + 1 < len(arguments):
            return arguments[place + 1]
        if option.startswith("--") and argument.startswith(f"{option}="):
            return argument.removeprefix(f"{option}=")
    return None


def report(error: Exception) -> int:
    """Say an unexpected error in one line; the traceback goes to a file."""
    import tempfile
    import traceback

    with tempfile.NamedTemporaryFile(
        "w", prefix="foretwin-", suffix=".log", delete=False, encoding="utf-8"
    ) as file:
        traceback.print_exception(error, file=file)
    say(
        f"foretwin: internal error: {type(error).__name__}: {one_line(error)} "
        f"(traceback in {file.name})",
        error=True,
    )
    return INTERNAL


def drop_output() -> None:
    """Forget what cannot be written to a full disk, or what nobody reads any more."""
    try:
        sys.stdout.flush()
    except OSError:
        write_nowhere(sys.stdout)


def flush_output() -> None:
    """Write out what waits; where nobody reads it any more, whoever did has seen enough."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        write_nowhere(sys.stdout)


def one_line(error: BaseException) -> str:
    """Return what is wrong as a line, with the path that a system's error names."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'output'}: {error.strerror.lower()}"
    return " ".join(str(error).split())
