"""Figures of the simulated wing: `python benchmarks/beam.py [--pazy FOLDER]`.

Large deflection against the elastica, frequencies against Euler-Bernoulli, the measured Pazy
curve, and the time that a minute of flight takes.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import tomllib
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from avionics.config.load import default_config_text, parse_config
from sim_bus.wing.beam import Beam
from sim_bus.wing.build import make_wing
from sim_bus.wing.pazy import measured_sweep, pazy_beam, static_sweep
from sim_bus.wing.scenario import load_scenario
from sim_bus.wing.uniform_beam import uniform_beam

SPAN_M, EI, MASS_PER_M = 1.5, 6.0, 0.4
PAZY = Path(__file__).resolve().parents[2] / "shared" / "data" / "real" / "pazy-wing"
AUTHORS = "the authors' own beam code: 0.14 and 3.84"


def uniform(elements: int) -> Beam:
    return uniform_beam(
        span_m=SPAN_M, elements=elements, mass_per_m=MASS_PER_M, ei_out_n_m2=EI,
        ei_in_n_m2=3000.0, gj_n_m2=5.0, ea_n=1e6, chord_m=0.02,
    )  # fmt: skip


def elastica(load: float) -> tuple[float, float, float]:
    def modulus(slope: float) -> tuple[float, float]:
        p = np.sqrt((1 + np.sin(slope)) / 2)
        return p * p, np.arcsin(1 / (p * np.sqrt(2)))

    def miss(slope: float) -> float:
        m, start = modulus(slope)
        return ellipk(m) - ellipkinc(start, m) - np.sqrt(load)

    slope = brentq(miss, 1e-9, np.pi / 2 - 1e-9, xtol=1e-14)
    m, start = modulus(slope)
    down = 1 - 2 / np.sqrt(load) * (ellipe(m) - ellipeinc(start, m))
    return slope, down, np.sqrt(2 * np.sin(slope) / load)


def show_elastica() -> None:
    print("tip force P against the elastica: error of slope, deflection, reach, % of each")
    print("P L^2/EI   slope deg   16 elements             24                      48")
    for load in (0.5, 1.5, 2.5, 3.5):
        wanted = np.array(elastica(load))
        columns = []
        for count in (16, 24, 48):
            beam = uniform(count)
            strain = beam.static(beam.drive(tip_force_n=(0.0, 0.0, load * EI / SPAN_M**2)))
            place, frames = beam.shape(strain, np.array([SPAN_M]))
            slope = np.arctan2(frames[0, 2, 1], frames[0, 1, 1])
            found = np.array([slope, place[0, 2] / SPAN_M, place[0, 1] / SPAN_M])
            columns.append(" ".join(f"{x:+7.3f}" for x in 100 * (found / wanted - 1)))
        print(f"{load:8.1f}   {np.degrees(wanted[0]):9.2f}   {' '.join(columns)}")


def show_frequencies() -> None:
    roots = np.array([1.87510407, 4.69409113, 7.85475744])
    wanted = roots**2 / (2 * np.pi * SPAN_M**2) * np.sqrt(EI / MASS_PER_M)
    print(f"\nfirst three frequencies, Euler-Bernoulli {wanted.round(4)} Hz; error, %")
    for count in (16, 24, 48):
        beam = uniform(count)
        found = beam.frequencies_hz(beam.static(beam.drive()), beam.drive())
        nearest = np.array([found[np.argmin(abs(found - f))] for f in wanted])
        print(f"{count:3d} elements: {(100 * (nearest / wanted - 1)).round(3)}")


def show_pazy(folder: Path) -> None:
    if not folder.is_dir():
        print(f"\n{folder} is absent: no Pazy figures")
        return
    measured = measured_sweep(folder)
    found = static_sweep(pazy_beam(folder), measured[:, 0])
    miss = found - measured[:, 1]
    print("\nPazy wing (Avin et al., 2022; Riso and Cesnik, 2022): tip mass kg, measured and")
    print("found displacement, difference, % of semispan")
    for (mass, wanted), value, error in zip(measured, found, miss, strict=True):
        print(f"{mass:4.1f} {wanted:9.3f} {value:9.3f} {error:+7.3f}")
    light = measured[:, 0] <= 0.8
    worst = np.abs(miss[light]).max(), np.abs(miss).max()
    print(f"largest to 0.8 kg {worst[0]:.2f}, in all {worst[1]:.2f} ({AUTHORS})")


def show_speed() -> None:
    config = parse_config(tomllib.loads(default_config_text()), origin="packaged")
    wing = make_wing(config, load_scenario("default"), rng=np.random.default_rng(0))
    wing.truth(10**9)  # compiled and warm
    start = time.process_time()
    for second in range(2, 61):
        wing.truth(second * 10**9)
    spent = time.process_time() - start
    print(f"\n59 s of the default flight: {spent:.1f} s of processor time, {59 / spent:.0f} x")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pazy", type=Path, default=PAZY)
    folder = parser.parse_args().pazy
    show_elastica()
    show_frequencies()
    show_pazy(folder)
    show_speed()


if __name__ == "__main__":
    main()
