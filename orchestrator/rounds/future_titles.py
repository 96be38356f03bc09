"""Futures in the words of people: the scenario's title, and how the future departs from it."""

from __future__ import annotations

from collections.abc import Mapping

from foretwin.contracts.futures import Future

NOMINAL = "nominal"
_ARRIVES = ".arrives_after_s"


def future_title(future: Future, titles: Mapping[str, str]) -> str:
    """Return what happens in a future, by the titles of scenarios: its `name` is for tables."""
    parts = [titles.get(future.scenario_id, future.scenario_id)] if future.scenario_id else []
    late_s = next((v for name, v in future.values.items() if name.endswith(_ARRIVES)), 0.0)
    if round(late_s, 1):
        parts.append(f"{abs(late_s):.1f} s {'later' if late_s > 0.0 else 'earlier'}")
    parts += _aims(future.numbers)
    if not parts:
        return NOMINAL if future.index == 0 else future.name
    return ", ".join(parts)


def _aims(numbers: Mapping[str, float]) -> list[str]:
    """Return how the car itself is another one than expected."""
    found = []
    if percent := round(100.0 * (numbers.get("target_speed_factor", 1.0) - 1.0)):
        found.append(f"car {abs(percent)} % {'faster' if percent > 0 else 'slower'}")
    if (grip := numbers.get("friction_factor", 1.0)) != 1.0:
        found.append(f"grip {100.0 * grip:.0f} %")
    if delay_s := numbers.get("extra_steering_delay_s", 0.0):
        found.append(f"steering {delay_s:.1f} s late")
    if shift_m := numbers.get("lateral_shift_m", 0.0):
        found.append(f"{abs(shift_m):.1f} m to the {'left' if shift_m > 0.0 else 'right'}")
    return found
