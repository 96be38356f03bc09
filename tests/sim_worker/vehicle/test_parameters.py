from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.sim_worker.vehicle.parameters import (
    DEFAULT_FILE,
    bundled_vehicles,
    load_vehicle,
    understeer_gradient,
)
from foretwin.sim_worker.vehicle.plausible import PLAUSIBLE, check_plausible

COVERS = ("foretwin.sim_worker.vehicle.plausible",)


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
        (
            "[mass_kg]\nvalue = 1093.2952334674046",
            "[mass_kg]\nvalue = -3.0",
            "mass_kg -3 is implausible; it must be 150 to 60000",
        ),
        ("[mass_kg]\nvalue = 1093.2952334674046", '[mass_kg]\nvalue = "x"', "mass_kg"),
        ("[friction]\nvalue = 1.0489", "[friction]\nvalue = nan", "friction nan is implausible"),
        ("[length_m]", "[lenght_m]", "lenght_m"),
        ("[wheelbase_m]\nvalue = 2.5789128", "[wheelbase_m]\nvalue = 1.0", "less than"),
        (
            "[wheelbase_m]\nvalue = 2.5789128",
            "[wheelbase_m]\nvalue = 257.0",
            "wheelbase_m 257 is implausible; it must be 0.8 to 12",
        ),
        (
            "[mass_kg]\nvalue = 1093.2952334674046\nstd = ",
            "[mass_kg]\nvalue = 1093.2952334674046\nstd = -",
            "it must be zero or more, and finite",
        ),
        ("[steering_delay_s]\nvalue = 0.1", "[steering_delay_s]\nvalue = 0.9", "delay"),
        ('name = "bmw_320i"', "name = ", "not TOML"),
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


def test_every_parameter_has_its_range() -> None:
    assert set(PLAUSIBLE) == set(load_vehicle().__struct_fields__) - {"name"}


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.toml"):
        load_vehicle(tmp_path / "nowhere.toml")


def test_five_classes_of_vehicles_and_two_small_cars_come_along() -> None:
    assert set(bundled_vehicles()) == {
        "ford_escort", "bmw_320i", "vw_vanagon", "lorry_12t", "city_bus",
        "f1tenth", "autodrive_nigel",
    }  # fmt: skip


@pytest.mark.parametrize("name", bundled_vehicles())
def test_a_bundled_vehicle_is_found_by_its_name_and_is_plausible(name: str) -> None:
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert all(
        getattr(vehicle, field).source != "default"
        for field in vehicle.__struct_fields__
        if field != "name"
    )
    assert vehicle.wheelbase_m.value + vehicle.rear_overhang_m.value < vehicle.length_m.value
    # No vehicle that one may buy oversteers: the limit of neutral is that of the given digits.
    assert understeer_gradient(vehicle) > -1e-6
    box = vehicle.mass_kg.value * (vehicle.length_m.value**2 + vehicle.width_m.value**2) / 12.0
    # An F1TENTH car has its weight in the middle, where its battery lies.
    least = 0.3 if name == "f1tenth" else 0.6
    assert least * box < vehicle.yaw_inertia_kgm2.value < 1.05 * box


@pytest.mark.parametrize(("name", "number"), [("ford_escort", 1), ("vw_vanagon", 3)])
def test_cars_of_commonroad_have_its_numbers(name: str, number: int) -> None:
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    theirs, ours = setup_vehicle_parameters(number), load_vehicle(name)
    assert ours.mass_kg.value == pytest.approx(theirs.m)
    assert ours.wheelbase_m.value == pytest.approx(theirs.a + theirs.b)
    assert ours.cog_from_rear_axle_m.value == pytest.approx(theirs.b)
    assert ours.yaw_inertia_kgm2.value == pytest.approx(theirs.I_z)
    assert ours.cog_height_m.value == pytest.approx(theirs.h_s)


def test_an_unknown_name_is_answered_with_those_there_are() -> None:
    with pytest.raises(FileNotFoundError, match="bmw_320i, city_bus, f1tenth"):
        load_vehicle("trabant")


@pytest.mark.parametrize("name", sorted({*bundled_vehicles()} - {"f1tenth", "autodrive_nigel"}))
def test_bundled_vehicles_are_plausible(name: str) -> None:
    vehicle = load_vehicle(name)
    assert all(check_plausible(key, getattr(vehicle, key).value) > -1.0 for key in PLAUSIBLE)


def test_what_no_vehicle_has_is_refused_with_what_would_be_right() -> None:
    with pytest.raises(ValueError, match=r"mass_kg 20 is implausible; it must be 150 to 60000"):
        check_plausible("mass_kg", 20.0)
