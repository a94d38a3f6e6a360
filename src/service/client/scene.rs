//! The client's calls about the scene and the failure tests.

use glam::DVec3;
use tonic::Streaming;

use super::connection::{Client, ClientError};
use crate::{
    scene::{asteroids::FieldSpec, overlay::Overlay},
    service::{
        proto,
        scene::{
            objects::{BodyForm, Change},
            observer::ObserverChange,
            state::{SceneCatalogue, SceneUpdate},
        },
        wire::{
            camera,
            objects::{body_from_pb, field_from_pb, time_from_j2000, time_from_pb},
            observer::observer_from_pb,
            overlay::overlay_from_pb,
            scene,
        },
    },
};

/// The scene of a daemon.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneForm {
    /// Number of changes.
    pub revision: u64,
    /// Catalogues of its stars.
    pub catalogues: Vec<SceneCatalogue>,
    /// Rendering method of stars, by name.
    pub star_method: String,
    /// Limiting magnitude.
    pub magnitude_limit: f64,
    /// Its bodies.
    pub bodies: Vec<BodyForm>,
    /// Asteroid fields.
    pub asteroid_fields: Vec<FieldSpec>,
    /// Scene time, s since 2000-01-01T12:00:00Z.
    pub time_s: f64,
    /// Seconds of scene time per second of real time.
    pub time_rate: f64,
    /// Impostor method for distant asteroids, by name.
    pub impostor: String,
    /// Factor of the distances at which detail of asteroids is reduced.
    pub quality: f64,
    /// Overlay of display images.
    pub overlay: Overlay,
    /// The complete observer, as a change that sets it; empty if the scene has no observer.
    pub observer: ObserverChange,
}

impl TryFrom<proto::Scene> for SceneForm {
    type Error = ClientError;

    fn try_from(scene: proto::Scene) -> Result<Self, ClientError> {
        let lacks = |field| ClientError::Answer { field };
        let stars = scene.stars.ok_or(lacks("stars"))?;
        let asteroids = scene.asteroids.ok_or(lacks("asteroids"))?;
        let bodies: Result<_, String> = scene.bodies.into_iter().map(body_from_pb).collect();
        let fields: Result<_, String> = scene.asteroid_fields.into_iter().map(field_from_pb).collect();
        let catalogue = |catalogue: proto::Catalogue| SceneCatalogue { name: catalogue.name, stars: catalogue.stars };
        Ok(Self {
            revision: scene.revision,
            catalogues: scene.catalogues.into_iter().map(catalogue).collect(),
            star_method: stars.method,
            magnitude_limit: stars.magnitude_limit,
            bodies: bodies.map_err(|_| lacks("bodies"))?,
            asteroid_fields: fields.map_err(|_| lacks("asteroid_fields"))?,
            time_s: time_from_j2000(scene.time_j2000_s)
                .or_else(|_| time_from_pb(scene.time))
                .map_err(|_| lacks("time"))?,
            time_rate: scene.time_rate,
            impostor: asteroids.impostor,
            quality: asteroids.quality,
            overlay: overlay_from_pb(scene.overlay.unwrap_or_default()).map_err(|_| lacks("overlay"))?,
            observer: scene.observer.as_ref().map(observer_from_pb).unwrap_or_default(),
        })
    }
}

/// Changes of the scene. Dropping it ends the stream.
#[derive(Debug)]
pub struct SceneReceiver {
    stream: Streaming<proto::Scene>,
}

impl SceneReceiver {
    /// Waits for the next change; the first one is the current scene. Returns `None` when the daemon has ended the stream without an error.
    pub async fn next(&mut self) -> Result<Option<SceneForm>, ClientError> {
        self.stream.message().await?.map(SceneForm::try_from).transpose()
    }
}

impl TryFrom<proto::IdentifiedObject> for SeenObject {
    type Error = ClientError;

    fn try_from(object: proto::IdentifiedObject) -> Result<Self, ClientError> {
        let direction = object.direction.ok_or(ClientError::Answer { field: "direction" })?;
        Ok(Self {
            kind: match object.kind() {
                proto::ObjectKind::Star => SeenKind::Star,
                proto::ObjectKind::Body => SeenKind::Body,
                proto::ObjectKind::Constellation => SeenKind::Constellation,
                proto::ObjectKind::Unspecified => return Err(ClientError::Answer { field: "kind" }),
            },
            direction: DVec3::from_array(camera::vector_from_pb(direction)),
            name: object.name,
            designation: object.designation,
            separation_deg: object.separation_deg,
            v_mag: object.v_mag,
            temperature_k: object.temperature_k,
            distance_m: object.distance_m,
            solid_angle_sr: object.solid_angle_sr,
        })
    }
}

/// Results of failure tests. Dropping it ends the run after the current check.
#[derive(Debug)]
pub struct CheckReceiver {
    stream: Streaming<proto::VerifyResult>,
}

impl CheckReceiver {
    /// Waits for the next result; `None` after the last.
    pub async fn next(&mut self) -> Result<Option<proto::VerifyResult>, ClientError> {
        Ok(self.stream.message().await?)
    }
}

impl Client {
    /// Returns the current scene.
    pub async fn scene(&mut self) -> Result<SceneForm, ClientError> {
        self.scene.get_scene(proto::GetSceneRequest {}).await?.into_inner().try_into()
    }

