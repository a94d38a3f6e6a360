"""The light curve of a spinning asteroid, measured in an HDR view of a running daemon.

    python light_curve.py --connect 127.0.0.1:7143 --view star-tracker --csv light_curve.csv --plot light_curve.png

An ellipsoid spins in sunlight. The daemon draws it at several times during one rotation, and the light in each picture
is added up: the sum of luminance times solid angle over all pixels is the illuminance at the camera. The table also
contains the theoretical light in closed form. Scene, camera and view of the daemon are restored afterwards; other
clients see the asteroid in the meantime. The file is divided into cells (`# %%`), which editors that support notebooks
run one by one.
"""

# %% [markdown]
# ## Requirements
# numpy and this package; matplotlib for `--plot` only.

# %%
from __future__ import annotations

import argparse
import contextlib
import csv
import datetime
import importlib.util
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import steradian

Vector = npt.NDArray[np.float64]

ASTRONOMICAL_UNIT_M = 149_597_870_700.0
# Rotation angles of bodies are relative to this time.
J2000 = datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.timezone.utc)
# A sun without limb darkening: its illuminance at the distance d is pi L (R / d)^2.
SUN_RADIUS_M, SUN_LUMINANCE_CD_M2 = 6.957e8, 1.6e9

# %% [markdown]
# ## The asteroid
# It spins about its shortest axis, which points to celestial north. Sun and camera are in the plane of its equator.


# %%
@dataclass(frozen=True)
class Asteroid:
    """An ellipsoid in sunlight.

    Attributes:
        radii_m: semi-axes, m.
        albedo: geometric albedo.
        law: reflection law, `lommel_seeliger` or `lambert`.
        period_s: sidereal period of its rotation, s.
        sun_distance_m: distance from the Sun, m.
    """

    radii_m: tuple[float, float, float] = (9e3, 6.5e3, 6e3)
    albedo: float = 0.15
    law: str = "lommel_seeliger"
    period_s: float = 4.0 * 3600
    sun_distance_m: float = 2.5 * ASTRONOMICAL_UNIT_M

    @property
    def position_m(self) -> Vector:
        """Returns its centre; the Sun is at the origin."""
        return np.array([self.sun_distance_m, 0.0, 0.0])

    def illuminance_lx(self) -> float:
        """Returns the illuminance by sunlight at its centre, on a surface perpendicular to the rays, lx."""
        return float(np.pi * SUN_LUMINANCE_CD_M2 * (SUN_RADIUS_M / self.sun_distance_m) ** 2)

    def bodies(self) -> list[dict[str, object]]:
        """Returns the Sun and the asteroid as fields of messages `Body`."""
        sun: dict[str, object] = {
            "name": "sun",
            "position_m": [0.0, 0.0, 0.0],
            "radii_m": [SUN_RADIUS_M] * 3,
            "emission": {"luminance_cd_m2": SUN_LUMINANCE_CD_M2, "limb_darkening": 0.0},
        }
        asteroid: dict[str, object] = {
            "name": "asteroid",
            "position_m": self.position_m,
            "radii_m": self.radii_m,
            "geometric_albedo": self.albedo,
            "law": self.law,
            "spin": {"period_s": self.period_s, "phase_rad": 0.0},
        }
        return [sun, asteroid]


# %% [markdown]
# ## Theory
# The surface reflects by the law of Lommel and Seeliger: with the illuminance E at the angle of incidence i, its
# luminance at the angle of emission e is 2 p E / pi cos i / (cos i + cos e). If the ellipsoid is stretched to a sphere,
# and the directions to Sun and eye with it, the integral keeps its form. The light therefore has a closed form
# (Muinonen and Lumme 2015, "Disk-integrated brightness of a Lommel-Seeliger scattering ellipsoidal asteroid", A&A 584,
# A23).


