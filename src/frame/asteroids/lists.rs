//! Lists that the CPU has made, in the form in which culling on the adapter leaves them; and what counts say.

use super::{AsteroidCounts, AsteroidPlan, FrameBuffers, held::Held};
use crate::{
    gpu::{
        Gpu,
        constants::asteroid_lists::{IMPOSTOR_VERTICES, SEAM_BIT},
        layout,
    },
    plan::{
        asteroids::cpu_cull::{PictureLists, WHOLE_PICTURE},
        cull::MAX_VIEWPORTS,
    },
};

impl AsteroidPlan {
    /// Uploads lists, their places, totals and arguments.
    pub(super) fn upload_lists(&self, gpu: &Gpu, held: &Held, buffers: &mut FrameBuffers, found: &[PictureLists]) {
        let kinds = self.kinds as usize;
        let mut entries: Vec<layout::AsteroidEntry> = Vec::with_capacity(self.capacity as usize);
        let mut totals = vec![0];
        let (mut bases, mut arguments) = (Vec::new(), Vec::new());
        let meshes = held.mesh_arguments();
        for plane in &self.planes {
            let of = &found[plane.viewport];
            let lists = &of.lists[plane.face.map_or(WHOLE_PICTURE, |face| face as usize)];
            for kind in 0..kinds {
                let list = lists.get(kind).map_or(&[][..], Vec::as_slice);
                bases.push(entries.len() as u32);
                let count = list.len() as u32;
                let seen = if plane.face.is_none() { of.seen as u32 } else { 0 };
                totals.push(if kind == kinds - 1 { seen } else { count });
                let [indices, first_index, first_vertex] =
                    meshes.get(kind).copied().unwrap_or([IMPOSTOR_VERTICES, 0, 0]);
                arguments.extend([indices, count, first_index, first_vertex, 0]);
                entries.extend(list.iter().map(|entry| layout::AsteroidEntry {
                    instance: entry.instance,
                    item: entry.item | if entry.beyond_seam { SEAM_BIT } else { 0 },
                    fade: entry.fade,
                }));
            }
        }
        totals[0] = entries.len() as u32;
        buffers.entries.upload(gpu, &entries);
        buffers.totals.upload(gpu, &totals);
        buffers.bases.upload(gpu, &bases);
        buffers.arguments.upload(gpu, &arguments);
    }

    /// What the totals of all lists say of each of `views` views.
    pub(super) fn counts_of(&self, held: &Held, totals: &[u32], points: &[u32], views: usize) -> Vec<AsteroidCounts> {
        let levels = held.kinds.sets.iter().flat_map(|set| &set.shapes.shapes).map(|shape| shape.lods.len()).max();
        let mut counts = vec![AsteroidCounts { meshes: vec![0; levels.unwrap_or(0)], ..Default::default() }; views];
        for (plane, totals) in self.planes.iter().zip(totals.chunks_exact(self.kinds as usize)) {
            let Some(counts) = counts.get_mut(self.viewports[plane.viewport].view) else { continue };
            for set in &held.kinds.sets {
                for (shape, first) in set.shapes.shapes.iter().zip(&set.shape_kinds) {
                    for level in 0..shape.lods.len() {
                        counts.meshes[level] += u64::from(totals[first + level]);
                    }
                }
            }
            let impostors = &totals[held.kinds.meshes..held.kinds.lists()];
            counts.impostors += impostors.iter().map(|count| u64::from(*count)).sum::<u64>();
            if plane.face.is_none() {
                let nodes = self.cut.unresolved.iter().filter(|point| point.point.viewports >> plane.viewport & 1 == 1);
                let unresolved: u64 = nodes.map(|node| node.asteroids).sum();
                let pointlike = u64::from(points[MAX_VIEWPORTS + plane.viewport]);
                counts.points += u64::from(points[plane.viewport]);
                counts.unresolved += unresolved;
                let seen = u64::from(totals[totals.len() - 1]) + unresolved + pointlike;
                counts.culled += self.asteroids.saturating_sub(seen);
            }
        }
        counts
    }
}
