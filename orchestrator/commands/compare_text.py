"""Two drives of one road against each other, as text of 80 columns."""

from __future__ import annotations

from collections.abc import Iterator

from foretwin.sim_worker.analysis.two_drives.differences import (
    LIKE_SPEED_MPS,
    QUANTILES,
    UNITS,
    DriveDifference,
)

_LABELS = {
    "lateral_m": "to the left",
    "speed_mps": "speed",
    "time_per_100m_s": "time for 100 m",
    "accel_mps2": "acceleration",
}
_MOST_LISTED = 12


def difference_lines(found: DriveDifference, first: str, second: str) -> Iterator[str]:
    """Yield what two drives have in common, how they differ there, and stretch by stretch."""
    sides = (
        (first, found.a_m, found.common_a_m, found.std_m[0]),
        (second, found.b_m, found.common_b_m, found.std_m[1]),
    )
    for name, length_m, common_m, std_m in sides[: 1 if first == second else 2]:
        known = "its positions do not say how good they are"
        if std_m is not None:
            known = f"positions known to {std_m:.2f} m, as estimated"
        yield f"{name}: {length_m:.0f} m, of these {length_m - common_m:.0f} m alone; {known}"
    count = len(found.stretches)
    other = f"; {found.opposite_m:.0f} m the other way round" if found.opposite_m else ""
    passages = "passage" if count == 1 else "passages"
    yield f"in common: {found.common_b_m:.0f} m of road in {count} {passages}{other}"
    yield ""
    yield "second minus first, by place"
    yield f"{'':<16}{'':>6}" + "".join(f"{f'{q:.0%}':>8}" for q in QUANTILES) + f"{'RMS':>8}"
    for name, unit in UNITS.items():
        one = found.spreads[name]
        cells = "".join(f"{value:>8.2f}" for value in (*one.quantiles, one.rms))
        text = cells if one.places else "  no passage is so long"
        yield f"{_LABELS[name]:<16}{unit:>6}{text}"
    yield ""
    yield from after_lines(found)
    yield ""
    yield f"{'passage':<8}{'first':>16}{'second':>16}{'length':>9}{'took':>10}{'and':>9}"
    for number, here in enumerate(found.stretches[:_MOST_LISTED], start=1):
        took_a, took_b = here.a_s[-1] - here.a_s[0], here.b_s[-1] - here.b_s[0]
        yield (
            f"{number:<8}{f'from {here.a_s[0]:.0f} s':>16}{f'from {here.b_s[0]:.0f} s':>16}"
            f"{here.stretch.length_m:>7.0f} m{took_a:>8.1f} s{took_b:>7.1f} s"
        )
    if count > _MOST_LISTED:
        yield f"and {count - _MOST_LISTED} more"


def after_lines(found: DriveDifference) -> Iterator[str]:
    """Yield how far apart both are some seconds after they passed a place at like speed: the
    scale for gaps between a car and its model."""
    yield f"seconds after a place that both passed at like speed (within {LIKE_SPEED_MPS:g} m/s)"
    yield f"{'after':>5}{'places':>8}{'left out':>10}" + "".join(
        f"{name:>9}{'95 %':>8}" for name in ("along, m", "across, m", "m/s")
    )
    for row in found.after:
        begun = f"{row.horizon_s:>3g} s{row.along.places:>8}{row.left_out:>10}"
        if not row.along.places:
            yield f"{begun}  no such place"
            continue
        sides = (row.along, row.across, row.speed)
        cells = "".join(f"{one.rms:>9.2f}{one.size_p95:>8.2f}" for one in sides)
        yield f"{begun}{cells}"
    if any(row.left_out for row in found.after):
        yield "left out: so near the end of a passage that a car may be past it by then"
