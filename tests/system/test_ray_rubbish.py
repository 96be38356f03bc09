"""A node of Ray that answers with rubbish: told once, and others play what it was given.

Needs root and RAY_VENV, an environment with foretwin[ray].
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from tests.system.ray_nodes import RayNodes
from tests.system.test_sweep_on_ray import TOWN, on, summary

pytestmark = [pytest.mark.judge, pytest.mark.timeout(1200)]

SPOILS = """
import importlib.util, sys

class Spoils:
    def find_spec(self, name, path=None, target=None):
        if name != "foretwin.sim_worker.seat":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        executes = spec.loader.exec_module

        def executed(module):
            executes(module)
            answer = module.Seat.answer

            def spoilt(self, question, world):
                found = answer(self, question, world)
                rubbish = found.data and question.channel == "job"
                return found._replace(data={rubbish}) if rubbish else found

            module.Seat.answer = spoilt

        spec.loader.exec_module = executed
        return spec

sys.meta_path.insert(0, Spoils())
"""


@pytest.mark.parametrize(
    "rubbish", ["b'no message'", "found.data[:-9]", "found.data.replace(b'PAR1', b'RAP1')"]
)
def test_rubbish_of_a_node_is_told_in_one_line_and_others_play_it(
    tmp_path: Path, rubbish: str
) -> None:
    spec = tmp_path / "town.toml"
    spec.write_text(TOWN)
    assert run(["sweep", str(spec), "--out", str(tmp_path / "zenoh")]) == 0
    by_processes = summary(tmp_path / "zenoh")
    spoils = tmp_path / "spoils"
    spoils.mkdir()
    (spoils / "sitecustomize.py").write_text(SPOILS.replace("{rubbish}", rubbish))
    with RayNodes(2) as own:
        own.start(0)
        own.start(1, before_path=spoils)
        ended = own.run(*on(own, spec, tmp_path / "out", "--json"))
    print(ended.stderr)
    found = json.loads(ended.stdout)
    assert (ended.returncode, found["failed"]) == (0, 0), ended.stderr
    assert found["rows_sha256"] == by_processes["rows_sha256"]
    assert "Traceback" not in ended.stderr
