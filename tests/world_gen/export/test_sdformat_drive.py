"""A twin of an SDFormat file stands, drives and turns: its links and joints stepped by MuJoCo."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from lxml import etree

from foretwin.world_gen.export.sdformat import write_sdf
from foretwin.world_gen.export.sdformat_vehicles import WHEEL_RADIUS_M, place_vehicles
from tests.world_gen.export.test_sdformat import ALL_KINDS, CAR, built

WHEELBASE_M, TRACK_M = 2.6, 1.6


def pose_of(element: Any) -> tuple[list[float], list[float]]:
    """Return position and roll, pitch, yaw of an element."""
    numbers = [float(v) for v in (element.findtext("pose") or "0 0 0 0 0 0").split()]
    return numbers[:3], numbers[3:]


def gain(plugin: Any, tag: str) -> float:
    return float(plugin.findtext(tag).split()[0])


def twin_model(sdf: Path) -> mujoco.MjModel:
    """Return the file's twin on its ground as a MuJoCo model; joints keep their names.

    SDFormat gives links in the model's frame and joints at their child's; MuJoCo nests them.
    """
    root = etree.parse(str(sdf)).getroot()
    twin = root.find("world/model[@name='ego']")
    joints = {joint.findtext("child"): joint for joint in twin.findall("joint")}
    links = {link.get("name"): link for link in twin.findall("link")}
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = float(root.findtext("world/physics/max_step_size"))
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    bodies: dict[str, Any] = {}

    def add(name: str) -> Any:
        if name in bodies:
            return bodies[name]
        link, joint = links[name], joints.get(name)
        place = np.array(pose_of(link)[0])
        if joint is None:
            body = spec.worldbody.add_body(name=name, pos=place)
            body.add_freejoint()
        else:
            parent = joint.findtext("parent")
            body = add(parent).add_body(name=name, pos=place - pose_of(links[parent])[0])
            limit = float(joint.findtext("axis/limit/upper"))
            body.add_joint(
                name=joint.get("name"),
                axis=[float(v) for v in joint.findtext("axis/xyz").split()],
                damping=[float(joint.findtext("axis/dynamics/damping") or 0.0), 0, 0],
                range=[-limit, limit] if limit < 10 else [0, 0],
                limited=limit < 10,
            )
        body.explicitinertial = True
        body.mass = float(link.findtext("inertial/mass"))
        body.ipos = pose_of(link.find("inertial"))[0]
        tensor = link.find("inertial/inertia")
        body.inertia = [float(tensor.findtext(key)) for key in ("ixx", "iyy", "izz")]
        for part in link.findall("collision"):
            at, turned = pose_of(part)
            radius = part.findtext("geometry/cylinder/radius")
            if radius is not None:
                length = float(part.findtext("geometry/cylinder/length"))
                quaternion = np.zeros(4)
                mujoco.mju_euler2Quat(quaternion, turned, "XYZ")
                body.add_geom(
                    type=mujoco.mjtGeom.mjGEOM_CYLINDER,
                    size=[float(radius), length / 2, 0],
                    pos=at,
                    quat=quaternion,
                    contype=0,
                    conaffinity=1,
                    friction=[float(part.findtext("surface/friction/ode/mu")), 0.005, 0.0001],
                )
        bodies[name] = body
        return body

    for name in links:
        add(name)
    plugin = twin.find("plugin")
    for side in ("left", "right"):
        steer = spec.add_actuator(name=f"steer_{side}", target=f"front_{side}_steer_joint")
        steer.trntype = mujoco.mjtTrn.mjTRN_JOINT
        steer.set_to_position(kp=gain(plugin, "left_steering_pid_gain"))
        drive = spec.add_actuator(name=f"drive_{side}", target=f"rear_{side}_wheel_joint")
        drive.trntype = mujoco.mjtTrn.mjTRN_JOINT
        drive.set_to_velocity(kv=gain(plugin, "linear_velocity_pid_gain"))
        effort = float(joints[f"rear_{side}_wheel"].findtext("axis/limit/effort"))
        drive.forcerange, drive.forcelimited = [-effort, effort], True
    return spec.compile()


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> mujoco.MjModel:
    path = tmp_path_factory.mktemp("sdf") / "world.sdf"
    write_sdf(built(), path, vehicles=place_vehicles(built(), ALL_KINDS, CAR))
    return twin_model(path)


def driven(model: mujoco.MjModel, *, speed_mps: float, steering_rad: float, for_s: float) -> Any:
    """Drive with both front wheels turned by Ackermann's rule; return poses x, y, z, yaw."""
    data = mujoco.MjData(model)
    tan = math.tan(steering_rad)
    half = TRACK_M / (2 * WHEELBASE_M) * tan
    left, right = math.atan2(tan, 1 - half), math.atan2(tan, 1 + half)
    poses = []
    for _ in range(int(for_s / model.opt.timestep)):
        data.actuator("steer_left").ctrl = left
        data.actuator("steer_right").ctrl = right
        for side, sign in (("left", -1.0), ("right", 1.0)):
            wheel = speed_mps / WHEEL_RADIUS_M * (1 + sign * half)
            data.actuator(f"drive_{side}").ctrl = wheel
        mujoco.mj_step(model, data)
        w, x, y, z = data.qpos[3:7]
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        poses.append([*data.qpos[:3], yaw])
    return np.array(poses)


def test_a_twin_stands_on_its_wheels(model: mujoco.MjModel) -> None:
    poses = driven(model, speed_mps=0.0, steering_rad=0.0, for_s=2.0)
    assert abs(poses[-1][2]) < 0.02
    np.testing.assert_allclose(poses[-1][:2], 0.0, atol=0.02)


def test_a_twin_drives_forward(model: mujoco.MjModel) -> None:
    poses = driven(model, speed_mps=5.0, steering_rad=0.0, for_s=4.0)
    speed = (poses[-1] - poses[-501]) / (500 * model.opt.timestep)
    assert speed[0] == pytest.approx(5.0, rel=0.03)
    assert abs(poses[-1][1]) < 0.1


@pytest.mark.parametrize("steering_rad", [0.3, -0.3])
def test_a_twin_turns_as_its_wheelbase_says(model: mujoco.MjModel, steering_rad: float) -> None:
    poses = driven(model, speed_mps=2.0, steering_rad=steering_rad, for_s=6.0)[1500:]
    steps = np.diff(poses, axis=0)
    turned = np.unwrap(poses[:, 3])[-1] - np.unwrap(poses[:, 3])[0]
    radius = np.hypot(steps[:, 0], steps[:, 1]).sum() / turned
    # The rear axle's centre on a circle of L / tan(δ), but for slip at the tyres.
    assert radius == pytest.approx(WHEELBASE_M / math.tan(steering_rad), rel=0.08)
