//! Names of stars: proper names, designations by Bayer and Flamsteed, and catalogue numbers, in the forms that people write.

use std::borrow::Cow;

use unicode_normalization::UnicodeNormalization;

use super::{StarRecord, constellations::CONSTELLATIONS};

/// Greek letters: abbreviation of the IAU as in the built-in table, name, and character.
const GREEK: [(&str, &str, char); 24] = [
    ("alf", "alpha", 'α'),
    ("bet", "beta", 'β'),
    ("gam", "gamma", 'γ'),
    ("del", "delta", 'δ'),
    ("eps", "epsilon", 'ε'),
    ("zet", "zeta", 'ζ'),
    ("eta", "eta", 'η'),
    ("tet", "theta", 'θ'),
    ("iot", "iota", 'ι'),
    ("kap", "kappa", 'κ'),
    ("lam", "lambda", 'λ'),
    ("mu", "mu", 'μ'),
    ("nu", "nu", 'ν'),
    ("ksi", "xi", 'ξ'),
    ("omi", "omicron", 'ο'),
    ("pi", "pi", 'π'),
    ("rho", "rho", 'ρ'),
    ("sig", "sigma", 'σ'),
    ("tau", "tau", 'τ'),
    ("ups", "upsilon", 'υ'),
    ("phi", "phi", 'φ'),
    ("chi", "chi", 'χ'),
    ("psi", "psi", 'ψ'),
    ("ome", "omega", 'ω'),
];
/// Other spellings of Greek letters in catalogues.
const OTHER_GREEK: [(&str, &str); 7] =
    [("alp", "alf"), ("the", "tet"), ("xi", "ksi"), ("mu.", "mu"), ("nu.", "nu"), ("pi.", "pi"), ("ksi.", "ksi")];

/// Genitives of constellations, as in "Alpha Canis Majoris", with their abbreviations.
const GENITIVES: [(&str, &str); 88] = [
    ("And", "Andromedae"),
    ("Ant", "Antliae"),
    ("Aps", "Apodis"),
    ("Aqr", "Aquarii"),
    ("Aql", "Aquilae"),
    ("Ara", "Arae"),
    ("Ari", "Arietis"),
    ("Aur", "Aurigae"),
    ("Boo", "Bootis"),
    ("Cae", "Caeli"),
    ("Cam", "Camelopardalis"),
    ("Cnc", "Cancri"),
    ("CVn", "Canum Venaticorum"),
    ("CMa", "Canis Majoris"),
    ("CMi", "Canis Minoris"),
    ("Cap", "Capricorni"),
    ("Car", "Carinae"),
    ("Cas", "Cassiopeiae"),
    ("Cen", "Centauri"),
    ("Cep", "Cephei"),
    ("Cet", "Ceti"),
    ("Cha", "Chamaeleontis"),
    ("Cir", "Circini"),
    ("Col", "Columbae"),
    ("Com", "Comae Berenices"),
    ("CrA", "Coronae Australis"),
    ("CrB", "Coronae Borealis"),
    ("Crv", "Corvi"),
    ("Crt", "Crateris"),
    ("Cru", "Crucis"),
    ("Cyg", "Cygni"),
    ("Del", "Delphini"),
    ("Dor", "Doradus"),
    ("Dra", "Draconis"),
    ("Equ", "Equulei"),
    ("Eri", "Eridani"),
    ("For", "Fornacis"),
    ("Gem", "Geminorum"),
    ("Gru", "Gruis"),
    ("Her", "Herculis"),
    ("Hor", "Horologii"),
    ("Hya", "Hydrae"),
    ("Hyi", "Hydri"),
    ("Ind", "Indi"),
    ("Lac", "Lacertae"),
    ("Leo", "Leonis"),
    ("LMi", "Leonis Minoris"),
    ("Lep", "Leporis"),
    ("Lib", "Librae"),
    ("Lup", "Lupi"),
    ("Lyn", "Lyncis"),
    ("Lyr", "Lyrae"),
    ("Men", "Mensae"),
    ("Mic", "Microscopii"),
    ("Mon", "Monocerotis"),
    ("Mus", "Muscae"),
    ("Nor", "Normae"),
    ("Oct", "Octantis"),
    ("Oph", "Ophiuchi"),
    ("Ori", "Orionis"),
    ("Pav", "Pavonis"),
    ("Peg", "Pegasi"),
    ("Per", "Persei"),
    ("Phe", "Phoenicis"),
    ("Pic", "Pictoris"),
    ("Psc", "Piscium"),
    ("PsA", "Piscis Austrini"),
    ("Pup", "Puppis"),
    ("Pyx", "Pyxidis"),
    ("Ret", "Reticuli"),
    ("Sge", "Sagittae"),
    ("Sgr", "Sagittarii"),
    ("Sco", "Scorpii"),
    ("Scl", "Sculptoris"),
    ("Sct", "Scuti"),
    ("Ser", "Serpentis"),
    ("Sex", "Sextantis"),
    ("Tau", "Tauri"),
    ("Tel", "Telescopii"),
    ("Tri", "Trianguli"),
    ("TrA", "Trianguli Australis"),
    ("Tuc", "Tucanae"),
    ("UMa", "Ursae Majoris"),
    ("UMi", "Ursae Minoris"),
    ("Vel", "Velorum"),
    ("Vir", "Virginis"),
    ("Vol", "Volantis"),
    ("Vul", "Vulpeculae"),
];

