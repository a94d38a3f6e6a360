"""Compares the light of a store of the whole sky with that of its table: python light_sums.py STERADIAN FOLDER [STARS]"""

import pathlib
import sys

import numpy as np
from stores import LUMINANCE, exported, leaves, light, run

folder = pathlib.Path(sys.argv[2]).resolve()
count = int(sys.argv[3]) if len(sys.argv) > 3 else 200_000
random = np.random.default_rng(11)
# The stars are within 10 degrees, so that leaves are as full as those of a large catalogue. More than a million stars cover the whole sky.
least = -1 if count > 1_000_000 else np.cos(np.radians(10))
ra = random.uniform(0, 360, count)
dec = np.degrees(np.arcsin(random.uniform(least, 1, count)))
# A twentieth of the stars is bright. From V = 13 to 20, there are twice as many stars of each magnitude as of the previous one.
bright = count // 20
v = np.concatenate([random.uniform(11, 12.95, bright), 13 + np.log2(1 + 127 * random.uniform(0, 1, count - bright))])
temperature = np.round(np.exp(random.uniform(np.log(2500), np.log(20000), count)), 2)
v = np.round(v, 5)
with open(folder / "table.csv", "w", encoding="ascii") as file:
    file.write("ra_deg,dec_deg,v_mag,teff_k\n")
    file.writelines("%.8f,%.8f,%.5f,%.2f\n" % row for row in zip(ra, dec, v, temperature))
run(folder, "catalogue", "import", "table.csv", "--memory", "512MiB", "--out", "store")

# Compare luminance, then the three channels.
def off(found, expected):
    return [float(found @ LUMINANCE / (expected @ LUMINANCE) - 1), *(found / expected - 1)]


stored_v, stored_temperature, sums = leaves(folder / "store")
faint = v >= 13
assert len(stored_v) == faint.sum() == count - bright
table = light(v[faint], temperature[faint])
stored = light(stored_v, stored_temperature)
rows = exported(folder, "store/bright")
assert len(rows) == bright
bright_table = light(v[~faint], temperature[~faint])
bright_stored = light(np.array([row["v_mag"] for row in rows]), np.array([row["teff_k"] for row in rows]))
of_index, of_leaves, of_bright = off(sums, stored), off(stored, table), off(bright_stored, bright_table)
of_all = off(stored + bright_stored, table + bright_table)
for name, found in [("index", of_index), ("leaves", of_leaves), ("bright", of_bright), ("all", of_all)]:
    print(name, *(f"{value:.1e}" for value in found))
# The constant has six digits.
assert max(map(abs, of_index)) < 2e-6, of_index
for found in [of_leaves, of_all]:
    assert abs(found[0]) < 1e-6, found
# A wrong input: one star of V = 13 is missing.
assert abs(off(light(stored_v[1:], stored_temperature[1:]), table)[0]) > 1e-6
