//! Uploads CPU-made lists in the layout that culling on the adapter writes, and evaluates counts.
//!
//! No twin: plan/asteroids/cpu_cull.rs.

use super::{AsteroidCounts, FrameBuffers, held::Held};
use crate::render::constants::asteroid_lists::{IMPOSTOR_VERTICES, SEAM_BIT};
use crate::{
    gpu::{Gpu, dispatch_rows},
    plan::{
        asteroids::{
            AsteroidPlan,
            cpu_cull::{PictureLists, WHOLE_PICTURE},
        },
        stars::cull::MAX_VIEWPORTS,
    },
    render::asteroids::layout,
};

/// Uploads lists, their offsets, totals and draw arguments.
pub(super) fn upload_lists(
    gpu: &Gpu,
    plan: &AsteroidPlan,
    held: &Held,
    buffers: &mut FrameBuffers,
    found: &[PictureLists],
    splats_per_workgroup: u32,
) {
    let kinds = plan.kinds as usize;
    let mut entries: Vec<layout::AsteroidEntry> = Vec::with_capacity(plan.capacity as usize);
    let mut totals = vec![0];
    let (mut bases, mut arguments) = (Vec::new(), Vec::new());
    let meshes = held.mesh_arguments();
    for plane in &plan.planes {
        let lists_of_viewport = &found[plane.viewport];
        let lists = &lists_of_viewport.lists[plane.face.map_or(WHOLE_PICTURE, |face| face as usize)];
        for kind in 0..kinds {
            let list = lists.get(kind).map_or(&[][..], Vec::as_slice);
            bases.push(entries.len() as u32);
            let count = list.len() as u32;
            let seen = if plane.face.is_none() { lists_of_viewport.seen as u32 } else { 0 };
            totals.push(if kind == kinds - 1 { seen } else { count });
            let [indices, first_index, first_vertex] = meshes.get(kind).copied().unwrap_or([IMPOSTOR_VERTICES, 0, 0]);
            if splats_per_workgroup > 0 && kind >= plan.numbers.meshes {
                let [columns, rows] = dispatch_rows(gpu, count.div_ceil(splats_per_workgroup));
                arguments.extend([columns, rows, 1, count, entries.len() as u32]);
            } else {
                arguments.extend([indices, count, first_index, first_vertex, 0]);
            }
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

/// Computes the asteroid counts of each of `views` views from the totals of all lists.
pub(super) fn counts_of(
    plan: &AsteroidPlan,
    totals: &[u32],
    points: &[u32],
    hidden: &[u32],
    views: usize,
) -> Vec<AsteroidCounts> {
    let levels = plan.numbers.sets.iter().flat_map(|set| &set.shapes.shapes).map(|shape| shape.lods.len()).max();
    let mut counts = vec![AsteroidCounts { meshes: vec![0; levels.unwrap_or(0)], ..Default::default() }; views];
    for ((plane, totals), hidden) in plan.planes.iter().zip(totals.chunks_exact(plan.kinds as usize)).zip(hidden) {
        let Some(counts) = counts.get_mut(plan.viewports[plane.viewport].view) else { continue };
        for set in &plan.numbers.sets {
            for (shape, first) in set.shapes.shapes.iter().zip(&set.shape_kinds) {
                for level in 0..shape.lods.len() {
                    counts.meshes[level] += u64::from(totals[first + level]);
                }
            }
        }
        let impostors = &totals[plan.numbers.meshes..plan.numbers.lists()];
        counts.impostors += impostors.iter().map(|count| u64::from(*count)).sum::<u64>();
        counts.hidden += u64::from(*hidden);
        if plane.face.is_none() {
            let nodes = plan.cut.unresolved.iter().filter(|point| point.point.viewports >> plane.viewport & 1 == 1);
            let unresolved: u64 = nodes.map(|node| node.asteroids).sum();
            let pointlike = u64::from(points[MAX_VIEWPORTS + plane.viewport]);
            counts.points += u64::from(points[plane.viewport]);
            counts.unresolved += unresolved;
            let seen = u64::from(totals[totals.len() - 1]) + unresolved + pointlike;
            counts.culled += plan.asteroids.saturating_sub(seen);
        }
    }
    counts
}
