"""Runs in the judges' interpreter, which has commonroad-io: read scenarios back and check them.

Reads from standard input a JSON list of scenarios, each with `path`; writes a JSON object of what
it found in each.
"""

from __future__ import annotations

import copy
import json
import logging
import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import commonroad
import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.validity import is_valid_polyline
from commonroad.scenario.lanelet import LaneletNetwork
from lxml import etree

PROBLEM = b"""<planningProblem id="999999999"><initialState>
<position><point><x>0</x><y>0</y></point></position><velocity><exact>0</exact></velocity><orientation><exact>0</exact></orientation>
<yawRate><exact>0</exact></yawRate><slipAngle><exact>0</exact></slipAngle>
<time><exact>0</exact></time></initialState><goalState><time><intervalStart>0</intervalStart>
<intervalEnd>1</intervalEnd></time></goalState></planningProblem>"""
"""The schema asks for a task; a map has none."""


POLYGON = "its polygon is not valid"


class Said(logging.Handler):
    """Counts what the reader logs, by its first words."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: Counter[str] = Counter()

    def emit(self, record: logging.LogRecord) -> None:
        self.lines[" ".join(record.getMessage().split()[:1])] += 1


def main() -> None:
    folder = Path(commonroad.__file__).parent / "common" / "xml_definition_files"
    schema = etree.XMLSchema(etree.parse(str(folder / "XML_commonRoad_XSD.xsd")))
    tasks = json.load(sys.stdin)
    json.dump({task["path"]: judged(task["path"], schema) for task in tasks}, sys.stdout)


def judged(path: str, schema: Any) -> dict[str, Any]:
    said = Said()
    logging.getLogger().handlers = [said]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scenario, _ = CommonRoadFileReader(path).open()
        network = scenario.lanelet_network
        faults = [fault for lanelet in network.lanelets for fault in faults_of(lanelet, network)]
        whole = counts(network)
        for tidy in (
            network.cleanup_lanelet_references,
            network.cleanup_traffic_sign_references,
            network.cleanup_traffic_light_references,
        ):
            tidy()
        if counts(network) != whole:
            faults.append(f"{whole} before, {counts(network)} after cleaning up references")
        copied = LaneletNetwork.create_from_lanelet_network(copy.deepcopy(network))
        if len(copied.lanelets) != len(network.lanelets):
            faults.append("lanelets are lost in a copy")
        for light in network.traffic_lights:
            light.get_state_at_time_step(17)
    return {
        "lanelets": len(network.lanelets),
        "intersections": len(network.intersections),
        "incomings": sorted(len(i.incomings) for i in network.intersections),
        "signs": Counter(
            e.traffic_sign_element_id.name
            for s in network.traffic_signs
            for e in s.traffic_sign_elements
        ),
        "lights": len(network.traffic_lights),
        "obstacles": len(scenario.obstacles),
        "faults": [fault for fault in faults if not fault.endswith(POLYGON)],
        "polygons": [fault for fault in faults if fault.endswith(POLYGON)],
        "schema": schema_errors(path, schema),
        "warnings": [str(w.message).splitlines()[0] for w in caught],
        "said": said.lines,
        "location": [network.location.gps_latitude, network.location.gps_longitude],
    }


def counts(network: LaneletNetwork) -> list[int]:
    return [
        sum(len(la.predecessor) + len(la.successor) for la in network.lanelets),
        sum(la.adj_left is not None for la in network.lanelets),
        sum(la.adj_right is not None for la in network.lanelets),
        sum(len(la.traffic_signs) + len(la.traffic_lights) for la in network.lanelets),
    ]


def faults_of(lanelet: Any, network: LaneletNetwork) -> list[str]:
    found = []
    lines = (lanelet.left_vertices, lanelet.center_vertices, lanelet.right_vertices)
    if not all(is_valid_polyline(line) for line in lines):
        found.append(f"{lanelet.lanelet_id}: a line is not valid")
    # What turns about one point touches itself there.
    closed = any(np.array_equal(line[0], line[-1]) for line in lines)
    if not (closed or lanelet.polygon.shapely_object.is_valid):
        found.append(f"{lanelet.lanelet_id}: {POLYGON}")
    for number in lanelet.successor:
        other = network.find_lanelet_by_id(number)
        if lanelet.lanelet_id not in other.predecessor:
            found.append(f"{lanelet.lanelet_id} is no predecessor of its successor {number}")
        for mine, its in (
            (lanelet.left_vertices, other.left_vertices),
            (lanelet.right_vertices, other.right_vertices),
        ):
            if not np.array_equal(mine[-1], its[0]):
                found.append(f"{lanelet.lanelet_id} does not meet its successor {number}")
    for number, same, line, side in (
        (lanelet.adj_left, lanelet.adj_left_same_direction, lanelet.left_vertices, "left"),
        (lanelet.adj_right, lanelet.adj_right_same_direction, lanelet.right_vertices, "right"),
    ):
        if number is None:
            continue
        other = network.find_lanelet_by_id(number)
        its = {"left": other.left_vertices, "right": other.right_vertices}
        opposite = "right" if side == "left" else "left"
        shared = its[opposite] if same else its[side][::-1]
        if not np.array_equal(line, shared):
            found.append(f"{lanelet.lanelet_id} shares no border with {number} on its {side}")
    return found


def schema_errors(path: str, schema: Any) -> list[str]:
    tree = etree.parse(path)
    tree.getroot().append(etree.fromstring(PROBLEM))
    schema.validate(tree)
    return [f"{e.line}: {e.message}" for e in schema.error_log]


if __name__ == "__main__":
    main()
