"""CommonRoad's multi-body model, compiled: suspension, load transfer, magic-formula tyres, wheels.

Althoff, Würsching (2020), CommonRoad: Vehicle Models, section 8; the authors' program is
`vehiclemodels.vehicle_dynamics_mb`, which a test holds this against. Here a car carries its own
friction and axle stiffnesses, and forces that are none of the tyres' act on its body.
"""

from __future__ import annotations

import math
from typing import Any

from foretwin.contracts.arrays import Array
from foretwin.geometry.compiled import OUT, REAL, kernel, types

STATES = 29
"""Of one car: x, y, steering, vx, yaw, yaw rate (0 to 5); roll, pitch and their rates (6 to 9);
vy (10), heave; front axle (13 to 17), rear axle (18 to 22); wheels' spin (23 to 26), axles' side
shifts (27, 28)."""
X, Y, STEER, VX, YAW, YAW_RATE, VY, FIRST_WHEEL = 0, 1, 2, 3, 4, 5, 10, 23
LEAST_MPS = 0.1
"""Below it slip has no meaning, and the formulas have no force."""
GRAVITY_MPS2 = 9.81

_BODY_NAMES = (
    "m m_s m_uf m_ur a b I_Phi_s I_y_s I_z I_xz_s K_sf K_sdf K_sr K_sdr T_f T_r K_ras K_tsf K_tsr "
    "K_rad K_zt h_raf h_rar h_s I_uf I_ur I_y_w K_lt R_w T_sb T_se D_f D_r E_f E_r"
)
BODY = _BODY_NAMES.split()
"""Names of the parameters of body and axles, as CommonRoad has them."""
_TYRE_NAMES = (
    "p_cx1 p_dx1 p_dx3 p_ex1 p_kx1 p_hx1 p_vx1 r_bx1 r_bx2 r_cx1 r_ex1 r_hx1 p_cy1 p_dy1 p_dy3 "
    "p_ey1 p_ky1 p_hy1 p_hy3 p_vy1 p_vy3 r_by1 r_by2 r_by3 r_cy1 r_ey1 r_hy1 r_vy1 r_vy3 r_vy4 "
    "r_vy5 r_vy6"
)
TYRE = _TYRE_NAMES.split()
"""Names of the parameters of a tyre."""
BODY_TYPE: Any = types.UniTuple(REAL, len(BODY))
TYRE_TYPE: Any = types.UniTuple(REAL, len(TYRE))
_FORCES = types.UniTuple(REAL, 2)


@kernel(_FORCES, REAL, REAL, REAL, REAL, REAL, REAL, TYRE_TYPE)
def tyre_forces(
    slip: float,
    angle: float,
    camber: float,
    load: float,
    grip: float,
    stiffness: float,
    tyre: tuple[float, ...],
) -> tuple[float, float]:
    """Return a tyre's forces along and across itself; `grip` scales its friction, `stiffness` its
    cornering stiffness."""
    (cx, dx, dx3, ex, kx, hx, vx, bxa, bxa2, cxa, exa, hxa) = tyre[:12]
    (cy, dy, dy3, ey, ky, hy, hy3, vy, vy3) = tyre[12:21]
    (byk, byk2, byk3, cyk, eyk, hyk, vyk, vyk3, vyk4, vyk5, vyk6) = tyre[21:]
    kappa = hx - slip
    most = grip * dx * (1.0 - dx3 * camber**2) * load
    b = load * kx / (cx * most)
    # The shift stands within the sine, as in the authors' program.
    curve = cx * math.atan(b * kappa - ex * (b * kappa - math.atan(b * kappa)))
    pure_x = most * math.sin(curve + load * vx)
    side = 1.0 if camber > 0.0 else -1.0 if camber < 0.0 else 0.0
    alpha = angle + side * (hy + hy3 * abs(camber))
    lift = side * load * (vy + vy3 * abs(camber))
    mu = grip * dy * (1.0 - dy3 * camber**2)
    b = load * ky * stiffness / (cy * mu * load)
    curve = cy * math.atan(b * alpha - ey * (b * alpha - math.atan(b * alpha)))
    pure_y = mu * load * math.sin(curve) + lift
    b = bxa * math.cos(math.atan(bxa2 * slip))
    rest = math.cos(cxa * math.atan(b * hxa - exa * (b * hxa - math.atan(b * hxa))))
    moved = b * (angle + hxa)
    along = pure_x / rest * math.cos(cxa * math.atan(moved - exa * (moved - math.atan(moved))))
    b = byk * math.cos(math.atan(byk2 * (angle - byk3)))
    rest = math.cos(cyk * math.atan(b * hyk - eyk * (b * hyk - math.atan(b * hyk))))
    moved = b * (slip + hyk)
    across = pure_y / rest * math.cos(cyk * math.atan(moved - eyk * (moved - math.atan(moved))))
    shift = mu * load * (vyk + vyk3 * camber) * math.cos(math.atan(vyk4 * angle))
    return along, across + shift * math.sin(vyk5 * math.atan(vyk6 * slip))


