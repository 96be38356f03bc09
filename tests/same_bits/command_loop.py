"""Runs commands of one command line one after the other, in one process: imports are paid once.

`python command_loop.py MODULE COMMANDS.json` writes the exit codes to `COMMANDS.json.codes`. Each
command is {"arguments": [...], "screen": FILE}; it sees what `python -m MODULE` would see.
"""

from __future__ import annotations

import contextlib
import json
import runpy
import sys
from pathlib import Path


def run(module: str, arguments: list[str], screen: Path) -> int | str:
    """Run one command; returns its exit code, or in words what it died of."""
    sys.argv = [module, *arguments]
    with screen.open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file):
        try:
            runpy.run_module(module, run_name="__main__", alter_sys=True)
        except SystemExit as end:
            return 0 if end.code is None else end.code
        except Exception as error:
            return f"{type(error).__name__}: {error}"
    return 0


if __name__ == "__main__":
    commands = Path(sys.argv[2])
    entry = sys.argv[1]
    codes = [
        run(entry, command["arguments"], Path(command["screen"]))
        for command in json.loads(commands.read_text(encoding="utf-8"))
    ]
    commands.with_name(commands.name + ".codes").write_text(json.dumps(codes), encoding="utf-8")
