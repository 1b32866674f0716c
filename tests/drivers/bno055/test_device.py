"""Bring-up, calibration, crystal, multiplexer, and screening in flight, on the simulated chip."""

import numpy as np
import pytest

from avionics.config.chips import Bno055Settings
from drivers.bno055.calibration import CalibrationFile
from drivers.bno055.device import Bno055
from drivers.bno055.screening import is_suspicious
from drivers.bno055.settings import Settings
from drivers.errors import DeviceNotFoundError, DriverError, FrameFormatError
from drivers.i2c_registers import I2cRegisterPort
from sim_bus.clock import SimClock
from tests.drivers.bno055_scripts import ScriptedI2c
from tests.drivers.wing_bench import NOISELESS, SECOND

BLOCK = (
    bytes(range(6)) + bytes(6) + (16 * 2).to_bytes(2, "little") + bytes(4) + bytes((232, 3, 224, 1))
)


@pytest.mark.parametrize("bus", ["i2c", "uart"])
def test_settings_are_in_the_chip_after_opening(bench, bus) -> None:
    wanted = Bno055Settings(mode="gyronly", gyro_range_dps=500, gyro_bandwidth_hz=116)
    one = bench(bus, chip=wanted)
    one.imus.open()
    chip = one.chips[0]
    assert chip.mode == 3
    assert chip._pages[1][0x0A] == 0x12
    assert chip._pages[0][0x3B] == 0x80
    assert chip._page == 0


def test_setting_that_does_not_take_is_named(bench, monkeypatch) -> None:
    one = bench("i2c")
    honest = one.chips[0].write

    def write(register, data, t_ns) -> None:
        if register != 0x0A:
            honest(register, data, t_ns)

    monkeypatch.setattr(one.chips[0], "write", write)
    one.imus._stations[0].chip.settings = Settings(gyro_range_dps=250)
    with pytest.raises(DeviceNotFoundError, match="pod 0: GYR_CONFIG_0 reads 0x38, expected 0x3B"):
        one.imus.open()


def test_chip_left_on_page_1_by_a_crash_is_opened(bench) -> None:
    one = bench("i2c")
    one.chips[0].select_page(1)
    one.imus.open()
    assert one.chips[0]._page == 0


def test_foreign_device_is_not_written_to() -> None:
    clock, bus = SimClock(SECOND), ScriptedI2c(b"\x68")  # an MPU-6050 says so everywhere
    device = Bno055(I2cRegisterPort(bus, 0x68), clock, pod="0")
    with pytest.raises(DeviceNotFoundError, match="pod 0: chip id 0x68, expected 0xA0"):
        device.open()
    assert bus.writes == []


def test_calibration_is_kept_by_chip_and_restored(bench, tmp_path) -> None:
    path = tmp_path / "chips.json"
    store = CalibrationFile(path)
    one = bench("i2c", chip=Bno055Settings(calibration_file=str(path)))
    store.save(one.chips[0].unique_id, BLOCK)
    one.imus.open()
    assert bytes(one.chips[0]._pages[0][0x55:0x6B]) == BLOCK
    device = one.imus._stations[0].chip
    assert device.state.calibrated
    assert device.state.uid == one.chips[0].unique_id
    for t_ns in device.save_calibration():
        one.clock.sleep_until_ns(t_ns)
    assert store.load(one.chips[0].unique_id) == BLOCK
    one.fly(0.1)
    assert one.chips[0].mode == device.settings.mode


CALIB_STAT = 0x35


@pytest.mark.parametrize("bus", ["i2c", "uart"])
@pytest.mark.parametrize(
    ("mode", "status", "is_saved"),
    [
        ("ndof", 0xFF, True),
        ("ndof", 0x3F, True),  # the sensors are, whatever the fusion says
        ("ndof", 0xFC, False),
        ("imu", 0x3C, True),
        ("imu", 0x38, False),
        ("amg", 0xFF, False),
    ],
)
def test_fully_calibrated_chip_is_saved_at_the_end(
    bench, tmp_path, bus, mode, status, is_saved
) -> None:
    path = tmp_path / "chips.json"
    store = CalibrationFile(path)
    one = bench(bus, chip=Bno055Settings(mode=mode, calibration_file=str(path)))
    one.imus.open()
    one.fly(0.1)
    chip = one.chips[0]
    chip._pages[0][CALIB_STAT] = status
    chip._pages[0][0x55:0x6B] = BLOCK
    one.imus.take_events()
    one.imus.close()
    assert store.load(chip.unique_id) == (BLOCK if is_saved else None)
    said = [event.message for event in one.imus.take_events()]
    assert said == (["calibration saved"] if is_saved else [])


