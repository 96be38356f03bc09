"""The report: every guess of a junction in words, counted, and what it adds up to."""

from __future__ import annotations

import json

import msgspec
import pytest

from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.world_gen.report.report import JunctionReport, note_kind, report_of
from foretwin.world_gen.report.text import as_markdown, as_text
from foretwin.world_gen.report.values import SOURCE_CONFIDENCE, SUBJECT_WEIGHT, SubjectReport
from tests.world_gen.drawn_maps import (
    AVENUE,
    CROSS,
    STREET,
    crossing,
    drawn_map,
    roundabout,
    world_of,
)

COVERS = (
    "foretwin.world_gen.report.subjects",
    "foretwin.world_gen.report.text",
    "foretwin.world_gen.report.values",
)
SQUARE = {20: (20.0, 20.0), 21: (35.0, 20.0), 22: (35.0, 35.0), 23: (20.0, 35.0)}


@pytest.fixture(scope="module")
def world() -> World:
    return world_of(
        crossing(
            street={"highway": "residential", "name": "Street", "lanes": "3", "maxspeed": "30"},
            avenue={
                "highway": "residential",
                "name": "Avenue",
                "oneway": "yes",
                "lanes": "2",
                "turn:lanes": "left|through;right",
            },
            extra_nodes=SQUARE,
            extra_ways=[(20, [20, 21, 22, 23, 20], {"building": "yes"})],
        )
    )


@pytest.fixture(scope="module")
def junction(world: World) -> JunctionReport:
    return report_of(world).junctions[0]


def _subject(junction: JunctionReport, name: str) -> SubjectReport:
    return next(s for s in junction.subjects if s.subject == name)


def test_sentences_name_the_road_and_the_value(junction):
    assert "Street: 3 lanes, inferred (2 times)" in _subject(junction, "lane counts").guessed
    assert (
        "Street: lane 3.00 m wide, default (6 times)" in _subject(junction, "lane widths").guessed
    )
    assert _subject(junction, "directions").guessed == (
        "Street: traffic both ways, inferred (6 times)",
    )
    assert all("Avenue" not in words for words in _subject(junction, "lane counts").guessed)


def test_what_the_map_says_is_counted_as_tagged(junction):
    counts = _subject(junction, "lane counts")
    assert (counts.tagged, counts.inferred, counts.default) == (2, 2, 0)
    speeds = _subject(junction, "speed limits")
    assert (speeds.tagged, speeds.inferred, speeds.default) == (6, 0, 4)
    assert "Avenue: 30 km/h, default (4 times)" in speeds.guessed
    turns = _subject(junction, "turns")
    assert turns.tagged == 2


def test_who_waits_for_whom_is_told(junction):
    rules = _subject(junction, "right of way")
    assert rules.tagged + rules.inferred + rules.default > 0
    assert any(
        words.startswith(("Street: waits for", "Avenue: waits for")) for words in rules.guessed
    )


def test_a_lesser_road_gives_way_at_a_sign_only_where_the_map_has_one():
    main = {**STREET, "highway": "tertiary"}
    without = report_of(world_of(crossing(street=main, avenue=AVENUE))).junctions[0]
    assert without.control == "uncontrolled"
    told = _subject(without, "control").guessed
    assert "Avenue: gives way, though the map has no sign, inferred (2 times)" in told
    assert not any("at a sign" in words for words in told)
    signed = crossing(street=main, avenue=AVENUE, node_tags={0: {"highway": "give_way"}})
    junction = report_of(world_of(signed)).junctions[0]
    assert junction.control == "give_way"
    assert (
        "Avenue: gives way at a sign, inferred (2 times)" in _subject(junction, "control").guessed
    )


def _who_waits(world: World) -> str:
    return "\n".join(_subject(report_of(world).junctions[0], "right of way").guessed)


def test_roads_of_one_name_are_told_apart_by_where_they_come_from():
    rules = _who_waits(world_of(crossing(street=STREET, avenue=STREET)))
    assert "Street from the east: waits for Street from the north (who comes from the" in rules
    assert "Street from the north: waits for Street from the west (who comes from the" in rules
    assert "Street from the south: waits for Street from the north (turns across" in rules
    assert "waits for Street (" not in rules


