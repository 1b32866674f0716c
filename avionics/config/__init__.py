"""The configuration: what every key means, checked; ``load`` makes one from files."""

from avionics.config.model import (
    Camera,
    Config,
    Estimator,
    Marker,
    Pod,
    Recorder,
    Tracker,
    Wing,
    stations,
)

__all__ = [
    "Camera",
    "Config",
    "Estimator",
    "Marker",
    "Pod",
    "Recorder",
    "Tracker",
    "Wing",
    "stations",
]
