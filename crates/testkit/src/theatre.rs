//! A theatre with known directions: six projectors at the springline of a tilted dome, which are pinhole cameras
//! without lens errors. Also writes the files that installers would deliver for it, in each format.
//!
//! Dome axes: +x right, +y towards the apex, -z forward; the eye is at the centre of the sphere. Positions on a raster
//! are fractions of its width and height, from the top left.

use std::io::{Cursor, Write};

use steradian::glam::{DMat3, DVec2, DVec3};
use zip::write::SimpleFileOptions;

/// Radius of the dome, m.
pub const RADIUS_M: f64 = 8.0;
/// Angle by which the apex of the dome leans to the front, degrees.
pub const TILT_DEG: f64 = 20.0;

/// A pinhole camera.
#[derive(Clone, Debug)]
pub struct Projector {
    pub name: String,
    pub size_px: [u32; 2],
    /// Position in dome axes, m.
    pub place_m: DVec3,
    /// Columns: right, up, backwards.
    pub dome_from_projector: DMat3,
    /// Tangents of half the angles of view.
    pub half_tangents: DVec2,
    /// Direction from the eye to the centre of its picture: angle to the right of the front, and angle upwards, rad.
    pub yaw_pitch_rad: [f64; 2],
}

/// Returns the unit vector at an angle to the right of the front and an angle upwards, rad.
pub fn towards(yaw_rad: f64, pitch_rad: f64) -> DVec3 {
    DVec3::new(yaw_rad.sin() * pitch_rad.cos(), pitch_rad.sin(), -yaw_rad.cos() * pitch_rad.cos())
}

/// Returns the six projectors with rasters of another size.
pub fn projectors_of(size_px: [u32; 2]) -> Vec<Projector> {
    projectors().into_iter().map(|projector| Projector { size_px, ..projector }).collect()
}

/// Returns the six projectors: at the springline, 60 degrees apart, each facing the opposite side; their rasters
/// overlap.
pub fn projectors() -> Vec<Projector> {
    let projector = |index: usize| {
        let yaw = (30.0 + 60.0 * index as f64).to_radians();
        let place_m = towards(yaw + std::f64::consts::PI, 0.01) * RADIUS_M * 0.99;
        let backwards = -towards(yaw, 29f64.to_radians());
        let right = DVec3::Y.cross(backwards).normalize();
        Projector {
            name: format!("p{index}"),
            size_px: [1920, 1200],
            place_m,
            dome_from_projector: DMat3::from_cols(right, backwards.cross(right), backwards),
            half_tangents: DVec2::new(36f64.to_radians().tan(), 26f64.to_radians().tan()),
            yaw_pitch_rad: [yaw, 56f64.to_radians()],
        }
    };
    (0..6).map(projector).collect()
}

impl Projector {
    /// Returns the point at which the ray of a raster position meets the dome, m.
    pub fn point_m(&self, x: f64, y: f64) -> DVec3 {
        let plane = DVec2::new(2.0 * x - 1.0, 1.0 - 2.0 * y) * self.half_tangents;
        let ray = (self.dome_from_projector * plane.extend(-1.0)).normalize();
        // Solve |place + t ray| = radius for the point ahead.
        let half = self.place_m.dot(ray);
        let beyond = half * half - self.place_m.length_squared() + RADIUS_M * RADIUS_M;
        self.place_m + ray * (beyond.sqrt() - half)
    }

    /// Returns the direction of a raster position from the eye.
    pub fn direction(&self, x: f64, y: f64) -> DVec3 {
        self.point_m(x, y).normalize()
    }

    /// Returns the raster position of a direction, if the raster contains it.
    pub fn place(&self, direction: DVec3) -> Option<DVec2> {
        let ray = self.dome_from_projector.transpose() * (direction * RADIUS_M - self.place_m);
        let plane = ray.truncate() / -ray.z / self.half_tangents;
        let place = DVec2::new(plane.x + 1.0, 1.0 - plane.y) / 2.0;
        (ray.z < 0.0 && place.cmpge(DVec2::ZERO).all() && place.cmple(DVec2::ONE).all()).then_some(place)
    }

