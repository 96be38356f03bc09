"""What a World is made of: what the map said of each junction, what was guessed, how sure it is."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

import msgspec

from foretwin.contracts.world import World, WorldJunction
from foretwin.world_gen.report.subjects import Neighbourhood, building_subject, junction_subjects
from foretwin.world_gen.report.values import SUBJECT_WEIGHT, SubjectReport

_OBJECT = re.compile(r"^(way|node|relation|building|intersection) [-\w.]+: ")
_ID = re.compile(r"\b(way|node|relation|building|ways|nodes) -?\d+\b|\b[wrn]-?\d[\w.-]*\b")
_NUMBER = re.compile(r"-?\d+(?:[.,]\d+)?")
_EXAMPLES = 3
_OF_SUMMARY = ("id", "name", "kind", "control", "lat", "lon", "arms")
"""What a report of a junction takes from the junction's summary."""


class NoteCount(msgspec.Struct, frozen=True, kw_only=True):
    """Notes of one kind: what they say without ids and numbers, how many, the first few."""

    kind: str
    count: int
    examples: tuple[str, ...]


class JunctionReport(msgspec.Struct, frozen=True, kw_only=True):
    """One junction, subject by subject.

    `confidence` is the mean of its subjects' confidences weighted by `SUBJECT_WEIGHT`; None where
    nothing is known of it. It compares junctions; it is no probability.
    """

    id: str
    name: str
    kind: str
    control: str
    lat: float
    lon: float
    arms: int
    confidence: float | None
    subjects: tuple[SubjectReport, ...]


class WorldReport(msgspec.Struct, frozen=True, kw_only=True):
    """A World's junctions, its buildings, and its notes counted by kind.

    `confidence` is the mean over its junctions and, with the weight of one subject, buildings.
    """

    world_id: str
    name: str
    map_sha256: str
    attribution: str
    confidence: float | None
    junctions: tuple[JunctionReport, ...]
    buildings: SubjectReport
    notes: tuple[NoteCount, ...]

    def as_json(self) -> str:
        """Return the report as indented JSON, one object."""
        return msgspec.json.format(msgspec.json.encode(self), indent=2).decode() + "\n"


def report_of(world: World) -> WorldReport:
    """Return what of a World was tagged, inferred or a default.

    A value counts 1 where it is tagged, 0.7 where inferred, 0.3 where a default
    (`SOURCE_CONFIDENCE`). A subject's confidence is the mean over its values, a junction's the
    mean over its subjects by `SUBJECT_WEIGHT`, the World's the mean over its junctions' and its
    buildings' subjects by the same weights.
    """
    at = Neighbourhood(world)
    junctions = tuple(_junction(at, junction) for junction in world.junctions)
    buildings = building_subject(world.buildings)
    every = [subject for junction in junctions for subject in junction.subjects]
    return WorldReport(
        world_id=world.id,
        name=world.intersection.name or world.intersection.id,
        map_sha256=world.map_sha256,
        attribution=world.attribution,
        confidence=_confidence([*every, buildings]),
        junctions=junctions,
        buildings=buildings,
        notes=note_counts(world.notes),
    )


def _junction(at: Neighbourhood, junction: WorldJunction) -> JunctionReport:
    subjects = junction_subjects(at, junction)
    place = msgspec.structs.asdict(junction.summary)
    return JunctionReport(
        **{field: place[field] for field in _OF_SUMMARY},
        confidence=_confidence(subjects),
        subjects=subjects,
    )


def _confidence(subjects: Sequence[SubjectReport]) -> float | None:
    known = [
        (SUBJECT_WEIGHT[s.subject], s.confidence) for s in subjects if s.confidence is not None
    ]
    total = sum(weight for weight, _ in known)
    return round(sum(weight * value for weight, value in known) / total, 2) if total else None


def note_counts(notes: Sequence[str]) -> tuple[NoteCount, ...]:
    """Return notes counted by kind, the commonest first: what one names as a list counts each."""
    by_kind: dict[str, list[str]] = defaultdict(list)
    number: dict[str, int] = defaultdict(int)
    for note in notes:
        kind = note_kind(note)
        by_kind[kind].append(note)
        # One note can name many objects: `buildings cut back where a lane passes: w1, w2`.
        head, _, tail = note.rpartition(": ")
        listed = tail.split(", ") if head and not _OBJECT.match(note) else []
        number[kind] += max(1, len(listed))
    return tuple(
        NoteCount(kind=kind, count=number[kind], examples=tuple(found[:_EXAMPLES]))
        for kind, found in sorted(by_kind.items(), key=lambda i: (-number[i[0]], i[0]))
    )


def note_kind(note: str) -> str:
    """Return a note without the ids, numbers and lists that tell it from others of its kind."""
    text = _OBJECT.sub("", note)
    if text == note and ": " in note:
        text = note.rpartition(": ")[0]
    text = _ID.sub(lambda found: f"{found[1]} …" if found[1] else "…", text)
    return _NUMBER.sub("…", text)
