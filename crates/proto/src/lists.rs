//! Serialisation of vectors and quaternions, which are messages on the wire, as the lists of numbers that configurations have.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::v1;

pub mod vector {
    use super::{Deserialize, Deserializer, Serialize, Serializer, v1};

    pub fn serialize<S: Serializer>(value: &Option<v1::Vector3>, to: S) -> Result<S::Ok, S::Error> {
        value.map(|v| [v.x, v.y, v.z]).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<v1::Vector3>, D::Error> {
        Ok(Option::<[f64; 3]>::deserialize(from)?.map(|[x, y, z]| v1::Vector3 { x, y, z }))
    }
}

pub mod quaternion {
    use super::{Deserialize, Deserializer, Serialize, Serializer, v1};

    pub fn serialize<S: Serializer>(value: &Option<v1::Quaternion>, to: S) -> Result<S::Ok, S::Error> {
        value.map(|q| [q.x, q.y, q.z, q.w]).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<v1::Quaternion>, D::Error> {
        Ok(Option::<[f64; 4]>::deserialize(from)?.map(|[x, y, z, w]| v1::Quaternion { x, y, z, w }))
    }
}
