"""The same job on every engine, at junctions of real maps."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw
from foretwin.contracts.futures import EngineName, Job, PathAhead
from foretwin.contracts.runner import JobRequest
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.multibody_equations import BODY, TYRE
from foretwin.geometry.polyline import headings_rad
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.rounds.probe import probe_task
from foretwin.sim_worker.engines import multibody
from foretwin.sim_worker.engines.multibody_car import MultiBodyNumbers, multibody_car
from foretwin.sim_worker.engines.registry import trouble_with_engine
from foretwin.sim_worker.futures.run_job import run_alone
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered
from tests.world_gen.export.judged_sample import sample_worlds

BEND_DEG = 20.0
JUNCTIONS, HORIZON_S, ALLOWED_M, STIFFER = 20, 4.0, 0.5, 50.0
NEARER_M, PROBE_BEHIND_M = (0, 28), 5
"""The probe begins 40 m before the junction, its path 5 m before that, in points 1 m apart."""
OTHERS: tuple[EngineName, ...] = ("multibody", "gazebo")


def nominal_job(world: World, car: VehicleParameters, nearer_m: int) -> Job | None:
    """The probe's nominal future alone, `nearer_m` on its way: 28 leave 12 m to the junction."""
    task = probe_task(DriveConfig(), world, car, 0)
    if task is None:
        return None
    assert isinstance(task.question, JobRequest)
    job = task.question.decoded()
    xy_m = job.path.xy_m[nearer_m:]
    yaw = headings_rad(xy_m)[PROBE_BEHIND_M]
    lat, lon = geo_from_local(world.frame, xy_m[PROBE_BEHIND_M])
    state = msgspec.structs.replace(
        job.state,
        position=GeoPoint(float(lat), float(lon)),
        yaw_rad=float(geo_from_local_yaw(world.frame, yaw, xy_m[PROBE_BEHIND_M])),
    )
    limits = job.path.speed_limit_mps[nearer_m:]
    return msgspec.structs.replace(
        job,
        state=state,
        path=PathAhead(xy_m=xy_m, speed_limit_mps=limits),
        futures=job.futures[:1],
        scenarios=(),
        horizon_s=HORIZON_S,
        accidents=False,
        metrics=(),
    )


def turned(xy_m: Array) -> float:
    """By how many degrees a way turns, either way, from its begin to its end."""
    headings = np.unwrap(headings_rad(xy_m[:: len(xy_m) // 8]))
    return float(np.degrees(np.ptp(headings)))


def way(job: Job, world: World, car: VehicleParameters, engine: EngineName) -> Array:
    result = run_alone(msgspec.structs.replace(job, engine=engine), world, car)
    return np.asarray(result.trajectory.states[0, :, :2], dtype=np.float64)


def switched(car: VehicleParameters, engine: EngineName) -> dict[str, VehicleParameters]:
    """The twin with one term as the other engine has it."""
    if engine == "gazebo":
        rigid = {
            name: getattr(car, name).value * STIFFER
            for name in ("front_cornering_stiffness_npr", "rear_cornering_stiffness_npr")
        }
        return {
            "rigid tyres": altered(car, **rigid),
            "lighter wheels": altered(car, wheel_inertia_mass_factor=1.036),
        }
    return {}


TERMS: dict[str, dict[str, float]] = {
    "no camber": dict.fromkeys(("D_f", "D_r", "p_hy1", "p_hy3", "p_vy1", "p_vy3", "p_dy3"), 0.0),
    "tyres that do not saturate": {"grip": 5.0},
    "no load transfer": {"h_s": 0.35},
    "springs ten times as stiff": dict.fromkeys(
        ("K_sf", "K_sr", "K_sdf", "K_sdr", "K_ras", "K_rad"), 10.0
    ),
    "front wheels turned by a linkage": {"linkage": 1.0},
}
"""In what the multi-body model is not as the twin, each as there; springs by a factor."""


def without(numbers: MultiBodyNumbers, term: str) -> MultiBodyNumbers:
    """The multi-body car without one term."""
    change = TERMS[term]
    scaled = term.startswith("springs")
    body, tyre = (
        tuple(
            (old * change[name] if scaled else change[name]) if name in change else old
            for name, old in zip(names, values, strict=True)
        )
        for names, values in ((BODY, numbers.body), (TYRE, numbers.tyre))
    )
    grip = numbers.grip_per_friction * change.get("grip", 1.0)
    linkage = change.get("linkage", numbers.linkage)
    return numbers._replace(body=body, tyre=tyre, grip_per_friction=grip, linkage=linkage)


def multibody_without(job: Job, world: World, car: VehicleParameters, term: str) -> Array:
    """The way of the multi-body car without one term."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(multibody, "multibody_car", lambda of: without(multibody_car(of), term))
        return way(job, world, car, "multibody")


def junctions_text(data: Path) -> Iterator[str]:
    """Yield a line for each junction and one for each engine."""
    car = load_vehicle()
    engines = [name for name in OTHERS if trouble_with_engine(name) is None]
    found: dict[EngineName, list[float]] = {name: [] for name in engines}
    turning: dict[EngineName, list[bool]] = {name: [] for name in engines}
    drivable = (
        (name, world, jobs)
        for name, world in sample_worlds(data)
        if None not in (jobs := [nominal_job(world, car, m) for m in NEARER_M])
    )
    passages = (
        (f"{name} from {40 - nearer_m} m", world, job)
        for name, world, jobs in islice(drivable, JUNCTIONS)
        for nearer_m, job in zip(NEARER_M, jobs, strict=True)
    )
    for name, world, job in passages:
        assert job is not None
        here = way(job, world, car, "mujoco")
        turned_deg = turned(here)
        said = []
        for engine in engines:
            there = way(job, world, car, engine)
            apart = float(np.hypot(*(here[-1] - there[-1])))
            found[engine].append(apart)
            if turned_deg >= BEND_DEG:
                turning[engine].append(apart <= ALLOWED_M)
            text = f"{engine} {apart:.2f} m"
            if apart > ALLOWED_M:
                for term, other in switched(car, engine).items():
                    left = way(job, world, other, "mujoco")[-1] - there[-1]
                    text += f" ({term} in the twin: {np.hypot(*left):.2f} m)"
                for term in TERMS if engine == "multibody" else ():
                    left = here[-1] - multibody_without(job, world, car, term)[-1]
                    text += f" ({term}: {np.hypot(*left):.2f} m)"
            said.append(text)
        yield f"{name}, turning {turned_deg:.0f} deg: {', '.join(said)}"
    for engine, apart in found.items():
        near, bent = sum(one <= ALLOWED_M for one in apart), turning[engine]
        yield (
            f"{engine}: {JUNCTIONS} junctions, within {ALLOWED_M:g} m after {HORIZON_S:g} s "
            f"in {near} of {len(apart)} passages, in {sum(bent)} of the {len(bent)} that turn by "
            f"{BEND_DEG:g} deg or more; median {np.median(apart):.2f} m, most {max(apart):.2f} m"
        )
    for name in set(OTHERS) - set(engines):
        yield f"{name}: {trouble_with_engine(name)}"