/// Catalogues whose numbers are names of stars. Each entry has the prefix that people write, in lower case without blanks, and the name of the
/// catalogue. Gaia's EDR3 and DR3 have the same numbers; those of DR2 differ for some stars.
const NUMBERED: [(&str, &str); 7] = [
    ("hr", "HR"),
    ("hip", "HIP"),
    ("hd", "HD"),
    ("gaiadr3", "Gaia DR3"),
    ("gaiaedr3", "Gaia DR3"),
    ("gaiadr2", "Gaia DR2"),
    ("gaia", "Gaia"),
];
/// Apostrophes that people and programs write instead of the straight one.
const APOSTROPHES: [char; 3] = ['\u{2019}', '\u{2018}', '\u{2bc}'];

/// Names of a star from a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StarNames {
    /// Proper name; empty if it has none.
    pub name: String,
    /// Designations, such as `alf CMa` and `HIP 32349`, the most usual one first.
    pub designations: Vec<String>,
}

/// Names of a star in a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamesOfStar {
    /// Index of the star.
    pub star: u32,
    /// Its names.
    pub names: StarNames,
}

/// A star with its names.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedStar {
    /// Proper name; empty if it has none.
    pub name: Cow<'static, str>,
    /// Its most usual designation, such as `alf CMa`; may be empty.
    pub designation: Cow<'static, str>,
    /// Its other designations, such as `HR 2491`.
    pub others: Vec<Cow<'static, str>>,
    /// Position, brightness and temperature.
    pub star: StarRecord,
}

impl NamedStar {
    /// Creates a star of a file with its names.
    pub fn from_file(names: StarNames, star: StarRecord) -> Self {
        let mut designations = names.designations.into_iter().map(Cow::Owned);
        let designation = designations.next().unwrap_or_default();
        Self { name: names.name.into(), designation, others: designations.collect(), star }
    }

    /// All its names and designations.
    fn all(&self) -> impl Iterator<Item = &str> {
        [&self.name, &self.designation]
            .into_iter()
            .chain(&self.others)
            .map(AsRef::as_ref)
            .filter(|name| !name.is_empty())
    }
}

/// Returns the abbreviation of a constellation in lower case. `words` is its abbreviation, name or genitive, in lower case.
fn constellation(words: &str) -> Option<String> {
    let named = CONSTELLATIONS
        .iter()
        .find(|(short, full)| short.eq_ignore_ascii_case(words) || full.eq_ignore_ascii_case(words));
    let genitive = || GENITIVES.iter().find(|(_, genitive)| genitive.eq_ignore_ascii_case(words));
    named.or_else(genitive).map(|(short, _)| short.to_lowercase())
}

/// Returns the Greek letter and the index from the first word of a designation, such as `zet` and `1` from `zeta1`, `ζ1` or `zet-1`. `word` must be
/// in the form of [`plain`].
fn greek(word: &str) -> Option<(&'static str, String)> {
    let digits: String = word.chars().filter(char::is_ascii_digit).collect();
    let digits = digits.trim_start_matches('0').to_owned();
    let letter: String = word.chars().filter(|c| !c.is_ascii_digit() && *c != '-').collect();
    let other = OTHER_GREEK.iter().find(|(known, _)| *known == letter).map(|(_, short)| *short);
    let known = GREEK
        .iter()
        .find(|(short, full, character)| *short == letter || *full == letter || letter.chars().eq([*character]));
    other.or(known.map(|(short, ..)| *short)).map(|short| (short, digits))
}

