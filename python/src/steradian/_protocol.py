"""The daemon's protocol: message classes and calls, created at run time from descriptors.

`steradian.binpb` is a serialised `FileDescriptorSet` of `proto/`. There is no generated code: one package serves all
versions of protobuf's runtime, and a new call or field needs only a new `steradian.binpb`. The descriptors have a
separate pool, so that modules that protoc has generated from the same files can coexist with this package.

`build` converts plain Python values to messages. A mapping of fields becomes any message, a sequence of numbers a
`Vector3`, `Quaternion`, `Rgb` or `Range`, a `datetime` with a time zone a `Timestamp`, and a name the value of an
enumeration.
"""

from __future__ import annotations

import datetime
import importlib.resources
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

# Message classes exist only at run time: a type checker does not know their fields.
Message = Any

PACKAGE = "steradian.v1"

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
# Messages that can be given as a sequence of numbers, with their fields.
_NUMBERS = {
    f"{PACKAGE}.Vector3": ("x", "y", "z"),
    f"{PACKAGE}.Quaternion": ("x", "y", "z", "w"),
    f"{PACKAGE}.Rgb": ("red", "green", "blue"),
    f"{PACKAGE}.Range": ("least", "most"),
}


@dataclass(frozen=True)
class Method:
    """A call of a service: its path, its messages, and whether each side streams."""

    path: str
    request: Message
    response: Message
    client_streams: bool
    server_streams: bool


def _class_maker(pool: Any) -> Callable[[Any], Any]:
    """Returns the function that creates a message class; its name changed in protobuf 4.22."""
    if hasattr(message_factory, "GetMessageClass"):
        return lambda descriptor: message_factory.GetMessageClass(descriptor)
    factory = message_factory.MessageFactory(pool)
    return lambda descriptor: factory.GetPrototype(descriptor)


class _Protocol:
    """Content of `steradian.binpb`."""

    def __init__(self, serialised: bytes) -> None:
        files = descriptor_pb2.FileDescriptorSet.FromString(serialised)
        self.pool: Any = descriptor_pool.DescriptorPool()
        # A file follows those that it imports.
        for file in files.file:
            self.pool.AddSerializedFile(file.SerializeToString())
        self._class_of = _class_maker(self.pool)
        self.methods: dict[str, dict[str, Method]] = {}
        for file in files.file:
            for service in file.service:
                calls = {method.name: self._method(file.package, service.name, method) for method in service.method}
                self.methods[service.name] = calls

    def _method(self, package: str, service: str, method: Any) -> Method:
        # Type names in descriptors are absolute, with a leading dot.
        return Method(
            path=f"/{package}.{service}/{method.name}",
            request=self.message_class(method.input_type[1:]),
            response=self.message_class(method.output_type[1:]),
            client_streams=method.client_streaming,
            server_streams=method.server_streaming,
        )

    def message_class(self, full_name: str) -> Message:
        return self._class_of(self.pool.FindMessageTypeByName(full_name))


_PROTOCOL = _Protocol((importlib.resources.files(__package__ or "steradian") / "steradian.binpb").read_bytes())


def services() -> dict[str, list[str]]:
    """Returns the names of the services, each with the names of its calls."""
    return {service: list(calls) for service, calls in _PROTOCOL.methods.items()}


def method(service: str, name: str) -> Method:
    """Returns a call by service and name, such as `ViewService` and `GetView`.

    Raises:
        ValueError: the service or call does not exist; the message lists the known ones.
    """
    calls = _PROTOCOL.methods.get(service.removeprefix(f"{PACKAGE}."))
    if calls is None:
        raise ValueError(f"no service `{service}`: must be one of {', '.join(_PROTOCOL.methods)}")
    if name not in calls:
        raise ValueError(f"{service} has no call `{name}`: it has {', '.join(calls)}")
    return calls[name]


def message(name: str, /, **fields: object) -> Message:
    """Creates a message by name, such as `Body`, with these fields (see the head of this module).

    Raises:
        ValueError: the message does not exist.
        TypeError: it has no such field, or a value does not fit one.
    """
    try:
        cls = _PROTOCOL.message_class(name if "." in name else f"{PACKAGE}.{name}")
    except KeyError:
        raise ValueError(f"the protocol has no message `{name}`") from None
    return build(cls, fields)


def build(cls: Message, fields: Mapping[str, object]) -> Message:
    """Creates a message of a class with these fields; None leaves a field absent."""
    made = cls()
    merge(made, fields)
    return made


def enum_value(name: str, value: str) -> int:
    """Returns the number of an enumeration value, such as `JPEG` of `Encoding`.

    Raises:
        ValueError: the value does not exist; the message lists the known ones.
    """
    return _enum_number(_PROTOCOL.pool.FindEnumTypeByName(f"{PACKAGE}.{name}"), value)


def enum_name(name: str, number: int) -> str:
    """Returns the name of an enumeration value, or its number if only newer daemons know it."""
    values = _PROTOCOL.pool.FindEnumTypeByName(f"{PACKAGE}.{name}").values_by_number
    return str(values[number].name) if number in values else str(number)


def _enum_number(descriptor: Any, value: str) -> int:
    known = descriptor.values_by_name
    if value not in known:
        raise ValueError(f"{descriptor.name} has no `{value}`: it has {', '.join(known)}")
    return int(known[value].number)


