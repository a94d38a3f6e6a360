//! Runs an entry point with mutated inputs in a separate process, on any toolchain.
//!
//! A test starts its own binary again for one target, so that an abort, a stack overflow or exhausted memory ends
//! only that process. The process limits its address space, and a watchdog thread limits the time of each input. The
//! input that was being read when the process ended is kept as `target/fuzz/NAME-HASH`.
//!
//! Coverage feedback would need a special compiler. The driver uses the answer of the parser instead, which is the text
//! of the error without its numbers and names: an input with a new answer is kept and mutated further, so that parsers
//! are entered step by step. Random numbers have a fixed seed, so every run reads the same inputs, as far as its time
//! allows.

use std::{
    collections::HashSet,
    env, fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::PathBuf,
    process::{Command, Stdio, abort},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    thread,
    time::{Duration, Instant},
};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::{Resource, Rlimit, setrlimit};

/// Longest time for one input: several times the time of the slowest input on a busy machine.
const MOST_PER_INPUT: Duration = Duration::from_secs(20);
/// Number of inputs of a short run.
const FEW: u64 = 3000;
/// Seconds of a long run, unless `STERADIAN_FUZZ_SECONDS` is set.
const SECONDS: u64 = 60;
/// Longest input, bytes.
const LONGEST: usize = 1 << 18;
/// Largest number of inputs that are kept because their answers were new.
const MOST_KEPT: usize = 1000;
/// Name of the file with the input that is being read, in the temporary folder of the reading process.
const RUNNING: &str = "input";
/// Environment variable that marks the process that reads the inputs.
const READS: &str = "STERADIAN_FUZZ_READS";

/// A parser under test.
pub struct Target {
    /// Name of the target.
    pub name: &'static str,
    /// Reads an input; returns the text of the error, or an empty string.
    pub read: fn(&[u8]) -> String,
    /// Initial inputs.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Tokens of the format.
    pub tokens: &'static [&'static str],
    /// Repairs checksums, lengths and the like after a mutation.
    pub repair: fn(&mut Vec<u8>),
    /// Bytes of address space that the reader may use.
    pub most_bytes: u64,
}

/// Length of a run.
#[derive(Clone, Copy)]
pub enum Run {
    /// A fixed number of inputs.
    Short,
    /// As many inputs as time allows.
    Long,
}

/// Leaves an input unchanged.
pub fn as_it_is(_: &mut Vec<u8>) {}

/// Reads mutated inputs. `test` is the path of the calling test, as given by `module_path!()`.
///
/// # Panics
/// If an input makes the parser panic, abort, or use too much memory or time.
#[track_caller]
pub fn check(target: &Target, run: Run, test: &str) {
    if env::var_os(READS).is_some() {
        return read_all(target, run);
    }
    // Remove the crate's name at the start, which test names do not contain.
    let test = test.split_once("::").map_or(test, |(_, test)| test);
    // Use a folder in memory if possible, because writing a file to a disk takes longer than parsing it.
    let scratch = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
    let child = Command::new(env::current_exe().unwrap())
        .args([test, "--exact", "--include-ignored", "--nocapture", "--test-threads=1"])
        .env(READS, "1")
        // Files that the entry points write are removed with this folder.
        .env("TMPDIR", scratch.path())
        // Use one arena: otherwise every thread would reserve separate address space, which is limited.
        .env("MALLOC_ARENA_MAX", "1")
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let output = child.wait_with_output().unwrap();
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let summary = out.lines().find(|line| line.starts_with(SUMMARY));
    if let (true, Some(summary)) = (output.status.success(), summary) {
        println!("{summary}");
        return;
    }
    let said: Vec<&str> = err.lines().rev().take(12).collect();
    let said = said.into_iter().rev().collect::<Vec<_>>().join("\n");
    let Ok(input) = fs::read(scratch.path().join(RUNNING)) else {
        panic!("{}: the reading process ended with {}, outside any input\n{out}\n{said}", target.name, output.status);
    };
    let path = folder().join(format!("{}-{:016x}", target.name, hash(&input)));
    fs::write(&path, &input).unwrap();
    panic!(
        "{}: an input of {} bytes ended the process that read it with {}; it is in {}\n{said}",
        target.name,
        input.len(),
        output.status,
        path.display()
    );
}

