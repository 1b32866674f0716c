"""Draw docs/wing.svg: the wing, its axes, and what is measured, by the estimator's own geometry."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from avionics.config import Config
from avionics.config.load import default_config_text, parse_config_text
from avionics.flight.filter_setup import choose_basis, pinhole_from_config
from avionics.wse.attitude import station_attitude
from avionics.wse.geometry import WingGeometry

Array = NDArray[Any]

# Bending up (negative: tip down is positive) and a little nose-up twist, rad.
BENDING_RAD, TWIST_RAD = -0.36, 0.14
CHORD_M = 0.26
# Where the reference line lies in the chord, from the leading edge.
LINE_IN_CHORD = 0.4
INK, BLUE, RED, GREY, LIGHT = "#1f2933", "#1f6feb", "#d1242f", "#6b7785", "#dfe7ef"


def on_paper(points: Array) -> Array:
    """Return body points (..., 3) as the reader sees them, from behind, aside and above."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([y + 0.42 * x, 0.62 * x - 1.0 * z], axis=-1)


def beside(point: Array, right: float, up: float) -> Array:
    """Return a place on the paper beside another."""
    return point + np.array([right, up])


def arrow(axes: Any, start: Array, end: Array, label: str, colour: str, **text: Any) -> None:
    """Draw a labelled arrow between two body points."""
    a, b = on_paper(start), on_paper(end)
    style = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=b, xytext=a, arrowprops=style)
    at = b + 0.035 * (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
    axes.text(*at, label, color=colour, fontsize=10, style="italic", **text)


def section_points(config: Config, s: Array, x: Array, q: Array) -> Array:
    """Return points at arc lengths ``s`` and chordwise places ``x`` of the bent wing, body axes."""
    return WingGeometry(choose_basis(config), s, x=x).points(q)


def draw_wing(axes: Any, config: Config, q: Array) -> None:
    """Draw the straight and the bent wing, gyros, LEDs, camera and axes."""
    span = config.wing.span_m
    s = np.linspace(0.0, span, 41)
    front, back = LINE_IN_CHORD * CHORD_M, (LINE_IN_CHORD - 1.0) * CHORD_M
    for shape, face, edge, style in ((0 * q, "none", GREY, "--"), (q, LIGHT, INK, "-")):
        leading = on_paper(section_points(config, s, np.full_like(s, front), shape))
        trailing = on_paper(section_points(config, s, np.full_like(s, back), shape))
        outline = np.vstack([leading, trailing[::-1]])
        axes.fill(*outline.T, facecolor=face, edgecolor=edge, lw=1.1, ls=style)
    line = on_paper(section_points(config, s, 0 * s, q))
    axes.plot(*line.T, color=INK, lw=1.4, ls="-.")
    where = line[11]
    axes.annotate(
        "reference line,\narc length s",
        xy=where,
        xytext=beside(where, 0.10, -0.38),
        fontsize=9,
        ha="center",
        color=INK,
        arrowprops={"arrowstyle": "-", "color": INK, "lw": 0.7},
    )
    draw_gyros(axes, config, q)
    draw_leds(axes, config, q)
    draw_camera(axes, config, q)
    origin = np.zeros(3)
    for end, label in (([0.42, 0, 0], "x"), ([0, 0.26, 0], "y"), ([0, 0, 0.34], "z")):
        arrow(axes, origin, np.array(end), label, INK, ha="center", va="center")
    axes.text(
        -0.19,
        -0.42,
        "body axes at the root:\nx forward, y to the tip, z down",
        fontsize=9,
        color=INK,
        va="top",
    )


def draw_gyros(axes: Any, config: Config, q: Array) -> None:
    """Draw the pods and, at the last of them, its local axes."""
    s = np.array([pod.s_m for pod in config.pods])
    points = section_points(config, s, 0 * s, q)
    axes.plot(*on_paper(points).T, "s", ms=11, mfc=BLUE, mec="white", mew=1.0, zorder=5)
    for number, point in enumerate(on_paper(points)):
        axes.text(
            *beside(point, -0.20, -0.135),
            f"$(P,Q,R)_{number + 1}$",
            color=BLUE,
            fontsize=10,
            bbox={"facecolor": "white", "lw": 0, "pad": 1.5},
            zorder=7,
        )
    shape = WingGeometry(choose_basis(config), s).at(q)
    local_axes = station_attitude(*(float(a[-1]) for a in (shape.phi, shape.theta, shape.psi)))
    for axis, label in enumerate(("local x", "", "local z")):
        if label:
            arrow(
                axes,
                points[-1],
                points[-1] + 0.27 * local_axes[axis],
                label,
                BLUE,
                ha="center",
                va="bottom" if axis == 0 else "top",
            )


def draw_leds(axes: Any, config: Config, q: Array) -> None:
    """Draw the LEDs on the wing's upper side."""
    points = on_paper(leds(config, q))
    axes.plot(*points.T, "o", ms=6.5, mfc=RED, mec="white", mew=0.8, zorder=6)


def leds(config: Config, q: Array) -> Array:
    """Return the LEDs in body axes, m."""
    s = np.array([m.s_m for m in config.markers])
    x, z = (np.array([getattr(m, name) for m in config.markers]) for name in ("x_m", "z_m"))
    return WingGeometry(choose_basis(config), s, x=x, z=z).points(q)


def draw_camera(axes: Any, config: Config, q: Array) -> None:
    """Draw the camera and its rays to the LEDs."""
    camera = pinhole_from_config(config.camera) if config.camera else None
    assert camera is not None
    place = on_paper(camera.r_cam_in_body)
    for point in on_paper(leds(config, q)):
        axes.plot(*np.vstack([place, point]).T, color=RED, lw=0.5, alpha=0.45, zorder=4)
    axes.plot(*place, marker="s", ms=13, mfc=INK, mec="white", zorder=6)
    axes.plot(*beside(place, 0.025, -0.004), marker=">", ms=8, mfc=INK, mec="white", zorder=5)
    axes.text(
        *beside(place, -0.06, 0.05),
        "camera at the root,\nlooking along the span",
        fontsize=9,
        color=INK,
        ha="left",
        va="bottom",
    )


def draw_angles(axes: Any, config: Config, q: Array) -> None:
    """Say at the tip what is estimated."""
    tip = on_paper(section_points(config, np.array([config.wing.span_m]), np.zeros(1), q))[0]
    flat = on_paper(np.array([0.0, config.wing.span_m, 0.0]))
    axes.annotate(
        "",
        xy=tip,
        xytext=flat,
        arrowprops={"arrowstyle": "<->", "color": GREY, "lw": 1.0, "ls": ":"},
    )
    axes.text(
        *beside(tip, 0.09, 0.03),
        "estimated along the line:\n"
        r"bending $\varphi(s,t)$, tip down positive"
        "\n"
        r"twist $\theta(s,t)$, nose up positive"
        "\n"
        r"in-plane $\psi(s,t)$",
        fontsize=9.5,
        color=INK,
        va="center",
    )
    axes.text(*beside(flat, -0.44, -0.18), "straight wing", fontsize=9, color=GREY, va="bottom")


def draw_picture(axes: Any, config: Config, q: Array) -> None:
    """Draw what the camera measures: the LEDs' pixels."""
    assert config.camera is not None
    camera = pinhole_from_config(config.camera)
    pixel = camera.project(leds(config, q))
    axes.set_facecolor("#11161c")
    for radius, strength in ((13, 0.25), (8, 0.5), (4, 1.0)):
        axes.scatter(*pixel.T, s=radius**2, c="#ffd9d9", alpha=strength, lw=0)
    for number, (u, v) in enumerate(pixel):
        axes.text(u + 14, v - 12, f"{number}", color="white", fontsize=8)
    axes.set(xlim=(0, config.camera.width_px), ylim=(config.camera.height_px, 0), aspect="equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title("measured by the camera: LED pixels $(u, v)$", fontsize=10, color=RED)


def main(path: Path = Path(__file__).parent / "wing.svg") -> None:
    """Draw the picture.

    Parameters
    ----------
    path : Path
        Where; the suffix decides the format.
    """
    config = parse_config_text(default_config_text(), origin="default.toml")
    q = np.zeros(choose_basis(config).count)
    basis = choose_basis(config)
    q[basis.phi.start], q[basis.theta.start] = BENDING_RAD, TWIST_RAD
    mpl.rcParams.update({"svg.hashsalt": "wing", "svg.fonttype": "path", "font.size": 10})
    figure = plt.figure(figsize=(10.4, 5.04))
    wing = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    draw_wing(wing, config, q)
    draw_angles(wing, config, q)
    wing.text(
        0.62,
        -0.35,
        "measured by the gyros:\nrates $(P, Q, R)$ of each pod, local axes",
        fontsize=10,
        color=BLUE,
        va="top",
    )
    wing.set(xlim=(-0.22, 2.38), ylim=(-0.68, 0.58), aspect="equal")
    wing.axis("off")
    picture = figure.add_axes((0.70, 0.03, 0.285, 0.43))
    draw_picture(picture, config, q)
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()
