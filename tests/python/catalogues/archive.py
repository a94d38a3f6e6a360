"""A bulk file of the Gaia archive, written in its format with synthetic values: python archive.py STERADIAN FOLDER

The format: gzip, a head in ECSV as comments with one item of several lines for each of the 152 columns, their names, rows with `null` for missing values and
texts in quotation marks. Columns and their order: Gaia DR3 documentation, section gaia_source; ECSV: section 13.2.5."""

import gzip
import pathlib
import sys

import numpy as np
from stores import angle_arcsec, directions, expect, exported, run, v_of_gaia

folder = pathlib.Path(sys.argv[2]).resolve()
ASTROMETRY = ["ra", "dec", "parallax", "pmra", "pmdec"]
CORRELATIONS = [f"{a}_{b}_corr" for i, a in enumerate(ASTROMETRY) for b in ASTROMETRY[i + 1 :]]


def bounds(*names):
    return [name + end for name in names for end in ["", "_lower", "_upper"]]


def photometry(band):
    return [f"phot_{band}_{end}" for end in ["n_obs", "mean_flux", "mean_flux_error", "mean_flux_over_error", "mean_mag"]]


COLUMNS = [
    *"solution_id designation source_id random_index ref_epoch ra ra_error dec dec_error parallax parallax_error".split(),
    *"parallax_over_error pm pmra pmra_error pmdec pmdec_error".split(),
    *CORRELATIONS,
    *"astrometric_n_obs_al astrometric_n_obs_ac astrometric_n_good_obs_al astrometric_n_bad_obs_al astrometric_gof_al".split(),
    *"astrometric_chi2_al astrometric_excess_noise astrometric_excess_noise_sig astrometric_params_solved".split(),
    *"astrometric_primary_flag nu_eff_used_in_astrometry pseudocolour pseudocolour_error".split(),
    *[f"{name}_pseudocolour_corr" for name in ASTROMETRY],
    *"astrometric_matched_transits visibility_periods_used astrometric_sigma5d_max matched_transits".split(),
    *"new_matched_transits matched_transits_removed ipd_gof_harmonic_amplitude ipd_gof_harmonic_phase".split(),
    *"ipd_frac_multi_peak ipd_frac_odd_win ruwe".split(),
    *[f"scan_direction_{kind}_k{k}" for kind in ["strength", "mean"] for k in range(1, 5)],
    "duplicated_source",
    *photometry("g"),
    *photometry("bp"),
    *photometry("rp"),
    *"phot_bp_rp_excess_factor phot_bp_n_contaminated_transits phot_bp_n_blended_transits".split(),
    *"phot_rp_n_contaminated_transits phot_rp_n_blended_transits phot_proc_mode bp_rp bp_g g_rp".split(),
    *"radial_velocity radial_velocity_error rv_method_used rv_nb_transits rv_nb_deblended_transits".split(),
    *"rv_visibility_periods_used rv_expected_sig_to_noise rv_renormalised_gof rv_chisq_pvalue rv_time_duration".split(),
    *"rv_amplitude_robust rv_template_teff rv_template_logg rv_template_fe_h rv_atm_param_origin".split(),
    *"vbroad vbroad_error vbroad_nb_transits grvs_mag grvs_mag_error grvs_mag_nb_transits rvs_spec_sig_to_noise".split(),
    *"phot_variable_flag l b ecl_lon ecl_lat in_qso_candidates in_galaxy_candidates non_single_star".split(),
    *"has_xp_continuous has_xp_sampled has_rvs has_epoch_photometry has_epoch_rv has_mcmc_gspphot has_mcmc_msc".split(),
    "in_andromeda_survey",
    *[f"classprob_dsc_combmod_{kind}" for kind in ["quasar", "galaxy", "star"]],
    *bounds(*[f"{name}_gspphot" for name in ["teff", "logg", "mh", "distance", "azero", "ag", "ebpminrp"]]),
    "libname_gspphot",
]
assert len(COLUMNS) == 152 and len(set(COLUMNS)) == 152, len(COLUMNS)
UNITS = {
    "ref_epoch": "yr", "ra": "deg", "dec": "deg", "parallax": "mas", "parallax_error": "mas", "pm": "mas.yr**-1",
    "pmra": "mas.yr**-1", "pmdec": "mas.yr**-1", "phot_g_mean_mag": "mag", "phot_g_mean_flux": "'electron'.s**-1",
    "bp_rp": "mag", "radial_velocity": "km.s**-1", "teff_gspphot": "K", "distance_gspphot": "pc", "l": "deg", "b": "deg",
}  # fmt: skip


def written(name, rows, **units):
    """Writes a file. A row gives the values of some columns; all others are null."""
    with gzip.open(folder / name, "wt", encoding="ascii", compresslevel=1) as file:
        file.write("# %ECSV 1.0\n# ---\n# delimiter: ','\n# datatype:\n")
        for column in COLUMNS:
            text = column in ("designation", "phot_variable_flag", "libname_gspphot")
            kind = "string" if text else "int64" if column.endswith("_id") else "float64"
            file.write(f"# -\n#   name: {column}\n#   datatype: {kind}\n")
            unit = {**UNITS, **units}.get(column)
            if unit:
                file.write(f"#   unit: {unit}\n")
            file.write(f"#   description: Synthetic values of {column}\n")
        file.write("# meta: !!omap\n# - RELEASE: Gaia DR3\n" + ",".join(COLUMNS) + "\n")
        for row in rows:
            file.write(",".join(str(row.get(column, "null")) for column in COLUMNS) + "\n")


