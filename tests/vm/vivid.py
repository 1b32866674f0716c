"""vivid, the kernel's own test camera: loaded, told, unplugged and plugged in again."""

import subprocess
from pathlib import Path

DRIVER = Path("/sys/bus/platform/drivers/vivid")


def load(**parameters: str) -> None:
    """Unload the module and load it again."""
    if DRIVER.exists():
        subprocess.run(["modprobe", "-r", "vivid"], check=True)
    words = [f"{name}={value}" for name, value in parameters.items()]
    subprocess.run(["modprobe", "vivid", "n_devs=1", *words], check=True)


def tell(device: str, *words: str) -> str:
    """Call v4l2-ctl on a device; returns what it prints."""
    done = subprocess.run(
        ["v4l2-ctl", "-d", device, *words], check=True, capture_output=True, text=True
    )
    return done.stdout


def control(device: str, name: str) -> int:
    """Return the value of a control as the kernel has it."""
    return int(tell(device, "-C", name).split(":")[1])


def unplug() -> None:
    """Take the device away; its node vanishes."""
    (DRIVER / "unbind").write_text("vivid.0")


def plug_in() -> None:
    """Bring it back, with all controls at their defaults."""
    (DRIVER / "bind").write_text("vivid.0")
