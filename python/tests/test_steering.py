"""Steering and the lease of the camera."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from conftest import Daemon, until

import steradian


@pytest.fixture
def other(shared: Daemon) -> Iterator[steradian.Client]:
    """A second client."""
    with steradian.Client(shared.address) as made:
        yield made


def moved_to(client: steradian.Client, x_m: float) -> None:
    until(lambda: bool(client.camera().position_m[0] == x_m), f"the camera is at {x_m}")


def test_poses_arrive_and_the_last_one_counts(client: steradian.Client) -> None:
    before = client.camera().revision
    with client.steer(holder="desk 1") as steer:
        for step in range(500):
            steer(position_m=[step, 0, 0])
        steer(orientation=[0, 0, 1, 0])
    assert steer.camera is not None and steer.poses is not None
    np.testing.assert_array_equal(steer.camera.position_m, [499, 0, 0])
    np.testing.assert_array_equal(steer.camera.orientation, [0, 0, 1, 0])
    # Poses that newer ones replaced before they were sent are skipped.
    assert 1 <= steer.poses <= 501 and steer.camera.revision == before + steer.poses
    with pytest.raises(steradian.Cancelled):
        steer(position_m=[0, 0, 0])


def test_the_lease_holder_has_exclusive_control(client: steradian.Client, other: steradian.Client) -> None:
    with client.steer(holder="desk 1") as steer:
        steer(position_m=[1, 0, 0])
        moved_to(other, 1)
        with pytest.raises(steradian.LeaseHeld, match="`desk 1` holds the lease"):
            other.set_camera(position_m=[2, 0, 0])
        with pytest.raises(steradian.LeaseHeld, match="`desk 1` holds the lease"):
            with other.steer(holder="desk 2") as second:
                second(position_m=[2, 0, 0])
        with pytest.raises(steradian.LeaseHeld):
            with other.steer(lease=False) as second:
                second(position_m=[2, 0, 0])
    # The lease is released.
    assert other.set_camera(position_m=[3, 0, 0]).position_m[0] == 3


def test_a_snapshot_does_not_move_the_camera_of_another(client: steradian.Client, other: steradian.Client) -> None:
    client.save_snapshot("leased")
    with client.steer(holder="desk 1") as steer:
        steer(position_m=[6, 0, 0])
        moved_to(other, 6)
        with pytest.raises(steradian.FailedPrecondition, match="`desk 1` holds the lease"):
            other.load_snapshot("leased")


def test_a_lease_can_be_taken_over(client: steradian.Client, other: steradian.Client) -> None:
    def steer_on() -> None:
        while True:
            steer(position_m=[1, 0, 0])

    steer = client.steer(holder="desk 1")
    steer(position_m=[1, 0, 0])
    moved_to(other, 1)
    with other.steer(take_over=True, holder="desk 2") as second:
        second(position_m=[2, 0, 0])
        with pytest.raises(steradian.LeaseHeld, match="`desk 2` has taken over the lease"):
            steer_on()
        moved_to(client, 2)
    with pytest.raises(steradian.LeaseHeld):
        steer.close()
    with pytest.raises(ValueError, match="lease"):
        client.steer(take_over=True, lease=False)


def test_a_wrong_pose_ends_the_stream_and_leaves_the_camera(client: steradian.Client) -> None:
    camera = client.set_camera(position_m=[4, 0, 0])
    with pytest.raises(steradian.InvalidArgument, match="unit"):
        with client.steer() as steer:
            steer(orientation=[1, 1, 1, 1])
    assert client.camera().revision == camera.revision


def test_an_exception_inside_the_block_takes_precedence(client: steradian.Client) -> None:
    with pytest.raises(ZeroDivisionError):
        with client.steer() as steer:
            steer(position_m=[0, 0, 0])
            raise ZeroDivisionError
    # The lease is released, with some delay.
    until(lambda: _moves(client), "the lease is released")


def _moves(client: steradian.Client) -> bool:
    try:
        client.set_camera(position_m=[5, 0, 0])
    except steradian.LeaseHeld:
        return False
    return True
