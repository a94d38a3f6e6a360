//! Results that take long to compute and that several techniques use. They are kept from plan to plan; this does not change any plan.

use std::sync::{Arc, Weak};

use glam::DVec3;

use super::{PlanError, bodies::seen::HeldLights, exposure::pictures::Pictures, settings::GlareSettings};
use crate::{
    photometry::glare::GlareKernel,
    scene::{SceneObjects, SceneSnapshot},
};

/// Cached results, shared by the techniques.
#[derive(Default)]
pub(super) struct Kept {
    /// Pictures of the viewports of the last plan.
    pub pictures: Pictures,
    /// Light of the bodies for the eyes of the last plans.
    pub lights: HeldLights,
    /// Glare kernel, with the settings that determine it.
    kernel: Option<(GlareSettings, Arc<dyn GlareKernel>)>,
    /// Objects seen through air: objects of the scene, position of the camera, and result.
    seen: Option<(Weak<SceneObjects>, DVec3, Arc<SceneObjects>)>,
}

impl Kept {
    /// The glare kernel that was computed last.
    pub fn kernel(&self) -> Option<&Arc<dyn GlareKernel>> {
        self.kernel.as_ref().map(|(_, kernel)| kernel)
    }

    /// Computes the glare kernel of the settings, unless the kept kernel has the same settings.
    pub fn hold_kernel(&mut self, settings: &GlareSettings) -> Result<(), PlanError> {
        // Ignore settings that the kernel does not depend on.
        let GlareSettings { method, fraction, absolute, weights, .. } = GlareSettings::default();
        let kernel_settings = GlareSettings { method, fraction, absolute, weights, ..settings.clone() };
        if self.kernel.as_ref().is_none_or(|(held, _)| *held != kernel_settings) {
            self.kernel = Some((kernel_settings, settings.kernel()?));
        }
        Ok(())
    }

    /// The objects of a scene as its camera sees them: with air around the camera, the last result if the objects and the position are
    /// the same.
    pub fn objects_seen(&mut self, scene: &SceneSnapshot) -> Arc<SceneObjects> {
        let (objects, camera_m) = (&scene.objects, scene.camera.position_m);
        if let Some((before, position_m, seen)) = &self.seen
            && before.upgrade().is_some_and(|before| Arc::ptr_eq(&before, objects))
            && *position_m == camera_m
        {
            return Arc::clone(seen);
        }
        let seen = objects.seen_from(camera_m);
        self.seen = seen.local_sky.is_some().then(|| (Arc::downgrade(objects), camera_m, Arc::clone(&seen)));
        seen
    }
}
