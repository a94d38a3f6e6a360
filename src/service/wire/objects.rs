//! Bodies and asteroid fields: conversion between protobuf messages and plain types. Errors state the problem and the
//! valid values.

use glam::{DQuat, DVec3};
use prost_types::Timestamp;

use super::camera::{quaternion_from_pb, vector_from_pb, vector_to_pb};
use crate::{
    calendar,
    scene::{
        asteroids::{FieldParameters, FieldSpec, Placement, ShapeSource},
        bodies::{Body, Emission, Ephemeris, ReflectionLaw, SolarBody, Spin, Surface, check_name},
        unit_quaternion,
    },
    service::{
        proto,
        scene::objects::{BodyForm, Change},
    },
    units::J2000_UNIX_S,
};

/// Unix times of the first and last second of the years 1 to 9999, the range of a timestamp.
const TIMESTAMPS_S: std::ops::RangeInclusive<i64> = -62_135_596_800..=253_402_300_799;

/// Converts a time in s since 2000-01-01T12:00:00Z, rounded to the microsecond, which is the precision of f64 here. `None`: a timestamp cannot
/// carry its year.
pub(crate) fn time_to_pb(time_s: f64) -> Option<Timestamp> {
    let unix_us = ((time_s + J2000_UNIX_S) * 1e6).round() as i64;
    let timestamp =
        Timestamp { seconds: unix_us.div_euclid(1_000_000), nanos: (unix_us.rem_euclid(1_000_000) * 1000) as i32 };
    Some(timestamp).filter(|timestamp| TIMESTAMPS_S.contains(&timestamp.seconds))
}

pub(crate) fn time_from_pb(time: Option<Timestamp>) -> Result<f64, String> {
    let time = time.ok_or("time: named by update_mask, but missing")?;
    if !TIMESTAMPS_S.contains(&time.seconds) || !(0..1_000_000_000).contains(&time.nanos) {
        let allowed = "a timestamp must be within the years 1 to 9999 and have 0 to 999999999 nanoseconds; use time_j2000_s for other times";
        return Err(format!("time = {} s and {} ns: {allowed}", time.seconds, time.nanos));
    }
    Ok((time.seconds - J2000_UNIX_S as i64) as f64 + f64::from(time.nanos) * 1e-9)
}

/// Reads a time in s since 2000-01-01T12:00:00Z.
pub(crate) fn time_from_j2000(time_s: Option<f64>) -> Result<f64, String> {
    let time_s = time_s.ok_or("time_j2000_s: named by update_mask, but missing")?;
    calendar::check(time_s).map_err(|problem| format!("time_j2000_s = {time_s:?}: {problem}"))
}

fn rgb_to_pb([red, green, blue]: [f64; 3]) -> proto::Rgb {
    proto::Rgb { red, green, blue }
}

fn rgb_from_pb(rgb: Option<proto::Rgb>) -> [f64; 3] {
    rgb.map_or([0.0; 3], |rgb| [rgb.red, rgb.green, rgb.blue])
}

pub(crate) fn orientation_to_pb(DQuat { x, y, z, w }: DQuat) -> proto::Quaternion {
    proto::Quaternion { x, y, z, w }
}

fn orientation_from_pb(orientation: Option<proto::Quaternion>) -> Result<DQuat, String> {
    let given = orientation.map(|given| unit_quaternion(quaternion_from_pb(given)));
    given.transpose().map(Option::unwrap_or_default).map_err(|error| error.to_string())
}

fn needed_vector(vector: Option<proto::Vector3>, key: &str) -> Result<DVec3, String> {
    vector.map(|vector| DVec3::from_array(vector_from_pb(vector))).ok_or_else(|| format!("{key} is missing"))
}

fn law_from_pb(name: &str) -> Result<ReflectionLaw, String> {
    if name.is_empty() {
        return Ok(ReflectionLaw::default());
    }
    ReflectionLaw::from_name(name).ok_or_else(|| {
        let names = ReflectionLaw::ALL.map(ReflectionLaw::name).join(", ");
        format!("law = `{name}`: must be one of {names}")
    })
}

