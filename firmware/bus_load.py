"""Bus load of the pods, computed from the lengths in pod.dbc; prints the table of docs/firmware.md.

Bits of a classic frame with n bytes: 47 + 8 n with the three bits between frames, and at worst
one stuffed bit for four of the 34 + 8 n - 1 that stuffing covers (ISO 11898-1, Sec. 10.5).
"""

import sys
from pathlib import Path

import cantools

FOLDER = Path(__file__).resolve().parent
PODS, BIT_RATES = (2, 8, 16), (500_000, 1_000_000)
SAMPLE_HZ, SYNC_HZ, STATUS_HZ, COUNTERS_HZ = 100, 4, 1, 5
IDENTITY_HZ = 6 / 10  # six parts every ten seconds


def frame_bits(length: int) -> int:
    """Return the bits of a frame with ``length`` bytes, stuffing at its worst."""
    return 47 + 8 * length + (34 + 8 * length - 1) // 4


def rows() -> list[tuple[str, list[float]]]:
    """Return, by what is sent, the load for every number of pods and bit rate, percent."""
    layout = cantools.database.load_file(str(FOLDER.parent / "drivers" / "can" / "pod" / "pod.dbc"))
    bits = {m.name.removeprefix("Pod00_"): frame_bits(m.length) for m in layout.messages}
    house = bits["Status"] * STATUS_HZ + bits["Counters"] * COUNTERS_HZ
    house += bits["Identity"] * IDENTITY_HZ
    gyro = SAMPLE_HZ * (bits["Gyro"] + bits["Sample"])
    every = gyro + SAMPLE_HZ * (bits["Accel"] + bits["Mag"])
    sync = bits["Sync"] + bits["FollowUp"]
    cases = {
        "gyro, own timer": (gyro + SYNC_HZ * bits["SyncReply"], SYNC_HZ * sync),
        "gyro, sync triggers at 100 Hz": (gyro + SAMPLE_HZ * bits["SyncReply"], SAMPLE_HZ * sync),
        "all sensors, own timer": (every + SYNC_HZ * bits["SyncReply"], SYNC_HZ * sync),
    }
    return [
        (name, [100 * (n * (pod + house) + once) / rate for rate in BIT_RATES for n in PODS])
        for name, (pod, once) in cases.items()
    ]


def table() -> str:
    """Return the table in Markdown."""
    heads = [f"{n} pods, {rate // 1000} kbit/s" for rate in BIT_RATES for n in PODS]
    lines = ["| streams | " + " | ".join(heads) + " |", "|---|" + "---:|" * len(heads)]
    for name, loads in rows():
        lines.append(f"| {name} | " + " | ".join(f"{load:.0f} %" for load in loads) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
