//! Identifies a monitor by its EDID. Source: VESA Enhanced EDID Standard, release A, revision 2, section 3.

/// Length of a block, bytes.
const BLOCK: usize = 128;
/// First bytes of every EDID.
const HEADER: [u8; 8] = [0, 255, 255, 255, 255, 255, 255, 0];
/// Offsets of the four descriptors, and their length, bytes.
const DESCRIPTORS: [usize; 4] = [54, 72, 90, 108];
const DESCRIPTOR: usize = 18;
/// Types of descriptors that contain text: product name and serial number.
const TEXTS: [u8; 2] = [0xfc, 0xff];

/// Returns the names of a monitor: `VENDOR-PRODUCT-SERIAL` with four and eight hexadecimal digits, then its name and
/// its serial number as text, if present. Empty if the bytes are not an EDID.
pub(super) fn names(edid: &[u8]) -> Vec<String> {
    if edid.len() < BLOCK || edid[..8] != HEADER {
        return Vec::new();
    }
    let vendor = u16::from_be_bytes([edid[8], edid[9]]);
    let letter = |shift: u32| char::from(b'A' + (((vendor >> shift) & 31) as u8).saturating_sub(1).min(25));
    let vendor: String = [10, 5, 0].map(letter).iter().collect();
    let product = u16::from_le_bytes([edid[10], edid[11]]);
    let serial = u32::from_le_bytes([edid[12], edid[13], edid[14], edid[15]]);
    let mut names = vec![format!("{vendor}-{product:04X}-{serial:08X}")];
    for kind in TEXTS {
        let of_kind = DESCRIPTORS.iter().map(|start| &edid[*start..start + DESCRIPTOR]);
        for descriptor in of_kind.filter(|bytes| bytes[..3] == [0; 3] && bytes[3] == kind) {
            let text = String::from_utf8_lossy(&descriptor[5..]);
            let text = text.split('\n').next().unwrap_or_default().trim();
            if !text.is_empty() {
                names.push(text.to_owned());
            }
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vendor_product_serial_and_texts_are_parsed() {
        let mut edid = [0_u8; BLOCK];
        edid[..8].copy_from_slice(&HEADER);
        // The letters D, E and L are stored as 4, 5 and 12, in five bits each.
        edid[8..10].copy_from_slice(&((4_u16 << 10) | (5 << 5) | 12).to_be_bytes());
        edid[10..12].copy_from_slice(&0x40f1_u16.to_le_bytes());
        edid[12..16].copy_from_slice(&0x123_u32.to_le_bytes());
        edid[72..72 + 5].copy_from_slice(&[0, 0, 0, 0xff, 0]);
        edid[77..77 + 8].copy_from_slice(b"SN 0815\n");
        edid[90..90 + 5].copy_from_slice(&[0, 0, 0, 0xfc, 0]);
        edid[95..95 + 13].copy_from_slice(b"DELL U2720Q\n ");
        assert_eq!(names(&edid), ["DEL-40F1-00000123", "DELL U2720Q", "SN 0815"]);
        assert!(names(&edid[..100]).is_empty());
        edid[0] = 1;
        assert!(names(&edid).is_empty());
    }
}
