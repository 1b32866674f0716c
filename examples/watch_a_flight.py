"""Take the records of a flight as they are made: what a controller or a display would do.

A sink is anything with ``write(record, arrival_ns)``; the recorder is one, and this is another. It
gets every record once, in order: samples, frames, tracks, estimates, health, events.

    .venv/bin/python examples/watch_a_flight.py --seconds 5
"""

import argparse

from avionics import run_lockstep
from avionics.config.load import default_config_text, parse_config_text
from avionics.records import Event, WingShapeEstimate
from avionics.topics import Record
from sim_bus.rig import open_sim_rig
from sim_bus.wing.scenario import load_scenario


class TipWatch:
    """Prints the tip's height twice a second, and every event."""

    def __init__(self) -> None:
        self.heights_m: list[float] = []

    def write(self, record: Record, arrival_ns: int) -> None:
        """Take one record that arrived at ``arrival_ns``."""
        if isinstance(record, Event):
            print(f"{arrival_ns * 1e-9:8.2f} s  {record.level}: {record.source}: {record.message}")
        if not isinstance(record, WingShapeEstimate) or record.kind != "crg":
            return
        # Body axes: z points down.
        self.heights_m.append(-float(record.line_in_body_m[-1, 2]))
        if len(self.heights_m) % 50 == 0:
            sigma_mm = 1e3 * record.tip_sigma_m[2]
            age_ms = (arrival_ns - record.t_ns) * 1e-6
            print(
                f"{record.t_ns * 1e-9:8.2f} s  tip {self.heights_m[-1]:+.4f} m "
                f"+- {sigma_mm:.1f} mm, made {age_ms:.0f} ms after its instant"
            )


def main(arguments: list[str] | None = None) -> TipWatch:
    """Fly the packaged wing and watch it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    options = parser.parse_args(arguments)
    config = parse_config_text(default_config_text(), origin="the packaged wing")
    watch = TipWatch()
    with open_sim_rig(config, load_scenario("default"), seed=3) as rig:
        run_lockstep(rig, config, watch, duration_s=options.seconds)
    return watch


if __name__ == "__main__":
    main()