    /// Returns the solid angle of a pixel, sr, from the closed form of the directions.
    pub fn pixel_sr(&self, x: u32, y: u32) -> f64 {
        let [width, height] = self.size_px.map(f64::from);
        let h = 1e-3;
        let ray_direction =
            |dx: f64, dy: f64| self.direction((f64::from(x) + 0.5 + dx) / width, (f64::from(y) + 0.5 + dy) / height);
        (ray_direction(h, 0.0) - ray_direction(-h, 0.0)).cross(ray_direction(0.0, h) - ray_direction(0.0, -h)).length()
            / (4.0 * h * h)
    }

    /// Returns the width of a pixel at the centre of the raster, rad.
    pub fn pixel_rad(&self) -> f64 {
        let step = 1.0 / f64::from(self.size_px[0]);
        self.direction(0.5, 0.5).angle_between(self.direction(0.5 + step, 0.5))
    }

    /// Returns the rotation of its picture's frustum, whose apex is the eye.
    fn frustum(&self) -> DMat3 {
        let [yaw, pitch] = self.yaw_pitch_rad;
        DMat3::from_rotation_y(-yaw) * DMat3::from_rotation_x(pitch)
    }

    /// Returns the coordinates of a raster position in the picture of that frustum, which extends [`FRUSTUM_DEG`] to
    /// each side. They increase to the right and upwards from 0 to 1.
    pub fn in_frustum(&self, x: f64, y: f64) -> DVec2 {
        let local = self.frustum().transpose() * self.direction(x, y);
        let half = FRUSTUM_DEG.to_radians().tan();
        (local.truncate() / -local.z / half + 1.0) / 2.0
    }

    /// Returns the coordinates of a raster position in a fisheye of 180 degrees around the apex. The bottom of the
    /// fisheye is the front.
    pub fn in_fisheye(&self, x: f64, y: f64) -> DVec2 {
        let direction = self.direction(x, y);
        let across = DVec2::new(direction.x, direction.z);
        let theta = across.length().atan2(direction.y);
        let rho = theta / std::f64::consts::FRAC_PI_2;
        (across.normalize_or_zero() * rho + 1.0) / 2.0
    }
}

/// Half the angle of view of the frustums, degrees.
pub const FRUSTUM_DEG: f64 = 78.0;

/// Returns the raster position of a sample at the centre of a cell.
pub fn centre(i: usize, count: usize) -> f64 {
    (i as f64 + 0.5) / count as f64
}

pub fn corner(i: usize, count: usize) -> f64 {
    i as f64 / (count - 1) as f64
}

/// Variant of a PFM file.
#[derive(Clone, Copy)]
pub struct Pfm {
    pub size: [usize; 2],
    pub little_endian: bool,
    pub bottom_first: bool,
}

impl Pfm {
    /// Returns the variant defined by Netpbm.
    pub fn of(columns: usize, rows: usize) -> Self {
        Self { size: [columns, rows], little_endian: true, bottom_first: true }
    }

    /// Encodes the file. `value` receives the column, and the row from the top.
    pub fn bytes(&self, value: impl Fn(usize, usize) -> [f64; 3]) -> Vec<u8> {
        let [columns, rows] = self.size;
        let mut bytes =
            format!("PF\n{columns} {rows}\n{}\n", if self.little_endian { "-1.0" } else { "1.0" }).into_bytes();
        for line in 0..rows {
            let row = if self.bottom_first { rows - 1 - line } else { line };
            for column in 0..columns {
                for number in value(column, row) {
                    let number = number as f32;
                    bytes.extend(if self.little_endian { number.to_le_bytes() } else { number.to_be_bytes() });
                }
            }
        }
        bytes
    }
}

