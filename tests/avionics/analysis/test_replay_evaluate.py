"""Replay and evaluation of an imported set: bits, options, figures against their definition."""

import numpy as np
import pytest

from avionics.analysis.evaluate import evaluate
from avionics.analysis.flight import read_flight
from avionics.analysis.replay import replay
from avionics.datasets.importer import import_set
from avionics.errors import ConfigError, RecordingError
from avionics.recording import EncodedFrame, LogReader, LogWriter
from avionics.records import Truth, WingShapeEstimate
from tests.avionics.conftest import make_set

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    made = make_set(folder / "set", seconds=7.5)
    imported, flown = folder / "imported.mcap", folder / "flown.mcap"
    import_set(made.path, imported, calibrate=True)
    replay(imported, flown)
    return made, imported, flown


def estimates(log) -> list[bytes]:
    return [
        m.record.kind.encode() + m.record.phi_rad.tobytes() + m.record.marker_px.tobytes()
        for m in LogReader(log).messages()
        if isinstance(m.record, WingShapeEstimate)
    ]


def test_replay_twice_gives_the_same_file(logs, tmp_path) -> None:
    _, imported, flown = logs
    replay(imported, tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == flown.read_bytes()


def test_tracks_of_the_log_are_used_unless_asked(logs, tmp_path) -> None:
    _, _, flown = logs
    summary = replay(flown, tmp_path / "a.mcap")
    assert summary.tracked == 0
    assert estimates(tmp_path / "a.mcap") == estimates(flown)
    assert replay(flown, tmp_path / "b.mcap", retrack=True).tracked > 200


def test_images_are_left_out_on_request(logs, tmp_path) -> None:
    _, _, flown = logs
    replay(flown, tmp_path / "a.mcap", images=False)
    records = [m.record for m in LogReader(tmp_path / "a.mcap").messages(decode_images=False)]
    assert not any(isinstance(record, EncodedFrame) for record in records)
    assert estimates(tmp_path / "a.mcap") == estimates(flown)


def test_overrides_change_the_filter(logs, tmp_path) -> None:
    _, _, flown = logs
    replay(flown, tmp_path / "a.mcap", overrides=("estimator.form=paper",), images=False)
    reader = LogReader(tmp_path / "a.mcap")
    assert reader.config.estimator.form == "paper"
    bases = {m.record.basis for m in reader.messages() if isinstance(m.record, WingShapeEstimate)}
    assert bases == {"quarter-sine/1+1+0"}
    with pytest.raises(ConfigError, match=r"estimator\.from"):
        replay(flown, tmp_path / "b.mcap", overrides=("estimator.from=paper",))


def test_a_log_is_not_replayed_onto_itself(logs) -> None:
    _, imported, _ = logs
    with pytest.raises(RecordingError, match="is the log itself"):
        replay(imported, imported, force=True)


def test_estimates_follow_the_motion_capture(logs) -> None:
    figures = evaluate(read_flight(logs[2])).to_json_dict()
    assert figures["truth"] == "mocap"
    assert figures["filtered"]["eq17_px"]["median"] < 0.8
    assert figures["crg"]["eq17_px"]["p95"] < 1.5
    # A pixel of this camera is 5 mm at the tip, and no chessboard told its lens.
    assert figures["crg"]["tip_mm"]["rmse"] < 6.0
    assert figures["tracks"]["found"] > 0.98


def test_eq17_and_tip_against_their_definition(logs, tmp_path) -> None:
    """GIVEN estimates that are the truth bent by 0.01 rad THEN the figures are that bend's."""
    made, imported, _ = logs
    reader = LogReader(imported)
    log = tmp_path / "hand.mcap"
    template = next(
        m.record for m in LogReader(logs[2]).messages() if isinstance(m.record, WingShapeEstimate)
    )
    t0 = None
    with LogWriter(log, reader.config) as writer:
        for message in reader.messages(decode_images=False):
            record = message.record
            if isinstance(record, Truth | EncodedFrame):
                writer.write(record, message.arrival_ns)
            if isinstance(record, Truth):
                t0 = record.t_ns if t0 is None else t0
                from tests.avionics.conftest import EPOCH_NS

                q = made.q(np.array([(record.t_ns - EPOCH_NS) * 1e-9]))[0] + (0.01, 0.0)
                line = np.zeros((3, 3))
                writer.write(_estimate(template, record.t_ns, q, line), message.arrival_ns)
    figures = evaluate(read_flight(log)).to_json_dict()["crg"]
    t_s = np.arange(6.1, 8.9, 0.01)
    camera = reader.config.camera
    from avionics.flight.filter_setup import pinhole_from_config

    lens = pinhole_from_config(camera)
    here = lens.project(made.model.points(made.q(t_s)))
    there = lens.project(made.model.points(made.q(t_s) + (0.01, 0.0)))
    expected = np.median(np.linalg.norm(there - here, axis=2).mean(axis=1))
    assert figures["eq17_px"]["median"] == pytest.approx(expected, rel=0.05)
    assert abs(figures["eq17_px"]["slope_per_min"]) < 5.0


def _estimate(like, t_ns, q, line):
    from dataclasses import replace as changed

    return changed(
        like, t_ns=t_ns, kind="crg", basis="quarter-sine/1+1+0", phi_rad=q[:1], theta_rad=q[1:],
        psi_rad=np.zeros(0), line_in_body_m=line, phi_sigma_rad=q[:1], theta_sigma_rad=q[1:],
        psi_sigma_rad=np.zeros(0),
    )  # fmt: skip


def test_evaluation_says_what_is_missing(logs, tmp_path) -> None:
    _, imported, _ = logs
    with pytest.raises(RecordingError, match="avionics replay"):
        evaluate(read_flight(imported))
    made = make_set(tmp_path / "set", seconds=1.0)
    (made.path / "mocap.csv").unlink()
    import_set(made.path, tmp_path / "a.mcap")
    replay(tmp_path / "a.mcap", tmp_path / "b.mcap")
    with pytest.raises(RecordingError, match="no truth"):
        evaluate(read_flight(tmp_path / "b.mcap"))


def test_short_log_is_refused(tmp_path) -> None:
    made = make_set(tmp_path / "set", seconds=2.0)
    import_set(made.path, tmp_path / "a.mcap")
    replay(tmp_path / "a.mcap", tmp_path / "b.mcap")
    with pytest.raises(RecordingError, match="first 6 s"):
        evaluate(read_flight(tmp_path / "b.mcap"))
