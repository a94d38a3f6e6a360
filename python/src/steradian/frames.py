"""Frames of views, with their images as numpy arrays."""

from __future__ import annotations

import datetime
import io
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from . import _protocol, exr
from ._protocol import Message
from .camera import Camera

# Weights of the Rec. 709 primaries in the luminance.
_LUMINANCE_OF_RGB = np.array([0.2126, 0.7152, 0.0722])


def luminance(rgb: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Converts linear Rec. 709 colours, (..., 3), to luminances, (...), in the same unit: for HDR images cd/m^2."""
    colours: npt.NDArray[np.float64] = np.asarray(rgb, dtype=np.float64)
    together: npt.NDArray[np.float64] = colours @ _LUMINANCE_OF_RGB
    return together


@dataclass(frozen=True)
class Image:
    """One image of a frame.

    Attributes:
        part: empty for a view's only image, otherwise `left`, `right` or the name of the cube face.
        width_px: width, pixels.
        height_px: height, pixels.
        encoding: how `data` is encoded: `RGBA8`, `PNG`, `JPEG`, `RGB32F`, `EXR` ...
        data: the received bytes.
    """

    part: str
    width_px: int
    height_px: int
    encoding: str
    data: bytes = field(repr=False)

    def array(self) -> npt.NDArray[np.uint8] | npt.NDArray[np.float32]:
        """Returns the pixels, rows from the top.

        - `RGBA8`: (height, width, 4), uint8, sRGB codes and alpha; a view of `data`, not to be written to.
        - `RGB32F`: (height, width, 3), float32, luminance in cd/m^2, linear Rec. 709; a view of `data`.
        - `EXR`: the same, its channels R, G and B.
        - `PNG`, `JPEG`: (height, width, 4) or (height, width, 3), uint8, decoded by Pillow.

        Raises:
            ImportError: the encoding is `PNG` or `JPEG`, and Pillow is not installed.
            ValueError: the data is damaged, or the encoding cannot be an array.
        """
        if self.encoding == "RGBA8":
            return np.frombuffer(self.data, dtype=np.uint8).reshape(self.height_px, self.width_px, 4)
        if self.encoding in ("RGB32F", "EXR"):
            return self.rgb_cd_m2()
        if self.encoding in ("PNG", "JPEG"):
            return self._decoded()
        raise ValueError(f"{self.encoding} is not decoded here: `data` has the encoded bytes")

    def rgb_cd_m2(self) -> npt.NDArray[np.float32]:
        """Returns the luminance of the primaries of an `RGB32F` or `EXR` image, (height, width, 3), float32, cd/m^2,
        linear Rec. 709.

        Raises:
            ValueError: the image is a display image, or damaged.
        """
        if self.encoding == "RGB32F":
            return np.frombuffer(self.data, dtype="<f4").reshape(self.height_px, self.width_px, 3)
        channels = self.channels()
        return np.stack([channels[name] for name in "RGB"], axis=-1)

    def channels(self) -> dict[str, npt.NDArray[np.float32]]:
        """Returns the channels of an `EXR` image, each (height, width), float32: `R`, `G`, `B` in cd/m^2, and
        `omega`, the pixel's solid angle in sr, 0 outside of the picture.

        Raises:
            ValueError: it is of another encoding, or damaged.
        """
        if self.encoding != "EXR":
            raise ValueError(f"the image is {self.encoding}: EXR images have channels")
        return exr.channels(self.data)

    def illuminance_lx(self) -> float:
        """Returns the light in an `EXR` image: the sum of luminance times solid angle over its pixels, lx. For a single
        star or body, this is its illuminance at the camera, whatever the projection.

        Raises:
            ValueError: it is of another encoding, or damaged.
        """
        channels = self.channels()
        rgb = np.stack([channels[name] for name in "RGB"], axis=-1)
        return float(np.sum(luminance(rgb) * channels["omega"].astype(np.float64)))

    def _decoded(self) -> npt.NDArray[np.uint8]:
        try:
            import PIL.Image
        except ImportError as error:
            raise ImportError(f"decoding {self.encoding} needs Pillow (or request RGBA8): {error}") from error
        try:
            return np.asarray(PIL.Image.open(io.BytesIO(self.data)), dtype=np.uint8)
        except OSError as error:
            raise ValueError(f"the {self.encoding} image is damaged: {error}") from error


@dataclass(frozen=True)
class Frame:
    """A frame of one view. Frames of several views with the same number were rendered together; a headset has its own
    numbers.

    Attributes:
        view: name of the view.
        frame_number: number of the frame, counted over all views of the daemon's renderer.
        scene_revision: revision of the scene that the frame shows.
        camera_revision: revision of the camera that the frame shows.
        camera: camera of the frame; None only from daemons that do not send it.
        pose_time: time at which the daemon received that camera, by its clock, to microseconds.
        render_time: time at which the renderer finished the frame, by the same clock.
        exposure_ev100: exposure of display images, EV at ISO 100: display white is 1.2 * 2^ev cd/m^2.
        limiting_magnitude: limiting magnitude of stars in the display image; None if unknown.
        residual_codes: upper bound of the error of a pixel of the display image due to stars of a deep store that have
            not been read yet or do not fit into `stars.memory`, 8-bit codes; None: no stars of a deep store are drawn.
        quality_level: quality level of display images; 0 is as configured.
        given_up: descriptions of the reductions of quality.
        images: the images of the view.
        message: the received message with all fields of the protocol, but without the bytes of the images.
    """

    view: str
    frame_number: int
    scene_revision: int
    camera_revision: int
    camera: Camera | None
    pose_time: datetime.datetime
    render_time: datetime.datetime
    exposure_ev100: float
    limiting_magnitude: float | None
    residual_codes: float | None
    quality_level: int
    given_up: tuple[str, ...]
    images: tuple[Image, ...]
    message: Message = field(repr=False, compare=False)

    @classmethod
    def of(cls, message: Message) -> Frame:
        """Reads a frame from a message, and removes the image bytes from the message."""
        images = []
        for image in message.images:
            encoding = _protocol.enum_name("Encoding", image.encoding)
            images.append(Image(image.part, image.width, image.height, encoding, image.data))
            # Keep the bytes only once, because frames may be large.
            image.ClearField("data")
        has_limit = message.HasField("limiting_magnitude")
        return cls(
            view=message.view,
            frame_number=message.frame_number,
            scene_revision=message.scene_revision,
            camera_revision=message.camera_revision,
            camera=Camera.of(message.camera) if message.HasField("camera") else None,
            pose_time=_protocol.datetime_of(message.pose_time),
            render_time=_protocol.datetime_of(message.render_time),
            exposure_ev100=message.exposure_ev100,
            limiting_magnitude=message.limiting_magnitude if has_limit else None,
            residual_codes=message.residual_codes if message.HasField("residual_codes") else None,
            quality_level=message.quality_level,
            given_up=tuple(message.given_up),
            images=tuple(images),
            message=message,
        )

    def image(self, part: str = "") -> Image:
        """Returns the image of a part: empty for the only one, otherwise `left`, `right`, or a cube face.

        Raises:
            KeyError: the view has no such image; the message lists its images.
        """
        for image in self.images:
            if image.part == part:
                return image
        raise KeyError(f"{self.view} has no image `{part}`: it has {[image.part for image in self.images]}")

    def array(self, part: str = "") -> npt.NDArray[np.uint8] | npt.NDArray[np.float32]:
        """Returns the pixels of an image: see `Image.array`."""
        return self.image(part).array()
