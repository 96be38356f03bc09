"""Planners of another package: well-behaved ones, and ones that do what their name says."""

from __future__ import annotations

CODE = """
import os, time
import numpy as np
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm

class Steady(PurePursuitIdm):
    pass

class Counting:
    def begin(self, count):
        return Counted(count)

class Counted:
    def __init__(self, count):
        self.count, self.asked, self.remarks = count, 0, {}
    def plan(self, view):
        self.asked += 1
        self.remarks[0] = f"asked {self.asked} times for {self.count} cars"
        return np.full(len(view.arc_m), float(self.asked)), np.zeros(len(view.arc_m))

class One:
    def plan_one(self, view):
        if view.arc_m > 15.0:
            raise KeyError("no lane here")
        ahead = min((user.arc_m for user in view.users), default=0.0)
        return view.target_speed_mps - view.vx_mps, ahead / 1000.0

class Blocks(Steady):
    def plan(self, view):
        if view.time_s >= 0.5:
            time.sleep(600.0)
        return super().plan(view)

class Exits(Steady):
    def plan(self, view):
        if view.time_s >= 0.5:
            os._exit(7)
        return super().plan(view)

class Crashes(Steady):
    def plan(self, view):
        if view.time_s >= 0.5:
            os.abort()
        return super().plan(view)

class Raises(Steady):
    def plan(self, view):
        if view.time_s >= 0.5:
            raise RuntimeError("lost\\nmy way")
        return super().plan(view)

class NoNumber(Steady):
    def plan(self, view):
        answer = super().plan(view)
        if view.time_s >= 0.5:
            answer.accel_mps2[0] = np.nan
        return answer

class Scalar:
    def plan(self, view):
        return 1.0, 0.0

class Late(Steady):
    def plan(self, view):
        if view.time_s == 0.0:
            time.sleep(1.1)
        return super().plan(view)

class Nothing:
    def plan(self, view):
        return None

class OneNothing:
    def plan_one(self, view):
        return None

class BeginsNothing:
    def begin(self, count):
        return count

class NoPlanner:
    pass

class FailsToLoad:
    def __init__(self):
        raise OSError("no weights")
"""

NAMES = {
    "steady": "Steady", "counting": "Counting", "one": "One", "blocks": "Blocks",
    "exits": "Exits", "crashes": "Crashes", "raises": "Raises", "no_number": "NoNumber",
    "late": "Late", "nothing": "Nothing", "one_nothing": "OneNothing",
    "begins_nothing": "BeginsNothing", "scalar": "Scalar", "no_planner": "NoPlanner",
    "fails_to_load": "FailsToLoad",
}  # fmt: skip
