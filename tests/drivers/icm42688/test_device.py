"""Bring-up, settings and screening of the ICM-42688-P, on the simulated chip."""

import numpy as np
import pytest

from avionics.config.chips import Icm42688Settings
from drivers.errors import DeviceNotFoundError
from drivers.icm42688.device import Icm42688
from drivers.icm42688.settings import Settings
from drivers.icm42688.spi_port import SpiRegisterPort
from drivers.polled_imus import PolledImus
from sim_bus.clock import SimClock
from tests.drivers.wing_bench import NOISELESS, SECOND, Swing

BUSES = pytest.mark.parametrize("bus", ["i2c", "spi"])


def icm42688(**settings) -> Icm42688Settings:
    return Icm42688Settings(kind="icm42688", **settings)


def device(one) -> Icm42688:
    return one.imus._stations[0].chip


@BUSES
def test_settings_are_in_the_chip_after_opening(bench, bus) -> None:
    wanted = icm42688(
        gyro_range_dps=250, accel_range_g=4, data_hz=500, filter_order=3, gyro_bandwidth_hz=30
    )
    one = bench(bus, chip=wanted)
    one.imus.open()
    chip = one.chips[0]
    interface = 0x33 if bus == "spi" else 0x32
    configuration = bytes([interface, 0x51, 0x0F, 0x6F, 0x4F, 0x1A, 0x55, 0x15])
    assert bytes(chip._banks[0][0x4C:0x54]) == configuration
    assert chip._bank == 0
    assert chip.violations == []
    if bus == "i2c":
        assert chip._banks[0][0x13] == 0x09
        assert chip._banks[1][0x7C] == 0x5C


@BUSES
def test_gyro_alone_leaves_the_accelerometer_off(bench, bus) -> None:
    one = bench(bus, chip=icm42688(accelerometer=False))
    one.imus.open()
    assert one.chips[0]._banks[0][0x4E] == 0x0C
    (sample, *_) = one.fly(0.1)
    assert sample.specific_force_m_s2 is None
    assert one.count("invalid") == 0


@BUSES
def test_what_another_program_left_is_cleared(bench, bus) -> None:
    # GIVEN a chip that another program left running, with an offset, on bank 4
    one = bench(bus, chip=icm42688(), grade=NOISELESS)
    chip = one.chips[0]
    chip._banks[4][0x79] = 0x80
    chip._banks[0][0x4E] = 0x0F
    chip.select_page(4)
    # WHEN it is opened THEN it shows the true rate
    one.imus.open()
    samples = one.fly(0.3)
    assert samples[-1].rate_rad_s[1] == pytest.approx(0.0, abs=1e-3)
    assert chip.violations == []


@BUSES
def test_setting_that_does_not_take_is_named(bench, bus, monkeypatch) -> None:
    one = bench(bus, chip=icm42688())
    honest = one.chips[0]._write_byte

    def write(register, value, t_ns) -> None:
        if register != 0x52:
            honest(register, value, t_ns)

    monkeypatch.setattr(one.chips[0], "_write_byte", write)
    expected = "pod 0: GYRO_ACCEL_CONFIG0 reads 0x11, expected 0x66"
    with pytest.raises(DeviceNotFoundError, match=expected):
        one.imus.open()


@BUSES
def test_chip_that_takes_no_writes_is_named(bench, bus, monkeypatch) -> None:
    one = bench(bus, chip=icm42688())
    one.chips[0].read(0x2D, 1, one.clock.now_ns())
    monkeypatch.setattr(one.chips[0], "_write_byte", lambda *_: None)
    with pytest.raises(DeviceNotFoundError, match="INT_STATUS reads 0x00 after a reset"):
        one.imus.open()


@BUSES
def test_gyro_that_does_not_start_is_named(bench, bus, monkeypatch) -> None:
    one = bench(bus, chip=icm42688())
    monkeypatch.setattr(one.chips[0], "_refresh", lambda *_: None)
    with pytest.raises(DeviceNotFoundError, match="no gyro data 260 ms after it was switched on"):
        one.imus.open()


@BUSES
def test_chip_that_just_got_its_supply_is_waited_for(bench, bus) -> None:
    one = bench(bus, chip=icm42688())
    one.chips[0].brown_out(one.clock.now_ns())
    one.imus.open()
    assert len(one.fly(0.5)) > 45


@BUSES
def test_another_chip_of_the_family_is_refused(bench, bus) -> None:
    one = bench(bus, chip=icm42688())
    one.chips[0]._banks[0][0x75] = 0x42  # ICM-42605
    with pytest.raises(DeviceNotFoundError, match="pod 0: chip id 0x42, expected 0x47"):
        one.imus.open()


