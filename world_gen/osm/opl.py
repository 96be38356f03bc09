"""Decode OPL, osmium's text form with one object per line, in bulk.

Taking objects one by one out of osmium costs several times what osmium needs to decode the whole
file. Letting it write them as text, and taking all numbers of that text at once, is the quickest
way across. The format: https://osmcode.org/opl-file-format/
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.world_gen.osm.osm_map import BoolArray, IntArray, OsmMember, OsmRelation

OPL_OPTIONS = "opl,add_metadata=false"
UNITS_PER_DEG = 10_000_000
NO_POSITION = 2**31 - 1
"""Stands for a coordinate that the file does not give, in units of 1e-7 degrees."""
_ESCAPE = re.compile("%([0-9a-f]+)%")
_LETTERS_TO_SPACES = bytes.maketrans(b"nTxy,", b"     ")


class NodePositions(NamedTuple):
    """Ids (N,), latitudes and longitudes (N,) in units of 1e-7 degrees, all int64."""

    ids: IntArray
    lat_1e7: IntArray
    lon_1e7: IntArray

    @staticmethod
    def joined(parts: Iterable[NodePositions]) -> NodePositions:
        """Return the nodes of all parts, one after the other."""
        none = (np.empty(0, dtype=np.int64),) * 3
        return NodePositions(*map(np.concatenate, zip(none, *parts, strict=True)))

    @property
    def lat_lon_deg(self) -> Array:
        """Latitudes and longitudes (N, 2) in degrees."""
        return np.stack([self.lat_1e7, self.lon_1e7], axis=-1) / UNITS_PER_DEG

    def at(self, row: int) -> tuple[float, float]:
        """Return latitude and longitude of a node in degrees."""
        return float(self.lat_1e7[row]) / UNITS_PER_DEG, float(self.lon_1e7[row]) / UNITS_PER_DEG

    def rows(self, which: IntArray | BoolArray) -> NodePositions:
        """Return chosen nodes."""
        return NodePositions(*(column[which] for column in self))


class NodeObjects(NamedTuple):
    """Nodes in the order of the file, and the tags, as OPL, of those that have wanted ones."""

    positions: NodePositions
    tag_texts: dict[int, str]


class WayLines(NamedTuple):
    """Ways in the order of the file: ids, tags as OPL, nodes as OPL."""

    ids: list[int]
    tag_texts: list[str]
    node_texts: list[str]


class WayNodes(NamedTuple):
    """The nodes of many ways, one after the other (M,), and how many each way has (N,)."""

    nodes: IntArray
    counts: IntArray


TagsOf = Callable[[str], Mapping[str, str]]
"""Returns the tags of a T field without its letter."""


def tag_reader() -> TagsOf:
    """Return what makes dictionaries of tags as OPL, which objects with the same tags share."""
    return cache(_tags)


def _tags(text: str) -> dict[str, str]:
    if not text:
        return {}
    escaped = text.count("%")
    if escaped and escaped == 2 * text.count("%20%"):  # spaces alone: by far the most frequent
        text, escaped = text.replace("%20%", " "), 0
    pairs = [item.split("=", 1) for item in text.split(",")]
    if escaped:
        return {_plain(key): _plain(value) for key, value in pairs}
    return dict(pairs)


def sections(text: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield runs of lines of one kind of object, each with its letter: n, w or r."""
    if not text:
        return
    letters = np.frombuffer(text, dtype=np.uint8)
    begins = np.concatenate([[0], np.flatnonzero(letters[:-1] == ord("\n")) + 1])
    heads = letters[begins]
    cuts = [0, *begins[1:][heads[1:] != heads[:-1]].tolist(), len(text)]
    for begin, end in pairwise(cuts):
        yield chr(text[begin]), text[begin:end]


def any_tag(keys: Iterable[str], tags: Iterable[str] = ()) -> re.Pattern[str]:
    """Return what finds one of the keys, or one of the `tags` as `key=value`, in tags as OPL."""
    named = [re.escape(key) + "=" for key in keys] + [f"{re.escape(tag)}(?:,|$)" for tag in tags]
    return re.compile(f"(?:^|,)(?:{'|'.join(named)})")


