//! Report on the rows that an import has read: how many were used or rejected, and why.

use serde::{Deserialize, Serialize};

use super::super::reader::{ReadReport, RejectedKind};

/// An input that was read. Unfinished stores keep it as JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReadInput {
    /// Its rows.
    pub rows: Rows,
    /// Digest, see [`Input`](super::part::Input); empty for a whole store, which does not need one.
    pub digest: String,
}

/// Numbers of rows of an input.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rows {
    /// Name of the recognised source of a table; empty for a store and for the built-in table.
    source: String,
    /// Rows that became stars.
    used: u64,
    /// Number of rows of a table.
    rows: u64,
    /// Kind of problem, number of unusable rows with it, and description of the first such row.
    rejected: Vec<(String, u64, String)>,
    /// Remark, and number of used rows to which it applies.
    remarks: Vec<(String, u64)>,
    /// Columns that are not read although the renderer could use them.
    unused: Vec<String>,
    /// Remarks on the whole file.
    notes: Vec<String>,
}

impl Rows {
    /// Creates the numbers of a store or of the built-in table.
    pub fn of_store(stars: u64) -> Self {
        Self { used: stars, ..Self::default() }
    }

    /// Of a table.
    pub fn of_table(report: ReadReport) -> Self {
        let place = if report.without_lines { "row" } else { "line" };
        let rejected = report.rejected_kinds.iter().map(|RejectedKind { kind, rows, first }| {
            (kind.clone(), *rows as u64, format!("{} {place} {}: {}", report.file, first.line, first.reason))
        });
        let rejected = rejected.collect();
        let remarks = [
            (report.very_bright, "brighter than any star: the Sun, the Moon or a planet?"),
            (report.g_taken_as_v, "without BP-RP: G taken as V"),
            (report.hp_taken_as_v, "without V: Hp taken as V"),
            (report.colour_ignored, "with a colour index outside -1.5 to 8.5: taken as missing"),
            (report.motion_ignored, "with a motion of nines, such as -9999: taken as missing"),
            (report.temperature_clamped, "with a temperature outside 500 to 100000 K: moved to the nearest limit"),
        ];
        let remarks = remarks.into_iter().filter(|(count, _)| *count > 0);
        Self {
            source: report.source.name().to_owned(),
            used: report.used as u64,
            rows: report.rows as u64,
            rejected,
            remarks: remarks.map(|(count, remark)| (remark.to_owned(), count as u64)).collect(),
            unused: report.unused,
            notes: report.notes,
        }
    }
}

/// Returns the lines for a group of inputs, under the given name; the first line sums up the others.
pub fn input_lines(name: &str, inputs: &[ReadInput]) -> Vec<String> {
    let mut total = Rows::default();
    let mut sources: Vec<&str> = Vec::new();
    for ReadInput { rows, .. } in inputs {
        total.used += rows.used;
        total.rows += rows.rows;
        if !sources.contains(&rows.source.as_str()) {
            sources.push(&rows.source);
        }
        for (kind, count, first) in &rows.rejected {
            match total.rejected.iter_mut().find(|(known, ..)| known == kind) {
                Some((_, sum, _)) => *sum += count,
                None => total.rejected.push((kind.clone(), *count, first.clone())),
            }
        }
        for (remark, count) in &rows.remarks {
            match total.remarks.iter_mut().find(|(known, _)| known == remark) {
                Some((_, sum)) => *sum += count,
                None => total.remarks.push((remark.clone(), *count)),
            }
        }
        for (all, own) in [(&mut total.unused, &rows.unused), (&mut total.notes, &rows.notes)] {
            let new = own.iter().filter(|text| !all.contains(text)).cloned().collect::<Vec<_>>();
            all.extend(new);
        }
    }
    let Rows { used, rows, rejected, remarks, unused, notes, .. } = total;
    if sources == [""] {
        return vec![format!("{name}: {used} stars")];
    }
    let out: u64 = rejected.iter().map(|(_, count, _)| count).sum();
    let mut lines =
        vec![format!("{name}: {used} stars, read as {}, {out} of {rows} rows rejected", sources.join(" and "))];
    lines.extend(rejected.iter().map(|(kind, count, first)| format!("rejected: {kind}: {count}, first: {first}")));
    lines.extend(remarks.iter().map(|(remark, count)| format!("stars {remark}: {count}")));
    if !unused.is_empty() {
        lines.push(format!("not stored: the columns {} of {name}", unused.join(", ")));
    }
    lines.extend(notes.iter().map(|note| format!("note: {note}")));
    lines
}

#[cfg(test)]
mod tests {
    use super::super::super::reader::read_csv_from;
    use super::*;

    fn input(rows: Rows) -> ReadInput {
        ReadInput { rows, digest: String::new() }
    }

    #[test]
    fn files_of_a_group_are_added_up_by_reason() {
        let read = |file: &str, rows: &str| {
            let text = format!("source_id,ra,dec,phot_g_mean_mag,parallax,plx\n{rows}");
            input(Rows::of_table(read_csv_from(text.as_bytes(), file, 0.0).expect("read").report))
        };
        let files = [
            read("a.csv", "1,10,20,15,0.1,1\n2,10,95,15,0.1,1\n3,10,,15,0.1,1\n"),
            read("b.csv", "4,11,20,15,0.1,1\n5,10,96,15,0.1,1\n"),
        ];
        assert_eq!(
            input_lines("a.csv ... b.csv (2 files)", &files),
            [
                "a.csv ... b.csv (2 files): 2 stars, read as Gaia archive, DR3, 3 of 5 rows rejected",
                "rejected: dec is outside -90 to 90 degrees: 2, first: a.csv line 3: dec = \"95\" is outside -90 to 90 degrees",
                "rejected: dec is missing: 1, first: a.csv line 4: dec is missing",
                "stars without BP-RP: G taken as V: 2",
                "not stored: the columns plx of a.csv ... b.csv (2 files)",
            ]
        );
        assert_eq!(input_lines("builtin:bright", &[input(Rows::of_store(9))]), ["builtin:bright: 9 stars"]);
        // The inputs are kept in the state of an unfinished store.
        let json = serde_json::to_string(&files).expect("JSON");
        assert_eq!(serde_json::from_str::<Vec<ReadInput>>(&json).expect("read"), files);
    }
}
