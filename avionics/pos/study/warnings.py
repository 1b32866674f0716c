"""Warnings that belong beside the results of a distributed-POS study."""

from collections.abc import Iterator

import numpy as np
from scipy.stats import chi2

from avionics.pos.study.results import AXES, QUANTITY_NAMES, quantities_of
from avionics.pos.study.runs import Study

CHANCE = 0.999
"""A ratio that honest filters exceed in one table of a thousand is called a fault."""
DIVERGED_DEG = 5.0
DIVERGED_SIGMAS = 10.0
"""Beyond both a filter has diverged: the models are for angles of a degree or so."""


def warnings(study: Study) -> Iterator[str]:
    """Yield what a reader must not overlook: sigmas that are too small, and divergence.

    Within a run the error hardly changes, so each run counts as one draw.
    """
    limit = float(np.sqrt(chi2.ppf(CHANCE, len(study.seeds)) / len(study.seeds)))
    for line in study.lines:
        for quantity in quantities_of(study.spec):
            ratio = line.consistency(quantity)
            bad = [
                f"{axis} {value:.1f}"
                for axis, value in zip(AXES, ratio, strict=True)
                if np.isfinite(value) and value > limit
            ]
            if bad:
                yield (
                    f"{line.method}, {line.scenario}: the {QUANTITY_NAMES[quantity]} is wrong by "
                    f"more than the filter knows, error / own sigma = {', '.join(bad)} (chance "
                    f"allows {limit:.1f}). Do not use its covariance there."
                )
    yield from _diverged(study)


def _diverged(study: Study) -> Iterator[str]:
    """Yield one text on each method that lost its way, the changes of the profile included."""
    lines = [(line.scenario, line) for line in study.lines]
    lines += [(f"with {name}", line) for name, made in study.changes.items() for line in made]
    found: dict[str, list[str]] = {}
    for where, line in lines:
        rmse_deg, ratio = np.rad2deg(line.mean("rmse")), line.consistency()
        lost = [
            f"{axis} {value:.0f}"
            for axis, value, by_sigma in zip(AXES, rmse_deg, ratio, strict=True)
            if not (value <= DIVERGED_DEG or by_sigma <= DIVERGED_SIGMAS)
        ]
        if lost:
            found.setdefault(line.method, []).append(f"{where} {', '.join(lost)}")
    for method, places in found.items():
        yield (
            f"{method} diverged, RMSE of the system error angle in degrees: {'; '.join(places)}. "
            "These figures are no accuracy, and their digits mean nothing."
        )