random = np.random.default_rng(3)
count = 3000
ra, dec = random.uniform(0, 360, count), np.degrees(np.arcsin(random.uniform(-1, 1, count)))
g, bp_rp = random.uniform(9, 20.5, count), random.uniform(-0.3, 4, count)
pmra, pmdec = random.normal(0, 10, (2, count))
# Five stars are fast, 400 have no BP-RP, 500 have neither parallax nor motion, and 7 have no magnitude.
pmra[:5], pmdec[:5] = 900.0, -1200.0
without_colour, two_parameters, without_g = np.arange(1000, 1400), np.arange(1300, 1800), np.arange(2000, 2007)
rows = []
for i in range(count):
    row = {"solution_id": 1636148068921376768, "designation": f'"Gaia DR3 {i + 1}"', "source_id": i + 1, "ref_epoch": 2016.0}
    row |= {"ra": repr(float(ra[i])), "dec": repr(float(dec[i])), "phot_variable_flag": '"NOT_AVAILABLE"', "has_rvs": '"False"'}
    row |= {"phot_g_mean_mag": f"{g[i]:.6f}", "bp_rp": f"{bp_rp[i]:.6f}", "parallax": "0.25", "parallax_error": "0.3"}
    row |= {"pmra": repr(float(pmra[i])), "pmdec": repr(float(pmdec[i])), "pm": 12.6}
    rows.append(row)
for i in without_colour:
    del rows[i]["bp_rp"]
for i in two_parameters:
    for column in ["parallax", "parallax_error", "pmra", "pmdec", "pm"]:
        del rows[i][column]
for i in without_g:
    del rows[i]["phot_g_mean_mag"]
# The catalogue is divided into two files, like those of the archive.
written("GaiaSource_000000-003111.csv.gz", rows[:1500])
written("GaiaSource_003112-005263.csv.gz", rows[1500:])
files = sorted(path.name for path in folder.glob("GaiaSource_*.csv.gz"))
said = run(folder, "catalogue", "import", *files, "--memory", "256MiB", "--out", "gaia")
expect(
    said,
    "GaiaSource_000000-003111.csv.gz: 1500 stars, read as Gaia archive, DR3, 0 of 1500 rows rejected",
    "GaiaSource_003112-005263.csv.gz: 1493 stars, read as Gaia archive, DR3, 7 of 1500 rows rejected",
    "rejected: no brightness: 7, first: GaiaSource_003112-005263.csv.gz line ",
    "stars without BP-RP: G taken as V: 400",
    "or without one: distance by the prior: 2993",
    "wrote gaia: 2993 stars",
)
# Distances of GSP-Phot are not measured distances, so they are not stored. Only their column is reported as not stored.
unread = [line for line in said.splitlines() if line.startswith("not stored: the columns")]
assert unread == [f"not stored: the columns distance_gspphot of {file}" for file in files], said
expect(run(folder, "catalogue", "check", "gaia", "--light"), "all checksums are right")

# Every star is found at its position at the epoch of its layer, with V computed from G and BP-RP.
stars = exported(folder, "gaia")
found = directions(np.array([star["ra_deg"] for star in stars]), np.array([star["dec_deg"] for star in stars]))
used = np.setdiff1d(np.arange(count), without_g)
towards = directions(ra[used], dec[used])
nearest = np.array([int(np.argmax(towards @ one)) for one in found])
assert len(set(nearest)) == len(used) == len(stars)
which = used[nearest]
at_2016 = np.array([star["ref_epoch"] for star in stars]) == 2016.0
expected = towards[nearest]
# Bright and fast stars are stored at J2000.0, so move the expected positions back by 16 years, along a straight line.
moves = ~np.isin(which, two_parameters) & ~at_2016
east = np.stack([-np.sin(np.radians(ra[which])), np.cos(np.radians(ra[which])), np.zeros(len(which))], -1)
north = np.cross(expected, east)
mas = np.radians(1 / 3.6e6)
moved = expected - 16 * mas * (pmra[which][:, None] * east + pmdec[which][:, None] * north)
expected = np.where(moves[:, None], moved / np.linalg.norm(moved, axis=1)[:, None], expected)
off = angle_arcsec(found, expected)
v = np.where(np.isin(which, without_colour), g[which], v_of_gaia(g[which], bp_rp[which]))
off_v = np.abs(np.array([star["v_mag"] for star in stars]) - v)
limit = np.where(at_2016, np.select([v < 15, v < 17], [0.026, 0.013], 0.0064), 0.0123) + 0.0001
print(f"places: leaves {off[at_2016].max():.4f} arcsec, bright {off[~at_2016].max():.5f}; V: {off_v[at_2016].max():.4f}, "
      f"{off_v[~at_2016].max():.5f}; {len(stars)} stars")  # fmt: skip
assert (off < limit).all(), (off[off >= limit], which[off >= limit])
assert (off_v < np.where(at_2016, 0.0051, 0.0003)).all(), off_v.max()
assert (~at_2016 == ((v < 13) | (which < 5))).all()
# Without the motion, the fast stars would be 24 arcsec off.
fast = which < 5
assert fast.sum() == 5 and (angle_arcsec(found[fast], towards[nearest][fast]) > 20).all()

# Units in the header are read; a unit of a different quantity is refused.
written("GaiaSource_wrong.csv.gz", rows[:5], parallax="pc")
error = run(folder, "catalogue", "import", "GaiaSource_wrong.csv.gz", "--memory", "256MiB", "--out", "wrong", code=65)
expect(error, "parallax is in pc; it must be in mas")
