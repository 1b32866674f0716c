"""The configuration that a log or a bench writes is one that a flight takes."""

import pytest

from avionics.config.load import default_config_text, parse_config_text
from avionics.recording.attached import config_toml

LINKS = (
    '{kind="i2c",bus=1,address=0x28}',
    '{kind="i2c",bus=1,address=0x28,mux_address=0x70,mux_channel=0}',
    '{kind="i2c",bus=1,address=0x28,mux_address=0x70,mux_channel=3}',
)


@pytest.mark.parametrize("link", LINKS)
def test_written_configuration_is_read_back_as_it_was(link: str) -> None:
    pods = f"pods=[{{id=0,s_m=0.6,link={link}}}]"
    config = parse_config_text(default_config_text(), (pods,), origin="packaged")
    assert parse_config_text(config_toml(config), (), origin="written") == config
