"""A flight of several wings: ``[[wings]]``, each with its pods, markers and camera, in one log.

The short form for one wing, ``[wing]`` with its tables beside it, is ``Config``.
"""

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Generic, TypeVar

from pydantic import Field, ValidationInfo, model_validator

from avionics.config.model import (
    FLOWN,
    Config,
    Equipment,
    FlightSettings,
    Pod,
    Wing,
    check_unless_flown,
)
from avionics.errors import ConfigError

T = TypeVar("T")
SHORT_FORM = ("wing", *Equipment.model_fields)
"""Tables that stand at the top of a file for one wing, and within ``[[wings]]`` for several."""


class FlownWing(Equipment, Wing):
    """One of several wings. Pods, markers and camera stand in its own tables."""

    name: str = Field(pattern="^[^/]+$")
    """Name in topics and records; unique."""

    @model_validator(mode="after")
    def _is_consistent(self) -> "FlownWing":
        self.check_placed(self.span_m)
        return self


class WingsConfig(FlightSettings):
    """Everything that decides what flies on several wings of one aircraft."""

    wings: Annotated[tuple[FlownWing, ...], Field(min_length=1)]
    """The wings."""

    @model_validator(mode="before")
    @classmethod
    def _is_one_form(cls, tables: Any) -> Any:
        beside = [key for key in SHORT_FORM if isinstance(tables, dict) and key in tables]
        if beside:
            msg = (
                f"[{beside[0]}] stands beside [[wings]]; each of several wings has its own: move "
                f"it into the [[wings]] that it belongs to"
            )
            raise ValueError(msg)
        return tables

    @model_validator(mode="after")
    def _is_consistent(self, info: ValidationInfo) -> "WingsConfig":
        _unique("wings", "name", (wing.name for wing in self.wings))
        _unique("pods of all wings", "id", (pod.id for pod in self.pods))
        _unique("cameras", "name", (wing.camera.name for wing in self.wings if wing.camera))
        check_unless_flown((*self.pods, self.root), info)
        return self

    @property
    def wing_configs(self) -> tuple[Config, ...]:
        """The configuration of each wing, in order: what one pipeline takes."""
        shared = {name: getattr(self, name) for name in FlightSettings.model_fields}
        return tuple(
            Config(
                wing=Wing(**{name: getattr(wing, name) for name in Wing.model_fields}),
                **{name: getattr(wing, name) for name in Equipment.model_fields},
                **shared,
            )
            for wing in self.wings
        )

    @property
    def pods(self) -> tuple[Pod, ...]:
        """The pods of all wings, in order."""
        return tuple(pod for wing in self.wings for pod in wing.pods)


FlightConfig = Config | WingsConfig
"""What a file or a log describes: one wing, or several."""


def flight_config(tables: dict[str, Any], *, is_flown: bool = False) -> FlightConfig:
    """Validate nested tables; one ``[[wings]]`` is the same flight as ``[wing]``.

    Parameters
    ----------
    tables : dict
        As a TOML file or a log's attachment holds them.
    is_flown : bool
        Whether they are a log's, whose links are taken as they were.

    Raises
    ------
    pydantic.ValidationError
        Where a key is wrong.
    """
    context = FLOWN if is_flown else None
    if "wings" not in tables:
        return Config.model_validate(tables, context=context)
    several = WingsConfig.model_validate(tables, context=context)
    return several.wing_configs[0] if len(several.wings) == 1 else several


class ByCamera(Generic[T]):
    """What belongs to each wing, found by its camera; a single wing takes any camera for its own.

    Parameters
    ----------
    config : Config or WingsConfig
        The wings.
    items : sequence
        One for each, in order.
    """

    def __init__(self, config: FlightConfig, items: Sequence[T]) -> None:
        self._items = tuple(items)
        self._by_name = {
            each.camera.name: item
            for each, item in zip(config.wing_configs, items, strict=True)
            if each.camera is not None
        }

    def get(self, camera: str) -> T | None:
        """Return what belongs to the wing of a camera; None if none of several has it."""
        return self._items[0] if len(self._items) == 1 else self._by_name.get(camera)


def one_wing(config: FlightConfig, what: str, *, remedy: str = "give it a [wing]") -> Config:
    """Return the configuration of the only wing.

    Raises
    ------
    ConfigError
        If there are several; the message begins with ``what``, which takes one, and ends with
        the remedy.
    """
    if isinstance(config, Config):
        return config
    names = ", ".join(wing.name for wing in config.wings)
    msg = f"{what} takes one wing, the configuration has [[wings]] {names}; {remedy}"
    raise ConfigError(msg)


def config_of_wing(config: FlightConfig, name: str) -> Config:
    """Return the configuration that the records of a wing belong to.

    A flight of one wing has no other, whatever an older log calls it.

    Raises
    ------
    ConfigError
        If there are several wings and none has this name.
    """
    return config if isinstance(config, Config) else config.for_wing(name)


def config_of_camera(config: FlightConfig, name: str) -> Config:
    """Return the configuration of the wing that a camera looks at.

    Raises
    ------
    ConfigError
        If there are several wings and none has a camera of this name.
    """
    if isinstance(config, Config):
        return config
    for one in config.wing_configs:
        if one.camera is not None and one.camera.name == name:
            return one
    names = ", ".join(camera.name for camera in config.cameras)
    msg = f"camera '{name}': the configuration has none of this name; wanted one of {names}"
    raise ConfigError(msg)


def _unique(what: str, key: str, values: Iterable[int | str]) -> None:
    found = list(values)
    if len(set(found)) != len(found):
        shown = ", ".join(str(value) for value in found)
        msg = f"{what}: every {key} must be unique, found {shown}"
        raise ValueError(msg)
