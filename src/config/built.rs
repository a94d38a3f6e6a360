//! The rig with which a configuration was checked: the projectors of a dome take a second to read.

use std::sync::Arc;

use super::ViewSpec;
use crate::view::Rig;

/// Views, and the rig that was built from them, if it was.
#[derive(Clone, Debug, Default)]
pub(super) struct Built(Option<Arc<(Vec<ViewSpec>, Rig)>>);

impl PartialEq for Built {
    /// Always equal, because the rig follows from the configuration.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Built {
    pub(super) fn new(views: &[ViewSpec], rig: &Rig) -> Self {
        Self(Some(Arc::new((views.to_vec(), rig.clone()))))
    }

    /// Returns the rig of these views; `None` if it was not built, or if the views have changed since.
    pub(super) fn rig(&self, views: &[ViewSpec]) -> Option<Rig> {
        self.0.as_ref().filter(|built| built.0 == views).map(|built| built.1.clone())
    }
}
