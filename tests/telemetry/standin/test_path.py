from __future__ import annotations

import numpy as np

from foretwin.geometry.polyline import interpolated
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from tests.telemetry.standin_drive import wished_path

PATH = DrivenPath(*wished_path(), driver=read_parameters().driver)


def test_what_lies_between_two_points_is_numpys_to_the_last_bit() -> None:
    beyond = [-1.0, PATH.length_m + 1.0]
    for s_m in [*np.linspace(0.0, PATH.length_m, 1000), *PATH.s_m[:50], PATH.length_m, *beyond]:
        x, y = interpolated(s_m, PATH.s_m, PATH.xy_m)
        yaw, curvature, speed = (
            np.interp(s_m, PATH.s_m, known)
            for known in (PATH.yaw_rad, PATH.curvature_pm, PATH.speed_mps)
        )
        assert np.array(PATH.at(s_m)).tobytes() == np.array([x, y, yaw, curvature]).tobytes()
        assert np.array(PATH.speed_at(s_m)).tobytes() == speed.tobytes()


def test_a_car_is_found_where_many_points_would_be() -> None:
    rng = np.random.default_rng(3)
    for s_m in rng.uniform(5.0, PATH.length_m - 5.0, 200):
        here = PATH.at(s_m)
        x, y = np.array([here.x_m, here.y_m]) + rng.normal(0.0, 0.3, 2)
        piece = PATH.piece(s_m - 3.0, s_m + 3.0)
        assert piece is not None
        (expected,) = piece.locate(np.array([[x, y]])).s_m
        assert PATH.locate(x, y, near_s_m=s_m) == expected
