"""``assemble`` and ``probe`` with simulated chips where the bus libraries would open hardware."""

import cv2
import numpy as np
import pytest
import serial
import smbus2

from avionics.config.load import parse_config
from avionics.errors import ConfigError
from avionics.flight.doctor import probe
from avionics.flight.hardware import open_rig
from drivers.errors import DeviceNotFoundError
from sim_bus.buses.can_pod import SimCanBus, SimPod
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.buses.uart import SimSerialPort
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.clock import SimClock
from tests.drivers.wing_bench import GOOD, SECOND, Swing

CHANNEL = "hardware-test"
I2C = {"id": 0, "s_m": 0.3, "link": {"kind": "i2c", "bus": 1, "address": 0x28}}
MUX = {
    "id": 3,
    "s_m": 0.9,
    "link": {"kind": "i2c", "bus": 1, "address": 0x29, "mux_address": 0x70, "mux_channel": 2},
}
UART = {"id": 1, "s_m": 0.6, "link": {"kind": "uart", "port": "/dev/ttyTEST"}}
CAN = {
    "id": 2,
    "s_m": 1.2,
    "link": {"kind": "can", "interface": "virtual", "channel": CHANNEL, "node": 5},
    "chip": {"mode": "gyronly", "gyro_range_dps": 500},
}
LENS = {"f_x_px": 600.0, "f_y_px": 600.0, "c_x_px": 31.5, "c_y_px": 23.5}


def config(*pods, **more):
    return parse_config({"wing": {"span_m": 1.5}, "pods": list(pods), **more}, origin="test")


@pytest.fixture
def desk(monkeypatch):
    """Return the clock of a desk with a chip at every place that the pods above name."""
    clock, rng = SimClock(SECOND), np.random.default_rng(4)

    def chip() -> SimBno055:
        return SimBno055(Swing(), rng, grade=GOOD, power_on_ns=SECOND)

    places = {(None, 0, 0x28): Wired(chip(), "pod 0"), (0x70, 2, 0x29): Wired(chip(), "pod 3")}
    chips = {"uart": chip(), "can": chip(), "i2c": places[(None, 0, 0x28)].chip}

    def smbus(number):
        if number not in (1, 11):
            raise FileNotFoundError(2, "No such file or directory")
        return SimI2cBus(clock, places)

    def port(name, baud, **options):
        if name != "/dev/ttyTEST":
            raise serial.SerialException(13, f"could not open port {name}: Permission denied")
        return SimSerialPort(chips["uart"], clock, overruns=False)

    monkeypatch.setattr(smbus2, "SMBus", smbus)
    monkeypatch.setattr(serial, "Serial", port)
    pod = SimPod(5, chips["can"], SimCanBus(CHANNEL, clock), clock)
    clock.on_advance(pod.step)
    clock.chips = chips
    yield clock
    pod.close()


def test_every_bus_of_a_configuration_delivers(desk) -> None:
    with open_rig(config(I2C, UART, CAN, MUX), desk) as rig:
        assert len(rig.imus) == 3  # the two on I2C share a bus
        heard = set()
        for _ in range(2000):
            desk.advance(1_000_000)
            heard |= {s.pod for source in rig.imus if (s := source.read(0)) is not None}
        assert heard == {"0", "1", "2", "3"}
    rig.close()


def test_can_pods_are_set_as_configured(desk) -> None:
    with open_rig(config(CAN), desk) as rig:
        for _ in range(3000):
            desk.advance(1_000_000)
            sample = rig.imus[0].read(0)
        assert sample is None or sample.specific_force_m_s2 is None
        chip = desk.chips["can"]
        assert chip.gyro_rad_s_per_lsb == pytest.approx(np.radians(500 / 32768))
        assert rig.imus[0].health()["pod 2"].get("config_refused", 0) == 0


@pytest.mark.parametrize(
    ("pod", "message"),
    [
        ({**I2C, "link": {"kind": "i2c", "bus": 9}}, r"/dev/i2c-9 does not exist; .*i2cdetect -l"),
        ({**I2C, "link": {"kind": "i2c", "address": 0x29}}, r"pod 0: no answer, expected 0xA0"),
        (
            {**UART, "link": {"kind": "uart", "port": "/dev/ttyX"}},
            r"serial port /dev/ttyX does not open: .*group dialout",
        ),
        (
            {**CAN, "link": {**CAN["link"], "node": 6}},
            r"pod 2: no frame from node 6 within 2\.0 s on can hardware-test; check",
        ),
        (
            {**CAN, "link": {**CAN["link"], "interface": "nosuch"}},
            r"can hardware-test: interface 'nosuch' does not open",
        ),
    ],
)
def test_missing_device_is_named_with_its_remedy(desk, pod, message) -> None:
    with pytest.raises(DeviceNotFoundError, match=message):
        open_rig(config(pod), desk)


