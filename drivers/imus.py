"""Both sources of ``ImuSample``: chips polled over I2C or UART, and pods on CAN."""

from drivers.can_imus import CanImus
from drivers.polled_imus import PolledImus

__all__ = ["CanImus", "PolledImus"]
