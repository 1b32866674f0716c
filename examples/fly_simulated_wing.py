"""Fly the simulated wing from Python, write its log, and print how far the estimates were off.

.venv/bin/python examples/fly_simulated_wing.py out/example.mcap --seconds 20
"""

import argparse
from pathlib import Path

from avionics import read_flight, run_lockstep
from avionics.analysis.evaluate import evaluate
from avionics.config.load import default_config_text, parse_config_text
from avionics.recording import LogWriter
from sim_bus.rig import open_sim_rig
from sim_bus.wing.scenario import load_scenario


def fly(path: Path, *, seconds: float, seed: int = 0) -> None:
    """Fly the packaged wing through the scenario "oblique": the load is off the wing's axis."""
    # Any key of docs/configuration.md can be set; the text may as well come from your own file.
    overrides = ("estimator.form=general", "recorder.image_format=jpeg")
    config = parse_config_text(default_config_text(), overrides, origin="the packaged wing")
    with (
        open_sim_rig(config, load_scenario("oblique"), seed=seed) as rig,
        LogWriter(path, config, utc_offset_ns=0, metadata={"command": "example"}) as log,
    ):
        run_lockstep(rig, config, log, duration_s=seconds)


def main(arguments: list[str] | None = None) -> None:
    """Fly and evaluate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args(arguments)
    fly(options.path, seconds=options.seconds)
    for kind, score in evaluate(read_flight(options.path)).kinds.items():
        median_px = score.eq17_px["median"] if score.eq17_px else float("nan")
        print(f"{kind:10} markers {median_px:6.2f} px, tip {score.tip_mm['rmse']:6.2f} mm RMS")


if __name__ == "__main__":
    main()
