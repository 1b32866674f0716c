"""Write short_flight.json: what a simulated flight measured, and what the estimators made of it.

    python tests/data/make_short_flight.py

Run it only when estimates are meant to change; the difference then stands in the commit.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from avionics.analysis.replay import replay
from avionics.recording import LogReader
from avionics.records import MarkerTracks, WingShapeEstimate
from drivers.samples import ImuSample

HERE = Path(__file__).parent
STORED = HERE / "short_flight.json"
FORMS = ("general", "paper")
EVERY = 25
SCENARIO = """
name = "short"
duration_s = 3.0

[[loads]]
kind = "sweep"
at_s = 0.3
for_s = 2.6
from_hz = 0.8
to_hz = 4.0
amplitude_m = 0.4
torque_nm = 0.6
"""


def expectation(row: WingShapeEstimate) -> dict[str, object]:
    """Return the numbers of a row that are stored."""
    return {
        "t_ns": row.t_ns,
        "phi_rad": row.phi_rad.tolist(),
        "theta_rad": row.theta_rad.tolist(),
        "tip_in_body_m": row.line_in_body_m[-1].tolist(),
        "tip_sigma_m": row.tip_sigma_m.tolist(),
        "marker_px": row.marker_px.tolist(),
    }


def rows_of(log: Path) -> dict[str, list[dict[str, object]]]:
    """Return some rows of every kind of estimate."""
    found: dict[str, list[dict[str, object]]] = {}
    for message in LogReader(log).messages(["/wing/*/estimate_*"]):
        found.setdefault(message.record.kind, []).append(expectation(message.record))
    return {kind: rows[EVERY::EVERY] for kind, rows in found.items()}


def event_of(record: object, arrival_ns: int) -> list[object]:
    """Return one measurement as plain numbers."""
    if isinstance(record, ImuSample):
        rate = record.rate_rad_s.tolist()
        return ["imu", arrival_ns, record.t_ns, record.pod, record.seq, rate]
    assert isinstance(record, MarkerTracks)
    tracks = [record.pixel.tolist(), record.sigma_px.tolist(), record.found.tolist()]
    return ["tracks", arrival_ns, record.t_ns, record.camera, record.frame_index, *tracks]


def write() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "short.toml").write_text(SCENARIO, encoding="utf-8")
        flown = folder / "flown.mcap"
        words = ["sim", "--scenario", folder / "short.toml", "--duration", "3", "-o", flown]
        command = [sys.executable, "-m", "avionics", *words, "--set", "recorder.images=false"]
        subprocess.run([str(word) for word in command], check=True)
        expected = {}
        for form in FORMS:
            output = folder / f"{form}.mcap"
            replay(flown, output, overrides=(f"estimator.form={form}",))
            expected[form] = rows_of(output)
        reader = LogReader(flown)
        events = [
            event_of(message.record, message.arrival_ns)
            for message in reader.messages(["/imu/*", "/camera/*/tracks"])
        ]
        stored = {
            "config": reader.config.model_dump(mode="json"),
            "events": events,
            "expected": expected,
        }
    lines = [json.dumps(event) for event in stored.pop("events")]
    text = json.dumps(stored)[:-1] + ', "events": [\n' + ",\n".join(lines) + "\n]}\n"
    STORED.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write()
