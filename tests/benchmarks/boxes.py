"""Cars between static boxes, against the same cars on open ground."""

from __future__ import annotations

from tests.benchmarks import scenes
from tests.benchmarks.bare_loop import bare_loop
from tests.benchmarks.measuring import Measurement, cpu_seconds
from tests.benchmarks.open_loop_16 import drive, stage_of

REPEATS = 12
SECONDS = scenes.FUTURES * scenes.HORIZON_S


def measure_among(boxes: int) -> Measurement:
    """Return CPU seconds in which 64 cars drive for 8 s, at last off the road and into boxes.

    `ratio_bare` is that of a bare C loop, which looks for contacts in every step.
    """
    street = scenes.street(buildings=boxes)
    among, flat = (stage_of(world, futures=scenes.FUTURES) for world in (street, None))
    if among.model.ngeom < boxes:
        raise AssertionError(f"{boxes} boxes, but the stage has {among.model.ngeom} geoms")
    among_s = flat_s = bare_among_s = bare_flat_s = float("inf")
    with (
        bare_loop(among.model, seconds=SECONDS, speed_mps=0.0) as bare_among,
        bare_loop(flat.model, seconds=SECONDS, speed_mps=0.0) as bare_flat,
    ):
        for _ in range(REPEATS):
            among_s = min(among_s, cpu_seconds(lambda: drive(among)))
            flat_s = min(flat_s, cpu_seconds(lambda: drive(flat)))
            bare_among_s = min(bare_among_s, bare_among())
            bare_flat_s = min(bare_flat_s, bare_flat())
    return Measurement(among_s, "CPU s", flat_s, {"ratio_bare": bare_among_s / bare_flat_s})
