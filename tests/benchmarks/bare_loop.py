"""Compiles and runs `bare_mj_step.c`, the baseline of everything that steps a model."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import mujoco

from tests.benchmarks.measuring import UnavailableError

SOURCE = Path(__file__).with_name("bare_mj_step.c")


def simulated_seconds_per_cpu_second(
    model: mujoco.MjModel, *, seconds: float, repeats: int, speed_mps: float, joint: str
) -> float:
    """Return what a bare C loop reaches on `model` with one thread; the best of `repeats`.

    Raises UnavailableError where no C compiler is installed.
    """
    steps = round(seconds / model.opt.timestep)
    with tempfile.TemporaryDirectory() as folder:
        program, file = Path(folder) / "bare_mj_step", Path(folder) / "model.mjb"
        _compile(program)
        mujoco.mj_saveModel(model, str(file), None)
        printed = subprocess.run(
            [program, file, str(steps), str(repeats), str(speed_mps), joint],
            check=True, capture_output=True, text=True,
        ).stdout  # fmt: skip
    cpu_seconds, timestep_s = map(float, printed.split())
    return steps * timestep_s / cpu_seconds


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