def test_calibration_that_cannot_be_saved_is_told(bench, tmp_path) -> None:
    one = bench(
        "i2c",
        chip=Bno055Settings(mode="ndof", calibration_file=str(tmp_path / "none" / "chips.json")),
    )
    one.imus.open()
    one.fly(0.1)
    one.chips[0]._pages[0][CALIB_STAT] = 0xFF
    one.imus.take_events()
    one.imus.close()
    (event,) = one.imus.take_events()
    assert event.level == "warning"
    assert "calibration not saved" in event.message
    assert "chips.json: cannot be written" in event.message


def test_host_subtracts_the_offsets_in_raw_modes_only(bench, tmp_path) -> None:
    # GIVEN equal chips, one of them with stored offsets WHEN both are read THEN those of raw
    # modes differ by the offsets, which the host takes off; in fusion modes the chip does it
    path = tmp_path / "chips.json"
    store = CalibrationFile(path)

    def read(mode: str, calibration_file: str | None):
        chip = Bno055Settings(mode=mode, calibration_file=calibration_file)
        one = bench("i2c", chip=chip, grade=NOISELESS)
        store.save(one.chips[0].unique_id, BLOCK)  # 32 LSB = 2 deg/s on x
        one.imus.open()
        one.clock.sleep_until_ns(8 * SECOND)  # restoring takes time, in which the wing swings on
        return one.fly(0.5)

    for mode in ("gyronly", "amg", "ndof"):
        pairs = list(zip(read(mode, None), read(mode, str(path)), strict=True))
        assert len(pairs) > 40
        offsets = np.array([a.rate_rad_s - b.rate_rad_s for a, b in pairs])
        np.testing.assert_allclose(
            offsets, [[np.radians(2), 0, 0]] * len(pairs), atol=2e-3
        )  # a count is 1.1e-3
        if mode == "amg":
            forces = np.array([a.specific_force_m_s2 - b.specific_force_m_s2 for a, b in pairs])
            expected = np.frombuffer(BLOCK[:6], "<i2") * 0.01
            np.testing.assert_allclose(forces, [expected] * len(pairs), atol=0.011)


def test_malformed_calibration_file_is_named(tmp_path) -> None:
    path = tmp_path / "chips.json"
    path.write_text('{"00": "zz"}', encoding="utf-8")
    with pytest.raises(FrameFormatError, match=r"chips\.json: calibration of chip 00 is 'zz'"):
        CalibrationFile(path).load(b"\0")
    path.write_text("[]", encoding="utf-8")
    with pytest.raises(FrameFormatError, match="expected an object"):
        CalibrationFile(path).load(b"\0")


def test_saving_without_a_store_is_an_error(bench) -> None:
    one = bench("i2c")
    with pytest.raises(DriverError, match="no calibration store"):
        next(one.imus._stations[0].chip.save_calibration())


def test_external_crystal_is_chosen_after_the_calibration(bench, monkeypatch) -> None:
    one = bench("i2c", chip=Bno055Settings(external_crystal=True))
    order = []
    honest = one.chips[0].write

    def write(register, data, t_ns) -> None:
        order.append((register, bytes(data)))
        honest(register, data, t_ns)

    monkeypatch.setattr(one.chips[0], "write", write)
    one.imus.open()
    assert (0x3F, b"\x80") in order
    assert order.index((0x3F, b"\x80")) > max(
        i for i, (r, _) in enumerate(order) if r in (0x0A, 0x0B)
    )


def test_four_sensors_behind_a_multiplexer_are_read_at_100_hz(bench) -> None:
    one = bench("i2c", pods=4, chip=Bno055Settings(mode="gyronly"), mux=True)
    one.imus.open()
    samples = one.fly(2.0)
    for pod in "0123":
        assert len([s for s in samples if s.pod == pod]) == pytest.approx(200, abs=4)


