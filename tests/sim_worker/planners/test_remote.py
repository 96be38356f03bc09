"""A driving stack on the other side of the bus: asked in lock step, and replaced where silent."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import msgspec
import numpy as np
import pytest

from foretwin.contracts.bus import Mailbox, Received
from foretwin.contracts.codec import encode
from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.planner_link import LINK_VERSION, PlannedMotions, PlannerScene
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.remote import RemoteDriver, RemotePlanner
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.bus_sides import DEADLINE_S
from tests.contracts.memory_bus import MemoryBus
from tests.sim_worker.planners.driven import Other, at_rest_on, drive, see, straight, view_of
from tests.starvation import kept_waiting

VEHICLE = load_vehicle()
IDS = {"run": "r1", "process": "w0"}
Stack = Callable[[PlannerScene], PlannedMotions | None]


def eastwards(scene: PlannerScene, *, speed: float = 6.0) -> PlannedMotions:
    """Drive on to the east, by and by 1 m to the left of the path."""
    time_s = np.linspace(0.0, 3.0, 31)
    x = scene.states[:, :1] + speed * time_s
    y = scene.states[:, 1:2] + (1.0 - scene.states[:, 1:2]) * np.minimum(time_s / 2.0, 1.0)
    return PlannedMotions(
        job=scene.job, question=scene.question, futures=scene.futures, time_s=time_s,
        xy_m=np.stack([x, np.broadcast_to(y, x.shape)], axis=-1), yaw_rad=np.zeros_like(x),
        speed_mps=np.full_like(x, speed), link=LINK_VERSION,
    )  # fmt: skip


@contextmanager
def stack(bus: MemoryBus, answers: Stack) -> Iterator[list[PlannerScene]]:
    """A driving stack in a thread; yields the scenes it was shown."""
    scenes, shown = Mailbox(16), []
    bus.subscribe("planner_scene", scenes, run="*", process="*")
    over = threading.Event()

    def serve() -> None:
        while not over.is_set():
            item = scenes.take(0.02)
            if isinstance(item, Received):
                scene = item.message()
                shown.append(scene)
                answer = answers(scene)
                if answer is not None:
                    ids = {"run": scene.run_id, "process": scene.worker_id}
                    bus.publish("planned_motions", answer, **ids)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield shown
    finally:
        over.set()
        thread.join()


def connected(
    bus: MemoryBus, *, first_s: float = DEADLINE_S, then_s: float = DEADLINE_S
) -> RemotePlanner:
    planner = RemotePlanner(first_answer_s=first_s, answer_s=then_s)
    planner.connect(bus, **IDS)
    return planner


class _Kept:
    """Keeps the driver of the job that `drive` begins."""

    def __init__(self, planner: RemotePlanner) -> None:
        self._planner = planner
        self.drivers: list[RemoteDriver] = []

    def begin(self, count: int) -> RemoteDriver:
        self.drivers.append(self._planner.begin(count))
        return self.drivers[-1]

    def plan(self, view):  # type: ignore[no-untyped-def]
        raise AssertionError


def test_cars_go_where_the_stack_says() -> None:
    bus = MemoryBus()
    path = straight()
    with stack(bus, eastwards) as shown:
        kept = _Kept(connected(bus))
        starts = at_rest_on(path, 5.0, 4.0, count=3)
        done = drive(kept, path, starts, vehicle=VEHICLE, seconds=6.0)
    assert done.states[:, -1, 3] == pytest.approx(6.0, abs=0.3)
    assert done.states[:, -1, 1] == pytest.approx(1.0, abs=0.15)
    assert kept.drivers[0].remarks == {}
    # Every 0.1 s a question, and none but the first asked more than once.
    asked = [scene.question for scene in shown if scene.question > 1]
    assert 59 <= len(asked) == len(set(asked)) <= 61
    assert {scene.question for scene in shown} == set(range(1, 61)) | {shown[-1].question}


def test_what_the_stack_is_shown() -> None:
    bus = MemoryBus()
    path = straight()
    starts = at_rest_on(path, 10.0, 3.0, count=2)
    seen, _ = see(path, [Other(np.array([[0.0, 3.0], [200.0, 3.0]]), 5.0, 50.0)], 0.0, 2)
    seen.poses[1] = np.nan
    view = view_of(path, starts, VEHICLE, users=seen, stop_arc_m=np.array([40.0, np.inf]))
    with stack(bus, eastwards) as shown:
        connected(bus).begin(2).plan(view)
    scene = shown[0]
    assert (scene.run_id, scene.worker_id, scene.futures) == ("r1", "w0", (0, 1))
    assert scene.states.tobytes() == starts.tobytes()
    assert scene.road_users[0, 0] == pytest.approx([50.0, 3.0, 0.0, 5.0, 4.5, 1.8, 0.0])
    assert np.isnan(scene.road_users[1]).all()
    assert scene.path_xy_m[[0, -1]] == pytest.approx(np.array([[0.0, 0.0], [200.0, 0.0]]))
    assert scene.stop_arc_m.tolist() == [40.0, np.inf]
    assert scene.arc_m == pytest.approx(10.0)


def test_a_silent_stack_is_replaced_and_the_futures_are_marked() -> None:
    bus = MemoryBus()
    path = straight()
    kept = _Kept(connected(bus, first_s=0.2, then_s=0.1))
    starts = at_rest_on(path, 5.0, 4.0, count=2)
    shown = Mailbox(128)
    bus.subscribe("planner_scene", shown, **IDS)
    begun = time.monotonic()
    with kept_waiting() as kept_s:
        done = drive(kept, path, starts, vehicle=VEHICLE, seconds=6.0)
        plain = drive(PurePursuitIdm(), path, starts, vehicle=VEHICLE, seconds=6.0)
    assert time.monotonic() - begun - kept_s.seconds < 10.0
    assert len(shown) >= 60, "it may come back, and is asked on"
    assert done.states.tobytes() == plain.states.tobytes()
    words = "fallback 'pure_pursuit_idm' acted from 0 s on: no answer within 0.2 s"
    assert kept.drivers[0].remarks == {0: words, 1: words}


def test_futures_that_an_answer_leaves_out_are_driven_by_the_fallback() -> None:
    bus = MemoryBus()

    def second_only(scene: PlannerScene) -> PlannedMotions:
        whole = eastwards(scene)
        return msgspec.structs.replace(
            whole, futures=(1,), xy_m=whole.xy_m[1:], yaw_rad=whole.yaw_rad[1:],
            speed_mps=whole.speed_mps[1:],
        )  # fmt: skip

    path = straight()
    with stack(bus, second_only):
        kept = _Kept(connected(bus))
        done = drive(kept, path, at_rest_on(path, 5.0, 4.0, count=2), vehicle=VEHICLE, seconds=5.0)
    assert done.states[:, -1, 1] == pytest.approx([0.0, 1.0], abs=0.15)
    assert list(kept.drivers[0].remarks) == [0]
    assert kept.drivers[0].remarks[0].endswith("acted from 0 s on: the answer left it out")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        ({"speed_mps": np.full((1, 31), np.nan)}, "the answer holds what is no number"),
        ({"futures": (3,)}, "no use: futures (3,) of 1 that were asked for"),
        ({"time_s": np.zeros(31)}, "no use: time_s does not rise"),
        ({"yaw_rad": np.zeros((1, 7))}, "no use: yaw_rad of shape (1, 7)"),
        ({"xy_m": np.zeros((1, 31, 3))}, "no use: xy_m of shape (1, 31, 3), not (1, 31, 2)"),
        ({"time_s": np.linspace(-9.0, -6.0, 31)}, "no use: time_s ends at -6 s"),
        ({"time_s": [0.0, 0.1]}, "an array of numpy is wanted, such as np.array(...) makes"),
        ({"link": 1}, "no use: it speaks version 1 of the planner link, this foretwin version 2"),
        ({"took_s": -1.0}, "no use: took_s -1: 0 to 10 s"),
        ({"failure": "lost its way"}, "no use: lost its way"),
    ],
)
def test_an_answer_of_no_use_is_named(spoil: dict[str, object], words: str) -> None:
    bus = MemoryBus()
    with stack(bus, lambda scene: msgspec.structs.replace(eastwards(scene), **spoil)):
        driver = connected(bus).begin(1)
        view = view_of(straight(), at_rest_on(straight(), 5.0, 4.0), VEHICLE)
        answer = driver.plan(view)
    assert words in driver.remarks[0]
    assert answer.accel_mps2.tobytes() == PurePursuitIdm().plan(view).accel_mps2.tobytes()


def test_past_the_end_of_a_motion_the_fallback_drives_until_the_next_one() -> None:
    bus, path = MemoryBus(), straight()

    def short(scene: PlannerScene) -> PlannedMotions:
        return msgspec.structs.replace(eastwards(scene), time_s=np.linspace(0.0, 0.03, 31))

    with stack(bus, short):
        driver = connected(bus).begin(1)
        view = view_of(path, at_rest_on(path, 5.0, 4.0), VEHICLE)
        driver.plan(view)
        assert driver.remarks == {}
        later = driver.plan(view._replace(time_s=0.05))
    assert "acted from 0.05 s on: its motion ended at 0.03 s" in driver.remarks[0]
    assert later.accel_mps2.tobytes() == PurePursuitIdm().plan(view).accel_mps2.tobytes()


def test_an_answer_to_an_older_question_does_not_count() -> None:
    bus = MemoryBus()

    def late(scene: PlannerScene) -> PlannedMotions:
        return msgspec.structs.replace(eastwards(scene), question=scene.question - 1)

    with stack(bus, late):
        driver = connected(bus, first_s=0.3).begin(1)
        driver.plan(view_of(straight(), at_rest_on(straight(), 5.0, 4.0), VEHICLE))
    assert "no answer within 0.3 s" in driver.remarks[0]


def test_of_two_stacks_that_answer_at_once_neither_drives() -> None:
    bus = MemoryBus()
    view = view_of(straight(), at_rest_on(straight(), 5.0, 4.0), VEHICLE)

    def twice(scene: PlannerScene) -> None:
        (answers,) = bus.mailboxes("planned_motions")
        key, kind = channel_key("planned_motions", **IDS), PlannedMotions
        for sender in (1, 2):
            data = encode(eastwards(scene), sender=sender)
            answers.put(Received("planned_motions", key, data, kind))

    with stack(bus, twice):
        driver = connected(bus).begin(1)
        driver.plan(view)
        assert driver.remarks == {}
        driver.plan(view._replace(time_s=0.1))
    words = "acted from 0.1 s on: no use: two stacks answer at once; end one of them"
    assert driver.remarks[0].endswith(words)


def test_in_lock_step_an_answer_is_waited_for_however_long_it_takes() -> None:
    bus = MemoryBus()

    def slow(scene: PlannerScene) -> PlannedMotions:
        time.sleep(0.1)
        return eastwards(scene)

    planner = RemotePlanner(first_answer_s=0.02, answer_s=0.02, alive_s=DEADLINE_S)
    planner.connect(bus, **IDS, lock_step=True)
    kept = _Kept(planner)
    with stack(bus, slow):
        drive(kept, straight(), at_rest_on(straight(), 5.0, 4.0), vehicle=VEHICLE, seconds=0.5)
    assert kept.drivers[0].remarks == {}


def test_in_lock_step_who_is_not_there_is_waited_for_once_until_it_comes() -> None:
    bus = MemoryBus()
    planner = RemotePlanner(first_answer_s=0.02, answer_s=0.01, alive_s=0.3)
    planner.connect(bus, **IDS, lock_step=True)
    view = view_of(straight(), at_rest_on(straight(), 5.0, 4.0), VEHICLE)
    nobody, still_nobody = planner.begin(1), planner.begin(1)
    nobody.plan(view)
    still_nobody.plan(view)
    assert "no answer within 0.3 s" in nobody.remarks[0]
    assert "no answer within 0.02 s" in still_nobody.remarks[0]
    planner.first_answer_s = DEADLINE_S
    with stack(bus, eastwards):
        back = planner.begin(1)
        back.plan(view)
    assert back.remarks == {}
    assert planner.within_s(first=False) == 0.3


def test_without_a_bus_it_says_so() -> None:
    view = view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE)
    with pytest.raises(ValueError, match="'remote' asks over the bus of a run; there is none here"):
        RemotePlanner().plan(view)
