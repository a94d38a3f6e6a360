//! Changes of the views of a scene: made, changed and deleted, each checked by a plan of the frames that become others, and on disk, before it is shown and
//! acknowledged.

use tonic::Status;

use super::{
    access::By,
    changes::paths,
    convert_views::{definition_from_pb, view_update_from_pb},
    handlers::{MOST_ATTEMPTS, Service, changed_meanwhile, refused, unchanged},
    proto, refusals,
    scene::SceneState,
    views::{GivenView, ViewSet, ViewUpdate},
};
use crate::{
    plan::view_settings::FrameGroup,
    view::{Rig, View},
};

/// Views that there may be when one is created. Every frame looks at all of them, and each may be a frame of its own.
const MOST_VIEWS: usize = 32;
/// Pixels that the images of all views may have when one is created or becomes larger: a picture of 8192 x 8192. Sums, images and their copies take up to 70
/// bytes of each, so that all views take less than 5 GB.
const MOST_PIXELS: u64 = 8192 * 8192;
/// Letters of a name that a client may give.
const MOST_NAME: usize = 64;

/// Whether there is room for views after a change. Those of the configuration may be more, and larger: what grows no further is not refused.
fn check_size(before: &ViewSet, after: &ViewSet) -> Result<(), Status> {
    let [count_before, count] = [before, after].map(|views| views.ids().len());
    if count > MOST_VIEWS && count > count_before {
        let problem = format!("there are {count_before} views: at most {MOST_VIEWS} are allowed; delete one first");
        return Err(refusals::exhausted("views", problem));
    }
    let [pixels_before, pixels] = [before, after].map(ViewSet::pixels);
    if pixels > MOST_PIXELS && pixels > pixels_before {
        let problem = format!(
            "the images of all views would have {pixels} pixels together: at most {MOST_PIXELS} are allowed (8192 x 8192); choose a smaller size, \
             or delete a view"
        );
        return Err(refusals::exhausted("pixels", problem));
    }
    Ok(())
}

/// Frames of a scene after a change that are not drawn before it.
fn new_groups(before: Vec<FrameGroup>, after: Vec<FrameGroup>) -> Vec<FrameGroup> {
    // The numbers of their views move when one is deleted.
    let of = |group: &FrameGroup| FrameGroup { views: Vec::new(), ..group.clone() };
    let known: Vec<FrameGroup> = before.iter().map(of).collect();
    after.into_iter().filter(|group| !known.contains(&of(group))).collect()
}

impl Service {
    /// Changes the scene where it has the revision expected, if it can be drawn then. `change` makes of a scene the one after the change.
    async fn changed_views(
        &self,
        expected: Option<u64>,
        change: impl Fn(&SceneState) -> Result<SceneState, Status>,
    ) -> Result<SceneState, Status> {
        for _ in 0..MOST_ATTEMPTS {
            let scene = self.scene_of(expected)?;
            let changed = change(&scene)?;
            check_size(&scene.views, &changed.views)?;
            let general = self.render.general(&scene);
            let groups = new_groups(scene.views.frame_groups(&general), changed.views.frame_groups(&general));
            self.plan(self.render.snapshot(&changed), groups).await?;
            if let Some(scene) = self.commit(changed, scene.revision, expected).await? {
                return Ok(scene);
            }
        }
        Err(changed_meanwhile())
    }

    /// Whether the adapter takes the images of a view: what is wrong with one of them is told before what all of them take together.
    fn check_view(&self, view: &View) -> Result<(), Status> {
        let alone = Rig::new(vec![view.clone()]).map_err(|error| refusals::invalid(error.to_string()))?;
        self.limits.check(&alone).map_err(|error| refusals::invalid(error.to_string()))
    }

    /// Makes a view.
    pub(super) async fn created_view(&self, by: &By, request: proto::CreateViewRequest) -> Result<proto::View, Status> {
        let definition = request.definition.ok_or_else(|| refusals::invalid("definition: it is missing"))?;
        let (given, pattern) = GivenView::read(definition_from_pb(&definition)).map_err(refusals::invalid)?;
        let name = given.view.name.clone();
        if name.len() > MOST_NAME {
            let problem = format!("definition.name: {} letters: allowed are at most {MOST_NAME}", name.len());
            return Err(refusals::invalid(problem));
        }
        self.check_view(&given.view)?;
        let scene = self
            .changed_views(request.expected_revision, |scene| {
                if self.view_names(scene).contains(&&*name) {
                    let names = self.view_names(scene).join(", ");
                    return Err(refusals::present(
                        "view",
                        &name,
                        format!("view `{name}` is there already; the views are: {names}"),
                    ));
                }
                let views = scene.views.with(&self.render.general(scene), given.clone()).map_err(refusals::invalid)?;
                scene.clone().with_views(views, Some((&name, pattern))).map_err(|error| unchanged(&error))
            })
            .await?;
        by.changed("CreateView", std::slice::from_ref(&name), scene.revision);
        self.view(&name, &scene)
    }

    /// Changes a view.
    pub(super) async fn updated_view(&self, by: &By, request: proto::UpdateViewRequest) -> Result<proto::View, Status> {
        let name = request.view.as_ref().map(|view| view.name.clone()).unwrap_or_default();
        if self.headset_named(&name).is_some() {
            let problem = "the headset has the general settings, those of the configuration";
            return Err(refusals::invalid(format!("view `{name}`: {problem}")));
        }
        // Whether there is such a view is told before what is wrong with the change.
        let scene = self.render.scene().map_err(refused)?;
        scene.views.named(&name).ok_or_else(|| self.no_view(&name, &scene))?;
        let update: ViewUpdate = view_update_from_pb(&request).map_err(refusals::invalid)?;
        let scene = self
            .changed_views(request.expected_revision, |scene| {
                let (_, index) = scene.views.named(&name).ok_or_else(|| self.no_view(&name, scene))?;
                let views = scene.views.changed(&self.render.general(scene), index, &update);
                let views = views.map_err(refusals::invalid)?;
                self.check_view(&views.rig().views()[index])?;
                let pattern = update.test_pattern.map(|shown| (&*name, shown));
                scene.clone().with_views(views, pattern).map_err(|error| unchanged(&error))
            })
            .await?;
        let keys = paths(request.update_mask).into_iter().map(|path| format!("{name}.{path}"));
        by.changed("UpdateView", &keys.collect::<Vec<_>>(), scene.revision);
        self.view(&name, &scene)
    }

    /// Deletes a view; the revision of the scene then.
    pub(super) async fn deleted_view(&self, by: &By, request: proto::DeleteViewRequest) -> Result<u64, Status> {
        let name = request.view;
        if self.headset_named(&name).is_some() {
            let problem = "the headset is no view of the rig: it is there as long as the daemon drives it";
            return Err(Status::failed_precondition(format!("view `{name}`: {problem}")));
        }
        let scene = self
            .changed_views(request.expected_revision, |scene| {
                let (_, index) = scene.views.named(&name).ok_or_else(|| self.no_view(&name, scene))?;
                let views = scene.views.without(&self.render.general(scene), index);
                let views = views.map_err(Status::failed_precondition)?;
                // Another view of this name begins without a test pattern.
                scene.clone().with_views(views, Some((&name, false))).map_err(|error| unchanged(&error))
            })
            .await?;
        by.changed("DeleteView", &[name], scene.revision);
        Ok(scene.revision)
    }
}
