"""A drive across the drawn junction, message by message: what the display shows at each instant."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import RoadUser, RoadUsers, SignalColour, SignalState
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.lights import ShownLight, ShownLights, WhyShown
from foretwin.contracts.simulation import ActiveWorld, RunEnd, WorldNotice
from foretwin.contracts.too_old import LIGHT_FOR_S, USERS_FOR_NS
from foretwin.contracts.world import World
from foretwin.viewer.copilot.frame import AheadFrame, AheadLight, PageFrame
from foretwin.viewer.copilot.now import DriveNow
from foretwin.viewer.copilot.words import INJECTION_FOR_S
from tests.viewer import scene
from tests.viewer.copilot.rounds import line, round_of
from tests.viewer.copilot.test_alerts import injection
from tests.viewer.copilot.test_right_of_way import drawn
from tests.viewer.copilot.test_words import AHEAD
from tests.viewer.scene import DRIVE_FRAME, START_NS, WORLD_ID, mirror_at, state_at

COVERS = (
    "foretwin.contracts.too_old",
    "foretwin.viewer.copilot.frame",
    "foretwin.viewer.copilot.lights_now",
    "foretwin.viewer.colours",
)

AHEAD_OF_X1 = msgspec.structs.replace(AHEAD, junction_id="x1", junction_control="signals")


class Drive:
    """A display and the clock of who feeds it."""

    def __init__(self, world: World | None = None, start_ns: int = START_NS) -> None:
        self.loads: list[str] = []
        self.firsts: list[int] = []
        """Stamps with which it was asked when the drive began."""
        self._start_ns = start_ns
        self._world = world
        self.now = DriveNow(
            drive_frame=DRIVE_FRAME, find_start=self._find, load_world=self._load, now_s=0.0
        )
        self.now_s = 0.0

    def _find(self, first_stamp_ns: int) -> int:
        self.firsts.append(first_stamp_ns)
        return self._start_ns

    def _load(self, world_id: str) -> World:
        self.loads.append(world_id)
        if self._world is None:
            raise FileNotFoundError(world_id)
        return self._world

    def take(self, channel: str, message: Any) -> None:
        self.now.take(channel, message, self.now_s)

    def goes_on(self, time_s: float) -> None:
        self.now_s = time_s
        self.take("state", state_at(time_s))
        self.take("mirror", mirror_at(time_s))
        self.take("progress", AHEAD_OF_X1)

    def frame(self) -> PageFrame:
        return self.now.frame(self.now_s)


def a_round(at_s: float = 4.0, **how: Any) -> Any:
    right = line((20.0, -20.0), (0.0, 10.0))
    view = round_of(("car", right, 1e-3), ("bicycle", right, 1e-5), **how)
    own = scene.round_at(4.0).xy_m[scene.round_at(4.0).nominal_index]
    xy = np.repeat(own[None, np.linspace(0, len(own) - 1, 25).astype(int)], 3, axis=0)
    return msgspec.structs.replace(
        view,
        stamp_ns=state_at(at_s).stamp_ns,
        intersection_id="x1",
        world_id=WORLD_ID,
        xy_m=xy,
    )


def test_before_anything_came_it_says_so() -> None:
    frame = Drive().frame()
    assert frame.sentence == "waiting for the drive"
    assert (frame.pose, frame.ahead, frame.danger, frame.level) == (None, None, None, "none")
    assert frame.speed_kmh is None


def test_a_drive_towards_a_junction_is_whole_in_one_frame() -> None:
    drive = Drive(drawn("signal", "signal", group="g1"))
    drive.goes_on(4.0)
    drive.take("round", a_round())
    drive.take(
        "signals", SignalState(stamp_ns=START_NS + 4 * 10**9, group_id="g1", colour="red_amber")
    )
    frame = drive.frame()
    assert frame.drive_s == pytest.approx(4.0)
    assert frame.speed_kmh == pytest.approx(28.8)
    assert frame.ahead is not None
    assert (frame.ahead.name, frame.ahead.arrival, frame.ahead.span) == (
        AHEAD.next_intersection,
        "4 s",
        "3 to 6 s",
    )
    assert (frame.ahead.sign, frame.ahead.control) == ("signals", "signals")
    assert frame.ahead.colour == "red and amber"
    assert frame.lights == {"g1": "red and amber"}
    assert frame.danger is not None
    assert (frame.danger.odds, frame.danger.in_s, frame.danger.hits) == ("12 %", 2.0, True)
    assert frame.danger.what.startswith("car ")
    assert len(frame.danger.path) == len(frame.danger.other) == 7, "as far as they meet"
    assert (frame.level, frame.more) == ("danger", 1)
    assert len(frame.others) == 1
    assert frame.world_id == WORLD_ID
    assert frame.roles == {"car": "all"}
    assert "signals red and amber" in frame.sentence
    assert msgspec.json.decode(msgspec.json.encode(frame), type=PageFrame) == frame
    assert len(msgspec.json.encode(frame)) < 6000


def test_the_light_ahead_is_told_with_whose_word_it_is() -> None:
    drive = Drive(drawn("signal", "signal", group="g1"))
    drive.goes_on(4.0)
    drive.take("round", a_round())

    def ahead(colour: SignalColour, why: WhyShown) -> AheadFrame:
        lights = tuple(ShownLight(group_id=g, colour=colour, why=why) for g in ("g0", "g1"))
        drive.take("lights", ShownLights(stamp_ns=0, world_id=WORLD_ID, lights=lights))
        found = drive.frame().ahead
        assert found is not None
        return found

    by_plan, by_hand = ahead("green", "plan"), ahead("red_amber", "set")
    assert by_plan.light == AheadLight(group="g1", colour="green", why="plan")
    assert by_plan.colour == "", "a plan is a guess"
    assert by_hand.light == AheadLight(group="g1", colour="red and amber", why="set")
    assert by_hand.colour == "red and amber"
    assert drive.frame().lights == {"g0": "red and amber", "g1": "red and amber"}
    drive.take("lights", ShownLights(stamp_ns=0, world_id=None))
    assert ahead("green", "plan").colour == ""


def test_a_pose_is_where_the_mirror_has_the_car() -> None:
    drive = Drive()
    drive.goes_on(7.0)
    frame = drive.frame()
    real = mirror_at(7.0).real
    assert frame.pose == pytest.approx([real.x_m, real.y_m, real.yaw_rad, 8.0], abs=0.02)
    twin = mirror_at(7.0).twin
    assert frame.twin_pose is not None
    assert frame.twin_pose[:2] == pytest.approx([twin.x_m, twin.y_m], abs=0.02)


def test_a_late_round_changes_nothing_but_the_alerts() -> None:
    drive = Drive()
    drive.goes_on(4.0)
    drive.take("round", a_round())
    before = drive.frame()
    for _ in range(2):
        drive.take("round", a_round(late=True))
    after = drive.frame()
    assert after.danger == before.danger
    assert [one.kind for one in after.alerts] == ["rounds"]


def test_control_is_that_of_the_junction_until_the_cars_own_lane_is_known() -> None:
    drive = Drive(drawn("give_way", "give_way"))
    drive.goes_on(4.0)
    before = drive.frame().ahead
    assert before is not None
    assert before.control == "signals"
    drive.take("round", a_round())
    after = drive.frame().ahead
    assert after is not None
    assert after.control == "give way"


def test_what_the_car_detects_is_shown_while_it_is_fresh() -> None:
    drive = Drive()
    drive.goes_on(4.0)
    user = RoadUser(
        user_id="u",
        kind="bicycle",
        position=GeoPoint(52.5140, 13.3900),
        yaw_rad=0.0,
        speed_mps=3.0,
        length_m=1.8,
        width_m=0.6,
    )
    stamp_ns = state_at(4.0).stamp_ns
    drive.take("objects", RoadUsers(stamp_ns=stamp_ns, users=(user,)))
    (seen,) = drive.frame().seen
    assert (seen.kind, seen.size) == ("bicycle", [1.8, 0.6])
    assert seen.at == pytest.approx([0.0, 0.0], abs=0.1)
    drive.take("objects", RoadUsers(stamp_ns=stamp_ns - USERS_FOR_NS - 1, users=(user,)))
    assert drive.frame().seen == []


def test_a_light_that_is_not_heard_any_more_is_not_shown() -> None:
    drive = Drive()
    drive.goes_on(10.0)
    stamp_ns = state_at(10.0).stamp_ns - round(LIGHT_FOR_S * 1e9)
    drive.take("signals", SignalState(stamp_ns=stamp_ns, group_id="g1", colour="green"))
    drive.take("signals", SignalState(stamp_ns=stamp_ns - 1, group_id="g2", colour="green"))
    drive.take("signals", SignalState(stamp_ns=stamp_ns, group_id="g3", colour="unknown"))
    assert drive.frame().lights == {"g1": "green"}


def test_a_car_on_a_lot_is_told_whether_it_is_shown_what_is_virtual() -> None:
    drive = Drive()
    drive.goes_on(10.0)
    assert drive.frame().virtual == "", "no car on a lot"
    drive.take("injection", injection("open", "well"))
    assert drive.frame().virtual == "virtual objects on · fence 12 m off, 29 m needed"
    drive.take("injection", injection("shut"))
    frame = drive.frame()
    off = "virtual objects off: near the fence · fence 12 m off, 29 m needed"
    assert (frame.virtual, [one.kind for one in frame.alerts]) == (off, ["injection"])
    drive.goes_on(10.1 + INJECTION_FOR_S)
    assert drive.frame().virtual == "virtual objects: not known"


def test_the_world_is_that_of_the_junction_ahead_once_it_counts() -> None:
    drive = Drive(drawn("none", "none"))
    drive.goes_on(1.0)
    drive.take("active_world", ActiveWorld(stamp_ns=1, world_id="before"))
    drive.take("world", WorldNotice(world_id=WORLD_ID, intersection_id="x1", file="x"))
    assert drive.frame().world_id == "before"
    drive.take("active_world", ActiveWorld(stamp_ns=1, world_id=WORLD_ID))
    assert drive.frame().world_id == WORLD_ID
    drive.take("active_world", ActiveWorld(stamp_ns=1, world_id=None))
    assert drive.frame().world_id == WORLD_ID, "ready, and the next one to come"


def test_only_worlds_that_were_told_of_are_read_and_those_that_cannot_be_are_none() -> None:
    drive = Drive()
    assert drive.now.world("secret") is None
    assert drive.loads == []
    drive.take("active_world", ActiveWorld(stamp_ns=1, world_id="torn"))
    assert drive.now.world("torn") is None
    assert drive.now.world("torn") is None
    assert drive.loads == ["torn"]


def test_drive_time_counts_from_the_start_of_the_drive_whenever_the_display_came() -> None:
    drive = Drive(start_ns=START_NS - 20 * 10**9)
    drive.goes_on(3.0)
    drive.goes_on(5.0)
    assert drive.frame().drive_s == pytest.approx(25.0)
    assert drive.firsts == [state_at(3.0).stamp_ns]


def test_the_end_of_the_run_is_shown() -> None:
    drive = Drive()
    drive.goes_on(4.0)
    drive.take("run_end", RunEnd(stamp_ns=1))
    assert [(one.kind, one.grave) for one in drive.frame().alerts] == [("ended", True)]


def test_it_listens_to_all_that_it_takes() -> None:
    assert {"state", "round", "progress", "verdict", "gap_alarm", "run_end"} <= set(
        Drive().now.channels
    )
