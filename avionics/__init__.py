"""Avionics data logger and wing-shape estimator for flexible wings.

The public face: what scripts and notebooks need, imported when it is first used, so that
``import avionics`` costs nothing.

==================  ====================================================================
``read_flight``     a log as arrays: ``read_flight("flight.mcap").imu["1"].rate_rad_s``
``Flight``          what it returns
``LogReader``       a log record by record
``Config``          the validated configuration of a wing
``load_config``     one from a TOML file
``open_rig``        the devices of a configuration, opened
``run_live``        fly a rig in real time, into a recorder
``run_lockstep``    fly a simulated rig step by step; the same seed gives the same log
==================  ====================================================================
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from avionics.analysis.flight import Flight, read_flight
    from avionics.config import Config
    from avionics.config.load import load_config
    from avionics.flight.hardware import open_rig
    from avionics.flight.runner import run_live, run_lockstep
    from avionics.recording import LogReader

__all__ = [
    "Config",
    "Flight",
    "LogReader",
    "load_config",
    "open_rig",
    "read_flight",
    "run_live",
    "run_lockstep",
]

_PLACES: Final = {
    "Config": "avionics.config",
    "Flight": "avionics.analysis.flight",
    "LogReader": "avionics.recording",
    "load_config": "avionics.config.load",
    "open_rig": "avionics.flight.hardware",
    "read_flight": "avionics.analysis.flight",
    "run_live": "avionics.flight.runner",
    "run_lockstep": "avionics.flight.runner",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _PLACES:
        msg = f"module 'avionics' has no attribute '{name}'; it offers {', '.join(__all__)}"
        raise AttributeError(msg, name=name)
    value = globals()[name] = getattr(import_module(_PLACES[name]), name)
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return list(__all__)
