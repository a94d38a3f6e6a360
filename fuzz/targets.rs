//! Fuzzing entry points: one function per format, from bytes to the program's data. `fuzz_targets/` runs them with
//! libFuzzer, `tests/fuzz` on any toolchain. Each returns the text of the error, or an empty string; runs without
//! coverage use it to recognise new inputs.

use std::{
    fmt::Display,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use steradian::{
    catalogue::{
        deep::{self, DeepStore, composite::Composite, tile::Tile},
        reader, store,
    },
    config::{Config, FilmPath},
    output::film::FilmTracks,
    photometry::{glare::PsfTable, psf},
    scene::{asteroids::ShapeSet, bodies::Texture},
    theatre::{self, ReadOptions},
};

fn answer<T>(result: Result<T, impl Display>) -> String {
    result.err().map(|error| error.to_string()).unwrap_or_default()
}

/// Folder of this process among the system's temporary files.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("steradian-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for inputs");
    std::fs::write(folder.join("data.bin"), [0x3f; 4096]).expect("a buffer next to shapes");
    folder
});

/// Writes the input to a file, for a parser that reads files.
fn file(name: &str, data: &[u8]) -> PathBuf {
    let path = FOLDER.join(name);
    std::fs::write(&path, data).expect("the input is written");
    path
}

/// A configuration, followed by a NUL and overrides, one per line.
pub fn configuration(data: &[u8]) -> String {
    let text = String::from_utf8_lossy(data);
    let (text, overrides) = text.split_once('\0').unwrap_or((&text, ""));
    let overrides: Vec<String> = overrides.lines().map(str::to_owned).collect();
    let read = Config::from_text(text, "fuzz.toml", Path::new("/no/such/folder"), &overrides);
    answer(read.and_then(|config| {
        config.star_sources();
        config.field_specs()?;
        config.camera()?;
        config.frame_groups()
    }))
}

/// The path of a film.
pub fn film_path(data: &[u8]) -> String {
    answer(FilmPath::from_text(&String::from_utf8_lossy(data), "fuzz.toml").map(|path| {
        let tracks = FilmTracks::new(&path);
        for keyframe in path.keyframes.iter().take(8) {
            for frame in [keyframe.frame, keyframe.frame.saturating_sub(1), keyframe.frame.saturating_add(1)] {
                tracks.at(frame);
            }
        }
    }))
}

/// A catalogue in CSV.
pub fn csv(data: &[u8]) -> String {
    answer(reader::read_csv_from(data, "fuzz.csv", 26.0))
}

/// A catalogue in JSON.
pub fn json(data: &[u8]) -> String {
    answer(reader::read_json_from(data, "fuzz.json", 26.0))
}

/// A catalogue in VOTable.
pub fn votable(data: &[u8]) -> String {
    answer(reader::read_votable_from(data, "fuzz.vot", 26.0))
}

/// A catalogue in FITS.
pub fn fits_table(data: &[u8]) -> String {
    answer(reader::read_fits_from(data, "fuzz.fits", 26.0))
}

/// A catalogue in Parquet.
pub fn parquet(data: &[u8]) -> String {
    answer(reader::read_parquet_from(data.to_vec(), "fuzz.parquet", 26.0))
}

/// A store of stars.
pub fn star_store(data: &[u8]) -> String {
    answer(store::read(&file("fuzz.stars", data)).map(|store| store.named(&store.records(100.0))))
}

/// Folder of a deep store whose files of leaves and tiles are empty.
static DEEP_FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = FOLDER.join("deep");
    std::fs::create_dir_all(&folder).expect("a folder for a store");
    let leaves = deep::LAYERS.iter().map(|layer| layer.file());
    for name in leaves.chain(deep::PLANES.iter().map(|plane| plane.file())) {
        std::fs::write(folder.join(name), []).expect("an empty file");
    }
    folder
});

/// A deep store: four bytes with the length of its index, the index, and the bright stars. The bright stars are also read as the words of a tile.
pub fn deep_store(data: &[u8]) -> String {
    let Some((length, rest)) = data.split_first_chunk() else { return "no length".to_owned() };
    let (index, bright) = rest.split_at((u32::from_le_bytes(*length) as usize).min(rest.len()));
    let folder = &*DEEP_FOLDER;
    std::fs::write(folder.join("index"), index).expect("the index is written");
    std::fs::write(folder.join("bright"), bright).expect("the bright stars are written");
    let words: Vec<u64> =
        bright.chunks_exact(8).map(|word| u64::from_le_bytes(word.try_into().expect("8 bytes"))).collect();
    for order in 6..=12 {
        let tile = Tile::from_words(order, &words).unwrap_or_default();
        assert!(
            tile.bits.iter().all(|bits| Composite::from_bits(*bits).light_lx.iter().all(|light| light.is_finite()))
        );
    }
    answer(DeepStore::open(folder).and_then(|store| {
        store.leaf(0, 7)?;
        store.tile(0, 7)?;
        store.bright().map(|bright| bright.named(&bright.records(16.0)))
    }))
}

/// A shape in glTF, as text or with a binary part, and its buffers.
pub fn gltf(data: &[u8]) -> String {
    answer(ShapeSet::from_gltf(&[file("fuzz.glb", data)]))
}

/// A point-spread function: FITS or OpenEXR, recognised by their first bytes.
pub fn point_spread(data: &[u8]) -> String {
    answer(psf::read_as_wide(&file("fuzz.psf", data), 0.01))
}

/// A texture: PNG.
pub fn texture(data: &[u8]) -> String {
    answer(Texture::from_png(&file("fuzz.png", data)))
}

/// A table of glare in CSV, and its kernel.
pub fn glare_table(data: &[u8]) -> String {
    let path = file("glare.csv", data);
    answer(PsfTable::read(&path).and_then(|table| table.kernel(1e-3)))
}

/// A calibration of projectors in any format. In a configuration of SGCT, a NUL is followed by the mesh that the text names `mesh.bin`.
pub fn theatre(data: &[u8]) -> String {
    let mut data = data;
    if data.starts_with(b"{")
        && let Some(end) = data.iter().position(|byte| *byte == 0)
    {
        file("mesh.bin", &data[end + 1..]);
        data = &data[..end];
    }
    let mut options = ReadOptions::default();
    let path = file("fuzz.theatre", data);
    let alone = answer(theatre::read(&path, &options));
    if !alone.contains("size_px") {
        return alone;
    }
    options.size_px = Some([64, 48]);
    answer(theatre::read(&path, &options))
}