/// Start of the summary, which is the last line of a run.
const SUMMARY: &str = "fuzzing ";

/// Creates `target/fuzz`, next to the folder of this binary's profile.
fn folder() -> PathBuf {
    let binary = env::current_exe().unwrap();
    let folder = binary.ancestors().nth(3).unwrap().join("fuzz");
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn hash(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    hasher.finish()
}

/// Returns the hash of an answer without numbers and quoted text, which differ from input to input.
fn kind_of(answer: &str) -> u64 {
    let mut kind = String::new();
    let mut quoted = None;
    for c in answer.chars().take(400) {
        match quoted {
            Some(end) if c == end => quoted = None,
            Some(_) => {}
            None if matches!(c, '`' | '"') => quoted = Some(c),
            None if c.is_ascii_digit() => {}
            None => kind.push(c),
        }
    }
    hash(kind.as_bytes())
}

/// Reads inputs in this process until the run ends or an input ends the process.
fn read_all(target: &Target, run: Run) {
    let seconds = env::var("STERADIAN_FUZZ_SECONDS").ok().map(|text| text.parse().expect("a number of seconds"));
    let duration = Duration::from_secs(seconds.unwrap_or(SECONDS));
    let mut corpus = (target.seeds)();
    let seeds = corpus.len();
    assert!(seeds > 0, "a target needs seeds");
    limit_memory(target.most_bytes);

    let running = env::temp_dir().join(RUNNING);
    let begin = Instant::now();
    // Start time of the current input, in milliseconds since the beginning; 0 if none is being read.
    let since = Arc::new(AtomicU64::new(0));
    watch(begin, Arc::clone(&since));
    let mut random = ChaCha8Rng::seed_from_u64(hash(target.name.as_bytes()));
    let mut kinds = HashSet::new();
    let (mut inputs, mut slowest) = (0, Duration::ZERO);
    let goes_on = |inputs: u64| match run {
        Run::Short => inputs < FEW + seeds as u64,
        Run::Long => begin.elapsed() < duration,
    };
    while goes_on(inputs) {
        let input = match corpus.get(inputs as usize).filter(|_| inputs < seeds as u64) {
            Some(seed) => seed.clone(),
            None => {
                let mut input = mutated(&mut random, &corpus, seeds, target.tokens);
                // Leave a quarter of the inputs damaged.
                if random.random_ratio(3, 4) {
                    (target.repair)(&mut input);
                }
                input
            }
        };
        fs::write(&running, &input).unwrap();
        let now = Instant::now();
        since.store(1 + begin.elapsed().as_millis() as u64, Relaxed);
        let answer = (target.read)(&input);
        since.store(0, Relaxed);
        slowest = slowest.max(now.elapsed());
        inputs += 1;
        if kinds.insert(kind_of(&answer)) && inputs > seeds as u64 {
            if corpus.len() < seeds + MOST_KEPT {
                corpus.push(input);
            } else {
                corpus[seeds + random.random_range(0..MOST_KEPT)] = input;
            }
        }
    }
    fs::remove_file(&running).unwrap();
    println!(
        "\n{SUMMARY}{}: {inputs} inputs from {seeds} seeds in {:.1} s, {} kinds of answers, the slowest took {:.3} s",
        target.name,
        begin.elapsed().as_secs_f64(),
        kinds.len(),
        slowest.as_secs_f64()
    );
}

/// Limits how much more address space this process can use: an allocation beyond the limit ends the process.
fn limit_memory(most_bytes: u64) {
    let pages: u64 = fs::read_to_string("/proc/self/statm").unwrap().split(' ').next().unwrap().parse().unwrap();
    // Add space for the stacks of threads that start later, which are reserved but hardly used.
    let of_threads = 256 << 20;
    let most = Some(pages * 4096 + of_threads + most_bytes);
    setrlimit(Resource::As, Rlimit { current: most, maximum: most }).unwrap();
    setrlimit(Resource::Core, Rlimit { current: Some(0), maximum: Some(0) }).unwrap();
}

/// Ends the process if an input takes too long.
fn watch(begin: Instant, since: Arc<AtomicU64>) {
    thread::spawn(move || {
        loop {
            thread::sleep(Duration::from_millis(200));
            let from = since.load(Relaxed);
            if from > 0 && begin.elapsed() > Duration::from_millis(from) + MOST_PER_INPUT {
                eprintln!("reading took longer than {} s", MOST_PER_INPUT.as_secs());
                abort();
            }
        }
    });
}

/// Numbers that provoke arithmetic errors.
const INTEGERS: [u64; 16] = [
    0,
    1,
    2,
    7,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x0100_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
];

/// Such numbers as text.
const NUMBERS: [&str; 22] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "3",
    "255",
    "65536",
    "1000000",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "1e308",
    "-1e308",
    "1e999",
    "1e-320",
    "0.1",
    "nan",
    "inf",
    "99999999999999999999999999",
];

