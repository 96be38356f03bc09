"""Driving stacks in a sweep's spec: their tables, and what decides on a sweep's identity."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.planner_link import PlannerJoined
from foretwin.orchestrator.sweep.folder import fingerprint_of, planner_origins
from foretwin.orchestrator.sweep.jobs import JobMaker
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.spec import Loaded, SweepSpec, check_spec, load_spec
from foretwin.orchestrator.sweep.stacks import RemoteStack
from foretwin.orchestrator.sweep.workers import task_timeout_s, worker_setup
from tests.orchestrator.sweeps import SMALL, alone, places_of, small_sweep
from tests.sim_worker.planners.a_stack import spec_of
from tests.sim_worker.planners.installed import install
from tests.system.foretwin_command import REPOSITORY

COVERS = ("foretwin.orchestrator.sweep.workers",)

MINE = PlannerJoined(name="mine", version="1.0", link=2)


def with_stack(loaded: Loaded, says: PlannerJoined = MINE, **changed: object) -> Loaded:
    """Let a stack be the only planner of a sweep that is loaded already."""
    stack = RemoteStack(**({"command": "python mine.py"} | changed))
    spec = msgspec.structs.replace(loaded.spec, planners=("mine",), remote={"mine": stack})
    return msgspec.structs.replace(loaded, spec=spec, stacks={"mine": says})


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> Loaded:
    return load_spec(small_sweep(tmp_path_factory.mktemp("small")))


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({}, "Object missing required field `command`"),
        ({"command": ""}, '.command: what starts it, such as "python my_stack.py"'),
        ({"command": "a 'b"}, '.command "a \'b": no closing quotation'),
        ({"command": "a", "instances": 0}, ".instances 0: 1 to 64"),
        ({"command": "a", "rate_hz": 15.0}, ".rate_hz 15: must divide control_hz 20 evenly"),
        ({"command": "a", "rate_hz": 40.0}, ".rate_hz 40: must divide control_hz 20 evenly"),
        ({"command": "a", "rate_hz": 0.0}, ".rate_hz 0: must divide control_hz 20 evenly"),
        ({"command": "a", "latency_s": -0.1}, ".latency_s -0.1: 0 to 10"),
        ({"command": "a", "answer_within_s": 0.0}, ".answer_within_s 0: above 0, a day at most"),
    ],
)
def test_a_table_that_cannot_be_used_is_named(table: dict[str, object], words: str) -> None:
    with pytest.raises((UserError, msgspec.ValidationError)) as raised:
        check_spec(SweepSpec(map="a", remote={"mine": msgspec.convert(table, RemoteStack)}))
    assert words in str(raised.value)


@pytest.mark.parametrize("name", ["constant_speed", "remote", "my stack", "my/stack"])
def test_a_name_that_is_taken_or_no_word_is_refused(name: str) -> None:
    with pytest.raises(UserError, match=rf"remote\.{name}: "):
        check_spec(SweepSpec(map="a", remote={name: RemoteStack(command="a")}))


def test_a_stack_that_cannot_be_started_is_refused_in_one_line(tmp_path: Path) -> None:
    missing = tmp_path / "no_such.py"
    spec = small_sweep(tmp_path, spec_of(f"{shlex.quote(sys.executable)} {missing}"))
    with pytest.raises(UserError) as raised:
        load_spec(spec)
    said = str(raised.value)
    assert said.startswith(
        f"{spec}: line 9: remote.mine ({sys.executable} {missing}): ended by exit code 2"
    )
    assert "No such file" in said
    assert "\n" not in said


def test_who_joins_is_known_by_name_and_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    command = f"{shlex.quote(sys.executable)} -m tests.sim_worker.planners.a_stack straight"
    first = load_spec(small_sweep(tmp_path, spec_of(command)))
    monkeypatch.setenv("A_STACK_VERSION", "2")
    second = load_spec(small_sweep(tmp_path, spec_of(command)))
    told = {"command": command, "name": "straight", "version": "1"}
    assert planner_origins(first)["mine"] == told
    assert planner_origins(second)["mine"] == told | {"version": "2"}
    assert fingerprint_of(first, "map") != fingerprint_of(second, "map")


def test_a_planner_of_a_package_is_known_by_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = "class Rolling:\n    def plan(self, view): ...\n"
    install(tmp_path, "changed_planner", code, rolling="Rolling")
    monkeypatch.syspath_prepend(tmp_path)
    loaded = load_spec(small_sweep(tmp_path, SMALL.replace("constant_speed", "rolling")))
    known = fingerprint_of(loaded, "map")
    assert fingerprint_of(loaded, "map") == known
    (tmp_path / "changed_planner.py").write_text(code + "# of another kind\n")
    assert fingerprint_of(loaded, "map") != known


def test_what_decides_on_rows_decides_on_the_sweep(loaded: Loaded) -> None:
    known = fingerprint_of(with_stack(loaded), "map")
    for changed in ({"command": "b"}, {"latency_s": 0.1}, {"rate_hz": 20.0}, {"instances": 2}):
        assert fingerprint_of(with_stack(loaded, **changed), "map") != known
    patient = with_stack(loaded, answer_within_s=1.0, start_within_s=2.0)
    assert fingerprint_of(patient, "map") == known


def test_a_stack_that_remembers_is_given_as_many_futures_as_it_has_processes(
    loaded: Loaded,
) -> None:
    runner = alone(loaded)
    world_id = places_of_all(loaded)
    worlds = [places_of(runner, loaded, world_id)]
    at_once = SweepPlan(with_stack(loaded), worlds)
    alone_each = SweepPlan(with_stack(loaded, stateful=True, instances=2), worlds)
    assert list(alone_each.sizes()) == [len(job.cells) for job in alone_each.planned()]
    mine = [job for job in alone_each.planned() if job.planner == "mine"]
    assert mine
    assert max(len(job.cells) for job in mine) == 2
    assert max(len(job.cells) for job in at_once.planned()) > 2
    assert alone_each.cells == at_once.cells


def places_of_all(loaded: Loaded) -> str:
    """Return the id of the only World."""
    (world,) = Path(str(loaded.spec.worlds)).glob("*.world")
    return world.stem


def test_a_job_says_when_its_stack_is_asked_and_others_stay_as_they_were(loaded: Loaded) -> None:
    worlds = [places_of(alone(loaded), loaded, places_of_all(loaded))]
    ours = with_stack(loaded, rate_hz=20.0, latency_s=0.05)
    plan = SweepPlan(ours, worlds)
    maker = JobMaker(ours)
    by_planner = {job.planner: maker.job(job).planner_timing for job in plan.planned()}
    assert by_planner["mine"] == ours.spec.remote["mine"].timing
    assert by_planner["reverse_pursuit"] is msgspec.UNSET


def test_a_worker_may_wait_for_its_stacks(loaded: Loaded) -> None:
    patient = with_stack(loaded, answer_within_s=7.0, start_within_s=11.0)
    assert task_timeout_s(loaded) == loaded.spec.job_timeout_s
    horizon_s = loaded.spec.horizon_s
    assert task_timeout_s(patient) == loaded.spec.job_timeout_s + 11.0 + 7.0 * 10.0 * horizon_s
    ((name, setup),) = worker_setup(patient, Path("out")).stacks
    assert (name, setup.command, setup.says) == ("mine", ("python", "mine.py"), MINE)
    assert worker_setup(loaded, Path("out")).stacks == ()
