//! Compares the lists of the adapter with f64 lists.

use std::collections::BTreeMap;

use super::*;
use crate::plan::Limits;
use crate::plan::asteroids::kinds::{MAX_FIELDS, MAX_SHAPES};
use crate::plan::{
    asteroids::{
        classes::ClassRules,
        cpu_cull::{self, PictureLists, WHOLE_PICTURE},
        frame::check,
        views::{PictureBounds, eye_distance_m, impostor_reach},
    },
    settings::ImpostorMethod,
};
use crate::render::targets::POINT_COUNTERS;

/// Entries by plane and kind: asteroid, side of the seam, share.
type Found = BTreeMap<(usize, usize, usize), Vec<(u32, bool, f32)>>;

/// Returns the number of differences between two sets of lists: entries that only one of them has, and shares that differ.
fn differences(first: &Found, second: &Found) -> usize {
    let missing = |one: &Found, other: &Found, both: bool| -> usize {
        one.iter()
            .flat_map(|(list, entries)| entries.iter().map(move |entry| (list, entry)))
            .filter(|(list, (instance, seam, fade))| {
                let twin = other
                    .get(list)
                    .and_then(|entries| entries.iter().find(|twin| (twin.0, twin.1) == (*instance, *seam)));
                match twin {
                    Some(twin) => both && (twin.2 - fade).abs() > 2e-3,
                    None => true,
                }
            })
            .count()
    };
    missing(first, second, true) + missing(second, first, false)
}

fn adapters_lists(bench: &mut Bench, plan: &AsteroidPlan) -> (Found, Vec<u32>) {
    let mut encoder = bench.encoder();
    bench.asteroids.record_cull(&bench.gpu, &mut encoder, &mut bench.timer, plan);
    let lists = plan.planes.len() * plan.kinds as usize;
    let (totals, bases, entries) = {
        let buffers = &mut bench.asteroids.buffers;
        (
            buffers.totals.with_room(&bench.gpu, 0).clone(),
            buffers.bases.with_room(&bench.gpu, 0).clone(),
            buffers.entries.with_room(&bench.gpu, 0).clone(),
        )
    };
    let words = 3 * plan.capacity as usize;
    let values: Vec<Vec<u32>> = bench.read(encoder, &[(&totals, 1 + lists), (&bases, lists), (&entries, words)]);
    let mut found = Found::new();
    for list in 0..lists {
        let (plane, kind) = (plan.planes[list / plan.kinds as usize], list % plan.kinds as usize);
        if kind == plan.kinds as usize - 1 {
            continue;
        }
        let (first, count) = (values[1][list] as usize, values[0][1 + list] as usize);
        let words = values[2][3 * first..3 * (first + count)].chunks_exact(3);
        let key = (plane.viewport, plane.face.map_or(WHOLE_PICTURE, |face| face as usize), kind);
        let entries = words.map(|word| (word[0], word[1] >> 31 == 1, f32::from_bits(word[2]))).collect::<Vec<_>>();
        if !entries.is_empty() {
            found.insert(key, entries);
        }
    }
    (found, values[0].clone())
}

fn lists_of_f64(
    objects: &SceneObjects,
    settings: &AsteroidSettings,
    viewports: &[Viewport],
    camera_m: DVec3,
) -> Vec<PictureLists> {
    let fields: Vec<&AsteroidField> = objects.fields.iter().map(Arc::as_ref).collect();
    let kinds = crate::plan::asteroids::kinds::Kinds::new(fields.iter().copied());
    let pictures: Vec<PictureBounds> = viewports
        .iter()
        .map(|viewport| {
            let reach = impostor_reach(settings, eye_distance_m(viewports, viewport));
            PictureBounds::new(viewport, MARGIN_PX, Tables::default().for_projection(&viewport.projection), reach)
        })
        .collect();
    let rules: Vec<ClassRules> = pictures
        .iter()
        .map(|picture| ClassRules {
            quality: settings.quality,
            impostor: picture.impostor,
            finest_only: settings.finest_only,
        })
        .collect();
    cpu_cull::cull(&fields, &kinds, camera_m, &pictures, &rules)
}

fn as_found(lists: &[PictureLists]) -> Found {
    let mut found = Found::new();
    for (viewport, picture) in lists.iter().enumerate() {
        for (plane, kinds) in picture.lists.iter().enumerate() {
            for (kind, list) in kinds.iter().enumerate().filter(|(_, list)| !list.is_empty()) {
                let entries = list.iter().map(|entry| (entry.instance, entry.beyond_seam, entry.fade)).collect();
                found.insert((viewport, plane, kind), entries);
            }
        }
    }
    found
}

/// Returns asteroids of many sizes around the origin of a field, near and far.
fn cloud(count: usize, seed: u64) -> SceneObjects {
    let mut random = Random(seed);
    let asteroids: Vec<(DVec3, f64, u32)> = (0..count)
        .map(|i| {
            let distance = 30.0 * 2000.0_f64.powf(random.next());
            (random.direction() * distance, 2.0 * 40.0_f64.powf(random.next()), (i % 2) as u32)
        })
        .collect();
    let instances = instances(&asteroids, seed);
    SceneObjects { fields: vec![field(instances, shapes())], time_s: 4.2e8, ..SceneObjects::default() }
}

