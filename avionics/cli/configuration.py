"""The configuration that a command was given, or the one that comes with the package."""

from pathlib import Path

from avionics.config import FlightConfig
from avionics.config.load import default_config_text, load_config, parse_config_text


def given_or_packaged(path: Path | None, overrides: tuple[str, ...]) -> FlightConfig:
    """Return the configuration of a file, or the packaged one, with some keys changed.

    Raises
    ------
    ConfigError
        If the file or a key is wrong.
    """
    if path is not None:
        return load_config(path, overrides)
    return parse_config_text(default_config_text(), overrides, origin="packaged configuration")
