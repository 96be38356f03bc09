"""The entry of the command `foretwin`; imports nothing heavy until a command needs it."""

from __future__ import annotations

import os
import signal
import sys

_ENDING = signal.SIGTERM, signal.SIGHUP


def main() -> None:
    """Run the command line and leave with its exit code."""
    # Nothing here renders with MuJoCo, whose look for a window costs each process an interpreter.
    os.environ.setdefault("MUJOCO_GL", "disable")

    for number in _ENDING:
        if signal.getsignal(number) == signal.SIG_DFL:  # else nohup's: nothing ends it
            signal.signal(number, _interrupt)
    from foretwin.orchestrator.commands.cli import run

    sys.exit(run(sys.argv[1:]))


def _interrupt(*_: object) -> None:
    """End as by Ctrl-C, with everything put away; a closed terminal says so twice."""
    for number in _ENDING:
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
