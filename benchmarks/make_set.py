"""Data sets that nobody tuned on: `python benchmarks/make_set.py [NAME ...] -o FOLDER`.

Six flights of the simulated wing in the format of `wing-sweep`, each with other trouble: oblique
loads, hidden markers, twist, a camera-gyro offset with late stamps, a swept wing with turned
sensors, three pods of which one dies.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from avionics.config import Camera, Config
from avionics.config.load import parse_config
from sim_bus.dataset import Blemishes, write_data_set
from sim_bus.wing.scenario import Scenario, parse_scenario

LEDS = [(0.58, 0.07, -0.012), (1.18, 0.07, -0.012), (1.5, 0.12, -0.008)]
EXTRA_MOCAP = [(0.06, 0.05, -0.006), (0.9, 0.05, -0.006)]
CAMERA = {
    "f_x_px": 604.3, "f_y_px": 603.1, "c_x_px": 322.4, "c_y_px": 236.8, "k1": -0.17, "k2": 0.06,
    "p1": 6e-4, "p2": -4e-4, "tilt_deg": -14.2, "pan_deg": 0.9, "roll_deg": -0.7,
    "r_in_body_m": (0.036, -0.011, -0.296), "fps": 30.0, "exposure_s": 0.006, "calibrated": True,
}  # fmt: skip
BAR = {"lit_bar": 55.0}
LIGHTS = [
    {"u_px": 88.0, "v_px": 62.0, "brightness": 0.9},
    {"u_px": 560.0, "v_px": 120.0, "brightness": 0.5},
]
RELEASE = {"kind": "force", "newtons": 7.0, "rise_s": 1.2, "for_s": 2.5}


def turned(axis: tuple[float, float, float], degrees: float) -> list[list[float]]:
    a, unit = np.radians(degrees), np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -unit[2], unit[1]], [unit[2], 0, -unit[0]], [-unit[1], unit[0], 0]])
    return (np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * k @ k).tolist()


def pair(places: list[tuple[float, float, float]], first: int = 0) -> list[dict[str, float]]:
    return [
        {"id": first + 2 * n + side, "s_m": s, "x_m": x if side == 0 else -x, "z_m": z}
        for n, (s, x, z) in enumerate(places)
        for side in (0, 1)
    ]


def wing(
    *,
    pods: list[dict],
    leds: list[tuple[float, float, float]] = LEDS,
    psi0_deg: float = 0.0,
    camera: dict | None = None,
    span_m: float = 1.5,
) -> Config:
    leds_all = pair(leds)
    return parse_config(
        {
            "wing": {"span_m": span_m, "psi0_deg": psi0_deg},
            "pods": pods,
            "markers": leds_all,
            "truth_markers": leds_all + pair(EXTRA_MOCAP, len(leds_all)),
            "camera": CAMERA | (camera or {}),
        },
        origin="benchmarks/make_set.py",
    )


TWO_PODS = [{"id": 0, "s_m": 0.58125}, {"id": 1, "s_m": 1.18125}]
Recipe = tuple[Config, dict, Blemishes]


def oblique() -> Recipe:
    """Tip pulled obliquely, chordwise and in twist: strong in-plane bending."""
    loads = [
        {"kind": "sweep", "at_s": 6, "for_s": 40, "from_hz": 0.25, "to_hz": 4.0,
         "amplitude_m": 0.4, "direction": (0.35, 0.0, 1.0), "side_n": 9.0, "torque_nm": 0.3},
        RELEASE | {"at_s": 49, "direction": (0.8, 0.0, 1.0)},
        RELEASE | {"at_s": 54, "direction": (-0.9, 0.0, 0.6)},
    ]  # fmt: skip
    return (
        wing(pods=TWO_PODS),
        {"loads": loads, "wing": {"ei_in_n_m2": 110.0, "cg_aft_m": 0.012},
         "picture": BAR | {"false_lights": LIGHTS}},
        Blemishes(),
    )  # fmt: skip


def hidden() -> Recipe:
    """All markers gone for 0.8 s again and again, single ones for longer, lights that wander."""
    loads = [
        {"kind": "sweep", "at_s": 6, "for_s": 44, "from_hz": 0.2, "to_hz": 5.0,
         "amplitude_m": 0.45, "torque_nm": 1.1},
        RELEASE | {"at_s": 53},
    ]  # fmt: skip
    faults = [
        {"kind": "marker_hidden", "target": "camera", "at_s": at, "for_s": 0.8}
        for at in (14.0, 23.5, 31.2, 40.4, 54.3)
    ]
    faults += [
        {"kind": "marker_hidden", "target": "camera", "at_s": 17, "for_s": 4, "markers": [4, 5]},
        {"kind": "marker_hidden", "target": "camera", "at_s": 26, "for_s": 3, "markers": [0, 2, 4]},
        {"kind": "illumination", "target": "camera", "at_s": 20, "for_s": 9, "value": 2.4},
        {"kind": "illumination", "target": "camera", "at_s": 43, "for_s": 5, "value": 0.4},
    ]
    wander = [
        {"u_px": 320.0, "v_px": 300.0, "radius_u_px": 70.0, "radius_v_px": 110.0, "period_s": 9.0},
        {"u_px": 400.0, "v_px": 330.0, "radius_u_px": 25.0, "radius_v_px": 130.0,
         "period_s": 5.5, "brightness": 1.3, "at_s": 12.0, "for_s": 40.0},
    ]  # fmt: skip
    return (
        wing(pods=TWO_PODS),
        {"loads": loads, "faults": faults, "wing": {"gj_n_m2": 9.0, "bend_twist_n_m2": 1.5},
         "picture": BAR | {"false_lights": LIGHTS + wander}},
        Blemishes(),
    )  # fmt: skip


def twist() -> Recipe:
    """Soft in torsion, coupled, shaken by couples and gusts."""
    loads = [
        {"kind": "sweep", "at_s": 5, "for_s": 32, "from_hz": 0.3, "to_hz": 5.0,
         "amplitude_m": 0.32, "torque_nm": 1.8},
        {"kind": "force", "at_s": 39, "for_s": 8, "newtons": 2.5, "hz": 0.9, "torque_nm": 1.4},
        {"kind": "gust", "at_s": 48, "for_s": 12, "airspeed_m_s": 6.0, "sigma_m_s": 0.7,
         "peak_m_s": 2.0, "every_s": 3.0},
    ]  # fmt: skip
    return (
        wing(pods=TWO_PODS),
        {"loads": loads,
         "wing": {"gj_n_m2": 6.0, "bend_twist_n_m2": 2.0, "cg_aft_m": 0.015, "taper": 0.3},
         "picture": {"false_lights": LIGHTS}},
        Blemishes(),
    )  # fmt: skip


def offset() -> Recipe:
    """Camera stamps 37 ms late against the gyros, IMU rows always stamped late."""
    loads = [
        {"kind": "sweep", "at_s": 6, "for_s": 44, "from_hz": 0.2, "to_hz": 6.0},
        RELEASE | {"at_s": 53},
    ]
    return (
        wing(pods=TWO_PODS),
        {"loads": loads, "picture": BAR | {"time_offset_s": 0.037, "false_lights": LIGHTS}},
        Blemishes(jitter_s=1e-4, late_s=1.8e-3, dropped=0.02, gaps=5),
    )


def swept() -> Recipe:
    """Swept back by 20 deg, sensors turned in their housings, a camera far from its nominal."""
    pods = [
        {"id": 3, "s_m": 0.55, "R_sensor_from_local": turned((0, 0, 1), 90)},
        {"id": 7, "s_m": 1.25, "R_sensor_from_local": turned((0.3, 1, 0.2), -176.5)},
    ]
    loads = [
        {"kind": "sweep", "at_s": 6, "for_s": 42, "from_hz": 0.2, "to_hz": 5.0,
         "amplitude_m": 0.4, "torque_nm": 0.3},
        RELEASE | {"at_s": 51},
    ]  # fmt: skip
    return (
        wing(pods=pods, psi0_deg=20.0, camera={"pan_deg": 18.3, "tilt_deg": -15.1}),
        {"loads": loads, "picture": BAR | {"false_lights": LIGHTS}},
        Blemishes(),
    )


def threepods() -> Recipe:
    """Three pods and eight markers; the outer pod dies for 15 s, gusts, releases."""
    pods = [{"id": 0, "s_m": 0.4}, {"id": 1, "s_m": 0.9}, {"id": 2, "s_m": 1.35}]
    leds = [(0.4, 0.08, -0.012), (0.8, 0.07, -0.012), (1.2, 0.06, -0.012), (1.5, 0.1, -0.008)]
    loads = [
        {"kind": "gust", "at_s": 5, "for_s": 25, "airspeed_m_s": 10.0, "sigma_m_s": 0.7,
         "peak_m_s": 1.6, "every_s": 4.0},
        RELEASE | {"at_s": 32},
        RELEASE | {"at_s": 37, "direction": (0.4, 0.0, 1.0)},
        {"kind": "sweep", "at_s": 43, "for_s": 15, "from_hz": 1.0, "to_hz": 4.0,
         "amplitude_m": 0.25},
    ]  # fmt: skip
    return (
        wing(pods=pods, leds=leds),
        {"loads": loads, "picture": BAR | {"false_lights": LIGHTS}},
        Blemishes(lost={2: (20.0, 35.0)}),
    )


RECIPES = {r.__name__: r for r in (oblique, hidden, twist, offset, swept, threepods)}


def nominal(true: Camera, rng: np.random.Generator) -> Camera:
    """The camera as a ruler, a protractor and the data sheet have it."""
    sign = rng.choice([-1.0, 1.0], 7)
    shift = sign[:3] * rng.uniform(0.006, 0.012, 3)
    focal = float(round(true.f_x_px * (1 + 0.025 * sign[3])))
    return true.model_copy(
        update={
            "f_x_px": focal, "f_y_px": focal, "c_x_px": (true.width_px - 1) / 2,
            "c_y_px": (true.height_px - 1) / 2, "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0,
            "tilt_deg": round(float(true.tilt_deg + 1.7 * sign[4]), 1),
            "pan_deg": round(float(true.pan_deg + 0.9 * sign[5]), 1),
            "roll_deg": round(float(true.roll_deg + 0.8 * sign[6]), 1),
            "r_in_body_m": tuple(
                round(float(a + b), 2) for a, b in zip(true.r_in_body_m, shift, strict=True)
            ),
            "calibrated": False,
        }
    )  # fmt: skip


def make(name: str, folder: Path, seed: int, duration_s: float | None) -> None:
    config, tables, blemishes = RECIPES[name]()
    scenario: Scenario = parse_scenario(
        {"name": name, "duration_s": 60.0} | tables, origin=f"benchmarks/make_set.py {name}"
    )
    if duration_s is not None:
        scenario = scenario.model_copy(update={"duration_s": duration_s})
    assert config.camera is not None
    write_data_set(
        folder / name, config, scenario, seed=seed, blemishes=blemishes,
        nominal=nominal(config.camera, np.random.default_rng(seed)),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(RECIPES))
    parser.add_argument("-o", "--output", type=Path, default=Path("sets"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--duration", type=float, default=None, metavar="S")
    arguments = parser.parse_args()
    for name in arguments.names or list(RECIPES):
        start = time.perf_counter()
        make(name, arguments.output, arguments.seed, arguments.duration)
        print(f"{arguments.output / name}: {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
