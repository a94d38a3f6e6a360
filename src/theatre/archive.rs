//! The ZIP archive of an MPCDI set, with limits on the number of entries, their names and their unpacked size.

use std::io::{Cursor, Read};

use zip::ZipArchive;

use super::fault::Fault;

/// Maximum number of entries of an archive.
const MOST_ENTRIES: usize = 4096;
/// Maximum unpacked size of an entry, bytes. It is the size of a map of 8192 x 8192 samples.
const MOST_ENTRY_BYTES: u64 = 1 << 30;
/// Maximum total unpacked size, bytes.
const MOST_UNPACKED_BYTES: u64 = 2 << 30;

const ALLOWED: &str = "an MPCDI set must be a ZIP of at most 4096 files, stored or deflated and not encrypted, without absolute paths or `..`, of \
                       at most 1 GiB each and 2 GiB in total";

pub(super) struct Archive<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    unpacked_left: u64,
    /// Name of the entry with the description. Paths in the description are relative to the folder of this entry.
    pub described: String,
}

/// Normalises a path: `/` between its parts, and no leading `./`.
fn plain(path: &str) -> String {
    let path = path.replace('\\', "/");
    path.strip_prefix("./").unwrap_or(&path).to_owned()
}

/// Splits the name of an entry into its folder (including the last separator) and its own name.
fn parts(entry: &str) -> (&str, &str) {
    entry.split_at(entry.rfind(['/', '\\']).map_or(0, |at| at + 1))
}

impl<'a> Archive<'a> {
    pub fn open(bytes: &'a [u8]) -> Result<Self, Fault> {
        let bad = |problem: String| Fault::new("archive", problem, ALLOWED);
        let zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| bad(format!("not readable ({error})")))?;
        if zip.len() > MOST_ENTRIES {
            return Err(bad(format!("{} entries", zip.len())));
        }
        for name in zip.file_names() {
            let leads_out = name.split(['/', '\\']).any(|part| part == "..");
            let drive = name.as_bytes().get(1) == Some(&b':');
            if name.starts_with(['/', '\\']) || leads_out || drive || name.contains('\0') {
                return Err(bad(format!("the entry `{}`", name.escape_debug())));
            }
        }
        Ok(Self { zip, unpacked_left: MOST_UNPACKED_BYTES, described: String::new() })
    }

    /// Returns the full path of the entry with this file name, ignoring case. The entry is in the root or, if it is not there, in the only folder
    /// that has such an entry.
    pub fn named(&self, name: &str) -> Result<Option<String>, Fault> {
        for in_root in [true, false] {
            let matches = |entry: &str| {
                let (folder, own) = parts(entry);
                own.eq_ignore_ascii_case(name) && folder.is_empty() == in_root
            };
            let mut found = self.zip.file_names().filter(|entry| matches(entry));
            match (found.next(), found.next()) {
                (Some(first), Some(second)) => {
                    let problem = format!("both `{}` and `{}`", first.escape_debug(), second.escape_debug());
                    return Err(Fault::new("archive", problem, format!("there must be only one {name}")));
                }
                (Some(first), None) => return Ok(Some(first.to_owned())),
                (None, _) => {}
            }
        }
        Ok(None)
    }

    /// Returns the entry that a path in the description `described` refers to. The path is relative to the description's folder or to the root;
    /// separators and upper or lower case may differ.
    pub fn entry(&self, path: &str, described: &str) -> Result<String, Fault> {
        let folder = parts(&plain(described)).0.to_owned();
        let path_plain = plain(path);
        for wanted in [path.to_owned(), format!("{folder}{path_plain}"), path_plain.clone()] {
            if self.zip.index_for_name(&wanted).is_some() {
                return Ok(wanted);
            }
        }
        for wanted in [format!("{folder}{path_plain}"), path_plain] {
            let mut found = self.zip.file_names().filter(|entry| plain(entry).eq_ignore_ascii_case(&wanted));
            match (found.next(), found.next()) {
                (Some(first), Some(second)) => {
                    let problem = format!("it is ambiguous: `{}` or `{}`", first.escape_debug(), second.escape_debug());
                    let place = format!("entry `{}`", path.escape_debug());
                    return Err(Fault::new(
                        place,
                        problem,
                        "must be the name of one entry, with the same upper and lower case",
                    ));
                }
                (Some(first), None) => return Ok(first.to_owned()),
                (None, _) => {}
            }
        }
        Ok(path.to_owned())
    }

    /// The content of an entry.
    pub fn bytes(&mut self, name: &str) -> Result<Vec<u8>, Fault> {
        let bad = |problem: String| Fault::new(format!("entry `{}`", name.escape_debug()), problem, ALLOWED);
        let index = self.zip.index_for_name(name).ok_or_else(|| {
            let mut names: Vec<&str> = self.zip.file_names().take(20).collect();
            names.sort_unstable();
            bad(format!("it is missing; the entries are {}", names.join(", ").escape_debug()))
        })?;
        let most = MOST_ENTRY_BYTES.min(self.unpacked_left);
        let mut entry = self.zip.by_index(index).map_err(|error| bad(format!("not readable ({error})")))?;
        let mut bytes = Vec::new();
        // The size in the header cannot be trusted, so the unpacked data are limited here.
        entry
            .by_ref()
            .take(most + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| bad(format!("not readable ({error})")))?;
        if bytes.len() as u64 > most {
            return Err(bad(format!("it unpacks to more than {most} bytes")));
        }
        self.unpacked_left -= bytes.len() as u64;
        Ok(bytes)
    }
}