/// Packs files into a ZIP archive.
pub fn zipped(files: &[(&str, Vec<u8>)], deflated: bool) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let method = if deflated { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in files {
        zip.start_file(*name, options).expect("an entry begins");
        zip.write_all(bytes).expect("an entry is written");
    }
    zip.finish().expect("the archive is whole").into_inner()
}

/// Encodes an 8-bit grey PNG.
pub fn png_grey(size: [u32; 2], value: impl Fn(u32, u32) -> u8) -> Vec<u8> {
    png_of(size, png::BitDepth::Eight, |x, y| vec![value(x, y)])
}

/// Encodes a 16-bit grey PNG.
pub fn png_grey16(size: [u32; 2], value: impl Fn(u32, u32) -> u16) -> Vec<u8> {
    png_of(size, png::BitDepth::Sixteen, |x, y| value(x, y).to_be_bytes().to_vec())
}

fn png_of(size: [u32; 2], depth: png::BitDepth, value: impl Fn(u32, u32) -> Vec<u8>) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    let pixels: Vec<u8> =
        (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).flat_map(|(x, y)| value(x, y)).collect();
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&pixels).expect("pixels");
    drop(writer);
    file
}

/// Variant of an MPCDI set.
#[derive(Clone)]
pub struct Mpcdi {
    pub profile: &'static str,
    pub version: &'static str,
    pub samples: [usize; 2],
    pub pfm: Pfm,
    /// Elements inside `geometryWarpFile` that follow the path.
    pub warp: String,
    /// Whether regions have frustums and coordinate frames.
    pub frame: bool,
    /// Vector added to all points, in the unit of the file.
    pub shift: DVec3,
    /// Units per metre.
    pub per_metre: f64,
    pub masks: bool,
    /// Alpha maps that divide the light among the six projectors.
    pub alpha: Option<Alpha>,
}

/// Format of alpha maps.
#[derive(Clone, Copy)]
pub struct Alpha {
    pub bits: u8,
    /// `gammaEmbedded`.
    pub gamma: f64,
}

impl Alpha {
    /// Rounds a share of light to one that the codes of a map can represent.
    pub fn quantized(&self, exact: f64) -> f64 {
        let most = f64::from((1_u32 << self.bits) - 1);
        ((exact.powf(1.0 / self.gamma) * most).round() / most).powf(self.gamma)
    }

    /// Returns the alpha map of one of the projectors, in the size of its raster.
    pub fn map(&self, projectors: &[Projector], own: usize) -> Vec<u8> {
        self.png(projectors[own].size_px, |x, y| share(projectors, own, x, y))
    }

    fn png(&self, size: [u32; 2], share: impl Fn(f64, f64) -> f64) -> Vec<u8> {
        let most = f64::from((1_u32 << self.bits) - 1);
        let code = |x: u32, y: u32| {
            let share = share(centre(x as usize, size[0] as usize), centre(y as usize, size[1] as usize));
            (share.powf(1.0 / self.gamma) * most).round() as u16
        };
        if self.bits == 8 { png_grey(size, |x, y| code(x, y) as u8) } else { png_grey16(size, code) }
    }
}

/// Returns the share of light of one of the projectors at a raster position. It is smooth, and zero at the borders of
/// the raster; all shares in a direction sum to one.
pub fn share(projectors: &[Projector], own: usize, x: f64, y: f64) -> f64 {
    let weight = |place: DVec2| (16.0 * place.x * (1.0 - place.x) * place.y * (1.0 - place.y)).powi(2);
    let direction = projectors[own].direction(x, y);
    let others = projectors.iter().enumerate().filter(|(other, _)| *other != own);
    let weight_of_others: f64 = others.filter_map(|(_, other)| other.place(direction)).map(weight).sum();
    let own = weight(DVec2::new(x, y));
    // In a corner that no other projector reaches, all light comes from this one.
    if own + weight_of_others > 0.0 { own / (own + weight_of_others) } else { 1.0 }
}

