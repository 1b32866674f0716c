from pathlib import Path

import numpy as np
import pytest

from avionics.config import Config
from avionics.config.load import default_config_text, parse_config
from avionics.records import Event, Health, MarkerTracks, Truth, WingShapeEstimate
from avionics.topics import Record
from drivers.samples import Frame, ImuSample

try:
    import tomllib
except ModuleNotFoundError:
    import tomli as tomllib


@pytest.fixture(scope="session")
def config() -> Config:
    return parse_config(tomllib.loads(default_config_text()), origin="default.toml")


def make_records(rng: np.random.Generator) -> list[Record]:
    """One record of every type and shape, with NaN, infinities, empty and absent arrays."""
    t_ns = 1_234_567_890_123
    odd = np.array([np.nan, -0.0, 5e-324])
    full = WingShapeEstimate(
        t_ns=t_ns + 4,
        wing="right",
        kind="crg",
        basis="quarter-sine/3+1+1",
        phi_rad=rng.normal(size=3),
        theta_rad=rng.normal(size=1),
        psi_rad=rng.normal(size=1),
        phi_sigma_rad=np.full(3, np.nan),
        theta_sigma_rad=rng.normal(size=1),
        psi_sigma_rad=rng.normal(size=1),
        bias_rad_s=rng.normal(size=(2, 3)),
        bias_sigma_rad_s=np.full((2, 3), np.nan),
        line_in_body_m=np.cumsum(rng.normal(size=(21, 3)) * 0.01, axis=0),
        tip_sigma_m=odd,
        marker_px=rng.normal(size=(6, 2)) * 100,
        marker_sigma_px=np.full((6, 2), np.nan),
        nis=float("nan"),
        used=np.array([True, False, True, True, False, True]),
        covariance=rng.normal(size=(11, 11)),
    )
    bare = WingShapeEstimate(
        t_ns=t_ns + 5,
        wing="right",
        kind="rg",
        basis="quarter-sine/1+0+0",
        phi_rad=rng.normal(size=1),
        theta_rad=np.empty(0),
        psi_rad=np.empty(0),
        phi_sigma_rad=rng.normal(size=1),
        theta_sigma_rad=np.empty(0),
        psi_sigma_rad=np.empty(0),
        bias_rad_s=np.empty((0, 3)),
        bias_sigma_rad_s=np.empty((0, 3)),
        line_in_body_m=rng.normal(size=(21, 3)),
        tip_sigma_m=np.full(3, np.inf),
        marker_px=np.empty((0, 2)),
        marker_sigma_px=np.empty((0, 2)),
        nis=0.7,
        used=np.empty(0, dtype=bool),
    )
    return [
        ImuSample(t_ns, "0", 7, rng.normal(size=3)),
        ImuSample(t_ns + 1, "root", 2**40, odd, rng.normal(size=3), rng.normal(size=3)),
        Frame(t_ns + 2, "root", 41, rng.integers(0, 256, (48, 64), dtype=np.uint8)),
        MarkerTracks(
            t_ns + 3,
            "root",
            41,
            np.array([[1.5, 2.25], [np.nan, np.nan]]),
            np.array([0.1, np.nan]),
            np.array([True, False]),
            "led",
        ),
        full,
        bare,
        Truth(t_ns + 6, "right", "mocap", rng.normal(size=(10, 3))),
        Truth(
            t_ns + 7,
            "right",
            "sim",
            np.empty((0, 3)),
            rng.normal(size=(21, 3)),
            *rng.normal(size=(3, 21)),
        ),
        Health(t_ns + 8, "can0", {"frames": 12345678901, "bus_off": 0}),
        Event(t_ns + 9, "pod 1", "warning", "silent for 0.2 s — going on without it"),
        Event(-5, "estimator", "info", "started"),
    ]


@pytest.fixture
def one_of_each() -> list[Record]:
    return make_records(np.random.default_rng(7))


@pytest.fixture
def log_path(tmp_path: Path) -> Path:
    return tmp_path / "flight.mcap"