/// Returns an input of the corpus with a few changes. Half of the time this input is a seed.
fn mutated(random: &mut ChaCha8Rng, corpus: &[Vec<u8>], seeds: usize, tokens: &[&str]) -> Vec<u8> {
    let among = if random.random() { seeds } else { corpus.len() };
    let mut input = corpus[random.random_range(0..among)].clone();
    for _ in 0..1 + random.random_range(0u32..6).pow(2) / 4 {
        change(random, &mut input, corpus, tokens);
    }
    input.truncate(LONGEST);
    input
}

/// Returns a random range of at most `most` bytes of an input.
fn range(random: &mut ChaCha8Rng, length: usize, most: usize) -> std::ops::Range<usize> {
    let start = random.random_range(0..=length);
    start..random.random_range(start..=length.min(start + most))
}

fn change(random: &mut ChaCha8Rng, input: &mut Vec<u8>, corpus: &[Vec<u8>], tokens: &[&str]) {
    let length = input.len();
    let token = |random: &mut ChaCha8Rng| match tokens.len() {
        0 => b"\0".to_vec(),
        count => tokens[random.random_range(0..count)].as_bytes().to_vec(),
    };
    let place = random.random_range(0..=length);
    match random.random_range(0..13) {
        0 if place < length => input[place] ^= 1 << random.random_range(0..8),
        1 if place < length => input[place] = random.random(),
        // Overwrite bytes with an integer in either byte order.
        2 | 3 => {
            let size = 1usize << random.random_range(0..4);
            let value = INTEGERS[random.random_range(0..INTEGERS.len())];
            let bytes = if random.random() {
                value.to_le_bytes()[..size].to_vec()
            } else {
                value.to_be_bytes()[8 - size..].to_vec()
            };
            for (to, from) in input.iter_mut().skip(place).zip(bytes) {
                *to = from;
            }
        }
        4 => {
            let token = token(random);
            input.splice(place..place, token);
        }
        5 => {
            let token = token(random);
            for (to, from) in input.iter_mut().skip(place).zip(token) {
                *to = from;
            }
        }
        // Replace the next number in the text.
        6 | 7 => {
            let is_digit = |byte: &u8| byte.is_ascii_digit();
            if let Some(start) = input[place..].iter().position(is_digit).map(|offset| place + offset) {
                let end =
                    input[start..].iter().position(|byte| !is_digit(byte)).map_or(length, |offset| start + offset);
                let number = NUMBERS[random.random_range(0..NUMBERS.len())];
                input.splice(start..end, number.bytes());
            }
        }
        8 => {
            let part = range(random, length, 64);
            input.drain(part);
        }
        // Insert a copy of a part, here or elsewhere, once or many times.
        9 => {
            let part = input[range(random, length, 200)].to_vec();
            let times = if random.random_ratio(1, 8) { random.random_range(2..200) } else { 1 };
            input.splice(place..place, part.repeat(times));
        }
        10 => input.truncate(place),
        11 => {
            let other = &corpus[random.random_range(0..corpus.len())];
            let part = other[range(random, other.len(), 4096)].to_vec();
            let end = if random.random() { place } else { (place + part.len()).min(length) };
            input.splice(place..end, part);
        }
        _ => {
            let bytes: Vec<u8> = (0..random.random_range(1..16)).map(|_| random.random()).collect();
            input.splice(place..place, bytes);
        }
    }
}
