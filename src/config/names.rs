//! Names of views, which become names of files.

/// Names that Windows reserves for devices, even if they have an extension.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];

/// Whether Windows reserves a name for a device.
fn is_device(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let is_port = |kind: &str| {
        name.strip_prefix(kind)
            .is_some_and(|number| number.len() == 1 && number.starts_with(|c| ('1'..='9').contains(&c)))
    };
    DEVICES.contains(&name.as_str()) || is_port("com") || is_port("lpt")
}

/// Returns the names that some file systems cannot use for files, or not in one folder with the files of an earlier name. Each result has the index
/// of the name and the reason.
pub(super) fn faults_in_files(names: &[&str]) -> Vec<(usize, String)> {
    let fault = |(index, name): (usize, &&str)| {
        if is_device(name) {
            return Some((
                index,
                "Windows reserves this name for a device: it cannot have a file with this name".to_owned(),
            ));
        }
        let twin = names[..index].iter().position(|before| before.eq_ignore_ascii_case(name))?;
        let problem = format!(
            "differs from views[{twin}] (view `{}`) only in its case: on Windows and macOS, the files of one would replace those of the other",
            names[twin]
        );
        Some((index, problem))
    };
    names.iter().enumerate().filter_map(fault).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_file_systems_confuse_or_refuse_are_found() {
        let found = faults_in_files(&["dome", "Dome", "CON", "lpt1", "lpt0", "com", "console", "com12"]);
        assert_eq!(found.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [1, 2, 3]);
        assert!(found[0].1.contains("views[0] (view `dome`)") && found[1].1.contains("device"), "{found:?}");
        assert_eq!(faults_in_files(&["a", "b", "a1"]), []);
    }
}