@kernel(
    types.void, OUT, REAL, REAL, REAL, REAL, REAL, REAL, REAL, REAL, BODY_TYPE, TYRE_TYPE, OUT
)  # fmt: skip
def slope(
    x: Array,
    rate: float,
    drive_mps2: float,
    brake_mps2: float,
    pull_mps2: float,
    grip: float,
    front_stiffness: float,
    rear_stiffness: float,
    linkage: float,
    body: tuple[float, ...],
    tyre: tuple[float, ...],
    out: Array,
) -> None:
    """Fill `out` (29,) with the time derivative of a state that moves forwards at `LEAST_MPS`.

    `rate` is the steering's, drive and brakes are torques at the wheels as accelerations of the
    whole mass, `pull_mps2` slows the body down; `grip` and the stiffnesses scale the tyres'.
    `linkage` is by what share front wheels are turned as rolling on one circle asks for
    (Ackermann): 0, as in the authors' program, turns both alike.
    """
    (m, m_s, m_uf, m_ur, a, b, i_roll, i_pitch, i_yaw, i_xz, k_sf, k_sdf, k_sr, k_sdr) = body[:14]
    (t_f, t_r, k_ras, k_tsf, k_tsr, k_rad, k_zt, h_raf, h_rar, h_s) = body[14:24]
    (i_uf, i_ur, i_wheel, k_lt, r_w, t_sb, t_se, d_f, d_r, e_f, e_r) = body[24:]
    g = GRAVITY_MPS2
    steer, u, psi, r, v = x[2], x[3], x[4], x[5], x[10]
    roll, pitch_rate, roll_rate = x[6], x[9], x[7]
    cos_r, sin_r = math.cos(roll), math.sin(roll)
    # Its left is where the yaw rate is added: axes as in the authors' program, z down.
    narrower = 0.5 * linkage * t_f / (a + b) * math.tan(steer)
    steer_l = math.atan(math.tan(steer) / (1.0 + narrower))
    steer_r = math.atan(math.tan(steer) / (1.0 - narrower))
    cos_sl, sin_sl, cos_sr, sin_sr = (
        math.cos(steer_l), math.sin(steer_l), math.cos(steer_r), math.sin(steer_r)
    )  # fmt: skip
    low_f, low_r = x[16] + r_w * (math.cos(x[13]) - 1.0), x[21] + r_w * (math.cos(x[18]) - 1.0)
    lean_f, lean_r = 0.5 * t_f * math.sin(x[13]), 0.5 * t_r * math.sin(x[18])
    z_lf, z_rf = (low_f - lean_f) * k_zt, (low_f + lean_f) * k_zt
    z_lr, z_rr = (low_r - lean_r) * k_zt, (low_r + lean_r) * k_zt
    u_lf = max((u + 0.5 * t_f * r) * cos_sl + (v + a * r) * sin_sl, 0.0)
    u_rf = max((u - 0.5 * t_f * r) * cos_sr + (v + a * r) * sin_sr, 0.0)
    u_lr, u_rr = max(u + 0.5 * t_r * r, 0.0), max(u - 0.5 * t_r * r, 0.0)
    side_f, side_r = v + a * r - x[14] * (r_w - x[16]), v - b * r - x[19] * (r_w - x[21])
    angle_lf = math.atan(side_f / (u + 0.5 * t_f * r)) - steer_l
    angle_rf = math.atan(side_f / (u - 0.5 * t_f * r)) - steer_r
    angle_lr = math.atan(side_r / (u + 0.5 * t_r * r))
    angle_rr = math.atan(side_r / (u - 0.5 * t_r * r))
    up_f, up_r = h_s - r_w + x[16] - x[11], h_s - r_w + x[21] - x[11]
    s_lf = up_f / cos_r - h_s + r_w + a * x[8] + 0.5 * (roll - x[13]) * t_f
    s_rf = up_f / cos_r - h_s + r_w + a * x[8] - 0.5 * (roll - x[13]) * t_f
    s_lr = up_r / cos_r - h_s + r_w - b * x[8] + 0.5 * (roll - x[18]) * t_r
    s_rr = up_r / cos_r - h_s + r_w - b * x[8] - 0.5 * (roll - x[18]) * t_r
    ds_lf = x[17] - x[12] + a * pitch_rate + 0.5 * (roll_rate - x[14]) * t_f
    ds_rf = x[17] - x[12] + a * pitch_rate - 0.5 * (roll_rate - x[14]) * t_f
    ds_lr = x[22] - x[12] - b * pitch_rate + 0.5 * (roll_rate - x[19]) * t_r
    ds_rr = x[22] - x[12] - b * pitch_rate - 0.5 * (roll_rate - x[19]) * t_r
    x_lf, y_lf = tyre_forces(
        1.0 - r_w * x[23] / u_lf,
        angle_lf,
        roll + d_f * s_lf + e_f * s_lf**2,
        z_lf,
        grip,
        front_stiffness,
        tyre,
    )
    x_rf, y_rf = tyre_forces(
        1.0 - r_w * x[24] / u_rf,
        angle_rf,
        roll - d_f * s_rf - e_f * s_rf**2,
        z_rf,
        grip,
        front_stiffness,
        tyre,
    )
    x_lr, y_lr = tyre_forces(
        1.0 - r_w * x[25] / u_lr,
        angle_lr,
        roll + d_r * s_lr + e_r * s_lr**2,
        z_lr,
        grip,
        rear_stiffness,
        tyre,
    )
    x_rr, y_rr = tyre_forces(
        1.0 - r_w * x[26] / u_rr,
        angle_rr,
        roll - d_r * s_rr - e_r * s_rr**2,
        z_rr,
        grip,
        rear_stiffness,
        tyre,
    )
    bent_f, bent_r = roll - x[13], roll - x[18]
    arm_f, arm_r = h_raf - r_w, h_rar - r_w
    dy_f, dy_r = v + a * r - x[15], v - b * r - x[20]
    give_f = up_f * sin_r - x[27] * cos_r - arm_f * math.sin(bent_f)
    give_r = up_r * sin_r - x[28] * cos_r - arm_r * math.sin(bent_r)
    dgive_f = (up_f * cos_r + x[27] * sin_r) * roll_rate + (x[17] - x[12]) * sin_r
    dgive_f -= dy_f * cos_r + arm_f * math.cos(bent_f) * (roll_rate - x[14])
    dgive_r = (up_r * cos_r + x[28] * sin_r) * roll_rate + (x[22] - x[12]) * sin_r
    dgive_r -= dy_r * cos_r + arm_r * math.cos(bent_r) * (roll_rate - x[19])
    pin_f, pin_r = give_f * k_ras + dgive_f * k_rad, give_r * k_ras + dgive_r * k_rad
    rest_f, rest_r = m_s * g * b / (2.0 * (a + b)), m_s * g * a / (2.0 * (a + b))
    bar_f, bar_r = bent_f * k_tsf / t_f, bent_r * k_tsr / t_r
    f_lf = rest_f - s_lf * k_sf - ds_lf * k_sdf + bar_f
    f_rf = rest_f - s_rf * k_sf - ds_rf * k_sdf - bar_f
    f_lr = rest_r - s_lr * k_sr - ds_lr * k_sdr + bar_r
    f_rr = rest_r - s_rr * k_sr - ds_rr * k_sdr - bar_r
    springs = f_lf + f_rf + f_lr + f_rr
    along_lf, along_rf = x_lf * cos_sl - y_lf * sin_sl, x_rf * cos_sr - y_rf * sin_sr
    rear_y = y_lr + y_rr
    across_f = y_lf * cos_sl + x_lf * sin_sl + y_rf * cos_sr + x_rf * sin_sr
    sum_x = x_lr + x_rr + along_lf + along_rf
    sum_n = across_f * a - rear_y * b + (x_lr - x_rr) * 0.5 * t_r
    sum_n += (along_lf - along_rf) * 0.5 * t_f
    sum_l = 0.5 * t_f * (f_lf - f_rf) + 0.5 * t_r * (f_lr - f_rr)
    sum_l -= pin_f / cos_r * (up_f - arm_f * math.cos(x[13]))
    sum_l -= pin_r / cos_r * (up_r - arm_r * math.cos(x[18]))
    sum_m = a * (f_lf + f_rf) - b * (f_lr + f_rr) + sum_x * (h_s - x[11])
    roll_f = 0.5 * t_f * (f_rf - f_lf) - pin_f * arm_f - across_f * (r_w - x[16])
    half_f, lean = 0.5 * t_f * math.cos(x[13]), r_w * math.sin(x[13])
    roll_f += z_lf * (lean + half_f - k_lt * y_lf) - z_rf * (half_f - lean + k_lt * y_rf)
    roll_r = 0.5 * t_r * (f_rr - f_lr) - pin_r * arm_r - rear_y * (r_w - x[21])
    half_r, lean = 0.5 * t_r * math.cos(x[18]), r_w * math.sin(x[18])
    roll_r += z_lr * (lean + half_r - k_lt * y_lr) - z_rr * (half_r - lean + k_lt * y_rr)
    heave_f = z_lf + z_rf + pin_f * sin_r - (f_lf + f_rf) * cos_r
    heave_r = z_lr + z_rr + pin_r * sin_r - (f_lr + f_rr) * cos_r
    shift_f = across_f - pin_f * cos_r - (f_lf + f_rf) * sin_r
    shift_r = rear_y - pin_r * cos_r - (f_lr + f_rr) * sin_r
    out[0] = u * math.cos(psi) - v * math.sin(psi)
    out[1] = u * math.sin(psi) + v * math.cos(psi)
    out[2], out[3] = rate, sum_x / m + r * v - pull_mps2
    out[4], out[5] = r, (sum_n + i_xz / i_roll * sum_l) / (i_yaw - i_xz**2 / i_roll)
    out[6], out[7] = roll_rate, (i_xz / i_yaw * sum_n + sum_l) / (i_roll - i_xz**2 / i_yaw)
    out[8], out[9] = pitch_rate, sum_m / i_pitch
    out[10] = ((pin_f + pin_r) * cos_r + springs * sin_r) / m_s - r * u
    out[11], out[12] = x[12], g - (springs * cos_r - (pin_f + pin_r) * sin_r) / m_s
    out[13], out[14], out[15] = x[14], roll_f / i_uf, shift_f / m_uf - r * u
    out[16], out[17] = x[17], g - heave_f / m_uf
    out[18], out[19], out[20] = x[19], roll_r / i_ur, shift_r / m_ur - r * u
    out[21], out[22] = x[22], g - heave_r / m_ur
    brakes, engine = -m * r_w * brake_mps2, m * r_w * drive_mps2
    front = 0.5 * (t_sb * brakes + t_se * engine)
    rear = 0.5 * ((1.0 - t_sb) * brakes + (1.0 - t_se) * engine)
    out[23], out[24] = (front - r_w * x_lf) / i_wheel, (front - r_w * x_rf) / i_wheel
    out[25], out[26] = (rear - r_w * x_lr) / i_wheel, (rear - r_w * x_rr) / i_wheel
    for wheel in range(23, 27):
        if x[wheel] < 0.0:  # a locked wheel does not turn back
            x[wheel] = out[wheel] = 0.0
    out[27], out[28] = dy_f, dy_r
