//! Writes SPK kernels for tests.

use steradian::glam::DVec3;

/// Number of 8-byte words in a record of a DAF file.
const RECORD_WORDS: usize = 128;

/// A segment of type 2 (Chebyshev polynomials of the position): one record of degree 1.
pub struct Segment {
    pub target: i32,
    pub centre: i32,
    pub axes: i32,
    /// Centre (TDB, s since J2000.0) and half length (s) of the covered time.
    pub covered_s: [f64; 2],
    /// Position at the centre of the covered time, and its change until the end, km.
    pub place_km: [DVec3; 2],
}

/// Returns the bytes of a kernel. Layout: DAF Required Reading and SPK Required Reading of NAIF.
pub fn kernel(segments: &[Segment]) -> Vec<u8> {
    let mut words: Vec<[u8; 8]> = vec![[0; 8]; 3 * RECORD_WORDS];
    let mut summaries = Vec::new();
    for Segment { target, centre, axes, covered_s: [middle_s, half_s], place_km: [at, slope] } in segments {
        let first = words.len() + 1;
        let values = [
            *middle_s,
            *half_s,
            at.x,
            slope.x,
            at.y,
            slope.y,
            at.z,
            slope.z,
            middle_s - half_s,
            2.0 * half_s,
            8.0,
            1.0,
        ];
        words.extend(values.map(f64::to_le_bytes));
        let ints = [*target, *centre, *axes, 2, first as i32, words.len() as i32];
        summaries.push((middle_s - half_s).to_le_bytes());
        summaries.push((middle_s + half_s).to_le_bytes());
        for pair in ints.chunks(2) {
            let [low, high] = [pair[0].to_le_bytes(), pair[1].to_le_bytes()];
            summaries.push([low, high].concat().try_into().unwrap());
        }
    }
    let free = words.len() as i32 + 1;
    words.resize(words.len().next_multiple_of(RECORD_WORDS), [0; 8]);
    // Next and previous summary record, and number of summaries.
    words[RECORD_WORDS + 2] = (segments.len() as f64).to_le_bytes();
    words[RECORD_WORDS + 3..][..summaries.len()].copy_from_slice(&summaries);
    words[2 * RECORD_WORDS..3 * RECORD_WORDS].fill(*b"        ");
    let mut bytes = words.concat();
    bytes[..8].copy_from_slice(b"DAF/SPK ");
    for (at, value) in [(8, 2_i32), (12, 6), (76, 2), (80, 2), (84, free)] {
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    bytes[16..76].fill(b' ');
    bytes[88..96].copy_from_slice(b"LTL-IEEE");
    bytes[699..727].copy_from_slice(b"FTPSTR:\r:\n:\r\n:\r\0:\x81:\x10\xce:ENDFTP");
    bytes
}
