"""OpenSCENARIO files as a simulator plays them: boxes of entities over time, from the XML alone."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.geometry.rectangles import Rectangles


@dataclass(frozen=True, slots=True)
class FileEntity:
    """One entity: its box about the reference point, and that point's places, headings, times."""

    element: etree._Element
    length_m: float
    width_m: float
    centre_m: float
    xy_m: Array
    yaw_rad: Array
    time_s: Array
    speed_mps: float

    def boxes(self, time_s: Array) -> Rectangles:
        x, y = (np.interp(time_s, self.time_s, self.xy_m[:, i]) for i in (0, 1))
        yaw = np.interp(time_s, self.time_s, np.unwrap(self.yaw_rad))
        centre = np.stack(
            [x + self.centre_m * np.cos(yaw), y + self.centre_m * np.sin(yaw)], axis=-1
        )
        return Rectangles(centre, yaw, self.length_m, self.width_m)


@dataclass(frozen=True, slots=True)
class ScenarioFile:
    root: etree._Element
    parameters: dict[str, float]
    properties: dict[str, str]
    entities: dict[str, FileEntity]
    logic_file: str
    end_s: float

    @classmethod
    def read(cls, file: Path, **changed: float) -> ScenarioFile:
        """Read a file, with other values of its parameters where these are given."""
        root = etree.parse(file).getroot()
        parameters = {
            p.get("name"): float(p.get("value")) for p in root.iter("ParameterDeclaration")
        }
        assert set(changed) <= set(parameters)
        parameters |= changed
        stop = root.find("Storyboard/StopTrigger//SimulationTimeCondition")
        reader = _Reader(root, parameters)
        return cls(
            root=root,
            parameters=parameters,
            properties={
                p.get("name"): p.get("value")
                for p in root.findall("FileHeader/Properties/Property")
            },
            entities={o.get("name"): reader.entity(o) for o in root.iter("ScenarioObject")},
            logic_file=root.find("RoadNetwork/LogicFile").get("filepath"),
            end_s=reader.value(stop.get("value")),
        )


@dataclass(frozen=True, slots=True)
class _Reader:
    root: etree._Element
    parameters: dict[str, float]

    def value(self, words: str) -> float:
        return self.parameters[words[1:]] if re.match(r"\$", words) else float(words)

    def entity(self, element: etree._Element) -> FileEntity:
        name = element.get("name")
        size = element.find(".//Dimensions")
        init = self.root.find(f"Storyboard/Init/Actions/Private[@entityRef='{name}']")
        xy, yaw = self._positions(init)
        speed = self.value(init.find(".//AbsoluteTargetSpeed").get("value"))
        time = np.zeros(1)
        group = next(
            (
                group
                for group in self.root.iter("ManeuverGroup")
                if group.find("Actors/EntityRef").get("entityRef") == name
            ),
            None,
        )
        if group is not None:
            follow = group.find(".//FollowTrajectoryAction")
            start = xy[0]
            xy, yaw = self._positions(follow)
            np.testing.assert_allclose(xy[0], start, atol=1e-6)
            if follow.find("TimeReference/Timing") is not None:
                time = np.array([float(v.get("time")) for v in follow.iter("Vertex")])
            else:
                arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
                time = np.arange(0.0, 30.0, 0.01)
                come = self._come(time, speed, group)
                xy = np.stack([np.interp(come, arc, xy[:, i]) for i in (0, 1)], axis=-1)
                yaw = np.interp(come, arc, np.unwrap(yaw))
        return FileEntity(
            element=element[0],
            length_m=float(size.get("length")),
            width_m=float(size.get("width")),
            centre_m=float(element.find(".//Center").get("x")),
            xy_m=xy,
            yaw_rad=yaw,
            time_s=time,
            speed_mps=speed,
        )

    def _positions(self, within: etree._Element) -> tuple[Array, Array]:
        found = [
            [float(p.get("x")), float(p.get("y")), float(p.get("h"))]
            for p in within.iter("WorldPosition")
        ]
        return np.array(found)[:, :2], np.array(found)[:, 2]

    def _come(self, time_s: Array, speed: float, group: etree._Element) -> Array:
        """Return how far one has come at a speed, which an event may end."""
        brake = group.find(".//SpeedActionDynamics")
        if brake is None:
            return speed * time_s
        trigger = next(
            event.find(".//SimulationTimeCondition")
            for event in group.iter("Event")
            if event.find(".//SpeedAction") is not None
        )
        begins, rate = self.value(trigger.get("value")), self.value(brake.get("value"))
        braking = np.clip(time_s - begins, 0.0, speed / rate)
        return speed * (np.minimum(time_s, begins) + braking) - rate * braking**2 / 2.0
