"""The kinds of guest kernels, by the name of their tier."""

from collections.abc import Mapping
from typing import Final

from sim_bus.guests import uml, vm
from sim_bus.guests.guest import Runner

RUNNERS: Final[Mapping[str, Runner]] = {"uml": uml.run_in_guest, "vm": vm.run_in_guest}
