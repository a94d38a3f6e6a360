"""Views of the rig, and their images."""

from __future__ import annotations

from dataclasses import dataclass, field

from . import _protocol
from ._protocol import Message
from .camera import Vector


@dataclass(frozen=True, eq=False)
class ViewImage:
    """One image of a view.

    Attributes:
        part: empty for a view's only image, otherwise `left`, `right` or the name of the cube face.
        width_px: width, pixels.
        height_px: height, pixels.
        orientation: (4,), float64: unit quaternion x, y, z, w from the axes of the image to camera axes; None
            for a headset.
        projection: message `Projection`: mapping of directions to its pixels; None for a headset.
    """

    part: str
    width_px: int
    height_px: int
    orientation: Vector | None
    projection: Message

    @classmethod
    def of(cls, message: Message) -> ViewImage:
        """Reads an image from a message."""
        return cls(
            part=message.part,
            width_px=message.width,
            height_px=message.height,
            orientation=_protocol.numbers_of(message.orientation) if message.HasField("orientation") else None,
            projection=message.projection if message.HasField("projection") else None,
        )


@dataclass(frozen=True, eq=False)
class View:
    """A view.

    Attributes:
        name: its name.
        type: type as in configurations: perspective, stereo, cubemap, fisheye, dome_master ... or headset.
        images: its images, in the order of those in frames; none for a headset that is not connected.
        revision: revision of the scene, which also counts the changes of views.
        message: the message `View`, with `definition`, `exposure`, `glare`, `tone_map`, `exposure_group`, `own_keys`.
    """

    name: str
    type: str
    images: tuple[ViewImage, ...]
    revision: int
    message: Message = field(repr=False)

    @classmethod
    def of(cls, message: Message) -> View:
        """Reads a view from a message."""
        return cls(
            name=message.name,
            type=message.type,
            images=tuple(ViewImage.of(image) for image in message.images),
            revision=message.revision,
            message=message,
        )
