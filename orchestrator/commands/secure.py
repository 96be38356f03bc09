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
from foretwin.orchestrator.campaign.issuing import check_days, issue, make_authority
from foretwin.orchestrator.campaign.joining import LOCAL_ROLES
from foretwin.orchestrator.drive.exit_words import EXIT_DONE, EXIT_PARTLY


def begin(folder: Path, *, hosts: Sequence[str], days: int, role_days: int) -> int:
    """Make a campaign with what a drive itself needs."""
    now = datetime.datetime.now(UTC)
    check_days(role_days)
    name = f"foretwin {folder.resolve().name}"
    make_authority(folder, name=name, days=days, now=now)
    for role in LOCAL_ROLES:
        issue(folder, role, days=role_days, now=now, hosts=hosts if role == "router" else ())
    say(f"campaign {folder}: {', '.join(LOCAL_ROLES)}; ends {_day(folder / AUTHORITY)}")
    say(f"others join with foretwin secure add ROLE --folder {folder}: car, planner, operator")
    return EXIT_DONE


def add(folder: Path, role: str, *, hosts: Sequence[str], days: int) -> int:
    """Make or renew the certificate of one role."""
    if role not in CAMPAIGN_ROLES and worker_name(role) is None:
        known = ", ".join((*CAMPAIGN_ROLES, NAMED_WORKER))
        raise UserError(f"role {role!r}: one of {known} (NAME of small letters and digits)")
    place = issue(folder, role, days=days, now=datetime.datetime.now(UTC), hosts=hosts)
    say(f"{place}: {role}, until {_day(place / CERTIFICATE)}; copy the folder to its host")
    return EXIT_DONE


def show(folder: Path) -> int:
    """Say of each certificate for how long it holds; 3 where one is of no use."""
    now = datetime.datetime.now(UTC)
    authority = folder / AUTHORITY
    if not authority.is_file():
        raise UserError(f"{authority}: missing; foretwin secure init --folder {folder} makes it")
    faults = [time_trouble(read_certificate(authority), str(authority), now=now)]
    say(f"campaign {folder}: until {_day(authority)}")
    for role in (*CAMPAIGN_ROLES, *named_workers(folder)):
        if not (folder / role).is_dir():
            continue
        files = certificate_in(folder / role)
        certificate = read_certificate(Path(files.certificate))
        for_hosts = f", for {', '.join(certificate.hosts)}" if certificate.hosts else ""
        say(f"{role}: until {certificate.last:%Y-%m-%d %H:%M} UTC{for_hosts}")
        faults.extend(troubles(files, now=now))
    for line in dict.fromkeys(fault for fault in faults if fault):
        say(line, error=True)
    return EXIT_PARTLY if any(faults) else EXIT_DONE


def _day(file: Path) -> str:
    return f"{read_certificate(file).last:%Y-%m-%d %H:%M} UTC"