#[test]
#[ignore = "long: make test-all"]
fn adapter_lists_match_f64_lists_for_all_counts_projections_and_positions() {
    let (auto, none) = (ImpostorMethod::Auto, ImpostorMethod::None);
    let detected = tails_detected(&[(1, auto), (255, none), (256, auto), (257, auto), (2001, auto), (2001, none)]);
    assert!(detected >= 2, "a missing tail was detected in only {detected} cases");
}

#[test]
#[ignore = "long: make test-all"]
fn adapter_lists_match_f64_lists_with_and_without_impostors_at_every_count() {
    let counts = [1, 255, 256, 257, 2000, 10_007];
    let cases = counts.map(|count| [(count, ImpostorMethod::Auto), (count, ImpostorMethod::None)]);
    let detected = tails_detected(cases.as_flattened());
    assert!(detected >= 4, "a missing tail was detected in only {detected} cases");
}

/// Compares the lists for each asteroid count and impostor method. Returns the number of cases in which the comparison
/// detects that the tail of a list is missing.
fn tails_detected(cases: &[(usize, ImpostorMethod)]) -> usize {
    let mut bench = Bench::new();
    let mut random = Random(7);
    let mut tails = 0;
    for (case, &(count, method)) in cases.iter().enumerate() {
        let objects = cloud(count, 11 + case as u64 / 2);
        let settings = AsteroidSettings { impostor: method, ..AsteroidSettings::default() };
        let orientation = DQuat::from_axis_angle(random.direction(), 6.0 * random.next());
        let viewports = viewports(&kinds(), orientation);
        let camera_m = objects.fields[0].position_m + random.direction() * (25.0 * random.next());
        let plan = bench.plan(&objects, &settings, &viewports, camera_m);
        let (found, totals) = adapters_lists(&mut bench, &plan);
        let expected = lists_of_f64(&objects, &settings, &viewports, camera_m);
        let wanted = as_found(&expected);
        let entries: usize = wanted.values().map(Vec::len).sum();
        let differing = differences(&found, &wanted);
        // Rounding may change the class of asteroids on the border between two classes.
        assert!(differing <= entries / 1000 + 1, "{count} {method:?}: {differing} of {entries} differ");
        assert!(u64::from(totals[0]) <= plan.capacity);
        assert!(count < 1000 || entries > count, "{count} asteroids gave {entries} entries");
        // In the full-sphere view every asteroid is in the lists or part of a combined point.
        let sphere = viewports.len() - 1;
        let seen = totals[(sphere + 1) * plan.kinds as usize];
        let combined: u64 =
            plan.cut.unresolved.iter().filter(|p| p.point.viewports >> sphere & 1 == 1).map(|p| p.asteroids).sum();
        let pointlike: u64 = plan.cut.items[plan.cut.shape_items..].iter().map(|item| u64::from(item.count)).sum();
        assert_eq!(u64::from(seen) + combined + pointlike, count as u64);
        if count > 1000 {
            let has_faces = found.keys().any(|(_, plane, _)| *plane != WHOLE_PICTURE);
            let has_seam = found.values().flatten().any(|(_, seam, _)| *seam);
            let fades = found.values().flatten().any(|(_, _, fade)| *fade < 0.0);
            assert!(has_faces && has_seam && fades, "faces {has_faces}, seam {has_seam}, fades {fades}");
        }
        // The comparison detects a missing tail.
        let in_tail = |entry: &(u32, bool, f32)| entry.0 as usize >= count / 16 * 16;
        let tail = found.values().flatten().filter(|entry| in_tail(entry)).count();
        let mut dropped = found.clone();
        dropped.values_mut().for_each(|entries| entries.retain(|entry| !in_tail(entry)));
        assert!(differences(&dropped, &wanted) + differing >= tail, "{count}");
        tails += usize::from(tail > 0 && differences(&dropped, &wanted) > differing);
    }
    tails
}

#[test]
fn lists_are_reproducible_and_in_the_order_of_asteroids() {
    let mut bench = Bench::new();
    let objects = cloud(3001, 5);
    let settings = AsteroidSettings::default();
    let viewports = viewports(&kinds(), DQuat::IDENTITY);
    let plan = bench.plan(&objects, &settings, &viewports, objects.fields[0].position_m);
    let first = adapters_lists(&mut bench, &plan);
    for _ in 0..3 {
        assert_eq!(adapters_lists(&mut bench, &plan), first);
    }
    let stays_in_group = |entries: &[(u32, bool, f32)]| {
        entries.windows(2).all(|pair| pair[0].0 / 256 != pair[1].0 / 256 || pair[0].0 <= pair[1].0)
    };
    assert!(first.0.values().all(|entries| stays_in_group(entries)));
}

