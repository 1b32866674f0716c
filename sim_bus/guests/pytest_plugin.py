"""pytest plugin: tiers by marker, ``--require``, and ``uml`` and ``vm`` tests run inside a guest.

Use it with ``-p sim_bus.guests.pytest_plugin``. A test whose tier this machine lacks is skipped
with the line that installs it; a tier named in ``--require`` must be there. Tests marked ``uml``
or ``vm`` that are started on the host run together in one guest of that kind, and are reported
here one by one.
"""

import json
import os
import re
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from sim_bus.guests.guest import STATUS_DIED, STATUS_MISSING, guest_kind
from sim_bus.guests.kinds import RUNNERS
from sim_bus.guests.tiers import TIERS

REPORTS = "reports.jsonl"
LIMIT_S = float(os.environ.get("RIG_LIMIT_S", "900"))
# Variables by which Python and pytest find what the tests import.
PASSED_ON = ("PYTHONPATH", "PYTEST_PLUGINS", "PYTEST_DISABLE_PLUGIN_AUTOLOAD")
# By kind of guest, then by test.
_guest_reports: pytest.StashKey[dict[str, dict[str, list[Any]]]] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--require``."""
    parser.addoption(
        "--require",
        default="",
        help="comma-separated tiers that must run here; a missing one fails instead of skipping",
    )


@cache
def _missing(name: str) -> str | None:
    return next(tier.missing() for tier in TIERS if tier.name == name)


def pytest_configure(config: pytest.Config) -> None:
    """Refuse to start when a promised tier is unknown or missing."""
    for tier in TIERS:
        config.addinivalue_line("markers", f"{tier.name}: {tier.content}")
    chosen = set(re.findall(r"(?<!not )\b\w+", config.getoption("-m")))
    if getattr(config.option, "numprocesses", None) and (kinds := sorted(chosen & set(RUNNERS))):
        msg = f"-m {kinds[0]} with -n: such tests run in one guest, one by one; leave -n out"
        raise pytest.UsageError(msg)
    known = {tier.name for tier in TIERS}
    for name in filter(None, map(str.strip, config.getoption("--require").split(","))):
        if name not in known:
            msg = f"--require={name}: no such tier; known: {', '.join(sorted(known))}"
            raise pytest.UsageError(msg)
        if (reason := _missing(name)) is not None:
            msg = f"promised tier '{name}' cannot run here: {reason}"
            raise pytest.UsageError(msg)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip, with the reason, what this machine or this selection leaves out."""
    chosen = config.getoption("-m")
    for item in items:
        for tier in TIERS:
            if item.get_closest_marker(tier.name) is None:
                continue
            if (reason := _missing(tier.name)) is not None:
                item.add_marker(pytest.mark.skip(reason=f"tier {tier.name}: {reason}"))
            elif tier.name not in chosen and guest_kind() is None:
                reason = f"tier {tier.name}: select it with -m {tier.name}"
                item.add_marker(pytest.mark.skip(reason=reason))
        if item.get_closest_marker("proof") is not None and "proof" not in chosen:
            item.add_marker(pytest.mark.skip(reason="long proof: select it with -m proof"))


def _guest_of(item: pytest.Item) -> str | None:
    """Return the kind of guest that a test of this host is to run in."""
    if any(item.iter_markers("skip")) or guest_kind() is not None:
        return None
    return next((kind for kind in RUNNERS if item.get_closest_marker(kind) is not None), None)


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> None:
    """Run the chosen tests of each kind in one guest, before the first test's time limit begins."""
    session.stash[_guest_reports] = {}
    for kind in RUNNERS:
        chosen = [item for item in session.items if _guest_of(item) == kind]
        if chosen and not session.config.option.collectonly:
            session.stash[_guest_reports][kind] = _run_guest(kind, session.config, chosen)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> bool | None:
    """Report a test from the guest's run instead of running it on the host."""
    kind = _guest_of(item)
    if kind is None:
        return None
    found = item.session.stash[_guest_reports].get(kind, {"": []})
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = found.get(item.nodeid, [])
    # Every test ends with its teardown: what does not took the guest with it.
    if not any(report.when == "teardown" for report in reports):
        reports = [*reports, _died(item, found[""])]
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _run_guest(kind: str, config: pytest.Config, items: list[pytest.Item]) -> dict[str, list[Any]]:
    out = Path(tempfile.mkdtemp(prefix=f"{kind}-"))
    command = [
        *(sys.executable, "-m", "pytest", "-q"),
        *_passed_on(config),
        *("-m", config.getoption("-m") or kind),
        *(item.nodeid for item in items),
    ]
    environment = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    # What is promised here is promised there: a test may fail for it instead of skipping.
    environment["RIG_REQUIRE"] = config.getoption("--require")
    result = RUNNERS[kind](
        command, out, limit_s=LIMIT_S, cwd=config.rootpath, environment=environment
    )
    found: dict[str, list[Any]] = {"": []}
    path = out / REPORTS
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        report = config.hook.pytest_report_from_serializable(config=config, data=json.loads(line))
        if isinstance(report.longrepr, list):  # a skip's place and reason: JSON has no tuples
            report.longrepr = tuple(report.longrepr)
        found.setdefault(report.nodeid, []).append(report)
    if result.status == 0:
        shutil.rmtree(out, ignore_errors=True)
    elif len(found) == 1 or result.status != 1:
        why = result.failure()
        if result.status not in {STATUS_DIED, STATUS_MISSING}:
            why = f"pytest in the guest ended with status {result.status}; its files: {out}"
        found[""] = [f"{why}\n{result.stdout[-3000:]}\n{result.stderr[-1500:]}"]
    return found


def _passed_on(config: pytest.Config) -> list[str]:
    """Return the options by which the guest's pytest finds the same tests under the same names."""
    options = config.option
    # This plugin first: it may have been named on the command line only.
    plugins = dict.fromkeys([__name__, *options.plugins, "no:cacheprovider"])
    words = [word for name in plugins for word in ("-p", name)]
    words.append(f"--rootdir={config.rootpath}")
    if config.inipath is not None:
        words += ["-c", str(config.inipath)]
    for pair in options.override_ini or ():
        words += ["-o", pair]
    for pattern in options.pythonwarnings or ():
        words += ["-W", pattern]
    words.append(f"--import-mode={options.importmode}")
    if options.noconftest:
        words.append("--noconftest")
    return words


def _died(item: pytest.Item, reasons: list[str]) -> pytest.TestReport:
    why = "\n".join(reasons) or "the guest reported no end of this test"
    return pytest.TestReport(item.nodeid, item.location, {}, "failed", why, "call")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Inside the guest: hand every report to the host."""
    if guest_kind() is not None and _config is not None:
        data = _config.hook.pytest_report_to_serializable(config=_config, report=report)
        with (Path(os.environ["RIG_OUT"]) / REPORTS).open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(data, default=str) + "\n")


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print what the tiers' tests measured (``record_property``)."""
    lines = [
        f"{report.nodeid.rsplit('::', 1)[-1]}: "
        + ", ".join(f"{name} = {_short(value)}" for name, value in report.user_properties)
        for reports in terminalreporter.stats.values()
        for report in reports
        if getattr(report, "when", "") == "call" and report.user_properties
    ]
    if lines and guest_kind() is None:
        terminalreporter.section("measured")
        for line in lines:
            terminalreporter.write_line(line)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


_config: pytest.Config | None = None


def pytest_sessionstart(session: pytest.Session) -> None:
    """Keep the configuration for ``pytest_runtest_logreport``."""
    global _config  # noqa: PLW0603 (the hook above is given no configuration)
    _config = session.config
