//! The masks and look-up tables of an MPCDI set.

use super::{Mask, Reader, archive::Archive, fault::Fault, lut, mask, xml::Element};

impl Reader<'_> {
    /// Reads the entry that the description names.
    pub(super) fn entry(&mut self, path: &str, archive: &mut Archive) -> Result<Vec<u8>, Fault> {
        let name = archive.entry(path, &archive.described)?;
        if name != path {
            self.note(format!("`{}` is the entry `{}` of the archive", path.escape_debug(), name.escape_debug()));
        }
        archive.bytes(&name)
    }

    pub(super) fn mask(
        &mut self,
        kind: &str,
        size_px: [u32; 2],
        fileset: &Element,
        archive: &mut Archive,
    ) -> Result<Option<Mask>, Fault> {
        let Some(element) = named_file(fileset, kind)? else { return Ok(None) };
        let gamma = match element.child_text("gammaEmbedded")? {
            Some(_) => element.number("gammaEmbedded")?,
            None => {
                self.note(format!("{kind}: no gammaEmbedded; linear is assumed"));
                1.0
            }
        };
        let path = element.needed("path")?.text();
        let place = format!("entry `{}`", path.escape_debug());
        let bytes = self.entry(&path, archive)?;
        let take = &mut |width, height| self.take_mask(width, height, "size");
        let decoded = mask::decode(&bytes, gamma, take).map_err(|fault| fault.within(&place))?;
        for (field, found) in [("componentDepth", decoded.components), ("bitDepth", decoded.bits)] {
            if element.child(field)?.is_some() {
                let declared = element.number(field)?;
                if declared != f64::from(found) {
                    let problem = format!("{field} = {declared}, but the picture has {found}");
                    return Err(Fault::new(&element.place, problem, "both must agree"));
                }
            }
        }
        if decoded.from_alpha {
            self.note(format!("{place}: its alpha channel is the mask"));
        }
        if decoded.coloured {
            self.note(format!("{place}: it is coloured; only its luminance is used"));
        }
        self.note_shape(&place, &decoded.mask, size_px);
        if kind == "alphaMap" {
            self.note_black(&place, &decoded.mask);
        }
        Ok(Some(decoded.mask))
    }

    pub(super) fn table(
        &mut self,
        name: &str,
        fileset: &Element,
        archive: &mut Archive,
    ) -> Result<Option<lut::Lut>, Fault> {
        let mut found = None;
        // The look-up table that corrects the projector's colours takes precedence over tables that change the encoding.
        for kind in ["correctLUT", "colorCorrectLUT", "encodeLUT", "decodeLUT"] {
            let Some(element) = named_file(fileset, kind)? else { continue };
            if found.is_some() {
                self.note(format!("region {name}: {kind} is not applied because there is another table"));
                continue;
            }
            let path = element.needed("path")?.text();
            let bytes = self.entry(&path, archive)?;
            let place = format!("entry `{}`", path.escape_debug());
            found = Some(lut::decode(&bytes).map_err(|fault| fault.within(&place))?);
            self.note(format!("region {name}: look-up table of {kind}"));
        }
        Ok(found)
    }
}

/// Returns a child of a set of files if it names a file. Some programs write every element, with an empty path if there is no file.
pub(super) fn named_file<'a, 'input>(
    fileset: &Element<'a, 'input>,
    name: &str,
) -> Result<Option<Element<'a, 'input>>, Fault> {
    let Some(element) = fileset.child(name)? else { return Ok(None) };
    Ok(if element.child_text("path")?.as_deref() == Some("") { None } else { Some(element) })
}