pub(crate) fn body_to_pb(form: &BodyForm) -> proto::Body {
    let body = &form.body;
    let spins = body.spin != Spin::default();
    proto::Body {
        name: body.name.clone(),
        position_m: Some(vector_to_pb(body.position_m)),
        orientation: Some(orientation_to_pb(body.orientation)),
        radii_m: Some(vector_to_pb(body.radii_m)),
        geometric_albedo: Some(rgb_to_pb(body.surface.geometric_albedo)),
        law: body.surface.law.name().to_owned(),
        texture_of: form.texture_of.clone().unwrap_or_default(),
        spin: spins.then_some(proto::Spin { period_s: body.spin.period_s, phase_rad: body.spin.phase_rad }),
        emission: body.emission.map(|emission| proto::Emission {
            luminance_cd_m2: Some(rgb_to_pb(emission.luminance_cd_m2)),
            limb_darkening: emission.limb_darkening,
            corona: Some(emission.corona),
        }),
        ephemeris: body.ephemeris.map_or_else(String::new, |of| of.to_string()),
        phase_curve: body.surface.phase_curve.map_or_else(String::new, |of| of.name().to_owned()),
    }
}

/// Returns a body of the Solar System by name; empty: none.
fn solar_body_from_pb(name: &str, key: &str) -> Result<Option<SolarBody>, String> {
    if name.is_empty() {
        return Ok(None);
    }
    let found = SolarBody::from_name(name).map(Some);
    found.ok_or_else(|| format!("{key} = `{name}`: must be one of {}", SolarBody::ALL.map(SolarBody::name).join(", ")))
}

/// Reads a body without checking ranges.
pub(crate) fn body_from_pb(body: proto::Body) -> Result<BodyForm, String> {
    let spin = body.spin.map(|spin| Spin { period_s: spin.period_s, phase_rad: spin.phase_rad });
    let ephemeris = Some(body.ephemeris).filter(|text| !text.is_empty()).map(Ephemeris::try_from).transpose();
    let ephemeris = ephemeris.map_err(|problem| format!("ephemeris = {problem}"))?;
    let is_sun = ephemeris.and_then(Ephemeris::stands_as) == Some(SolarBody::Sun);
    let emission = |emission: proto::Emission| {
        let luminance_cd_m2 = emission.luminance_cd_m2.ok_or("emission.luminance_cd_m2 is missing")?;
        Ok::<_, String>(Emission {
            luminance_cd_m2: rgb_from_pb(Some(luminance_cd_m2)),
            limb_darkening: emission.limb_darkening,
            // State files of versions without coronas lack this field.
            corona: emission.corona.unwrap_or(is_sun),
        })
    };
    Ok(BodyForm {
        body: Body {
            ephemeris,
            position_m: match (ephemeris, body.position_m) {
                // The position follows from the scene's time.
                (Some(_), None) => DVec3::ZERO,
                (_, given) => needed_vector(given, "position_m")?,
            },
            radii_m: needed_vector(body.radii_m, "radii_m")?,
            orientation: orientation_from_pb(body.orientation)?,
            spin: spin.unwrap_or_default(),
            surface: Surface {
                law: law_from_pb(&body.law)?,
                geometric_albedo: rgb_from_pb(body.geometric_albedo),
                phase_curve: solar_body_from_pb(&body.phase_curve, "phase_curve")?,
                texture: None,
            },
            emission: body.emission.map(emission).transpose()?,
            seen_through: [1.0; 3],
            name: body.name,
        },
        texture_of: Some(body.texture_of).filter(|name| !name.is_empty()),
    })
}

fn range_to_pb([least, most]: [f64; 2]) -> proto::Range {
    proto::Range { least, most }
}

fn needed_range(range: Option<proto::Range>, key: &str) -> Result<[f64; 2], String> {
    range.map(|range| [range.least, range.most]).ok_or_else(|| format!("{key} is missing"))
}

