"""Drawing without a screen, by EGL: on a GPU, or by Mesa's llvmpipe where there is none."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import say

_NEEDED = "cameras need EGL: a GPU's driver, or Mesa (on Debian: libegl1 libgl1-mesa-dri)"
_WITHIN_S = 60.0


class DrawingError(UserError):
    """Nothing can be drawn here, or not any more."""


@contextlib.contextmanager
def drawing() -> Iterator[None]:
    """Say in one line what a driver says; raises DrawingError."""
    try:
        yield
    except DrawingError:
        raise
    except Exception as error:  # each library on the way raises what it likes
        line = " ".join(str(error).split()) or type(error).__name__
        raise DrawingError(f"{_NEEDED}: {line}") from error


def drawing_context(width_px: int, height_px: int) -> Any:
    """Return a context of OpenGL of this size, current in this thread; raises DrawingError where
    there is none.

    Whatever MUJOCO_GL says: commands switch it off, since they draw nothing.
    """
    with drawing():
        from mujoco.egl import GLContext

        context = GLContext(width_px, height_px)
        context.make_current()
    return context


def check_drawing() -> None:
    """Raise UserError where nothing can be drawn on this machine.

    Asked of a process of its own: libraries that draw start threads, and who asks forks later.
    """
    done = subprocess.run(
        [sys.executable, "-P", "-m", __name__], capture_output=True, text=True, timeout=_WITHIN_S,
        check=False,
    )  # fmt: skip
    if done.returncode:
        lines = (done.stdout + done.stderr).strip().splitlines() or [f"ended {done.returncode}"]
        raise UserError(lines[-1] if lines[-1].startswith(_NEEDED) else f"{_NEEDED}: {lines[-1]}")


def main() -> int:
    """Draw nothing, once; 2 where that cannot be done, and say why."""
    try:
        drawing_context(16, 16).free()
    except UserError as error:
        say(str(error))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
