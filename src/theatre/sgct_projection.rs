//! Projections of SGCT's viewports.

use glam::{DMat3, DVec2, DVec3};

use super::{
    Reader,
    content::Content,
    fault::{Fault, rounded, shown},
    json::Field,
    sgct_keys::projection_type,
};

/// A viewport within its window.
pub(super) struct Area {
    /// Position of its lower left corner and its size, relative to the window.
    pub position: DVec2,
    pub size: DVec2,
    pub size_px: [u32; 2],
    pub aspect: f64,
}

/// The picture of a viewport.
pub(super) struct Drawn {
    pub content: Content,
    /// Whether it is a fisheye.
    pub round: bool,
    /// Whether the values of the mesh are positions in the picture, even if the mesh is a PFM.
    pub texture_mapped: bool,
    /// Whether its directions depend on the position of the eye.
    pub has_eye: bool,
}

/// Field of view above which a fisheye needs more samples: 300 degrees, rad.
const WIDE_RAD: f64 = 300.0 * std::f64::consts::PI / 180.0;

impl Drawn {
    /// Whether it is a fisheye that extends almost to the antipode of its centre.
    pub fn is_wide(&self) -> bool {
        matches!(self.content, Content::Fisheye { half_fov_rad, .. } if 2.0 * half_fov_rad > WIDE_RAD)
    }
}

impl Reader<'_> {
    pub(super) fn projection(
        &mut self,
        field: &Field,
        area: &Area,
        eye: DVec3,
        is_bourke: bool,
    ) -> Result<Drawn, Fault> {
        let kind = field.needed("type")?;
        let known = "must be one of planar, projectionplane, fisheye, texturemapped and spoutflat";
        let name = projection_type(field)?;
        let drawn =
            |content: Content| Drawn { content, round: false, texture_mapped: name == "texturemapped", has_eye: true };
        match name.as_str() {
            "planar" | "texturemapped" => Ok(drawn(planar(field, eye)?)),
            // This type is from old versions of SGCT. It is a planar projection whose picture is also sent to other programs.
            "spoutflat" => {
                self.note(format!(
                    "{}: read as the planarprojection in it; the picture for other programs (Spout) is left out",
                    field.place
                ));
                Ok(drawn(planar(&field.needed("planarprojection")?, eye)?))
            }
            "projectionplane" => {
                let corner = |key: &str| field.needed(key)?.vector();
                let (lower_left, upper_left, upper_right) =
                    (corner("lowerleft")?, corner("upperleft")?, corner("upperright")?);
                let content = Content::corners(lower_left, upper_left, upper_right, eye);
                Ok(drawn(content.map_err(|fault| fault.within(&field.place))?))
            }
            "fisheye" => self.sgct_fisheye(field, area, is_bourke),
            "sphericalmirror" => Err(Fault::refused(
                format!("{}: a spherical mirror", field.place),
                "its meshes refer to four pictures, and the file does not contain the directions of these pictures; export a single mesh of a fisheye (Paul Bourke's .data)",
            )),
            "cubemap" | "equirectangular" => Err(Fault::refused(
                format!("{}: the projection `{name}`", field.place),
                format!(
                    "it shows all directions and needs no calibration: write a view of the type `{name}`; a projector {known}"
                ),
            )),
            "spoutoutput" => Err(Fault::refused(
                format!("{}: the projection `spoutoutput`", field.place),
                format!(
                    "it gives pictures of all directions to other programs, not to a projector; a projector {known}"
                ),
            )),
            "cylindrical" => Err(Fault::refused(
                format!("{}: the projection `cylindrical`", field.place),
                format!("it shows all azimuths, and no view has this projection; a projector {known}"),
            )),
            other => Err(Fault::new(&kind.place, format!("`{}`", other.escape_debug()), known)),
        }
    }

    /// Reads a fisheye. The picture is a square whose edges are cut off by `crop`. The rest is shown in the viewport as
    /// large as the aspect ratio allows.
    fn sgct_fisheye(&mut self, field: &Field, area: &Area, is_bourke: bool) -> Result<Drawn, Fault> {
        let fov_deg = field.optional_number("fov")?.unwrap_or(180.0);
        let tilt_deg = field.optional_number("tilt")?.unwrap_or(0.0);
        let keep = field.flag("keepaspectratio", true)?;
        let crop = field.get("crop")?;
        let [left, right, bottom, top] = match &crop {
            None => [0.0; 4],
            Some(crop) => {
                let mut parts = [0.0; 4];
                for (part, key) in parts.iter_mut().zip(["left", "right", "bottom", "top"]) {
                    *part = crop.optional_number(key)?.unwrap_or(0.0);
                }
                let [left, right, bottom, top] = parts;
                if parts.iter().any(|part| !(0.0..1.0).contains(part)) || left + right >= 1.0 || bottom + top >= 1.0 {
                    let problem = format!("left {left}, right {right}, bottom {bottom}, top {top}");
                    let allowed =
                        "must be fractions of the square, at least 0; the sums of opposite ones must be below 1";
                    return Err(Fault::new(&crop.place, problem, allowed));
                }
                parts
            }
        };
        let offset = field.get("offset")?.map_or(Ok(DVec3::ZERO), |offset| {
            let part = |key: &str| Ok::<f64, Fault>(offset.optional_number(key)?.unwrap_or(0.0));
            let offset_of = DVec3::new(part("x")?, part("y")?, part("z")?);
            // The eye must stay within the sphere of radius 1 on which the picture lies.
            if offset_of.length() >= 1.0 {
                let problem = format!("{} has the length {}", shown(offset_of.to_array()), rounded(offset_of.length()));
                return Err(Fault::new(
                    &offset.place,
                    problem,
                    "must be shorter than 1, which is the radius of the dome",
                ));
            }
            Ok(offset_of)
        })?;
        // Half the size of the cropped square, relative to the viewport. A mesh by Paul Bourke has coordinates in a square picture.
        let (wide, high) = (1.0 - left - right, 1.0 - bottom - top);
        let aspect = if is_bourke { 1.0 } else { area.aspect } * high / wide;
        let edge = if keep { [(1.0 / aspect).min(1.0), aspect.min(1.0)] } else { [1.0; 2] };
        self.note(format!(
            "fisheye of {fov_deg} degrees, equidistant, centre = apex of the dome tilted by {tilt_deg} degrees to the front, bottom = front"
        ));
        if [left, right, bottom, top] != [0.0; 4] {
            self.note(format!(
                "fisheye: its square is cut by {left} on the left, {right} on the right, {bottom} at the bottom and {top} at the top"
            ));
        }
        // In SGCT, the second number is positive downwards in the picture.
        let eye = DVec3::new(offset.x, -offset.y, offset.z);
        if offset != DVec3::ZERO {
            self.note(format!(
                "fisheye: the eye is at {}, in radii of the dome (right, up and towards the centre of the picture)",
                shown(eye.to_array())
            ));
        }
        let radius = [edge[0] / wide, edge[1] / high];
        let content = Content::fisheye(fov_deg.to_radians(), tilt_deg.to_radians(), radius)
            .map_err(|fault| fault.within(&field.place))?
            .cut(edge, [left - right, bottom - top], eye);
        Ok(Drawn { content, round: true, texture_mapped: false, has_eye: false })
    }
}

