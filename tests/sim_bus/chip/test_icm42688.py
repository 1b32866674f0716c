"""The register model against the data sheet (DS-000347 rev. 1.5) and against known motion."""

import numpy as np
import pytest

from sim_bus.chip.icm42688.chip import SimIcm42688
from sim_bus.chip.sensing import PERFECT, ImuGrade
from sim_bus.chip.sim_chip import ChipSilentError

MS = 1_000_000
BOTH_ON, GYRO_ON = b"\x0f", b"\x0c"
INVALID = b"\x80\x00"


def chip(motion, *, grade: ImuGrade = PERFECT, **options) -> SimIcm42688:
    return SimIcm42688(motion, np.random.default_rng(1), grade=grade, **options)


def running(motion, settings: dict[int, int] | None = None, *, mode: bytes = BOTH_ON, **options):
    c = chip(motion, **options)
    for register, value in (settings or {}).items():
        c.write(register, bytes([value]), 0)
    c.write(0x4E, mode, 0)
    assert not c.violations
    return c


def words(data: bytes) -> np.ndarray:
    return np.frombuffer(data, dtype=">i2").astype(float)


def test_identity_and_reset_values_of_every_bank(wave) -> None:
    c = chip(wave)
    assert c.read(0x75, 2, 0) == b"\x47\x00"
    assert c.read(0x4C, 8, 0) == bytes.fromhex("30 91 00 06 06 16 11 0D")
    assert c.read(0x1D, 14, 0) == INVALID * 7
    for bank, register, value in (
        (1, 0x03, "80"), (1, 0x0B, "A0 0D AA 80"), (1, 0x7A, "83 00 5F"), (2, 0x03, "30 40 62"),
        (4, 0x40, "A2 85 51 A4 8C 5C 45 5B 00"), (4, 0x77, "00" * 9),
    ):  # fmt: skip
        c.write(0x76, bytes([bank]), 0)
        expected = bytes.fromhex(value)
        assert c.read(register, len(expected), 0) == expected
        assert c.read(0x76, 1, 0) == bytes([bank])


def test_reset_takes_a_millisecond_and_restores_every_bank(wave) -> None:
    c = running(wave, {0x51: 0x1A, 0x52: 0x66})
    c.write(0x4E, b"\x00", 60 * MS)
    c.write(0x76, b"\x01", 60 * MS)
    c.write(0x0B, b"\xa3", 60 * MS)
    c.write(0x76, b"\x00", 60 * MS)
    assert c.read(0x2D, 1, 60 * MS)[0] & 0x10
    assert not c.read(0x2D, 1, 60 * MS)[0] & 0x10
    c.write(0x11, b"\x01", 61 * MS)
    with pytest.raises(ChipSilentError, match="reset"):
        c.read(0x75, 1, 61 * MS + 900_000)
    assert c.read(0x75, 1, 62 * MS) == b"\x47"
    assert c.read(0x51, 2, 62 * MS) == b"\x16\x11"
    assert c.read(0x11, 1, 62 * MS) == b"\x00"  # the bit clears itself
    assert c.read(0x2D, 1, 62 * MS)[0] & 0x10
    c.write(0x76, b"\x01", 62 * MS)
    assert c.read(0x0B, 1, 62 * MS) == b"\xa0"


def test_power_up_is_silent(wave) -> None:
    c = chip(wave, is_booted=False)
    with pytest.raises(ChipSilentError):
        c.read(0x75, 1, 3 * MS)
    assert c.transfer(b"\xf5\x00", 3 * MS) == b"\xff\xff"
    assert c.read(0x75, 1, 5 * MS) == b"\x47"


def test_data_are_invalid_until_each_sensor_has_started(wave) -> None:
    c = running(wave)
    assert c.read(0x1F, 12, 9 * MS) == INVALID * 6
    early = c.read(0x1F, 12, 29 * MS)
    assert early[:6] != INVALID * 3
    assert early[6:] == INVALID * 3
    assert c.read(0x25, 6, 32 * MS) != INVALID * 3


def test_invalid_data_read_zero_where_the_last_value_is_held(wave) -> None:
    c = running(wave, {0x4C: 0xB0})
    assert c.read(0x1D, 14, 1 * MS) == bytes(14)


