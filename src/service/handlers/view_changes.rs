//! Methods that create, change and delete views. Each change is checked by a plan of the affected frames and saved
//! before it is applied and acknowledged.

use tonic::Status;

use super::{
    scene_changes::paths,
    service::{MOST_ATTEMPTS, Service, changed_meanwhile, unchanged},
};
use crate::{
    plan::view_settings::FrameGroup,
    service::{
        frames::errors::refused,
        network::access::By,
        proto,
        scene::{excerpts::listed, state::SceneState, views::ViewSet},
        wire::{
            refusals,
            views::{ViewChange, spec_from_pb, view_change_from_pb},
        },
    },
    view::{Rig, View},
};

/// Maximum number of views after one is created. Every frame checks all views, and each view may need a separate frame.
const MOST_VIEWS: usize = 32;
/// Maximum number of pixels of all views after one is created or enlarged, equal to an image of 8192 x 8192. Accumulators, images and their copies
/// take up to 70 bytes per pixel, so all views together take less than 5 GB.
const MOST_PIXELS: u64 = 8192 * 8192;
/// Maximum length of a view's name that a client gives, characters.
const MOST_NAME: usize = 64;

/// Checks the limits after a change. The configuration may exceed them; a change that does not increase the excess is
/// accepted.
fn check_size(before: &ViewSet, after: &ViewSet) -> Result<(), Status> {
    let [count_before, count] = [before, after].map(|views| views.ids().len());
    if count > MOST_VIEWS && count > count_before {
        let problem = format!("there are {count_before} views: there must be at most {MOST_VIEWS}; delete one first");
        return Err(refusals::exhausted("views", problem));
    }
    let [pixels_before, pixels] = [before, after].map(ViewSet::pixels);
    if pixels > MOST_PIXELS && pixels > pixels_before {
        let problem = format!(
            "the images of all views would have {pixels} pixels together, but at most {MOST_PIXELS} are allowed (8192 x 8192): choose a smaller \
             size, or delete a view"
        );
        return Err(refusals::exhausted("pixels", problem));
    }
    Ok(())
}

/// Returns the frame groups of a scene that are new after a change.
fn new_groups(before: Vec<FrameGroup>, after: Vec<FrameGroup>) -> Vec<FrameGroup> {
    // Compare groups without the indices of views, which change when a view is deleted.
    let without_views = |group: &FrameGroup| FrameGroup { views: Vec::new(), ..group.clone() };
    let known: Vec<FrameGroup> = before.iter().map(without_views).collect();
    after.into_iter().filter(|group| !known.contains(&without_views(group))).collect()
}

impl Service {
    /// Changes the scene if it has the expected revision and can be drawn. `change` returns the scene after the change.
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

    /// Checks the size of each image against the adapter, before the total of all images is checked.
    fn check_view(&self, view: &View) -> Result<(), Status> {
        let alone = Rig::new(vec![view.clone()]).map_err(|error| refusals::invalid(error.to_string()))?;
        self.limits.check(&alone).map_err(|error| refusals::invalid(error.to_string()))
    }

    /// Creates a view.
    pub(crate) async fn created_view(&self, by: &By, request: proto::CreateViewRequest) -> Result<proto::View, Status> {
        let definition = request.definition.ok_or_else(|| refusals::invalid("definition: missing"))?;
        let (spec, view) = spec_from_pb(&definition).map_err(|error| refusals::invalid(error.to_string()))?;
        let name = spec.name.clone();
        if name.len() > MOST_NAME {
            let problem = format!("definition.name: {} characters: must have at most {MOST_NAME}", name.len());
            return Err(refusals::invalid(problem));
        }
        self.check_view(&view)?;
        let scene = self
            .changed_views(request.expected_revision, |scene| {
                if self.view_names(scene).contains(&&*name) {
                    let names = listed(self.view_names(scene));
                    return Err(refusals::present(
                        "view",
                        &name,
                        format!("view `{name}` exists already; the views are: {names}"),
                    ));
                }
                let views = scene.views.with(&self.render.general(scene), spec.clone(), view.clone());
                let views = views.map_err(refusals::invalid)?;
                scene.clone().with_views(views, Some((&name, spec.test_pattern))).map_err(|error| unchanged(&error))
            })
            .await?;
        by.changed("CreateView", std::slice::from_ref(&name), scene.revision);
        self.view(&name, &scene)
    }

    /// Changes a view.
    pub(crate) async fn updated_view(&self, by: &By, request: proto::UpdateViewRequest) -> Result<proto::View, Status> {
        let name = request.view.as_ref().map(|view| view.name.clone()).unwrap_or_default();
        if self.headset_named(&name).is_some() {
            let problem = "the headset uses the general settings of the configuration, which cannot be changed";
            return Err(refusals::invalid(format!("view `{name}`: {problem}")));
        }
        // Report an unknown view before an invalid change.
        let scene = self.render.scene().map_err(refused)?;
        scene.views.named(&name).ok_or_else(|| self.no_view(&name, &scene))?;
        let scene = self
            .changed_views(request.expected_revision, |scene| {
                let (_, index) = scene.views.named(&name).ok_or_else(|| self.no_view(&name, scene))?;
                let change = view_change_from_pb(&request, &scene.views.spec(index)).map_err(refusals::invalid)?;
                let general = self.render.general(scene);
                let (views, test_pattern) = match &change {
                    ViewChange::Update(update) => (scene.views.changed(&general, index, update), update.test_pattern),
                    ViewChange::Replace(spec) => (scene.views.replaced(&general, index, spec), Some(spec.test_pattern)),
                };
                let views = views.map_err(refusals::invalid)?;
                self.check_view(&views.rig().views()[index])?;
                scene
                    .clone()
                    .with_views(views, test_pattern.map(|shown| (&*name, shown)))
                    .map_err(|error| unchanged(&error))
            })
            .await?;
        let keys = paths(request.update_mask).into_iter().map(|path| format!("{name}.{path}"));
        by.changed("UpdateView", &keys.collect::<Vec<_>>(), scene.revision);
        self.view(&name, &scene)
    }

    /// Deletes a view; returns the new revision of the scene.
    pub(crate) async fn deleted_view(&self, by: &By, request: proto::DeleteViewRequest) -> Result<u64, Status> {
        let name = request.view;
        if self.headset_named(&name).is_some() {
            let problem = "the headset is not part of the rig; it exists while the daemon drives it";
            return Err(Status::failed_precondition(format!("view `{name}`: {problem}")));
        }
        let scene = self
            .changed_views(request.expected_revision, |scene| {
                let (_, index) = scene.views.named(&name).ok_or_else(|| self.no_view(&name, scene))?;
                let views = scene.views.without(&self.render.general(scene), index);
                let views = views.map_err(Status::failed_precondition)?;
                // A new view of this name starts without a test pattern.
                scene.clone().with_views(views, Some((&name, false))).map_err(|error| unchanged(&error))
            })
            .await?;
        by.changed("DeleteView", &[name], scene.revision);
        Ok(scene.revision)
    }
}