pub(crate) fn field_to_pb(form: &FieldSpec) -> proto::AsteroidField {
    use proto::asteroid_field::{Placement as Wire, Shapes};
    let parameters = form.parameters;
    proto::AsteroidField {
        name: form.name.clone(),
        position_m: Some(vector_to_pb(form.position_m)),
        orientation: Some(orientation_to_pb(form.orientation)),
        instances: parameters.instances,
        seed: parameters.seed,
        placement: Some(match parameters.placement {
            Placement::Box { size_m } => Wire::Box(proto::BoxPlacement { size_m: Some(vector_to_pb(size_m)) }),
            Placement::Belt { inner_m, outer_m, height_m } => {
                Wire::Belt(proto::BeltPlacement { inner_m, outer_m, height_m })
            }
            Placement::Ring { inner_m, outer_m, thickness_m } => {
                Wire::Ring(proto::RingPlacement { inner_m, outer_m, thickness_m })
            }
        }),
        radius_m: Some(range_to_pb(parameters.radius_m)),
        size_index: parameters.size_index,
        spin_period_s: Some(range_to_pb(parameters.spin_period_s)),
        geometric_albedo: Some(rgb_to_pb(form.geometric_albedo)),
        law: form.law.name().to_owned(),
        shapes: match &form.shapes {
            ShapeSource::Procedural { seed } => Some(Shapes::ShapeSeed(*seed)),
            ShapeSource::OfField(name) => Some(Shapes::ShapesOf(name.clone())),
            // Clients do not see files; `Objects::field_specs` names the field that has them.
            ShapeSource::Files(_) => None,
        },
    }
}

/// Reads a field without checking ranges.
pub(crate) fn field_from_pb(field: proto::AsteroidField) -> Result<FieldSpec, String> {
    use proto::asteroid_field::{Placement as Wire, Shapes};
    let placement = match field.placement.ok_or("placement is missing: must be one of box, belt and ring")? {
        Wire::Box(given) => Placement::Box { size_m: needed_vector(given.size_m, "box.size_m")? },
        Wire::Belt(proto::BeltPlacement { inner_m, outer_m, height_m }) => {
            Placement::Belt { inner_m, outer_m, height_m }
        }
        Wire::Ring(proto::RingPlacement { inner_m, outer_m, thickness_m }) => {
            Placement::Ring { inner_m, outer_m, thickness_m }
        }
    };
    Ok(FieldSpec {
        position_m: needed_vector(field.position_m, "position_m")?,
        orientation: orientation_from_pb(field.orientation)?,
        parameters: FieldParameters {
            instances: field.instances,
            seed: field.seed,
            placement,
            radius_m: needed_range(field.radius_m, "radius_m")?,
            size_index: field.size_index,
            spin_period_s: needed_range(field.spin_period_s, "spin_period_s")?,
        },
        shapes: match field.shapes {
            None => ShapeSource::Procedural { seed: 0 },
            Some(Shapes::ShapeSeed(seed)) => ShapeSource::Procedural { seed },
            Some(Shapes::ShapesOf(name)) => ShapeSource::OfField(name),
        },
        law: law_from_pb(&field.law)?,
        geometric_albedo: rgb_from_pb(field.geometric_albedo),
        name: field.name,
    })
}

/// Reads the part of a list that a path of the mask names. `rest` is the path after the list's name: empty or `.NAME`. `given` contains the items of
/// the message.
pub(crate) fn add_change<M: Clone, T>(
    change: &mut Change<T>,
    list: &str,
    rest: &str,
    given: &[M],
    name_of: impl Fn(&M) -> &str,
    read: impl Fn(M) -> Result<T, String>,
) -> Result<(), String> {
    let one = |message: &M| {
        let name = name_of(message);
        check_name(name).map_err(|error| format!("{list}: {error}"))?;
        read(message.clone()).map_err(|problem| format!("{list}.{name}: {problem}"))
    };
    let both = || format!("update_mask: `{list}` names the whole list: use either this path, or names below it");
    let Some(name) = rest.strip_prefix('.') else {
        if !change.is_nothing() {
            return Err(both());
        }
        *change = Change::All(given.iter().map(one).collect::<Result<_, _>>()?);
        return Ok(());
    };
    check_name(name).map_err(|error| format!("update_mask: {list}.{error}"))?;
    let mut of_name = given.iter().filter(|message| name_of(message) == name);
    let value = of_name.next().map(one).transpose()?;
    if of_name.next().is_some() {
        return Err(format!("{list}.{name}: given more than once"));
    }
    match change {
        Change::All(_) => return Err(both()),
        Change::Nothing => *change = Change::Named(vec![(name.to_owned(), value)]),
        Change::Named(named) if named.iter().any(|(before, _)| before == name) => {
            return Err(format!("update_mask: `{list}.{name}` is named twice"));
        }
        Change::Named(named) => named.push((name.to_owned(), value)),
    }
    Ok(())
}

