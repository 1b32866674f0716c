"""Two wings behind one root: what the sources of one rig deliver of each."""

import numpy as np
import pytest

from avionics.config import FlightConfig
from avionics.config.load import parse_config
from avionics.records import Truth
from drivers.samples import Frame, ImuSample
from sim_bus.buses.faults import Fault
from sim_bus.rig import EPOCH_NS, SimRig, open_sim_rig
from sim_bus.wing.scenario import Scenario, parse_scenario

pytestmark = pytest.mark.slow

LENS = {"f_x_px": 150.0, "f_y_px": 150.0, "c_x_px": 79.5, "c_y_px": 59.5, "width_px": 160,
        "height_px": 120, "tilt_deg": -14.0}  # fmt: skip


def two_wings() -> FlightConfig:
    wings = [
        {
            "name": name, "side": name, "span_m": 1.5,
            "pods": [{"id": pod, "s_m": 1.2, "link": {"kind": "i2c", "bus": pod}}],
            "markers": [{"id": 0, "s_m": 1.5}],
            "camera": {"name": name, "pan_deg": pan, "r_in_body_m": [0, y, -0.3], **LENS},
        }
        for name, pod, pan, y in (("left", 1, 180.0, 0.02), ("right", 2, 0.0, -0.02))
    ]  # fmt: skip
    return parse_config({"wings": wings}, origin="test")


def scenario(**tables: object) -> Scenario:
    roll = {"axis": "roll", "amplitude": 15.0, "hz": 0.5, "at_s": 0.0, "fade_s": 0.3}
    gust = {"kind": "gust", "at_s": 0.0, "for_s": 9.0, "sigma_m_s": 1.0}
    return parse_scenario({"name": "test", "root": [roll], "loads": [gust], **tables}, origin="t")


def fly(rig: SimRig, seconds: float) -> list:
    found: list = []
    for _ in range(round(seconds * 1000)):
        rig.clock.advance(1_000_000)
        for source in (*rig.imus, *rig.cameras, rig.truth):
            while (record := source.read(0)) is not None:
                found.append(record)
    return found


@pytest.fixture(scope="module")
def flown() -> list:
    dead = {"kind": "camera_dead", "target": "camera left", "at_s": 1.5}
    with open_sim_rig(two_wings(), scenario(faults=[dead]), seed=4) as rig:
        return fly(rig, 2.0)


def test_truth_of_the_wings_comes_side_by_side(flown: list) -> None:
    truths = [record for record in flown if isinstance(record, Truth)]
    left, right = truths[0::2], truths[1::2]
    assert [t.t_ns for t in left] == [t.t_ns for t in right]
    assert {t.wing for t in left} == {"left"}
    assert all(t.line_in_body_m[-1, 1] < -1.3 for t in left)
    assert all(t.line_in_body_m[-1, 1] > 1.3 for t in right)


def test_one_root_rolls_both_and_each_meets_its_own_turbulence(flown: list) -> None:
    samples = [record for record in flown if isinstance(record, ImuSample)]
    roll = np.array([sample.rate_rad_s[0] for sample in samples if sample.pod == "root"])
    # 15 deg at 0.5 Hz are 47 deg/s once the roll has faded in.
    assert np.degrees(np.abs(roll[50:]).max()) == pytest.approx(47.1, abs=1.5)
    truths = [record for record in flown if isinstance(record, Truth)]
    left, right = (np.array([t.phi_rad[-1] for t in truths[first::2]]) for first in (0, 1))
    # What the roll bends up on one side it bends down on the other; the turbulence is no mirror.
    assert np.corrcoef(left, right)[0, 1] < -0.5
    assert np.abs((left - left[0]) + (right - right[0])).max() > 0.02


def test_each_camera_sees_its_own_wing(flown: list) -> None:
    for name in ("left", "right"):
        frames = [r for r in flown if isinstance(r, Frame) and r.camera == name]
        assert len(frames) > 35
        assert frames[20].image.max() > 150


def test_a_fault_is_for_one_camera_or_for_all(flown: list) -> None:
    stamps = {
        name: [r.t_ns for r in flown if isinstance(r, Frame) and r.camera == name]
        for name in ("left", "right")
    }
    assert max(stamps["left"]) < EPOCH_NS + 1.5e9 < max(stamps["right"])
    of_all, of_one = (Fault("camera_dead", target, 0, 1) for target in ("camera", "camera left"))
    assert of_all.is_for("camera left")
    assert of_all.is_for("camera")
    assert not of_one.is_for("camera right")
    assert not Fault("nak", "pod 1", 0, 1).is_for("pod 10")
