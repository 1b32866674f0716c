"""The bench in this process: where pods go, what commands do, and how pictures go out."""

import json
import socket
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from avionics.config.chips import Icm42688Settings
from avionics.config.links import CanLink, I2cLink, SpiLink, UartLink
from avionics.config.load import default_config_text, parse_config_text
from avionics.errors import ConfigError
from drivers.clock import SteadyClock
from drivers.errors import DeviceNotFoundError
from sim_bus.bench.bench import Bench, BenchOptions
from sim_bus.bench.build import open_bench
from sim_bus.bench.client import RefusedError, ask
from sim_bus.bench.control import BenchControl, ControlServer
from sim_bus.bench.places import Offer, place_pods
from sim_bus.bench.served_can import ServedCan
from sim_bus.buses.can_pod import SimPod
from sim_bus.wing.scenario import load_scenario
from tests.opening import open_imus

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def config():
    return parse_config_text(default_config_text(), (), origin="packaged")


@pytest.fixture
def channel() -> str:
    return f"bench-{uuid.uuid4().hex[:8]}"


@pytest.fixture
def bench(config, channel: str, tmp_path: Path) -> Iterator[Bench]:
    offer = Offer(can=channel, interface="simbus", pods=frozenset({0}))
    options = BenchOptions(offer=offer, folder=tmp_path)
    with open_bench(config, load_scenario("default"), options) as opened:
        yield opened


def test_pods_keep_their_own_kind_of_bus(config) -> None:
    places = place_pods(config, Offer(can="vcan0", i2c_dev=7))
    assert places["0"] == I2cLink(bus=7, address=0x28)
    assert places["1"] == CanLink(kind="can", interface="socketcan", channel="vcan0", node=1)


def test_pods_move_where_there_is_room(config) -> None:
    places = place_pods(config, Offer(can="vcan0"))
    assert [(link.channel, link.node) for link in places.values()] == [("vcan0", 0), ("vcan0", 1)]
    assert all(isinstance(p, UartLink) for p in place_pods(config, Offer(uart=True)).values())
    two = place_pods(config, Offer(i2c_dev=3)).values()
    assert len({(link.bus, link.address) for link in two}) == 2


def test_no_place_and_no_such_pod_are_named(config) -> None:
    with pytest.raises(ConfigError, match="one of --can CHANNEL, --uart, --i2c-dev N"):
        place_pods(config, Offer())
    with pytest.raises(ConfigError, match=r"no pod \[9\]"):
        place_pods(config, Offer(can="x", pods=frozenset({9})))


