"""The entry of the command `foretwin`; imports nothing heavy until a command needs it."""

from __future__ import annotations

import os
import sys

from foretwin.contracts.end_signals import ignore_end_signals, on_end_signals


def main() -> None:
    """Run the command line and leave with its exit code."""
    # Nothing here renders with MuJoCo, whose look for a window costs each process an interpreter.
    os.environ.setdefault("MUJOCO_GL", "disable")
    # Nor has anything matrices that are worth a second thread; forks do as this process does.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"

    on_end_signals(_interrupt)
    from foretwin.orchestrator.commands.cli import run

    sys.exit(run(sys.argv[1:]))


def _interrupt() -> None:
    """End as by Ctrl-C, with everything put away; a closed terminal says so twice."""
    ignore_end_signals()
    raise KeyboardInterrupt


if __name__ == "__main__":
    main()
