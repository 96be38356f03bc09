"""Who is on the road in each future of a job, as arrays for `Traffic`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.drive import RoadUserKind
from foretwin.contracts.futures import RecordedRoadUser
from foretwin.contracts.scenario import Conduct
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.road_users.crowd import Crowd
from foretwin.sim_worker.road_users.manners import SPREADS, Spreads, key_of, manners
from foretwin.sim_worker.road_users.paces import Paces, briskness
from foretwin.sim_worker.road_users.replay import Replay
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

KIND_NAMES: tuple[RoadUserKind, ...] = tuple(KINDS)


class Player(NamedTuple):
    """One road user of one future; arc lengths are those of its box centre on its own path.

    `speed_mps` is what it drives where no bend asks for less, of the law-abiding the one to begin
    with. `size_m` is length and width where measured, else that of its kind. Who stops does so
    `acts_after_s` after the start; `hidden_by` names another actor of the future; `known` is who
    the real car perceives, whatever the map says.
    """

    name: str
    kind: RoadUserKind
    path: FrenetPath
    start_arc_m: float
    speed_mps: float
    conduct: Conduct = "heedless"
    desired_mps: float | None = None
    lateral_m: float = 0.0
    acts_after_s: float = np.inf
    decel_mps2: float = 4.0
    hidden_by: str = ""
    known: bool = False
    size_m: tuple[float, float] | None = None


class RoadUserArrays(NamedTuple):
    """The crowd of a job, and the paths that it moves on.

    `paths` are all that are driven on, the ego's first; `paces` how those get on along them who
    react to nobody; `replay` has where those are who come first in every future, if they were
    recorded.
    """

    crowd: Crowd
    paths: tuple[FrenetPath, ...]
    paces: Paces
    replay: Replay | None = None


def casting(
    casts: Sequence[Sequence[Player]],
    *,
    ego_path: FrenetPath,
    replayed: Sequence[RecordedRoadUser] = (),
    keys: Sequence[int] | None = None,
    spreads: Spreads = SPREADS,
) -> RoadUserArrays:
    """Lay the road users of S futures out as arrays; places without one are not present.

    Those `replayed` come first in each; their `path_of` counts on after the paths. `keys` (S,) name
    the futures: by them and by their own names the law-abiding have their manners, drawn from
    `spreads`.
    """
    first = len(replayed)
    shape = (len(casts), first + max(map(len, casts), default=0))
    # Futures have many road users in common: each is looked at once.
    known: dict[int, int] = {}
    players: list[Player] = []
    which, hidden = np.zeros(shape, np.intp), np.full(shape, -1, np.intp)
    for s, cast in enumerate(casts):
        for player in cast:
            if id(player) not in known:
                players.append(player)
                known[id(player)] = len(players)
        which[s, first : first + len(cast)] = [known[id(player)] for player in cast]
        for r, player in enumerate(cast, start=first):
            if player.hidden_by:
                hidden[s, r] = first + [other.name for other in cast].index(player.hidden_by)
    paths = {id(ego_path): ego_path}
    for player in players:
        paths.setdefault(id(player.path), player.path)
    places = {path: place for place, path in enumerate(paths)}
    # Who drives alike on one path has one pace.
    paced: dict[tuple[int, float, float], int] = {}
    pace_of = {
        id(p): paced.setdefault(
            (places[id(p.path)], p.speed_mps, briskness(p.conduct, p.decel_mps2)), len(paced)
        )
        for p in players
        if p.speed_mps > 0.0 and p.conduct not in ("law_abiding", "parked")
    }
    rows = [
        _ABSENT,
        *(_player_row(p, places[id(p.path)], pace_of.get(id(p), _NO_PACE)) for p in players),
    ]
    which[:, :first] = len(rows) + np.arange(first)
    rows += [_row(user.kind, user.size_m, len(paths) + k) for k, user in enumerate(replayed)]
    columns = np.moveaxis(np.array(rows)[which], -1, 0).copy()
    present, lawful, walks, known_already = columns[:4] > 0.0
    path_of, kinds, pace, user_key = columns[4:8].astype(np.intp)
    length, width, lateral, arc, speed, wants, limit, accel, decel, at, by = columns[8:]
    own = manners(range(len(casts)) if keys is None else keys, user_key, spreads)
    by_limit = np.where(np.isfinite(limit), np.maximum(speed, own.limit_share * limit), speed)
    crowd = Crowd(
        present=present,
        lawful=lawful,
        length_m=length,
        width_m=width,
        path_of=path_of,
        pace_of=pace,
        lateral_m=lateral,
        start_arc_m=arc,
        start_speed_mps=speed,
        desired_mps=np.where(np.isnan(wants), by_limit, wants),
        accel_mps2=own.accel_mps2 * accel,
        decel_mps2=own.decel_mps2 * decel,
        time_gap_s=own.time_gap_s,
        briskness=own.lateral_mps2 / driver.LATERAL_ACCEL_MPS2 * np.minimum(accel, 1.0),
        reaction_s=own.reaction_s,
        lag_s=own.lag_s,
        brakes_at_s=at,
        brakes_by_mps2=by,
        walks=walks,
        kinds=kinds,
        known=known_already,
        hidden_by=hidden,
    )
    motions = np.array(list(paced)).reshape(-1, 3).T
    paces = Paces(tuple(paths.values()), motions[0].astype(np.intp), motions[1], motions[2])
    replay = Replay(replayed) if replayed else None
    return RoadUserArrays(crowd, tuple(paths.values()), paces, replay)


_Row = tuple[float, ...]
"""Of one player: 1 where present, lawful, walking, known; places of path, kind and pace; its key;
length, width, offset, place, speed; the speed that it wants, if given, and the limit; acceleration
and deceleration as shares of a car's; when it brakes, and how."""
_NO_PACE = -1
_STILL: _Row = (0.0, 0.0, 0.0, 0.0, np.inf, 1.0, 1.0, np.inf, 1.0)
_ABSENT: _Row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, _NO_PACE, 0.0, 1.0, 1.0, *_STILL)


def _row(
    kind: RoadUserKind,
    size_m: tuple[float, float] | None,
    path: int,
    *,
    lawful: bool = False,
    known: bool = True,
    pace: int = _NO_PACE,
    key: int = 0,
    motion: _Row = _STILL,
) -> _Row:
    traits = KINDS[kind]
    size = size_m or (traits.length_m, traits.width_m)
    kind_place = KIND_NAMES.index(kind)
    flags = (1.0, lawful, not traits.keeps_lane, known)
    return (*flags, path, kind_place, pace, key, *size, *motion)


def _player_row(player: Player, path: int, pace: int) -> _Row:
    traits, car, on = KINDS[player.kind], KINDS["car"], player.path
    limit_mps = float(on.speed_limit_mps[on.place(np.array([player.start_arc_m])).node[0]])
    motion = (
        player.lateral_m,
        player.start_arc_m,
        0.0 if player.conduct == "parked" else player.speed_mps,
        np.nan if player.desired_mps is None else player.desired_mps,
        traits.limit_mps(limit_mps),
        traits.accel_mps2 / car.accel_mps2,
        traits.decel_mps2 / car.decel_mps2,
        player.acts_after_s if player.conduct == "stops" else np.inf,
        player.decel_mps2,
    )
    return _row(
        player.kind,
        player.size_m,
        path,
        lawful=player.conduct == "law_abiding",
        known=player.known,
        pace=pace,
        key=key_of(player.name),
        motion=motion,
    )