def read_nodes(section: bytes, wanted: Callable[[str], object]) -> NodeObjects:
    """Read lines such as `n1 Thighway=stop x8.5 y53.25`; `wanted` decides by their tags."""
    section, texts = _without_tags(section, wanted)
    if b" x " in section or b" y\n" in section:
        section = section.replace(b" x ", b" x999 ").replace(b" y\n", b" y999\n")
    numbers = _integers(section.translate(_LETTERS_TO_SPACES, b".")).reshape(-1, 3)
    scaled = numbers[:, 1:] * _missing_decimals(section).reshape(-1, 2)
    scaled = np.minimum(scaled, NO_POSITION)
    return NodeObjects(NodePositions(numbers[:, 0], scaled[:, 1], scaled[:, 0]), texts)


def _without_tags(section: bytes, wanted: Callable[[str], object]) -> tuple[bytes, dict[int, str]]:
    """Cut the tags out of lines of nodes; spaces in tags are escaped, so " T" begins a field."""
    letters = np.frombuffer(section, dtype=np.uint8)
    begins = np.flatnonzero((letters[:-2] == 32) & (letters[1:-1] == 84) & (letters[2:] != 32))
    found: dict[int, str] = {}
    pieces: list[bytes] = []
    done = 0
    for begin in begins.tolist():
        end = section.index(b" ", begin + 2)
        text = _text(section[begin + 2 : end])
        pieces.append(section[done : begin + 2])
        done = end
        if wanted(text):
            found[int(section[section.rfind(b"n", 0, begin) + 1 : begin])] = text
    if not pieces:
        return section, found
    return b"".join((*pieces, section[done:])), found


def _missing_decimals(section: bytes) -> IntArray:
    """Return for each coordinate the power of ten that makes it a count of 1e-7 degrees.

    OPL drops trailing zeros, so that the digits after the point must be counted.
    """
    letters = np.frombuffer(section, dtype=np.uint8)
    starts = np.flatnonzero(letters >= ord("x"))
    points = np.flatnonzero(letters == ord("."))
    ends = np.empty_like(starts)
    ends[0::2] = starts[1::2] - 1
    ends[1::2] = np.flatnonzero(letters == ord("\n"))
    decimals = np.zeros(len(starts), dtype=np.int64)
    all_have = len(points) == len(starts)
    of = np.arange(len(starts)) if all_have else np.searchsorted(starts, points) - 1
    decimals[of] = ends[of] - points - 1
    scales: IntArray = (10 ** (7 - np.arange(8, dtype=np.int64)))[decimals]
    return scales


def way_lines(section: bytes) -> WayLines:
    """Split lines such as `w10 Thighway=residential Nn1,n2`; other spaces are escaped."""
    fields = _text(section).replace("\n", " ").split(" ")
    return WayLines(
        [int(head[1:]) for head in fields[0:-1:3]],
        [tags[1:] for tags in fields[1::3]],
        [nodes[1:] for nodes in fields[2::3]],
    )


def way_nodes(node_texts: Sequence[str]) -> WayNodes:
    """Return the nodes of ways from texts such as `n1,n2`."""
    counts = np.array([text.count("n") for text in node_texts], dtype=np.int64)
    joined = ",".join(text for text in node_texts if text).encode("ascii")
    return WayNodes(_integers(joined.translate(_LETTERS_TO_SPACES)), counts)


def read_relations(
    section: bytes, keeps: Callable[[Mapping[str, str]], bool], tags_of: TagsOf
) -> dict[int, OsmRelation]:
    """Read lines such as `r20 Ttype=restriction Mw10@from,n1@via,w11@to` that `keeps` accepts."""
    found = {}
    for line in _text(section).split("\n"):
        if not line or "type=" not in line:
            continue
        head, tag_text, member_text = line.split(" ")
        tags = tags_of(tag_text[1:])
        if keeps(tags):
            key = int(head[1:])
            members = tuple(_member(text) for text in member_text[1:].split(",") if text)
            found[key] = OsmRelation(key, members, tags)
    return found


def _integers(text: bytes) -> IntArray:
    if not text.strip():
        return np.empty(0, dtype=np.int64)
    return np.fromstring(text, dtype=np.int64, sep=" ")


def _text(data: bytes) -> str:
    return data.decode("utf-8", errors="replace")


def _member(text: str) -> OsmMember:
    target, _, role = text.partition("@")
    return OsmMember(target[0], int(target[1:]), _plain(role) if "%" in role else role)


def _plain(text: str) -> str:
    return _ESCAPE.sub(_character, text)


def _character(match: re.Match[str]) -> str:
    code = int(match[1], 16)
    stands_for_one = code < 0xD800 or 0xE000 <= code <= 0x10FFFF
    return chr(code) if stands_for_one else "\ufffd"
