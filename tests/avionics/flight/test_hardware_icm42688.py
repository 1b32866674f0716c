"""``open_rig`` and ``probe`` with simulated ICM-42688-P where spidev and smbus2 would open them."""

import sys
import types

import numpy as np
import pytest
import smbus2

from avionics.config.load import parse_config
from avionics.flight.doctor import probe
from avionics.flight.hardware import open_rig
from drivers.errors import DeviceNotFoundError
from sim_bus.buses.i2c import SimI2cBus, Wired
from sim_bus.buses.spi import SimSpiDevice
from sim_bus.chip.icm42688.chip import SimIcm42688
from sim_bus.clock import SimClock
from tests.drivers.wing_bench import GOOD, SECOND, Swing

CHIP = {"kind": "icm42688"}
SPI = {
    "id": 0, "s_m": 0.3, "chip": CHIP,
    "link": {"kind": "spi", "bus": 1, "device": 0, "speed_hz": 4_000_000, "mode": 3},
}  # fmt: skip
I2C = {"id": 1, "s_m": 0.6, "chip": CHIP, "link": {"kind": "i2c", "bus": 2, "address": 0x69}}


def config(*pods):
    return parse_config({"wing": {"span_m": 1.5}, "pods": list(pods)}, origin="test")


@pytest.fixture
def desk(monkeypatch):
    """Return the clock of a desk with a chip at both places."""
    clock, rng = SimClock(SECOND), np.random.default_rng(4)
    chips = [SimIcm42688(Swing(), rng, grade=GOOD, power_on_ns=SECOND) for _ in range(2)]

    class SpiDev:
        max_speed_hz = mode = 0

        def open(self, bus, device):
            if bus != 1:
                raise FileNotFoundError(2, "No such file or directory")
            clock.spi = self
            self._line = SimSpiDevice(chips[0], clock, target="pod 0")

        def xfer2(self, values):
            return self._line.xfer2(values)

        def close(self):
            self._line.close()

    module = types.ModuleType("spidev")
    module.SpiDev = SpiDev
    monkeypatch.setitem(sys.modules, "spidev", module)
    places = {(None, 0, 0x69): Wired(chips[1], "pod 1")}
    monkeypatch.setattr(smbus2, "SMBus", lambda _: SimI2cBus(clock, places))
    clock.chips = chips
    return clock


def test_chips_on_both_buses_deliver(desk) -> None:
    with open_rig(config(SPI, I2C), desk) as rig:
        assert {source.name for source in rig.imus} == {"spi 1.0", "i2c bus 2"}
        assert (desk.spi.max_speed_hz, desk.spi.mode) == (4_000_000, 3)
        heard = set()
        for _ in range(100):
            desk.advance(1_000_000)
            heard |= {s.pod for source in rig.imus if (s := source.read(0)) is not None}
        assert heard == {"0", "1"}
    rig.close()


def test_doctor_finds_the_chip_and_names_its_place(desk) -> None:
    finding = probe(config(SPI), desk)[0]
    assert finding.ok
    assert finding.what == "pod 0 on /dev/spidev1.0"
    assert finding.found == "ICM-42688-P answers; 48 Hz, 2000 deg/s, samples come"


def test_doctor_says_what_to_do_about_a_missing_node_or_package(desk, monkeypatch) -> None:
    away = {**SPI, "link": {"kind": "spi", "bus": 7}}
    finding = probe(config(away), desk)[0]
    assert (finding.ok, finding.found) == (False, "/dev/spidev7.0 does not exist")
    assert finding.remedy.startswith("enable SPI on this board")
    monkeypatch.setitem(sys.modules, "spidev", None)
    finding = probe(config(SPI), desk)[0]
    assert finding.remedy == "`pip install 'wing-avionics[spi]'`"


def test_doctor_says_what_to_do_about_a_chip_that_does_not_drive_its_line(
    desk, monkeypatch
) -> None:
    monkeypatch.setattr(desk.chips[0], "transfer", lambda sent, _: bytes(len(sent)))
    finding = probe(config(SPI), desk)[0]
    assert finding.found == "chip id 0x00, expected 0x47"
    assert finding.remedy == "nothing drives SDO: check supply, wiring and chip select"
    with pytest.raises(DeviceNotFoundError, match="nothing drives SDO"):
        open_rig(config(SPI), desk)