/// Returns a name in lower case, with straight apostrophes, without accents, and with the usual form of each letter and digit: `µ`, `ϕ` and `¹`
/// become `μ`, `φ` and `1` (Unicode's compatibility decomposition).
fn plain(name: &str) -> String {
    // Combining marks of other scripts do not count as accents.
    let is_accent = |c: &char| ('\u{300}'..='\u{36f}').contains(c);
    let bare: String = name.nfkd().filter(|c| !is_accent(c)).collect();
    bare.to_lowercase().replace(APOSTROPHES, "'")
}

/// Whether two names are the same except for the case of letters and the form of apostrophes.
pub fn is_same(name: &str, other: &str) -> bool {
    plain(name) == plain(other)
}

/// Returns the catalogue and the number from a name such as `HR 2491`, `hr2491` or `Gaia DR3 4472832130942575872`; `None` for other names.
fn numbered(name: &str) -> Option<(&'static str, String)> {
    let joined: String = plain(name).split_whitespace().collect();
    NUMBERED.iter().find_map(|(written, catalogue)| {
        let number = joined.strip_prefix(*written)?;
        let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| (*catalogue, number.to_owned()))
    })
}

/// Returns the catalogues whose numbers may mean the same star: a number of Gaia without its release may belong to any release.
fn other_releases(catalogue: &str) -> &'static [&'static str] {
    match catalogue {
        "Gaia" => &["Gaia DR3", "Gaia DR2"],
        "Gaia DR3" | "Gaia DR2" => &["Gaia"],
        _ => &[],
    }
}

/// Returns a name in the form in which names are compared: in lower case, with single blanks, and with abbreviated Greek letters and constellations.
/// Catalogue numbers have the form `HR 2491`.
fn canonical(name: &str) -> String {
    if let Some((catalogue, number)) = numbered(name) {
        return format!("{catalogue} {number}");
    }
    let lower = plain(name);
    let words: Vec<&str> = lower.split_whitespace().collect();
    let Some((first, rest)) = words.split_first() else { return String::new() };
    // The component of a double star may follow, as in `alf Cen A`.
    let (named, component) = match rest.split_last() {
        Some((component, before)) if component.len() == 1 && constellation(&before.join(" ")).is_some() => {
            (before, format!(" {component}"))
        }
        _ => (rest, String::new()),
    };
    let Some(constellation) = constellation(&named.join(" ")) else { return words.join(" ") };
    match greek(first) {
        Some((letter, digits)) => format!("{letter}{digits} {constellation}{component}"),
        None => format!("{first} {constellation}{component}"),
    }
}

/// Returns the designation by Bayer or Flamsteed from the form in HYG, such as `9Alp CMa`, `Alp-1 Cru` or `61 Cyg`. The letter is preferred to the
/// number.
pub(super) fn of_hyg(text: &str) -> Option<String> {
    let mut words = text.split_whitespace();
    let (first, constellation_name) = (words.next()?, words.next_back()?);
    let (short, _) = CONSTELLATIONS.iter().find(|(short, _)| short.eq_ignore_ascii_case(constellation_name))?;
    let middle: String = words.collect();
    let joined = plain(&format!("{first}{middle}"));
    let after_number = joined.trim_start_matches(|c: char| c.is_ascii_digit());
    if after_number.is_empty() {
        return Some(format!("{joined} {short}"));
    }
    greek(after_number).map(|(letter, digits)| format!("{letter}{digits} {short}"))
}

/// A shared letter may mean any of the stars that are fainter than the brightest of them by less than this.
const ALIKE_MAG: f64 = 0.5;