/// Reads two opposite edges of a field of view, rad. Either each edge has its own key, or each is half of the whole angle.
fn edges(fov: &Field, [first, second]: [&str; 2], whole: &str) -> Result<[f64; 2], Fault> {
    let angle = fov.optional_number(whole)?;
    let edge = |key: &str| match (fov.optional_number(key)?, angle) {
        (Some(edge), _) => Ok(edge),
        (None, Some(angle)) => Ok(angle / 2.0),
        (None, None) => {
            let allowed = "must have one of them, in degrees";
            Err(Fault::new(&fov.place, format!("neither `{key}` nor `{whole}`"), allowed))
        }
    };
    let edges = [edge(first)?, edge(second)?];
    if let Some(angle) = angle
        && (edges[0] + edges[1] - angle).abs() > 1e-6
    {
        let problem = format!("{first} {} and {second} {} in addition to {whole} {angle}", edges[0], edges[1]);
        return Err(Fault::new(
            &fov.place,
            problem,
            format!("must have either {first} and {second}, or {whole}, because they differ"),
        ));
    }
    Ok(edges.map(f64::to_radians))
}

/// Returns the distance of a planar projection's plane from the room's origin, m.
fn plane_distance(field: &Field, fov: &Field) -> Result<f64, Fault> {
    let distance = match (field.optional_number("distance")?, fov.optional_number("distance")?) {
        (Some(own), Some(other)) if own != other => {
            let problem = format!("distance = {own}, and {other} in `fov`");
            return Err(Fault::new(&field.place, problem, "must be given once"));
        }
        (Some(distance), _) | (None, Some(distance)) => distance,
        (None, None) => 10.0,
    };
    if distance > 0.0 {
        Ok(distance)
    } else {
        Err(Fault::new(&field.place, format!("distance = {distance}"), "must be more than 0"))
    }
}

/// Reads the picture of a planar projection. The distance of its plane is measured from the room's origin, not from the eye.
fn planar(field: &Field, eye: DVec3) -> Result<Content, Fault> {
    let fov = field.needed("fov")?;
    let [left, right] = edges(&fov, ["left", "right"], "hfov")?;
    let [down, up] = edges(&fov, ["down", "up"], "vfov")?;
    let within = |angle: f64| angle.abs() < 89.99f64.to_radians();
    if ![left, right, down, up].into_iter().all(within) || left + right <= 0.0 || down + up <= 0.0 {
        let degrees = [left, right, down, up].map(f64::to_degrees);
        let problem = format!("left, right, down and up are {} degrees", shown(degrees));
        let allowed = "must be between -89.99 and 89.99 degrees, left plus right and down plus up more than 0: SGCT counts each outwards \
                       from the middle, so all four are positive in an ordinary frustum";
        return Err(Fault::new(&fov.place, problem, allowed));
    }
    let (left, down) = (-left, -down);
    let rotation = field.get("orientation")?.map_or(Ok(DMat3::IDENTITY), |orientation| orientation.rotation())?;
    let distance = plane_distance(field, &fov)?;
    let offset = field.get("offset")?.map_or(Ok(DVec3::ZERO), |offset| offset.vector())?;
    let content = Content::frustum(left, right, down, up, rotation).map_err(|fault| fault.within(&fov.place))?;
    let Content::Plane { lower_left, right, up } = content else {
        return Ok(content);
    };
    let lower_left = lower_left * distance + offset;
    let (upper_left, upper_right) = (lower_left + up * distance, lower_left + up * distance + right * distance);
    Content::corners(lower_left, upper_left, upper_right, eye).map_err(|fault| fault.within(&field.place))
}
