"""SUMO's lights follow the World's; a table in memory stands for SUMO."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from foretwin.sim_worker.virtual_traffic.sumo_lights import SumoLights, groups_of_signals
from foretwin.world_gen.export.opendrive import write_opendrive
from tests.orchestrator.trip import town_world

SIGNALS = ("1", "1", "2", "")
"""Of the links of the light "j"; another light knows none."""
GROUPS = {"1": "n4:g0", "2": "n4:g1"}


class SumoTable:
    """What SUMO is asked and told of its lights."""

    def __init__(self) -> None:
        self.told: list[tuple[str, str]] = []
        self.trafficlight = self

    def getIDList(self) -> tuple[str, ...]:  # noqa: N802
        return "j", "far"

    def getAllProgramLogics(self, name: str) -> tuple[SimpleNamespace, ...]:  # noqa: N802
        return (
            SimpleNamespace(phases=[SimpleNamespace(state=state) for state in ("GGrr", "rrgG")]),
        )

    def getParameter(self, name: str, key: str) -> str:  # noqa: N802
        return SIGNALS[int(key.removeprefix("linkSignalID:"))] if name == "j" else ""

    def setRedYellowGreenState(self, name: str, state: str) -> None:  # noqa: N802
        self.told.append((name, state))

    def setProgram(self, name: str, program: str) -> None:  # noqa: N802
        self.told.append((name, f"program {program}"))


def test_lights_are_set_when_they_change_and_given_back_when_nothing_is_told() -> None:
    sumo = SumoTable()
    lights = SumoLights(sumo, GROUPS)
    lights.show({})
    lights.show({"n4:g0": "green", "n4:g1": "red", "n9:g0": "red"})
    lights.show({"n4:g0": "green", "n4:g1": "red"})
    lights.show({"n4:g0": "amber", "n4:g1": "red_amber"})
    lights.show({"n4:g0": "dark", "n4:g1": "green"})
    lights.show({"n4:g0": "red"})
    lights.show({})
    lights.show({})
    assert sumo.told == [
        ("j", "GGro"), ("j", "yyuo"), ("j", "oogo"), ("j", "rroo"), ("j", "program 0"),
    ]  # fmt: skip


def test_the_groups_stand_in_our_own_export(tmp_path: Path) -> None:
    world = town_world("n44")
    write_opendrive(world, tmp_path / "a.xodr")
    found = groups_of_signals(tmp_path / "a.xodr")
    assert set(found.values()) == {one.group_id for one in world.signals}
    assert len(found) >= len(world.signals)
