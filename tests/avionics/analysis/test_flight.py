"""A log as arrays: the records' own numbers, in one pass, within a bound of memory."""

import sys
import tracemalloc
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from avionics.analysis.collectors import KEPT
from avionics.analysis.evaluate import evaluate
from avionics.analysis.export import export
from avionics.analysis.flight import Flight, read_flight
from avionics.analysis.info import info_text
from avionics.analysis.series import in_time_order
from avionics.errors import AvionicsError, RecordingError
from avionics.recording import Damage, LogReader, LogWriter
from avionics.recording.mcap import scan
from avionics.recording.schema.decode import DECODER_OF
from avionics.records import Event, MarkerTracks, Truth, WingShapeEstimate
from drivers.samples import Frame, ImuSample
from tests.avionics.written_flight import CONFIG, LENGTH_S, estimate, flight_records, write


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("log") / "flight.mcap", flight_records())


@pytest.fixture(scope="module")
def flight(log: Path) -> Flight:
    return read_flight(log)


def records(log: Path, kind: type, topic: str = "*") -> list:
    found = LogReader(log).messages([topic], decode_images=False)
    return [m.record for m in found if isinstance(m.record, kind)]


def assert_rows_are(series, of: list, *names: str) -> None:
    for name in names:
        assert_array_equal(getattr(series, name), np.array([getattr(r, name) for r in of]), name)


def test_samples_are_those_of_the_log(log: Path, flight: Flight) -> None:
    assert list(flight.imu) == ["0", "1"]
    of = records(log, ImuSample, "/imu/1")
    samples = flight.imu["1"]
    assert_rows_are(samples, of, "t_ns", "seq", "rate_rad_s")
    assert samples.rate_rad_s.shape == (round(LENGTH_S * 100), 3)
    assert samples.specific_force_m_s2 is None
    assert samples.t_ns.dtype == np.int64
    assert samples.t_s[-1] == pytest.approx(LENGTH_S - 0.01)


@pytest.mark.parametrize("kind", ["rg", "crg", "filtered"])
def test_estimates_are_those_of_the_log(log: Path, flight: Flight, kind: str) -> None:
    of = records(log, WingShapeEstimate, f"*/estimate_{kind}")
    estimates = flight.estimates[kind]
    assert (estimates.kind, estimates.wing, estimates.basis) == (kind, "right", of[0].basis)
    names = ("phi_rad", "theta_sigma_rad", "bias_rad_s", "line_in_body_m", "marker_px", "nis")
    assert_rows_are(estimates, of, "t_ns", *names, "used")
    assert_array_equal(estimates.tip_in_body_m, [one.line_in_body_m[-1] for one in of])
    assert estimates.amplitude_rad.shape == (len(of), 3)


def test_tracks_truth_health_and_events_are_those_of_the_log(log: Path, flight: Flight) -> None:
    assert_rows_are(
        flight.tracks, records(log, MarkerTracks), "t_ns", "frame_index", "pixel", "found"
    )
    assert (flight.tracks.camera, flight.tracks.tracker) == ("root", "led")
    assert_array_equal(flight.tracks.arrival_ns - flight.tracks.t_ns, 40_000_000)
    assert_rows_are(flight.truth, records(log, Truth), "marker_in_body_m", "line_in_body_m")
    assert flight.truth.phi_rad is None
    assert flight.health.last == {"can0": {"bus_off": 1, "frames": 900}}
    assert_array_equal(flight.health.counts("can0", "frames")[1], [900])
    assert flight.events == tuple(records(log, Event))


def test_topics_are_counted_in_order_of_appearance(log: Path, flight: Flight) -> None:
    counted = Counter(m.topic for m in LogReader(log).messages(decode_images=False))
    assert {topic: one.count for topic, one in flight.topics.items()} == dict(counted)
    assert list(flight.topics) == list(counted)
    assert flight.duration_s == pytest.approx(LENGTH_S)
    assert flight.topics["/imu/0"].rate_hz == pytest.approx(100)


def test_pictures_come_one_by_one_and_by_number(log: Path, flight: Flight) -> None:
    of = records(log, object, "/camera/*/image")
    frames = flight.frames()
    assert len(frames) == len(of) == 90
    assert_array_equal(frames.t_ns, [one.t_ns for one in of])
    for frame, encoded in zip(frames, of, strict=True):
        assert (frame.t_ns, frame.index) == (encoded.t_ns, encoded.index)
        assert (frame.image == encoded.index).all()
    assert frames.with_index(77).image[0, 0] == 77
    assert frames[-1].index == 89
    with pytest.raises(RecordingError, match="no frame 90 of camera root"):
        frames.with_index(90)
    with pytest.raises(IndexError):
        _ = frames[90]