    /// Changes the scene if it still has the expected revision; returns the scene with its new revision.
    pub async fn update_scene(
        &mut self,
        update: &SceneUpdate,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let request = scene::scene_update_to_pb(update, expected_revision);
        self.scene.update_scene(request).await?.into_inner().try_into()
    }

    /// Adds or replaces a body.
    pub async fn put_body(
        &mut self,
        body: impl Into<BodyForm>,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let form: BodyForm = body.into();
        let bodies = Change::put(&form.body.name.clone(), form);
        self.update_scene(&SceneUpdate { bodies, ..SceneUpdate::default() }, expected_revision).await
    }

    /// Removes a body by name.
    pub async fn remove_body(&mut self, name: &str, expected_revision: Option<u64>) -> Result<SceneForm, ClientError> {
        let update = SceneUpdate { bodies: Change::remove(name), ..SceneUpdate::default() };
        self.update_scene(&update, expected_revision).await
    }

    /// Adds or replaces an asteroid field.
    pub async fn put_asteroid_field(
        &mut self,
        field: FieldSpec,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let asteroid_fields = Change::put(&field.name.clone(), field);
        self.update_scene(&SceneUpdate { asteroid_fields, ..SceneUpdate::default() }, expected_revision).await
    }

    /// Removes an asteroid field by name.
    pub async fn remove_asteroid_field(
        &mut self,
        name: &str,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let update = SceneUpdate { asteroid_fields: Change::remove(name), ..SceneUpdate::default() };
        self.update_scene(&update, expected_revision).await
    }

    /// Watches the scene.
    pub async fn watch_scene(&mut self) -> Result<SceneReceiver, ClientError> {
        Ok(SceneReceiver { stream: self.scene.watch_scene(proto::WatchSceneRequest {}).await?.into_inner() })
    }

    /// Runs failure tests on the daemon's adapter: those that match `filter` (empty: all), with `star_method` (empty:
    /// the current one).
    pub async fn verify(&mut self, filter: &str, star_method: &str) -> Result<CheckReceiver, ClientError> {
        let request = proto::VerifyRequest { filter: filter.to_owned(), star_method: star_method.to_owned() };
        Ok(CheckReceiver { stream: self.diagnostics.verify(request).await?.into_inner() })
    }

    /// Saves scene, settings of views and camera under a name.
    pub async fn save_snapshot(&mut self, name: &str) -> Result<(), ClientError> {
        self.scene.save_snapshot(proto::SaveSnapshotRequest { name: name.to_owned() }).await?;
        Ok(())
    }

    /// Loads a snapshot if the scene has the expected revision; returns the changed scene.
    pub async fn load_snapshot(
        &mut self,
        name: &str,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let request = proto::LoadSnapshotRequest { name: name.to_owned(), expected_revision };
        self.scene.load_snapshot(request).await?.into_inner().try_into()
    }

    /// Lists the names of the snapshots.
    pub async fn snapshots(&mut self) -> Result<Vec<String>, ClientError> {
        let answer = self.scene.list_snapshots(proto::ListSnapshotsRequest {}).await?.into_inner();
        Ok(answer.snapshots.into_iter().map(|snapshot| snapshot.name).collect())
    }
}

/// Kind of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeenKind {
    /// A star of the catalogues.
    Star,
    /// A body of the scene.
    Body,
    /// A constellation.
    Constellation,
}

/// An object in a direction.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenObject {
    /// Kind.
    pub kind: SeenKind,
    /// Name; empty if it has none.
    pub name: String,
    /// Bayer or Flamsteed designation of a star; empty if unknown.
    pub designation: String,
    /// Unit vector to its apparent place, ICRS axes.
    pub direction: DVec3,
    /// Angle from the requested direction, degrees.
    pub separation_deg: f64,
    /// Apparent V magnitude of a star.
    pub v_mag: Option<f64>,
    /// Effective temperature of a star, K.
    pub temperature_k: Option<f64>,
    /// Distance from the camera, m; `None` if unknown.
    pub distance_m: Option<f64>,
    /// Solid angle of a constellation, sr.
    pub solid_angle_sr: Option<f64>,
}

impl Client {
    /// Identifies the objects in an apparent direction (ICRS axes): bodies that cover it, nearest first, or stars within `radius_deg` of it,
    /// brightest first. Returns at most `most` objects.
    pub async fn identify(
        &mut self,
        direction: DVec3,
        radius_deg: f64,
        most: u32,
    ) -> Result<Vec<SeenObject>, ClientError> {
        let direction = Some(camera::vector_to_pb(direction));
        let request = proto::IdentifyRequest { direction, radius_deg, most };
        let objects = self.scene.identify(request).await?.into_inner().objects;
        objects.into_iter().map(SeenObject::try_from).collect()
    }

    /// Returns the name of the constellation that contains a direction (ICRS axes).
    pub async fn constellation(&mut self, direction: DVec3) -> Result<String, ClientError> {
        let request =
            proto::IdentifyRequest { direction: Some(camera::vector_to_pb(direction)), most: 1, ..Default::default() };
        Ok(self.scene.identify(request).await?.into_inner().constellation)
    }

    /// Returns the place of a body or a star by name.
    pub async fn find(&mut self, name: &str) -> Result<SeenObject, ClientError> {
        let request = proto::FindRequest { name: name.to_owned() };
        let found = self.scene.find(request).await?.into_inner().object;
        found.ok_or(ClientError::Answer { field: "object" })?.try_into()
    }
}
