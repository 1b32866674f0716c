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
    is_booted: bool = False,
) -> SimChip:
    """Return the simulated chip of a pod.

    Parameters
    ----------
    chip : Bno055Settings or Icm42688Settings
        The kind; how it is set is the driver's task.
    motion : Motion
        What moves it.
    rng : numpy.random.Generator
        Its own errors and noise.
    grade : ImuGrade
        How good it is.
    power_on_ns : int
        When it got its supply, ns.
    is_booted : bool
        Whether it answers at once.
    """
    kind = KINDS[chip.kind]
    return kind(motion, rng, grade=grade, power_on_ns=power_on_ns, is_booted=is_booted)
