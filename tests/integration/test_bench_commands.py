"""Commands of the bench that are refused or fail leave nothing behind that they should not."""

import json
import socket
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from sim_bus.bench.client import RefusedError, ask
from sim_bus.bench.control import ControlServer
from sim_bus.bench.frame_server import FrameServer
from sim_bus.guests import tiers
from sim_bus.guests.guest import GuestResult
from sim_bus.guests.kinds import RUNNERS


@pytest.fixture
def living(tmp_path: Path) -> Iterator[Path]:
    """Control socket and camera socket of a bench that runs; returns the former."""
    with ControlServer(tmp_path / "c.sock", lambda _: {"here": True}) as server:
        frames = FrameServer(tmp_path / "camera.sock", 30.0)
        yield server.path
        frames.close()


def answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as caller:
        return caller.connect_ex(str(path)) == 0


def serve(avionics, folder: Path, *words: object):
    channel = f"bench-{uuid.uuid4().hex[:8]}"
    return avionics(
        "rig", "serve", "default", "--can", channel, "--interface", "simbus", *words,
        "-o", folder / "truth.mcap",
    )  # fmt: skip


def test_second_bench_is_refused_and_harms_nothing(avionics, living: Path, tmp_path: Path) -> None:
    config = tmp_path / "fly.toml"
    done = serve(
        avionics, tmp_path, "--camera", "pipe", "--control", living, "--write-config", config
    )
    assert done.status == 1
    assert "another bench" in done.err
    assert ask(living, {"do": "status"}) == {"here": True}
    assert answers(tmp_path / "camera.sock")
    assert not (tmp_path / "truth.mcap").exists()
    assert not config.exists()


def test_bench_beside_a_living_camera_is_refused(avionics, living: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.sock"
    done = serve(avionics, tmp_path, "--camera", "pipe", "--control", own)
    assert done.status == 1
    assert "camera socket" in done.err
    assert answers(tmp_path / "camera.sock")
    assert not (tmp_path / "truth.mcap").exists()
    assert not own.exists()


def test_bench_that_cannot_open_leaves_the_old_truth(avionics, tmp_path: Path) -> None:
    truth = tmp_path / "truth.mcap"
    truth.write_bytes(b"precious")
    done = avionics(
        "rig", "serve", "default", "--can", "nocan9", "--control", tmp_path / "c.sock",
        "-o", truth, "--force",
    )  # fmt: skip
    assert done.status == 1
    assert truth.read_bytes() == b"precious"
    assert not (tmp_path / "c.sock").exists()


def test_bench_runs_to_its_end_and_cleans_up(avionics, tmp_path: Path) -> None:
    path = tmp_path / "c.sock"
    dead = socket.socket(socket.AF_UNIX)
    dead.bind(str(path))  # what a killed bench leaves
    dead.close()
    done = serve(
        avionics, tmp_path, "--lead", "1.5", "--duration", "0.2", "--json", "--control", path
    )
    assert done.status == 0, done.err
    assert json.loads(done.out)["control"] == str(path)
    assert (tmp_path / "truth.mcap").stat().st_size > 10_000
    assert not path.exists()


@pytest.mark.parametrize(
    ("elapsed_s", "was_started", "words"),
    [
        (-2.0, False, "the scenario begins in 2.0 s"),
        (-1.2, True, "the bench was started already; the scenario begins in 1.2 s"),
        (7.5, True, "the bench was started already; the scenario began 7.5 s ago"),
    ],
)
def test_start_says_what_the_bench_answered(
    avionics, tmp_path: Path, elapsed_s, was_started, words
) -> None:
    answer = {"epoch_ns": 0, "elapsed_s": elapsed_s, "was_started": was_started}
    with ControlServer(tmp_path / "c.sock", lambda _: answer) as server:
        done = avionics("rig", "start", "--control", server.path)
    assert done.status == 0, done.err
    assert done.out.strip() == words


def test_what_is_no_socket_is_not_removed(tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("precious")
    with pytest.raises(RefusedError, match="another kind"):
        ControlServer(notes)
    assert notes.read_text() == "precious"


def test_bench_that_still_opens_says_so(tmp_path: Path) -> None:
    with ControlServer(tmp_path / "c.sock") as server:
        with pytest.raises(RefusedError, match="still opening"):
            ask(server.path, {"do": "status"})
        server.answer_with(lambda _: {"here": True})
        assert ask(server.path, {"do": "status"}) == {"here": True}


def test_camera_device_without_its_camera_is_refused(avionics, tmp_path: Path) -> None:
    done = serve(avionics, tmp_path, "--camera-device", "/dev/video10")
    assert done.status == 1
    assert "--camera v4l2" in done.err
    assert not (tmp_path / "truth.mcap").exists()


def test_serial_lines_that_no_pod_would_use_are_refused(avionics, tmp_path: Path) -> None:
    done = serve(avionics, tmp_path, "--uart", "--control", tmp_path / "c.sock")
    assert done.status == 1
    assert 'link = { kind = "uart"' in done.err
    assert not (tmp_path / "truth.mcap").exists()


def test_stop_that_waited_in_vain_does_not_say_that_the_bench_ended(avionics, living: Path) -> None:
    done = avionics("rig", "stop", "--control", living, "--wait-s", "0.1")
    assert done.status == 1
    assert "--wait-s" in done.err
    assert "has ended" not in done.out


@pytest.fixture
def guest(monkeypatch: pytest.MonkeyPatch) -> dict:
    """Stands for the guest: leaves a file in RIG_OUT and ends with ``status``."""
    told: dict = {"status": 0}

    def run(command, out, **_):
        (out / "left").write_text("by the command")
        told["out"] = out
        return GuestResult(told["status"], out)

    monkeypatch.setitem(RUNNERS, "uml", run)
    return told


@pytest.mark.parametrize(("status", "is_kept"), [(0, False), (3, True)])
def test_temporary_folder_is_told_and_kept_only_after_a_failure(
    avionics, guest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, status: int, is_kept: bool
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    guest["status"] = status
    done = avionics("rig", "run", "--", "true")
    assert done.status == status
    assert str(guest["out"]) in done.err
    assert guest["out"].exists() == is_kept


def test_folder_of_ones_own_is_kept(avionics, guest, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    assert avionics("rig", "run", "--out", tmp_path / "out", "--", "true").status == 0
    assert (tmp_path / "out" / "left").exists()


def test_folder_with_a_space_is_refused_in_words(avionics, guest, tmp_path: Path) -> None:
    done = avionics("rig", "run", "--out", tmp_path / "my out", "--", "true")
    assert done.status == 1
    assert "has a space in it" in done.err
    assert "out" not in guest


def test_doctor_prints_brackets_as_they_are(avionics, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = (tiers.Piece("drivers [of others]", lambda: False, tiers.FOREIGN_PIP),)
    monkeypatch.setattr(tiers, "extras", lambda: missing)
    monkeypatch.setenv("COLUMNS", "250")
    done = avionics("rig", "doctor")
    assert "drivers [of others]" in done.out
    assert "pip install wing-avionics[foreign]" in done.out
