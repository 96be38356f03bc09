"""`foretwin compare` of two runs or two sweeps: what changed, and whether that is chance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import command_line, plain
from foretwin.orchestrator.across.changes import changes_between, is_worse
from foretwin.orchestrator.across.paired_statistics import LEAST_PLACES, LEVEL
from foretwin.orchestrator.across.pairs import side_of
from foretwin.orchestrator.agreement.difference import difference_lines, difference_of, read_judged
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.record.folders_of_runs import is_run_folder

WORSE = 3
_MOST_LISTED = 12


def compare_runs(
    first: Path,
    second: Path,
    *,
    planners: str | None,
    every: bool = False,
    fail_on_worse: bool,
) -> CommandResult:
    """Return what changed from one run or sweep to another; its code is 0, or where it is asked 3
    if more cases newly fail than were fixed.

    `planners` names one for each side, with a comma between; with `every` measures are listed whose
    change may be chance. Raises UserError in one line.
    """
    of_first, of_second = _planners(planners)
    if first.resolve() == second.resolve() and of_first == of_second:
        raise UserError(f"compare: both are {first}: name another, or two of its --planners A,B")
    found = changes_between(side_of(first, of_first), side_of(second, of_second))
    judged = _judged(first, second) if found["first"]["kind"] == "drive" else None
    lines = [*change_lines(found, every=every), *(difference_lines(judged)[2:] if judged else ())]
    return CommandResult(
        {**found, "judged": judged},
        "\n".join(map(plain, lines)),
        WORSE if fail_on_worse and is_worse(found) else 0,
    )


def refuse_for_runs(first: Path, second: Path, *, of_drives: tuple[object, ...]) -> None:
    """Raise UserError where a run is compared with what is none, or with options of drives."""
    for folder in (first, second):
        if not folder.exists():
            raise FileNotFoundError(f"{folder}: no such folder")
        if not is_run_folder(folder):
            raise UserError(
                f"compare: {folder} is neither a run nor a sweep: name two of these, or two "
                "recorded drives (of a run: RUN/drive.mcap)"
            )
    if any(one is not None for one in of_drives):
        raise UserError(
            "compare: --out and declarations are for recorded drives, not runs or sweeps"
        )


def _planners(given: str | None) -> tuple[str | None, str | None]:
    if given is None:
        return None, None
    names = [name.strip() for name in given.split(",")]
    if len(names) != 2 or not all(names):
        raise UserError(f"--planners {given}: two names, as in --planners mine,yours")
    return names[0], names[1]


def _judged(first: Path, second: Path) -> dict[str, Any] | None:
    """Return what `foretwin judge` would say of both; None where a run has not what it takes."""
    if first.resolve() == second.resolve():
        return None
    try:
        return difference_of(read_judged(first), read_judged(second))
    except (FileNotFoundError, KeyError, TypeError):
        return None


def change_lines(found: dict[str, Any], *, every: bool = False) -> Iterator[str]:
    """Yield what changed, as text; with `every` also what may be chance."""
    for name, side in (("A", found["first"]), ("B", found["second"])):
        who = ", ".join(side["planners"])
        yield f"{name}: {side['folder']} ({side['futures']} futures of {who})"
    for name, both in found["inputs"].items():
        yield f"  {name}: {both['first']} → {both['second']}"
    if not found["inputs"]:
        yield "  nothing that decides futures differs"
    failing = found["failing"]
    alone = f"{found['only_first']} only in A, {found['only_second']} only in B"
    yield f"{found['pairs']} cases are in both, {alone}; {failing['pairs']} were played in both"
    not_played = found["not_played"]
    if not_played["newly"] or not_played["no_longer"]:
        yield (
            f"not played: {not_played['newly']} newly, "
            f"{not_played['no_longer']} no longer, {not_played['neither']} in neither"
        )
    yield f"to the same bits: {found['equal']}"
    yield (
        f"collided: {failing['first']} → {failing['second']}: {failing['newly']} newly failing, "
        f"{failing['fixed']} fixed"
    )
    if failing["change"] is not None:
        yield from _share_lines(failing["change"])
    yield from _measure_lines(found["measures"], every=every)
    yield from _alone_lines(found["alone"], every=every)
    yield from _place_lines(found["places"])
    for name, side in (("newly failing", "second"), ("fixed", "second")):
        cases, folder = found[name.replace(" ", "_")], found[side]["folder"]
        for one in cases[:_MOST_LISTED]:
            where = f"{one['scenario'] or 'nominal'} at {one['junction_id']}: {one['name']}"
            yield f"{name}: {where}: {command_line('repeat', folder, one['future_id'])}"
        if len(cases) > _MOST_LISTED:
            yield f"{name}: {len(cases) - _MOST_LISTED} more: --json"


def _share_lines(change: dict[str, Any]) -> Iterator[str]:
    """Yield how the share of collisions changed, and whether the choice of places explains it."""
    said = f"change of the share, in percentage points: {_interval(change, 100.0)}"
    p_value = change["p_value"]
    if p_value is not None:
        sure = "significant" if p_value < LEVEL else "not significant"
        yield f"{said}, p = {p_value:.3g}, {sure}"
        return
    yield said
    yield (
        f"fewer than {LEAST_PLACES} places: too few to tell a change from the choice of places; "
        "what is counted here is true of these cases alone"
    )


def _measure_lines(rows: list[dict[str, Any]], *, every: bool) -> Iterator[str]:
    """Yield so many of the measures that changed as are read at once, and with `every` all: those
    first that are for the worse or the better, and of these the surest."""
    changed = sorted((row for row in rows if row["change"]["mean"] != 0.0), key=_order)
    sure = [row for row in changed if _doubt(row) < LEVEL]
    shown = changed if every else sure[:_MOST_LISTED]
    if shown:
        yield f"{'measure':<40}{'A':>10}{'B':>10}  {'B minus A, 95 %':<40} p adjusted"
    for row in shown:
        p_value = "" if row["p_adjusted"] is None else f"{row['p_adjusted']:.3g}"
        name = row["measure"] if row["unit"] == "1" else f"{row['measure']} ({row['unit']})"
        yield (
            f"{name:<40}{row['first']:>10.4g}{row['second']:>10.4g}  "
            f"{_interval(row['change'], 1.0):<40} {p_value:<10}{row['word']}"
        )
    if relative := [row["measure"] for row in shown if row["relative"]]:
        yield (
            f"{', '.join(relative)}: relative to the farthest of the futures of one job: between "
            "planners, or sweeps of other cases, no measure of progress"
        )
    if every:
        return
    left = Counter(row["word"] for row in sure[len(shown) :])
    if left:
        words = ", ".join(f"{count} {word}" for word, count in sorted(left.items()))
        yield f"{left.total()} more changed significantly ({words}): --all"
    unsure = changed[len(sure) :]
    at_few = sum(row["p_adjusted"] is None for row in unsure)
    if chance := len(unsure) - at_few:
        yield f"{_measures(chance)} changed not significantly: --all"
    if at_few:
        yield f"{_measures(at_few)} changed at too few places to tell: --all"


def _alone_lines(rows: list[dict[str, Any]], *, every: bool) -> Iterator[str]:
    """Yield of which measures one side alone has a value, significantly oftener than the other;
    with `every` all."""
    ordered = sorted(rows, key=_doubt)
    shown = ordered if every else [row for row in ordered if _doubt(row) < LEVEL][:_MOST_LISTED]
    for row in shown:
        yield (
            f"{row['measure']}: only A has a value in {row['first']} cases, "
            f"only B in {row['second']}, {_sureness(row)}; "
            f"what changed is told of {row['both']} with both"
        )
    if left := len(rows) - len(shown):
        measures = "measure has" if left == 1 else "measures have"
        yield f"{left} more {measures} a value on one side alone in some cases: --all"


def _measures(count: int) -> str:
    return f"{count} {'measure' if count == 1 else 'measures'}"


def _sureness(row: dict[str, Any]) -> str:
    if row["p_adjusted"] is None:
        return f"at too few places to tell ({row['units']})"
    return f"p adjusted {row['p_adjusted']:.3g}"


def _order(row: dict[str, Any]) -> tuple[bool, bool, float]:
    doubt = _doubt(row)
    return doubt >= LEVEL, row["word"] == "changed", doubt


def _doubt(row: dict[str, Any]) -> float:
    return 1.0 if row["p_adjusted"] is None else float(row["p_adjusted"])


def _place_lines(rows: list[dict[str, Any]]) -> Iterator[str]:
    changed = [row for row in rows if row["newly"] or row["fixed"]]
    yield f"places where cases changed: {len(changed)} of {len(rows)}"
    for row in changed[:_MOST_LISTED]:
        yield (
            f"  {row['junction_id']}: collided {row['first']} → {row['second']} of {row['pairs']}, "
            f"{row['newly']} newly, {row['fixed']} fixed"
        )


def _interval(change: dict[str, Any], scale: float) -> str:
    mean = f"{scale * change['mean']:+z.3g}"
    places = f"{change['units']} {'place' if change['units'] == 1 else 'places'}"
    if change["low"] is None:
        return f"{mean} (too few to tell: {places})"
    return f"{mean} [{scale * change['low']:+z.3g}, {scale * change['high']:+z.3g}] ({places})"
