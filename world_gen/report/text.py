"""A World's report for people: plain text for a terminal, Markdown for a page."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import msgspec

from foretwin.world_gen.report.report import JunctionReport, WorldReport
from foretwin.world_gen.report.values import SOURCE_CONFIDENCE, SubjectReport

COLUMNS = 100
_HOW = ", ".join(f"{source} {worth:g}" for source, worth in SOURCE_CONFIDENCE.items())
EXPLANATION = (
    f"Confidence is the mean worth of the values ({_HOW}), over subjects by their weight. "
    "It compares junctions; it is no probability."
)


def as_text(report: WorldReport) -> str:
    """Return a report as plain text of at most 100 columns."""
    lines = [
        *_wrapped(f"World {report.world_id}: {report.name}", ""),
        f"confidence {_figure(report.confidence)}, {len(report.junctions)} junctions, "
        f"map {report.map_sha256[:12]}",
        *_wrapped(EXPLANATION, ""),
    ]
    for junction in report.junctions:
        lines += ["", *_wrapped(_title(junction), ""), *subject_table(junction.subjects)]
        for subject in junction.subjects:
            lines += _sentences(subject)
    around = report.buildings
    lines += ["", "Surroundings", *subject_table((around,)), *_sentences(around)]
    lines += ["", f"Notes: {sum(note.count for note in report.notes)}"]
    for note in report.notes:
        lines += _wrapped(f"{note.count:5}  {note.kind}", " " * 7)
        for example in note.examples:
            lines += _wrapped(f"       {_shortened(example, 2 * COLUMNS)}", " " * 9)
    lines += ["", report.attribution]
    return "\n".join(lines) + "\n"


def as_markdown(report: WorldReport) -> str:
    """Return a report as Markdown with one table for each junction."""
    lines = [
        f"# {_escaped(report.name)}",
        "",
        f"World `{report.world_id}`, map `{report.map_sha256[:12]}`, confidence "
        f"**{_figure(report.confidence)}**. {EXPLANATION}",
    ]
    for junction in report.junctions:
        lines += ["", f"## {_escaped(_title(junction))}", "", *_markdown(junction.subjects)]
    lines += ["", "## Surroundings", "", *_markdown((report.buildings,))]
    if report.notes:
        lines += ["", "## Notes", "", "| count | what | for example |", "|---:|---|---|"]
        lines += [
            f"| {note.count} | {_escaped(note.kind)} | {_escaped(_shortened(note.examples[0]))} |"
            for note in report.notes
        ]
    lines += ["", report.attribution]
    return "\n".join(lines) + "\n"


def _title(junction: JunctionReport) -> str:
    kind = junction.kind.replace("_", " ")
    return (
        f"Junction {junction.id}: {junction.name or 'unnamed'} ({kind}, {junction.arms} arms, "
        f"{junction.control.replace('_', ' ')}), confidence {_figure(junction.confidence)}"
    )


def subject_table(
    subjects: Sequence[SubjectReport], *, head: str = "  ", width: int = 20
) -> list[str]:
    """Return lines that count the values of each subject by where they are from.

    The first column is `width` wide, under `head`, and indented as that is.
    """
    indent = " " * (len(head) - len(head.lstrip()))
    return [
        f"{head:{width}}{'tagged':>8}{'inferred':>10}{'default':>9}{'confidence':>12}",
        *(
            f"{indent + s.subject:{width}}{_known(s):8}{s.inferred:10}{s.default:9}"
            f"{_figure(s.confidence):>12}"
            for s in subjects
        ),
    ]


def _sentences(subject: SubjectReport) -> list[str]:
    if not subject.guessed:
        return []
    lines = [f"  {subject.subject}, guessed"]
    for sentence in subject.guessed:
        lines += _wrapped(f"    {sentence}", " " * 6)
    return lines


def _markdown(subjects: Sequence[SubjectReport]) -> list[str]:
    lines = ["| subject | tagged | inferred | default | confidence |", "|---|---:|---:|---:|---:|"]
    lines += [
        f"| {s.subject} | {_known(s)} | {s.inferred} | {s.default} | {_figure(s.confidence)} |"
        for s in subjects
    ]
    guessed = [f"- {s.subject}: {_escaped(words)}" for s in subjects for words in s.guessed]
    return [*lines, *([""] if guessed else []), *guessed]


def _figure(confidence: float | None) -> str:
    return "none" if confidence is None else f"{confidence:.2f}"


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(
        text, COLUMNS, subsequent_indent=indent, break_on_hyphens=False, drop_whitespace=True
    )


def _shortened(text: str, most: int = COLUMNS) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"


def _escaped(text: str) -> str:
    """Return text that Markdown shows as it is: names come from the map."""
    for mark in "\\`*_[]<>|#":
        text = text.replace(mark, f"\\{mark}")
    return text


def _known(subject: SubjectReport) -> int:
    """Return how many values are told outright: by tags, or by the car's own passes."""
    return subject.tagged + (0 if subject.driven is msgspec.UNSET else subject.driven)