# %%
def theory_lx(asteroid: Asteroid, to_eye: Vector, distance_m: float, times: Sequence[datetime.datetime]) -> Vector:
    """Returns the illuminance that an asteroid with the law of Lommel and Seeliger causes at a distant eye, lx, for
    each time.

    Args:
        to_eye: (3,), unit vector from the asteroid to the eye, ICRS axes.
        distance_m: distance of the eye, m.
    """
    if asteroid.law != "lommel_seeliger":
        raise ValueError(f"{asteroid.law}: the closed form exists for lommel_seeliger only")
    turns = np.array([(time - J2000).total_seconds() / asteroid.period_s for time in times])
    angles = 2 * np.pi * (turns % 1.0)
    radii = np.array(asteroid.radii_m)
    # Directions in the axes of the body, stretched.
    sun, eye = (_turned(direction, -angles) / radii for direction in (np.array([-1.0, 0.0, 0.0]), to_eye))
    sun_length, eye_length = np.linalg.norm(sun, axis=1), np.linalg.norm(eye, axis=1)
    both = np.linalg.norm(sun + eye, axis=1)
    cos_phase = np.clip(np.sum(sun * eye, axis=1) / (sun_length * eye_length), -1.0, 1.0)
    phase = np.arccos(cos_phase)
    x = np.arccos(np.clip((sun_length + eye_length * cos_phase) / both, -1.0, 1.0))
    y = phase - x
    # Use 0 at full phase, because the logarithm is infinite there.
    with np.errstate(divide="ignore", invalid="ignore"):
        product = np.sin(x) * np.sin(y) * -np.log(np.tan(x / 2) * np.tan(y / 2))
    term = np.cos(x) + np.cos(y) - np.where(np.minimum(x, y) > 0, product, 0.0)
    scale = asteroid.albedo * asteroid.illuminance_lx() * np.prod(radii) / distance_m**2
    light: Vector = scale * sun_length * eye_length / both * term
    return light


def _turned(direction: Vector, angles: Vector) -> Vector:
    """Returns a direction, turned about z by each of the angles: (n, 3)."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * direction[0] - s * direction[1], s * direction[0] + c * direction[1], 0 * c + direction[2]], 1)


# %% [markdown]
# ## The measurement
# Stars and glare are turned off during the measurement, so that all light in the picture comes from the asteroid. Each
# change contains the revision of the previous one: if another client changes the scene in between, the measurement ends
# with `Conflict` instead of wrong numbers.


# %%
@contextlib.contextmanager
def prepared(client: steradian.Client, view: str, asteroid: Asteroid) -> Iterator[int]:
    """Shows only the asteroid, yields the revision of the scene, and restores the scene afterwards."""
    scene, camera, shown = client.scene(), client.camera(), client.view(view)
    own_glare = {
        key.removeprefix("glare."): getattr(shown.message.glare, key.removeprefix("glare."))
        for key in shown.message.own_keys
        if key.startswith("glare.")
    }
    try:
        client.set_camera(velocity_c=[0.0, 0.0, 0.0])
        client.update_view(view, {"glare": {"method": "none"}})
        changes = {"bodies": asteroid.bodies(), "asteroid_fields": [], "stars.magnitude_limit": -30.0}
        yield client.update_scene(changes).revision
    finally:
        old = scene.message
        before = {"bodies": old.bodies, "asteroid_fields": old.asteroid_fields, "stars": old.stars, "time": old.time}
        client.update_scene(before)
        client.update_view(view, {"glare": own_glare})
        client.set_camera(camera)


def aim(client: steradian.Client, view: str, asteroid: Asteroid, phase_rad: float) -> tuple[Vector, float]:
    """Places the camera so that the asteroid is in the middle of the view, at a phase angle. Returns the direction to
    the camera, and its distance, m."""
    images = client.view(view).images
    if len(images) != 1 or images[0].orientation is None:
        raise ValueError(f"the light curve needs a view with one image, but {view} has {len(images)}")
    projection = images[0].projection
    half_rad = np.arctan(projection.up_tan) if projection.mapping == "perspective" else projection.fov_rad / 2
    # Theory assumes parallel rays: its error is of the order of size over distance, here 0.2 %.
    distance_m = max(asteroid.radii_m) / min(0.15 * half_rad, 0.002) if half_rad > 0 else 100 * max(asteroid.radii_m)
    to_eye = np.array([-np.cos(phase_rad), -np.sin(phase_rad), 0.0])
    ahead = steradian.multiply(steradian.looking_at(-to_eye), steradian.conjugate(images[0].orientation))
    client.set_camera(position_m=asteroid.position_m + distance_m * to_eye, orientation=ahead)
    return to_eye, distance_m


def measured_lx(
    client: steradian.Client, view: str, times: Sequence[datetime.datetime], revision: int
) -> Iterator[float]:
    """Returns the light in the view at each time, lx."""
    for time in times:
        revision = client.update_scene({"time": time}, expected_revision=revision).revision
        yield client.render(view, "EXR").image().illuminance_lx()


def turn_of(asteroid: Asteroid, steps: int) -> list[datetime.datetime]:
    """Returns times during one rotation, including its start and its end."""
    begin = datetime.datetime(2026, 1, 1, tzinfo=datetime.timezone.utc)
    return [begin + datetime.timedelta(seconds=asteroid.period_s * step / steps) for step in range(steps + 1)]


# %% [markdown]
# ## Table and picture


# %%
@dataclass(frozen=True)
class LightCurve:
    """Times, and the light at each of them, lx: as measured in the pictures, and as computed by theory."""

    times: list[datetime.datetime]
    measured_lx: Vector
    theory_lx: Vector

    def largest_error(self) -> float:
        """Returns the largest relative error of the light in the pictures."""
        return float(np.max(np.abs(self.measured_lx / self.theory_lx - 1)))


def light_curve(client: steradian.Client, view: str, asteroid: Asteroid, phase_rad: float, steps: int) -> LightCurve:
    """Measures one turn."""
    times = turn_of(asteroid, steps)
    with prepared(client, view, asteroid) as revision:
        to_eye, distance_m = aim(client, view, asteroid, phase_rad)
        measured = np.array(list(measured_lx(client, view, times, revision)))
    return LightCurve(times, measured, theory_lx(asteroid, to_eye, distance_m, times))


def write_csv(file: str, curve: LightCurve) -> None:
    """Writes a row for each time: ISO 8601, and both illuminances, lx."""
    with open(file, "w", newline="") as out:
        rows = csv.writer(out)
        rows.writerow(["time", "measured_lx", "theory_lx"])
        for time, *light in zip(curve.times, curve.measured_lx, curve.theory_lx):
            rows.writerow([time.isoformat(), *(f"{lx:.9e}" for lx in light)])


def plot(file: str, curve: LightCurve, title: str) -> None:
    """Plots both curves, with their difference below."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    hours = np.array([(time - curve.times[0]).total_seconds() / 3600 for time in curve.times])
    figure, (above, below) = pyplot.subplots(
        2, 1, sharex=True, figsize=(7, 4.5), height_ratios=[3, 1], constrained_layout=True
    )
    above.plot(hours, curve.theory_lx * 1e3, color="0.6", linewidth=3, label="closed form")
    above.plot(hours, curve.measured_lx * 1e3, ".", color="tab:blue", markersize=5, label="sum over pixels")
    above.set_ylabel("illuminance / mlx")
    above.set_title(title, fontsize=10)
    above.legend(frameon=False)
    below.plot(hours, (curve.measured_lx / curve.theory_lx - 1) * 100, ".", color="tab:blue", markersize=5)
    below.axhline(0, color="0.6", linewidth=1)
    below.set_ylabel("difference / %")
    below.set_xlabel("time / h")
    figure.savefig(file, dpi=110)
    pyplot.close(figure)