def test_sensor_switched_off_keeps_its_last_sample(wave) -> None:
    c = running(wave)
    last = c.read(0x25, 6, 100 * MS)
    c.write(0x4E, b"\x03", 101 * MS)
    assert c.read(0x25, 6, 200 * MS) == last


@pytest.mark.parametrize(
    ("code", "range_dps", "lsb_per_dps"),
    [(0, 2000, 16.4), (1, 1000, 32.8), (2, 500, 65.5), (3, 250, 131), (4, 125, 262)],
)
def test_gyro_scale_follows_the_range(waves, code, range_dps, lsb_per_dps) -> None:
    c = running(waves(peak_dps=60.0), {0x4F: code << 5 | 6})
    found = [words(c.read(0x25, 6, t * MS))[0] for t in range(1000, 2000, 5)]
    # The data sheet rounds 32768 over the range to a tenth.
    assert max(found) == pytest.approx(60 * lsb_per_dps, rel=2e-3)


@pytest.mark.parametrize("code", range(4))
def test_accelerometer_scale_follows_the_range(wave, code) -> None:
    c = running(wave, {0x50: code << 5 | 6})
    assert words(c.read(0x1F, 6, 1000 * MS)) == pytest.approx([0, 0, -(2048 << code)])


def test_valid_data_never_read_as_invalid(waves) -> None:
    for hold, lowest in ((0x30, -32766), (0xB0, -32768)):
        c = running(waves(peak_dps=500.0), {0x4F: 0x80 | 6, 0x4C: hold})
        found = [words(c.read(0x25, 6, t * MS))[0] for t in range(1000, 2000, 5)]
        assert (min(found), max(found)) == (lowest, 32767)


def test_temperature_counts_from_25_degrees(wave) -> None:
    c = running(wave)
    found = words(c.read(0x1D, 2, 1000 * MS))[0] / 132.48 + 25
    assert found == pytest.approx(c.sensing.latch(990).temperature_c, abs=0.02)


def test_little_endian_data_on_request(wave) -> None:
    big, little = running(wave), running(wave, {0x4C: 0x20})
    data = big.read(0x1D, 14, 100 * MS)
    swapped = b"".join(data[i : i + 2][::-1] for i in range(0, 14, 2))
    assert little.read(0x1D, 14, 100 * MS) == swapped


GROUP_DELAY_MS = {  # Sec. 5.5, at 1 kHz, 500 Hz and 200 Hz
    (0, 2): (2.0, 4.0, 5.0), (0, 6): (4.7, 9.3, 11.7), (1, 1): (2.1, 4.1, 5.1),
    (1, 5): (5.2, 10.4, 12.9), (1, 6): (6.1, 12.2, 15.3), (1, 7): (12.0, 24.0, 30.0),
    (2, 4): (4.6, 9.2, 11.4), (2, 6): (8.2, 16.3, 20.4),
}  # fmt: skip