def test_pods_go_where_their_chip_can_be(config) -> None:
    chip, link = Icm42688Settings(kind="icm42688"), SpiLink(kind="spi")
    pods = [pod.model_copy(update={"chip": chip, "link": link}) for pod in config.pods]
    spi = config.model_copy(update={"pods": tuple(pods)})
    places = place_pods(spi, Offer(i2c_dev=3))
    assert [(link.bus, link.address) for link in places.values()] == [(3, 0x68), (3, 0x69)]
    with pytest.raises(ConfigError, match="pod 0: no bus to put its ICM-42688-P on; give one of"):
        place_pods(spi, Offer(can="vcan0"))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"uart": True}, r"--uart: no pod.*pod 0 on can.*kind = \"uart\""),
        ({"i2c_dev": 7, "pods": frozenset({1})}, "--i2c-dev: no pod"),
        ({"uart_devices": ("/dev/ttyUSB0",)}, "--uart: no pod"),
    ],
)
def test_bus_that_no_pod_would_use_is_refused(config, more, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        place_pods(_all_on_can(config), Offer(can="vcan0", **more))


def _all_on_can(config):
    pods = [
        pod.model_copy(
            update={"link": CanLink(kind="can", interface="virtual", channel="x", node=n)}
        )
        for n, pod in enumerate(config.pods)
    ]
    return config.model_copy(update={"pods": tuple(pods)})


def test_serial_port_without_a_pod_is_refused(config) -> None:
    ports = ("/dev/ttyUSB0", "/dev/ttyUSB1", "/dev/ttyUSB2")
    with pytest.raises(ConfigError, match="ttyUSB2: there are 2 pods"):
        place_pods(config, Offer(uart_devices=ports))


def test_unknown_interface_says_what_it_needs(config, tmp_path: Path) -> None:
    options = BenchOptions(offer=Offer(can="nocan9"), folder=tmp_path)
    with pytest.raises(DeviceNotFoundError, match=r"nocan9.*(ip link add|avionics rig run)"):
        open_bench(config, load_scenario("default"), options)


def test_simulated_pod_shares_the_bus_with_another(bench: Bench, channel, make_chip) -> None:
    clock = SteadyClock()
    other = ServedCan("simbus", channel, None, clock)
    other.start([SimPod(1, make_chip(), other.tap(), clock, uid=bytes(range(12)))])
    try:
        pods = [
            pod.model_copy(
                update={"link": CanLink(kind="can", interface="simbus", channel=channel, node=n)}
            )
            for n, pod in enumerate(bench.config.pods)
        ]
        imus = open_imus(pods, clock)
        heard: set[str] = set()
        give_up = time.monotonic() + 20
        while heard != {"0", "1"} and time.monotonic() < give_up:
            sample = imus.read(0.1)
            heard |= set() if sample is None else {sample.pod}
        imus.close()
        assert heard == {"0", "1"}
    finally:
        other.close()


@pytest.fixture
def said() -> list[str]:
    """Events that the truth log is given."""
    return []


@pytest.fixture
def control(bench: Bench, tmp_path: Path, said: list[str]) -> Iterator[Path]:
    path = tmp_path / "control.sock"
    with ControlServer(path, BenchControl(bench, threading.Event(), said.append)):
        yield path


def test_faults_are_switched_while_it_runs(bench: Bench, control: Path) -> None:
    imus = open_imus(bench.config.pods[:1])

    def silent_for_s(limit_s: float) -> float:
        start = time.monotonic()
        while time.monotonic() - start < limit_s:
            if imus.read(0.02) is not None:
                return time.monotonic() - start
        return limit_s

    try:
        ask(control, {"do": "fault", "on": True, "kind": "pod_silent", "target": "pod 0"})
        while imus.read(0.2) is not None:
            pass
        assert silent_for_s(0.5) == 0.5
        assert ask(control, {"do": "status"})["faults"] == [
            {"kind": "pod_silent", "target": "pod 0"}
        ]
        ask(control, {"do": "fault", "on": False, "kind": "pod_silent", "target": "pod 0"})
        assert silent_for_s(20.0) < 20.0
        assert ask(control, {"do": "status"})["faults"] == []
    finally:
        imus.close()


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"do": "fault", "on": True, "kind": "nak", "target": "pod 7"}, "pod 7.*not served"),
        ({"do": "fault", "on": True, "kind": "nonsense", "target": "*"}, "takes no effect"),
        ({"do": "fault", "on": True, "kind": "uart_late", "target": "pod 0"}, "takes no effect"),
        ({"do": "fault", "on": True, "kind": "camera_drop", "target": "*"}, "takes no effect"),
        ({"do": "dance"}, "unknown"),
        ({"do": "fault", "on": True}, "kind"),
    ],
)
def test_what_cannot_be_done_is_refused(control: Path, request_, words: str) -> None:
    with pytest.raises(RefusedError, match=words):
        ask(control, request_)


def fault(control: Path, on: bool, kind: str, target: str, **more: object) -> None:
    ask(control, {"do": "fault", "on": on, "kind": kind, "target": target, **more})


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"for_s": -5}, "--for -5: wants more than 0 s"),
        ({"for_s": 0}, "--for 0: wants more than 0 s"),
        ({"for_s": float("nan")}, "for_s is nan"),
        ({"probability": 0}, "--probability 0"),
        ({"value": float("inf")}, "value is inf"),
        ({"markers": [1]}, "only to marker_hidden"),
    ],
)
def test_switch_that_would_do_nothing_is_refused(control: Path, more, words: str) -> None:
    with pytest.raises(RefusedError, match=words):
        fault(control, True, "nak", "pod 0", **more)
    assert ask(control, {"do": "status"})["faults"] == []