def test_a_lost_neighbour_does_not_stop_the_other(bench) -> None:
    # GIVEN two chips on one bus WHEN one stops to answer THEN the other is read on
    one = bench("i2c", pods=2, chip=Bno055Settings(mode="gyronly"))
    one.imus.open()
    one.fly(0.5)
    one.fault("nak", 0, 0.0, 3.0)
    samples = one.fly(3.0)
    assert len([s for s in samples if s.pod == "1"]) == pytest.approx(300, abs=6)
    assert len([s for s in samples if s.pod == "0"]) < 5
    assert len([s for s in one.fly(1.0) if s.pod == "0"]) > 80


def test_slow_bus_skips_ticks_and_says_so(bench) -> None:
    one = bench("i2c", pods=2, byte_ns=600_000)  # 18 bytes of AMG take 12 ms
    one.imus.open()
    samples = one.fly(2.0)
    skipped = one.count("ticks_missed")
    assert skipped > 50
    seqs = [s.seq for s in samples if s.pod == "1"]
    assert seqs == sorted(set(seqs))
    assert seqs[-1] - seqs[0] > len(seqs)


def test_missing_chip_at_start_is_taken_up_later_without_open(bench) -> None:
    one = bench("i2c")
    one.fault("nak", 0, 0.0, 2.0)
    assert one.fly(1.9) == []
    assert len(one.fly(1.5)) > 80
    assert [e.level for e in one.imus.take_events()] == ["error", "info"]


LIMIT = np.full(3, 1600, dtype=np.int32)


@pytest.mark.parametrize(
    ("now", "expected", "verdict"),
    [
        ((10, 20, 30), (12, 18, 33), False),
        ((-32758, 20, 30), (10, 20, 30), True),  # bit 7 of a high byte
        ((138, 20, 30), (10, 20, 30), True),  # bit 7 of a low byte
        ((110, 20, 30), (10, 20, 30), False),  # a step without that bit
        ((200, 20, 30), (190, 20, 30), False),  # the bit, but no step
        ((2000, 20, 30), (10, 20, 30), True),
    ],
)
def test_false_bits_are_suspected(now, expected, verdict) -> None:
    values = [np.array(x, dtype=np.int32) for x in (now, expected)]
    assert is_suspicious(*values, LIMIT) is verdict


def test_hard_manoeuvre_is_believed_after_the_second_look(bench, monkeypatch) -> None:
    one = bench("i2c", chip=Bno055Settings(mode="gyronly"), grade=NOISELESS)
    one.imus.open()
    one.fly(0.5)
    start_ns = one.clock.now_ns()
    honest = one.chips[0].read

    def read(register, length, t_ns):
        data = honest(register, length, t_ns)
        if register == 0x14 and t_ns > start_ns:
            return (9000 + t_ns // 1_000_000 % 7).to_bytes(2, "little") + data[2:]
        return data

    monkeypatch.setattr(one.chips[0], "read", read)
    samples = one.fly(0.5)
    assert len(samples) >= 48
    assert samples[-1].rate_rad_s[0] == pytest.approx(9000 * np.radians(2000 / 32768), rel=1e-3)
    assert samples[0].t_ns - start_ns < 0.03 * SECOND


@pytest.mark.parametrize("before", [True, False])
def test_a_burst_that_was_held_up_gives_no_sample_rather_than_a_wrong_time(
    bench, monkeypatch, before: bool
) -> None:
    one = bench("i2c", chip=Bno055Settings(mode="gyronly"))
    one.imus.open()
    one.fly(0.2)
    honest, taken, count = one.chips[0].read, [], 0

    def read(register, length, t_ns):
        nonlocal count
        count += register == 0x14
        hold_up_ns = 7_000_000 if count % 10 == 0 else 1_000_000
        if before:
            one.clock.advance(hold_up_ns)
        data = honest(register, length, one.clock.now_ns())
        taken.append(one.clock.now_ns())
        if not before:
            one.clock.advance(hold_up_ns)
        return data

    monkeypatch.setattr(one.chips[0], "read", read)
    samples = one.fly(3.0)
    assert one.count("read_slow") == pytest.approx(30, abs=3)
    assert len(samples) == pytest.approx(270, abs=6)
    error_ns = [min(abs(s.t_ns - t) for t in taken) for s in samples]
    assert max(error_ns) < 2_000_000