@pytest.mark.parametrize(("rate", "odr_hz", "at"), [(6, 1000, 0), (15, 500, 1), (7, 200, 2)])
@pytest.mark.parametrize(("order", "bandwidth"), list(GROUP_DELAY_MS))
def test_filter_delays_as_the_data_sheet_says(waves, order, bandwidth, rate, odr_hz, at) -> None:
    c = running(
        waves(hz=0.5),
        {0x4F: rate, 0x51: 0x12 | order << 2, 0x52: bandwidth << 4 | bandwidth},
    )
    first = c.sensing.latch_index(500 * MS)
    c.read(0x25, 6, 500 * MS)  # takes the settings over
    latches = [c.sensing.latch(index) for index in range(first, first + 2 * odr_hz, odr_hz // 50)]
    t = np.array([latch.t_ns for latch in latches]) * 1e-9
    columns = np.stack([np.sin(np.pi * t), np.cos(np.pi * t)], axis=1)
    fit = np.linalg.lstsq(columns, np.array([x.rate_rad_s[0] for x in latches]), rcond=None)[0]
    delay_ms = -np.arctan2(fit[1], fit[0]) / np.pi * 1e3
    aaf_ms = 1e3 * np.sqrt(2) / (2 * np.pi * 585)
    # The table is rounded to 0.1 ms.
    assert delay_ms == pytest.approx(GROUP_DELAY_MS[order, bandwidth][at] + aaf_ms, abs=0.11)


def test_registers_change_at_the_output_data_rate(wave) -> None:
    for code, odr_hz in ((6, 1000), (15, 500), (7, 200)):
        c = running(wave, {0x4F: code})
        readings = [c.read(0x25, 6, 100 * MS + k * MS // 8) for k in range(800)]
        changes = sum(a != b for a, b in zip(readings[1:], readings, strict=False))
        assert changes == pytest.approx(odr_hz // 10, abs=1)


def test_data_ready_is_set_by_a_new_sample_and_cleared_by_reading(wave) -> None:
    c = running(wave)
    c.read(0x2D, 1, 100 * MS)
    assert c.read(0x2D, 1, 100 * MS) == b"\x00"
    assert c.read(0x1F, 15, 102 * MS)[-1] == 0x08
    assert c.read(0x1F, 15, 102 * MS)[-1] == 0x00


def test_forbidden_writes_are_lost_and_noted(wave) -> None:
    c = running(wave)
    c.write(0x52, b"\x66", 100_000)  # 0.1 ms after the start
    c.write(0x52, b"\x66", 50 * MS)  # Sec. 12.9
    c.write(0x4F, b"\x26", 50 * MS)  # range and rate may change
    assert c.read(0x52, 1, 50 * MS) == b"\x11"
    assert c.read(0x4F, 1, 50 * MS) == b"\x26"
    assert [v.split()[-1] for v in c.violations] == ["start", "running"]


def test_offsets_of_a_program_before_are_applied_until_the_reset(waves) -> None:
    c = chip(waves(peak_dps=0))
    c.write(0x76, b"\x04", 0)
    c.write(0x77, bytes.fromhex("40 C0 C0 00 80 00 02 00 00"), 0)  # +64, -2, 0 LSB; 0, 0, +...
    c.write(0x76, b"\x00", 0)
    c.write(0x4E, BOTH_ON, 0)
    gyro = words(c.read(0x25, 6, 100 * MS)) / (32768 / 2000)
    assert gyro[0] == pytest.approx(64 / 32, abs=0.04)
    assert gyro[1] == pytest.approx(-832 / 32, abs=0.04)
    c.write(0x11, b"\x01", 101 * MS)
    c.write(0x4E, BOTH_ON, 103 * MS)
    assert words(c.read(0x25, 6, 200 * MS)) == pytest.approx([0, 0, 0])


def test_spi_reads_bursts_and_takes_single_writes(wave) -> None:
    c = chip(wave)
    assert c.transfer(b"\xf5\x00", 0) == b"\x00\x47"
    assert c.transfer(b"\xcc" + bytes(8), 0)[1:] == bytes.fromhex("30 91 00 06 06 16 11 0D")
    c.transfer(b"\x51\x1a\x66", 0)
    assert c.read(0x51, 2, 0) == b"\x1a\x11"
    assert c.violations == ["burst write of register 0x51 over SPI"]


def test_interface_that_is_switched_off_does_not_answer(wave) -> None:
    c = chip(wave)
    c.transfer(b"\x4c\x33", 0)
    with pytest.raises(ChipSilentError, match="UI_SIFS_CFG"):
        c.read(0x75, 1, 0)
    c.transfer(b"\x4c\x32", 0)
    assert c.transfer(b"\xf5\x00", 0) == b"\xff\xff"
    assert c.read(0x75, 1, 0) == b"\x47"


def test_brown_out_is_silent_then_asleep_with_invalid_data(wave) -> None:
    c = running(wave)
    c.read(0x2D, 1, 100 * MS)
    c.brown_out(100 * MS)
    with pytest.raises(ChipSilentError):
        c.read(0x75, 1, 103 * MS)
    assert c.read(0x25, 6, 200 * MS) == INVALID * 3
    assert c.read(0x4E, 1, 200 * MS) == b"\x00"
    assert c.read(0x2D, 1, 200 * MS) == b"\x10"
