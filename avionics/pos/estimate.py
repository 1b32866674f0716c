"""What every method returns."""

from dataclasses import dataclass

import numpy as np

from avionics.pos.compiled import Array, IndexArray


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Angles between master and slave, at K output instants.

    Attributes
    ----------
    index : ndarray of int, shape (K,)
        Output instants as indices of the trajectory's grid.
    rho, theta : ndarray, shape (K, 3)
        Rigid misalignment and flexure, rad.
    covariance : ndarray, shape (K, 6, 6)
        Of (rho, theta), rad^2.
    """

    index: IndexArray
    rho: Array
    theta: Array
    covariance: Array

    @property
    def system_angle(self) -> Array:
        """System error angle u = rho + theta, rad, shape (K, 3)."""
        return self.rho + self.theta

    @property
    def system_covariance(self) -> Array:
        """Covariance of u, rad^2, shape (K, 3, 3)."""
        P = self.covariance
        result: Array = P[:, :3, :3] + P[:, :3, 3:] + P[:, 3:, :3] + P[:, 3:, 3:]
        return result

    @property
    def system_sigma(self) -> Array:
        """One-sigma of u, rad, shape (K, 3)."""
        result: Array = np.sqrt(np.einsum("kii->ki", self.system_covariance))
        return result


@dataclass(frozen=True, slots=True, eq=False)
class Estimates:
    """The filter's estimate and, where it was asked for, the smoother's."""

    filtered: Estimate
    smoothed: Estimate | None = None
