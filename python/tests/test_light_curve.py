"""Tests the example of the light curve: compares its theory with a sum over the surface, and its measurement with both,
and runs its program."""

from __future__ import annotations

import csv
import importlib.util
from pathlib import Path

import light_curve
import numpy as np
import numpy.typing as npt
import pytest
from conftest import Daemon
from light_curve import Asteroid, aim, measured_lx, prepared, theory_lx, turn_of

import steradian


def summed_lx(asteroid: Asteroid, to_eye: npt.NDArray[np.float64], distance_m: float, turn_rad: float) -> float:
    """Returns the light of an asteroid, lx, summed over the elements of its surface."""
    z, longitude = np.meshgrid(np.linspace(-1, 1, 2001)[1:] - 5e-4, np.linspace(0, 2 * np.pi, 2001)[1:])
    sphere = np.stack([np.sqrt(1 - z**2) * np.cos(longitude), np.sqrt(1 - z**2) * np.sin(longitude), z], axis=-1)
    radii = np.array(asteroid.radii_m)
    # Normals of the surface, scaled by the area of its elements.
    areas = sphere / radii * np.prod(radii) * 4 * np.pi / z.size
    back = steradian.quaternion([0, 0, 1], -turn_rad)
    to_sun = np.array([-1.0, 0.0, 0.0])
    cos_i, cos_e = (np.clip(areas @ steradian.rotate(back, direction), 0, None) for direction in (to_sun, to_eye))
    either = np.where((cos_i > 0) & (cos_e > 0), cos_i + cos_e, 1.0)
    luminance = 2 * asteroid.albedo * asteroid.illuminance_lx() / np.pi
    return float(np.sum(luminance * cos_i * cos_e / either) / distance_m**2)


@pytest.mark.parametrize("phase_rad", [0.0, 0.7, 2.0])
def test_the_closed_form_is_the_sum_over_the_surface(phase_rad: float) -> None:
    asteroid = Asteroid()
    to_eye = np.array([-np.cos(phase_rad), -np.sin(phase_rad), 0.0])
    times = turn_of(asteroid, 5)
    for time, light in zip(times, theory_lx(asteroid, to_eye, 1e6, times)):
        turn_rad = 2 * np.pi * ((time - light_curve.J2000).total_seconds() / asteroid.period_s % 1)
        assert light == pytest.approx(summed_lx(asteroid, to_eye, 1e6, turn_rad), rel=2e-3)
    sphere = Asteroid(radii_m=(5e3, 5e3, 5e3))
    full = theory_lx(sphere, np.array([-1.0, 0.0, 0.0]), 1e6, times[:1])
    assert full[0] == pytest.approx(sphere.albedo * sphere.illuminance_lx() * (5e3 / 1e6) ** 2, rel=1e-12)
    with pytest.raises(ValueError, match="lambert"):
        theory_lx(Asteroid(law="lambert"), to_eye, 1e6, times)


@pytest.mark.parametrize("view, phase_deg", [("flat", 0.0), ("flat", 100.0), ("dome", 40.0)])
def test_the_light_in_the_pictures_matches_theory(client: steradian.Client, view: str, phase_deg: float) -> None:
    before = client.scene()
    curve = light_curve.light_curve(client, view, Asteroid(), np.radians(phase_deg), 12)
    # The error of theory is 0.2 % times a factor of order 1.
    assert curve.largest_error() < 4e-3
    assert curve.measured_lx.max() > 1.3 * curve.measured_lx.min()
    # The comparison must fail with the theory for another body.
    other = theory_lx(Asteroid(radii_m=(9e3, 9e3, 6e3)), np.array([-1.0, 0.0, 0.0]), 1e6, curve.times)
    assert np.max(np.abs(curve.measured_lx / other - 1)) > 0.1
    after = client.scene()
    assert (after.bodies, after.time, after.magnitude_limit) == (before.bodies, before.time, before.magnitude_limit)
    assert client.view(view).message.own_keys == []


def test_a_lambert_sphere_on_its_orbit_has_the_phase_law(client: steradian.Client) -> None:
    sphere = Asteroid(radii_m=(7e3, 7e3, 7e3), law="lambert")
    with prepared(client, "flat", sphere) as revision:
        for phase_rad in [0.0, 0.5, 1.0, 1.5, 2.0]:
            _, distance_m = aim(client, "flat", sphere, phase_rad)
            times = turn_of(sphere, 1)[:1]
            light = next(measured_lx(client, "flat", times, revision))
            revision = client.scene().revision
            law = (np.sin(phase_rad) + (np.pi - phase_rad) * np.cos(phase_rad)) / np.pi
            expected = sphere.albedo * sphere.illuminance_lx() * (7e3 / distance_m) ** 2 * law
            assert light == pytest.approx(expected, rel=4e-3)


def test_changes_by_another_client_are_detected(client: steradian.Client) -> None:
    asteroid = Asteroid()
    with prepared(client, "flat", asteroid) as revision:
        client.update_scene({"stars.magnitude_limit": 3.0})
        with pytest.raises(steradian.Conflict):
            next(measured_lx(client, "flat", turn_of(asteroid, 2), revision))


def test_the_program_writes_a_table_and_a_picture(
    shared: Daemon, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, picture = tmp_path / "curve.csv", tmp_path / "curve.png"
    arguments = ["--connect", shared.address, "--view", "flat", "--steps", "4", "--csv", str(table)]
    if importlib.util.find_spec("matplotlib") is None:
        with pytest.raises(SystemExit):
            light_curve.main([*arguments, "--plot", str(picture)])
        assert "--plot needs matplotlib" in capsys.readouterr().err and not table.exists()
    else:
        light_curve.main([*arguments, "--plot", str(picture)])
        assert picture.read_bytes().startswith(b"\x89PNG")
    light_curve.main(arguments)
    rows = list(csv.DictReader(table.open()))
    assert len(rows) == 5 and list(rows[0]) == ["time", "measured_lx", "theory_lx"]
    assert all(float(row["measured_lx"]) == pytest.approx(float(row["theory_lx"]), rel=4e-3) for row in rows)
    assert "5 times, amplitude 0." in capsys.readouterr().out
    with pytest.raises(SystemExit):
        light_curve.main([*arguments, "--phase-deg", "170"])
