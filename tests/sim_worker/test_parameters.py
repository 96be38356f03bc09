from __future__ import annotations

from pathlib import Path

import pytest

from sim_worker.vehicle.parameters import DEFAULT_FILE, load_vehicle, understeer_gradient


def test_bundled_vehicle_is_commonroads_vehicle_2() -> None:
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

    theirs, ours = parameters_vehicle2(), load_vehicle()
    assert ours.mass_kg.value == pytest.approx(theirs.m)
    assert ours.wheelbase_m.value == pytest.approx(theirs.a + theirs.b)
    assert ours.cog_from_rear_axle_m.value == pytest.approx(theirs.b)
    assert ours.yaw_inertia_kgm2.value == pytest.approx(theirs.I_z)
    stiffness = -theirs.tire.p_ky1 * theirs.m * 9.81 * theirs.b / (theirs.a + theirs.b)
    assert ours.front_cornering_stiffness_npr.value == pytest.approx(stiffness, rel=1e-3)
    assert understeer_gradient(ours) == pytest.approx(0.0, abs=1e-5)


def test_every_value_says_where_it_came_from() -> None:
    vehicle = load_vehicle()
    assert all(
        getattr(vehicle, name).source != "default"
        for name in vehicle.__struct_fields__
        if name != "name"
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[mass_kg]\nvalue = 1093.2952334674046", "[mass_kg]\nvalue = -3.0", "mass_kg is -3.0"),
        ("[mass_kg]\nvalue = 1093.2952334674046", '[mass_kg]\nvalue = "x"', "mass_kg"),
        ("[friction]\nvalue = 1.0489", "[friction]\nvalue = nan", "friction is nan"),
        ("[length_m]", "[lenght_m]", "lenght_m"),
        ("[wheelbase_m]\nvalue = 2.5789128", "[wheelbase_m]\nvalue = 1.0", "less than"),
        ("[steering_delay_s]\nvalue = 0.1", "[steering_delay_s]\nvalue = 0.9", "delay"),
        ('name = "bmw_320i"', "name = ", "no TOML"),
    ],
)
def test_wrong_file_is_refused_in_one_line_that_names_file_and_field(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    text = DEFAULT_FILE.read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "car.toml"
    file.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=r"car\.toml") as caught:
        load_vehicle(file)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.toml"):
        load_vehicle(tmp_path / "nowhere.toml")
