"""Tests the package's page: its programs and the commands of its examples must run unchanged, one after the other, on
the daemon that the page starts."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import Daemon

REPOSITORY = Path(__file__).parents[2]
PAGE = REPOSITORY / "docs/python.md"
ADDRESS = "127.0.0.1:7143"
# Options that shorten an example.
SHORT = {
    "light_curve.py": ["--steps", "4"],
    "frame_ages.py": ["--periods", "0.1", "--frames", "2", "--seconds", "0.3"],
}


def blocks(kind: str, text: str) -> list[str]:
    """Returns the fenced blocks of a language."""
    parts = text.split(f"```{kind}\n")[1:]
    return [part.split("```")[0] for part in parts]


@pytest.fixture(scope="module")
def documented(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Starts the daemon that the page describes, on a free port."""
    configuration = (REPOSITORY / "configs/mission-control.toml").read_text()
    daemon = Daemon(tmp_path_factory.mktemp("documented"), configuration)
    yield daemon
    daemon.kill()


def test_the_programs_run(documented: Daemon, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {}
    programs = blocks("python", PAGE.read_text())
    assert len(programs) >= 6
    for program in programs:
        exec(compile(program.replace(ADDRESS, documented.address), PAGE, "exec"), names)
    said = capsys.readouterr().out
    assert "lx come from the stars" in said and "('two-colours', 'PASS')" in said
    client: Any = names["client"]
    client.close()


def test_the_examples_run(documented: Daemon, tmp_path: Path) -> None:
    commands = [line for block in blocks("sh", PAGE.read_text()) for line in block.splitlines() if "python3 " in line]
    assert len(commands) == len(SHORT) == len(list((REPOSITORY / "python/examples").glob("*.py")))
    for command in commands:
        setting, python, script, *arguments = shlex.split(command.replace(ADDRESS, documented.address))
        assert (setting, python) == ("PYTHONPATH=python/src", "python3")
        run = [sys.executable, str(REPOSITORY / script), *arguments, *SHORT[Path(script).name]]
        environment = os.environ | {"PYTHONPATH": str(REPOSITORY / "python/src")}
        done = subprocess.run(run, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, f"{command}: {done.stderr}"
    assert (tmp_path / "light_curve.csv").is_file()
