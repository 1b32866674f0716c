"""What every source of IMU samples does, whatever the bus."""

import itertools

import numpy as np
import pytest

from drivers.bno055.registers import Mode
from drivers.bno055.settings import Settings
from drivers.errors import DeviceNotFoundError
from tests.drivers.wing_bench import LAG_NS, NOISELESS, SECOND, Swing

BUSES = ("i2c", "uart", "can")
RAW = Settings(mode=Mode.GYRONLY)


def rate_error(samples) -> np.ndarray:
    """Sampled against true rate about x, the chip's low-pass delay and its hold taken out."""
    t_ns = np.array([s.t_ns for s in samples])
    found = np.array([s.rate_rad_s[0] for s in samples])
    # A polled register is up to one latch old; at 12.6 rad/s^2 that is the bound on the error.
    return found - Swing.rate(t_ns - LAG_NS - 5_000_000)


@pytest.mark.parametrize("bus", BUSES)
class TestImuContract:
    def test_samples_come_at_100_hz_with_unbroken_numbers(self, bench, bus) -> None:
        one = bench(bus, settings=RAW)
        one.imus.open()
        one.fly(0.5)
        samples = one.fly(2.0)
        assert len(samples) == pytest.approx(200, abs=2)
        assert {s.seq for s in samples} == set(range(samples[0].seq, samples[-1].seq + 1))
        assert all(b.t_ns > a.t_ns for a, b in itertools.pairwise(samples))

    def test_rates_and_times_agree_with_the_motion(self, bench, bus) -> None:
        one = bench(bus, settings=RAW)
        one.imus.open()
        one.fly(0.5)
        samples = one.fly(3.0)
        # 5 ms of unknown age at 4 pi rad/s^2, and the noise.
        assert np.abs(rate_error(samples)).max() < 4 * np.pi * 0.006 + 0.01
        assert np.mean([s.rate_rad_s[2] for s in samples]) == pytest.approx(-0.3, abs=1e-3)

    @pytest.mark.parametrize(
        ("mode", "bandwidth_hz"),
        [(Mode.GYRONLY, 230), (Mode.GYRONLY, 32), (Mode.AMG, 47), (Mode.NDOF, 230)],
    )
    def test_rates_are_as_old_as_the_chip_says(self, bench, bus, mode, bandwidth_hz) -> None:
        settings = Settings(mode=mode, gyro_bandwidth_hz=bandwidth_hz)
        one = bench(bus, settings=settings, grade=NOISELESS)
        one.imus.open()
        one.fly(0.5)
        samples = one.fly(3.0)
        t_ns = np.array([s.t_ns for s in samples])
        found = np.array([s.rate_rad_s[0] for s in samples])
        ages_s = np.arange(0.0, 0.025, 0.0005)
        missed = [np.std(found - Swing.rate(t_ns - age * 1e9)) for age in ages_s]
        age_s = ages_s[np.argmin(missed)]
        delay = settings.delay
        # On one pass the reads stand at one phase to the register, anywhere in its period.
        assert abs(age_s - delay.mean_s) < delay.spread_s + 0.001

    @pytest.mark.parametrize(
        ("mode", "range_dps"),
        [(Mode.GYRONLY, 2000), (Mode.GYRONLY, 250), (Mode.AMG, 1000), (Mode.NDOF, 2000)],
    )
    def test_scale_follows_mode_and_range(self, bench, bus, mode, range_dps) -> None:
        one = bench(bus, settings=Settings(mode=mode, gyro_range_dps=range_dps), grade=NOISELESS)
        one.imus.open()
        one.fly(1.0)
        samples = one.fly(0.3)
        lsb = np.radians(1 / 16 if mode.is_fusion else range_dps / 32768)
        assert one.chips[0].gyro_rad_s_per_lsb == pytest.approx(lsb)
        for sample in samples:
            # -0.3 rad/s holds still on z, so that only rounding is left.
            assert sample.rate_rad_s[2] == pytest.approx(-0.3, abs=0.51 * lsb)

    def test_force_and_flux_come_where_the_mode_has_them(self, bench, bus) -> None:
        one = bench(bus, settings=Settings(mode=Mode.AMG))
        one.imus.open()
        one.fly(1.0)
        sample = one.fly(0.1)[-1]
        assert sample.specific_force_m_s2 == pytest.approx([0, 0, 9.81], abs=0.6)
        assert sample.magnetic_flux_t == pytest.approx([2e-5, 0, 4e-5], abs=3e-5)
        two = bench(bus, settings=RAW, seed=2)
        two.imus.open()
        two.fly(1.0)
        assert two.fly(0.1)[-1].specific_force_m_s2 is None

    def test_read_with_zero_timeout_returns_at_once(self, bench, bus) -> None:
        one = bench(bus, settings=RAW)
        one.imus.open()
        one.fly(0.5)
        while one.imus.read(0) is not None:
            pass
        before_ns = one.clock.now_ns()
        assert one.imus.read(0) is None
        assert one.clock.now_ns() == before_ns

    def test_brown_out_in_flight_is_healed_and_counted(self, bench, bus) -> None:
        # GIVEN a chip in flight WHEN it browns out THEN it is set up again within 1.5 s
        one = bench(bus, settings=RAW)
        one.imus.open()
        one.fly(1.0)
        one.fault("brown_out", 0, 0.0, 0.001)
        start_ns = one.clock.now_ns()
        samples = one.fly(4.0)
        late = [s for s in samples if s.t_ns > start_ns + 1.5 * SECOND]
        assert len(late) == pytest.approx(250, abs=6)
        assert np.abs(rate_error(late)).max() < 4 * np.pi * 0.006 + 0.01
        assert any(e.level == "warning" for e in one.imus.take_events())

    def test_close_may_be_called_twice(self, bench, bus) -> None:
        one = bench(bus)
        one.imus.close()
        one.imus.close()
        assert one.imus.read(0) is None


@pytest.mark.parametrize("bus", ["i2c", "uart"])
def test_wrong_chip_is_named_with_what_was_found(bench, bus) -> None:
    one = bench(bus)
    one.chips[0]._pages[0][0] = 0x00
    with pytest.raises(DeviceNotFoundError, match=r"pod 0: chip id 0x00, expected 0xA0"):
        one.imus.open()


def test_absent_pod_is_named(bench) -> None:
    one = bench("can")
    one.fault("pod_silent", 0, 0.0, 100.0)
    with pytest.raises(DeviceNotFoundError, match=r"pod 0: no frame from node 0 within 2\.0 s"):
        one.imus.open()


def test_failed_self_test_is_named(bench, monkeypatch) -> None:
    one = bench("i2c")
    honest = one.chips[0].read

    def read(register, length, t_ns):
        return b"\x0b" if register == 0x36 else honest(register, length, t_ns)

    monkeypatch.setattr(one.chips[0], "read", read)
    with pytest.raises(DeviceNotFoundError, match=r"self-test 0x0B, expected 0x0F \(gyroscope"):
        one.imus.open()
