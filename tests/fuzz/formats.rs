//! Makes files of formats, and makes their checksums and lengths right again after a mutation, so that what is behind these checks is reached.

/// The four bytes of a little-endian number.
fn put(bytes: &mut [u8], at: usize, value: u32) {
    if let Some(place) = bytes.get_mut(at..at + 4) {
        place.copy_from_slice(&value.to_le_bytes());
    }
}

fn number(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?))
}

/// A store has the length that its header tells, and a CRC-32 from the version on.
pub fn repair_store(bytes: &mut Vec<u8>) {
    let length = || {
        let [chunks, stars, text] = [number(bytes, 16)?, number(bytes, 24)?, number(bytes, 32)?];
        let text = text.checked_next_multiple_of(16)?;
        chunks.checked_mul(112)?.checked_add(stars.checked_mul(16)?)?.checked_add(text)?.checked_add(64)
    };
    if let Some(length) = length().filter(|length| *length < 1 << 17) {
        bytes.resize(length as usize, 0);
    }
    if bytes.len() > 12 {
        let sum = crc32fast::hash(&bytes[12..]);
        put(bytes, 8, sum);
    }
}

/// A PNG's chunks have a CRC-32 each.
pub fn repair_png(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes(length.try_into().unwrap()) as usize;
        let end = at + 8 + length;
        if end + 4 > bytes.len() {
            return;
        }
        let sum = crc32fast::hash(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}

/// A .glb file tells its length and that of its text, which ends where its binary part begins.
pub fn repair_glb(bytes: &mut [u8]) {
    if !bytes.starts_with(b"glTF") {
        return;
    }
    let length = bytes.len() as u32;
    put(bytes, 8, length);
    if let Some(binary) = bytes.windows(4).position(|four| four == b"BIN\0").filter(|at| *at >= 24) {
        put(bytes, 12, (binary - 24) as u32);
        put(bytes, binary - 4, length - binary as u32 - 4);
    }
}

/// A .glb file of a text and a binary part.
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

/// A FITS unit: cards, padded, then data, padded.
pub fn fits_unit(cards: &[&str], data: &[u8]) -> Vec<u8> {
    let mut bytes: Vec<u8> = cards.iter().chain(&["END"]).flat_map(|card| format!("{card:<80}").into_bytes()).collect();
    bytes.resize(bytes.len().next_multiple_of(2880), b' ');
    bytes.extend_from_slice(data);
    bytes.resize(bytes.len().next_multiple_of(2880), 0);
    bytes
}

/// The entries of a ZIP, taken from their own headers and stored anew with lengths and CRC-32; PNGs within are repaired too.
pub fn repair_zip(bytes: &mut Vec<u8>) {
    let starts: Vec<usize> =
        bytes.windows(4).enumerate().filter(|(_, four)| *four == b"PK\x03\x04").map(|(at, _)| at).collect();
    let end = bytes.windows(4).position(|four| four == b"PK\x01\x02").unwrap_or(bytes.len());
    if starts.first() != Some(&0) {
        return;
    }
    let short = |at: usize| Some(usize::from(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?)));
    let mut whole: Vec<u8> = Vec::new();
    let mut directory: Vec<u8> = Vec::new();
    let mut entries = 0_u16;
    for (i, at) in starts.iter().enumerate() {
        let next = starts.get(i + 1).copied().unwrap_or(end);
        let (Some(name), Some(extra)) = (short(at + 26), short(at + 28)) else { return };
        let Some(data) = bytes.get(at + 30 + name + extra..next) else { return };
        let mut data = data.to_vec();
        if data.starts_with(b"\x89PNG") {
            repair_png(&mut data);
        }
        let name = &bytes[at + 30..at + 30 + name];
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