def test_unknown_marker_is_refused_with_those_that_are_served(bench: Bench, control: Path) -> None:
    bench.shown = bench.config.camera
    bench.camera = bench.make_camera(bench.wing, bench.faults, start_ns=0)
    with pytest.raises(RefusedError, match="no marker 77; served are 0, 1"):
        fault(control, True, "marker_hidden", "camera", markers=[1, 77])
    fault(control, True, "marker_hidden", "camera", markers=[1])
    fault(control, True, "marker_hidden", "camera", markers=[2, 3])
    with pytest.raises(RefusedError, match="is on already"):
        fault(control, True, "marker_hidden", "camera", markers=[3, 4])


def test_fault_is_on_once(control: Path) -> None:
    fault(control, True, "nak", "pod 0")
    for target in ("pod 0", "*"):
        with pytest.raises(RefusedError, match="fault off nak 'pod 0'"):
            fault(control, True, "nak", target)
    fault(control, False, "nak", "pod 0")
    fault(control, True, "nak", "pod 0")
    fault(control, False, "nak", "*")
    assert ask(control, {"do": "status"})["faults"] == []


def test_off_of_what_is_not_on_is_refused(control: Path) -> None:
    with pytest.raises(RefusedError, match="'nak' is not on for 'pod 0'"):
        fault(control, False, "nak", "pod 0")
    fault(control, True, "nak", "*")
    with pytest.raises(RefusedError, match=r"on for all at once.*fault off nak '\*'"):
        fault(control, False, "nak", "pod 0")
    fault(control, False, "nak", "*")
    with pytest.raises(RefusedError, match=r"not on for '\*'"):
        fault(control, False, "nak", "*")


def test_what_happens_at_once_may_happen_again(control: Path) -> None:
    fault(control, True, "brown_out", "pod 0")
    fault(control, True, "brown_out", "pod 0")
    with pytest.raises(RefusedError, match="happens once and is over"):
        fault(control, False, "brown_out", "pod 0")


def test_status_counts_what_goes_out_and_what_is_missed(config, tmp_path: Path) -> None:
    # GIVEN a bench with a pod and a camera at which somebody looks
    offer = Offer(can=f"bench-{uuid.uuid4().hex[:8]}", interface="simbus", pods=frozenset({0}))
    options = BenchOptions(offer=offer, camera="pipe", folder=tmp_path)
    with (
        open_bench(config, load_scenario("default"), options) as bench,
        ControlServer(tmp_path / "c.sock", BenchControl(bench, threading.Event(), print)) as server,
        socket.socket(socket.AF_UNIX) as sleeper,
    ):
        assert ask(server.path, {"do": "status"})["counters"]["camera"] == {"sent": 0, "missed": 0}
        sleeper.connect(str(tmp_path / "camera.sock"))
        # WHEN pictures are taken and not read THEN both are counted
        give_up = time.monotonic() + 30
        counted = {"sent": 0, "missed": 0}
        while not (counted["sent"] and counted["missed"]) and time.monotonic() < give_up:
            counted = ask(server.path, {"do": "status"})["counters"]["camera"]
            time.sleep(0.02)
        assert counted["sent"] > 0
        assert counted["missed"] > 0


def test_rubbish_on_the_control_socket_harms_nobody(control: Path) -> None:
    for malformed in (b"\xff\xfe\n", b"[1, 2]\n", b"{\n", b"\n"):
        with socket.socket(socket.AF_UNIX) as client:
            client.settimeout(5)
            client.connect(str(control))
            client.sendall(malformed)
            assert "error" in json.loads(client.makefile("rb").readline())
    assert ask(control, {"do": "status"})["elapsed_s"] is None


def test_second_bench_on_one_socket_is_refused(bench: Bench, control: Path) -> None:
    with pytest.raises(RefusedError, match="another bench"):
        ControlServer(control, BenchControl(bench, threading.Event(), print))


def test_nobody_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(DeviceNotFoundError, match="avionics rig serve"):
        ask(tmp_path / "none.sock", {"do": "status"})


def test_scenario_begins_once(bench: Bench, control: Path, said: list[str]) -> None:
    assert bench.elapsed_s is None
    first = ask(control, {"do": "start", "lead_s": 3})
    again = ask(control, {"do": "start", "lead_s": 9})
    assert again["epoch_ns"] == first["epoch_ns"]
    assert (first["was_started"], again["was_started"]) == (False, True)
    assert -3.0 <= first["elapsed_s"] < again["elapsed_s"] <= bench.elapsed_s < 0
    assert said == ["scenario default begins"]