/// Returns the paths and messages of a change, for clients.
pub(crate) fn change_to_pb<T, M>(change: &Change<T>, list: &str, write: impl Fn(&T) -> M) -> (Vec<String>, Vec<M>) {
    match change {
        Change::Nothing => (Vec::new(), Vec::new()),
        Change::All(all) => (vec![list.to_owned()], all.iter().map(write).collect()),
        Change::Named(named) => (
            named.iter().map(|(name, _)| format!("{list}.{name}")).collect(),
            named.iter().filter_map(|(_, value)| value.as_ref().map(&write)).collect(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        scene::bodies::SolarBody,
        service::{scene::state::SceneUpdate, wire::scene::scene_update_from_pb},
    };

    fn update(scene: proto::Scene, paths: &[&str]) -> Result<SceneUpdate, String> {
        scene_update_from_pb(&proto::UpdateSceneRequest {
            scene: Some(scene),
            update_mask: Some(prost_types::FieldMask { paths: paths.iter().map(|path| path.to_string()).collect() }),
            expected_revision: None,
        })
    }

    fn mars() -> proto::Body {
        body_to_pb(&Body::preset(SolarBody::Mars, "mars", DVec3::X).into())
    }

    fn swarm() -> FieldSpec {
        FieldSpec {
            name: "swarm".to_owned(),
            position_m: DVec3::Y,
            orientation: DQuat::from_rotation_x(0.5),
            parameters: FieldParameters {
                instances: 7,
                seed: 8,
                placement: Placement::Belt { inner_m: 1.0, outer_m: 2.0, height_m: 3.0 },
                radius_m: [0.1, 0.2],
                size_index: 2.5,
                spin_period_s: [60.0, 70.0],
            },
            shapes: ShapeSource::OfField("rocks".to_owned()),
            law: ReflectionLaw::Lambert,
            geometric_albedo: [0.1, 0.2, 0.3],
        }
    }

    #[test]
    fn bodies_fields_and_times_survive_a_round_trip() {
        let mut sun = BodyForm::from(Body::preset(SolarBody::Sun, "sun", DVec3::new(1.0, -2.0, 3e11)));
        sun.texture_of = Some("spots".to_owned());
        assert_eq!(body_from_pb(body_to_pb(&sun)), Ok(sun));
        let mut field = swarm();
        for placement in [
            Placement::Box { size_m: DVec3::new(1.0, 2.0, 3.0) },
            Placement::Ring { inner_m: 1.0, outer_m: 2.0, thickness_m: 0.0 },
            field.parameters.placement,
        ] {
            field.parameters.placement = placement;
            let back = field_from_pb(field_to_pb(&field)).unwrap();
            assert!(back.orientation.angle_between(field.orientation) < 1e-7);
            assert_eq!(FieldSpec { orientation: field.orientation, ..back }, field);
        }
        for time_s in [0.0, 820_497_600.25, -3e9 + 0.5, 1e11] {
            assert!((time_from_pb(time_to_pb(time_s)).unwrap() - time_s).abs() <= 1e-6, "{time_s}");
        }
        assert_eq!(time_to_pb(0.0), Some(Timestamp { seconds: 946_728_000, nanos: 0 }));
        // The first and the last second that a timestamp can carry, and their neighbours.
        let [first_s, last_s] = [-63_082_324_800.0, 252_455_572_799.0];
        for time_s in [first_s, last_s] {
            assert_eq!(time_from_pb(time_to_pb(time_s)), Ok(time_s));
        }
        assert_eq!([first_s - 1.0, last_s + 1.0].map(time_to_pb), [None, None]);
    }

    #[test]
    fn masks_replace_add_and_remove_items() {
        let given = || proto::Scene { bodies: vec![mars()], ..Default::default() };
        let form = body_from_pb(mars()).unwrap();
        assert_eq!(update(given(), &["bodies"]).unwrap().bodies, Change::All(vec![form.clone()]));
        let named = update(given(), &["bodies.venus", "bodies.mars"]).unwrap().bodies;
        let removed = ("venus".to_owned(), None);
        assert_eq!(named, Change::Named(vec![removed.clone(), ("mars".to_owned(), Some(form))]));
        // Bodies that the mask does not name are ignored.
        let nameless = proto::Scene { bodies: vec![proto::Body::default()], ..Default::default() };
        assert_eq!(update(nameless, &["bodies.venus"]).unwrap().bodies, Change::Named(vec![removed]));
    }

    #[test]
    fn invalid_values_are_refused_with_valid_ones() {
        let twice = proto::Scene { bodies: vec![mars(), mars()], ..Default::default() };
        let with = |body: proto::Body| proto::Scene { bodies: vec![body], ..Default::default() };
        let field = |field: proto::AsteroidField| proto::Scene { asteroid_fields: vec![field], ..Default::default() };
        let time_at = |seconds, nanos| proto::Scene { time: Some(Timestamp { seconds, nanos }), ..Default::default() };
        let j2000 = |time_s| proto::Scene { time_j2000_s: Some(time_s), ..Default::default() };
        assert_eq!(update(j2000(-8.1e10), &["time_j2000_s"]).unwrap().time_s, Some(-8.1e10));
        let settings = |impostor: &str, quality| proto::Scene {
            asteroids: Some(proto::AsteroidSettings { impostor: impostor.to_owned(), quality }),
            ..Default::default()
        };
        for (scene, paths, parts) in [
            (twice, &["bodies.mars"][..], &["bodies.mars", "more than once"][..]),
            (with(mars()), &["bodies", "bodies.mars"], &["either this path, or names"]),
            (with(mars()), &["bodies.mars", "bodies"], &["either this path, or names"]),
            (with(mars()), &["bodies.mars", "bodies.mars"], &["twice"]),
            (with(mars()), &["bodies."], &["name", "1 to 64"]),
            (with(mars()), &["bodies.mars.law"], &["name", "letters"]),
            (with(mars()), &["bodiesmars"], &["no field `bodiesmars`", "bodies.NAME"]),
            (with(proto::Body { name: "a b".to_owned(), ..mars() }), &["bodies"], &["a b", "letters"]),
            (with(proto::Body { position_m: None, ..mars() }), &["bodies"], &["bodies.mars", "position_m is missing"]),
            (with(proto::Body { radii_m: None, ..mars() }), &["bodies"], &["bodies.mars", "radii_m is missing"]),
            (with(proto::Body { law: "phong".to_owned(), ..mars() }), &["bodies"], &["phong", "lommel_seeliger"]),
            (with(proto::Body { emission: Some(Default::default()), ..mars() }), &["bodies"], &["luminance_cd_m2"]),
            (field(proto::AsteroidField { placement: None, ..field_to_pb(&swarm()) }), &["asteroid_fields"], &["belt"]),
            (
                field(proto::AsteroidField { radius_m: None, ..field_to_pb(&swarm()) }),
                &["asteroid_fields.swarm"],
                &["asteroid_fields.swarm", "radius_m is missing"],
            ),
            (proto::Scene::default(), &["time"], &["time", "missing"]),
            (time_at(-62_135_596_801, 0), &["time"], &["years 1 to 9999", "time_j2000_s"]),
            (proto::Scene::default(), &["time_j2000_s"], &["time_j2000_s", "missing"]),
            (j2000(-3e11), &["time_j2000_s"], &["time_j2000_s = -300000000000.0", "years -6000 to 10000"]),
            (j2000(f64::NAN), &["time_j2000_s"], &["years -6000 to 10000"]),
            (proto::Scene { time_j2000_s: Some(1.0), ..time_at(0, 0) }, &["time", "time_j2000_s"], &["only one"]),
            (time_at(0, -1), &["time"], &["nanoseconds"]),
            (settings("sprite", 1.0), &["asteroids"], &["sprite", "octahedral_blend"]),
            (settings("none", 0.0), &["asteroids.quality"], &["asteroids.quality = 0", "between 0.1 and 10"]),
            (settings("none", 1.0), &["asteroids.tiles"], &["no field `asteroids.tiles`"]),
        ] {
            let problem = update(scene, paths).unwrap_err();
            assert!(parts.iter().all(|part| problem.contains(part)), "{paths:?}: {problem}");
        }
        assert_eq!(update(settings("none", 0.0), &["asteroids.impostor"]).unwrap().quality, None);
    }
}
