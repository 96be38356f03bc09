"""What the engineer reads at the end of a drive, told from its record."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any, NamedTuple

from foretwin.contracts.running import with_others
from foretwin.contracts.terminal import plain
from foretwin.orchestrator.agreement.verdict_rows import agreement_lines
from foretwin.orchestrator.record.sibling_count import sibling_lines
from foretwin.orchestrator.record.whereabouts import junction_name
from foretwin.orchestrator.rounds.siblings import SIBLING
from foretwin.orchestrator.tuning.words import summary_lines

log = logging.getLogger("orchestrator")

DISAGREEMENTS_SHOWN = 12
REASONS_SHOWN = 3
BEGINNING_S = 0.5
"""Where a junction is near so soon, the drive began near it."""


def _readiness(junction: dict[str, Any], config: dict[str, Any]) -> str:
    """Say how long before the car came near a World was ready; a drive may begin near one.

    In lock step the drive waits for Worlds, and how long that takes says nothing of the drive.
    """
    if config["speed"] is None:
        return "its world never came" if junction["built_at_s"] is None else "its world was ready"
    before_s = junction["world_ready_before_s"]
    if before_s < 0.0:
        return f"its world came {-before_s:.1f} s late"
    if junction["within_radius_at_s"] - config["start_s"] < BEGINNING_S:
        return "its world was ready before the drive began"
    return f"its world was ready {before_s:.1f} s before the car came near"


def side_by_side_lines(found: Any, junctions: Sequence[dict[str, Any]] = ()) -> list[str]:
    """Return what is said of human and ADS: each segment, and where they disagree."""
    if found is None:
        return []
    names = {junction["id"]: junction_name(junction) for junction in junctions}
    lines = [
        f"  {one['control_mode']} for {(one['to_stamp_ns'] - one['from_stamp_ns']) / 1e9:.1f} s: "
        f"{one['plans']} plans of the ADS, 95 % within {_across(one)}"
        f"{one['along_m']:.1f} m along, {one['speed_mps']:.1f} m/s of what was then driven"
        for one in found["segments"]
        if one["plans"]
    ]
    lines += [
        f"  {one['drive_time_s']:7.1f} s  {one['kind'].replace('_', ' ')} for "
        f"{one['duration_s']:.1f} s at {one['lat_deg']:.6f}, {one['lon_deg']:.6f} "
        f"({names.get(one['junction_id'], one['junction_id']) or 'no junction ahead'})"
        for one in found["disagreements"][:DISAGREEMENTS_SHOWN]
    ]
    more = len(found["disagreements"]) - DISAGREEMENTS_SHOWN
    return [*lines, f"  and {more} more in results/disagreements.parquet"] if more > 0 else lines


def _across(segment: dict[str, Any]) -> str:
    """Say how far plans lay across, and of how many that is known where not of all."""
    across_m, ways = segment["lateral_m"], segment.get("ways", segment["plans"])
    if across_m is None:
        return ""
    of = "" if ways == segment["plans"] else f" (of the {ways} whose way could be compared)"
    return f"{across_m:.1f} m across{of}, "


class LastWords(NamedTuple):
    """What is told at the end of a drive; `failed` where an error of ours was in the way."""

    text: str
    failed: bool = False


def summed_up(record: dict[str, object]) -> LastWords:
    """Return what is told of a drive that is over and kept, whatever stands in its record."""
    try:
        return LastWords(summary_text(record))
    except Exception:
        log.exception("a drive that is kept could not be summed up")
        text = f"{record['exit']}: run.json says how it went, log.jsonl why no more"
        return LastWords(text, failed=True)


def summary_text(record: dict[str, object]) -> str:
    """Return what the engineer reads at the end of a drive."""
    futures = record["futures"]
    assert isinstance(futures, dict)
    junctions = record["intersections"]
    assert isinstance(junctions, list)
    config: dict[str, Any] = record["config"]  # type: ignore[assignment]
    lines = [
        f"{record['exit']}: {_counted(len(junctions), 'junction')} passed, {futures['count']} "
        f"futures in {_counted(futures['rounds'], 'round')} ({futures['missed_rounds']} missed)"
        + _pace(record["state_to_result_ms_p95"], lock_step=config["speed"] is None)
    ]
    if futures["smaller_rounds"] or futures["spared_rounds"]:
        sizes = [f"{n} had {size}" for size, n in futures["rounds_by_futures"].items()]
        lines.append(
            f"  the machine was too slow for {futures['wanted_per_round']} futures in every round: "
            f"{', '.join(sizes)}, {futures['spared_rounds']} were left out"
        )
    lines += _reasons_lines(
        futures.get("not_placed"), "in {} of the futures the scenario was not placed"
    )
    lines += _reasons_lines(
        futures.get("remarked"), "of {} of the futures their planner has to say"
    )
    lines += [
        f"  {junction['arrived_at_s']:7.1f} s  {junction_name(junction)} ({junction['kind']}): "
        f"{_readiness(junction, config)}"
        for junction in junctions
    ]
    if "map" in record["telemetry"]["position_from"]:  # type: ignore[index]
        lines.append("  the car's position came from GNSS and the map")
    lines += side_by_side_lines(record.get("side_by_side"), junctions)
    lines += agreement_lines(record.get("agreement"), junctions)  # type: ignore[arg-type]
    lines += sibling_lines(record.get("siblings"), _share_of_core(record))  # type: ignore[arg-type]
    lines += summary_lines(record["tuning"], junctions)  # type: ignore[arg-type]
    lines += _free_twin_lines(record.get("free_twin"))  # type: ignore[arg-type]
    attribution = record["map"]["attribution"]  # type: ignore[index]
    return "\n".join(plain(line) for line in (*lines, attribution))


def _reasons_lines(reasons: dict[str, int] | None, of_how_many: str) -> list[str]:
    """Say of how many futures something is to be said, and what of most."""
    return [f"  {counted_reasons(reasons, of_how_many)}"] if reasons else []


def failed_line(record: dict[str, Any]) -> str | None:
    """Return what the engineer reads of futures that failed, from run.json; None where none did."""
    futures = record["futures"]
    reasons = futures.get("failed")
    of_how_many = f"{{}} of {futures['count']} futures"
    return counted_reasons(reasons, of_how_many) if reasons else None


def counted_reasons(reasons: dict[str, int], of_how_many: str) -> str:
    """Return how many there are, in the place of {}, and the commonest reasons."""
    total = sum(reasons.values())
    told = with_others(dict(list(reasons.items())[:REASONS_SHOWN]), total)
    why = "; ".join(f"{reason} ({count})" for reason, count in told.items())
    return f"{of_how_many.format(total)}: {why}"


def _pace(latency_ms: Any, *, lock_step: bool) -> str:
    """Say how soon results were there; in lock step the car waited for them, however long."""
    if latency_ms is None:
        return ""
    if lock_step:
        return ", in lock step: the drive waited for each"
    return f", 95 % within {latency_ms / 1e3:.2g} s of the state"


def _share_of_core(record: dict[str, Any]) -> float | None:
    """Return what the second engine's process took of a core while it could play."""
    share: float | None = record.get("processor", {}).get(SIBLING, {}).get("share_of_core")
    return share


def _free_twin_lines(free_twin: dict[str, int] | None) -> list[str]:
    """Say how often the free twin was beyond a limit that the viewer draws."""
    if not free_twin or not free_twin["samples"]:
        return []
    share = free_twin["beyond_limits"] / free_twin["samples"]
    return [f"  the twin, left to itself, was beyond a limit {share:.1%} of the time"]


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'s' if number != 1 else ''}"
