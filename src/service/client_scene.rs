//! The client's calls about the scene and the failure tests.

use glam::DVec3;
use tonic::Streaming;

use super::{
    client::{Client, ClientError},
    convert,
    convert_objects::{body_from_pb, field_from_pb, time_from_pb},
    convert_observer::observer_from_pb,
    convert_overlay::overlay_from_pb,
    objects::{BodyForm, Change, FieldForm},
    observer::ObserverChange,
    proto,
    scene::SceneUpdate,
    server::SceneCatalogue,
};
use crate::{scene::overlay::Overlay, verify::Outcome};

/// The scene of a daemon.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneForm {
    /// Counts its changes.
    pub revision: u64,
    /// Where its stars come from.
    pub catalogues: Vec<SceneCatalogue>,
    /// How stars are drawn, by name.
    pub star_method: String,
    /// Faintest magnitude that is drawn.
    pub magnitude_limit: f64,
    /// Its bodies.
    pub bodies: Vec<BodyForm>,
    /// Its fields of asteroids.
    pub asteroid_fields: Vec<FieldForm>,
    /// The moment that is shown, s since 2000-01-01T12:00:00Z.
    pub time_s: f64,
    /// Seconds of the scene for each second that goes by.
    pub time_rate: f64,
    /// What stands in for far asteroids, by name.
    pub impostor: String,
    /// Factor on the distances at which detail of asteroids is left out.
    pub quality: f64,
    /// What is drawn over display images.
    pub overlay: Overlay,
    /// From where it is seen, whole, as a change that makes it so; nothing where it has no observer.
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
            time_s: time_from_pb(scene.time).map_err(|_| lacks("time"))?,
            time_rate: scene.time_rate,
            impostor: asteroids.impostor,
            quality: asteroids.quality,
            overlay: overlay_from_pb(scene.overlay.unwrap_or_default()).map_err(|_| lacks("overlay"))?,
            observer: scene.observer.as_ref().map(observer_from_pb).unwrap_or_default(),
        })
    }
}

/// The scene and its changes. Dropping it ends the stream.
#[derive(Debug)]
pub struct SceneReceiver {
    stream: Streaming<proto::Scene>,
}

impl SceneReceiver {
    /// Waits for the next change, at first for the scene as it is; `None` when the daemon has ended the stream in good order.
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
            direction: DVec3::from_array(convert::vector_from_pb(direction)),
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

/// A figure of a check.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedFigure {
    /// What was measured.
    pub what: String,
    /// The number.
    pub measured: f64,
    /// The greatest allowed; `None` if the figure only informs.
    pub limit: Option<f64>,
    /// Unit of both.
    pub unit: String,
    /// Whether the limit is kept.
    pub pass: bool,
}

/// The result of a check.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedCheck {
    /// Number in the list of places where methods fail.
    pub number: Option<u32>,
    /// Its name.
    pub name: String,
    /// The group that it belongs to.
    pub group: String,
    /// How it has ended.
    pub outcome: Outcome,
    /// What was measured.
    pub figures: Vec<ReceivedFigure>,
    /// Why there are no figures.
    pub message: Option<String>,
    /// Time that it took, s.
    pub seconds: f64,
}

impl TryFrom<proto::VerifyResult> for ReceivedCheck {
    type Error = ClientError;

    fn try_from(result: proto::VerifyResult) -> Result<Self, ClientError> {
        use proto::verify_result::Outcome as Wire;
        let outcome = match Wire::try_from(result.outcome) {
            Ok(Wire::Pass) => Outcome::Pass,
            Ok(Wire::Fail) => Outcome::Fail,
            Ok(Wire::NotApplicable) => Outcome::NotApplicable,
            Ok(Wire::Unspecified) | Err(_) => return Err(ClientError::Answer { field: "outcome" }),
        };
        let figure = |figure: proto::VerifyFigure| ReceivedFigure {
            what: figure.what,
            measured: figure.measured,
            limit: figure.limit,
            unit: figure.unit,
            pass: figure.pass,
        };
        Ok(Self {
            number: result.number,
            name: result.name,
            group: result.group,
            outcome,
            figures: result.figures.into_iter().map(figure).collect(),
            message: Some(result.message).filter(|message| !message.is_empty()),
            seconds: result.seconds,
        })
    }
}

/// Results of failure tests as they come. Dropping it ends the run after the check in the works.
#[derive(Debug)]
pub struct CheckReceiver {
    stream: Streaming<proto::VerifyResult>,
}

impl CheckReceiver {
    /// Waits for the next result; `None` after the last.
    pub async fn next(&mut self) -> Result<Option<ReceivedCheck>, ClientError> {
        self.stream.message().await?.map(ReceivedCheck::try_from).transpose()
    }
}

impl Client {
    /// The scene now.
    pub async fn scene(&mut self) -> Result<SceneForm, ClientError> {
        self.scene.get_scene(proto::GetSceneRequest {}).await?.into_inner().try_into()
    }

    /// Changes the scene, if it still has the revision expected; returns it with its new one.
    pub async fn update_scene(
        &mut self,
        update: &SceneUpdate,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let request = convert::scene_update_to_pb(update, expected_revision);
        self.scene.update_scene(request).await?.into_inner().try_into()
    }

