//! Initial inputs: the files of the repository, and small files of every kind that a parser accepts. Also has the
//! tokens of each format.

use std::{fs, io::Cursor, path::Path};

use base64::{Engine, engine::general_purpose::STANDARD};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    Vec2, WritableImage, f16,
};
use png::{BitDepth, ColorType};
use steradian::catalogue::{
    StarRecord,
    bright::bright_stars,
    deep::build::{Build, BuildOptions, NewStar},
    motion::StarVelocity,
    names::{NamesOfStar, StarNames},
    store::{self, Store},
};

use crate::{
    formats::{fits_unit, glb},
    theatre_sets::{Mpcdi, Pfm, bourke, csv as mesh_csv, exr, obj, projectors, sgc, sgct, sgct_frustum, zipped},
};

/// Reads the files in a folder of the repository that have one of these extensions.
fn files(folder: &str, extensions: &[&str]) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| extensions.iter().any(|known| path.extension().is_some_and(|found| found == *known)))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "{folder} must have files for seeds");
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

pub const KEYS: &[&str] = &[
    "\0",
    "\n",
    "=",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "\"",
    "'",
    "'''",
    ".",
    ",",
    "#",
    "views.0.",
    "scene.catalogues",
    "[[views]]",
    "[[bodies]]",
    "[[asteroid_fields]]",
    "[overlay]",
    "[server]",
    "[exposure]",
    "[glare]",
    "[stars]",
    "type = ",
    "name = ",
    "size = ",
    "fov_deg",
    "cubemap",
    "domemaster",
    "fisheye",
    "stereo",
    "perspective",
    "equirectangular",
    "[1, 2]",
    "nan",
    "inf",
    "1e308",
    "-0.0",
    "1979-05-27T07:32:00Z",
    "galaxy = { stars = 5 }",
    "true",
    "exposure_group = 'a'",
    "ipd_m = ",
    "orientation",
    "position_m",
    "tilt_deg",
];

/// Returns every configuration of the repository, some of them with overrides.
pub fn configurations() -> Vec<Vec<u8>> {
    let mut all = files("configs", &["toml"]);
    let built_in = include_bytes!("../../src/config/built_in.toml");
    let overrides = [
        "exposure.ev100=2\nviews.0.size=[16, 16]\nscene.catalogues.0=my.csv",
        "views.0.fov_deg=210\nglare.method=none\nserver.listen=unix:/run/x\nstars.method=tent",
        "scene.time=2031-01-01T00:00:00Z\nscene.camera.position_m=[1, 2, 3]\nviews=[]",
    ];
    all.extend(overrides.map(|overrides| [&built_in[..], b"\0", overrides.as_bytes()].concat()));
    all.push(built_in.to_vec());
    all
}

/// Returns every film path of the repository, and one with the features that these lack.
pub fn film_paths() -> Vec<Vec<u8>> {
    let mut all = files("paths", &["toml"]);
    let other = "[[keyframes]]\nframe = 3\norientation = [0, 0, 0, 1]\nfov_y_deg = 40\nev100 = -3\neasing = 'linear'\n\
        [[keyframes]]\nframe = 9\ntime = 2026-01-01T00:00:00Z\nmagnitude_limit = 9\nvelocity_c = [0.1, 0, 0]\nfov_y_deg = 4\n";
    all.push(other.as_bytes().to_vec());
    all
}

pub const PATH_KEYS: &[&str] = &[
    "\n",
    "fps",
    "around_m",
    "[[keyframes]]",
    "frame",
    "position_m",
    "look",
    "fov_scale",
    "ev100",
    "easing",
    "1e300",
    "nan",
    "inf",
];

pub const COLUMNS: &[&str] = &[
    ",",
    ";",
    "\t",
    "\n",
    "\r\n",
    "\"",
    "\"\"",
    "#",
    "\u{feff}",
    "ra_deg",
    "dec_deg",
    "v_mag",
    "ra",
    "dec",
    "mag",
    "absmag",
    "b_v",
    "ci",
    "parallax_mas",
    "dist",
    "distance_pc",
    "temperature_k",
    "phot_g_mean_mag",
    "bp_rp",
    "magnitude",
    "temperature",
    "x",
    "y",
    "z",
    "nan",
    "inf",
    "1e308",
    "-1e-320",
    "06 45 08.9",
    "-16:42:58",
    "+90",
    "360",
];

