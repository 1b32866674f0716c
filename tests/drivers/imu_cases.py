"""The chips of the contract of IMU sources: every kind that the configuration has."""

from dataclasses import dataclass
from typing import get_args

from avionics.config.chips import Bno055Settings, Chip, ChipSettings, Icm42688Settings


@dataclass(frozen=True)
class ChipCase:
    """One kind of chip.

    Attributes
    ----------
    name : str
        As test ids show it.
    buses : tuple of str
        What it can be behind.
    raw : Chip
        Set to give rates alone, at its plainest.
    whole : Chip or None
        Set to give all it has; None if that is no more.
    has_flux : bool
        Whether that includes the magnetic flux.
    aged : tuple of Chip
        Settings that differ in how old the rates are.
    scaled : tuple of (Chip, float)
        Settings that differ in the worth of a bit of the gyro, with it in deg/s.
    """

    name: str
    buses: tuple[str, ...]
    raw: Chip
    whole: Chip | None
    has_flux: bool
    aged: tuple[Chip, ...]
    scaled: tuple[tuple[Chip, float], ...]


BNO055 = ChipCase(
    "bno055",
    ("i2c", "uart", "can"),
    raw=Bno055Settings(mode="gyronly"),
    whole=Bno055Settings(mode="amg"),
    has_flux=True,
    aged=(
        Bno055Settings(mode="gyronly", gyro_bandwidth_hz=230),
        Bno055Settings(mode="gyronly", gyro_bandwidth_hz=32),
        Bno055Settings(mode="amg", gyro_bandwidth_hz=47),
        Bno055Settings(mode="ndof", gyro_bandwidth_hz=230),
    ),
    scaled=(
        (Bno055Settings(mode="gyronly"), 2000 / 32768),
        (Bno055Settings(mode="gyronly", gyro_range_dps=250), 250 / 32768),
        (Bno055Settings(mode="amg", gyro_range_dps=1000), 1000 / 32768),
        (Bno055Settings(mode="ndof"), 1 / 16),
    ),
)
ICM42688 = ChipCase(
    "icm42688",
    ("i2c", "spi"),
    raw=Icm42688Settings(kind="icm42688", accelerometer=False),
    whole=Icm42688Settings(kind="icm42688"),
    has_flux=False,
    aged=(
        Icm42688Settings(kind="icm42688"),
        Icm42688Settings(kind="icm42688", gyro_bandwidth_hz=231),
        Icm42688Settings(kind="icm42688", data_hz=200, gyro_bandwidth_hz=47),
    ),
    scaled=tuple(
        (Icm42688Settings(kind="icm42688", gyro_range_dps=dps), dps / 32768) for dps in (2000, 250)
    ),
)


def plain_case(kind: str) -> ChipCase:
    """Return the case of a chip of which nothing but its kind is known here: a gyro alone."""
    chip = SETTINGS[kind](kind=kind)
    return ChipCase(kind, chip.links, chip, None, has_flux=False, aged=(chip,), scaled=())


SETTINGS = {
    get_args(settings.model_fields["kind"].annotation)[0]: settings
    for settings in ChipSettings.__subclasses__()
}
_KNOWN = (BNO055, ICM42688)
CASES = (
    *_KNOWN,
    *(plain_case(kind) for kind in SETTINGS if kind not in {case.name for case in _KNOWN}),
)


def each(of: str) -> list[tuple[str, Chip] | tuple[str, Chip, float]]:
    """Return (bus, settings) or (bus, settings, worth) of every chip, on all its buses."""
    return [
        (bus, *entry) if isinstance(entry, tuple) else (bus, entry)
        for case in CASES
        for entry in getattr(case, of)
        for bus in case.buses
    ]


def name_of(value: object) -> str | None:
    """Return how a test id shows a bus or the settings of a chip."""
    if isinstance(value, Bno055Settings):
        return f"{value.mode}-{value.gyro_range_dps}-{value.gyro_bandwidth_hz}"
    if isinstance(value, Icm42688Settings):
        return f"icm-{value.data_hz}-{value.gyro_range_dps}-{value.gyro_bandwidth_hz}"
    if isinstance(value, ChipSettings):
        return str(value.kind)
    return value if isinstance(value, str) else None
