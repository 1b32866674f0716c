"""Which simulated chip stands for which ``chip`` of a configuration."""

from collections.abc import Callable
from typing import Final

import numpy as np

from avionics.config.chips import Chip
from sim_bus.chip.bno055.chip import SimBno055
from sim_bus.chip.icm42688.chip import SimIcm42688
from sim_bus.chip.sensing import ImuGrade, Motion
from sim_bus.chip.sim_chip import SimChip

KINDS: Final[dict[str, Callable[..., SimChip]]] = {
    "bno055": SimBno055,
    "icm42688": SimIcm42688,
}


def make_sim_chip(
    chip: Chip,
    motion: Motion,
    rng: np.random.Generator,
    *,
    grade: ImuGrade,
    power_on_ns: int,
) -> SimChip:
    """Return the simulated chip of a pod, switched on at ``power_on_ns`` and not yet booted."""
    return KINDS[chip.kind](motion, rng, grade=grade, power_on_ns=power_on_ns, is_booted=False)