pub fn csv() -> Vec<Vec<u8>> {
    let mut all = files("tests/data/catalogues", &["csv"]);
    let bright = include_bytes!("../../crates/sky/src/catalogue/bright_stars.csv");
    all.push(bright[..bright.len().min(8000)].to_vec());
    all
}

pub const JSON: &[&str] = &[
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "\"",
    "\\",
    "\\u0000",
    "null",
    "true",
    "1e400",
    "\"stars\"",
    "\"ra_deg\"",
    "\"dec_deg\"",
    "\"v_mag\"",
    "\"temperature_k\"",
    "\"parallax_mas\"",
    "\"b_v\"",
    "[[[[[[[[",
    "{\"a\":",
];

pub fn json() -> Vec<Vec<u8>> {
    files("tests/data/catalogues", &["json"])
}

pub const VOTABLE: &[&str] = &[
    "<",
    "/>",
    "</",
    ">",
    "'",
    "<!--",
    "<![CDATA[",
    "]]>",
    "&amp;",
    "&#x41;",
    "VOTABLE",
    "RESOURCE",
    "TABLE",
    "FIELD",
    "VALUES",
    "TABLEDATA",
    "BINARY",
    "BINARY2",
    "STREAM",
    "TR",
    "TD",
    "INFO",
    "name=",
    "datatype=",
    "arraysize=",
    "unit=",
    "ucd=",
    "null=",
    "encoding=",
    "href=",
    "long",
    "double",
    "unicodeChar",
    "bit",
    "*",
    "999999999",
    "2x3*",
    "pos.eq.ra",
    "deg",
    "rad",
];

pub fn votable() -> Vec<Vec<u8>> {
    files("tests/data/catalogues", &["vot"])
}

pub const CARDS: &[&str] = &[
    "XTENSION",
    "BINTABLE",
    "BITPIX",
    "NAXIS",
    "NAXIS1",
    "NAXIS2",
    "PCOUNT",
    "GCOUNT",
    "TFIELDS",
    "TTYPE1",
    "TFORM1",
    "TFORM2",
    "TUNIT1",
    "TSCAL1",
    "TZERO1",
    "TNULL1",
    "TUCD1",
    "ZTABLE",
    "END     ",
    "= ",
    "'D       '",
    "'9999999A'",
    "'1PE(9)'",
    "9223372036854775807",
    "-32768",
    "1E308",
    "T",
    "F",
];

pub fn fits_table() -> Vec<Vec<u8>> {
    files("tests/data/catalogues", &["fits"])
}

pub fn parquet() -> Vec<Vec<u8>> {
    files("tests/data/catalogues", &["parquet"])
}

pub fn star_store() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("seed.stars");
    let store = |stars: usize, description: &str| {
        let records: Vec<StarRecord> = bright_stars(0.0).into_iter().take(stars).collect();
        let velocities = (0..stars.min(3) as u32).map(|star| StarVelocity { star, velocity: [1e-6; 3] }).collect();
        let names = StarNames { name: "Name".into(), designations: vec!["HIP 1".into()] };
        let names = (0..stars.min(2) as u32).map(|star| NamesOfStar { star, names: names.clone() }).collect();
        let store = Store::from_records(description.to_owned(), records, velocities, names);
        store::write(&path, &store).unwrap();
        fs::read(&path).unwrap()
    };
    vec![store(40, "a few"), store(1, ""), store(0, "none at all")]
}

/// Returns deep stores in which all stars are bright.
pub fn deep_store() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let store = |name: &str, stars: usize| {
        let out = folder.path().join(name);
        let options = BuildOptions { out: out.clone(), memory_bytes: 64 << 20, job: name.to_owned(), cells: None };
        let mut build = Build::open(options).unwrap();
        for star in bright_stars(0.0).into_iter().take(stars) {
            build.add(star, NewStar { velocity: Some([1e-6; 3]), ..NewStar::default() }).unwrap();
        }
        build.finish(None, name.to_owned(), &mut |_| ()).unwrap();
        let [index, bright] = ["index", "bright"].map(|file| fs::read(out.join(file)).unwrap());
        [&(index.len() as u32).to_le_bytes()[..], &index, &bright].concat()
    };
    vec![store("one", 1), store("a few", 40)]
}