def test_wrong_chip_id_is_named(desk) -> None:
    desk.chips["i2c"]._pages[0][0] = 0
    with pytest.raises(DeviceNotFoundError, match=r"pod 0: chip id 0x00, expected 0xA0"):
        open_rig(config(I2C), desk)


def test_pod_without_a_link_is_named(desk) -> None:
    with pytest.raises(ConfigError, match=r"pod 0: has no link; add e\.g\. link = "):
        open_rig(config({"id": 0, "s_m": 0.3}), desk)


def test_one_chip_over_two_links_is_refused(desk) -> None:
    # GIVEN a second bus that is a channel of a multiplexer on the first, as the kernel makes them
    through = {**I2C, "id": 4, "link": {"kind": "i2c", "bus": 11, "address": 0x28}}
    uid = desk.chips["i2c"].unique_id.hex()
    message = f"pod 0 and pod 4: both answer as the chip {uid}; one chip is reached over two links"
    with pytest.raises(DeviceNotFoundError, match=message):
        open_rig(config(I2C, through), desk)
    findings = probe(config(I2C, through), desk)
    assert [f.ok for f in findings[:2]] == [True, False]
    assert "both answer as the chip" in findings[1].found
    assert findings[1].remedy.startswith("one chip is reached over two links: check the wiring")


def test_every_pod_says_which_chip_it_is(desk) -> None:
    with open_rig(config(I2C, UART, CAN), desk) as rig:
        for _ in range(3000):
            desk.advance(1_000_000)
            for source in rig.imus:
                source.read(0)
        told = {(e.source, e.message) for source in rig.imus for e in source.take_events()}
        ids = {name: uid for source in rig.imus for name, uid in source.chip_ids().items()}
    wanted = {"pod 0": "i2c", "pod 1": "uart", "pod 2": "can"}
    assert ids == {name: desk.chips[kind].unique_id for name, kind in wanted.items()}
    for name in ("pod 0", "pod 1"):
        assert (name, f"is up; chip {ids[name].hex()}") in told
    assert ("pod 2", f"chip {ids['pod 2'].hex()}") in told


def test_what_was_opened_is_closed_when_a_later_device_fails(desk, monkeypatch) -> None:
    opened = []
    honest = smbus2.SMBus

    def remember(number):
        opened.append(honest(number))
        return opened[-1]

    monkeypatch.setattr(smbus2, "SMBus", remember)
    bad = {**CAN, "link": {**CAN["link"], "node": 6}}
    with pytest.raises(DeviceNotFoundError):
        open_rig(config(I2C, bad), desk)
    assert not opened[0].is_open


def test_doctor_says_what_is_there_and_how_to_mend_the_rest(desk, tmp_path) -> None:
    missing = {**UART, "link": {"kind": "uart", "port": "/dev/ttyX"}}
    camera = {**LENS, "source": {"kind": "file", "path": str(tmp_path / "none.avi")}}
    findings = probe(config(I2C, missing, camera=camera), desk)
    assert [f.ok for f in findings[:3]] == [True, False, False]
    assert "samples come" in findings[0].found
    assert findings[1].remedy == "add the user to the group dialout"
    assert findings[2].remedy == "give the path of a video file"
    assert all(f.ok or f.remedy for f in findings)


def test_doctor_compares_the_picture_with_the_configuration(desk, tmp_path) -> None:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for _ in range(3):
        writer.write(np.zeros((48, 64, 3), dtype=np.uint8))
    writer.release()
    source = {"kind": "file", "path": str(path)}
    wrong, right = ({**LENS, "width_px": w, "height_px": 48, "source": source} for w in (65, 64))
    (finding,) = (f for f in probe(config(camera=wrong), desk) if f.what == "camera root")
    assert not finding.ok
    assert "frames of 64 x 48 px, the configuration says 65 x 48" in finding.found
    (finding,) = (f for f in probe(config(camera=right), desk) if f.what == "camera root")
    assert finding.ok
