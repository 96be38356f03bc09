"""From the folders of runs or sweeps to the file of their report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.partial_file import partial_file
from foretwin.orchestrator.report.blocks import Report
from foretwin.orchestrator.report.gap_rows import HumanRow
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.orchestrator.report.page import html_of
from foretwin.orchestrator.report.redaction import PlaceNames, Redaction, names_of, redacted
from foretwin.orchestrator.report.run_report import run_report

RUN, SWEEP = "run.json", "sweep.json"
_REDACTED_NAME = "RUN"


def write_report(
    folders: Sequence[Path],
    out: Path,
    *,
    people: Sequence[HumanRow] = (),
    redaction: Redaction | None = None,
) -> Report:
    """Write the report of a run; returns what it says.

    Raises UserError in one line for a folder that holds no run, or one that goes on, and OSError
    where the file cannot be written.
    """
    report = report_of_folders(folders, people=people, redaction=redaction)
    with partial_file(out) as partial:
        partial.write_text(html_of(report), encoding="utf-8")
    return report


def report_of_folders(
    folders: Sequence[Path],
    *,
    people: Sequence[HumanRow] = (),
    redaction: Redaction | None = None,
) -> Report:
    """Return the report of a run; see `write_report`."""
    for folder in folders:
        if not (folder / RUN).is_file():
            raise UserError(f"{folder}: no run of a drive: no {RUN} in it")
    if len(folders) != 1:
        raise UserError(f"a report is of one run, not of {len(folders)}")
    run = RunMaterial(folders[0], called=_REDACTED_NAME if redaction else "")
    report = run_report(
        run, people=people, pictures=redaction != "places", places=redaction is None
    )
    if redaction is None:
        return report
    return redacted(report, PlaceNames(names_of(run.record, run.worlds())))