pub const GLTF: &[&str] = &[
    "{",
    "}",
    "[",
    "]",
    ",",
    "\"nodes\":[",
    "\"children\":[0]",
    "\"mesh\":0",
    "\"count\":",
    "\"byteOffset\":",
    "\"byteLength\":",
    "\"byteStride\":",
    "\"componentType\":5126",
    "\"componentType\":5121",
    "\"type\":\"VEC3\"",
    "\"sparse\":{",
    "\"normalized\":true",
    "\"matrix\":[",
    "\"scale\":[-1,1,1]",
    "\"rotation\":[0,0,0,2]",
    "\"mode\":",
    "\"name\":\"a_LOD1\"",
    "_LOD0",
    "_LOD1",
    "COLOR_0",
    "\"uri\":\"data.bin\"",
    "\"uri\":\"%2e%2e/x\"",
    "data:;base64,",
    "\"extensionsRequired\":[\"x\"]",
    "\"bufferView\":0",
    "BIN\0",
    "JSON",
];

/// Returns the text and the binary part of a tetrahedron in glTF.
fn tetrahedron(uri: &str, extra: &str) -> (String, Vec<u8>) {
    let places: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let corners: [u16; 12] = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
    let mut binary: Vec<u8> = places.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    binary.extend(corners.iter().flat_map(|value| value.to_le_bytes()));
    binary.extend([200; 16]);
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"name":"rock","mesh":0{extra}}},{{"mesh":0,"translation":[3,0,0]}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":2}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
{{"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}},
{{"bufferView":2,"componentType":5121,"normalized":true,"count":4,"type":"VEC4"}}],
"bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":24}},{{"buffer":0,"byteOffset":72,"byteLength":16}}],
"buffers":[{{"byteLength":{}{uri}}}]}}"#,
        binary.len()
    );
    (text, binary)
}

