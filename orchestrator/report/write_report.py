"""From the folders of runs or sweeps to the file of their report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.partial_file import partial_file
from foretwin.orchestrator.progress import Progress, untold
from foretwin.orchestrator.record.run_folder import SUMMARY
from foretwin.orchestrator.report.blocks import Report
from foretwin.orchestrator.report.gap_rows import HumanRow
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.orchestrator.report.page import html_of
from foretwin.orchestrator.report.redaction import PlaceNames, Redaction, names_of, redacted
from foretwin.orchestrator.report.run_report import run_report
from foretwin.orchestrator.report.several_runs import several_runs_report
from foretwin.orchestrator.report.sweep_material import SweepMaterial
from foretwin.orchestrator.report.sweep_report import sweep_report

RUN = "run.json"
_REDACTED_NAME = "RUN"


def write_report(
    folders: Sequence[Path],
    out: Path,
    *,
    people: Sequence[HumanRow] = (),
    redaction: Redaction | None = None,
    progress: Progress = untold,
) -> Report:
    """Write the report of a run, of a sweep, or of several runs; returns what it says.

    Raises UserError in one line for a folder that holds no run, or one that goes on, and OSError
    where the file cannot be written.
    """
    report = report_of_folders(folders, people=people, redaction=redaction, progress=progress)
    with partial_file(out) as partial:
        partial.write_text(html_of(report), encoding="utf-8")
    return report


def report_of_folders(
    folders: Sequence[Path],
    *,
    people: Sequence[HumanRow] = (),
    redaction: Redaction | None = None,
    progress: Progress = untold,
) -> Report:
    """Return the report of a run, of a sweep, or of several runs; see `write_report`."""
    look = {"pictures": redaction != "places", "places": redaction is None}
    sweeps = [folder for folder in folders if (folder / SUMMARY).is_file()]
    if sweeps:
        if len(folders) != 1:
            raise UserError(
                "a report is of one sweep, or of runs: not of sweeps and others together"
            )
        sweep = SweepMaterial(folders[0], called="SWEEP" if redaction else "")
        report = sweep_report(sweep, **look, progress=progress)
        records, worlds = [sweep.record], sweep.worlds()
    else:
        runs = [_run(folder, redaction) for folder in folders]
        report = (
            run_report(runs[0], people=people, **look, progress=progress)
            if len(runs) == 1
            else several_runs_report(runs, **look, progress=progress)
        )
        records = [run.record for run in runs]
        worlds = [world for run in runs for world in run.worlds()]
    if redaction is None:
        return report
    names = set().union(*(names_of(record, ()) for record in records), names_of({}, worlds))
    return redacted(report, PlaceNames(names))


def _run(folder: Path, redaction: Redaction | None) -> RunMaterial:
    if not (folder / RUN).is_file():
        raise UserError(f"{folder}: neither a run nor a sweep: no {RUN} and no {SUMMARY} in it")
    return RunMaterial(folder, called=_REDACTED_NAME if redaction else "")