/// Returns another designation of the star with a canonical designation. A letter with an index may mean a component: `alf1 Cen` is `alf Cen A`. The
/// first component of a double star is often catalogued without its letter: `70 Oph A` is `70 Oph`.
fn others_of(wanted: &str) -> Option<String> {
    let (first, rest) = wanted.split_once(' ')?;
    let bare = first.trim_end_matches(|c: char| c.is_ascii_digit());
    if let (true, Some(index)) = (GREEK.iter().any(|(short, ..)| *short == bare), first.strip_prefix(bare)) {
        let component = index.parse::<u8>().ok().filter(|index| (1..=4).contains(index))?;
        return (!rest.contains(' ')).then(|| format!("{bare} {rest} {}", char::from(b'a' + component - 1)));
    }
    rest.strip_suffix(" a").map(|constellation| format!("{first} {constellation}"))
}

/// Returns the star with a name or designation in a form that people write: `Sirius`, `alf CMa`, `α CMa`, `Alpha Canis Majoris`, `R Leo`, `HR 2491`.
/// A number of Gaia without its release is searched in every release, DR3 first. A Greek letter or a number without an index or a component also
/// finds the stars that have it with one: it means the brightest of them, or the first of several stars of similar brightness: `gam Vel` is `gam2
/// Vel`, `alf Cen` is `alf Cen A`, `61 Cyg` is `61 Cyg A`.
pub fn find<'a>(stars: impl Iterator<Item = &'a NamedStar> + Clone, name: &str) -> Option<&'a NamedStar> {
    let wanted = canonical(name);
    let called = |wanted: &str| stars.clone().find(|star| star.all().any(|known| canonical(known) == wanted));
    let of_other_release = || {
        let (catalogue, number) = numbered(name)?;
        other_releases(catalogue).iter().find_map(|other| called(&format!("{other} {number}")))
    };
    let of_component = || called(&others_of(&wanted)?);
    called(&wanted).or_else(of_other_release).or_else(of_component).or_else(|| {
        let (letter, constellation) = wanted.split_once(' ')?;
        let bare = letter.trim_end_matches(|c: char| c.is_ascii_digit());
        if !bare.is_empty() {
            GREEK.iter().find(|(short, ..)| *short == bare)?;
        }
        let has_letter = |known: &str| {
            let known = canonical(known);
            let Some((with_index, rest)) = known.split_once(' ') else { return false };
            let index = with_index.strip_prefix(letter);
            let component = rest.strip_prefix(constellation).map(str::trim_start);
            // Digits that follow a number make it another number.
            index.is_some_and(|index| {
                index.is_empty() || (!bare.is_empty() && index.chars().all(|c| c.is_ascii_digit()))
            }) && component.is_some_and(|component| component.chars().count() <= 1)
        };
        let mut alike: Vec<&NamedStar> = stars.clone().filter(|star| star.all().any(has_letter)).collect();
        let magnitude = |star: &NamedStar| star.star.apparent_magnitude();
        let brightest = alike.iter().map(|star| magnitude(star)).fold(f64::INFINITY, f64::min);
        alike.retain(|star| magnitude(star) < brightest + ALIKE_MAG);
        alike.into_iter().min_by_key(|star| star.all().map(canonical).find(|known| has_letter(known)))
    })
}

