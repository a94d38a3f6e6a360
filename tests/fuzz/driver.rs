//! Runs an entry point with mutated inputs, in a process of its own, on any toolchain.
//!
//! A test starts its own binary again for one target, so that an abort, a stack that overflows or memory that is used up ends that process
//! alone. It limits its own address space, and a thread beside it watches the time of each input. What was being read when it ended is kept
//! as `target/fuzz/NAME-HASH`.
//!
//! There is no feedback from coverage, which needs a compiler of its own. In its place stands the answer: an input whose answer (the text of an
//! error without its numbers and names) is new is kept and mutated further, so that parsers are entered step by step. Random numbers are
//! those of a fixed seed: a run reads the same inputs as the one before, as far as it gets.

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

/// Longest that reading one input may take: several times what the slowest takes on a machine with other work.
const MOST_PER_INPUT: Duration = Duration::from_secs(20);
/// Inputs of a short run.
const FEW: u64 = 3000;
/// Seconds of a long run, unless `STERADIAN_FUZZ_SECONDS` tells.
const SECONDS: u64 = 60;
/// Longest input, bytes.
const LONGEST: usize = 1 << 18;
/// Inputs that are kept because their answers were new.
const MOST_KEPT: usize = 1000;
/// The input that is being read, in the folder of temporary files of that process.
const RUNNING: &str = "input";
/// Tells the process that it is the one that reads.
const READS: &str = "STERADIAN_FUZZ_READS";

/// A parser under test.
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// Reads an input; returns the error's text, or nothing.
    pub read: fn(&[u8]) -> String,
    /// Inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// What occurs in the format.
    pub tokens: &'static [&'static str],
    /// Makes checksums and the like right again after a mutation.
    pub repair: fn(&mut Vec<u8>),
    /// Bytes of address space that reading may take.
    pub most_bytes: u64,
}

/// How much is read.
#[derive(Clone, Copy)]
pub enum Run {
    /// A fixed number of inputs.
    Short,
    /// As many as the time allows.
    Long,
}

/// Nothing to repair.
pub fn as_it_is(_: &mut Vec<u8>) {}

/// Reads mutated inputs. `test` is the path of the calling test in its binary, as `module_path!()` tells it.
///
/// # Panics
/// If an input makes the parser panic, abort, take too much memory or too long.
#[track_caller]
pub fn check(target: &Target, run: Run, test: &str) {
    if env::var_os(READS).is_some() {
        return read_all(target, run);
    }
    // The first part is the crate's name, which tests do not have in theirs.
    let test = test.split_once("::").map_or(test, |(_, test)| test);
    // In memory where that can be had: files of a disk take longer to write than to read.
    let scratch = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
    let child = Command::new(env::current_exe().unwrap())
        .args([test, "--exact", "--include-ignored", "--nocapture", "--test-threads=1"])
        .env(READS, "1")
        // Files that the entry points write go with this folder.
        .env("TMPDIR", scratch.path())
        // Else every thread reserves an address space of its own, which is limited.
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
        panic!("{}: the process that reads ended with {}, at no input\n{out}\n{said}", target.name, output.status);
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

/// Begins the line that a run ends with.
const SUMMARY: &str = "fuzzing ";

/// `target/fuzz`, beside the folder of the profile that this binary lies below.
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

/// An answer without what differs from input to input: numbers, and what is quoted.
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

/// Reads inputs in this process, until the run is over or one of them ends it.
fn read_all(target: &Target, run: Run) {
    let seconds = env::var("STERADIAN_FUZZ_SECONDS").ok().map(|text| text.parse().expect("a number of seconds"));
    let duration = Duration::from_secs(seconds.unwrap_or(SECONDS));
    let mut corpus = (target.seeds)();
    let seeds = corpus.len();
    assert!(seeds > 0, "a target has seeds");
    limit_memory(target.most_bytes);

    let running = env::temp_dir().join(RUNNING);
    let begin = Instant::now();
    // Milliseconds since the beginning at which the reading of an input began; 0: none is read.
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
                // A quarter stays broken.
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
        "\n{SUMMARY}{}: {inputs} inputs from {seeds} seeds in {:.1} s, {} kinds of answers, the slowest after {:.3} s",
        target.name,
        begin.elapsed().as_secs_f64(),
        kinds.len(),
        slowest.as_secs_f64()
    );
}

/// Lets this process have so many more bytes of address space: an allocation beyond them ends it.
fn limit_memory(most_bytes: u64) {
    let pages: u64 = fs::read_to_string("/proc/self/statm").unwrap().split(' ').next().unwrap().parse().unwrap();
    // Stacks of threads that begin later are reserved and hardly used.
    let of_threads = 256 << 20;
    let most = Some(pages * 4096 + of_threads + most_bytes);
    setrlimit(Resource::As, Rlimit { current: most, maximum: most }).unwrap();
    setrlimit(Resource::Core, Rlimit { current: Some(0), maximum: Some(0) }).unwrap();
}

/// Ends the process when an input takes too long.
fn watch(begin: Instant, since: Arc<AtomicU64>) {
    thread::spawn(move || {
        loop {
            thread::sleep(Duration::from_millis(200));
            let from = since.load(Relaxed);
            if from > 0 && begin.elapsed() > Duration::from_millis(from) + MOST_PER_INPUT {
                eprintln!("reading takes longer than {} s", MOST_PER_INPUT.as_secs());
                abort();
            }
        }
    });
}

/// Numbers at which arithmetic goes wrong.
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

/// The same in text.
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

/// An input of the corpus with a few changes. Half of them begin with a seed.
fn mutated(random: &mut ChaCha8Rng, corpus: &[Vec<u8>], seeds: usize, tokens: &[&str]) -> Vec<u8> {
    let among = if random.random() { seeds } else { corpus.len() };
    let mut input = corpus[random.random_range(0..among)].clone();
    for _ in 0..1 + random.random_range(0u32..6).pow(2) / 4 {
        change(random, &mut input, corpus, tokens);
    }
    input.truncate(LONGEST);
    input
}

/// A range of at most `most` bytes of an input.
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
        // An integer in binary, of either order.
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
        // The next number in text.
        6 | 7 => {
            let is_digit = |byte: &u8| byte.is_ascii_digit();
            if let Some(start) = input[place..].iter().position(is_digit).map(|at| place + at) {
                let end = input[start..].iter().position(|byte| !is_digit(byte)).map_or(length, |at| start + at);
                let number = NUMBERS[random.random_range(0..NUMBERS.len())];
                input.splice(start..end, number.bytes());
            }
        }
        8 => {
            let part = range(random, length, 64);
            input.drain(part);
        }
        // A part again, here or elsewhere, once or many times.
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