def test_lanes_of_one_road_that_merge_wait_for_the_lane_beside():
    ways = [
        (11, [3, 0], {**STREET, "oneway": "yes", "lanes": "2", "turn:lanes": "through|through"}),
        (12, [0, 1], {**STREET, "oneway": "yes", "lanes": "1"}),
        (13, [0, 2], {**AVENUE, "oneway": "yes"}),
    ]
    words = "Street from the west: waits for the lane beside (merging lanes)"
    assert words in _who_waits(world_of(drawn_map(CROSS, ways)))


def test_confidence_is_the_stated_formula(world, junction):
    for subject in junction.subjects:
        n = (subject.tagged, subject.inferred, subject.default)
        mean = sum(c * k for c, k in zip(SOURCE_CONFIDENCE.values(), n, strict=True)) / sum(n)
        assert subject.confidence == pytest.approx(mean, abs=0.005)
    weights = [SUBJECT_WEIGHT[s.subject] for s in junction.subjects]
    mean = sum(w * s.confidence for w, s in zip(weights, junction.subjects, strict=True))
    assert junction.confidence == pytest.approx(mean / sum(weights), abs=0.006)
    assert 0.0 < report_of(world).confidence < 1.0


def test_a_map_that_says_more_is_trusted_more():
    bare = report_of(world_of(crossing(street={"highway": "road"}, avenue={"highway": "road"})))
    told = {
        "highway": "tertiary",
        "name": "S",
        "lanes": "2",
        "lanes:forward": "1",
        "lanes:backward": "1",
        "maxspeed": "50",
        "oneway": "no",
        "turn:lanes:forward": "through",
        "turn:lanes:backward": "through",
        "width:lanes:forward": "3.2",
        "width:lanes:backward": "3.2",
    }
    full = report_of(world_of(crossing(street=told, avenue=told)))
    assert full.junctions[0].confidence > bare.junctions[0].confidence + 0.1


def test_a_ring_is_tagged_and_a_crossing_worked_out(junction):
    ring = report_of(world_of(roundabout())).junctions[0]
    assert all("roundabout" not in words for words in _subject(ring, "kind").guessed)
    assert "junction: crossing, inferred" in _subject(junction, "kind").guessed


def test_buildings_are_counted_together(world):
    buildings = report_of(world).buildings
    assert (buildings.tagged, buildings.default) == (0, 1)
    assert buildings.guessed == ("1 building: 6.0 m high, default",)


def test_every_form_names_the_source_and_fits(world):
    report = report_of(world)
    text, page, data = as_text(report), as_markdown(report), json.loads(report.as_json())
    assert text.endswith(ATTRIBUTION + "\n")
    assert ATTRIBUTION in page
    assert data["attribution"] == ATTRIBUTION
    assert max(len(line) for line in text.splitlines()) <= 100
    for words in ("Street: 3 lanes, inferred", "lane counts", "confidence"):
        assert words in text
        assert words in page
    assert data["junctions"][0]["subjects"][0]["subject"] == "kind"


def test_names_from_the_map_cannot_break_a_page():
    nasty = {"highway": "residential", "name": "A|B *<b>* `x`"}
    page = as_markdown(report_of(world_of(crossing(street=nasty))))
    assert r"A\|B \*\<b\>\* \`x\`" in page


@pytest.mark.parametrize(
    ("note", "kind"),
    [
        (
            "way 12: room for a radius of 4.0 m alone into way 34 (right)",
            "room for a radius of … m alone into way … (right)",
        ),
        (
            "buildings cut back where a lane passes: w1, w2-1",
            "buildings cut back where a lane passes",
        ),
        (
            "way 5: building outline is not closed; left out",
            "building outline is not closed; left out",
        ),
    ],
)
def test_notes_of_one_kind_are_told_apart_from_others(note, kind):
    assert note_kind(note) == kind


def test_notes_are_counted_by_kind(world):
    noted = msgspec.structs.replace(
        world, notes=("way 1: too wide", "way 2: too wide", "buildings cut: w1, w2, w3")
    )
    assert [(n.kind, n.count) for n in report_of(noted).notes] == [
        ("buildings cut", 3),
        ("too wide", 2),
    ]
