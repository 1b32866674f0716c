"""WGS-84 earth: radii, rates, gravity. Arrays or scalars, compiled for the loops over time."""

from typing import Any

import numpy as np

from avionics.pos.compiled import Array, compiled

EQUATOR_RADIUS = 6378137.0  # WGS-84 (NIMA TR8350.2), m
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)
EARTH_RATE = 7.292115e-5  # rad/s
GRAVITY_EQUATOR = 9.7803253359  # normal gravity at the equator, m/s^2
SOMIGLIANA = 0.00193185265241
STANDARD_GRAVITY = 9.80665  # m/s^2, the unit behind "ug"


@compiled
def meridian_radius(latitude: Any) -> Any:
    """Return R_M, m, at a latitude, rad."""
    w2 = 1.0 - ECCENTRICITY2 * np.sin(latitude) ** 2
    return EQUATOR_RADIUS * (1.0 - ECCENTRICITY2) / (w2 * np.sqrt(w2))


@compiled
def normal_radius(latitude: Any) -> Any:
    """Return R_N, m, at a latitude, rad."""
    return EQUATOR_RADIUS / np.sqrt(1.0 - ECCENTRICITY2 * np.sin(latitude) ** 2)


@compiled
def gravity(latitude: Any, height: Any) -> Any:
    """Return normal gravity, m/s^2, along -z of n: Somigliana with the factor 1 - 2h/R."""
    s2 = np.sin(latitude) ** 2
    surface = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * s2) / np.sqrt(1.0 - ECCENTRICITY2 * s2)
    return surface * (1.0 - 2.0 * height / EQUATOR_RADIUS)


def earth_rate(latitude: Array) -> Array:
    """Return omega_ie in n, rad/s, shape (..., 3)."""
    zero = np.zeros_like(latitude)
    return np.stack([zero, EARTH_RATE * np.cos(latitude), EARTH_RATE * np.sin(latitude)], axis=-1)


def transport_rate(latitude: Array, height: Array, velocity: Array) -> Array:
    """Return omega_en in n, rad/s, shape (..., 3), of a velocity in n, m/s, shape (..., 3)."""
    north = meridian_radius(latitude) + height
    east = normal_radius(latitude) + height
    return np.stack(
        [
            -velocity[..., 1] / north,
            velocity[..., 0] / east,
            velocity[..., 0] * np.tan(latitude) / east,
        ],
        axis=-1,
    )


def transport_rate_derivative(
    latitude: Array, height: Array, velocity: Array, velocity_dot: Array
) -> Array:
    """Return d(omega_en)/dt + d(omega_ie)/dt in n's own axes, rad/s^2, shape (..., 3)."""
    R_M, R_N = meridian_radius(latitude), normal_radius(latitude)
    north, east, tan = R_M + height, R_N + height, np.tan(latitude)
    sc = np.sin(latitude) * np.cos(latitude)
    w2 = 1.0 - ECCENTRICITY2 * np.sin(latitude) ** 2
    latitude_dot = velocity[..., 1] / north
    north_dot = 3.0 * R_M * ECCENTRICITY2 * sc / w2 * latitude_dot + velocity[..., 2]
    east_dot = R_N * ECCENTRICITY2 * sc / w2 * latitude_dot + velocity[..., 2]
    about_north = velocity_dot[..., 0] / east - velocity[..., 0] * east_dot / east**2
    return np.stack(
        [
            -velocity_dot[..., 1] / north + velocity[..., 1] * north_dot / north**2,
            about_north - EARTH_RATE * np.sin(latitude) * latitude_dot,
            about_north * tan
            + velocity[..., 0] / east * (1.0 + tan**2) * latitude_dot
            + EARTH_RATE * np.cos(latitude) * latitude_dot,
        ],
        axis=-1,
    )


def inertial_from_navigation(latitude: Array, longitude: Array, t: Array) -> Array:
    """Return C_n^i, shape (..., 3, 3); i coincides with the earth frame at t = 0 s."""
    s, c = np.sin(latitude), np.cos(latitude)
    angle = longitude + EARTH_RATE * t
    s_a, c_a, zero = np.sin(angle), np.cos(angle), np.zeros_like(latitude)
    rows = [[-s_a, -s * c_a, c * c_a], [c_a, -s * s_a, c * s_a], [zero, c, s]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
