"""GIVEN reads at irregular times WHEN a sample enters the estimator THEN its time is true."""

import numpy as np
import pytest

from avionics.config import Estimator, Pod, RootImu
from avionics.config.chips import Bno055Settings
from avionics.config.links import CanLink, I2cLink, UartLink
from avionics.flight.health import HealthLog
from avionics.flight.imu_channel import ImuChannel
from drivers.samples import ImuSample
from tests.avionics.wse.flight import ListSink

PERIOD_NS = 10_000_000
SECOND_NS = 1_000_000_000
# A host that is busy polls late, never early.
LATE_NS = np.random.default_rng(3).exponential(2.5e6, 600).clip(0, 8e6).astype(int)
READS_NS = 7_000_000_000 + np.arange(600) * PERIOD_NS + LATE_NS


def used_times_ns(pod: Pod) -> np.ndarray:
    """When the estimator takes late reads for true, without the chip's own lag."""
    channel = ImuChannel(
        "pod 0", pod, Estimator(), is_mirrored=False, health=HealthLog(ListSink())
    )  # fmt: skip
    lag_s = pod.chip.delay.mean_s
    used = []
    for seq, t_ns in enumerate(READS_NS.tolist()):
        rate = np.array([1e-3 * np.sin(seq), 0.0, 0.0])
        taken = channel.take(ImuSample(t_ns, "0", seq, rate), t_ns)
        assert taken is not None
        used.append(taken[0] + round(1e9 * lag_s))
    return np.array(used)


@pytest.mark.parametrize(
    "link", [I2cLink(), UartLink(kind="uart", port="/dev/ttyX"), CanLink(kind="can")]
)
def test_our_drivers_stamps_are_believed(link) -> None:
    assert used_times_ns(Pod(id=0, s_m=1.0, link=link)) == pytest.approx(READS_NS, abs=2)


def test_a_data_sets_late_stamps_are_of_a_regular_clock() -> None:
    used = used_times_ns(Pod(id=0, s_m=1.0))
    late_ns = (used - (READS_NS - LATE_NS))[200:]
    assert np.abs(late_ns).max() < 0.25 * LATE_NS.mean()


def low_pass_s(bandwidth_hz: float) -> float:
    return float(np.sqrt(2)) / (2 * np.pi * bandwidth_hz)


@pytest.mark.parametrize(
    ("mode", "bandwidth_hz", "lag", "age_s"),
    [
        ("amg", 32, "auto", low_pass_s(32) + 0.5 / 100),
        ("gyronly", 230, "auto", low_pass_s(230) + 0.5 / 2000),
        ("gyronly", 230, "filter", low_pass_s(230)),
        # The chip fuses at 32 Hz and 100 values a second, whatever is configured (Table 3-14).
        ("ndof", 230, "auto", low_pass_s(32) + 0.5 / 100),
        ("ndof", 230, "filter", low_pass_s(32)),
        ("imu", 523, "auto", low_pass_s(32) + 0.5 / 100),
    ],
)
def test_a_rate_is_as_old_as_its_mode_makes_it(mode, bandwidth_hz, lag, age_s) -> None:
    pod = Pod(
        id=0,
        s_m=1.0,
        link=I2cLink(),
        chip=Bno055Settings(mode=mode, gyro_bandwidth_hz=bandwidth_hz),
    )
    channel = ImuChannel(
        "pod 0", pod, Estimator(gyro_lag_s=lag), is_mirrored=False, health=HealthLog(ListSink())
    )
    taken = channel.take(ImuSample(SECOND_NS, "0", 0, np.array([0.1, 0.0, 0.0])), SECOND_NS)
    assert taken is not None
    assert SECOND_NS - taken[0] == pytest.approx(1e9 * age_s, abs=2)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_the_roots_rates_are_turned_to_the_axes_of_the_wing(is_mirrored: bool) -> None:
    # GIVEN a sensor whose x axis points to the right and whose y axis points aft
    root = RootImu(R_sensor_from_body=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    channel = ImuChannel(
        "root", root, Estimator(), is_mirrored=is_mirrored, health=HealthLog(ListSink())
    )
    body = np.array([0.1, 0.2, 0.3])
    sensor = np.array([body[1], -body[0], body[2]])
    taken = channel.take(ImuSample(SECOND_NS, "root", 0, sensor), SECOND_NS)
    assert taken is not None
    # THEN a left wing's model, a mirror image, has x and z turned around.
    wanted = body * ([-1.0, 1.0, -1.0] if is_mirrored else [1.0, 1.0, 1.0])
    assert taken[1] == pytest.approx(wanted)
