"""Directions, names and time."""

from __future__ import annotations

import datetime
import time

import numpy as np
import pytest
from conftest import STAR_DEC_DEG, STAR_RA_DEG, until

import steradian


def test_the_camera_looks_in_directions_and_at_names(client: steradian.Client) -> None:
    direction = np.deg2rad([STAR_RA_DEG, STAR_DEC_DEG])
    star = [np.cos(direction[1]) * np.cos(direction[0]), np.cos(direction[1]) * np.sin(direction[0]), np.sin(direction[1])]
    looked = client.look(longitude_deg=STAR_RA_DEG, latitude_deg=STAR_DEC_DEG, frame="icrs")
    np.testing.assert_allclose(steradian.rotate(looked.orientation, [0, 0, -1]), star, atol=1e-9)
    assert looked.frame == "icrs" and looked.azimuth_deg is None
    found = client.identify(star, radius_deg=1.0)
    assert [each.kind for each in found] == ["STAR"] and abs((found[0].v_mag or 0) - 2.0) < 0.01
    orion = client.find("orion")
    assert (orion.kind, orion.name, orion.v_mag) == ("CONSTELLATION", "Orion", None)
    camera = client.look("Orion", frame="galactic")
    np.testing.assert_allclose(steradian.rotate(camera.orientation, [0, 0, -1]), orion.direction, atol=1e-9)
    assert camera.frame == "galactic"
    with pytest.raises(steradian.NotFound, match="Pluto"):
        client.find("Pluto")
    with pytest.raises(steradian.InvalidArgument, match="no observer"):
        client.look(latitude_deg=10.0, frame="horizon")
    client.set_camera(frame="icrs")


def test_a_turn_is_about_the_axes_of_the_camera(client: steradian.Client) -> None:
    before = client.set_camera(orientation=[0, 0, 1, 0])
    turn = steradian.quaternion([0, 1, 0], 0.3)
    after = client.set_camera(turn=turn)
    np.testing.assert_allclose(after.orientation, steradian.multiply(before.orientation, turn), atol=1e-12)
    with pytest.raises(steradian.InvalidArgument, match="turn"):
        client.set_camera(turn=turn, orientation=[0, 0, 0, 1])


def test_poses_with_a_time_are_all_sent(client: steradian.Client) -> None:
    client.set_camera(position_m=[0, 0, 0])
    begin = datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(seconds=0.5)
    with client.steer() as steer:
        for step in range(20):
            steer(position_m=[step, 0, 0], time=begin + datetime.timedelta(milliseconds=20 * step))
        until(lambda: bool(client.camera().position_m[0] == 19), "the camera is at its last pose")
    assert steer.poses == 20
    with pytest.raises(steradian.InvalidArgument, match="later than"):
        with client.steer() as steer:
            for ahead_s in [2.0, 1.0]:
                later = datetime.datetime.now(datetime.timezone.utc) + datetime.timedelta(seconds=ahead_s)
                steer(position_m=[0, 0, 0], time=later)
    assert client.camera().position_m[0] == 19


def test_time_runs_at_a_rate(client: steradian.Client) -> None:
    begin = client.scene().time
    running = client.update_scene({"time_rate": 3600.0})
    assert running.time_rate == 3600.0
    time.sleep(0.1)
    rests = client.update_scene({"time_rate": 0.0, "time": client.scene().time})
    assert begin is not None and rests.time is not None and rests.time_rate == 0.0
    assert rests.time - begin > datetime.timedelta(minutes=5)
    client.update_scene({"time": begin})


def test_a_watch_waits_only_so_long(client: steradian.Client) -> None:
    with client.watch_camera() as cameras:
        first = cameras.next(timeout_s=60.0)
        with pytest.raises(TimeoutError, match="0.05 s"):
            cameras.next(timeout_s=0.05)
        client.set_camera(position_m=[7, 0, 0])
        assert cameras.next(timeout_s=60.0).revision == first.revision + 1
        cameras.close()
        with pytest.raises(StopIteration):
            while True:
                cameras.next(timeout_s=60.0)