/// Returns the rotation from the axes of a tilted dome to those of its room, and its centre, m.
pub fn room_from_dome() -> (DMat3, DVec3) {
    (DMat3::from_rotation_x(-TILT_DEG.to_radians()), DVec3::new(0.5, 1.25, -0.25))
}

fn numbers(stem: &str, vector: DVec3) -> String {
    format!("<{stem}x>{}</{stem}x><{stem}y>{}</{stem}y><{stem}z>{}</{stem}z>", vector.x, vector.y, vector.z)
}

impl Mpcdi {
    pub fn new(profile: &'static str, columns: usize, rows: usize) -> Self {
        Self {
            profile,
            version: "2.0",
            samples: [columns, rows],
            pfm: Pfm::of(columns, rows),
            warp: "<interpolation>smooth</interpolation>".to_owned(),
            frame: false,
            shift: DVec3::ZERO,
            per_metre: 1.0,
            masks: false,
            alpha: None,
        }
    }

    /// Returns a set of profile a3, with points in the axes of the room. The file also has the axes and the position of
    /// the tilted dome.
    pub fn a3(columns: usize, rows: usize) -> Self {
        Self { frame: true, ..Self::new("a3", columns, rows) }
    }

    /// Returns the warp map of a projector.
    pub fn map(&self, projector: &Projector) -> Vec<u8> {
        let [columns, rows] = self.samples;
        self.pfm.bytes(|i, j| {
            let (x, y) = (centre(i, columns), centre(j, rows));
            if ["2d", "3d"].contains(&self.profile) {
                let place = projector.in_frustum(x, y);
                return [place.x, place.y, 0.0];
            }
            let mut point = projector.point_m(x, y);
            if self.frame {
                let (rotation, centre) = room_from_dome();
                point = rotation * point + centre;
            }
            ((point + self.shift) * self.per_metre).to_array()
        })
    }

    pub fn region(&self, projector: &Projector) -> String {
        let [width, height] = projector.size_px;
        let mut text = format!(
            r#"<region id="{}" x="0" y="0" xsize="1" ysize="1" xResolution="{width}" yResolution="{height}">"#,
            projector.name
        );
        if ["2d", "3d"].contains(&self.profile) {
            let [yaw, pitch] = projector.yaw_pitch_rad.map(f64::to_degrees);
            text += &format!(
                "<Frustum><yaw>{yaw}</yaw><pitch>{pitch}</pitch><roll>0</roll><rightAngle>{FRUSTUM_DEG}</rightAngle>\
                 <leftAngle>-{FRUSTUM_DEG}</leftAngle><upAngle>{FRUSTUM_DEG}</upAngle><downAngle>-{FRUSTUM_DEG}</downAngle></Frustum>"
            );
        }
        if self.frame {
            let (rotation, centre) = room_from_dome();
            text += "<coordinateFrame>";
            text += &numbers("pos", centre * self.per_metre);
            text += &numbers("yaw", -(rotation * DVec3::Y));
            text += &numbers("pitch", rotation * DVec3::X);
            text += &numbers("roll", -(rotation * DVec3::Z));
            text += "</coordinateFrame>";
        }
        text + "</region>"
    }

