//! The comparison of instruction counts with the recorded ones.

use testkit::instruction_counts::{Counts, problems, read_dump};

fn recorded() -> Counts {
    Counts::from_csv(include_str!("../../benches/instruction_counts.csv")).unwrap()
}

#[test]
fn recorded_table_has_ten_frames_and_is_read_as_written() {
    let recorded = recorded();
    assert_eq!(recorded.frames.len(), 10);
    assert!(recorded.frames.iter().all(|frame| frame.1 > 1_000_000), "{recorded:?}");
    assert_eq!(Counts::from_csv(&recorded.to_csv()), Ok(recorded.clone()));
    assert_eq!(problems(&recorded, &recorded), [""; 0]);
}

#[test]
fn grown_missing_and_empty_counts_are_reported() {
    let recorded = recorded();
    let mut found = recorded.clone();
    found.frames[0].1 = recorded.frames[0].1 * 109 / 100;
    found.frames[1].1 = recorded.frames[1].1 / 2;
    assert_eq!(problems(&recorded, &found), [""; 0], "9 % more and half as many are not reported");
    found.frames[0].1 = recorded.frames[0].1 * 112 / 100;
    found.frames[2].1 = 0;
    let (lost, _) = found.frames.pop().unwrap();
    found.frames.push(("another".to_owned(), 5_000_000));
    let lines = problems(&recorded, &found);
    assert_eq!(lines.len(), 4, "{lines:#?}");
    assert!(lines[0].starts_with(&recorded.frames[0].0) && lines[0].contains("12.0 % more"), "{lines:#?}");
    assert!(lines[1].contains("no instructions") && lines[2].contains("none recorded"), "{lines:#?}");
    assert!(lines[3].starts_with(&lost) && lines[3].contains("not drawn"), "{lines:#?}");
}

#[test]
fn other_drivers_are_reported_and_not_compared() {
    let recorded = recorded();
    let mut found = Counts { driver: "another driver".to_owned(), ..recorded.clone() };
    found.frames[0].1 *= 2;
    let lines = problems(&recorded, &found);
    assert!(lines.len() == 1 && lines[0].contains("not compared") && lines[0].contains("another driver"), "{lines:?}");
}

#[test]
fn damaged_tables_and_dumps_are_refused() {
    let text = recorded().to_csv();
    for (from, to) in [("# driver: ", "# "), ("frame,instructions", "frame,seconds"), ("dome,", "dome,x")] {
        assert!(Counts::from_csv(&text.replacen(from, to, 1)).is_err(), "{to}");
    }
    let dump = "version: 1\ndesc: Trigger: Client Request: dome\n\nevents: Ir\nsummary: 12345\n\ntotals: 12345\n";
    assert_eq!(read_dump(dump), Some(("dome".to_owned(), 12_345)));
    assert_eq!(read_dump(&dump.replace("Client Request: ", "Program termination ")), None);
    assert_eq!(read_dump(&dump.replace("12345", "")), None);
}
