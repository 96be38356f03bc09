"""Compiles and runs `bare_mj_step.c`, the baseline of everything that steps a model."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

from tests.benchmarks.measuring import UnavailableError

SOURCE = Path(__file__).with_name("bare_mj_step.c")


@contextmanager
def bare_loop(
    model: mujoco.MjModel, *, seconds: float, speed_mps: float, joint: str = "ego_x"
) -> Iterator[Callable[[], float]]:
    """Yield what returns the CPU seconds in which one thread steps `model` through `seconds`.

    Let these be as many as what it is held against simulates: on a busy machine, the shortest of
    many short runs is luckier than that of a few long ones. Raises UnavailableError where no C
    compiler is installed.
    """
    steps = round(seconds / model.opt.timestep)
    with tempfile.TemporaryDirectory() as folder:
        program, file = Path(folder) / "bare_mj_step", Path(folder) / "model.mjb"
        _compile(program)
        mujoco.mj_saveModel(model, str(file), None)

        def run() -> float:
            printed = subprocess.run(
                [program, file, str(steps), "1", str(speed_mps), joint],
                check=True, capture_output=True, text=True,
            ).stdout  # fmt: skip
            return float(printed.split()[0])

        yield run


def _compile(program: Path) -> None:
    """Build against the headers and the library inside the mujoco wheel."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise UnavailableError("no C compiler: install gcc to measure against bare mj_step")
    package = Path(mujoco.__file__).parent
    (library,) = package.glob("libmujoco.so*")
    subprocess.run(
        [
            compiler, "-O2", "-std=gnu11", "-o", program, SOURCE, f"-I{package / 'include'}",
            library, f"-Wl,-rpath,{package}", "-lm",
        ],
        check=True,
    )  # fmt: skip
