"""Semi-physical flight of a real wing: its motion as truth, our pods and camera on it.

    python benchmarks/real_wing.py [--seeds 10] [-o FIGURE.png]

The motion is Bobshpog/AeroVision's motion capture of a real flexible wing (240 Hz, struck at
9.5 s). Slopes along the main spar, low-passed and differentiated, become the rates of two BNO055
(32 Hz low-pass, noise, zero-rate offset, quantisation) at `Main` 05 and 09; `Main` and `Rear` 06,
09, 10 become the pixels of a root camera (f = 604 px, 30 fps, 0.3 px white noise, the real
drop-outs). Everything goes through the pipeline that flies. Tip: `Main` 11, vertical motion
against its place at rest.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.signal import butter, filtfilt, lfilter

from avionics.analysis.interpolation import between
from avionics.config import Camera, Config, Estimator, Marker, Pod, Wing
from avionics.config.chips import Bno055Settings
from avionics.datasets.motive import MotiveTake, read_motive
from avionics.flight.filter_setup import marker_model, pinhole_from_config, recorded_basis
from avionics.flight.pipelines import Pipelines
from avionics.records import MarkerTracks, WingShapeEstimate
from avionics.wse.modes import ModeBasis
from drivers.samples import ImuSample

SOURCE = Path(__file__).resolve().parents[2] / "shared/data/real/flexible-wing-mocap"
SETTLED_S, REST_S, STRIKE_S = 4.0, 8.0, 9.5
MOTION_HZ = 25.0
FILTER_HZ = 32.0
SEEN = ("06", "09", "10")
PODS = ("05", "09")
TARGET = 0.15


class Motion:
    """The wing's motion in body axes: origin at `Main` 01, y along the spar at rest, z down."""

    def __init__(self, take: MotiveTake) -> None:
        self.t_s = take.t_s
        raw = {n: p[:, [0, 2, 1]] * (1, 1, -1) for n, p in take.position_m.items()}
        rest = {n: np.nanmean(p[take.t_s < REST_S], axis=0) for n, p in raw.items()}
        origin, second = rest["Main_Beam:01"], rest["Main_Beam:02"]
        y = (second - origin) / np.linalg.norm(second - origin)
        x = np.cross(y, (0.0, 0.0, 1.0))
        x /= np.linalg.norm(x)
        # Body axes: the spar's own direction at the root, so that the clamped slope is zero.
        axes = np.stack([x, y, np.cross(x, y)])
        self.point = {n: (p - origin) @ axes.T for n, p in raw.items()}
        self.rest = {n: (p - origin) @ axes.T for n, p in rest.items()}
        spar = np.array([self.rest[f"Main_Beam:{k:02d}"] for k in range(1, 12)])
        self.s_m = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(spar, axis=0), axis=1))])
        low_pass = butter(4, MOTION_HZ, fs=take.rate_hz)
        self.smooth = {n: filtfilt(*low_pass, _filled(p), axis=0) for n, p in self.point.items()}

    def rates(self, pod: str) -> np.ndarray:
        """Return (P, Q, R) of a station, rad/s.

        Slopes come from clamped polynomials through the whole spar: marker by marker the recorded
        deflection departs from any smooth shape by 5 % of its range, and slopes of neighbours by
        a quarter.
        """
        s = self.s_m[int(pod) - 1]
        spar = np.array([self.smooth[f"Main_Beam:{k:02d}"] for k in range(1, 12)])
        rear = np.array([self.smooth[f"Rear_Beam:{k:02d}"] for k in range(2, 11)])
        powers = np.arange(2, 5)
        shape = np.linalg.lstsq(self.s_m[:, None] ** powers, spar[..., 2], rcond=None)[0]
        phi = np.arcsin((powers * s ** (powers - 1)) @ shape)
        # Nose up is positive; the rear spar stands on the positive side of the chord's axis.
        chord = rear - spar[1:-1]
        angle = -np.arctan2(chord[..., 2], chord[..., 0])
        twist = np.linalg.lstsq(
            self.s_m[1:-1, None] ** (1, 2), angle - angle.mean(1)[:, None], rcond=None
        )[0]
        theta = np.array([s, s**2]) @ twist
        d_phi, d_theta = np.gradient(phi, self.t_s), np.gradient(theta, self.t_s)
        return np.stack([d_phi, d_theta * np.cos(phi), -d_theta * np.sin(phi)], axis=1)


def _filled(p: np.ndarray) -> np.ndarray:
    index = np.arange(len(p))
    known = np.isfinite(p[:, 0])
    return np.stack([np.interp(index, index[known], p[known, a]) for a in range(3)], axis=1)


