"""SUMO's netconvert beside foretwin on the same map: whole processes, and the work inside ours."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import osmium

from tests.benchmarks.map_to_world import NETWORK, make_world
from tests.benchmarks.measuring import Measurement, UnavailableError, wall_minimum_s

REPEATS = 3


class Process(NamedTuple):
    """What one run of a process took: wall seconds and its peak of resident memory."""

    wall_s: float
    peak_mib: float


def measure_on(map_name: str) -> Measurement:
    """Return whole processes' wall seconds on one of the real maps, ours against netconvert's.

    netconvert reads no PBF: it gets such a map as XML, converted beforehand.
    """
    data = os.environ.get("FORETWIN_DATA")
    if not data:
        raise UnavailableError("FORETWIN_DATA does not name the real maps")
    return compare(Path(data) / map_name)


def compare(map_file: Path) -> Measurement:
    """Measure both tools on one map file, run by run in turn; minima over the repeats.

    The value is that of the same job, the road network. What the whole World takes, with ground
    and buildings, of which netconvert makes none, stands beside it.
    """
    netconvert = netconvert_command()
    with tempfile.TemporaryDirectory(prefix="foretwin-bench-") as folder:
        work = Path(folder)
        xml = map_file
        if map_file.suffix == ".pbf":
            xml = work / "map.osm"
            with osmium.SimpleWriter(str(xml)) as writer:
                for item in osmium.FileProcessor(str(map_file)):
                    writer.add(item)
        whole_command = [
            sys.executable, "-m", "tests.benchmarks.map_to_world", str(map_file), str(work),
        ]  # fmt: skip
        theirs_command = [*netconvert, "--osm-files", str(xml), "-o", str(work / "net.xml")]
        ours = compiled_once(work)
        _run([*whole_command, NETWORK], ours)
        _run(whole_command, ours)
        network, whole, theirs = [], [], []
        for _ in range(REPEATS):
            theirs.append(_run(theirs_command))
            network.append(_run([*whole_command, NETWORK], ours))
            whole.append(_run(whole_command, ours))
        inside_s = wall_minimum_s(lambda: make_world(map_file, work, ground=False), repeats=REPEATS)
        whole_inside_s = wall_minimum_s(lambda: make_world(map_file, work), repeats=REPEATS)
    baseline = min(p.wall_s for p in theirs)
    world_s = min(p.wall_s for p in whole)
    return Measurement(
        min(p.wall_s for p in network),
        "s",
        baseline,
        {
            "in_process_s": inside_s,
            "in_process_ratio": inside_s / baseline,
            "world_s": world_s,
            "world_ratio": world_s / baseline,
            "world_in_process_s": whole_inside_s,
            "world_in_process_ratio": whole_inside_s / baseline,
            "peak_mib": min(p.peak_mib for p in network),
            "world_peak_mib": min(p.peak_mib for p in whole),
            "baseline_peak_mib": min(p.peak_mib for p in theirs),
        },
    )


def netconvert_command() -> list[str]:
    """Return the command that runs netconvert from the judges' environment."""
    venv = os.environ.get("JUDGES_VENV")
    if not venv:
        raise UnavailableError("JUDGES_VENV does not name an environment with eclipse-sumo")
    found = sorted(Path(venv).glob("lib/python3*/site-packages/sumo"))
    if not found:
        raise UnavailableError(f"{venv} holds no eclipse-sumo")
    return ["env", f"SUMO_HOME={found[0]}", str(found[0] / "bin" / "netconvert")]


def compiled_once(work: Path) -> dict[str, str]:
    """Return the environment of an installed program: its modules are compiled once, not each time.

    pip compiles them as it installs. Where bytecode may not be written, as in many containers, a
    hundred modules would be compiled anew in each run: 0.11 s.
    """
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return environment | {"PYTHONPYCACHEPREFIX": str(work / "bytecode")}


def _run(command: list[str], environment: dict[str, str] | None = None) -> Process:
    start = time.perf_counter()
    child = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment
    )
    peak_kib = 0
    # A child's own accounting begins with the memory of the process that started it.
    while child.poll() is None:
        peak_kib = max(peak_kib, _high_water_kib(child.pid))
        time.sleep(0.005)
    wall_s = time.perf_counter() - start
    if child.returncode:
        raise RuntimeError(f"{command[0]} ended with {child.returncode}: {' '.join(command)}")
    return Process(wall_s, peak_kib / 1024)


def _high_water_kib(pid: int) -> int:
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    except (FileNotFoundError, ProcessLookupError):
        return 0
    line = next((line for line in status.splitlines() if line.startswith("VmHWM")), "VmHWM: 0 kB")
    return int(line.split()[1])