class ScriptedSpi:
    """Answers everything with one byte and remembers what was written."""

    def __init__(self, answer: int) -> None:
        self.answer, self.writes = answer, []

    def xfer2(self, values):
        if not values[0] & 0x80:
            self.writes.append(values)
        return [self.answer] * len(values)

    def close(self) -> None:
        pass


@pytest.mark.parametrize("answer", [0x00, 0xFF])
def test_dead_spi_line_is_named_and_not_written_to(answer) -> None:
    clock, line = SimClock(SECOND), ScriptedSpi(answer)
    chip = Icm42688(SpiRegisterPort(line), clock, pod="0")
    found = f"pod 0: chip id 0x{answer:02X}, expected 0x47; nothing drives SDO: check supply"
    with pytest.raises(DeviceNotFoundError, match=found):
        PolledImus([chip], clock).open()
    assert line.writes == []


def test_chip_has_no_serial_number(bench) -> None:
    one = bench("spi", chip=icm42688())
    one.imus.open()
    assert device(one).uid == b""


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"gyro_range_dps": 300}, r"gyro_range_dps = 300: .* \[125, 250, 500, 1000, 2000\]"),
        ({"filter_order": 4}, r"filter_order = 4: .* \[1, 2, 3\]"),
        ({"data_hz": 400}, r"data_hz = 400: .* \[200, 500, 1000\]"),
        (
            {"gyro_bandwidth_hz": 50},
            r"gyro_bandwidth_hz = 50: at filter_order = 2 and data_hz = 1000 the ICM-42688-P wants "
            r"one of \[21, 48, 60, 97, 118, 192, 231\]",
        ),
    ],
)
def test_setting_that_the_chip_does_not_have_is_refused(more, message) -> None:
    with pytest.raises(ValueError, match=message):
        Settings(**more)


@BUSES
@pytest.mark.parametrize(
    ("order", "data_hz", "bandwidth_hz"),
    [(2, 1000, 48), (2, 1000, 231), (1, 1000, 24), (3, 500, 30), (2, 200, 19)],
)
def test_rates_are_as_old_as_the_driver_says(bench, bus, order, data_hz, bandwidth_hz) -> None:
    settings = icm42688(
        data_hz=data_hz, filter_order=order, gyro_bandwidth_hz=bandwidth_hz, rate_hz=137.0
    )
    one = bench(bus, chip=settings, grade=NOISELESS)
    one.imus.open()
    one.fly(0.5)
    samples = one.fly(3.0)
    t_s = np.array([s.t_ns for s in samples]) * 1e-9
    columns = np.stack([np.sin(2 * np.pi * t_s), np.cos(2 * np.pi * t_s)], axis=1)
    fit = np.linalg.lstsq(columns, np.array([s.rate_rad_s[0] for s in samples]), rcond=None)[0]
    age_s = -np.arctan2(fit[1], fit[0]) / (2 * np.pi)
    assert np.hypot(*fit) == pytest.approx(Swing.rate(0.25 * SECOND), rel=0.01)
    # Sec. 5.5 gives 0.1 ms; the phase of the register is averaged out by the odd rate.
    assert age_s == pytest.approx(device(one).delay_s, abs=1.5e-4 + 1e-3 * settings.delay.filter_s)


@BUSES
def test_single_false_bit_is_seen_by_a_second_look(bench, bus) -> None:
    one = bench(bus, chip=icm42688())
    one.imus.open()
    one.fly(0.5)
    one.fault("spike", 0, 0.0, 2.0, probability=0.2)
    samples = one.fly(2.0)
    t_ns = np.array([s.t_ns for s in samples])
    missed = np.array([s.rate_rad_s[0] for s in samples]) - Swing.rate(
        t_ns - device(one).delay_s * 1e9
    )
    assert one.count("spikes") > 8
    assert one.count("reinitialised") == 0
    # The least false bit is 0.14 rad/s; the register is half a millisecond older or newer.
    assert np.abs(missed).max() < 0.03
    assert len(samples) > 190