    pub fn xml(&self, projectors: &[Projector]) -> String {
        let mut display = String::new();
        let mut files = String::new();
        for projector in projectors {
            let name = &projector.name;
            display += &format!(r#"<buffer id="b{name}">{}</buffer>"#, self.region(projector));
            files += &format!(
                r#"<fileSet region="{name}"><geometryWarpFile><path>{name}.pfm</path>{}</geometryWarpFile>"#,
                self.warp
            );
            if self.masks {
                let mask = |kind: &str| {
                    format!(
                        "<{kind}><path>{name}_{kind}.png</path><componentDepth>1</componentDepth><bitDepth>8</bitDepth>\
                         <gammaEmbedded>2.2</gammaEmbedded></{kind}>"
                    )
                };
                files += &(mask("alphaMap") + &mask("betaMap"));
                files += &format!("<correctLUT><path>{name}.cube</path></correctLUT>");
            }
            if let Some(Alpha { bits, gamma }) = self.alpha {
                files += &format!(
                    "<alphaMap><path>{name}_alpha.png</path><componentDepth>1</componentDepth><bitDepth>{bits}</bitDepth>\
                     <gammaEmbedded>{gamma}</gammaEmbedded></alphaMap>"
                );
            }
            files += "</fileSet>";
        }
        format!(
            r#"<?xml version="1.0" encoding="utf-8"?><MPCDI profile="{}" version="{}" date="2026-01-01"><display>{display}</display><files>{files}</files></MPCDI>"#,
            self.profile, self.version
        )
    }

    /// Returns the files of the set.
    pub fn files(&self, projectors: &[Projector]) -> Vec<(String, Vec<u8>)> {
        let mut files = vec![("mpcdi.xml".to_owned(), self.xml(projectors).into_bytes())];
        for (own, projector) in projectors.iter().enumerate() {
            let name = &projector.name;
            files.push((format!("{name}.pfm"), self.map(projector)));
            if let Some(alpha) = self.alpha {
                files.push((format!("{name}_alpha.png"), alpha.map(projectors, own)));
            }
            if self.masks {
                files.push((format!("{name}_alphaMap.png"), png_grey([64, 40], |x, _| (4 * x) as u8)));
                files.push((format!("{name}_betaMap.png"), png_grey([2, 2], |_, y| 10 * y as u8)));
                files.push((format!("{name}.cube"), b"LUT_1D_SIZE 2\n0 0 0\n1 1 0.5\n".to_vec()));
            }
        }
        files
    }

    pub fn bytes(&self, projectors: &[Projector]) -> Vec<u8> {
        let files = self.files(projectors);
        let files: Vec<(&str, Vec<u8>)> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
        zipped(&files, true)
    }
}

/// Returns Paul Bourke's mesh of a fisheye.
pub fn bourke(projector: &Projector, columns: usize, rows: usize, intensity: impl Fn(usize, usize) -> f64) -> String {
    let aspect = f64::from(projector.size_px[0]) / f64::from(projector.size_px[1]);
    let mut text = format!("2\n{columns} {rows}\n");
    // Rows are in the order from bottom to top, as usual in such files.
    for row in (0..rows).rev() {
        for column in 0..columns {
            let (x, y) = (corner(column, columns), corner(row, rows));
            let content = projector.in_fisheye(x, y);
            text += &format!(
                "{:.7} {:.7} {:.7} {:.7} {:.6}\n",
                (2.0 * x - 1.0) * aspect,
                1.0 - 2.0 * y,
                content.x,
                content.y,
                intensity(column, row)
            );
        }
    }
    text
}

/// Returns an OBJ mesh of a picture. Its inner nodes are moved by up to `shift` cells.
pub fn obj(columns: usize, rows: usize, shift: f64, content: impl Fn(f64, f64) -> DVec2) -> String {
    let mut text = "# a mesh\no warp\n".to_owned();
    for row in 0..rows {
        for column in 0..columns {
            let (mut x, y) = (corner(column, columns), corner(row, rows));
            x += shift * (std::f64::consts::PI * x).sin() * (7.0 * y).sin() / columns as f64;
            let content = content(x, y);
            text += &format!("v {:.7} {:.7} 0\nvt {:.7} {:.7}\n", 2.0 * x - 1.0, 1.0 - 2.0 * y, content.x, content.y);
        }
    }
    for row in 1..rows {
        for column in 1..columns {
            let low = (row - 1) * columns + column;
            let high = low + columns;
            text += &format!("f {0}/{0} {1}/{1} {2}/{2} {3}/{3}\n", low, low + 1, high + 1, high);
        }
    }
    text
}

/// Returns a CSV mesh of a picture, with the columns x;y;u;v;column;row. y and v increase downwards.
pub fn csv(columns: usize, rows: usize, content: impl Fn(f64, f64) -> DVec2) -> String {
    let mut text = "x;y;u;v;column;row\n".to_owned();
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = (corner(column, columns), corner(row, rows));
            let content = content(x, y);
            text += &format!("{x:.7};{y:.7};{:.7};{:.7};{column};{row}\n", content.x, 1.0 - content.y);
        }
    }
    text
}

