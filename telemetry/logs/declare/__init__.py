"""Proposing what a table's columns are, proved by how they go together."""

from foretwin.telemetry.logs.declare.proposal import ANSWERS, Proposal, propose

__all__ = ["ANSWERS", "Proposal", "propose"]
