//! Star catalogues in Apache Parquet: columns of the first level with one number or text each. The file is read one row group at a time.
//!
//! The compression may be none, snappy, gzip or zstd. Parquet does not state units; they follow from the names as in CSV.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use ::parquet::basic::Compression;
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use ::parquet::record::Field;
use ::parquet::schema::types::Type;
use bytes::Bytes;

use super::rows::Reading;
use super::table::{Head, Table};
use super::{CatalogueError, CatalogueRead, RowPlace};

/// Reads a catalogue in Parquet that is in memory; messages call it `file`. Stars are placed `years` Julian years after J2000.0.
///
/// # Errors
/// If the bytes are damaged, if they use an unsupported compression, if the columns are not those of a star catalogue, or if no row is usable.
pub fn read_parquet_from(bytes: Vec<u8>, file: &str, years: f64) -> Result<CatalogueRead, CatalogueError> {
    read(Bytes::from(bytes), file, &years.into())
}

/// Reads a catalogue in Parquet from an open file or from bytes. The crate panics on some damaged files; such a panic is converted to an error.
pub(super) fn read(
    source: impl ChunkReader + 'static,
    file: &str,
    reading: &Reading,
) -> Result<CatalogueRead, CatalogueError> {
    catch_unwind(AssertUnwindSafe(|| read_whole(source, file, reading))).unwrap_or_else(|_| {
        let reason = "not Parquet: the file is damaged".to_owned();
        Err(CatalogueError::Malformed { file: file.to_owned(), place: RowPlace::Head, reason })
    })
}

fn read_whole(
    source: impl ChunkReader + 'static,
    file: &str,
    reading: &Reading,
) -> Result<CatalogueRead, CatalogueError> {
    let malformed =
        |place: RowPlace, reason: String| CatalogueError::Malformed { file: file.to_owned(), place, reason };
    let damaged = |place| move |error: ParquetError| malformed(place, format!("not Parquet: {error}"));
    let reader = SerializedFileReader::new(source).map_err(damaged(RowPlace::Head))?;

    // Columns of the first level with one value.
    let metadata = reader.metadata();
    let fields = metadata.file_metadata().schema().get_fields();
    let (flat, nested): (Vec<&Arc<Type>>, Vec<&Arc<Type>>) = fields.iter().partition(|field| {
        let info = field.get_basic_info();
        let is_repeated = info.has_repetition() && info.repetition() == ::parquet::basic::Repetition::REPEATED;
        field.is_primitive() && !is_repeated
    });
    let mut head = Head::default();
    flat.iter().for_each(|field| head.push(field.name(), "", ""));
    let mut table = Table::new(file, &head, reading)?;
    if !nested.is_empty() {
        let names: Vec<String> = nested.iter().map(|field| super::excerpt(field.name())).collect();
        table.note(format!("columns that do not hold a single number or text: {}", names.join(", ")));
    }
    for column in metadata.row_groups().iter().flat_map(|group| group.columns()) {
        let is_read = column.column_path().parts().len() == 1;
        let compression = column.compression();
        let offsets =
            [column.data_page_offset(), column.dictionary_page_offset().unwrap_or(0), column.compressed_size()];
        if offsets.iter().any(|offset| *offset < 0) {
            return Err(malformed(
                RowPlace::Head,
                "not Parquet: a column begins or ends before the start of the file".to_owned(),
            ));
        }
        if is_read && !is_known(compression) {
            let reason = format!(
                "compressed with {compression}; it must be uncompressed, or compressed with snappy, gzip or zstd"
            );
            return Err(malformed(RowPlace::Head, reason));
        }
    }

    // Rows.
    let projection = Type::group_type_builder(metadata.file_metadata().schema().name())
        .with_fields(flat.into_iter().cloned().collect())
        .build()
        .map_err(damaged(RowPlace::Head))?;
    let mut texts = Vec::with_capacity(head.names.len());
    for row in reader.get_row_iter(Some(projection)).map_err(damaged(RowPlace::Head))? {
        let row = row.map_err(damaged(RowPlace::Row(table.count() + 1)))?;
        texts.clear();
        texts.extend(row.get_column_iter().map(|(_, field)| text(field)));
        table.add(Ok(&texts))?;
    }
    table.finish()
}

const fn is_known(compression: Compression) -> bool {
    matches!(compression, Compression::UNCOMPRESSED | Compression::SNAPPY | Compression::GZIP(_) | Compression::ZSTD(_))
}

/// Returns a value as text that parses to the same number; empty if the value is null.
fn text(field: &Field) -> String {
    match field {
        Field::Null => String::new(),
        Field::Float16(value) => value.to_string(),
        Field::Float(value) => value.to_string(),
        Field::Double(value) => value.to_string(),
        Field::Str(text) => text.clone(),
        Field::Bytes(bytes) => String::from_utf8_lossy(bytes.data()).into_owned(),
        other => other.to_string(),
    }
}
