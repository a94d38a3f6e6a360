//! Builds files of several formats, and repairs their checksums and lengths after a mutation, so that inputs pass these
//! checks and reach the code behind them.

use steradian::catalogue::deep::index::root_of;

/// Writes a little-endian number of four bytes.
fn put(bytes: &mut [u8], offset: usize, value: u32) {
    if let Some(place) = bytes.get_mut(offset..offset + 4) {
        place.copy_from_slice(&value.to_le_bytes());
    }
}

fn number(bytes: &[u8], offset: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(offset..offset + 8)?.try_into().ok()?))
}

/// Repairs a star store: the lengths in its header, and the CRC-32 of everything from the version number on.
pub fn repair_store(bytes: &mut Vec<u8>) {
    let length = || {
        let [chunks, stars, text] = [number(bytes, 16)?, number(bytes, 24)?, number(bytes, 32)?];
        let text = text.checked_next_multiple_of(16)?;
        let extra = number(bytes, 40)?.checked_mul(16)?.checked_add(number(bytes, 48)?)?;
        chunks
            .checked_mul(112)?
            .checked_add(stars.checked_mul(16)?)?
            .checked_add(text)?
            .checked_add(64)?
            .checked_add(extra)
    };
    if let Some(length) = length().filter(|length| *length < 1 << 17) {
        bytes.resize(length as usize, 0);
    }
    if bytes.len() > 12 {
        let sum = crc32fast::hash(&bytes[12..]);
        put(bytes, 8, sum);
    }
}

/// Repairs a deep store of the target `deep_store`: the bright stars, their entry in the index, and the root checksum.
pub fn repair_deep_store(bytes: &mut Vec<u8>) {
    let Some(length) = bytes.first_chunk().map(|length| u32::from_le_bytes(*length) as usize) else { return };
    if bytes.len() < 4 + length || length < 128 {
        return;
    }
    let mut bright = bytes.split_off(4 + length);
    repair_store(&mut bright);
    let index = &mut bytes[4..];
    index[64..72].copy_from_slice(&(bright.len() as u64).to_le_bytes());
    if let (Some(crc32), Some(stars)) = (bright.get(8..12), bright.get(24..32)) {
        index[72..80].copy_from_slice(stars);
        index[80..84].copy_from_slice(crc32);
    }
    let root = root_of(index);
    index[16..48].copy_from_slice(&root);
    bytes.extend(bright);
}

/// Repairs the CRC-32 of each chunk of a PNG.
pub fn repair_png(bytes: &mut [u8]) {
    let mut offset = 8;
    while let Some(length) = bytes.get(offset..offset + 4) {
        let length = u32::from_be_bytes(length.try_into().unwrap()) as usize;
        let end = offset + 8 + length;
        if end + 4 > bytes.len() {
            return;
        }
        let sum = crc32fast::hash(&bytes[offset + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        offset = end + 4;
    }
}

/// Repairs the lengths of a .glb file and of its text, which ends where its binary part begins.
pub fn repair_glb(bytes: &mut [u8]) {
    if !bytes.starts_with(b"glTF") {
        return;
    }
    let length = bytes.len() as u32;
    put(bytes, 8, length);
    if let Some(binary) = bytes.windows(4).position(|four| four == b"BIN\0").filter(|offset| *offset >= 24) {
        put(bytes, 12, (binary - 24) as u32);
        put(bytes, binary - 4, length - binary as u32 - 4);
    }
}

/// Builds a .glb file from a text and a binary part.
pub fn glb(text: &str, binary: &[u8]) -> Vec<u8> {
    let mut text = text.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0\0\0\0\0\0\0\0\0JSON".to_vec();
    bytes.extend(text);
    bytes.extend(b"\0\0\0\0BIN\0");
    bytes.extend(binary);
    repair_glb(&mut bytes);
    bytes
}

/// Builds a FITS unit: padded cards, then padded data.
pub fn fits_unit(cards: &[&str], data: &[u8]) -> Vec<u8> {
    let mut bytes: Vec<u8> = cards.iter().chain(&["END"]).flat_map(|card| format!("{card:<80}").into_bytes()).collect();
    bytes.resize(bytes.len().next_multiple_of(2880), b' ');
    bytes.extend_from_slice(data);
    bytes.resize(bytes.len().next_multiple_of(2880), 0);
    bytes
}

/// Rebuilds a ZIP from the entries that its local headers describe, with correct lengths and CRC-32. Also repairs the
/// PNGs in it.
pub fn repair_zip(bytes: &mut Vec<u8>) {
    let starts: Vec<usize> =
        bytes.windows(4).enumerate().filter(|(_, four)| *four == b"PK\x03\x04").map(|(offset, _)| offset).collect();
    let end = bytes.windows(4).position(|four| four == b"PK\x01\x02").unwrap_or(bytes.len());
    if starts.first() != Some(&0) {
        return;
    }
    let short = |offset: usize| Some(usize::from(u16::from_le_bytes(bytes.get(offset..offset + 2)?.try_into().ok()?)));
    let mut whole: Vec<u8> = Vec::new();
    let mut directory: Vec<u8> = Vec::new();
    let mut entries = 0_u16;
    for (i, offset) in starts.iter().enumerate() {
        let next = starts.get(i + 1).copied().unwrap_or(end);
        let (Some(name), Some(extra)) = (short(offset + 26), short(offset + 28)) else { return };
        let Some(data) = bytes.get(offset + 30 + name + extra..next) else { return };
        let mut data = data.to_vec();
        if data.starts_with(b"\x89PNG") {
            repair_png(&mut data);
        }
        let name = &bytes[offset + 30..offset + 30 + name];
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        common.extend(crc32fast::hash(&data).to_le_bytes());
        common.extend([(data.len() as u32).to_le_bytes(); 2].concat());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((whole.len() as u32).to_le_bytes());
        directory.extend(name);
        whole.extend(b"PK\x03\x04");
        whole.extend(common);
        whole.extend(name);
        whole.extend(data);
        entries += 1;
    }
    let start = whole.len() as u32;
    whole.extend(&directory);
    whole.extend(b"PK\x05\x06\0\0\0\0");
    whole.extend([entries.to_le_bytes(); 2].concat());
    whole.extend((directory.len() as u32).to_le_bytes());
    whole.extend(start.to_le_bytes());
    whole.extend([0, 0]);
    *bytes = whole;
}
