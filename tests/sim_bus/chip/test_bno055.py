"""The register model against the data sheet (BNO055 rev. 1.4) and against known motion."""

import numpy as np
import pytest

from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.bno055.registers import Mode
from sim_bus.chip.sensing import PERFECT, ImuErrors, ImuGrade, Sensing
from sim_bus.chip.sim_chip import ChipSilentError

MS = 1_000_000
AMG, GYRONLY, NDOF = b"\x07", b"\x03", b"\x0c"


def chip(motion, *, grade: ImuGrade = PERFECT, **options) -> SimBno055:
    return SimBno055(motion, np.random.default_rng(1), grade=grade, **options)


def words(data: bytes) -> np.ndarray:
    return np.frombuffer(data, dtype="<i2").astype(float)


def running(motion, mode: bytes = AMG, *, page_1: dict[int, int] | None = None, **options):
    c = chip(motion, **options)
    c.write(0x07, b"\x01", 0)
    for register, value in (page_1 or {}).items():
        c.write(register, bytes([value]), 0)
    c.write(0x07, b"\x00", 0)
    c.write(0x3D, mode, 0)
    return c


def test_identity_and_reset_values(wave) -> None:
    c = chip(wave)
    assert c.read(0x00, 7, 0) == bytes([0xA0, 0xFB, 0x32, 0x0F, 0x11, 0x03, 0x15])
    assert c.read(0x36, 1, 0) == b"\x0f"
    assert c.read(0x3B, 1, 0) == b"\x80"
    c.write(0x07, b"\x01", 0)
    assert c.read(0x08, 4, 0) == bytes([0x0D, 0x0B, 0x38, 0x00])
    assert c.read(0x50, 16, 0) == c.unique_id
    assert len(set(c.unique_id)) > 8


def test_mode_changes_take_their_time(wave) -> None:
    c = chip(wave)
    c.write(0x3D, AMG, 0)
    assert c.read(0x3D, 1, 6 * MS) == b"\x00"
    assert c.read(0x3D, 1, 8 * MS) == AMG
    c.write(0x3D, b"\x00", 10 * MS)
    assert c.read(0x3D, 1, 28 * MS) == AMG
    assert c.read(0x3D, 1, 30 * MS) == b"\x00"


def test_reset_is_650_ms_of_silence_and_all_defaults(wave) -> None:
    c = running(wave, page_1={0x0A: 0x3C})
    c.read(0x14, 6, 50 * MS)
    c.write(0x3F, b"\x20", 100 * MS)
    with pytest.raises(ChipSilentError, match="reset"):
        c.read(0x00, 1, 749 * MS)
    assert c.read(0x00, 1, 751 * MS) == b"\xa0"
    assert c.read(0x3D, 1, 751 * MS) == b"\x00"
    c.write(0x07, b"\x01", 751 * MS)
    assert c.read(0x0A, 1, 751 * MS) == b"\x38"


def test_chip_that_is_switched_on_boots_first(wave) -> None:
    c = chip(wave, is_booted=False, power_on_ns=5 * MS)
    with pytest.raises(ChipSilentError):
        c.read(0x00, 1, 600 * MS)
    assert c.read(0x00, 1, 656 * MS) == b"\xa0"


def test_configuration_wants_config_mode(wave) -> None:
    c = running(wave)
    c.read(0x00, 1, 20 * MS)
    c.write(0x3B, b"\x02", 20 * MS)
    assert c.read(0x3B, 1, 20 * MS) == b"\x80"
    c.write(0x07, b"\x01", 20 * MS)
    c.write(0x0A, b"\x3c", 20 * MS)
    assert c.read(0x0A, 1, 20 * MS) == b"\x38"


def test_read_only_registers_stay(wave) -> None:
    c = chip(wave)
    c.write(0x00, b"\x55\x55", 0)
    assert c.read(0x00, 2, 0) == b"\xa0\xfb"


def test_page_one_shows_configuration_where_data_should_be(wave) -> None:
    """The trap: after a crash on page 1 the 'gyro data' are thresholds and durations."""
    c = running(wave)
    c.select_page(1)
    assert c.read(0x14, 6, 200 * MS) == bytes([0xC0, 0x0A, 0x0B, 0x00, 0x01, 0x19])