/// Returns an SGC mesh of the projector's frustum.
pub fn sgc(projector: &Projector, columns: usize, rows: usize) -> Vec<u8> {
    let mut bytes = b"SGC\x01".to_vec();
    bytes.extend(0_u32.to_le_bytes());
    let turn = steradian::glam::DQuat::from_mat3(&projector.frustum());
    let head = [turn.x, turn.y, turn.z, turn.w, 0.0, 0.0, 0.0, FRUSTUM_DEG, -FRUSTUM_DEG, -FRUSTUM_DEG, FRUSTUM_DEG];
    bytes.extend(head.iter().flat_map(|value| (*value as f32).to_le_bytes()));
    bytes.extend([columns, rows].iter().flat_map(|count| (*count as u32).to_le_bytes()));
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = (corner(column, columns), corner(row, rows));
            let content = projector.in_frustum(x, y);
            bytes.extend([x, y, 0.0, content.x, content.y, 0.0].iter().flat_map(|value| (*value as f32).to_le_bytes()));
        }
    }
    // The triangle strip goes from the end of a row to the next one by repeated nodes.
    let mut strip: Vec<u32> = Vec::new();
    for row in 1..rows {
        let index = |column: usize, row: usize| (row * columns + column) as u32;
        if row > 1 {
            strip.push(index(0, row - 1));
        }
        strip.extend((0..columns).flat_map(|column| [index(column, row - 1), index(column, row)]));
        strip.push(index(columns - 1, row));
    }
    bytes.extend((strip.len() as u32).to_le_bytes());
    bytes.extend(strip.iter().flat_map(|index| index.to_le_bytes()));
    bytes
}

/// Returns a configuration of SGCT with one viewport, which has this projection and the additional keys `more`.
pub fn sgct(size_px: [u32; 2], projection: &str, more: &str) -> String {
    format!(
        r#"{{"version":1,"masteraddress":"localhost","nodes":[{{"address":"localhost","port":20401,"windows":[{{"size":{{"x":{},"y":{}}},
"viewports":[{{"pos":{{"x":0,"y":0}},"size":{{"x":1,"y":1}},"projection":{projection}{more}}}]}}]}}],
"users":[{{"eyeseparation":0.06,"pos":{{"x":0,"y":0,"z":0}}}}]}}"#,
        size_px[0], size_px[1]
    )
}

/// Returns the projection element of a projector's frustum.
pub fn sgct_frustum(kind: &str, projector: &Projector) -> String {
    let [yaw, pitch] = projector.yaw_pitch_rad.map(f64::to_degrees);
    format!(
        r#"{{"type":"{kind}","fov":{{"hFov":{0},"vFov":{0}}},"orientation":{{"yaw":{yaw},"pitch":{pitch},"roll":0}}}}"#,
        2.0 * FRUSTUM_DEG
    )
}

/// Encodes directions as OpenEXR, with the top row first.
pub fn exr(names: [&str; 3], size: [usize; 2], value: impl Fn(usize, usize) -> [f64; 3]) -> Vec<u8> {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Vec2, WritableImage,
    };
    let [columns, rows] = size;
    let channel = |axis: usize| {
        let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        AnyChannel::new(names[axis], FlatSamples::F32(places.map(|(i, j)| value(i, j)[axis] as f32).collect()))
    };
    let list = (0..3).map(channel).collect();
    let attributes = LayerAttributes::named("directions");
    let layer = Layer::new(Vec2(columns, rows), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(list));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).expect("an OpenEXR file");
    bytes.into_inner()
}
