"""The real driver of the ICM-42688-P on the simulated wing: what it reads is what the wing did."""

import numpy as np
import pytest

from avionics.config.load import parse_config
from sim_bus.rig import open_sim_rig
from tests.sim_bus.test_rig import CLEAN, fly, scenario

pytestmark = pytest.mark.slow

ICM = {"kind": "icm42688"}
SPI = {"kind": "spi", "bus": 0, "device": 0}
I2C = {"kind": "i2c", "bus": 1, "address": 0x68}
MUX = {**I2C, "mux_address": 0x70, "mux_channel": 3}


def config(*pods):
    tables = [{"id": n, "s_m": 0.6 + 0.3 * n, **pod} for n, pod in enumerate(pods)]
    return parse_config({"wing": {"span_m": 1.5}, "pods": tables}, origin="test")


@pytest.mark.parametrize("link", [SPI, I2C, MUX], ids=["spi", "i2c", "mux"])
@pytest.mark.parametrize(
    "more", [{}, {"data_hz": 200, "filter_order": 1, "gyro_bandwidth_hz": 44}], ids=["fast", "slow"]
)
def test_driver_reads_the_wings_rates_as_old_as_it_says(link, more) -> None:
    flown = config({"link": link, "chip": {**ICM, **more}})
    with open_sim_rig(flown, scenario(), seed=2) as rig:
        samples = fly(rig, 3.0)
        assert len(samples) == pytest.approx(300, abs=2)
        t_ns = np.array([s.t_ns for s in samples])
        rates = np.array([s.rate_rad_s for s in samples])
        age_ns = round(1e9 * flown.pods[0].chip.delay.mean_s)
        true = rig.wing.stations(t_ns - age_ns, np.array([0.6])).rate_rad_s[:, 0]
        assert np.abs(true).max() > 0.5
        # 0.1 deg/s of noise; half a period of the register at 4 rad/s^2 is 0.6 deg/s at 200 Hz.
        spread_dps = np.degrees(4.0 * flown.pods[0].chip.delay.spread_s)
        missed_dps = np.degrees(np.sqrt(np.mean((rates - true) ** 2, axis=0))).max()
        assert missed_dps < 0.12 + spread_dps
        assert rig.chips["0"].violations == []


def test_pod_without_a_link_is_at_the_chips_own_address() -> None:
    with open_sim_rig(config({"chip": ICM}), scenario(), seed=2) as rig:
        assert len(fly(rig, 0.5)) > 45


def test_two_kinds_of_chip_share_a_bus() -> None:
    pods = config(
        {"link": {"kind": "i2c", "bus": 1, "address": 0x28}},
        {"link": I2C, "chip": ICM},
        {"link": SPI, "chip": ICM},
    )
    with open_sim_rig(pods, scenario()) as rig:
        assert len(rig.imus) == 2
        counts = dict.fromkeys(pods.pod_names, 0)
        for sample in fly(rig, 1.0):
            counts[sample.pod] += 1
        assert all(97 <= n <= 101 for n in counts.values()), counts


@pytest.mark.parametrize(
    ("kind", "lost", "counter"),
    [("brown_out", 10, "all_ones"), ("spi_high", 50, "all_ones"), ("io_error", 50, "spi_io")],
)
def test_fault_in_flight_ends_and_the_pod_is_back(kind, lost, counter) -> None:
    fault = {"kind": kind, "target": "pod 0", "at_s": 0.5, "for_s": 0.3}
    flown = config({"link": SPI, "chip": ICM})
    with open_sim_rig(flown, scenario(faults=[fault], imu=CLEAN), seed=1) as rig:
        samples = fly(rig, 2.0)
        assert 200 - lost <= len(samples) < 200
        assert samples[-1].t_ns > rig.wing.epoch_ns + 1_980_000_000
        (health,) = rig.imus[0].health().values()
        assert health["reinitialised"] == 1
        assert health[counter] >= 1
