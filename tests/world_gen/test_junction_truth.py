"""Worlds of the drawn junctions agree with the truth that was written by hand beside them."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.world import World
from tests.data.junctions.draw import draw_all
from tests.world_gen.junction_score import COLUMNS, Score, score
from tests.world_gen.junction_truth import score_map, table, worlds_of
from tests.world_gen.mirror import mirrored_drawings, mirrored_truth
from tests.world_gen.truth_sheet import FOLDER, TrueJunction, true_maps

AT_LEAST = {
    "kind": 1.0,
    "control": 1.0,
    "arms": 1.0,
    "lanes": 0.99,
    "movements": 0.99,
    "turns": 0.99,
    "ring": 1.0,
    "yields": 1.0,
}


@pytest.fixture(scope="module")
def scores() -> dict[str, Score]:
    return {truth.name: score_map(truth) for truth in true_maps()}


def test_worlds_agree_with_the_truth(scores: dict[str, Score]) -> None:
    total = Score()
    for found in scores.values():
        total.add(found)
    shares = {column: total.share(column) for column in COLUMNS}
    short = {column: share for column, share in shares.items() if share < AT_LEAST[column]}
    assert not short, f"below what is asked: {short}\n{table(scores)}"


def test_there_are_forty_maps_and_enough_to_ask(scores: dict[str, Score]) -> None:
    assert len(scores) >= 40
    assert sum(found.asked["yields"] for found in scores.values()) > 600
    assert sum(found.asked["ring"] for found in scores.values()) >= 6


def test_the_world_misses_no_conflict_but_where_two_lanes_lead_out(
    scores: dict[str, Score],
) -> None:
    missed = {
        name: words
        for name, found in scores.items()
        if (words := [word for word in found.unlisted if word.endswith("(truth)")])
    }
    two_lanes_out = {
        "06_dual_and_single",
        "07_dual_and_dual",
        "32_restriction_via_way",
        "49_left_hand_dual",
    }
    assert missed.keys() <= two_lanes_out, missed


def test_the_maps_are_what_the_drawings_say(tmp_path: Path) -> None:
    draw_all(tmp_path)
    drawn = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.glob("*.osm")}
    kept = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.osm")}
    assert drawn == kept
    assert {Path(name).stem for name in kept} == {truth.name for truth in true_maps()}


def test_each_pair_that_conflicts_has_one_answer() -> None:
    for truth in true_maps():
        for world in worlds_of(truth):
            pairs = [frozenset((c.first_id, c.second_id)) for c in world.conflicts]
            assert len(set(pairs)) == len(pairs)
            assert all(c.yields_id in (c.first_id, c.second_id) for c in world.conflicts)
            waits = {
                (c.yields_id, *({c.first_id, c.second_id} - {c.yields_id})) for c in world.conflicts
            }
            assert waits == {(c.id, other) for c in world.connections for other in c.yields_to}


def test_mirrored_maps_give_mirrored_worlds(tmp_path: Path, scores: dict[str, Score]) -> None:
    files = mirrored_drawings(tmp_path)
    images = {t.name: score_map(mirrored_truth(t, files[t.name])) for t in true_maps()}
    changed = {
        name: found
        for name, found in images.items()
        if (found.right, found.asked) != (scores[name].right, scores[name].asked)
    }
    assert not changed, table(changed)


def _plain() -> tuple[TrueJunction, World]:
    truth = next(truth for truth in true_maps() if truth.name == "01_plain_crossing")
    return truth.junctions[0], worlds_of(truth)[0]


def test_a_lost_connection_is_a_missed_movement() -> None:
    truth, world = _plain()
    lost = msgspec.structs.replace(world, connections=world.connections[1:])
    found = score(truth, lost, lost.junctions[0])
    assert found.right["movements"] == found.asked["movements"] - 1
    assert any(word.startswith("movements: missed") for word in found.misses)


def test_a_lost_lane_counts() -> None:
    truth, world = _plain()
    gone = next(lane.id for lane in world.lanes if lane.role == "approach")
    lost = msgspec.structs.replace(
        world,
        lanes=tuple(lane for lane in world.lanes if lane.id != gone),
        connections=tuple(c for c in world.connections if c.from_lane_id != gone),
    )
    found = score(truth, lost, lost.junctions[0])
    assert found.right["lanes"] == found.asked["lanes"] - 1
    assert found.right["movements"] == found.asked["movements"] - 3


def test_a_renamed_arm_is_one_lost_and_one_invented() -> None:
    truth, world = _plain()
    junction = world.junctions[0]
    arms = (msgspec.structs.replace(junction.arms[0], name="Holzweg"), *junction.arms[1:])
    found = score(truth, world, msgspec.structs.replace(junction, arms=arms))
    assert (found.right["arms"], found.asked["arms"]) == (3, 5)
