"""GIVEN the packaged wing and scenario WHEN it flies ten seconds THEN the whole chain holds."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from avionics.recording import LogReader

pytestmark = pytest.mark.slow


def test_gyros_alone_drift_and_the_camera_bounds_them(avionics, short_flight: Path) -> None:
    done = avionics("evaluate", short_flight, "--json")
    assert done.status == 0, done.err
    figures = json.loads(done.out)
    assert figures["truth"] == "sim"
    assert figures["crg"]["eq17_px"]["median"] < 1.0
    assert figures["crg"]["eq17_px"]["p95"] < 2.5
    assert figures["rg"]["eq17_px"]["median"] > 2 * figures["crg"]["eq17_px"]["median"]
    assert figures["crg"]["tip_mm"]["rmse"] < 5.0


def test_export_holds_the_contract_columns(avionics, short_flight: Path, tmp_path: Path) -> None:
    assert avionics("export", short_flight, "-o", tmp_path / "tables").status == 0
    with (tmp_path / "tables" / "estimate_crg.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    wanted = ["t_ns", "phi_1_rad", "theta_1_rad", "marker_0_u_px", "marker_5_v_px", "tip_z_m"]
    for column in wanted:
        assert column in rows[0]
        assert column == "t_ns" or f"{column}_sigma" in rows[0]
    times_ns = np.array([int(row["t_ns"]) for row in rows])
    assert (np.diff(times_ns) == 10_000_000).all()
    assert len(rows) > 900
    with (tmp_path / "tables" / "tracks.csv").open() as stream:
        header = next(csv.reader(stream))
    assert header == ["t_ns", "frame", "marker", "u_px", "v_px", "sigma_px", "found"]


def test_same_seed_gives_the_same_log(avionics, tmp_path: Path) -> None:
    logs = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for log in logs:
        assert avionics("sim", "--duration", "2", "--seed", "5", "-o", log).status == 0
    assert logs[0].read_bytes() == logs[1].read_bytes()


def test_replay_repeats_the_estimates_bit_for_bit(
    avionics, short_flight: Path, tmp_path: Path
) -> None:
    again = tmp_path / "again.mcap"
    assert avionics("replay", short_flight, "-o", again).status == 0
    assert estimates(again) == estimates(short_flight)


def estimates(log: Path) -> list[bytes]:
    found = []
    with LogReader(log) as reader:
        for message in reader.messages():
            if "/estimate_" in message.topic:
                record = message.record
                found.append(
                    b"".join(
                        (
                            message.topic.encode(),
                            record.t_ns.to_bytes(8, "little"),
                            record.phi_rad.tobytes(),
                            record.theta_rad.tobytes(),
                            record.psi_rad.tobytes(),
                            record.marker_px.tobytes(),
                            record.marker_sigma_px.tobytes(),
                        )
                    )
                )
    assert len(found) > 1000
    return found


def test_a_damaged_log_is_read_with_a_warning(avionics, short_flight: Path, tmp_path: Path) -> None:
    content = bytearray(short_flight.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 100] = bytes(100)
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(content)
    for command in (
        ("evaluate", broken),
        ("export", broken, "-o", tmp_path / "tables"),
        ("replay", broken, "--no-images", "-o", tmp_path / "again.mcap"),
    ):
        done = avionics(*command)
        assert done.status == 0, done
        assert done.err.startswith(f"{broken}: damage: damaged chunks: 1"), done
    assert avionics("evaluate", short_flight).err == ""
