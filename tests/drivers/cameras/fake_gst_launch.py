"""Stands in for ``gst-launch-1.0``: writes GDP frames as scripted by FAKE_GST, a JSON object.

A list of objects is one for every start in turn, the last for all further ones; FAKE_GST_STARTS
names the file that counts them.

frames: how many; period_s: time between them; hang: silence then, not the end; same: indices of
frames that repeat the first picture; frozen_from: index of the last new picture; no_base: keeps
the base time to itself; garbage: raw bytes; complain: an error and nothing else; height: of the
pictures. Frames that a full pipe made late are left out, as by the leaky queue.
"""

import json
import os
import struct
import sys
import time
from pathlib import Path

WIDTH, HEIGHT = 31, 8  # rows of 93 bytes are padded to 96


def packet(kind: int, payload: bytes, pts_ns: int = (1 << 64) - 1) -> bytes:
    head = struct.pack(">BBBBHIQ", 1, 0, 1, 0, kind, len(payload), pts_ns)
    return head.ljust(62, b"\0") + payload


def picture(number: int, height: int = HEIGHT) -> bytes:
    row = bytes((number + i) % 256 for i in range(3 * WIDTH)) + b"\xff" * 3
    return row * height


def main() -> None:
    script = json.loads(os.environ["FAKE_GST"])
    if isinstance(script, list):
        with Path(os.environ["FAKE_GST_STARTS"]).open("a+b") as starts:
            starts.write(b"x")
            script = script[min(starts.tell(), len(script)) - 1]
    if script.get("complain"):
        sys.stderr.write(f"ERROR: {script['complain']}\n")
        sys.stderr.flush()
        sys.exit(1)
    base_ns = time.monotonic_ns()
    if not script.get("no_base"):
        seconds, rest = divmod(base_ns, 10**9)
        text = f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}.{rest:09d}"
        sys.stderr.write(f"0:00 DEBUG pipeline <pipeline0> start_time=0:00:00, base_time {text}\n")
        sys.stderr.flush()
    out = sys.stdout.buffer
    height, period_s = script.get("height", HEIGHT), script.get("period_s", 0.02)
    start_s = time.monotonic()
    caps = f"video/x-raw, format=(string)BGR, width=(int){WIDTH}, height=(int){height}"
    out.write(packet(10318, b"GstEventStreamStart\0") + packet(2, caps.encode() + b"\0"))
    out.write(bytes.fromhex(script.get("garbage", "")))
    for k in range(script.get("frames", 5)):
        if time.monotonic() > start_s + (k + 5) * period_s:
            continue
        n = min(k, script.get("frozen_from", k))
        content = picture(0 if n in script.get("same", []) else n, height)
        out.write(packet(1, content, time.monotonic_ns() - base_ns))
        out.flush()
        time.sleep(max(0.0, start_s + (k + 1) * period_s - time.monotonic()))
    if script.get("hang"):
        time.sleep(60)


if __name__ == "__main__":
    main()
