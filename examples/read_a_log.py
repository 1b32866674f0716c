"""Read a log as arrays: what is in it, how good it is, what one pod measured.

.venv/bin/python examples/read_a_log.py out/demo.mcap
"""

import sys

import numpy as np

from avionics import read_flight


def main(path: str) -> None:
    """Print what a log holds."""
    flight = read_flight(path)
    print(flight)
    print(f"{flight.duration_s:.1f} s, {len(flight.events)} events")
    for name, imu in flight.imu.items():
        interval_ms = 1e-6 * np.diff(imu.t_ns)
        lost = int((np.diff(imu.seq) - 1).sum())
        print(
            f"pod {name}: {len(imu.t_ns)} samples, one every {np.median(interval_ms):.2f} ms, "
            f"{lost} lost, strongest rate {np.degrees(np.abs(imu.rate_rad_s).max()):.0f} deg/s"
        )
    for kind, estimate in flight.estimates.items():
        tip = estimate.tip_in_body_m
        print(f"{kind}: {len(tip)} rows, basis {estimate.basis}, tip z {tip[:, 2].min():+.3f} to "
              f"{tip[:, 2].max():+.3f} m (down is positive)")  # fmt: skip
    found = flight.tracks.found
    print(f"markers found: {100.0 * found.mean(axis=0).round(3)} % of {len(found)} frames")


if __name__ == "__main__":
    main(sys.argv[1])