@pytest.mark.parametrize(
    ("code", "dps"), [(0, 2000), (1, 1000), (2, 500), (3, 250), (4, 125)]
)  # fmt: skip
def test_raw_scale_follows_the_range(wave, code: int, dps: float) -> None:
    c = running(wave, page_1={0x0A: 0x38 | code})
    found = [words(c.read(0x14, 6, t * MS))[0] * dps / 32768 for t in range(1000, 2000, 10)]
    # 32 Hz leaves 1 Hz as it is; quantisation is below 0.1 deg/s.
    assert max(found) == pytest.approx(100.0, abs=0.2)


def test_raw_rate_saturates_at_the_range(waves) -> None:
    c = running(waves(peak_dps=400.0), page_1={0x0A: 0x3C})
    found = [words(c.read(0x14, 6, t * MS))[0] for t in range(1000, 2000, 10)]
    assert max(found) == 32767
    assert min(found) == -32768


def test_fusion_takes_the_sensors_over(wave) -> None:
    c = running(wave, NDOF, page_1={0x0A: 0x3C, 0x0B: 0x03})
    found = [words(c.read(0x14, 6, t * MS))[0] / 16 for t in range(1000, 2000, 10)]
    assert max(found) == pytest.approx(100.0, abs=0.2)
    c.write(0x07, b"\x01", 2000 * MS)
    assert c.read(0x0A, 2, 2000 * MS) == b"\x38\x00"


def test_rad_per_second_is_a_fusion_unit(wave) -> None:
    c = chip(wave)
    c.write(0x3B, b"\x02", 0)
    c.write(0x3D, NDOF, 0)
    found = [words(c.read(0x14, 6, t * MS))[0] / 900 for t in range(1000, 2000, 10)]
    assert max(found) == pytest.approx(np.radians(100.0), abs=2e-3)


@pytest.mark.parametrize(("bandwidth", "hz"), [(7, 32.0), (3, 47.0), (5, 12.0)])
def test_low_pass_delays_as_a_second_order_filter(wave, bandwidth: int, hz: float) -> None:
    rng = np.random.default_rng(0)
    sensing = Sensing(wave, ImuErrors.draw(PERFECT, rng), rng, 0)
    sensing.configure(hz, 62.5)
    latches = [sensing.latch(index) for index in range(20, 320)]
    t = np.array([latch.t_ns for latch in latches]) * 1e-9
    columns = np.stack([np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)], axis=1)
    fit = np.linalg.lstsq(columns, np.array([x.rate_rad_s[0] for x in latches]), rcond=None)[0]
    delay_s = -np.arctan2(fit[1], fit[0]) / (2 * np.pi)
    assert delay_s == pytest.approx(np.sqrt(2) / (2 * np.pi * hz), rel=0.02)


