"""The command `secure`: the certificates of a campaign, made, renewed and shown."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path

from foretwin.contracts.campaign import (
    AUTHORITY,
    CAMPAIGN_ROLES,
    CERTIFICATE,
    NAMED_WORKER,
    certificate_in,
    named_workers,
    worker_name,
)
from foretwin.contracts.certificates import UTC, read_certificate, time_trouble, troubles
from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import say
from foretwin.orchestrator.campaign.issuing import (
    check_days,
    host_name,
    issue,
    make_authority,
)
from foretwin.orchestrator.campaign.joining import LOCAL_ROLES
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.drive.exit_words import EXIT_DONE, EXIT_PARTLY


def begin(folder: Path, *, hosts: Sequence[str], days: int, role_days: int) -> CommandResult:
    """Make a campaign with what a drive itself needs."""
    now = datetime.datetime.now(UTC)
    check_days(role_days)
    for host in hosts:  # what is made is not made again
        host_name(host)
    name = f"foretwin {folder.resolve().name}"
    make_authority(folder, name=name, days=days, now=now)
    for role in LOCAL_ROLES:
        issue(folder, role, days=role_days, now=now, hosts=hosts if role == "router" else ())
    return CommandResult(
        {"campaign": folder, "roles": LOCAL_ROLES, "until": _last(folder / AUTHORITY)},
        f"campaign {folder}: {', '.join(LOCAL_ROLES)}; ends {_day(folder / AUTHORITY)}\n"
        f"others join with foretwin secure add ROLE --folder {folder}: car, planner, operator",
    )


def add(folder: Path, role: str, *, hosts: Sequence[str], days: int) -> CommandResult:
    """Make or renew the certificate of one role."""
    if role not in CAMPAIGN_ROLES and worker_name(role) is None:
        known = ", ".join((*CAMPAIGN_ROLES, NAMED_WORKER))
        raise UserError(f"role {role!r}: one of {known} (NAME of small letters and digits)")
    place = issue(folder, role, days=days, now=datetime.datetime.now(UTC), hosts=hosts)
    return CommandResult(
        {"folder": place, "role": role, "until": _last(place / CERTIFICATE)},
        f"{place}: {role}, until {_day(place / CERTIFICATE)}; copy the folder to its host",
    )


def show(folder: Path) -> CommandResult:
    """Tell of each certificate for how long it holds; 3 where one is of no use."""
    now = datetime.datetime.now(UTC)
    authority = folder / AUTHORITY
    if not authority.is_file():
        raise UserError(f"{authority}: missing; foretwin secure init --folder {folder} makes it")
    faults = [time_trouble(read_certificate(authority), str(authority), now=now)]
    lines, rows = [f"campaign {folder}: until {_day(authority)}"], []
    for role in (*CAMPAIGN_ROLES, *named_workers(folder)):
        if not (folder / role).is_dir():
            continue
        files = certificate_in(folder / role)
        certificate = read_certificate(Path(files.certificate))
        for_hosts = f", for {', '.join(certificate.hosts)}" if certificate.hosts else ""
        lines.append(f"{role}: until {certificate.last:%Y-%m-%d %H:%M} UTC{for_hosts}")
        rows.append({"role": role, "until": certificate.last, "hosts": certificate.hosts})
        faults.extend(troubles(files, now=now))
    wrong = list(dict.fromkeys(fault for fault in faults if fault))
    body = {"campaign": folder, "until": _last(authority), "roles": rows, "troubles": wrong}

    def words() -> None:
        say("\n".join(lines))
        for line in wrong:
            say(line, error=True)

    return CommandResult(body, words, EXIT_PARTLY if wrong else EXIT_DONE)


def _last(file: Path) -> datetime.datetime:
    return read_certificate(file).last


def _day(file: Path) -> str:
    return f"{_last(file):%Y-%m-%d %H:%M} UTC"
