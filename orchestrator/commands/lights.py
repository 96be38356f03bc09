"""The command `lights`: by which numbers exports of a World know its groups of lights."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import plain
from foretwin.orchestrator.commands.told import CommandResult

_NUMBERS = dict[str, dict[str, list[int]]]
"""By group and key of a row, `ids`, `ways` or `signals`."""


def show_lights(exports: Sequence[Path]) -> CommandResult:
    """Return the [[light]] rows of a ROS 2 mapping for exports of one World.

    Raises UserError for a file that is no Lanelet2 map or OpenDRIVE file of ours.
    """
    rows, lines = light_rows(exports), []
    for row in rows:
        values = (f"{name} = {msgspec.json.encode(value).decode()}" for name, value in row.items())
        lines += ["[[light]]", *values, ""]
    return CommandResult({"light": rows}, "\n".join(lines))


def light_rows(exports: Sequence[Path]) -> list[dict[str, str | int | list[int]]]:
    """Return a row for each group of lights; junctions and their groups are counted for V2X."""
    found: _NUMBERS = defaultdict(lambda: defaultdict(list))
    for file in exports:
        before = len(found)
        for group, key, number in _numbers(file):
            found[group][key].append(number)
        if len(found) == before and not found:
            raise UserError(f"{file}: names no group of lights; an .osm or .xodr of foretwin does")
    junctions = sorted({group.rpartition(":")[0] for group in found})
    counts: dict[str, int] = defaultdict(int)
    rows: list[dict[str, str | int | list[int]]] = []
    for group in sorted(found):
        junction = group.rpartition(":")[0]
        counts[junction] += 1
        keys = {key: sorted(set(numbers)) for key, numbers in found[group].items()}
        v2x = {"intersection": junctions.index(junction) + 1, "signal_group": counts[junction]}
        rows.append({"group": plain(group), **keys, **v2x})
    return rows


def _numbers(file: Path) -> Iterator[tuple[str, str, int]]:
    """Yield group, key and number of all lights that a file names."""
    try:
        root = ElementTree.parse(file).getroot()
    except OSError as error:
        raise UserError(f"{file}: cannot be read: {error.strerror}") from None
    except ElementTree.ParseError as error:
        raise UserError(f"{file}: no XML: {error}") from None
    for relation in root.iterfind("relation"):
        group = relation.find("tag[@k='foretwin:group']")
        if group is not None:
            name = group.attrib["v"]
            yield name, "ids", int(relation.attrib["id"])
            for member in relation.iterfind("member[@role='refers']"):
                yield name, "ways", int(member.attrib["ref"])
    for controller in root.iterfind("controller"):
        for control in controller.iterfind("control"):
            yield controller.attrib["name"], "signals", int(control.attrib["signalId"])
