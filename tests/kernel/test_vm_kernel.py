"""The virtual machine before it boots: which kernel it takes, and what it says when one lacks."""

from pathlib import Path

import pytest

from sim_bus.guests import vm, vm_kernel
from sim_bus.guests.guest import STATUS_MISSING
from sim_bus.guests.vm_kernel import KernelError, find_kernel, is_static


@pytest.fixture
def cache(monkeypatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "wing-avionics" / "vm-kernel"


def unpacked(cache: Path, version: str, *, is_complete: bool = True) -> None:
    root = cache / f"linux-image-{version}"
    modules = root / "lib" / "modules" / version
    modules.mkdir(parents=True)
    (root / "boot").mkdir()
    (root / "boot" / f"vmlinuz-{version}").touch()
    if is_complete:
        (modules / "modules.dep").touch()


def test_newest_complete_kernel_is_taken(cache) -> None:
    assert find_kernel() is None
    for version in ("6.1.0-9-amd64", "6.1.0-56-amd64"):
        unpacked(cache, version)
    unpacked(cache, "6.12.1-amd64", is_complete=False)
    kernel = find_kernel()
    assert kernel is not None
    assert kernel.version == "6.1.0-56-amd64"
    assert kernel.image.exists()
    assert kernel.modules.is_dir()


def test_package_is_what_the_meta_package_depends_on() -> None:
    answer = "linux-image-amd64\n  Depends: linux-image-6.1.0-56-amd64\n"
    assert vm_kernel._package_name(answer) == "linux-image-6.1.0-56-amd64"
    with pytest.raises(KernelError, match="depends on no kernel package"):
        vm_kernel._package_name("linux-image-amd64\n")


def test_absent_kernel_is_said_with_the_line_that_fetches_it(cache, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(vm, "find_tool", lambda name: f"/bin/{name}")
    monkeypatch.setattr(vm, "is_static", lambda name: True)
    result = vm.run_in_guest(["true"], tmp_path / "out")
    assert result.status == STATUS_MISSING
    assert result.failure().endswith("avionics rig fetch-kernel")


def test_fetching_where_there_is_no_apt_is_an_error_in_words(cache, monkeypatch) -> None:
    monkeypatch.setattr(vm_kernel, "find_tool", lambda name: None)
    with pytest.raises(KernelError, match="apt-cache not found"):
        vm_kernel.fetch_kernel()


def test_program_with_a_loader_is_not_static(monkeypatch, tmp_path) -> None:
    path = tmp_path / "tool"
    monkeypatch.setattr(vm_kernel, "find_tool", lambda name: str(path))
    path.write_bytes(b"\x7fELF" + bytes(600) + b"/lib64/ld-linux-x86-64.so.2\0")
    assert not is_static("tool")
    path.write_bytes(b"\x7fELF" + bytes(600))
    assert is_static("tool")
