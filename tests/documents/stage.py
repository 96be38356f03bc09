"""What the folder of a page holds before its first command, and how the command is called there.

The package is installed from a wheel into an environment of its own, which is lent the libraries of
this one, so that no index is asked. Drives are cut short: see `SHORT`.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq

from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from tests.documents.blocks import ROOT

SHORT = {"--end": "6", "--futures": "4", "--rate": "0.5", "--tuning": "off"}
"""Added to every `foretwin drive` that says nothing of these."""
CROSSING, RING = "n44", "n11"
"""Two junctions of the drawn town, one with lights."""
SHIM = """#!{python}
import os, sys
words = sys.argv[1:]
if words[:1] == ["drive"] and "--help" not in words and "--config" not in words:
    for option, value in {short}.items():
        if option not in words and not (option == "--end" and "live" in words):
            words += [option, value]
os.execv({real!r}, [{real!r}, *words])
"""
PYTHON_SHIM = """#!/bin/sh
"{python}" "$@" || exit
[ "$1 $2" = "-m venv" ] || exit 0
for folder in "$3"/lib/python*/site-packages; do echo "{lent}" > "$folder/lent.pth"; done
"""


class Installed(NamedTuple):
    """An environment in which foretwin is installed from its wheel, and a finished drive."""

    wheel: Path
    programs: Path
    """Folder of `foretwin`, `python`, `pip`."""
    lent: Path
    run: Path
    """A run of the drawn town, 101 s in lock step."""
    short: Path
    """The first 20 s of it, for what plays a run again."""
    table: Path
    """Its recording as CSV, with the declaration beside it."""

    def environment(self, home: Path) -> dict[str, str]:
        """Return what commands are started with: no display, no index, the wheel alone."""
        kept = {k: v for k, v in os.environ.items() if k not in {"DISPLAY", "WAYLAND_DISPLAY"}}
        for name in ("PYTHONPATH", "PYTHONDONTWRITEBYTECODE", "VIRTUAL_ENV", "FORETWIN_DATA"):
            kept.pop(name, None)
        return kept | {
            "PATH": f"{self.programs}:{kept['PATH']}",
            "HOME": str(home),
            "XDG_CACHE_HOME": str(home / ".cache"),
            "PIP_NO_INDEX": "1",
            "PIP_NO_BUILD_ISOLATION": "0",
            "PIP_DISABLE_PIP_VERSION_CHECK": "1",
            "PIP_ROOT_USER_ACTION": "ignore",
            "PIP_QUIET": "2",
            "COLUMNS": "120",
        }


def build_wheel(folder: Path) -> Path:
    """Build the wheel of the working tree, with what is installed."""
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "--quiet",
            "--no-deps",
            "--no-build-isolation",
            "--no-index",
            "-w",
            folder,
            ROOT,
        ],
        check=True,
    )
    (built,) = folder.glob("foretwin-*.whl")
    return built


def lend_libraries(folder: Path) -> Path:
    """Make a folder with all libraries of this environment but foretwin, as links."""
    folder.mkdir()
    for library in Path(np.__file__).parents[1].iterdir():
        if "foretwin" not in library.name and library.suffix != ".pth":
            (folder / library.name).symlink_to(library)
    return folder


def install(folder: Path) -> Installed:
    """Build, install, and drive twice."""
    wheel, lent = build_wheel(folder / "wheel"), lend_libraries(folder / "lent")
    home = folder / "environment"
    venv.create(home, with_pip=True)
    (libraries,) = (home / "lib").glob("python*/site-packages")
    (libraries / "lent.pth").write_text(f"{lent}\n", encoding="utf-8")
    programs = folder / "programs"
    programs.mkdir()
    python = home / "bin" / "python"
    _write_program(programs / "python3", PYTHON_SHIM.format(python=python, lent=lent))
    for name in ("python", "pip"):  # a link would hide which environment they belong to
        _write_program(programs / name, f'#!/bin/sh\nexec "{home}/bin/{name}" "$@"\n')
    installed = Installed(wheel, programs, lent, folder, folder, folder)
    around = installed.environment(folder)
    subprocess.run([programs / "pip", "install", "--quiet", wheel], check=True, env=around)
    real = str(home / "bin" / "foretwin")
    _write_program(programs / "foretwin", SHIM.format(python=python, short=SHORT, real=real))
    shutil.copytree(ROOT / "examples" / "tuning", folder / "examples" / "tuning")
    config = folder / "examples" / "tuning" / "first_drive.toml"

    def foretwin(*words: str | Path) -> None:
        subprocess.run(
            [real, *words], check=True, env=around, cwd=folder, stdout=subprocess.DEVNULL
        )

    foretwin("drive", "--config", config)
    foretwin("drive", "--config", config, "--end", "20", "--out", "short")
    (run,), (short,) = (folder / "runs" / "tuning").iterdir(), (folder / "short").iterdir()
    table = folder / "drive.csv"
    foretwin("convert", run / "drive.mcap", table)
    return installed._replace(run=run, short=short, table=table)


def _write_program(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)


def set_stage(folder: Path, what: tuple[str, ...], installed: Installed) -> None:
    """Put the things that a page names into its folder, each as `kind:path`."""
    for item in what:
        kind, _, name = item.partition(":")
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if kind == "map":
            shutil.copy(MAP_FILE, place)
        elif kind == "route":
            shutil.copy(ROUTE_FILE, place)
        elif kind == "log":
            shutil.copy(installed.run / "drive.mcap", place)
        elif kind in ("csv", "table"):
            shutil.copy(installed.table, place)
            if kind == "table":
                shutil.copy(f"{installed.table}.toml", f"{place}.toml")
        elif kind in ("run", "short"):
            shutil.copytree(installed.run if kind == "run" else installed.short, place)
        elif kind == "worlds":
            shutil.copytree(installed.run / "worlds", place)
        elif kind == "vehicle":
            shutil.copy(ROOT / "sim_worker" / "vehicle" / "bmw_320i.toml", place)
        elif kind == "progress":
            shutil.copy(ROOT / "orchestrator" / "forecast" / "progress.npz", place)
        elif kind == "wheel":
            shutil.copy(installed.wheel, folder)
        elif kind == "examples":
            shutil.copytree(ROOT / "examples" / name, folder / "examples" / name)
        elif kind == "package":
            shutil.copytree(ROOT / "examples" / "planner_package", place, dirs_exist_ok=True)
        else:
            raise AssertionError(f"no such thing on a stage: {item}")


def names_in(run: Path) -> dict[str, str]:
    """Return what pages may call `{future}`, `{world}` and `{ring}` (two of its
    Worlds) and `{run}` of a run."""
    columns = ["future_id", "world_id", "junction_id"]
    futures = pq.read_table(run / "results" / "futures.parquet", columns=columns).to_pylist()
    worlds = {row["junction_id"]: row["world_id"] for row in futures}
    record = json.loads((run / "run.json").read_text(encoding="utf-8"))
    return {
        "{future}": futures[0]["future_id"],
        "{world}": worlds[CROSSING],
        "{ring}": worlds[RING],
        "{run}": record["run_id"],
    }
