"""The configuration: what every key means, checked; ``load`` makes one from files."""

from avionics.config.model import (
    Camera,
    Config,
    Marker,
    Pod,
    RootImu,
    Wing,
    stations,
)
from avionics.config.shared import Estimator, Recorder, Tracker
from avionics.config.wings import ByCamera, FlightConfig, WingsConfig, one_wing

__all__ = [
    "ByCamera",
    "Camera",
    "Config",
    "Estimator",
    "FlightConfig",
    "Marker",
    "Pod",
    "Recorder",
    "RootImu",
    "Tracker",
    "Wing",
    "WingsConfig",
    "one_wing",
    "stations",
]