def test_data_hold_between_latches_and_never_look_ahead(wave) -> None:
    c = running(wave)
    readings = [c.read(0x14, 6, 100 * MS + k * MS // 2) for k in range(200)]
    changes = np.flatnonzero([a != b for a, b in zip(readings[1:], readings, strict=False)])
    assert len(changes) in {9, 10, 11}
    assert np.diff(changes).min() >= 19


def test_own_clock_makes_repeats_at_the_nominal_rate(wave) -> None:
    grade = ImuGrade(clock_ppm=20_000.0)
    c = running(wave, grade=grade)
    readings = [c.read(0x14, 6, 100 * MS + k * 10 * MS) for k in range(2000)]
    repeats = sum(a == b for a, b in zip(readings[1:], readings, strict=False))
    scale = c.errors.clock_scale
    wanted = 2000 * max(scale - 1, 0)
    assert repeats == pytest.approx(wanted, abs=3)


def test_noise_density_is_the_data_sheets(waves) -> None:
    rng = np.random.default_rng(5)
    grade = ImuGrade(gyro_offset_dps=0, gyro_walk_dps_sqrts=0, gyro_offset_dps_per_k=0)
    sensing = Sensing(waves(peak_dps=0), ImuErrors.draw(grade, rng), rng, 0)
    rates = np.degrees([sensing.latch(i).rate_rad_s for i in range(20, 3020)])
    # A second-order Butterworth passes 1.11 of its corner.
    wanted = 0.014 * np.sqrt(1.11 * 32.0)
    assert rates.std() == pytest.approx(wanted, rel=0.05)


def test_offset_stays_within_the_grade_and_drifts(waves) -> None:
    offsets = []
    for seed in range(40):
        errors = ImuErrors.draw(ImuGrade(), np.random.default_rng(seed))
        offsets.append(np.degrees(errors.gyro_offset_rad_s))
    assert np.abs(offsets).max() <= 1.0
    assert np.std(offsets) == pytest.approx(1 / np.sqrt(3), rel=0.15)
    rng = np.random.default_rng(0)
    grade = ImuGrade(gyro_noise_dps_sqrthz=0, gyro_walk_dps_sqrts=0.05)
    sensing = Sensing(waves(peak_dps=0), ImuErrors.draw(grade, rng), rng, 0)
    early, late = sensing.latch(10).rate_rad_s, sensing.latch(6000).rate_rad_s
    assert np.abs(np.degrees(late - early)).max() > 0.05


def test_raw_modes_leave_the_offset_registers_to_the_host(waves) -> None:
    block = words_to_bytes([0, 0, 0, 0, 0, 0, 160, -160, 0, 1000, 480])
    readings = {}
    for mode in (AMG, NDOF):
        c = chip(waves(peak_dps=0))
        c.write(0x55, block, 0)
        assert c.read(0x55, 22, 0) == block
        c.write(0x3D, mode, 0)
        readings[mode] = words(c.read(0x14, 6, 50 * MS))
    assert readings[AMG] == pytest.approx([0, 0, 0])
    assert readings[NDOF] == pytest.approx([-160, 160, 0])


def words_to_bytes(values: list[int]) -> bytes:
    return np.array(values, dtype="<i2").tobytes()


def test_fusion_takes_a_still_chips_offset_for_bias(waves) -> None:
    c = running(waves(peak_dps=0), NDOF, grade=ImuGrade(gyro_offset_dps=2.0))
    early = np.abs(words(c.read(0x14, 6, 100 * MS))).max()
    for k in range(250):
        last = c.read(0x14, 6, (200 + 10 * k) * MS)
    assert early > 10
    assert np.abs(words(last)).max() < 6
    assert c.read(0x35, 1, 3000 * MS)[0] & 0x30 == 0x30


def test_brown_out_is_silent_then_config_with_zeros(wave) -> None:
    c = running(wave)
    assert any(c.read(0x14, 6, 300 * MS))
    c.brown_out(400 * MS)
    with pytest.raises(ChipSilentError):
        c.read(0x14, 6, 500 * MS)
    assert c.read(0x14, 6, 1100 * MS) == bytes(6)
    assert c.read(0x3A, 1, 1100 * MS) == b"\x00"
    assert c.mode is Mode.CONFIG


def test_frozen_and_zero_data(wave) -> None:
    c = running(wave)
    c.read(0x14, 6, 100 * MS)
    c.freeze_until_ns = 400 * MS
    held = c.read(0x14, 6, 200 * MS)
    assert c.read(0x14, 6, 390 * MS) == held
    assert c.read(0x14, 6, 420 * MS) != held
    c.zero_until_ns = 600 * MS
    assert c.read(0x14, 6, 500 * MS) == bytes(6)
    assert any(c.read(0x14, 6, 650 * MS))


def test_self_test_takes_400_ms(wave) -> None:
    c = chip(wave)
    c.write(0x3F, b"\x01", 0)
    assert c.read(0x39, 1, 100 * MS) == b"\x04"
    assert c.read(0x36, 1, 100 * MS) == b"\x00"
    assert c.read(0x36, 1, 450 * MS) == b"\x0f"


def test_suspended_gyro_reads_zero(wave) -> None:
    c = running(wave, GYRONLY, page_1={0x0B: 0x03})
    assert c.read(0x14, 6, 300 * MS) == bytes(6)


def test_gravity_and_temperature(wave) -> None:
    c = running(wave)
    data = c.read(0x08, 0x2D, 300 * MS)
    assert words(data[:6]) == pytest.approx([0, 0, -981], abs=1)
    assert 15 < data[0x34 - 0x08] < 45


def test_quaternion_is_that_of_the_attitude(wave) -> None:
    wave.attitude = lambda _: np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    c = running(wave, NDOF)
    w, x, y, z = words(c.read(0x20, 8, 300 * MS)) / (1 << 14)
    # Sensor x points east: turned by +90 deg about down.
    assert (w, x, y, z) == pytest.approx((np.sqrt(0.5), 0, 0, np.sqrt(0.5)), abs=1e-4)
    assert words(c.read(0x1A, 2, 300 * MS))[0] / 16 == pytest.approx(90.0)


def test_same_seed_gives_the_same_bytes(wave) -> None:
    def reading() -> list[bytes]:
        c = SimBno055(wave, np.random.default_rng(9))
        c.write(0x3D, AMG, 0)
        return [c.read(0x08, 24, k * 10 * MS) for k in range(1, 300)]

    assert reading() == reading()