# %%
def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the program."""
    parser = argparse.ArgumentParser(description="Measures the light curve of a spinning asteroid.")
    parser.add_argument("--connect", default="127.0.0.1:7143", help="address of the daemon")
    parser.add_argument("--view", required=True, help="a view with one image; a narrow view shows the asteroid larger")
    parser.add_argument("--phase-deg", type=float, default=40.0, help="angle between Sun and camera, 0 to 120")
    parser.add_argument("--steps", type=int, default=72, help="number of times during one rotation")
    parser.add_argument("--csv", required=True, help="file for the table")
    parser.add_argument("--plot", help="file for the picture")
    given = parser.parse_args(arguments)
    if not 0 <= given.phase_deg <= 120 or given.steps < 1:
        parser.error("--phase-deg must be between 0 and 120, and --steps at least 1")
    # Check this before the measurement, which takes long.
    if given.plot and importlib.util.find_spec("matplotlib") is None:
        parser.error("--plot needs matplotlib, which is not installed (Debian: python3-matplotlib)")
    asteroid = Asteroid()
    with steradian.Client(given.connect) as client:
        curve = light_curve(client, given.view, asteroid, np.radians(given.phase_deg), given.steps)
    write_csv(given.csv, curve)
    if given.plot:
        radii = " x ".join(f"{radius / 1e3:g}" for radius in asteroid.radii_m)
        plot(given.plot, curve, f"Asteroid of {radii} km at a phase angle of {given.phase_deg:g} degrees")
    amplitude = 2.5 * np.log10(curve.measured_lx.max() / curve.measured_lx.min())
    print(f"{len(curve.times)} times, amplitude {amplitude:.3f} mag, largest error {curve.largest_error():.2e}")


if __name__ == "__main__":
    try:
        main()
    except (steradian.SteradianError, ValueError, OSError) as error:
        sys.exit(f"error: {error}")
