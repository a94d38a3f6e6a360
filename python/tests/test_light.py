"""Pixels by physics: the light of a star, and its place."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from conftest import STAR_DEC_DEG, STAR_MAGNITUDE, STAR_RA_DEG

import steradian

# Illuminance of a star of magnitude 0, lx, as in docs/star-methods.md and crates/sky/src/units.rs.
MAGNITUDE_0_LX = 2.53848e-6
STAR_LX = MAGNITUDE_0_LX * 10 ** (-0.4 * STAR_MAGNITUDE)


def star_direction() -> npt.NDArray[np.float64]:
    ra, dec = np.radians(STAR_RA_DEG), np.radians(STAR_DEC_DEG)
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


def edges(image: steradian.ViewImage) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Returns the tangents of the edges of columns and rows of a flat image."""
    p = image.projection
    columns = np.linspace(p.left_tan, p.right_tan, image.width_px + 1)
    return columns, np.linspace(p.up_tan, p.down_tan, image.height_px + 1)


def solid_angles(image: steradian.ViewImage) -> npt.NDArray[np.float64]:
    """Returns the solid angles of the pixels of a flat image, sr: the integral of (1 + x^2 + y^2)^-1.5 over each."""
    x, y = edges(image)
    corner = np.arctan2(x * y[:, None], np.sqrt(1 + x**2 + y[:, None] ** 2))
    areas: npt.NDArray[np.float64] = np.abs(np.diff(np.diff(corner, axis=0), axis=1))
    return areas


def flat(client: steradian.Client) -> steradian.ViewImage:
    return client.view("flat").images[0]


def test_the_sum_of_a_stars_light_is_its_illuminance(client: steradian.Client) -> None:
    client.set_camera(orientation=steradian.looking_at(star_direction()))
    pixels = client.render("flat", "RGB32F").array()
    assert pixels.shape == (120, 160, 3) and pixels.dtype == np.float32
    light_lx = np.sum(steradian.luminance(pixels) * solid_angles(flat(client)))
    assert light_lx == pytest.approx(STAR_LX, rel=1e-4)
    # The comparison must fail with doubled solid angles.
    assert np.sum(steradian.luminance(pixels) * 2 * solid_angles(flat(client))) != pytest.approx(STAR_LX, rel=0.5)


@pytest.mark.parametrize("view", ["flat", "dome"])
def test_exr_images_have_the_light_and_its_solid_angles(client: steradian.Client, view: str) -> None:
    client.set_camera(orientation=steradian.looking_at(star_direction()))
    frame = client.render(view, "EXR")
    assert frame.image().illuminance_lx() == pytest.approx(STAR_LX, rel=1e-4)
    np.testing.assert_array_equal(frame.array(), client.render(view, "RGB32F").array())
    if view == "flat":
        np.testing.assert_allclose(frame.image().channels()["omega"], solid_angles(flat(client)), rtol=1e-5)


def test_a_star_appears_in_its_direction(client: steradian.Client) -> None:
    ahead = steradian.looking_at(star_direction())
    image = flat(client)
    for right_rad, up_rad in [(0.0, 0.0), (0.1, 0.0), (0.0, -0.13), (-0.2, 0.05)]:
        # Turn the camera to the other side.
        turn = steradian.multiply(steradian.quaternion([0, 1, 0], right_rad), steradian.quaternion([1, 0, 0], -up_rad))
        orientation = steradian.multiply(ahead, turn)
        client.set_camera(orientation=orientation)
        seen = steradian.rotate(steradian.conjugate(orientation), star_direction())
        light = steradian.luminance(client.render("flat", "RGB32F").array()) * solid_angles(image)
        x, y = edges(image)
        rows, columns = np.mgrid[0 : image.height_px, 0 : image.width_px] + 0.5
        expected = [(seen[0] / -seen[2] - x[0]) / (x[1] - x[0]), (seen[1] / -seen[2] - y[0]) / (y[1] - y[0])]
        found = [np.sum(light * columns) / np.sum(light), np.sum(light * rows) / np.sum(light)]
        np.testing.assert_allclose(found, expected, atol=0.01)
        assert (found[0] - 80) * right_rad >= 0 and (found[1] - 60) * up_rad <= 0


def test_display_images_show_the_star_and_dark_sky(client: steradian.Client) -> None:
    client.set_camera(orientation=steradian.looking_at(star_direction()))
    pixels = client.render("flat").array()
    assert pixels.shape == (120, 160, 4) and pixels.dtype == np.uint8
    assert pixels[55:65, 75:85, :3].max() > 50 and pixels[:30, :, :3].max() < 3
    assert np.all(pixels[..., 3] == 255)
    small = client.render("flat", max_size=80)
    assert small.array().shape == (60, 80, 4)


def test_stereo_frames_have_an_image_for_each_eye(client: steradian.Client) -> None:
    frame = client.render("eyes", "RGB32F")
    assert [image.part for image in frame.images] == ["left", "right"]
    assert frame.array("right").shape == (48, 64, 3)
    with pytest.raises(KeyError, match="left"):
        frame.array()


@pytest.mark.parametrize(
    "encoding, beginning", [("PNG", b"\x89PNG"), ("JPEG", b"\xff\xd8"), ("EXR", b"\x76\x2f\x31\x01")]
)
def test_encoded_files_are_unchanged(client: steradian.Client, encoding: str, beginning: bytes) -> None:
    assert client.render("flat", encoding).image().data.startswith(beginning)


def test_png_is_decoded_by_pillow_or_refused(client: steradian.Client) -> None:
    image = client.render("flat", "PNG").image()
    try:
        import PIL.Image  # noqa: F401
    except ImportError:
        with pytest.raises(ImportError, match="Pillow"):
            image.array()
    else:
        np.testing.assert_array_equal(image.array()[..., :3], client.render("flat").array()[..., :3])
