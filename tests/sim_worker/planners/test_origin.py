"""What a planner is made of, for those who keep its results."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.sim_worker.planners.origin import PlannerOrigin, files_digest
from foretwin.sim_worker.planners.registry import check_planner, planner_names, planner_origin
from tests.sim_worker.planners.installed import install

CODE = """
raise RuntimeError("nobody may run this to ask where it is from")
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on the path with one planner, `mine`, of the module `planners_of_origin`."""
    install(tmp_path, "planners_of_origin", CODE, mine="Mine")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_two_of_one_name_are_refused_rather_than_one_of_them_taken(installed: Path) -> None:
    install(installed, "other_planners", CODE, mine="Mine", constant_speed="Mine")
    words = "planner 'mine': other_planners and planners_of_origin offer one; uninstall one, or"
    with pytest.raises(UserError, match=words):
        check_planner("mine")
    check_planner("pure_pursuit_idm")
    words = "planner 'constant_speed' is one of foretwin; rename the entry of other_planners"
    with pytest.raises(UserError, match=words):
        check_planner("constant_speed")


def test_a_package_tells_its_name_and_version_and_is_not_run(installed: Path) -> None:
    origin = planner_origin("mine")
    assert origin[:2] == ("planners_of_origin", "1.0")
    assert "planners_of_origin" not in sys.modules


def test_a_change_of_a_file_is_seen_without_another_version(installed: Path) -> None:
    before = planner_origin("mine")
    (installed / "planners_of_origin.py").write_text(CODE + "# another line\n")
    after = planner_origin("mine")
    assert after._replace(files_sha256=before.files_sha256) == before
    assert after.files_sha256 != before.files_sha256


def test_another_version_is_seen_without_a_change_of_a_file(installed: Path) -> None:
    before = planner_origin("mine")
    info = installed / "planners_of_origin-1.0.dist-info" / "METADATA"
    info.write_text(info.read_text().replace("Version: 1.0", "Version: 1.1"))
    assert planner_origin("mine") == before._replace(version="1.1")


def test_every_file_of_a_package_counts_but_bytecode_and_what_is_hidden(tmp_path: Path) -> None:
    package = tmp_path / "package"
    (package / "inner" / "__pycache__").mkdir(parents=True)
    (package / ".git").mkdir()
    (package / "__init__.py").write_text("")
    seen = {files_digest([package])}
    for name in ("inner/__pycache__/x.pyc", ".git/HEAD", "inner/.hidden"):
        (package / name).write_text("anything")
        assert files_digest([package]) in seen
    for name in ("inner/other.py", "weights.npz"):
        (package / name).write_text("anything")
        assert files_digest([package]) not in seen
        seen.add(files_digest([package]))
    (package / "inner" / "other.py").rename(package / "inner" / "renamed.py")
    assert files_digest([package]) not in seen


def test_those_of_foretwin_are_told_as_its_own() -> None:
    origins = {planner_origin(name) for name in ("pure_pursuit_idm", "frenet_lattice")}
    assert [(o.distribution, bool(o.version)) for o in origins] == [("foretwin", True)]
    assert isinstance(next(iter(origins)), PlannerOrigin)


def test_an_unknown_name_is_told_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=f"unknown planner 'nobody'; one of {planner_names()[0]}"):
        planner_origin("nobody")
