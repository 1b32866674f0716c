"""Links against each other: refused with the pods, the keys and the remedy; or accepted."""

import re
from pathlib import Path

import pytest

from avionics.config.load import parse_config, parse_config_text
from avionics.errors import ConfigError
from drivers.can.pod.messages import RATE_MAX_HZ

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware" / "core" / "pod_config.c"


def text(*pods: tuple[str, str]) -> str:
    """Return a configuration of pods, each a link and a chip table."""
    tables = [
        f"[[pods]]\nid = {n}\ns_m = {0.5 + 0.1 * n}\nlink = {{ {link} }}\nchip = {{ {chip} }}\n"
        for n, (link, chip) in enumerate(pods)
    ]
    return "[wing]\nspan_m = 1.5\n" + "".join(tables)


def i2c(more: str = "address = 0x28", bus: int = 1) -> str:
    return f'kind = "i2c", bus = {bus}, {more}'


def can(node: int, more: str = "") -> str:
    return f'kind = "can", channel = "can0", node = {node}{more and ", " + more}'


def uart(port: str) -> str:
    return f'kind = "uart", port = "{port}"'


MUX_0 = "address = 0x28, mux_address = 0x70, mux_channel = 0"
MUX_1 = "address = 0x28, mux_address = 0x70, mux_channel = 1"
OTHER_MUX = "address = 0x28, mux_address = 0x71, mux_channel = 0"
REFUSED = {
    "same address": (
        text((i2c(), ""), (i2c(), "")),
        r"pods 0 and 1: link\.address: both answer at 0x28 of I2C bus 1; give one link\.address",
    ),
    "same channel": (
        text((i2c(MUX_1), ""), (i2c(MUX_1), "")),
        r"pods 0 and 1: link\.mux_channel: both answer at 0x28 of I2C bus 1 behind channel 1 of "
        r"multiplexer 0x70; give one",
    ),
    "direct beside a multiplexer": (
        text((i2c(), ""), (i2c(MUX_1), "")),
        r"pods 0 and 1: link\.address: pod 0 answers at 0x28 of I2C bus 1 beside every channel",
    ),
    "behind a multiplexer beside direct": (
        text((i2c(MUX_1), ""), (i2c(), "")),
        r"pods 0 and 1: link\.address: pod 1 answers at 0x28 of I2C bus 1 beside every channel",
    ),
    "chip at a multiplexer's address": (
        text((i2c("address = 0x70"), ""), (i2c(MUX_0), "")),
        r"key 'pods\.0': link\.address = 0x70: the BNO055 answers at 0x28 or 0x29",
    ),
    "channel of no multiplexer": (
        text((i2c("address = 0x28, mux_channel = 2"), "")),
        r"key 'pods\.0\.link': mux_channel = 2 without mux_address; add mux_address = 0x70",
    ),
    "channel 0 of no multiplexer": (
        text((i2c("address = 0x28, mux_channel = 0"), "")),
        r"mux_channel = 0 without mux_address",
    ),
    "two rates on a polled bus": (
        text((i2c(), "rate_hz = 50"), (i2c("address = 0x29"), "rate_hz = 200")),
        r"pods 0 and 1: chip\.rate_hz is 50 and 200 on I2C bus 1, which is read at one rate; give",
    ),
    "one chip select twice": (
        text(*[('kind = "spi", bus = 1, device = 0', 'kind = "icm42688"')] * 2),
        r"pods 0 and 1: link\.device: both on /dev/spidev1\.0; give each a chip select of its own",
    ),
    "one serial port twice": (
        text((uart("/dev/ttyUSB0"), ""), (uart("/dev/ttyUSB0"), "")),
        r"pods 0 and 1: link\.port: both on /dev/ttyUSB0; a serial line has one chip: give each",
    ),
    "one serial port in two spellings": (
        text((uart("/dev/ttyUSB0"), ""), (uart("/dev//../dev/ttyUSB0"), "")),
        r"pods 0 and 1: link\.port: both on /dev/ttyUSB0 and /dev//\.\./dev/ttyUSB0, which are one",
    ),
    "a serial CAN adapter's port": (
        text((uart("/dev/ttyACM0"), ""),
             ('kind = "can", interface = "slcan", channel = "/dev/ttyACM0@115200"', "")),
        r"pods 0 and 1: link\.port and link\.channel: both on /dev/ttyACM0; a serial line",
    ),
    "one node twice": (
        text((can(1), ""), (can(2), ""), (can(1), "")),
        r"pods 0 and 2: link\.node = 1 for both on CAN socketcan can0; give each its own, 0 to 15",
    ),
    "two bit rates": (
        text((can(1, "bitrate = 500000"), ""), (can(2), "")),
        r"pods 0 and 1: link\.bitrate is 500000 and absent on CAN socketcan can0, which runs",
    ),
    "mixed trigger": (
        text((can(1, "triggered = true"), ""), (can(2), "")),
        r"pods 0 and 1: link\.triggered is true and false on CAN socketcan can0, which triggers",
    ),
    "two triggered rates": (
        text((can(1, "triggered = true"), ""), (can(2, "triggered = true"), "rate_hz = 50")),
        r"pods 0 and 1: chip\.rate_hz is 100 and 50 on CAN socketcan can0, which triggers all",
    ),
    "rate that is not whole": (
        text((can(1), "rate_hz = 62.5")),
        r"pod 0: chip\.rate_hz = 62\.5; a pod on CAN samples at whole rates from 1 to 200 Hz",
    ),
    "rate beyond the firmware's": (
        text((can(1), "rate_hz = 250")),
        r"pod 0: chip\.rate_hz = 250; a pod on CAN samples at whole rates from 1 to 200 Hz",
    ),
}  # fmt: skip
ACCEPTED = {
    "two addresses": text((i2c(), ""), (i2c("address = 0x29"), "")),
    "two channels": text((i2c(MUX_0), ""), (i2c(MUX_1), "")),
    "two multiplexers": text((i2c(MUX_0), ""), (i2c(OTHER_MUX), "")),
    "two buses": text((i2c(), ""), (i2c(bus=2), "rate_hz = 50")),
    "direct beside another address": text((i2c("address = 0x29"), ""), (i2c(MUX_1), "")),
    "two chip selects": text(
        *((f'kind = "spi", bus = 1, device = {n}', 'kind = "icm42688"') for n in (0, 1))
    ),
    "two lines": text((uart("/dev/ttyNONE0"), ""), (uart("/dev/ttyNONE1"), "rate_hz = 50")),
    "own rates on CAN": text((can(1), ""), (can(2), "rate_hz = 50")),
    "fastest on CAN": text((can(1), "rate_hz = 200")),
    "two channels of CAN": text((can(1), ""), ('kind = "can", channel = "can1", node = 1', "")),
    "pods of one slcan adapter": text(
        *(
            (f'kind = "can", interface = "slcan", channel = "/dev/ttyACM0", node = {n}', "")
            for n in (0, 1)
        )
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_links_that_contradict_each_other_are_refused(name) -> None:
    content, message = REFUSED[name]
    with pytest.raises(ConfigError, match=rf"^wing\.toml: .*{message}"):
        parse_config_text(content, origin="wing.toml")


@pytest.mark.parametrize("name", ACCEPTED)
def test_links_that_a_bus_can_serve_are_accepted(name) -> None:
    parse_config_text(ACCEPTED[name], origin="wing.toml")


def test_a_port_and_a_link_to_it_are_one(tmp_path) -> None:
    port, link = tmp_path / "ttyUSB0", tmp_path / "by-id"
    port.touch()
    link.symlink_to(port)
    content = text((uart(str(port)), ""), (uart(str(link)), ""))
    with pytest.raises(ConfigError, match=rf"both on {port} and {link}, which are one port"):
        parse_config_text(content, origin="wing.toml")


def test_pods_of_two_wings_share_the_buses() -> None:
    wings = [
        {"name": name, "span_m": 1.5, "pods": [{"id": n, "s_m": 0.5, "link": {"kind": "i2c"}}]}
        for n, name in enumerate(("left", "right"))
    ]
    with pytest.raises(ConfigError, match=r"pods 0 and 1: link\.address: both answer at 0x28"):
        parse_config({"wings": wings}, origin="wing.toml")


def test_what_has_flown_can_be_read_again() -> None:
    link = {"kind": "i2c", "bus": 1, "address": 0x28, "mux_address": None, "mux_channel": 0}
    pods = [{"id": n, "s_m": 0.5, "link": link} for n in range(2)]
    tables = {"wing": {"span_m": 1.5}, "pods": pods}
    assert len(parse_config(tables, origin="flight.mcap", is_flown=True).pods) == 2
    with pytest.raises(ConfigError):
        parse_config(tables, origin="wing.toml")


def test_the_rate_is_the_firmwares() -> None:
    found = re.search(r"#define RATE_MAX_HZ (\d+)U", FIRMWARE.read_text(encoding="utf-8"))
    assert found is not None
    assert int(found[1]) == RATE_MAX_HZ
