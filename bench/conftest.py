"""Tell what was counted a second below the table of times."""

from __future__ import annotations

import pytest


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print what benchmarks noted besides their times."""
    session = getattr(config, "_benchmarksession", None)
    counted = [bench for bench in getattr(session, "benchmarks", ()) if bench.extra_info]
    if counted:
        terminalreporter.section("a second")
    for bench in counted:
        rates = ", ".join(f"{value:,} {name.split('_per_')[0]}" for name, value in bench.extra_info.items())
        terminalreporter.write_line(f"{bench.name:40s} {rates}")
