"""Every junction of every extract in every format: nothing raises, every model compiles.

Takes about an hour of one core. Of large extracts every tenth junction has its pictures drawn.
Notes by kind are left in build/every_junction.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import mujoco
import pytest

from foretwin.orchestrator.worlds.opening import open_map
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.export.choices import OPENDRIVE_VERSIONS, SIMULATORS
from foretwin.world_gen.export.formats import FORMATS, ExportOptions
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.report.report import note_kind, report_of
from tests.world_gen.export.judged_sample import QUOTA

NOTES = Path(__file__).parents[3] / "build" / "every_junction"
PICTURES = ("png", "svg")
MANY = 200
"""Of extracts with more junctions, every tenth is drawn."""


def trials(*, drawn: bool) -> list[tuple[str, ExportOptions]]:
    """Return every format with every option that changes the file."""
    car, named = load_vehicle(), (("a", "twin"), ("b", "shadow"), ("c", "ghost"))
    found = [("sdf", ExportOptions(simulator=s, vehicle=car, vehicles=named)) for s in SIMULATORS]
    found += [("opendrive", ExportOptions(opendrive_version=v)) for v in OPENDRIVE_VERSIONS]
    others = [name for name in FORMATS if name not in ("sdf", "opendrive", *PICTURES)]
    return found + [(name, ExportOptions()) for name in (*others, *(PICTURES if drawn else ()))]


def write_all(
    map_file: Path, share: int, shares: int, folder: Path
) -> tuple[list[str], Counter[str]]:
    """Write each `shares`th junction in every format; return what failed, and notes by kind."""
    opened = open_map(map_file)
    index = index_map(opened.osm, opened.graph, opened.junctions)
    failures, kinds = [], Counter[str]()
    for junction in opened.junctions[share::shares]:
        name = junction.summary.id
        lot = int(hashlib.sha256(name.encode()).hexdigest()[:8], 16)
        step = "build"
        try:
            world = build_world(opened.osm, opened.graph, junction, index=index)
            kinds.update(note_kind(note) for note in world.notes)
            step = "report"
            report_of(world).as_json()
            for step, options in trials(drawn=len(opened.junctions) <= MANY or lot % 10 == 0):
                path = folder / f"{share}{FORMATS[step].suffix}"
                FORMATS[step].write(world, path, options)
                if step == "mjcf":
                    mujoco.MjModel.from_xml_path(str(path))
        except Exception as error:  # all failures are to be known, not the first
            failures.append(f"{name}: {step}: {type(error).__name__}: {error}")
    return failures, kinds


@pytest.mark.judge
@pytest.mark.real_data
@pytest.mark.timeout(4 * 3600)
@pytest.mark.parametrize("extract", QUOTA)
def test_every_junction_in_every_format(extract: str, data_dir: Path, tmp_path: Path) -> None:
    shares = os.cpu_count() or 1
    with ProcessPoolExecutor(shares, mp_context=multiprocessing.get_context("spawn")) as pool:
        file = data_dir / extract
        runs = [pool.submit(write_all, file, i, shares, tmp_path) for i in range(shares)]
        results = [run.result() for run in runs]
    kinds = sum((result[1] for result in results), Counter[str]())
    NOTES.mkdir(parents=True, exist_ok=True)
    lines = [f"{count:6d}  {kind}" for kind, count in kinds.most_common()]
    (NOTES / f"{Path(extract).name}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert [failure for result in results for failure in result[0]] == []