def test_absent_quantities_are_none_or_nan(tmp_path: Path) -> None:
    zero, force = np.zeros(3), np.array([0.0, 0.0, -9.8])
    items = [
        (0, ImuSample(0, "0", 0, zero)),
        (1, ImuSample(1, "0", 1, zero, force)),
        (2, ImuSample(2, "0", 2, zero)),
    ]
    samples = read_flight(write(tmp_path / "a.mcap", items)).imu["0"]
    assert samples.magnetic_flux_t is None
    assert samples.specific_force_m_s2 is not None
    nothing = np.full(3, np.nan)
    assert_array_equal(samples.specific_force_m_s2, [nothing, force, nothing])


def test_covariances_stand_at_the_estimates_that_carry_one(tmp_path: Path) -> None:
    items = [(t, estimate(t, "crg")) for t in range(6)]
    with_one = items[4][1]
    P = np.arange(9.0).reshape(3, 3)
    object.__setattr__(with_one, "covariance", P)
    found = read_flight(write(tmp_path / "a.mcap", items)).estimates["crg"].covariance
    assert found is not None
    assert_array_equal(found.t_ns, [4])
    assert_array_equal(found.P, [P])
    without = read_flight(write(tmp_path / "b.mcap", items[:4])).estimates["crg"]
    assert without.covariance is None


def test_late_records_keep_their_place_until_they_are_ordered(tmp_path: Path) -> None:
    times = [30, 10, 20, 10, 40]
    items = [(100 + n, ImuSample(t, "0", n, np.full(3, float(n)))) for n, t in enumerate(times)]
    samples = read_flight(write(tmp_path / "a.mcap", items)).imu["0"]
    assert_array_equal(samples.t_ns, times)
    ordered = in_time_order(samples)
    assert_array_equal(ordered.t_ns, [10, 20, 30, 40])
    assert_array_equal(ordered.seq, [3, 2, 0, 4])
    assert_array_equal(ordered.rate_rad_s[:, 0], [3, 2, 0, 4])
    assert in_time_order(ordered) is ordered


def test_arrays_cannot_be_changed_by_accident(flight: Flight) -> None:
    with pytest.raises(ValueError, match="read-only"):
        flight.imu["0"].rate_rad_s[0, 0] = 1.0


def test_several_wings_and_cameras_are_chosen_by_name(tmp_path: Path) -> None:
    def of(wing: str, t_ns: int) -> WingShapeEstimate:
        one = estimate(t_ns, "crg")
        object.__setattr__(one, "wing", wing)
        return one

    items = [(t, of(wing, t)) for t in range(3) for wing in ("left", "right")]
    image = np.zeros((4, 4), np.uint8)
    items += [(9, Frame(9, camera, 0, image)) for camera in ("port", "starboard")]
    flight = read_flight(write(tmp_path / "a.mcap", items))
    assert len(flight.wings["left"].estimates["crg"].t_ns) == 3
    with pytest.raises(RecordingError, match=r"holds wings left, right; choose one: \.wings"):
        _ = flight.estimates
    with pytest.raises(RecordingError, match="holds cameras port, starboard"):
        flight.frames()
    assert flight.frames("port")[0].camera == "port"
    with pytest.raises(RecordingError, match="no frames of camera root"):
        flight.frames("root")
    assert {"estimate_crg", "estimate_crg_right", "frames_starboard"} <= set(flight.tables)


def test_what_a_log_lacks_is_said(tmp_path: Path) -> None:
    flight = read_flight(write(tmp_path / "a.mcap", [(5, estimate(5, "crg"))]))
    with pytest.raises(RecordingError, match=r"a\.mcap: holds no truth"):
        _ = flight.truth
    with pytest.raises(RecordingError, match=r"a\.mcap: holds no records of cameras"):
        _ = flight.tracks
    assert flight.health.last == {}
    assert flight.events == ()
    with pytest.raises(RecordingError, match="holds no table 'imu_0'; it has estimate_crg"):
        flight.table("imu_0")


