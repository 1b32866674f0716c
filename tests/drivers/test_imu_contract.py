"""What every source of IMU samples does, whatever the chip and the bus."""

import itertools

import numpy as np
import pytest

from drivers.errors import DeviceNotFoundError
from sim_bus.chip.kinds import KINDS
from tests.drivers.imu_cases import CASES, SETTINGS, ChipCase, each, name_of
from tests.drivers.wing_bench import NOISELESS, SECOND, Swing

# 4 pi rad/s^2 at most, a rate that is off by half a register's period and a millisecond, and noise.
ACCELERATION_RAD_S2 = 4 * np.pi
PLACES = [(case, bus) for case in CASES for bus in case.buses]


def rate_error(samples, chip) -> np.ndarray:
    """Sampled against true rate about x at the mean age that the chip states."""
    t_ns = np.array([s.t_ns for s in samples])
    found = np.array([s.rate_rad_s[0] for s in samples])
    return found - Swing.rate(t_ns - 1e9 * chip.delay.mean_s)


def bound_rad_s(chip) -> float:
    return ACCELERATION_RAD_S2 * (chip.delay.spread_s + 0.001) + 0.01


@pytest.mark.parametrize(("case", "bus"), PLACES, ids=[f"{c.name}-{b}" for c, b in PLACES])
class TestImuContract:
    def test_samples_come_at_100_hz_with_unbroken_numbers(self, bench, case, bus) -> None:
        one = bench(bus, chip=case.raw)
        one.imus.open()
        one.fly(0.5)
        samples = one.fly(2.0)
        assert len(samples) == pytest.approx(200, abs=2)
        assert {s.seq for s in samples} == set(range(samples[0].seq, samples[-1].seq + 1))
        assert all(b.t_ns > a.t_ns for a, b in itertools.pairwise(samples))

    def test_rates_and_times_agree_with_the_motion(self, bench, case, bus) -> None:
        one = bench(bus, chip=case.raw)
        one.imus.open()
        one.fly(0.5)
        samples = one.fly(3.0)
        assert np.abs(rate_error(samples, case.raw)).max() < bound_rad_s(case.raw)
        assert np.mean([s.rate_rad_s[2] for s in samples]) == pytest.approx(-0.3, abs=1e-3)

    def test_force_and_flux_come_where_the_mode_has_them(self, bench, case: ChipCase, bus) -> None:
        if case.whole is not None:
            one = bench(bus, chip=case.whole)
            one.imus.open()
            one.fly(1.0)
            sample = one.fly(0.1)[-1]
            assert sample.specific_force_m_s2 == pytest.approx([0, 0, 9.81], abs=0.6)
            if case.has_flux:
                assert sample.magnetic_flux_t == pytest.approx([2e-5, 0, 4e-5], abs=3e-5)
            else:
                assert sample.magnetic_flux_t is None
        two = bench(bus, chip=case.raw, seed=2)
        two.imus.open()
        two.fly(1.0)
        assert two.fly(0.1)[-1].specific_force_m_s2 is None

    def test_read_with_zero_timeout_returns_at_once(self, bench, case, bus) -> None:
        one = bench(bus, chip=case.raw)
        one.imus.open()
        one.fly(0.5)
        while one.imus.read(0) is not None:
            pass
        before_ns = one.clock.now_ns()
        assert one.imus.read(0) is None
        assert one.clock.now_ns() == before_ns

    def test_brown_out_in_flight_is_healed_and_counted(self, bench, case, bus) -> None:
        # GIVEN a chip in flight WHEN it browns out THEN it is set up again within 1.5 s
        one = bench(bus, chip=case.raw)
        one.imus.open()
        one.fly(1.0)
        one.fault("brown_out", 0, 0.0, 0.001)
        start_ns = one.clock.now_ns()
        samples = one.fly(4.0)
        late = [s for s in samples if s.t_ns > start_ns + 1.5 * SECOND]
        assert len(late) == pytest.approx(250, abs=6)
        assert np.abs(rate_error(late, case.raw)).max() < bound_rad_s(case.raw)
        assert any(e.level == "warning" for e in one.imus.take_events())

    def test_close_may_be_called_twice(self, bench, case, bus) -> None:
        one = bench(bus, chip=case.raw)
        one.imus.close()
        one.imus.close()
        assert one.imus.read(0) is None


@pytest.mark.parametrize(("bus", "chip"), each("aged"), ids=name_of)
def test_rates_are_as_old_as_the_chip_says(bench, bus, chip) -> None:
    one = bench(bus, chip=chip, grade=NOISELESS)
    one.imus.open()
    one.fly(0.5)
    samples = one.fly(3.0)
    t_ns = np.array([s.t_ns for s in samples])
    found = np.array([s.rate_rad_s[0] for s in samples])
    ages_s = np.arange(0.0, 0.025, 0.0005)
    missed = [np.std(found - Swing.rate(t_ns - age * 1e9)) for age in ages_s]
    age_s = ages_s[np.argmin(missed)]
    # On one pass the reads stand at one phase to the register, anywhere in its period.
    assert abs(age_s - chip.delay.mean_s) < chip.delay.spread_s + 0.001


@pytest.mark.parametrize(("bus", "chip", "dps_per_bit"), each("scaled"), ids=name_of)
def test_scale_follows_the_settings(bench, bus, chip, dps_per_bit) -> None:
    one = bench(bus, chip=chip, grade=NOISELESS)
    one.imus.open()
    one.fly(1.0)
    for sample in one.fly(0.3):
        # -0.3 rad/s holds still on z, so that only rounding is left.
        assert sample.rate_rad_s[2] == pytest.approx(-0.3, abs=0.51 * np.radians(dps_per_bit))
        counts = sample.rate_rad_s / np.radians(dps_per_bit)
        assert counts == pytest.approx(np.rint(counts), abs=1e-6)


@pytest.mark.parametrize("bus", ["i2c", "uart"])
def test_wrong_chip_is_named_with_what_was_found(bench, bus) -> None:
    one = bench(bus)
    one.chips[0]._pages[0][0] = 0x00
    with pytest.raises(DeviceNotFoundError, match=r"pod 0: chip id 0x00, expected 0xA0"):
        one.imus.open()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_chip_of_another_kind_is_refused(bench, case) -> None:
    for other in set(KINDS) - {case.name}:
        one = bench("i2c", chip=case.raw)
        stranger = KINDS[other](Swing(), np.random.default_rng(1), power_on_ns=0)
        one.chips[0].read, one.chips[0].write = stranger.read, stranger.write
        with pytest.raises(DeviceNotFoundError, match="pod 0: chip id"):
            one.imus.open()


def test_every_kind_of_chip_is_simulated() -> None:
    assert set(KINDS) == set(SETTINGS)


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