pub fn gltf() -> Vec<Vec<u8>> {
    let packed = |extra: &str| {
        let (text, binary) = tetrahedron("", extra);
        glb(&text, &binary)
    };
    let encoded = STANDARD.encode(tetrahedron("", "").1);
    let embedded = tetrahedron(&format!(r#","uri":"data:application/octet-stream;base64,{encoded}""#), "").0;
    let beside = tetrahedron(r#","uri":"data.bin""#, "").0;
    vec![
        packed(""),
        packed(r#","children":[1]"#),
        packed(r#","matrix":[2,0,0,0,0,2,0,0,0,0,-2,0,1,2,3,1]"#),
        packed(r#","rotation":[0,0,0.7071,0.7071],"scale":[1,2,3]"#),
        embedded.into_bytes(),
        beside.into_bytes(),
    ]
}

pub const PSF: &[&str] = &[
    "SIMPLE  =                    T",
    "NAXIS   =                    2",
    "NAXIS1  =              4096",
    "NAXIS2  =",
    "BITPIX  =",
    "END     ",
    "XTENSION= 'IMAGE   '",
    "XTENSION= 'BINTABLE'",
    "PCOUNT  =",
    "GCOUNT  =",
    "BSCALE  =",
    "BZERO   =",
    "BLANK   =",
    "PIXELSCL=",
    "CDELT1  =",
    "CD1_1   =",
    "CUNIT1  = 'arcsec'",
    "CHECKSUM= '0000000000000000'",
    "DATASUM = '0'",
    "channels\0chlist\0",
    "dataWindow\0box2i\0",
    "compression\0",
    "tiles\0",
    "R\0",
    "pixelScaleArcsec\0",
];

/// Returns OpenEXR files with every compression, block type and sample type.
fn exr_files() -> Vec<Vec<u8>> {
    let size = Vec2(8, 8);
    let values: Vec<f32> = (0..64).map(|i| i as f32).collect();
    let floats = FlatSamples::F32(values.clone());
    let halves = FlatSamples::F16(values.iter().map(|value| f16::from_f32(*value)).collect());
    let whole = FlatSamples::U32((0..64).collect());
    let file = |names: &[&str], samples: &FlatSamples, compression: Compression, blocks: Blocks| {
        let list = names.iter().map(|name| AnyChannel::new(*name, samples.clone())).collect();
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let layer = Layer::new(size, LayerAttributes::named("psf"), encoding, AnyChannels::sort(list));
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    };
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
    ];
    let mut all: Vec<Vec<u8>> =
        compressions.map(|compression| file(&["R", "G", "B"], &floats, compression, Blocks::ScanLines)).into();
    all.push(file(&["Y"], &halves, Compression::B44, Blocks::ScanLines));
    all.push(file(&["Y"], &whole, Compression::PIZ, Blocks::ScanLines));
    all.push(file(&["R", "G", "B"], &halves, Compression::ZIP16, Blocks::Tiles(Vec2(4, 4))));
    all
}

pub fn point_spread() -> Vec<Vec<u8>> {
    let card = |key: &str, value: &str| format!("{key:<8}= {value:>20}");
    let picture = |bitpix: &str, bytes_each: usize, extra: &[String]| {
        let cards = [("SIMPLE", "T"), ("BITPIX", bitpix), ("NAXIS", "2"), ("NAXIS1", "4"), ("NAXIS2", "4")];
        let mut cards: Vec<String> = cards.iter().map(|(key, value)| card(key, value)).collect();
        cards.extend_from_slice(extra);
        let cards: Vec<&str> = cards.iter().map(String::as_str).collect();
        let data: Vec<u8> = (0..16 * bytes_each).map(|i| if i % bytes_each == 1 { i as u8 } else { 0 }).collect();
        fits_unit(&cards, &data)
    };
    let scale = card("PIXELSCL", "0.25");
    let mut all: Vec<Vec<u8>> = [("-32", 4), ("-64", 8), ("8", 1), ("16", 2), ("32", 4), ("64", 8)]
        .map(|(bitpix, bytes_each)| picture(bitpix, bytes_each, std::slice::from_ref(&scale)))
        .into();
    all.push(picture(
        "16",
        2,
        &[
            card("BSCALE", "2.0"),
            card("BZERO", "32768.0"),
            card("BLANK", "7"),
            card("CDELT1", "1D-4"),
            card("CDELT2", "1E-4"),
        ],
    ));
    all.push(picture("-32", 4, &[card("CD1_1", "1e-5"), card("CD2_2", "1e-5"), "CUNIT1  = 'deg'".to_owned()]));
    let empty = fits_unit(&[&card("SIMPLE", "T"), &card("BITPIX", "8"), &card("NAXIS", "0")], &[]);
    let mut image = picture("-32", 4, &[scale]);
    image[..30].copy_from_slice(b"XTENSION= 'IMAGE   '          ");
    all.push([empty, image].concat());
    all.extend(exr_files());
    all
}

pub const PNG: &[&str] =
    &["IHDR", "PLTE", "IDAT", "tRNS", "IEND", "iCCP", "acTL", "fcTL", "fdAT", "zTXt", "sRGB", "gAMA", "\0\0\0\0"];

pub fn textures() -> Vec<Vec<u8>> {
    let file = |colour: ColorType, depth: BitDepth, bytes: &[u8]| {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 4, 4);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        if colour == ColorType::Indexed {
            encoder.set_palette(vec![7; 48]);
        }
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(bytes).unwrap();
        drop(writer);
        file
    };
    vec![
        file(ColorType::Rgb, BitDepth::Eight, &[100; 48]),
        file(ColorType::Grayscale, BitDepth::Eight, &(0..16).collect::<Vec<u8>>()),
        file(ColorType::Grayscale, BitDepth::Two, &[0x1b; 4]),
        file(ColorType::Indexed, BitDepth::Four, &[0x12; 8]),
        file(ColorType::Rgba, BitDepth::Eight, &[100; 64]),
        file(ColorType::Rgb, BitDepth::Sixteen, &[100; 96]),
    ]
}

pub const TABLE: &[&str] =
    &[",", "\n", "\r\n", "#", "\u{feff}", "theta_deg,per_sr", "nan", "inf", "1e308", "180", "-1", "1e-320"];

pub fn glare_table() -> Vec<Vec<u8>> {
    let table = "# measured\ntheta_deg,per_sr\n0.01,1e6\n0.1,1e4\n1,100\n10,1\n90,0.01\n180,0\n";
    vec![table.as_bytes().to_vec(), format!("\u{feff}{}", &table[11..]).replace('\n', "\r\n").into_bytes()]
}

pub const THEATRE: &[&str] = &[
    "\0",
    "\n",
    " ",
    ";",
    "PF\n",
    "-1.0\n",
    "1.0\n",
    "8192 8192\n",
    "PK\x03\x04",
    "mpcdi.xml",
    "../x",
    "profile=\"2d\"",
    "profile=\"a3\"",
    "version=\"1.0\"",
    "<frustum>",
    "<yaw>90</yaw>",
    "<coordinateFrame>",
    "<geometricUnit>mm</geometricUnit>",
    "<originOf3DData>idealEyePoint</originOf3DData>",
    "<interpolation>linear</interpolation>",
    "<gammaEmbedded>1</gammaEmbedded>",
    "<alphaMap>",
    "<![CDATA[",
    "&#65;",
    "<!--",
    "LUT_3D_SIZE 2\n",
    "DOMAIN_MAX 2 2 2\n",
    "\"mesh\":\"mesh.bin\"",
    "\"blendmask\":\"mesh.bin\"",
    "\"type\":\"FisheyeProjection\"",
    "\"type\":\"ProjectionPlane\"",
    "\"type\":\"TextureMappedProjection\"",
    "\"orientation\":{\"x\":0,\"y\":0,\"z\":0,\"w\":1}",
    "\"fov\":{\"hfov\":90,\"vfov\":60}",
    "vt 0 0\n",
    "f 1/1 2/2 3/3\n",
    "SGC\x01",
    "vwf1",
];

/// Returns small sets of one projector in every format. MPCDI sets are stored without compression, so that mutations
/// can change their contents.
pub fn theatre() -> Vec<Vec<u8>> {
    let all = projectors();
    let one = &all[..1];
    let projector = &all[0];
    let set = |set: Mpcdi| {
        let files = set.files(one);
        let files: Vec<(&str, Vec<u8>)> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
        zipped(&files, false)
    };
    let masks = Mpcdi { masks: true, ..Mpcdi::a3(3, 3) };
    let units = Mpcdi {
        version: "1.0",
        warp: "<interpolation>linear</interpolation><geometricUnit>mm</geometricUnit><originOf3DData>floorCenter</originOf3DData>"
            .to_owned(),
        ..Mpcdi::new("sl", 3, 3)
    };
    let direction = |i: usize, j: usize| projector.direction(i as f64 / 3.0, j as f64 / 3.0).to_array();
    let frustum = |x: f64, y: f64| projector.in_frustum(x, y);
    let size = [64, 48];
    let with = |projection: &str, mesh: &[u8]| {
        [sgct(size, projection, r#","mesh":"mesh.bin""#).as_bytes(), b"\0", mesh].concat()
    };
    let planar = sgct_frustum("PlanarProjection", projector);
    let textured = sgct_frustum("TextureMappedProjection", projector);
    let fisheye = r#"{"type":"FisheyeProjection","fov":180,"tilt":20}"#;
    let mesh = bourke(projector, 4, 3, |column, _| column as f64 / 3.0 - 0.1).into_bytes();
    let pfm = Pfm::of(4, 4).bytes(direction);
    vec![
        set(masks),
        set(units),
        set(Mpcdi::new("2d", 3, 3)),
        pfm.clone(),
        Pfm { little_endian: false, ..Pfm::of(4, 4) }.bytes(direction),
        exr(["R", "G", "B"], [4, 4], direction),
        mesh.clone(),
        obj(3, 3, 0.4, frustum).into_bytes(),
        mesh_csv(3, 3, frustum).into_bytes(),
        sgc(projector, 3, 3),
        sgct(size, fisheye, "").into_bytes(),
        with(fisheye, &mesh),
        with(&planar, obj(3, 3, 0.4, frustum).as_bytes()),
        with(&planar, &sgc(projector, 3, 3)),
        with(&textured, &pfm),
        b"LUT_1D_SIZE 2\n0 0 0\n1 1 1\n".to_vec(),
    ]
}
