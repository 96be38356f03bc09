"""The entry of the command `foretwin`; imports nothing heavy until a command needs it."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run the command line and leave with its exit code."""
    # Nothing here renders with MuJoCo, whose look for a window costs each process an interpreter.
    os.environ.setdefault("MUJOCO_GL", "disable")

    from foretwin.orchestrator.commands.cli import run

    sys.exit(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