/// Reads the counts of a frame.
fn counts(bench: &mut Bench, plan: &AsteroidPlan) -> Result<Vec<AsteroidCounts>, RenderError> {
    let mut encoder = bench.encoder();
    bench.asteroids.record_cull(&bench.gpu, &mut encoder, &mut bench.timer, plan);
    let mut readback = ReadbackBuffer::new("readback");
    readback.begin(count_bytes(plan));
    let mut places = Places::default();
    let counters = bench.gpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some("counters"),
        size: 4 * u64::from(POINT_COUNTERS),
        usage: wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    bench.asteroids.copy_counts(&bench.gpu, &mut encoder, &mut readback, &mut places, plan, (&counters, 0));
    bench.gpu.queue.submit([encoder.finish()]);
    readback.map(&bench.gpu);
    bench.gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let read = read_counts(&bench.gpu, &mut readback, &places, plan, plan.viewports.len());
    readback.unmap(&bench.gpu);
    bench.gpu.take_failure().unwrap();
    read
}

#[test]
fn full_lists_are_reported_as_an_error() {
    let mut bench = Bench::new();
    let objects = cloud(2000, 5);
    let settings = AsteroidSettings::default();
    let viewports = viewports(&kinds(), DQuat::IDENTITY);
    let mut plan = bench.plan(&objects, &settings, &viewports, objects.fields[0].position_m);
    assert!(counts(&mut bench, &plan).is_ok());
    plan.capacity = 500;
    let error = counts(&mut bench, &plan).unwrap_err();
    assert!(
        matches!(error, RenderError::Plan(PlanError::AsteroidLists { limit: 500, needed }) if needed > 500),
        "{error}"
    );
    assert!(error.to_string().contains("asteroids.quality"), "{error}");
}

#[test]
fn too_many_asteroids_for_a_binding_are_refused_with_the_limit() {
    let options = GpuOptions { binding_limit_bytes: Some(24 * 2000), ..GpuOptions::default() };
    let limits = Gpu::open(&options).unwrap().limits();
    check(&cloud(2000, 1), &limits).unwrap();
    let error = check(&cloud(2001, 1), &limits).unwrap_err();
    assert!(matches!(error, PlanError::TooManyAsteroids { asteroids: 2001, limit: 2000, .. }), "{error}");
}

#[test]
fn too_many_fields_or_shapes_are_refused_with_the_limit() {
    let limits = Limits::default();
    let field = &cloud(1, 1).fields[0];
    let scene = |fields: usize, shapes: usize| {
        let one = &field.shapes.shapes[0];
        let set = ShapeSet { shapes: vec![one.clone(); shapes], digest: 9 };
        let field = Arc::new(AsteroidField { shapes: Arc::new(set), ..(**field).clone() });
        SceneObjects { fields: vec![field; fields], ..SceneObjects::default() }
    };
    check(&scene(MAX_FIELDS, 1), &limits).unwrap();
    let error = check(&scene(MAX_FIELDS + 1, 1), &limits).unwrap_err();
    assert!(matches!(error, PlanError::TooManyFields { limit: MAX_FIELDS, .. }), "{error}");
    let error = check(&scene(200, MAX_SHAPES / 200 + 1), &limits).unwrap_err();
    assert!(matches!(error, PlanError::TooManyShapes { limit: MAX_SHAPES, .. }), "{error}");
}

/// The bend table limits how far the image of a short arc can depart from its chord, for every projection.
#[test]
fn bend_table_bounds_the_curvature_of_the_projection() {
    use crate::plan::asteroids::views::{DirectionTable, table_place};
    let viewports = viewports(&kinds(), DQuat::IDENTITY);
    for viewport in &viewports {
        let mapping = viewport.projection.mapping();
        let table = DirectionTable::new(&viewport.projection);
        let mut random = Random(4);
        for _ in 0..300 {
            let middle = random.direction();
            let along = middle.cross(random.direction()).normalize().cross(middle).normalize();
            let half = 0.01 + 0.02 * random.next();
            let pixel = |angle: f64| mapping.pixel_from_direction(middle * angle.cos() + along * angle.sin());
            let (Some(begin), Some(end)) = (pixel(-half), pixel(half)) else { continue };
            let longitude = matches!(viewport.projection, crate::view::projection::Projection::Equirectangular(_));
            if (longitude && begin.distance(end) > 60.0) || !begin.is_finite() || !end.is_finite() {
                continue;
            }
            let cosine = if longitude { middle.y } else { -middle.z };
            let bound = (2.0 * half).powi(2) / 8.0 * table.bend_around_all(table_place(cosine), 0.5 * half + 0.02);
            if matches!(viewport.projection, crate::view::projection::Projection::Perspective(_)) {
                assert_eq!(bound, 0.0);
                continue;
            }
            let worst = (-9..10).filter_map(|i| pixel(half * f64::from(i) / 10.0)).map(|pixel| {
                let chord = end - begin;
                let t = ((pixel - begin).dot(chord) / chord.length_squared()).clamp(0.0, 1.0);
                (begin + chord * t).distance(pixel)
            });
            let worst = worst.fold(0.0, f64::max);
            assert!(worst <= bound * 1.05 + 1e-6, "{:?}: {worst} px, bound {bound}, at {middle}", viewport.projection);
        }
    }
}
