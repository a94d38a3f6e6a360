"""Imports a table that is made to cause errors: python adversarial.py STERADIAN FOLDER"""

import pathlib
import sys

import numpy as np
from stores import angle_arcsec, directions, expect, exported, run, v_of_gaia

folder = pathlib.Path(sys.argv[2]).resolve()
COLUMNS = "source_id,ref_epoch,ra,dec,parallax,parallax_error,pmra,pmdec,phot_g_mean_mag,bp_rp"
random = np.random.default_rng(5)
lines, stars = [], []


def add(ra, dec, g, bp_rp=0.8, parallax="0.2", error="0.3", source=None):
    """A usable star."""
    ra, dec = (value if isinstance(value, str) else repr(float(value)) for value in (ra, dec))
    lines.append(f"{source or len(lines) + 1},2016.0,{ra},{dec},{parallax},{error},,,{g:.5f},{bp_rp:.4f}")
    stars.append((float(ra), float(dec), g, bp_rp))


# 100,489 stars in one square arcminute, where right ascension passes from 360 to 0 degrees, on a slightly irregular grid of 0.19 arcsec.
side = 317
step = 0.19
shift = random.uniform(-0.05, 0.05, (2, side, side))
for row in range(side):
    for column in range(side):
        x, y = ((column - side // 2) * step + shift[0, row, column]) / 3600, ((row - side // 2) * step + shift[1, row, column]) / 3600
        add(x % 360, y, random.uniform(13.5, 21), random.uniform(-0.3, 3))
# One star of V = 2 among them.
add(0.004, 0.004, 2.0, 0.8)
# Stars on the poles, with various right ascensions, and next to them.
for sign in [1, -1]:
    for number in range(12):
        add(30.0 * number, sign * 90.0, 14 + 0.1 * number)
        add(30.0 * number, sign * (90 - 1 / 3600), 16 + 0.1 * number)
# Double stars with a separation of 0.05 arcsec.
for number in range(300):
    ra, dec = 20 + 0.9 * number, -60 + 0.4 * number
    add(ra, dec, 15.0)
    add(ra, dec + 0.05 / 3600, 15.6)
# Right ascensions at the ends of the range, in several notations.
for number, ra in enumerate(["0", "360", "-0.0", "359.999999999", "1e-12", "-180", "180.0", "+90"]):
    add(ra, str(30 + number), 17.0)
# Negative, absurd and missing parallaxes, and a source number that two stars share.
for number, (parallax, error) in enumerate([("-5", "0.1"), ("-1e9", "1e-3"), ("NaN", "NaN"), ("null", ""), ("inf", "1"), ("1e-300", "0.1")]):
    add(100.0, 40.0 + number, 18.0, parallax=parallax, error=error)
add(110.0, 40.0, 18.0, source=4711)
add(111.0, 40.0, 18.5, source=4711)
used = len(lines)
# Rows that repeat a star are left out of the store.
lines += [lines[used - 1], lines[5], lines[5]]
# Reasons why rows are unusable, and the number of these rows.
REFUSED = {
    ",,,,,,,,,": ("ra is missing", 40),
    "null,null,null,null,null,null,null,null,null,null": ("ra is missing", 30),
    "1,2016.0,NaN,10,1,0.1,,,15,1": ("ra is missing", 1),
    "1,2016.0,10,NaN,1,0.1,,,15,1": ("dec is missing", 2),
    "1,2016.0,10,20,1,0.1,,,NaN,1": ("no brightness", 3),
    "1,2016.0,10,20,1,0.1,,,99.99,1": ("phot_g_mean_mag is not a magnitude: no brightness", 2),
    "1,2016.0,10,20,1,0.1,,,1e300,1": ("phot_g_mean_mag is not a magnitude: no brightness", 1),
    "1,2016.0,10,20,1,0.1,,,75,1": ("phot_g_mean_mag is outside -40 to 60", 2),
    "1,2016.0,10,20,1,0.1,,,inf,1": ("phot_g_mean_mag is not finite", 1),
    "1,2016.0,361,20,1,0.1,,,15,1": ("ra is outside -180 to 360 degrees", 4),
    "1,2016.0,10,90.000001,1,0.1,,,15,1": ("dec is outside -90 to 90 degrees", 5),
    "1,2016.0,10,-1e300,1,0.1,,,15,1": ("dec is outside -90 to 90 degrees", 1),
    "1,2016.0,ten,20,1,0.1,,,15,1": ("ra is not an angle", 2),
    "1,2016.0,10,20,1e12,0.1,,,15,1": ("parallax is too large", 2),
    "1,2016.0,10,20,1,0.1,1e9,0,15,1": ("pmra is outside -100000 to 100000 mas/yr", 3),
    "1,1e9,10,20,1,0.1,5,0,15,1": ("ref_epoch is outside 1800 to 2200", 2),
    "1,2016.0,10,20,1": ("5 fields instead of 10", 2),
    '1,2016.0,"10,20,1,0.1,,,15,1': ("a quotation mark is not closed on its line", 2),
}
for line, (_, count) in REFUSED.items():
    lines += [line] * count
order = random.permutation(len(lines))
with open(folder / "table.csv", "w", encoding="ascii") as file:
    file.write("\n".join([COLUMNS, *(lines[i] for i in order)]) + "\n")

said = run(folder, "catalogue", "import", "table.csv", "--memory", "256MiB", "--out", "store")
refused = {}
for kind, count in REFUSED.values():
    refused[kind] = refused.get(kind, 0) + count
out = sum(refused.values())
expect(said, f"table.csv: {used + 3} stars, read as Gaia archive, DR3, {out} of {len(lines)} rows rejected")
expect(said, *(f"rejected: {kind}: {count}, first: table.csv line " for kind, count in refused.items()))
expect(said, "not stored: duplicates of other stars: 3", f"wrote store: {used} stars, ")
checked = run(folder, "catalogue", "check", "store", "--light")
expect(checked, f"{used} stars (in", "every composite star matches its cell")

# Every star is in the store once, within the error of its leaf.
rows = exported(folder, "store")
assert len(rows) == used
ra, dec, v = (np.array([row[key] for row in rows]) for key in ["ra_deg", "dec_deg", "v_mag"])
bright = np.array([row["ref_epoch"] for row in rows]) == 2000.0
true_ra, true_dec, true_g, true_colour = np.array(stars).T
true_v = v_of_gaia(true_g, true_colour)
assert bright.sum() == (true_v < 13).sum() == 1
limit = np.where(true_v < 13, 0.0123, np.select([true_v < 15.0001, true_v < 17.0001], [0.026, 0.013], 0.0064)) + 0.0001
found, true = directions(ra, dec), directions(true_ra, true_dec)


def match(rows_here, stars_here, which):
    """Matches each row with one of the stars; `which` is the star of each row."""
    assert sorted(which) == sorted(stars_here), (len(rows_here), len(stars_here))
    off = angle_arcsec(found[rows_here], true[which])
    assert (off < limit[which]).all(), (off / limit[which]).max()
    off_v = np.abs(v[rows_here] - true_v[which])
    assert (off_v < np.where(bright[rows_here], 0.0003, 0.0051)).all(), off_v.max()
    return off.max(), off_v.max()


# Match the stars of the grid by cell, and the others with the nearest star of about the same brightness.
x, y = (ra + 180) % 360 - 180, dec
is_grid = (np.abs(x) < 0.02) & (np.abs(y) < 0.02) & ~bright
cell = np.rint(y * 3600 / step).astype(int) * side + np.rint(x * 3600 / step).astype(int) + side // 2 * (side + 1)
print("grid: off by %.4f arcsec, V %.4f" % match(np.flatnonzero(is_grid), np.arange(side * side), cell[is_grid]))
others = np.flatnonzero(~is_grid)
rest = np.arange(side * side, used)
cost = (1 - found[others] @ true[rest].T) * 1e9 + np.abs(v[others][:, None] - true_v[rest][None]) / 0.005
print("others: off by %.4f arcsec, V %.4f" % match(others, rest, rest[np.argmin(cost, 1)]))

# A file without a usable row, and wrong input for each comparison.
(folder / "null.csv").write_text(COLUMNS + "\n" + ",,,,,,,,,\n" * 5, encoding="ascii")
error = run(folder, "catalogue", "import", "null.csv", "--memory", "256MiB", "--out", "none", code=65)
expect(error, "null.csv: no usable row; 5 rows rejected, first: line 2: ra is missing")
assert not (folder / "none").exists()
true_v[cell[is_grid][0]] += 0.02
try:
    match(np.flatnonzero(is_grid), np.arange(side * side), cell[is_grid])
except AssertionError:
    pass
else:
    raise AssertionError("a star of another brightness passes")
