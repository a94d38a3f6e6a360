"""Reads deep stores without Steradian, according to the layout in the module comments of index.rs and word.rs."""

import csv
import math
import pathlib
import re
import struct
import subprocess
import sys

import numpy as np

ILLUMINANCE_MAG_0_LX = 2.53848e-6
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
STERADIAN = sys.argv[1]


def run(folder, *arguments, code=0):
    """Runs a command; returns its standard output, or its error if `code` is not 0."""
    result = subprocess.run([STERADIAN, *map(str, arguments)], cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == code, f"{arguments}: exit code {result.returncode}\n{result.stdout}\n{result.stderr}"
    return result.stdout if code == 0 else result.stderr


def expect(text, *parts):
    for part in parts:
        assert part in text, f"{part!r} is not in\n{text}"


def exported(folder, store, name="exported.csv"):
    """Returns the stars of a store: a list of rows, each a dictionary of numbers (None if empty)."""
    run(folder, "catalogue", "export", store, "--out", name)
    with open(folder / name, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for key, text in row.items():
            if key != "name":
                row[key] = float(text) if text else None
    return rows


def directions(ra_deg, dec_deg):
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], -1)


def angle_arcsec(first, second):
    return np.degrees(2 * np.arcsin(np.linalg.norm(first - second, axis=-1) / 2)) * 3600


def leaves(store):
    """Returns magnitudes and temperatures of all stars in leaves, and the sums of light in the index (lx, RGB)."""
    index = (store / "index").read_bytes()
    assert index[:8] == b"STERDEEP"
    layers = struct.unpack_from("<I", index, 12)[0]
    description = struct.unpack_from("<Q", index, 56)[0]
    planes = struct.unpack_from("<I", index, 84)[0]
    start = 128 + (description + 7) // 8 * 8
    entries = [struct.unpack_from("<IIQQ", index, start + 24 * part) for part in range(layers + planes)]
    start += 24 * len(entries)
    magnitudes, temperatures, sums = [], [], np.zeros(3)
    for magnitude, _, stars, segments in entries[:layers]:
        words = np.fromfile(store / f"leaves-{magnitude}", "<u8")
        assert len(words) == stars
        magnitudes.append(magnitude + 10 / 2047 * ((words >> np.uint64(19)) & np.uint64(0x7FF)).astype(float))
        code = ((words >> np.uint64(11)) & np.uint64(0xFF)).astype(float)
        temperatures.append(1 / (1e-5 + code * (1 / 2000 - 1e-5) / 255))
        if segments:
            sums += np.frombuffer(index, "<f8", 3 * 12 * 4**5, start).reshape(-1, 3).sum(0)
            start += 24 * 12 * 4**5
    return np.concatenate(magnitudes), np.concatenate(temperatures), sums


def colour(temperature_k):
    """Returns linear Rec. 709 of black bodies with luminance 1: Planck's law times the colour matching functions of the CIE."""
    root = pathlib.Path(__file__).parents[3]
    table = (root / "crates/sky/src/photometry/cie1931.rs").read_text(encoding="utf-8").split("COLOUR_MATCHING", 2)[2]
    rows = re.findall(r"\[([0-9.e-]+), ([0-9.e-]+), ([0-9.e-]+)\],", table)
    matching = np.array(rows, float)
    assert matching.shape == (95, 3)
    wavelength = 360e-9 + 5e-9 * np.arange(95)
    exponent = 6.62607015e-34 * 299792458.0 / 1.380649e-23 / (wavelength * np.asarray(temperature_k, float)[:, None])
    xyz = (wavelength**-5.0 / np.expm1(exponent)) @ matching
    # Columns are the primaries of Rec. 709, scaled to the white of D65.
    primaries = np.array([[0.64, 0.33, 0.03], [0.30, 0.60, 0.10], [0.15, 0.06, 0.79]]).T
    white = np.array([0.3127, 0.3290, 0.3583]) / 0.3290
    rgb = xyz @ np.linalg.inv(primaries * np.linalg.solve(primaries, white)).T
    return rgb / (rgb @ LUMINANCE)[:, None]


def light(magnitude, temperature_k):
    """Returns the sum of light, lx, in three channels. Stars are added up exactly, in blocks that fit in memory."""
    parts = []
    for first in range(0, len(magnitude), 100_000):
        some = slice(first, first + 100_000)
        stars = 10 ** (-0.4 * np.asarray(magnitude[some], float))
        parts.append(stars @ colour(temperature_k[some]))
    return ILLUMINANCE_MAG_0_LX * np.array([math.fsum(part[channel] for part in parts) for channel in range(3)])


def v_of_gaia(g, bp_rp):
    """Returns V, computed from G and BP-RP: Riello et al. 2021, A&A 649, A3, table C.2, G - V."""
    x = np.clip(bp_rp, -0.5, 5.0)
    return g - (-0.02704 + 0.01424 * x - 0.2156 * x**2 + 0.01426 * x**3)
