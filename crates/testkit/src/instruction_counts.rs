//! Instruction counts of frames: the recorded table, the output of callgrind, and their comparison.

use std::fmt::Write as _;

/// Growth of a count that is reported, as a fraction of the recorded count.
pub const REPORTED_GROWTH: f64 = 0.10;

/// Counts of one run, with the driver that drew the frames.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Counts {
    /// Adapter and driver. Counts of different drivers are not compared.
    pub driver: String,
    /// Name of each frame, and its instructions.
    pub frames: Vec<(String, u64)>,
}

impl Counts {
    /// Parses the recorded table.
    pub fn from_csv(text: &str) -> Result<Self, String> {
        let mut lines = text.lines();
        let driver =
            lines.next().and_then(|line| line.strip_prefix("# driver: ")).ok_or("line 1 has no `# driver: `")?;
        let head = lines.next();
        if head != Some("frame,instructions") {
            return Err(format!("line 2 is {head:?} instead of frame,instructions"));
        }
        let row = |line: &str| {
            let (name, count) = line.split_once(',').ok_or_else(|| format!("`{line}` has no count"))?;
            Ok((name.to_owned(), count.parse().map_err(|error| format!("`{line}`: {error}"))?))
        };
        let frames = lines.map(row).collect::<Result<_, String>>()?;
        Ok(Self { driver: driver.to_owned(), frames })
    }

    /// Formats the table for the file of recorded counts.
    pub fn to_csv(&self) -> String {
        let mut text = format!("# driver: {}\nframe,instructions\n", self.driver);
        for (name, count) in &self.frames {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name},{count}");
        }
        text
    }

    fn count(&self, name: &str) -> Option<u64> {
        self.frames.iter().find(|frame| frame.0 == name).map(|frame| frame.1)
    }
}

/// Returns a line for each problem: a frame whose count has grown by more than [`REPORTED_GROWTH`], a frame that only
/// one of the tables has, a count of 0, or another driver.
pub fn problems(recorded: &Counts, found: &Counts) -> Vec<String> {
    if recorded.driver != found.driver {
        return vec![format!("not compared: recorded with {}, now {}", recorded.driver, found.driver)];
    }
    let mut lines = Vec::new();
    for (name, now) in &found.frames {
        match recorded.count(name) {
            _ if *now == 0 => lines.push(format!("{name}: no instructions were counted")),
            None => lines.push(format!("{name}: {now} instructions, none recorded")),
            Some(before) if *now as f64 > before as f64 * (1.0 + REPORTED_GROWTH) => {
                let growth = 100.0 * (*now as f64 / before as f64 - 1.0);
                lines.push(format!("{name}: {now} instructions, {growth:.1} % more than the recorded {before}"));
            }
            Some(_) => {}
        }
    }
    let missing = recorded.frames.iter().filter(|frame| found.count(&frame.0).is_none());
    lines.extend(missing.map(|frame| format!("{}: recorded, but not drawn", frame.0)));
    lines
}

/// Reads a dump of callgrind. Returns the name that the program gave it, and the number of instructions of all threads.
pub fn read_dump(text: &str) -> Option<(String, u64)> {
    let name = text.lines().find_map(|line| line.strip_prefix("desc: Trigger: Client Request: "))?;
    let number = |prefix: &str| text.lines().find_map(|line| line.strip_prefix(prefix))?.trim().parse().ok();
    Some((name.to_owned(), number("totals: ").or_else(|| number("summary: "))?))
}