    /// Adds a body, or changes the one of its name.
    pub async fn put_body(
        &mut self,
        body: impl Into<BodyForm>,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let form: BodyForm = body.into();
        let bodies = Change::put(&form.body.name.clone(), form);
        self.update_scene(&SceneUpdate { bodies, ..SceneUpdate::default() }, expected_revision).await
    }

    /// Removes the body of a name.
    pub async fn remove_body(&mut self, name: &str, expected_revision: Option<u64>) -> Result<SceneForm, ClientError> {
        let update = SceneUpdate { bodies: Change::remove(name), ..SceneUpdate::default() };
        self.update_scene(&update, expected_revision).await
    }

    /// Adds a field of asteroids, or changes the one of its name.
    pub async fn put_asteroid_field(
        &mut self,
        field: FieldForm,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let asteroid_fields = Change::put(&field.name.clone(), field);
        self.update_scene(&SceneUpdate { asteroid_fields, ..SceneUpdate::default() }, expected_revision).await
    }

    /// Removes the field of asteroids of a name.
    pub async fn remove_asteroid_field(
        &mut self,
        name: &str,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let update = SceneUpdate { asteroid_fields: Change::remove(name), ..SceneUpdate::default() };
        self.update_scene(&update, expected_revision).await
    }

    /// The scene and its changes.
    pub async fn watch_scene(&mut self) -> Result<SceneReceiver, ClientError> {
        Ok(SceneReceiver { stream: self.scene.watch_scene(proto::WatchSceneRequest {}).await?.into_inner() })
    }

    /// Runs failure tests on the daemon's adapter: those that `filter` names (empty: all), for `star_method` (empty: the one in
    /// use).
    pub async fn verify(&mut self, filter: &str, star_method: &str) -> Result<CheckReceiver, ClientError> {
        let request = proto::VerifyRequest { filter: filter.to_owned(), star_method: star_method.to_owned() };
        Ok(CheckReceiver { stream: self.diagnostics.verify(request).await?.into_inner() })
    }

    /// Saves scene, settings of views and camera under a name.
    pub async fn save_snapshot(&mut self, name: &str) -> Result<(), ClientError> {
        self.scene.save_snapshot(proto::SaveSnapshotRequest { name: name.to_owned() }).await?;
        Ok(())
    }

    /// Puts a snapshot in place of what is shown, if the scene has the revision expected; returns the scene after the change.
    pub async fn load_snapshot(
        &mut self,
        name: &str,
        expected_revision: Option<u64>,
    ) -> Result<SceneForm, ClientError> {
        let request = proto::LoadSnapshotRequest { name: name.to_owned(), expected_revision };
        self.scene.load_snapshot(request).await?.into_inner().try_into()
    }

    /// Names of the snapshots.
    pub async fn snapshots(&mut self) -> Result<Vec<String>, ClientError> {
        let answer = self.scene.list_snapshots(proto::ListSnapshotsRequest {}).await?.into_inner();
        Ok(answer.snapshots.into_iter().map(|snapshot| snapshot.name).collect())
    }
}

/// What an object is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeenKind {
    /// A star of the catalogues.
    Star,
    /// A body of the scene.
    Body,
    /// A constellation.
    Constellation,
}

/// What stands in a direction.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenObject {
    /// What it is.
    pub kind: SeenKind,
    /// Its name; empty: it has none.
    pub name: String,
    /// Bayer or Flamsteed designation of a star; empty: not known.
    pub designation: String,
    /// Unit vector to where it is seen, ICRS axes.
    pub direction: DVec3,
    /// From the direction that was asked for, degrees.
    pub separation_deg: f64,
    /// Apparent V magnitude of a star.
    pub v_mag: Option<f64>,
    /// Effective temperature of a star, K.
    pub temperature_k: Option<f64>,
    /// From the camera, m; `None`: not known.
    pub distance_m: Option<f64>,
    /// How much of the sky lies within the borders of a constellation, sr.
    pub solid_angle_sr: Option<f64>,
}

impl Client {
    /// What stands in a direction (ICRS axes, as the camera sees it): bodies that cover it, the nearest first, or stars within `radius_deg` of it, the brightest
    /// first; at most `most`.
    pub async fn identify(
        &mut self,
        direction: DVec3,
        radius_deg: f64,
        most: u32,
    ) -> Result<Vec<SeenObject>, ClientError> {
        let direction = Some(convert::vector_to_pb(direction));
        let request = proto::IdentifyRequest { direction, radius_deg, most };
        let objects = self.scene.identify(request).await?.into_inner().objects;
        objects.into_iter().map(SeenObject::try_from).collect()
    }

    /// Name of the constellation that a direction (ICRS axes) lies in.
    pub async fn constellation(&mut self, direction: DVec3) -> Result<String, ClientError> {
        let request =
            proto::IdentifyRequest { direction: Some(convert::vector_to_pb(direction)), most: 1, ..Default::default() };
        Ok(self.scene.identify(request).await?.into_inner().constellation)
    }

    /// Where a body or a star of a name is.
    pub async fn find(&mut self, name: &str) -> Result<SeenObject, ClientError> {
        let request = proto::FindRequest { name: name.to_owned() };
        let found = self.scene.find(request).await?.into_inner().object;
        found.ok_or(ClientError::Answer { field: "object" })?.try_into()
    }
}
