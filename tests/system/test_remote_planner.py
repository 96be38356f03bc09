"""A driving stack in a process of its own drives futures over Zenoh, and is killed in between."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numpy as np

from foretwin.contracts.bus import Bus, Mailbox, ZenohBus
from foretwin.contracts.futures import Future
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.planners.registry import load_planner
from foretwin.sim_worker.planners.remote import RemotePlanner
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.bus_sides import DEADLINE_S, python
from tests.sim_worker.places import crossroads, job
from tests.sim_worker.planners.driven import at_rest_on, drive, straight
from tests.system.foretwin_command import REPOSITORY, Finished, run_folder, started

EXAMPLE = REPOSITORY / "examples" / "remote_planner.py"
VEHICLE = load_vehicle()


def example(*arguments: str) -> AbstractContextManager[subprocess.Popen[str]]:
    return python(str(EXAMPLE), *arguments)


@contextmanager
def run_bus() -> Iterator[tuple[Bus, str]]:
    """A router and a worker's client, as in a run."""
    setup = BusSetup(endpoint=free_endpoint(), lossless=True)
    with ZenohBus(setup, router=True), ZenohBus(setup) as bus:
        yield bus, setup.endpoint


def test_the_example_drives_and_after_its_death_the_fallback() -> None:
    path = straight()
    starts = at_rest_on(path, 5.0, 4.0, count=4)
    with run_bus() as (bus, endpoint):
        planner = RemotePlanner(first_answer_s=DEADLINE_S, answer_s=DEADLINE_S)
        planner.connect(bus, run="r1", process="w0")
        with example("--endpoint", endpoint) as process:
            told: list[dict[int, str]] = []

            class Kept:
                def begin(self, count: int):  # type: ignore[no-untyped-def]
                    driver = planner.begin(count)
                    told.append(driver.remarks)
                    return driver

                def plan(self, view):  # type: ignore[no-untyped-def]
                    raise AssertionError

            alive = drive(
                Kept(), path, starts, vehicle=VEHICLE, seconds=8.0, red_arc_m=45.0,
                red_until_s=99.0,
            )  # fmt: skip
            process.kill()
            process.wait()
        assert told == [{}]
        assert np.abs(alive.states[:, -1, 3]).max() < 0.3
        assert (alive.front_m[:, -1] > 43.0).all()
        assert (alive.front_m[:, -1] < 45.0).all()
        planner.first_answer_s = planner.answer_s = 0.2
        drive(Kept(), path, starts, vehicle=VEHICLE, seconds=2.0)
    assert sorted(told[1]) == [0, 1, 2, 3]
    assert "no answer within 0.2 s" in told[1][0]


def test_futures_of_a_job_are_driven_by_it_beside_others() -> None:
    futures = (
        Future(index=0, name="ours"),
        Future(index=1, name="theirs", planner="remote"),
    )
    planner = load_planner("remote")
    assert isinstance(planner, RemotePlanner)
    with run_bus() as (bus, endpoint), example("--endpoint", endpoint):
        planner.connect(bus, run="r1", process="w0")
        shown = Mailbox(64)
        bus.subscribe("planned_motions", shown, run="r1", process="w0")
        result = run_job(
            job(futures, horizon_s=4.0), BatchSimulation(crossroads(), VEHICLE, nsim=2)
        )
    load_planner.cache_clear()
    assert result.outcome.valid.all()
    assert result.outcome.progress_m[1] > 25.0
    assert len(shown) > 30


def test_a_whole_drive_is_driven_by_it(tmp_path: Path) -> None:
    config = tmp_path / "remote.toml"
    config.write_text("scenarios = []\n")
    out = tmp_path / "runs"
    with started(
        out, "--config", str(config), "--planner", "remote", "--speed", "max", "--end", "3",
        "--rate", "1", "--futures", "4", "--horizon", "2", "--workers", "1",
    ) as drive, example("--out", str(out)):  # fmt: skip
        screen, _ = drive.communicate(timeout=240.0)
    run = Finished(drive.returncode, screen, run_folder(out))
    assert run.code == 0, run.screen
    driven = [row for row in run.rows("futures") if row["planner"] == "remote"]
    assert len(driven) >= 4
    assert all(row["valid"] for row in driven)
    assert {row["remark"] for row in driven} == {""}, "in lock step it is waited for"
    assert max(row["progress_m"] for row in driven) > 1.0
