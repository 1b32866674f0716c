"""GIVEN a wing with ICM-42688-P over SPI and I2C WHEN it flies ten seconds THEN the chain holds."""

import json
from pathlib import Path

import pytest

from avionics.config.load import default_config_text

pytestmark = pytest.mark.slow

BNO055_PODS = (
    'chip = { gyro_bandwidth_hz = 47 }\nlink = { kind = "i2c", bus = 1, address = 0x28 }',
    "chip = { gyro_bandwidth_hz = 47 }\n"
    'link = { kind = "can", interface = "virtual", channel = "wing", node = 1 }',
)
ICM42688_PODS = (
    'chip = { kind = "icm42688" }\nlink = { kind = "spi", bus = 0, device = 0 }',
    'chip = { kind = "icm42688" }\nlink = { kind = "i2c", bus = 1, address = 0x68 }',
)


def test_wing_of_another_chip_flies_as_well_as_the_packaged_one(avionics, tmp_path: Path) -> None:
    text = default_config_text()
    for before, after in zip(BNO055_PODS, ICM42688_PODS, strict=True):
        assert before in text
        text = text.replace(before, after)
    (tmp_path / "wing.toml").write_text(text, encoding="utf-8")
    log = tmp_path / "flight.mcap"
    done = avionics("sim", tmp_path / "wing.toml", "--duration", "10", "--seed", "0", "-o", log)
    assert done.status == 0, done.err
    done = avionics("evaluate", log, "--json")
    figures = json.loads(done.out)
    # The bounds of the packaged flight (test_simulated_flight.py).
    assert figures["crg"]["eq17_px"]["median"] < 1.0
    assert figures["crg"]["eq17_px"]["p95"] < 2.5
    assert figures["crg"]["tip_mm"]["rmse"] < 5.0
    # The estimator knows how old the rates are: an age wrong by 5 ms gives four times as much.
    assert figures["filtered"]["eq17_px"]["median"] < 0.3
    again = tmp_path / "again.mcap"
    assert avionics("replay", log, "-o", again).status == 0
    done = avionics("evaluate", again, "--json")
    assert json.loads(done.out)["crg"] == figures["crg"]
