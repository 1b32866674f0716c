"""What the bench plays back is what it would have computed."""

import uuid
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from avionics.config.load import default_config_text, parse_config_text
from sim_bus.bench import prepare as preparing
from sim_bus.bench.bench import Bench, BenchOptions
from sim_bus.bench.build import open_bench
from sim_bus.bench.places import Offer
from sim_bus.bench.prepare import prepare
from sim_bus.buses.factory import generator
from sim_bus.buses.faults import Fault
from sim_bus.camera.sim_camera import PAINTED_FAULTS, Exposure
from sim_bus.wing.build import make_wing
from sim_bus.wing.motion import PodMotion
from sim_bus.wing.scenario import parse_scenario

pytestmark = pytest.mark.slow

SECONDS, SECOND = 1.2, 1_000_000_000
LOADS = [{"kind": "sweep", "at_s": 0.1, "for_s": 9.0, "from_hz": 2.0, "to_hz": 3.0}]
SCENARIO = parse_scenario({"name": "waves", "loads": LOADS, "truth_hz": 50.0}, origin="here")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """A started bench that plays 1.2 s back and computes what follows."""
    folder = tmp_path_factory.mktemp("bench")
    config = parse_config_text(default_config_text(), (), origin="packaged")
    offer = Offer(can=f"bench-{uuid.uuid4().hex[:8]}", interface="simbus")
    options = BenchOptions(offer=offer, camera="pipe", folder=folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        with open_bench(config, SCENARIO, options) as opened:
            prepare(opened, SECONDS, lambda *_: None)
            opened.start(30.0)
            yield opened


@pytest.fixture(scope="module")
def computed(bench: Bench):
    """The same wing, computed."""
    rng = generator(bench.seed, "wing")
    return make_wing(bench.config, bench.scenario, rng=rng, epoch_ns=bench.wing.epoch_ns)


def instants(bench: Bench, from_s: float, to_s: float, count: int = 301) -> np.ndarray:
    return bench.wing.epoch_ns + np.linspace(from_s * 1e9, to_s * 1e9, count).astype(np.int64)


@pytest.mark.parametrize(("from_s", "to_s"), [(-0.4, 0.3), (0.5, SECONDS), (1.1, 1.5)])
def test_chips_feel_the_computed_motion(bench: Bench, computed, from_s, to_s) -> None:
    times = instants(bench, from_s, to_s)
    for pod in bench.config.pods:
        wanted, found = PodMotion(computed, pod), bench.motions[pod.name]
        for one, other, tolerance in zip(
            found.sense(times), wanted.sense(times), (1e-4, 5e-3, 1e-9), strict=True
        ):
            assert np.abs(one - other).max() < tolerance
            assert np.ptp(other, axis=0).max() > tolerance
        assert np.abs(found.attitude(times[170]) - wanted.attitude(times[170])).max() < 1e-6


def test_truth_is_the_computed_one(bench: Bench, computed) -> None:
    for number in (0, 7, 60, 61, 75):  # 60: the last that is prepared
        t_ns = bench.wing.epoch_ns + number * SECOND // 50
        found, wanted = bench.truth(t_ns), computed.truth(t_ns)
        assert (found.t_ns, found.wing) == (wanted.t_ns, wanted.wing)
        for name in ("line_in_body_m", "marker_in_body_m", "phi_rad", "theta_rad", "psi_rad"):
            assert np.allclose(getattr(found, name), getattr(wanted, name), atol=1e-12)


def exposure(bench: Bench, number: int) -> Exposure:
    assert bench.camera is not None
    index = bench.camera._first + number
    return Exposure(index, bench.camera._instant_ns(index, 0.0), 0)


@pytest.mark.parametrize("number", [-1, 0, 20, 35, 36, 40])
def test_pictures_show_the_markers_where_they_are(bench: Bench, computed, number: int) -> None:
    assert bench.camera is not None
    shot = exposure(bench, number)
    image = bench.camera.frame(shot).image.astype(float)
    eye = bench.make_camera(computed, bench.faults, start_ns=bench.wing.epoch_ns)
    pixel, visible = eye.marker_pixels(shot.t_ns)
    for u, v in pixel[visible]:
        left, top = round(u) - 6, round(v) - 6
        part = np.clip(image[top : top + 13, left : left + 13] - 120.0, 0.0, None)
        rows, columns = np.mgrid[top : top + 13, left : left + 13]
        found = np.array([(part * columns).sum(), (part * rows).sum()]) / part.sum()
        assert np.abs(found - (u, v)).max() < 0.5


def test_prepared_picture_is_painted_only_under_a_fault(bench: Bench, monkeypatch) -> None:
    assert bench.camera is not None
    shot, painted = exposure(bench, 12), []
    paint = bench.camera._paint
    monkeypatch.setattr(bench.camera, "_paint", lambda *a: painted.append(1) or paint(*a))
    plain = bench.camera.frame(shot).image
    assert not painted
    for kind in PAINTED_FAULTS:
        fault = Fault(kind, "camera", shot.t_ns - 1, shot.t_ns + 1, value=0.3)
        bench.faults.faults.append(fault)
        changed = bench.camera.frame(shot).image
        bench.faults.faults.remove(fault)
        assert painted.pop()
        assert np.abs(changed.astype(int) - plain).max() > 60


def test_flight_is_computed_once(bench: Bench, monkeypatch) -> None:
    again = open_bench(
        bench.config.model_copy(update={"camera": None}), SCENARIO,
        BenchOptions(offer=Offer(can=uuid.uuid4().hex, interface="simbus")),
    )  # fmt: skip
    with again:
        calls = []
        first = prepare(again, SECONDS, lambda *_: calls.append(1))
        assert calls
        second = prepare(again, SECONDS, lambda *_: pytest.fail("computed again"))
        assert np.array_equal(first.line_m, second.line_m)
        assert np.array_equal(first.motion["0"], second.motion["0"])
        monkeypatch.setattr(preparing, "cache_folder", lambda _: None)
        calls.clear()
        prepare(again, SECONDS, lambda *_: calls.append(1))
        assert calls


def test_spoilt_file_is_computed_again(bench: Bench, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(preparing, "cache_folder", lambda _: tmp_path)
    options = BenchOptions(offer=Offer(can=uuid.uuid4().hex, interface="simbus"))
    config = bench.config.model_copy(update={"camera": None})
    with open_bench(config, SCENARIO, options) as again:
        calls: list[int] = []
        prepare(again, 0.3, lambda *_: calls.append(1))
        (file,) = tmp_path.iterdir()
        file.write_bytes(file.read_bytes()[:-1000])
        count = len(calls)
        prepare(again, 0.3, lambda *_: calls.append(1))
        assert len(calls) == 2 * count


def test_cache_keeps_the_newest_flights(bench: Bench, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(preparing, "cache_folder", lambda _: tmp_path)
    for number in range(preparing.KEPT_FLIGHTS + 3):
        (tmp_path / f"old-{number}.npz").write_bytes(b"")
    options = BenchOptions(offer=Offer(can=uuid.uuid4().hex, interface="simbus"))
    config = bench.config.model_copy(update={"camera": None})
    with open_bench(config, SCENARIO, options) as again:
        prepare(again, 0.3, lambda *_: None)
    kept = [file.name for file in tmp_path.iterdir()]
    assert len(kept) == preparing.KEPT_FLIGHTS
    assert any(name.startswith("waves-") for name in kept)
