"""The chips of a configuration: which there are, where they can be, what is refused."""

import pytest

from avionics.config import Config
from avionics.config.chips import Bno055Settings, Icm42688Settings
from avionics.config.load import parse_config_text
from avionics.errors import ConfigError

WING = "[wing]\nspan_m = 1.5\n[[pods]]\nid = 0\ns_m = 0.5\n"
SPI = 'link = { kind = "spi", bus = 0, device = 1 }\n'


def config(text: str) -> Config:
    return parse_config_text(WING + text, (), origin="wing.toml")


def test_chip_without_a_kind_is_a_bno055() -> None:
    assert config("").pods[0].chip == Bno055Settings()
    assert config('chip = { mode = "ndof" }').pods[0].chip == Bno055Settings(mode="ndof")


def test_icm42688_is_read_back_from_a_log_as_it_was_written() -> None:
    one = config(SPI + 'chip = { kind = "icm42688", gyro_range_dps = 250 }')
    assert one.pods[0].chip == Icm42688Settings(kind="icm42688", gyro_range_dps=250)
    assert Config.model_validate(one.model_dump(mode="json")) == one


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SPI, r"'pods\.0': link\.kind = \"spi\": the BNO055 wants \"i2c\" or \"uart\" or \"can\""),
        (
            'link = { kind = "i2c" }\nchip = { kind = "icm42688" }',
            r"'pods\.0': link\.address = 0x28: the ICM-42688-P answers at 0x68 or 0x69",
        ),
        (
            'link = { kind = "i2c", address = 0x30 }',
            r"'pods\.0': link\.address = 0x30: the BNO055 answers at 0x28 or 0x29",
        ),
        (
            'link = { kind = "can", node = 1 }\nchip = { kind = "icm42688" }',
            r"'pods\.0': link\.kind = \"can\": the ICM-42688-P wants \"spi\" or \"i2c\"",
        ),
        (
            'chip = { kind = "icm42688", gyro_bandwidth_hz = 50 }',
            r"'pods\.0\.chip': gyro_bandwidth_hz = 50: at filter_order = 2 and data_hz = 1000",
        ),
        (
            'chip = { kind = "icm42688", data_hz = 200, gyro_bandwidth_hz = 19, rate_hz = 500 }',
            r"'pods\.0\.chip': rate_hz = 500 is above data_hz = 200",
        ),
        ('chip = { kind = "mpu6050" }', 'wants a table with kind = "bno055" or "icm42688"'),
        ('chip = { kind = "icm42688", mode = "amg" }', r"unknown key 'pods\.0\.chip\.mode'"),
    ],
)
def test_what_a_chip_cannot_be_is_refused(text, message) -> None:
    with pytest.raises(ConfigError, match=message):
        config(text)