def _is_repeated(field: Any) -> bool:
    # `label` is deprecated in versions that have `is_repeated`.
    if hasattr(field, "is_repeated"):
        return bool(field.is_repeated)
    return bool(field.label == field.LABEL_REPEATED)


def set_field(target: Message, name: str, value: object) -> None:
    """Sets a field of a message.

    Raises:
        TypeError: the field does not exist, or the value does not fit it.
    """
    field = target.DESCRIPTOR.fields_by_name.get(name)
    if field is None:
        fields = ", ".join(target.DESCRIPTOR.fields_by_name)
        raise TypeError(f"{target.DESCRIPTOR.name} has no field `{name}`: it has {fields}")
    if _is_repeated(field):
        _set_repeated(target, field, value)
    elif field.message_type is not None:
        part = getattr(target, name)
        # A present message without fields differs from an absent one.
        part.SetInParent()
        merge(part, value)
    else:
        setattr(target, name, _scalar(field, value))


def put(target: Message, path: str, value: object) -> None:
    """Sets the target of a path: a field, a field of a field, or the list member of this name.

    Raises:
        TypeError: the field does not exist, or the value does not fit it.
        ValueError: the value has the right type, but is invalid.
    """
    head, _, rest = path.partition(".")
    descriptor = target.DESCRIPTOR.fields_by_name.get(head)
    if not rest or descriptor is None or descriptor.message_type is None:
        # If the field does not exist, pass the rest of the path, so that the error names it.
        set_field(target, path, value)
        return
    part = getattr(target, head)
    if not hasattr(part, "add"):
        put(part, rest, value)
        return
    member = part.add()
    merge(member, value)
    if member.name not in ("", rest):
        raise ValueError(f"{path} cannot have the name `{member.name}`")
    member.name = rest


def _set_repeated(target: Message, field: Any, values: object) -> None:
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        raise TypeError(f"{target.DESCRIPTOR.name}.{field.name} needs a sequence, not {values!r}")
    target.ClearField(field.name)
    items = getattr(target, field.name)
    for value in values:
        if field.message_type is not None:
            merge(items.add(), value)
        else:
            items.append(_scalar(field, value))


def _scalar(field: Any, value: object) -> object:
    if isinstance(value, str) and field.enum_type is not None:
        return _enum_number(field.enum_type, value)
    # Convert numpy numbers for protobuf.
    return value.item() if isinstance(value, np.generic) else value


def _is_message(value: object, full_name: str) -> bool:
    return getattr(getattr(value, "DESCRIPTOR", None), "full_name", None) == full_name


def merge(target: Message, value: object) -> None:
    """Assigns a value to a message: a message of the same type, a mapping of fields, or a short form (see the head
    of this module).

    Raises:
        TypeError: the value does not fit this message.
        ValueError: it has the right type, but is invalid.
    """
    kind = target.DESCRIPTOR.full_name
    if _is_message(value, kind):
        other: Message = value
        # The message may come from another descriptor pool.
        target.MergeFromString(other.SerializeToString())
    elif isinstance(value, Mapping):
        for name, part in value.items():
            if part is not None:
                set_field(target, name, part)
    elif kind in _NUMBERS:
        _set_numbers(target, _NUMBERS[kind], value)
    elif kind == "google.protobuf.Timestamp" and isinstance(value, datetime.datetime):
        target.seconds, target.nanos = _since_epoch(value)
    elif kind == "google.protobuf.FieldMask" and isinstance(value, Iterable) and not isinstance(value, (str, bytes)):
        target.paths.extend(value)
    else:
        raise TypeError(f"{value!r} cannot be converted to {target.DESCRIPTOR.name}")


def _set_numbers(target: Message, names: tuple[str, ...], value: object) -> None:
    numbers = np.asarray(value, dtype=np.float64)
    # A single number means a grey colour.
    if numbers.ndim == 0 and target.DESCRIPTOR.name == "Rgb":
        numbers = np.full(3, numbers)
    if numbers.shape != (len(names),):
        raise ValueError(f"{target.DESCRIPTOR.name} has {len(names)} numbers ({', '.join(names)}), not {value!r}")
    for name, number in zip(names, numbers.tolist()):
        setattr(target, name, number)


def _since_epoch(time: datetime.datetime) -> tuple[int, int]:
    """Returns seconds and nanoseconds since 1970."""
    if time.tzinfo is None:
        raise ValueError(f"{time!r} has no time zone: use datetime(..., tzinfo=timezone.utc)")
    since = time - _EPOCH
    return since.days * 86_400 + since.seconds, since.microseconds * 1000


def datetime_of(timestamp: Message) -> datetime.datetime:
    """Converts a `Timestamp` to a time in UTC, rounded down to microseconds."""
    return _EPOCH + datetime.timedelta(seconds=timestamp.seconds, microseconds=timestamp.nanos // 1000)


def numbers_of(part: Message) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Returns the numbers of a `Vector3`, `Quaternion`, `Rgb` or `Range`, float64."""
    names = _NUMBERS[part.DESCRIPTOR.full_name]
    return np.array([getattr(part, name) for name in names], dtype=np.float64)
