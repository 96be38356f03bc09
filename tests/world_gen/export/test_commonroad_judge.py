"""What commonroad-io says of scenarios: it reads back all that was written, without a word."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from foretwin.contracts.world import World
from foretwin.world_gen.export.commonroad import write_commonroad
from tests.world_gen.drawn_maps import roundabout, world_of
from tests.world_gen.export.judged_sample import sample_worlds
from tests.world_gen.export.judges import ask_judge, judges_python
from tests.world_gen.export.signalled import signalled_crossing


def assert_accepted(paths: list[Path], worlds: list[World]) -> None:
    verdicts = ask_judge("load_commonroad.py", [{"path": str(path)} for path in paths])
    # Where the map turns a lane around on the spot, no ground lies between its borders.
    folded = sum(len(verdict["polygons"]) for verdict in verdicts.values())
    assert folded <= 0.001 * sum(verdict["lanelets"] for verdict in verdicts.values())
    for path, drawn in zip(paths, worlds, strict=True):
        verdict = verdicts[str(path)]
        assert verdict["schema"] == []
        assert verdict["faults"] == []
        assert verdict["warnings"] == []
        # The reader tells that it renames the 2020a format's successors, and nothing else.
        assert set(verdict["said"]) <= {"successorRight", "successorStraight", "successorLeft"}
        root = etree.parse(str(path)).getroot()
        found = list(root.iterfind("intersection"))
        assert verdict["lanelets"] == len(drawn.lanes) + len(drawn.connections) + len(
            drawn.crossings
        )
        assert verdict["intersections"] == len(found)
        assert verdict["incomings"] == sorted(len(list(i.iterfind("incoming"))) for i in found)
        assert verdict["lights"] == len(drawn.signals)
        assert verdict["location"] == pytest.approx(
            [drawn.frame.origin.lat_deg, drawn.frame.origin.lon_deg]
        )


@pytest.mark.judge
def test_commonroad_reads_drawn_worlds_back(tmp_path: Path) -> None:
    judges_python()
    worlds = [signalled_crossing(), world_of(roundabout())]
    paths = []
    for i, drawn in enumerate(worlds):
        paths.append(tmp_path / f"{i}.xml")
        write_commonroad(drawn, paths[-1])
    assert_accepted(paths, worlds)


@pytest.mark.judge
@pytest.mark.real_data
def test_commonroad_reads_the_sampled_worlds_back(data_dir: Path, tmp_path: Path) -> None:
    judges_python()
    paths, worlds = [], []
    for sampled in sample_worlds(data_dir):
        paths.append(tmp_path / f"{sampled.name}.xml")
        write_commonroad(sampled.world, paths[-1])
        worlds.append(sampled.world)
    assert len(worlds) == 60
    assert_accepted(paths, worlds)
