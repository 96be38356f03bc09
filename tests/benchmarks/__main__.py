"""`python -m tests.benchmarks [NAME ...]` measures and writes `build/bench.json`.

The file is `{name: {value, unit, baseline, ratio, ...}}`; rows of benchmarks that were not
named stay. Exit code 1 where something could not be measured, 2 for an unknown name.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from pathlib import Path

from tests.benchmarks.measuring import Measurement, UnavailableError

OUT = Path(__file__).parents[2] / "build" / "bench.json"

BENCHMARKS = (
    "open_loop_16",
    "closed_loop_10hz",
    "closed_loop_20hz",
    "closed_loop_50hz",
    "two_cores",
    "sweep_two_cores",
    "boxes_200",
    "boxes_1000",
    "full_scene",
    "live_metrics",
    "merged_objects",
    "merged_clouds",
    "metadrive",
    "gym_steps",
    "world_from_open_map",
    "world_stages",
    "world_cutout_vs_netconvert",
    "world_monaco_vs_netconvert",
    "world_liechtenstein_vs_netconvert",
    "state_to_result",
    "live_round",
    "live_total_cpu",
    "metrics_64x80x10",
    "estimator_bad_network",
    "told_metrics",
    "received_samples",
    "tuning_cost",
    "ray_overhead",
    "help_startup",
    "lidar_turn",
    "radar_turn",
    "camera_turn",
)
"""Each is a module of this package with a function `measure() -> Measurement`."""


def main(names: list[str]) -> int:
    """Run the named benchmarks, all by default, and write those that could be measured."""
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        print(f"unknown benchmark {', '.join(unknown)}; known: {', '.join(BENCHMARKS)}")
        return 2
    chosen = names or list(BENCHMARKS)
    rows: dict[str, dict[str, float | str]] = {}
    for name in chosen:
        start = time.perf_counter()
        try:
            measured: Measurement = importlib.import_module(f"tests.benchmarks.{name}").measure()
        except UnavailableError as missing:
            print(f"{name:28} not measured: {missing}")
            continue
        rows[name] = measured.as_row()
        print(
            f"{name:28} {measured.value:12.4g} against {measured.baseline:10.4g} {measured.unit}:"
            f" ratio {measured.value / measured.baseline:.3f}"
            f" ({time.perf_counter() - start:.0f} s to measure)",
            flush=True,
        )
        for name_of, figure in measured.more.items():
            print(f"{'':28} {name_of} {figure:.4g}")
    OUT.parent.mkdir(exist_ok=True)
    kept = {name: row for name, row in _written().items() if name not in chosen}
    in_order = {name: row for name in BENCHMARKS if (row := {**kept, **rows}.get(name))}
    OUT.write_text(json.dumps(in_order, indent=2) + "\n", encoding="utf-8")
    print(f"written: {OUT}")
    return 0 if len(rows) == len(chosen) else 1


def _written() -> dict[str, dict[str, float | str]]:
    """Return the rows of earlier runs; a file that was cut short holds none."""
    try:
        return json.loads(OUT.read_text(encoding="utf-8"))  # type: ignore[no-any-return]
    except (FileNotFoundError, json.JSONDecodeError):
        return {}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