def test_damage_is_carried_along(log: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    flight = read_flight(cut)
    reader = LogReader(cut)
    found = list(reader.messages(decode_images=False))
    assert flight.damage == reader.damage != Damage()
    assert sum(one.count for one in flight.topics.values()) == len(found) > 100
    assert [frame.index for frame in flight.frames()] == flight.frames().index.tolist()


def test_arrays_are_there_although_the_configuration_is_damaged(log: Path, tmp_path: Path) -> None:
    data = bytearray(log.read_bytes())
    data[data.index(b'"span_m"') + 1] ^= 1
    (tmp_path / "a.mcap").write_bytes(data)
    flight = read_flight(tmp_path / "a.mcap")
    assert len(flight.estimates["crg"].t_ns) == round(LENGTH_S * 100)
    with pytest.raises(RecordingError, match=r"config\.json"):
        _ = flight.config


def test_other_topics_are_counted_and_not_decoded(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded = counted_decoders(monkeypatch)
    flight = read_flight(log, ["/imu/*"])
    assert list(flight.imu) == ["0", "1"]
    assert set(decoded) == {"avionics.ImuSample"}
    assert flight.topics["/camera/root/image"].count == 90
    assert flight.wings["right"].estimates == {}


def test_a_record_without_columns_is_counted(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(KEPT, Truth)
    flight = read_flight(log)
    assert flight.topics["/wing/right/truth"].count == round(LENGTH_S * 50)
    assert flight.wing.truth is None


def test_two_lines_give_a_pandas_table(log: Path) -> None:
    pytest.importorskip("pandas")
    flight = read_flight(log)
    table = flight.table("estimate_crg").to_pandas()
    assert (
        table["tip_z_m"].to_numpy().tolist()
        == flight.estimates["crg"].line_in_body_m[:, -1, 2].tolist()
    )
    assert table["t_ns"].dtype == np.int64
    assert flight.table("/event").to_pandas()["message"][0] == "silent <0.2 s> & back"
    assert flight.table("/health").to_pandas()["count"].sum() == 901


def test_without_pandas_the_remedy_is_said(flight: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(AvionicsError, match=r'needs pandas: pip install "wing-avionics\[desk\]"'):
        flight.table("imu_0").to_pandas()


def counted_decoders(monkeypatch: pytest.MonkeyPatch) -> dict[str, Counter[bytes]]:
    """Count by schema how often each message is decoded."""
    counts: dict[str, Counter[bytes]] = {}

    def counting(schema: str, decode):
        def counted(data: bytes, sequence: int, offset_ns: int):
            counts.setdefault(schema, Counter())[data] += 1
            return decode(data, sequence, offset_ns)

        return counted

    for schema, decode in dict(DECODER_OF).items():
        monkeypatch.setitem(DECODER_OF, schema, counting(schema, decode))
    return counts


def write_report(flight: Flight, folder: Path) -> None:
    pytest.importorskip("matplotlib")
    from avionics.report.build import write_report

    write_report(flight, folder / "report.html")


@pytest.mark.parametrize(
    ("use", "pictures"),
    [
        (lambda flight, _: evaluate(flight), 0),
        (export, 0),
        (lambda flight, _: info_text(flight), 0),
        (write_report, 4),
    ],
    ids=["evaluate", "export", "info", "report"],
)
def test_one_pass_decodes_each_message_once(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, use, pictures: int
) -> None:
    held = sum(1 for _ in LogReader(log).messages(decode_images=False))
    decoded = counted_decoders(monkeypatch)
    chunks: Counter[int] = Counter()
    unpack = scan._unpacked

    def counted(body: bytes) -> bytes:
        chunks[hash(body)] += 1
        return unpack(body)

    monkeypatch.setattr(scan, "_unpacked", counted)
    use(read_flight(log), tmp_path)
    assert all(count == 1 for of in decoded.values() for count in of.values())
    images = decoded.pop("foxglove.CompressedImage", Counter())
    assert sum(images.values()) == pictures
    assert sum(map(len, decoded.values())) == held - 90
    # The head of the file reaches into its first chunk; each picture is looked up in its own.
    assert chunks.total() <= len(chunks) + 1 + pictures


BYTES_OF = {"imu": 56, "estimate": 782, "image": 40}
"""What a record costs: a sample of a gyro alone; an estimate of 3 modes, 16 points, 6 markers."""
OVERHEAD = 1.15
"""A column that grows is at most an eighth longer than what is in it."""
PASS_BYTES = 3_000_000
"""One chunk, packed and unpacked, and what was imported on the way."""


def peak_bytes(use) -> int:
    tracemalloc.start()
    try:
        use()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_is_that_of_the_numbers(tmp_path: Path) -> None:
    """GIVEN a long log with pictures THEN neither records nor pictures are held."""
    log, rng = tmp_path / "long.mcap", np.random.default_rng(1)
    shape = estimate(0, "crg")
    with LogWriter(log, CONFIG) as writer:
        for number in range(16_000):
            t_ns = number * 10_000_000
            writer.write(ImuSample(t_ns, "0", number, np.zeros(3)), t_ns)
            if number % 4 == 0:
                writer.write(replace(shape, t_ns=t_ns), t_ns)
            if number % 400 == 0:
                noise = rng.integers(0, 256, (480, 640), dtype=np.uint8)
                writer.write(Frame(t_ns, "root", number, noise), t_ns)
    assert log.stat().st_size > 10_000_000
    list(LogReader(log).messages(["/event"]))  # imports are nobody's memory
    flight = read_flight(log)
    peak = peak_bytes(lambda: flight.imu)
    expected = 16_000 * BYTES_OF["imu"] + 4000 * BYTES_OF["estimate"] + 40 * BYTES_OF["image"]
    assert expected <= peak <= OVERHEAD * expected + PASS_BYTES
    samples, frames = flight.imu["0"], flight.frames()
    assert len(samples.t_ns) == 16_000
    # One picture and its chunk.
    assert peak_bytes(lambda: sum(int(frame.image[0, 0]) for frame in frames)) < PASS_BYTES
    held = peak_bytes(lambda: list(LogReader(log).messages(decode_images=False)))
    assert held > 2 * (OVERHEAD * expected + PASS_BYTES)
