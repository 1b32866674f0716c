"""What stands at the start of every log so that it explains itself."""

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import tomli_w

from avionics.config import FlightConfig

METADATA_NAME = "avionics"
CONFIG_JSON = "config.json"
CONFIG_TOML = "config.toml"
FORMAT_VERSION = "1"
# A key that a configuration takes only beside another one.
BELONGS_TO = {"mux_channel": "mux_address"}


def software_version() -> str:
    """Return the version of this package, or "unknown" where it is not installed."""
    try:
        return version("wing-avionics")
    except PackageNotFoundError:
        return "unknown"


def log_metadata(
    config: FlightConfig, *, utc_offset_ns: int, extra: Mapping[str, str] | None
) -> dict[str, str]:
    """Return the metadata record ``avionics`` of a new log; ``extra`` adds keys, replaces none."""
    return {
        **(extra or {}),
        "format_version": FORMAT_VERSION,
        "software_version": software_version(),
        "utc_offset_ns": str(utc_offset_ns),
        "config_sha256": config.digest(),
    }


def config_toml(config: FlightConfig) -> str:
    """Return the resolved configuration as TOML that ``avionics run`` takes again."""
    return tomli_w.dumps(_without_none(config.model_dump(mode="json")))


def _without_none(value: Any) -> Any:
    """TOML has no null: a key left out means the same, and so does one that belongs to it."""
    if isinstance(value, dict):
        absent = {key for key, item in value.items() if item is None}
        absent |= {key for key, owner in BELONGS_TO.items() if owner in absent}
        return {key: _without_none(item) for key, item in value.items() if key not in absent}
    if isinstance(value, list):
        return [_without_none(item) for item in value]
    return value


def media_type(name: str) -> str:
    """Return the media type of an attachment from its name."""
    kinds = {
        "json": "application/json",
        "toml": "application/toml",
        "csv": "text/csv",
        "yaml": "application/yaml",
        "txt": "text/plain",
        "png": "image/png",
    }
    return kinds.get(name.rpartition(".")[2].lower(), "application/octet-stream")
