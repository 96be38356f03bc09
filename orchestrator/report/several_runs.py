"""Several runs side by side: what each came to, place by place, and what changed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from foretwin.orchestrator.progress import Progress, untold
from foretwin.orchestrator.record.whereabouts import driven_s
from foretwin.orchestrator.report.blocks import (
    Block,
    Chapter,
    Drawn,
    KeyFigure,
    Listed,
    Prose,
    Report,
    TableCell,
    Tone,
    change_between,
    listed_words,
    number,
    plural,
    row,
    scientific,
)
from foretwin.orchestrator.report.first_page import rounds_in_time, verdict_of
from foretwin.orchestrator.report.indicators import indicators_over
from foretwin.orchestrator.report.indicators_part import indicators_part
from foretwin.orchestrator.report.material import RunMaterial, in_lock_step, part_of
from foretwin.orchestrator.report.passages import JunctionPassed, passages, tone_of
from foretwin.orchestrator.report.provenance_part import provenance_part
from foretwin.orchestrator.report.route_picture import route_svg

_MOST_RUNS = 12
_TELL_LITTLE = {"out", "view", "trace", "metrics", "endpoint", "cache_dir"}
"""Settings that change nothing of what a drive comes to."""


class _Seen(NamedTuple):
    run: RunMaterial
    name: str
    passed: list[JunctionPassed]


def several_runs_report(
    runs: Sequence[RunMaterial],
    *,
    pictures: bool = True,
    places: bool = True,
    progress: Progress = untold,
) -> Report:
    """Return the report of several runs; the first is what the others are held against."""
    shown = runs[:_MOST_RUNS]
    seen, of_each = [], []
    with progress(2 * len(shown) + 1, "sections") as (advance, _):
        for place, run in enumerate(shown):
            seen.append(_Seen(run, f"{chr(ord('A') + place)}", passages(run)))
            advance(seen[-1].name)
        indicators = indicators_over(runs)
        advance("indicators")
        for one in seen:
            of_each.append(_one(one, pictures=pictures))
            advance(one.name)
    unread = [f"{one.name}: {word}" for one in seen for word in one.run.unread]
    ids = [str(one.run.record.get("run_id") or one.run.folder.name) for one in seen]
    attribution = dict.fromkeys(one.run.attribution for one in seen if one.run.attribution)
    return Report(
        title=f"{plural(len(seen), 'drive')} side by side",
        subtitle=" · ".join(f"{one.name}: {run_id}" for one, run_id in zip(seen, ids, strict=True)),
        verdict=_verdict(seen),
        tone="watch" if any(_tone(one) in ("watch", "bad") for one in seen) else "good",
        figures=tuple(_figure(one) for one in seen[:5]),
        front=(*(Prose(f"{one}.", "bad") for one in unread), _key_figures(seen), *_left(runs)),
        parts=(
            Chapter("settings", "What was set otherwise", (_settings(seen, places=places),)),
            Chapter("junctions", "Junction by junction", (_junctions(seen),)),
            indicators_part(indicators),
            *of_each,
            Chapter(
                "provenance",
                "Provenance",
                (),
                tuple(
                    provenance_part(one.run.folder, one.run.record, places=places)._replace(
                        anchor=f"provenance-{one.name}", title=f"Drive {one.name}"
                    )
                    for one in seen
                ),
            ),
        ),
        attribution=tuple(attribution),
        counted=indicators,
        unread=tuple(unread),
    )


def _left(runs: Sequence[RunMaterial]) -> list[Block]:
    left = len(runs) - _MOST_RUNS
    return [Prose(f"{plural(left, 'further run')} not shown.", "watch")] if left > 0 else []


def _tone(one: _Seen) -> Tone:
    return verdict_of(one.run, one.passed)[1]


def _verdict(seen: Sequence[_Seen]) -> str:
    first, *others = seen
    said = []
    for other in others:
        a, b = (part_of(one.run.record, "comparison", "ade_m", "4") for one in (first, other))
        if a is not None and b is not None and round(a, 2) == round(b, 2):
            said.append(
                f"what {other.name} foresaw lies as far from what was driven as {first.name} did "
                f"after 4 s ({a:.2f} m)"
            )
        elif a is not None and b is not None:
            nearer = "nearer to" if b < a else "farther from"
            said.append(
                f"what {other.name} foresaw lies {abs(b - a):.2f} m {nearer} what was driven than "
                f"{first.name} after 4 s ({b:.2f} against {a:.2f} m)"
            )
        for one, beside in ((first, other), (other, first)):
            if alone := _met(one) - _met(beside):
                met = plural(len(alone), "junction")
                said.append(f"{one.name} met {met} that {beside.name} did not")
    if not said:
        return "Too little is known of these drives to say what changed."
    text = "; ".join(said)
    chance = "Whether that is more than chance, one drive each cannot tell."
    return f"{text[0].upper()}{text[1:]}. {chance}"


def _met(one: _Seen) -> set[str]:
    return {str(passed.place["id"]) for passed in one.passed}


def _figure(one: _Seen) -> KeyFigure:
    gravest = max((p.gravest or 0.0 for p in one.passed), default=0.0)
    note = f"{plural(len(one.passed), 'junction')}, gravest {scientific(gravest).text}"
    error = part_of(one.run.record, "comparison", "ade_m", "4")
    value = "not known" if error is None else f"{error:.2f} m"
    return KeyFigure(value, f"{one.name}: off after 4 s", note, tone_of(gravest))


_Get = Callable[[_Seen], TableCell]


def _recorded(*path: str, digits: int = 0, unit: str = "", times: float = 1.0) -> _Get:
    def get(one: _Seen) -> TableCell:
        value: Any = part_of(one.run.record, *path)
        return number(None if value is None else times * float(value), digits, unit)

    return get


def _share_in_time(one: _Seen) -> TableCell:
    found = rounds_in_time(one.run)
    return number(None if not found or not found[1] else 100.0 * found[0] / found[1], 0, "%")


def _latency(one: _Seen) -> TableCell:
    record = {} if in_lock_step(one.run.record) else one.run.record
    return number(record.get("state_to_result_ms_p95"), 0, "ms")


def _agreeing(one: _Seen) -> TableCell:
    told = part_of(one.run.record, "agreement", "overall")
    if not told:
        return number(None)
    agree = told["agree_pass"] + told["agree_fail"]
    judged = agree + told["too_pessimistic"] + told["too_optimistic"]
    return number(100.0 * agree / judged if judged else None, 0, "%")


def _gravest(one: _Seen) -> TableCell:
    gravest = max((p.gravest or 0.0 for p in one.passed), default=0.0)
    return scientific(gravest, tone=tone_of(gravest))


_ROWS: tuple[tuple[str, _Get], ...] = (
    ("driven", lambda one: number(driven_s(one.run.record), 1, "s")),
    (
        "junctions reached",
        lambda one: number(float(sum(p.arrived_s is not None for p in one.passed)), 0),
    ),
    ("futures", _recorded("futures", "count")),
    ("rounds in time", _share_in_time),
    ("state to result, 95 % within", _latency),
    ("gravest foreseen", _gravest),
    ("futures that collide", lambda one: number(float(sum(p.collided for p in one.passed)), 0)),
    ("nominal future off after 2 s", _recorded("comparison", "ade_m", "2", digits=2, unit="m")),
    ("nominal future off after 8 s", _recorded("comparison", "ade_m", "8", digits=2, unit="m")),
    (
        "gap of the model along after 2 s",
        _recorded("tuning", "gap", "rms", "all", "along_m", digits=2, unit="m"),
    ),
    (
        "gap of the model across after 2 s",
        _recorded("tuning", "gap", "rms", "all", "across_m", digits=2, unit="m"),
    ),
    (
        "forecasts within p10 to p90 (80 % is right)",
        _recorded("calibration", "p10_p90_coverage", times=100.0, unit="%"),
    ),
    ("CRPS of forecasts", _recorded("calibration", "crps", digits=2, unit="m")),
    ("simulation agrees with reality", _agreeing),
    ("telemetry lost", _recorded("ledger", "telemetry", "lost")),
    ("jobs lost", _recorded("ledger", "jobs", "lost")),
)


def _key_figures(seen: Sequence[_Seen]) -> Listed:
    rows = []
    for name, get in _ROWS:
        cells = [get(one) for one in seen]
        rows.append(row(name, *cells, change_between(cells[0], cells[-1])))
    columns = ("figure", *(one.name for one in seen), "last minus first")
    return Listed("What each came to", columns, tuple(rows), frozenset(range(1, len(seen) + 2)))


def _settings(seen: Sequence[_Seen], *, places: bool) -> Block:
    configs = [one.run.record.get("config") or {} for one in seen]
    hidden = set() if places else {"map", "log", "route", "dem"}
    names = sorted({name for config in configs for name in config} - _TELL_LITTLE - hidden)
    versions = [one.run.record.get("versions") or {} for one in seen]
    packages = sorted({name for version in versions for name in version})
    rows = [
        row(name, *(TableCell(_short(config.get(name)), code=True) for config in configs))
        for name in names
        if len({str(config.get(name)) for config in configs}) > 1
    ]
    rows += [
        row(
            f"version of {name}",
            *(TableCell(version.get(name, "not told"), code=True) for version in versions),
        )
        for name in packages
        if len({version.get(name) for version in versions}) > 1
    ]
    if places and len({part_of(one.run.record, "map", "sha256") for one in seen}) > 1:
        hashes = (str(part_of(one.run.record, "map", "sha256") or "not told")[:12] for one in seen)
        rows.append(row("map, sha256", *(TableCell(one, code=True) for one in hashes)))
    if not rows:
        return Prose("Settings, versions and map are the same.")
    return Listed(
        "Settings and versions that differ",
        ("setting", *(one.name for one in seen)),
        tuple(rows),
    )


def _short(value: Any) -> str:
    text = str(value)
    return text.rsplit("/", 1)[-1] if "/" in text else text


def _junctions(seen: Sequence[_Seen]) -> Block:
    names: dict[str, str] = {}
    for one in seen:
        for passed in one.passed:
            names.setdefault(str(passed.place["id"]), passed.name)
    if not names:
        return Prose("None of these drives met a junction.")
    rows = []
    for junction_id, name in names.items():
        cells: list[TableCell] = []
        for one in seen:
            mine = [p for p in one.passed if str(p.place["id"]) == junction_id]
            grave = max((p.gravest or 0.0 for p in mine), default=None)
            cells += [
                number(float(sum(p.futures for p in mine)) if mine else None, 0),
                number(float(sum(p.collided for p in mine)) if mine else None, 0),
                scientific(grave, tone=tone_of(grave)),
            ]
        rows.append(row(name, *cells))
    columns = ["junction"]
    for one in seen:
        columns += [f"{one.name}: futures", "collide", "gravest"]
    return Listed(
        "Foreseen at each junction", tuple(columns), tuple(rows), frozenset(range(1, len(columns)))
    )


def _one(one: _Seen, *, pictures: bool) -> Chapter:
    verdict, tone = verdict_of(one.run, one.passed)
    blocks: list[Block] = [Prose(verdict, tone)]
    svg = None
    if pictures:
        svg = route_svg(one.run.track, one.run.worlds(), one.passed, linked=False)
    if svg is not None:
        blocks.append(
            Drawn(
                svg, f"The way of {one.name}, with its junctions. {one.run.attribution}", wide=True
            )
        )
    names = [p.name for p in one.passed]
    blocks.append(Prose(f"Junctions: {listed_words(names) or 'none'}."))
    return Chapter(f"drive-{one.name}", f"Drive {one.name}", tuple(blocks))
