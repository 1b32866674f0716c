"""A flight in a notebook: cells between ``# %%`` lines, for Jupyter, VS Code or Spyder.

As a program: ``.venv/bin/python examples/notebook.py out/demo.mcap out/tip.png``
"""

# %% Read
import sys

import matplotlib as mpl
import numpy as np

from avionics import read_flight

path, picture = sys.argv[1:] if len(sys.argv) == 3 else ("out/demo.mcap", "out/tip.png")
flight = read_flight(path)
print(flight)

# %% A table: one row per estimate, units in the names
table = flight.table("estimate_crg").to_pandas()
print(table.filter(like="tip").describe())

# %% How far is the tip off, and does the filter know it?
crg, truth = flight.estimates["crg"], flight.truth
true_z = np.interp(crg.t_ns, truth.t_ns, truth.tip_in_body_m[:, 2])
error_mm = 1e3 * (crg.tip_in_body_m[:, 2] - true_z)
sigma_mm = 1e3 * crg.tip_sigma_m[:, 2]
settled = crg.t_s > 1.0
inside = np.abs(error_mm) < 2.0 * sigma_mm
print(f"error {np.std(error_mm[settled]):.2f} mm, within two sigmas {inside[settled].mean():.0%}")

# %% Plot it
mpl.use("agg")
import matplotlib.pyplot as plt  # noqa: E402 (after the backend)

figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(9, 5))
above.plot(crg.t_s, -crg.tip_in_body_m[:, 2], label="CRG-WSE")
above.plot(truth.t_s, -truth.tip_in_body_m[:, 2], "k:", label="truth")
above.set_ylabel("tip height, m")
above.legend()
below.fill_between(crg.t_s, -2 * sigma_mm, 2 * sigma_mm, alpha=0.3, label="two sigmas")
below.plot(crg.t_s, error_mm, lw=0.8, label="error")
below.set_ylabel("error, mm")
below.set_ylim(-15.0, 15.0)
below.set_xlabel("time, s")
below.legend()
figure.savefig(picture)
