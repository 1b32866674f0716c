"""What the camera should see: pixels of the markers and the tip as functions of the amplitudes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from avionics.wse.geometry import WingGeometry, integration_matrix
from avionics.wse.jacobian import STEP, perturbed
from avionics.wse.modes import ModeBasis
from avionics.wse.pinhole import Pinhole

Array = NDArray[Any]

LINE_POINTS = 21


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The wing as the camera sees it at one set of amplitudes, or at a stack of them.

    Attributes
    ----------
    pixel : ndarray, shape (K, 2)
        Raw-image pixels, px.
    can_see : ndarray of bool, shape (K,)
        Before the camera and inside the lens law.
    pixel_by_q : ndarray, shape (K, 2, n)
        Derivatives by the amplitudes, px/rad.
    line_in_body : ndarray, shape (S, 3)
        Points of the reference line, m; the last is the tip.
    tip_by_q : ndarray, shape (3, n)
        Derivatives of the tip, m/rad.
    """

    pixel: Array
    can_see: Array
    pixel_by_q: Array
    line_in_body: Array
    tip_by_q: Array

    def __getitem__(self, i: int | slice) -> "View":
        """Return one view, or some, of a stack."""
        return View(
            self.pixel[i],
            self.can_see[i],
            self.pixel_by_q[i],
            self.line_in_body[i],
            self.tip_by_q[i],
        )

    def in_basis(self, embed: Array) -> "View":
        """Return the view with derivatives by the amplitudes of a smaller basis."""
        return View(
            self.pixel,
            self.can_see,
            self.pixel_by_q @ embed.T,
            self.line_in_body,
            self.tip_by_q @ embed.T,
        )


class MarkerModel:
    """Markers, tip and line of one wing before one camera.

    Parameters
    ----------
    basis : ModeBasis
        Mode shapes.
    points : ndarray, shape (K, 3)
        Arc length s of each marker, and its place (x, z) in the local frame there, m.
    camera : Pinhole or None
        Without a camera no marker is predicted.
    psi0 : float
        Sweep at the root, rad.
    is_left : bool
        Whether it is a left wing, the mirror in y of a right one.
    """

    def __init__(
        self,
        basis: ModeBasis,
        points: Array,
        camera: Pinhole | None,
        *,
        psi0: float = 0.0,
        is_left: bool = False,
    ) -> None:
        self.basis = basis
        self.count = len(points)
        self.camera = camera
        span = basis.span_m
        s, x, z = np.ascontiguousarray(np.vstack([points, [span, 0.0, 0.0]]).T)
        self._geometry = WingGeometry(basis, s, x=x, z=z, psi0=psi0)
        self._mirror = np.array([1.0, -1.0 if is_left else 1.0, 1.0])
        self._is_mirrored = is_left
        self._to_line = integration_matrix(np.linspace(0.0, span, LINE_POINTS), span).T.copy()

    def _in_body(self, components: Array) -> Array:
        """Mirror (..., 3, S) for a left wing."""
        return components * self._mirror[:, None] if self._is_mirrored else components

    def points(self, q: Array) -> Array:
        """Return the markers in body axes, m, shape (..., K, 3)."""
        points: Array = self._geometry.points(q) * self._mirror
        return points[..., : self.count, :]

    def pixels(self, q: Array) -> Array:
        """Return the markers' raw-image pixels, shape (..., K, 2); NaN without a camera."""
        if self.camera is None:
            return np.full((*q.shape[:-1], self.count, 2), np.nan)
        pixel: Array = self.camera.project(self.points(q))
        return pixel

    def stack(self, amplitudes: Array) -> View:
        """Return the views at A sets of amplitudes (A, n), all derivatives in one batched call.

        The arrays of the view have the sets as their first axis.
        """
        k = self.count
        shape = self._geometry.at(perturbed(amplitudes))
        tip = self._in_body(shape.line[..., -1:])[..., 0]
        line = self._in_body(shape.tangent_at_nodes[:, 0].real @ self._to_line)
        if self.camera is None:
            seen = np.zeros((len(tip), k), dtype=bool)
            pixel = np.full((*tip.shape[:2], 2, k), np.nan, dtype=complex)
        else:
            markers = self._in_body((shape.line + shape.offset)[..., :k])
            pixel, every = self.camera.project_components(markers)
            seen = every[:, 0]
        return View(
            pixel[:, 0].real.swapaxes(1, 2),
            seen,
            (pixel.imag / STEP).transpose(0, 3, 2, 1),
            line.swapaxes(1, 2),
            (tip.imag / STEP).swapaxes(1, 2),
        )

    def view(self, q: Array) -> View:
        """Return the view at amplitudes ``q``."""
        return self.stack(q[None])[0]