def configuration(motion: Motion, estimator: Estimator) -> Config:
    """Return the wing with pods and LEDs where the mocap markers were; offsets fitted at rest."""
    span_m = float(motion.s_m[-1])
    places = {f"{b}:{k}": motion.s_m[int(k) - 1] for b in ("Main_Beam", "Rear_Beam") for k in SEEN}
    places["Main_Beam:11"] = span_m
    camera = Camera(
        f_x_px=604, f_y_px=604, c_x_px=319.5, c_y_px=239.5, tilt_deg=-15, pan_deg=0,
        r_in_body_m=(-0.03, -0.12, -0.12), calibrated=True,
    )  # fmt: skip
    chip = Bno055Settings(mode="ndof", gyro_bandwidth_hz=32)
    markers = tuple(Marker(id=i, s_m=s) for i, s in enumerate(places.values()))
    bare = Config(
        wing=Wing(span_m=span_m), camera=camera, estimator=estimator,
        pods=tuple(Pod(id=i, s_m=motion.s_m[int(k) - 1], chip=chip) for i, k in enumerate(PODS)),
        markers=markers,
    )  # fmt: skip
    # Where the LEDs sit on their sections: measured on the wing at rest, as a lab would.
    basis = ModeBasis("quarter-sine", span_m, 1, 1, 0)
    model = marker_model(bare, basis)
    q = np.zeros(2)
    spar = [motion.rest[f"Main_Beam:{k:02d}"] for k in range(1, 12)]
    line = marker_model(
        bare, basis, markers=[Marker(id=i, s_m=s) for i, s in enumerate(motion.s_m)]
    )
    grid = np.linspace(-0.4, 0.4, 801)
    shapes = np.stack([grid, np.zeros_like(grid)], axis=1)
    misfit = ((line.points(shapes) - np.array(spar)) ** 2).sum(axis=(1, 2))
    q[0] = grid[int(np.argmin(misfit))]
    offset = np.array([motion.rest[n] for n in places]) - model.points(q)
    phi = q[0] * np.sin(np.pi * np.array(list(places.values())) / (2 * span_m))
    down = offset[:, 2] * np.cos(phi) - offset[:, 1] * np.sin(phi)
    fitted = tuple(
        m.model_copy(update={"x_m": float(o[0]), "z_m": float(d)})
        for m, o, d in zip(markers, offset, down, strict=True)
    )
    return bare.model_copy(update={"markers": fitted[:-1], "truth_markers": fitted})


class Kept(list):
    def write(self, record, arrival_ns) -> None:
        if isinstance(record, WingShapeEstimate):
            self.append(record)


