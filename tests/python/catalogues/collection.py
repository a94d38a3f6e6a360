"""Imports a collection, with a margin catalogue, that hats-import writes here: python collection.py STERADIAN FOLDER [STARS]"""

import os
import pathlib
import sys

import numpy as np
import pandas as pd
from dask.distributed import Client
from hats_import import CollectionArguments
from hats_import.collection.run_import import run as run_hats_import
from scipy.spatial import cKDTree
from stores import angle_arcsec, directions, expect, exported, run, v_of_gaia

folder = pathlib.Path(sys.argv[2]).resolve()
count = int(sys.argv[3]) if len(sys.argv) > 3 else 200_000


def table():
    """Returns rows like those of Gaia. A third of the stars is in a clump, so that partitions have several orders."""
    random = np.random.default_rng(42)
    ra, dec = random.uniform(0, 360, count), np.degrees(np.arcsin(random.uniform(-1, 1, count)))
    clump = count // 3
    ra[:clump], dec[:clump] = random.normal(266, 3, clump), random.normal(-29, 3, clump)
    rows = pd.DataFrame({"source_id": (np.arange(count) * 131 + 7) << 20, "ref_epoch": 2016.0, "ra": ra, "dec": dec})
    rows["parallax"], rows["parallax_error"] = random.normal(0.8, 0.5, count), np.exp(random.normal(-2.5, 0.8, count))
    rows["pmra"], rows["pmdec"] = random.normal(0, 8, (2, count))
    rows["phot_g_mean_mag"] = np.clip(20.5 - 1.6 * random.exponential(1, count), 4, 21.3).astype("f4")
    rows["bp_rp"] = np.clip(random.normal(1.2, 0.5, count), -0.4, 5).astype("f4")
    rows.loc[random.random(count) < 0.15, "bp_rp"] = np.nan
    rows.loc[random.random(count) < 0.18, ["parallax", "parallax_error", "pmra", "pmdec"]] = np.nan
    return rows.sample(frac=1, random_state=1, ignore_index=True)


def main():
    rows = table()
    os.chdir(folder)
    for name, part in [("1.csv", rows[: count // 2]), ("2.csv", rows[count // 2 :])]:
        part.to_csv(name, index=False)
    os.mkdir("tmp")
    arguments = (
        CollectionArguments(output_artifact_name="gaia", output_path=".", tmp_dir="tmp", progress_bar=False)
        .catalog(input_file_list=["1.csv", "2.csv"], file_reader="csv", catalog_type="object", ra_column="ra",
                 dec_column="dec", lowest_healpix_order=1, highest_healpix_order=6, pixel_threshold=count // 10)
        .add_margin(margin_threshold=300.0, is_default=True)
    )  # fmt: skip
    with Client(n_workers=1, threads_per_worker=1) as client:
        run_hats_import(arguments, client)
    orders = {path.name for path in (folder / "gaia/gaia/dataset").glob("Norder=*")}
    assert len(orders) > 1, orders
    margin = pd.concat(pd.read_parquet(path) for path in (folder / "gaia/gaia_5arcmin").rglob("Npix=*.parquet"))
    assert len(margin) > count // 100, len(margin)

    # The collection and its catalogue give the same store; the margin is refused.
    said = run(folder, "catalogue", "import", "gaia", "--memory", "512MiB", "--out", "store")
    expect(said, f" files): {count} stars, read as Gaia archive, DR3, 0 of {count} rows rejected", f"wrote store: {count} stars, ")
    run(folder, "catalogue", "import", "gaia/gaia", "--memory", "512MiB", "--out", "again")
    for path in (folder / "store").glob("leaves-*"):
        assert path.read_bytes() == (folder / "again" / path.name).read_bytes(), path
    error = run(folder, "catalogue", "import", "gaia/gaia_5arcmin", "--memory", "512MiB", "--out", "margin", code=65)
    expect(error, "its dataproduct_type is margin; it must be object or source")
    expect(run(folder, "catalogue", "check", "store", "--light"), "all checksums are right")

    # Every star is stored once, with its position and magnitude.
    stars = exported(folder, "store")
    found = directions(*(np.array([star[key] for star in stars]) for key in ["ra_deg", "dec_deg"]))
    v = np.array([star["v_mag"] for star in stars])
    bright = np.array([star["ref_epoch"] for star in stars]) == 2000.0
    g, colour = rows["phot_g_mean_mag"].to_numpy(float), rows["bp_rp"].to_numpy(float)
    true_v = np.where(np.isnan(colour), g, v_of_gaia(g, colour))
    at_2016 = directions(rows["ra"].to_numpy(), rows["dec"].to_numpy())
    ra, dec = np.radians(rows["ra"].to_numpy()), np.radians(rows["dec"].to_numpy())
    east = np.stack([-np.sin(ra), np.cos(ra), np.zeros(count)], -1)
    motion = np.radians(np.nan_to_num(rows[["pmra", "pmdec"]].to_numpy()) / 3.6e6)
    at_2000 = at_2016 - 16 * (motion[:, :1] * east + motion[:, 1:] * np.cross(at_2016, east))
    at_2000 /= np.linalg.norm(at_2000, axis=1)[:, None]
    which = np.empty(count, int)
    limit = np.select([true_v < 13, true_v < 15.0001, true_v < 17.0001], [0.0123, 0.026, 0.013], 0.0064) + 0.0001
    for kind, places in [(bright, at_2000), (~bright, at_2016)]:
        which[kind] = cKDTree(places).query(found[kind])[1]
        off = angle_arcsec(found[kind], places[which[kind]])
        off_v = np.abs(v[kind] - true_v[which[kind]])
        print(f"{kind.sum()} stars off by at most {off.max():.4f} arcsec, {off_v.max():.4f} mag")
        # Three stars of the same brightness within an arcsecond could be mistaken for each other, but there are too few stars for that.
        assert (off < limit[which[kind]]).all(), off.max()
        assert off_v.max() < (0.0003 if kind is bright else 0.0051), off_v.max()
    assert len(stars) == count and len(set(which)) == count, len(set(which))
    # With the margin, some stars would be stored twice.
    assert len(set(margin["source_id"]) & set(rows["source_id"])) > 0


if __name__ == "__main__":
    main()