/// Explains why no star was found for a name that is a catalogue number, such as `HIP 32349`; `None` for other names.
pub fn why_no_number<'a>(mut stars: impl Iterator<Item = &'a NamedStar>, name: &str) -> Option<String> {
    let (catalogue, _) = numbered(name)?;
    let is_in =
        |known: &str| numbered(known).is_some_and(|(of, _)| of == catalogue || other_releases(catalogue).contains(&of));
    Some(if stars.any(|star| star.all().any(is_in)) {
        format!("no star of the scene has this {catalogue} number")
    } else {
        format!(
            "the stars of the scene have no {catalogue} numbers: builtin:bright has proper names, Bayer letters or else Flamsteed numbers, some \
             designations of variable stars, and HR numbers; files have the numbers in their columns"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::bright::{MIRA_VARIABLES, named_bright_stars};

    #[test]
    fn stars_are_found_as_people_write_their_names() {
        let stars = named_bright_stars(0.0);
        for (name, designation) in [
            ("HR 2491", "alf CMa"),
            ("hr2491", "alf CMa"),
            ("sirius", "alf CMa"),
            ("α CMa", "alf CMa"),
            ("Alpha Canis Majoris", "alf CMa"),
            ("alp cma", "alf CMa"),
            ("zet UMa", "zet1 UMa"),
            ("ζ¹ UMa", "zet1 UMa"),
            ("zeta1 Ursae Majoris", "zet1 UMa"),
            ("61 Cygni", "61 Cyg"),
            ("theta Ori", "tet1 Ori"),
            ("alpha Centauri", "alf Cen A"),
            ("α Cen", "alf Cen A"),
            ("Alpha Centauri B", "alf Cen B"),
            ("gamma Velorum", "gam2 Vel"),
            ("alpha Librae", "alf2 Lib"),
            ("xi Boo", "ksi Boo"),
            ("\u{b5} Cep", "mu Cep"),
            ("\u{3f5} Ori", "eps Ori"),
            ("\u{3d5}1 Ori", "phi1 Ori"),
            ("\u{3f1} Cas", "rho Cas"),
            ("\u{3d1}1 Ori", "tet1 Ori"),
            ("\u{3b1}\u{b9} Cen", "alf Cen A"),
            ("alf2 Cen", "alf Cen B"),
            ("61 Cyg A", "61 Cyg A"),
            ("61 Cygni B", "61 Cyg B"),
            ("HR 8086", "61 Cyg B"),
            ("70 Oph A", "70 Oph"),
            ("alpha Bo\u{f6}tis", "alf Boo"),
        ] {
            let found = find(stars.iter(), name).unwrap_or_else(|| panic!("{name} is not found"));
            assert!(found.designation.starts_with(designation), "{name}: {}", found.designation);
        }
        for name in ["", "HR", "HR 99999", "alf", "alf Xyz", "HIP", "alf Cen C", "alf9 Cen", "6 Cyg A B", "70 Oph C"] {
            assert!(find(stars.iter(), name).is_none(), "{name}");
        }
    }

    /// Stars of a file with a proper name and a designation each.
    fn of_file(names: &[(&str, &str)]) -> Vec<NamedStar> {
        let any = named_bright_stars(0.0)[0].star;
        let star = |(name, designation): &(&str, &str)| {
            let designations = vec![(*designation).to_owned()];
            NamedStar::from_file(StarNames { name: (*name).to_owned(), designations }, any)
        };
        names.iter().map(star).collect()
    }

    #[test]
    fn numbers_of_gaia_are_found_by_their_release_or_without_one() {
        let stars = of_file(&[
            ("of DR2", "Gaia DR2 4472832130942575872"),
            ("of DR3", "Gaia DR3 4472832130942575872"),
            ("DR2 alone", "Gaia DR2 11"),
            ("DR3 alone", "Gaia DR3 12"),
            ("without a release", "Gaia 13"),
        ]);
        for (name, expected) in [
            ("Gaia DR3 4472832130942575872", "of DR3"),
            ("gaia dr3 4472832130942575872", "of DR3"),
            ("GaiaDR3 4472832130942575872", "of DR3"),
            ("Gaia EDR3 4472832130942575872", "of DR3"),
            ("Gaia DR2 4472832130942575872", "of DR2"),
            ("Gaia 4472832130942575872", "of DR3"),
            ("Gaia 11", "DR2 alone"),
            ("gaia12", "DR3 alone"),
            ("Gaia 13", "without a release"),
            ("Gaia DR2 13", "without a release"),
            ("Gaia DR3 13", "without a release"),
            ("Gaia EDR3 13", "without a release"),
            ("Gaia DR3 11", ""),
            ("Gaia DR2 12", ""),
            ("Gaia DR1 12", ""),
            ("Gaia DR3", ""),
        ] {
            let found = find(stars.iter(), name).map_or("", |star| star.name.as_ref());
            assert_eq!(found, expected, "{name}");
        }
        let why = |stars: &[NamedStar], name: &str| why_no_number(stars.iter(), name).unwrap_or_default();
        assert!(why(&stars, "Gaia DR3 11").contains("has this Gaia DR3 number"));
        assert!(why(&stars[2..3], "Gaia DR3 11").contains("no Gaia DR3 numbers"));
        assert!(why(&stars[2..3], "Gaia 12").contains("has this Gaia number"));
        assert!(why(&stars[4..], "Gaia DR3 11").contains("has this Gaia DR3 number"));
    }

    #[test]
    fn apostrophes_of_any_form_are_the_same() {
        let stars = of_file(&[("Barnard's Star", "HIP 87937"), ("Kapteyn\u{2019}s Star", "HIP 24186")]);
        for name in ["Barnard's Star", "Barnard\u{2019}s Star", "barnard\u{2bc}s star", "BARNARD\u{2018}S  STAR"] {
            assert_eq!(find(stars.iter(), name).map(|star| star.designation.as_ref()), Some("HIP 87937"), "{name}");
        }
        assert_eq!(find(stars.iter(), "Kapteyn's Star").map(|star| star.designation.as_ref()), Some("HIP 24186"));
        assert!(is_same("Barnard\u{2019}s Star", "barnard's star") && !is_same("Barnards Star", "Barnard's Star"));
    }

    #[test]
    fn variable_stars_are_found_by_their_designations() {
        let stars = named_bright_stars(0.0);
        let number = |star: &NamedStar| star.all().find(|name| name.starts_with("HR ")).map(str::to_owned);
        // All variable stars that the documentation of the table names; General Catalogue of Variable Stars 5.1.
        for (name, hr) in [
            ("R Leo", "HR 3882"),
            ("r leonis", "HR 3882"),
            ("R Aql", "HR 7243"),
            ("R Aquilae", "HR 7243"),
            ("chi Cyg", "HR 7564"),
            ("Mira", "HR 681"),
            ("omi Cet", "HR 681"),
            ("Algol", "HR 936"),
            ("bet Per", "HR 936"),
            ("λ Tau", "HR 1239"),
            ("β Lyr", "HR 7106"),
            ("δ Cep", "HR 8571"),
            ("η Aql", "HR 7570"),
            ("ζ Gem", "HR 2650"),
            ("R CrB", "HR 5880"),
            ("T Coronae Borealis", "HR 5958"),
            ("Betelgeuse", "HR 2061"),
        ] {
            let found = find(stars.iter(), name).unwrap_or_else(|| panic!("{name} is not found"));
            assert_eq!(number(found).as_deref(), Some(hr), "{name}");
        }
        // Every Mira variable of the table has another designation than its number.
        for (hr, ..) in MIRA_VARIABLES {
            let found = find(stars.iter(), &format!("HR {hr}")).unwrap_or_else(|| panic!("HR {hr} is not found"));
            assert!(!found.designation.starts_with("HR"), "{}", found.designation);
        }
    }

    #[test]
    fn missing_numbers_name_the_designations_that_exist() {
        let mut stars = named_bright_stars(0.0);
        let why = |stars: &[NamedStar], name: &str| why_no_number(stars.iter(), name).unwrap_or_default();
        assert!(why(&stars, "HIP 32349").contains("no HIP numbers: builtin:bright has proper names"));
        assert!(why(&stars, "hd48915").contains("no HD numbers"));
        assert!(why(&stars, "HR 99999").contains("has this HR number"));
        for name in ["Sirius", "HIP", "HIP x", "hipparcos", "alf CMa"] {
            assert_eq!(why(&stars, name), "", "{name}");
        }
        stars[0].others.push("HIP 25".into());
        assert!(why(&stars, "HIP 32349").contains("has this HIP number"));
    }

    #[test]
    fn designations_of_hyg_have_the_form_of_the_table() {
        for (text, expected) in [
            ("9Alp CMa", "alf CMa"),
            ("9    CMa", "9 CMa"),
            ("Alp1Cen", ""),
            ("  Zet1UMa", ""),
            ("79Zet1 UMa", "zet1 UMa"),
            ("61    Cyg", "61 Cyg"),
            ("The-1 Ori", "tet1 Ori"),
            ("Xi  Boo", "ksi Boo"),
            ("Mu Cep", "mu Cep"),
        ] {
            assert_eq!(of_hyg(text).unwrap_or_default(), expected, "{text}");
        }
    }

    #[test]
    fn every_constellation_has_a_genitive() {
        for (short, _) in CONSTELLATIONS.iter().filter(|(short, _)| !short.starts_with("Ser")) {
            assert!(GENITIVES.iter().any(|(known, _)| known == short), "{short}");
        }
        for (short, genitive) in GENITIVES {
            assert_eq!(constellation(genitive), Some(short.to_lowercase()), "{genitive}");
        }
    }
}
