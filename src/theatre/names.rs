//! Converts names of regions to names that views of a configuration can have: at most 64 ASCII letters, digits, `_` and `-`.

use std::collections::HashSet;

use super::{MOST_REGIONS, Reader, Region};

/// Length to which names are shortened. It leaves room for a number, which is added if two files have the same name.
const MOST_LETTERS: usize = 56;
/// Maximum length of the name of a view.
const MOST_OF_VIEW: usize = 64;

/// Returns the name with characters that views cannot have replaced by `_`.
pub(crate) fn plain(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
    name.chars().map(letter).collect()
}

impl Reader<'_> {
    /// Gives a title to regions whose names are too long for a view or are in another script, and adds notes with the original names.
    pub(super) fn title(&mut self, regions: &mut [Region]) {
        let named = |region: &Region| region.title.as_ref().unwrap_or(&region.name).clone();
        let is_fit = |name: &str| name.is_ascii() && name.len() <= MOST_OF_VIEW;
        let mut used: HashSet<String> =
            regions.iter().map(named).filter(|name| is_fit(name)).map(|name| plain(&name)).collect();
        for region in regions.iter_mut() {
            let whole = named(region);
            if is_fit(&whole) {
                continue;
            }
            let mut short = plain(&whole);
            if !short.contains(|c: char| c.is_ascii_alphanumeric()) {
                // Nothing remains of a name in another script, so use the region's name.
                short = plain(&region.name);
            }
            short.truncate(MOST_LETTERS);
            let numbered = |n: usize| if n == 1 { short.clone() } else { format!("{short}_{n}") };
            // There are more numbers than regions, so an unused name is found.
            let title = (1..=MOST_REGIONS + 1).map(numbered).find(|name| used.insert(name.clone()));
            let Some(title) = title else { continue };
            self.note(format!(
                "the view {title} is `{}` in the file: a view's name has at most {MOST_OF_VIEW} ASCII letters, digits, `_` and `-`",
                whole.escape_debug()
            ));
            region.title = Some(title);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::theatre::{Grid, Interpolation, Placement, ReadOptions};

    fn titles(names: &[(&str, Option<&str>)]) -> (Vec<Option<String>>, Vec<String>) {
        let grid = Grid {
            columns: 2,
            rows: 2,
            samples: Vec::new(),
            placement: Placement::Corners,
            interpolation: Interpolation::Smooth,
        };
        let region = |(name, title): &(&str, Option<&str>)| Region {
            title: title.map(str::to_owned),
            ..Region::of_grid((*name).to_owned(), [2, 2], grid.clone())
        };
        let mut regions: Vec<Region> = names.iter().map(region).collect();
        let options = ReadOptions::default();
        let mut reader = Reader::new(Path::new("set"), &options);
        reader.title(&mut regions);
        (regions.into_iter().map(|region| region.title).collect(), reader.notes)
    }

    #[test]
    fn long_names_are_shortened_and_stay_unique() {
        let long = "x".repeat(70);
        let [first, second] = [1, 2].map(|i| format!("{long}{i}"));
        let (titles, notes) = titles(&[("0/0/0", Some(&first)), (&second, None), ("a/b", Some("Left one"))]);
        let short = "x".repeat(56);
        assert_eq!(titles, [Some(short.clone()), Some(format!("{short}_2")), Some("Left one".to_owned())]);
        assert!(notes.len() == 2 && notes[1].contains(&format!("{short}_2 is `{second}`")), "{notes:?}");
    }

    #[test]
    fn names_in_another_script_are_noted() {
        let names = [("0/0/0", Some("\u{5de6}")), ("0/1/0", Some("\u{53f3}")), ("0/2/0", Some("M\u{fc}nchen 1"))];
        let (titles, notes) = titles(&names);
        assert_eq!(titles.into_iter().flatten().collect::<Vec<_>>(), ["0_0_0", "0_1_0", "M_nchen_1"]);
        assert!(notes.len() == 3 && notes[0].contains("the view 0_0_0 is `\u{5de6}`"), "{notes:?}");
    }
}
