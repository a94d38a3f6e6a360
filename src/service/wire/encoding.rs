//! Image encodings: conversion between protobuf and plain types.

use crate::{output::Encoding, service::proto};

pub(crate) fn encoding_to_pb(encoding: Encoding) -> proto::Encoding {
    match encoding {
        Encoding::Rgba8 => proto::Encoding::Rgba8,
        Encoding::Png => proto::Encoding::Png,
        Encoding::Jpeg => proto::Encoding::Jpeg,
        Encoding::H264 => proto::Encoding::H264,
        Encoding::Rgb32f => proto::Encoding::Rgb32f,
        Encoding::Exr => proto::Encoding::Exr,
    }
}

/// Returns the encoding of a protobuf number; `None` if it is unknown or unspecified.
pub(crate) fn encoding_from_pb(encoding: i32) -> Option<Encoding> {
    match proto::Encoding::try_from(encoding).ok()? {
        proto::Encoding::Unspecified => None,
        proto::Encoding::Rgba8 => Some(Encoding::Rgba8),
        proto::Encoding::Png => Some(Encoding::Png),
        proto::Encoding::Jpeg => Some(Encoding::Jpeg),
        proto::Encoding::H264 => Some(Encoding::H264),
        proto::Encoding::Rgb32f => Some(Encoding::Rgb32f),
        proto::Encoding::Exr => Some(Encoding::Exr),
    }
}