def fly(motion: Motion, config: Config, seed: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return time and vertical position of the tip marker by kind of estimate."""
    rng = np.random.default_rng(seed)
    events: list[tuple[int, int, object]] = []
    fs = 1.0 / np.median(np.diff(motion.t_s))
    chip_filter = butter(2, FILTER_HZ, fs=fs)
    for i, pod in enumerate(PODS):
        seen = lfilter(*chip_filter, motion.rates(pod), axis=0)
        t_s = np.arange(0.013 + 0.003 * i, motion.t_s[-1], 0.01)
        rate = np.stack([np.interp(t_s, motion.t_s, seen[:, a]) for a in range(3)], axis=1)
        rate = rate + np.radians(rng.uniform(-1, 1, 3))
        rate = rate + np.radians(0.014) * np.sqrt(100 / 2) * rng.standard_normal(rate.shape)
        lsb = np.radians(1 / 16)
        rate = np.rint(rate / lsb) * lsb
        for n, (t, value) in enumerate(zip(t_s, rate, strict=True)):
            t_ns = round(t * 1e9)
            events.append((t_ns, 0, ImuSample(t_ns, str(i), n, value)))
    camera = pinhole_from_config(config.camera)
    names = [f"{b}:{k}" for b in ("Main_Beam", "Rear_Beam") for k in SEEN]
    points = np.stack([motion.point[n] for n in names], axis=1)
    frame_ns = np.round(np.arange(0.02, motion.t_s[-1], 1 / 30) * 1e9).astype(np.int64)
    t_ns = np.round(motion.t_s * 1e9).astype(np.int64)
    true_px = camera.project(between(t_ns, points, frame_ns))
    for n, (t, pixel) in enumerate(zip(frame_ns, true_px, strict=True)):
        noisy = pixel + 0.3 * rng.standard_normal(pixel.shape)
        found = np.isfinite(noisy).all(axis=1) & camera.in_image(pixel)
        tracks = MarkerTracks(
            int(t), "root", n, np.where(found[:, None], noisy, np.nan),
            np.where(found, 0.3, np.nan), found, "mocap",
        )  # fmt: skip
        events.append((int(t) + 45_000_000, 1, tracks))
    kept = Kept()
    pipeline = Pipelines(config, kept)
    for arrival_ns, kind, record in sorted(events, key=lambda e: (e[0], e[1])):
        (pipeline.on_imu if kind == 0 else pipeline.on_tracks)(record, arrival_ns)
    pipeline.close()
    tips = {}
    for kind in ("rg", "crg", "filtered"):
        rows = [r for r in kept if r.kind == kind]
        q = np.array([np.concatenate([r.phi_rad, r.theta_rad, r.psi_rad]) for r in rows])
        basis = recorded_basis(config, rows[0].basis)
        model = marker_model(config, basis, markers=config.truth_markers[-1:])
        tips[kind] = np.array([r.t_ns for r in rows]) * 1e-9, model.points(q)[:, 0, 2]
    return tips


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("-o", "--output", type=Path, help="figure of the first seed")
    arguments = parser.parse_args()
    path = SOURCE / "ir_lab_conditions.csv"
    if not path.exists():
        print(f"skipped: {path.name} is not beside the project (../shared/data/real)")
        return
    motion = Motion(read_motive(path))
    tip = motion.point["Main_Beam:11"][:, 2]
    rest_m = float(np.nanmean(tip[motion.t_s < REST_S]))
    after = motion.t_s > STRIKE_S
    scale_m = float(np.sqrt(np.nanmean((tip[after] - rest_m) ** 2)))
    print("motion: Bobshpog/AeroVision, real flexible wing, motion capture at 240 Hz")
    print(f"tip motion after the strike: {1e3 * scale_m:.2f} mm RMS\n")
    print(
        "form                estimate   tip error RMS, % of motion (mean, min..max over seeds)  mm"
    )
    forms = {
        "paper, 1 + 1 modes": Estimator(form="paper"),
        "one mode, general": Estimator(
            bending_modes=1, twist_modes=1, inplane_modes=0, gyro_lag_s="filter"
        ),
        # These gyros are read the moment they are sampled: their filter is all that delays them.
        "general default": Estimator(gyro_lag_s="filter"),
    }
    for name, estimator in forms.items():
        config = configuration(motion, estimator)
        flights = [fly(motion, config, seed) for seed in range(arguments.seeds)]
        for kind in ("rg", "crg", "filtered"):
            share = []
            for flight in flights:
                t_s, z_m = flight[kind]
                use = (t_s > STRIKE_S) & (t_s < motion.t_s[-1] - 0.1)
                at_rest = (t_s > SETTLED_S) & (t_s < REST_S)
                error = (
                    z_m[use] - z_m[at_rest].mean() - np.interp(t_s[use], motion.t_s, tip - rest_m)
                )
                share.append(100 * float(np.sqrt(np.nanmean(error**2))) / scale_m)
            mean = np.mean(share)
            note = ""
            if name.startswith("one mode") and kind != "rg":
                note = "  target <= 15 %: " + ("met" if mean <= 100 * TARGET else "MISSED")
            print(
                f"{name:20s}{kind:9s}  {mean:7.1f} ({min(share):.1f}..{max(share):.1f})"
                f"  {mean * scale_m * 10:6.3f}{note}"
            )
        if arguments.output and name == "one mode, general":
            _draw(arguments.output, motion, tip, flights[0])


def _draw(output: Path, motion: Motion, tip: np.ndarray, flight: dict) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 1, figsize=(11, 7), sharex=True)
    axes[0].plot(motion.t_s, 1e3 * tip, "k", lw=0.8, label="motion capture")
    for kind, colour in (("rg", "tab:gray"), ("crg", "tab:red")):
        t_s, z_m = flight[kind]
        axes[0].plot(t_s, 1e3 * z_m, colour, lw=0.8, label=kind)
        error = 1e3 * (z_m - np.interp(t_s, motion.t_s, tip))
        error -= error[(t_s > SETTLED_S) & (t_s < REST_S)].mean()
        axes[1].plot(t_s, error, colour, lw=0.8, label=kind)
    axes[0].set_ylabel("tip, mm down")
    axes[1].set(ylabel="error, mm", xlabel="time, s", ylim=(-4, 4))
    for ax in axes:
        ax.legend(loc="upper left")
        ax.grid(alpha=0.3)
    figure.suptitle("Semi-physical flight; motion: Bobshpog/AeroVision")
    figure.savefig(output, dpi=110, bbox_inches="tight")


if __name__ == "__main__":
    main()
