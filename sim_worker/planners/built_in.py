"""The classes of foretwin's own planners, by the names that the registry knows them by."""

from __future__ import annotations

from foretwin.sim_worker.planner_interface import Planner
from foretwin.sim_worker.planners.as_planned import AsPlanned
from foretwin.sim_worker.planners.constant_speed import ConstantSpeed
from foretwin.sim_worker.planners.frenet_lattice import FrenetLattice
from foretwin.sim_worker.planners.gap_acceptance import GapAcceptance
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.remote import RemotePlanner
from foretwin.sim_worker.planners.reverse_pursuit import ReversePursuit

BUILT_IN: dict[str, type[Planner]] = {
    "pure_pursuit_idm": PurePursuitIdm,
    "constant_speed": ConstantSpeed,
    "gap_acceptance": GapAcceptance,
    "frenet_lattice": FrenetLattice,
    "as_planned": AsPlanned,
    "reverse_pursuit": ReversePursuit,
    "remote": RemotePlanner,
}
