"""Tests the example that measures ages and rates: it must print its tables and restore the camera. No times are
asserted."""

from __future__ import annotations

import frame_ages
import numpy as np
import pytest
from conftest import Daemon

import steradian


def test_the_tables_are_printed_and_the_camera_is_restored(
    client: steradian.Client, shared: Daemon, capsys: pytest.CaptureFixture[str]
) -> None:
    before = client.camera()
    arguments = ["--connect", shared.address, "--view", "flat", "--periods", "0.01", "0.02", "--frames", "3"]
    frame_ages.main([*arguments, "--rates", "JPEG", "RGB32F", "--seconds", "0.2"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == "| reader, JPEG | 0.01 s | 0.02 s |"
    rows = [line.split(" | ")[0] for line in lines if line.startswith("| ")]
    wanted = ["`client.frames`", "`NextFrame`, one call at a time", "`client.frames`", "JPEG", "RGB32F"]
    assert rows[1:] == [f"| {row}" for row in wanted]
    np.testing.assert_array_equal(client.camera().orientation, before.orientation)
    with pytest.raises(steradian.NotFound):
        frame_ages.main(["--connect", shared.address, "--view", "none"])
    np.testing.assert_array_equal(client.camera().orientation, before.orientation)
