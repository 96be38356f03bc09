"""Campaigns for tests: all roles, and certificates that are old or not yet of use."""

from __future__ import annotations

import datetime
from pathlib import Path

from foretwin.contracts.campaign import CAMPAIGN_ROLES, CampaignRole, TlsFiles, role_files
from foretwin.contracts.certificates import UTC
from foretwin.orchestrator.campaign.issuing import issue, make_authority


def now() -> datetime.datetime:
    return datetime.datetime.now(UTC)


def campaign(folder: Path, *, age_days: float = 0.0) -> Path:
    """Make a campaign with all roles, begun some days ago."""
    begun = now() - datetime.timedelta(days=age_days)
    make_authority(folder, name=f"test {folder.name}", days=30, now=begun)
    for role in CAMPAIGN_ROLES:
        issue(folder, role, days=20, now=begun)
    return folder


def expired(folder: Path, role: CampaignRole) -> TlsFiles:
    """Make a role's certificate anew, one that ended an hour ago, and return its files."""
    issue(folder, role, days=1, now=now() - datetime.timedelta(days=1, hours=1))
    return role_files(folder, role)
