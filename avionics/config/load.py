"""How files and overrides become a validated ``Config``; every error names file, key and remedy."""

import hashlib
import sys
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from avionics.config.wings import FlightConfig, flight_config
from avionics.errors import ConfigError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Tables = dict[str, Any]


def parse_config(tables: dict[str, Any], *, origin: str, is_flown: bool = False) -> FlightConfig:
    """Validate nested tables, as a TOML file or a log's attachment holds them.

    Parameters
    ----------
    tables : dict
        The tables.
    origin : str
        What messages call where they come from.
    is_flown : bool
        Whether they are a log's: links are then not checked against each other.

    Raises
    ------
    ConfigError
        Naming ``origin``, the key, the value and what was wanted.
    """
    try:
        return flight_config(tables, is_flown=is_flown)
    except ValidationError as error:
        raise ConfigError("\n".join(explain(origin, item) for item in error.errors()[:5])) from None


# Tables of several kinds, told apart by their key ``kind``.
TAGGED = ("link", "source", "chip")


def explain(origin: str, item: Any) -> str:
    """Return one line on one of a validation error's items: file, key, what was wanted."""
    # A discriminated union puts its tag into the path; it is no key of the file.
    parts = [str(part) for part in item["loc"]]
    path = ".".join(
        p for p, before in zip(parts, ["", *parts], strict=False) if before not in TAGGED
    )
    if item["type"] == "extra_forbidden":
        return f"{origin}: unknown key '{path}'; remove it or correct its spelling"
    if item["type"] == "missing":
        return f"{origin}: key '{path}' is missing"
    where = f"{origin}: key '{path}'" if path else origin
    value = "" if item["type"] == "value_error" else f" (found {item['input']!r:.80})"
    return f"{where}: {item['msg'].removeprefix('Value error, ')}{value}"


def load_config(path: Path, overrides: tuple[str, ...] = ()) -> FlightConfig:
    """Read and validate a TOML configuration.

    Parameters
    ----------
    path : Path
        The file. ``calibration = {path, sha256}``, at the top or within one of ``[[wings]]``,
        names a TOML file whose ``[camera]`` keys replace those of this one.
    overrides : tuple of str
        ``key=value`` pairs, e.g. ``estimator.form=paper``.

    Raises
    ------
    ConfigError
        If the file is missing, is not TOML, or does not validate.
    """
    tables = read_toml(path)
    for table in (tables, *_wings_of(tables)):
        calibration = table.pop("calibration", None)
        if calibration is not None:
            _merge(table, _read_calibration(path, calibration))
    return parse_config(apply_overrides(tables, overrides), origin=str(path))


def parse_config_text(text: str, overrides: tuple[str, ...] = (), *, origin: str) -> FlightConfig:
    """Validate a configuration given as TOML text; see ``load_config``."""
    return parse_config(apply_overrides(tomllib.loads(text), overrides), origin=origin)


def read_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises
    ------
    ConfigError
        If it cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror}); give the path of a TOML configuration"
        raise ConfigError(msg) from error
    except UnicodeDecodeError as error:
        msg = f"{path}: is not text in UTF-8; give a TOML configuration"
        raise ConfigError(msg) from error
    except tomllib.TOMLDecodeError as error:
        msg = f"{path}: is not valid TOML: {error}"
        raise ConfigError(msg) from error


def _wings_of(tables: dict[str, Any]) -> list[dict[str, Any]]:
    wings = tables.get("wings")
    return [wing for wing in wings if isinstance(wing, dict)] if isinstance(wings, list) else []


def _read_calibration(config_path: Path, entry: Any) -> dict[str, Any]:
    if not isinstance(entry, dict) or set(entry) != {"path", "sha256"}:
        msg = f"{config_path}: 'calibration' wants exactly the keys path and sha256"
        raise ConfigError(msg)
    path = config_path.parent / str(entry["path"])
    tables = read_toml(path)
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != entry["sha256"]:
        msg = f"{path}: SHA-256 is {found}, {config_path} expects {entry['sha256']}"
        raise ConfigError(msg)
    return tables


def _merge(base: dict[str, Any], other: dict[str, Any]) -> None:
    for key, value in other.items():
        if isinstance(value, dict) and isinstance(base.get(key), dict):
            _merge(base[key], value)
        else:
            base[key] = value


def apply_overrides(tables: dict[str, Any], overrides: tuple[str, ...]) -> dict[str, Any]:
    """Return the tables with ``key=value`` pairs applied; values are read as TOML or as text.

    One of several wings is addressed by its name, e.g. ``wings.left.camera.tilt_deg=-12``.

    Raises
    ------
    ConfigError
        If a pair has no ``=`` or a key does not lead to a table.
    """
    result: dict[str, Any] = _deep_copy(tables)
    for pair in overrides:
        key, separator, text = pair.partition("=")
        if not separator or not key:
            msg = f"--set {pair}: wants key=value, for example estimator.form=paper"
            raise ConfigError(msg)
        table = result
        *parents, last = key.strip().split(".")
        if parents[:1] == ["wings"]:
            table, parents = _wing_named(result, parents, pair), parents[2:]
        for parent in parents:
            child = table.setdefault(parent, {})
            if not isinstance(child, dict):
                msg = f"--set {pair}: '{parent}' is not a table"
                raise ConfigError(msg)
            table = child
        table[last] = _toml_value(text.strip())
    return result


def _wing_named(tables: dict[str, Any], parents: list[str], pair: str) -> dict[str, Any]:
    wings = {str(wing.get("name")): wing for wing in _wings_of(tables)}
    if len(parents) > 1 and parents[1] in wings:
        return wings[parents[1]]
    msg = f"--set {pair}: wants wings.NAME.key=value, with NAME one of {', '.join(wings) or 'none'}"
    raise ConfigError(msg)


def _deep_copy(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _deep_copy(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_deep_copy(item) for item in value]
    return value


def _toml_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def default_config_text() -> str:
    """Return the packaged configuration: the simulated mockup wing."""
    return resources.files("avionics.config").joinpath("default.toml").read_text(encoding="utf-8")