@BUSES
def test_hard_manoeuvre_is_taken_after_the_second_look(bench, bus, monkeypatch) -> None:
    one = bench(bus, chip=icm42688(), grade=NOISELESS)
    one.imus.open()
    one.fly(0.5)
    start_ns = one.clock.now_ns()
    honest = one.chips[0]._read

    def read(register, length, t_ns):
        data = honest(register, length, t_ns)
        if register == 0x1F:
            return data[:6] + (9000 + t_ns // 1_000_000 % 7).to_bytes(2, "big") + data[8:]
        return data

    monkeypatch.setattr(one.chips[0], "_read", read)
    samples = one.fly(0.5)
    assert len(samples) >= 48
    assert samples[-1].rate_rad_s[0] == pytest.approx(9000 * np.radians(2000 / 32768), rel=1e-3)
    assert samples[0].t_ns - start_ns < 0.03 * SECOND


def test_saturated_rates_are_passed_on_and_counted(bench) -> None:
    # GIVEN a swing of 115 deg/s and a range of 125 WHEN an offset of 60 is added THEN the part
    # above 65 deg/s is at the stop
    one = bench("spi", chip=icm42688(gyro_range_dps=125))
    one.imus.open()
    one.fly(1.0)
    assert one.count("saturated") == 0
    one.chips[0].errors.gyro_offset_rad_s[0] = np.radians(60.0)
    one.fly(1.0)  # the second that is sensed already
    before = one.count("saturated")
    samples = one.fly(2.0)
    assert len(samples) == pytest.approx(200, abs=1)
    assert one.count("saturated") - before == pytest.approx(62, abs=4)  # 200 arccos(0.57) / pi
    assert max(s.rate_rad_s[0] for s in samples) == pytest.approx(np.radians(125), rel=1e-4)


@BUSES
def test_reset_in_flight_is_seen_in_the_next_burst(bench, bus) -> None:
    # GIVEN a chip in flight WHEN a dip of the supply resets it THEN the burst behind it says so
    one = bench(bus, chip=icm42688())
    one.imus.open()
    one.fly(0.5)
    one.imus.take_events()
    one.fault("config_reset", 0, 0.0, 0.001)
    samples = one.fly(1.0)
    assert one.count("resets") == one.count("reinitialised") == 1
    assert len(samples) > 88  # 60 ms of start-up
    first, last = one.imus.take_events()
    assert first.message.startswith("the chip was reset: INTF_CONFIG0 reads 0x30, expected 0x3")
    assert (first.level, last.message) == ("warning", "is up")


def test_false_reset_bit_does_not_cost_a_bring_up(bench, monkeypatch) -> None:
    one = bench("spi", chip=icm42688())
    one.imus.open()
    one.fly(0.5)
    honest, count = one.chips[0]._read, 0

    def read(register, length, t_ns):
        nonlocal count
        data = honest(register, length, t_ns)
        count += register == 0x1F
        return data[:-1] + b"\x10" if register == 0x1F and count == 10 else data

    monkeypatch.setattr(one.chips[0], "_read", read)
    assert len(one.fly(1.0)) >= 98
    assert one.count("reinitialised") == one.count("resets") == 0


@BUSES
def test_wrong_bank_is_put_back(bench, bus) -> None:
    one = bench(bus, chip=icm42688())
    one.imus.open()
    one.fly(0.5)
    one.fault("page_left", 0, 0.0, 0.001)
    samples = one.fly(1.0)
    assert one.count("wrong_bank") == 1
    assert one.count("reinitialised") == 0
    assert len(samples) >= 97


@pytest.mark.parametrize(("kind", "counter"), [("spi_low", "all_zero"), ("spi_high", "all_ones")])
def test_broken_data_line_gives_no_samples_and_is_named(bench, kind, counter) -> None:
    one = bench("spi", chip=icm42688())
    one.imus.open()
    one.fly(0.5)
    one.imus.take_events()
    start_ns = one.clock.now_ns()
    one.fault(kind, 0, 0.0, 0.5)
    samples = one.fly(2.0)
    during = [s for s in samples if s.t_ns < start_ns + 0.5 * SECOND]
    assert during == []
    assert one.count(counter) >= 1
    assert len(samples) > 120
    found = "0x00" if kind == "spi_low" else "0xFF"
    messages = [e.message for e in one.imus.take_events()]
    assert any(f"chip id {found}, expected 0x47" in m for m in messages)
    assert messages[-1] == "is up"


class Shake(Swing):
    """The swing with a flutter of 30 Hz and 8 rad/s on top."""

    @staticmethod
    def rate(t_ns):
        t_s = np.asarray(t_ns) * 1e-9
        return 2.0 * np.sin(2 * np.pi * t_s) + 8.0 * np.sin(60 * np.pi * t_s)


@BUSES
def test_flutter_costs_no_samples(bench, bus) -> None:
    one = bench(bus, chip=icm42688(gyro_bandwidth_hz=118))
    one.chips[0].sensing._motion = Shake()
    one.imus.open()
    samples = one.fly(2.0)
    assert len(samples) == pytest.approx(200, abs=1)
    assert max(abs(s.rate_rad_s[0]) for s in samples) > 6.0
    assert one.count("rejected") == one.count("spikes") == 0
