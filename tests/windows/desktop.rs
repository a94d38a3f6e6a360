//! Runs an X server for a test, and gives access to its pixels, keyboard and monitors.

use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use x11rb::{
    connection::Connection,
    protocol::{
        randr::{self, ConnectionExt as _},
        xproto::{self, AtomEnum, ConnectionExt as _, ImageFormat, PropMode},
        xtest::ConnectionExt as _,
    },
    rust_connection::RustConnection,
    wrapper::ConnectionExt as _,
};

/// Time limit far above the time that a server or a program needs.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Repeats a query until it has a result, or fails with the message of `message`.
pub fn until<T>(mut look: impl FnMut() -> Option<T>, message: impl Fn() -> String) -> T {
    let deadline = Instant::now() + PATIENCE;
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < deadline, "{}", message());
        thread::sleep(Duration::from_millis(30));
    }
}

/// Part of Xorg's configuration file with the monitors of its dummy driver. The first monitor has 1024 x 768 pixels;
/// the others are not connected.
const DUMMY: &str = r#"
Section "ServerFlags"
    Option "AutoAddDevices" "false"
    Option "AutoEnableDevices" "false"
EndSection
Section "Device"
    Identifier "dummy"
    Driver "dummy"
    VideoRam 65536
EndSection
Section "Monitor"
    Identifier "monitor"
    HorizSync 5.0 - 1000.0
    VertRefresh 5.0 - 200.0
EndSection
Section "Screen"
    Identifier "screen"
    Device "dummy"
    Monitor "monitor"
    DefaultDepth 24
    SubSection "Display"
        Depth 24
        Modes "1024x768"
    EndSubSection
EndSection
"#;

/// An image of the desktop: R, G, B of each pixel, row by row.
#[derive(Clone, PartialEq)]
pub struct Pixels {
    pub size: [usize; 2],
    pub codes: Vec<[u8; 3]>,
}

impl Pixels {
    /// Reads a PNG written by the program.
    pub fn of_png(path: &std::path::Path) -> Self {
        let decoder = png::Decoder::new(BufReader::new(std::fs::File::open(path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        let channels = info.color_type.samples();
        let codes = bytes.chunks_exact(channels).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        Self { size: [info.width as usize, info.height as usize], codes }
    }

    /// Returns the number of pixels that differ from another image of the same size, and the largest difference in
    /// codes.
    pub fn differences(&self, other: &Self) -> (usize, u8) {
        assert_eq!(self.size, other.size);
        let both = self.codes.iter().zip(&other.codes);
        let difference = |(one, other): (&[u8; 3], &[u8; 3])| (0..3).map(|c| one[c].abs_diff(other[c])).max();
        let differences: Vec<u8> = both.filter_map(difference).collect();
        let most = differences.iter().copied().max().unwrap_or(0);
        (differences.iter().filter(|difference| **difference > 0).count(), most)
    }

    pub fn is_black(&self) -> bool {
        self.codes.iter().all(|code| *code == [0; 3])
    }

    pub fn brightest(&self) -> u8 {
        self.codes.iter().flatten().copied().max().unwrap_or(0)
    }
}

/// A running X server.
pub struct Desktop {
    server: Child,
    /// Value of `DISPLAY`.
    pub display: String,
    pub connection: RustConnection,
    root: u32,
    _configuration: tempfile::TempDir,
}

impl Drop for Desktop {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

impl Desktop {
    /// Starts Xvfb with one monitor, `screen`. Returns an error if it is not installed.
    pub fn virtual_frame_buffer() -> Result<Self, String> {
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-screen", "0", "1600x900x24", "-ac", "+extension", "RANDR", "-noreset"]);
        Self::start(command, tempfile::tempdir().unwrap(), "Xvfb", "xvfb")
    }

    /// Starts Xorg with removable monitors, of which the first is connected: `DUMMY0`. Returns an error if it is not
    /// installed.
    pub fn dummy_monitors() -> Result<Self, String> {
        let folder = tempfile::tempdir().unwrap();
        let configuration = folder.path().join("xorg.conf");
        std::fs::write(&configuration, DUMMY).unwrap();
        let driver = "/usr/lib/xorg/modules/drivers/dummy_drv.so";
        if !std::path::Path::new(driver).is_file() {
            return Err(format!("{driver} is missing (Debian and Ubuntu: apt install xserver-xorg-video-dummy)"));
        }
        let mut command = Command::new("Xorg");
        command.args(["-displayfd", "1", "-ac", "-noreset", "-nolisten", "tcp", "-novtswitch"]);
        command.arg("-config").arg(&configuration).arg("-logfile").arg(folder.path().join("log"));
        Self::start(command, folder, "Xorg", "xserver-xorg-core")
    }

    fn start(mut command: Command, folder: tempfile::TempDir, name: &str, package: &str) -> Result<Self, String> {
        let log = std::fs::File::create(folder.path().join("messages")).unwrap();
        let spawned = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(log).spawn();
        let mut server = spawned
            .map_err(|error| format!("cannot start {name}: {error} (Debian and Ubuntu: apt install {package})"))?;
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let said = || std::fs::read_to_string(folder.path().join("messages")).unwrap_or_default();
        assert!(number.trim().parse::<u32>().is_ok(), "{name} does not start: {}", said());
        let display = format!(":{}", number.trim());
        let (connection, screen) = x11rb::connect(Some(&display)).unwrap();
        let root = connection.setup().roots[screen].root;
        Ok(Self { server, display, connection, root, _configuration: folder })
    }

    /// Returns the visible pixels of a part of the desktop.
    pub fn pixels(&self, [x, y]: [i16; 2], [width, height]: [u16; 2]) -> Pixels {
        let image = self.connection.get_image(ImageFormat::Z_PIXMAP, self.root, x, y, width, height, u32::MAX).unwrap();
        let image = image.reply().unwrap();
        // Each pixel is a 32-bit word with 24 bits of colour, blue first.
        let codes = image.data.chunks_exact(4).map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect();
        Pixels { size: [width, height].map(usize::from), codes }
    }

    /// Waits until a part of the desktop has the expected pixels.
    pub fn until_seen(&self, corner: [i16; 2], expected: &Pixels, context: &str) {
        let size = expected.size.map(|side| side as u16);
        let differences = || self.pixels(corner, size).differences(expected);
        until(
            || (differences().0 == 0).then_some(()),
            || format!("{context}: [pixels, codes] differ: {:?}", differences()),
        );
    }

    /// Presses and releases the key of a letter.
    pub fn press(&self, letter: char) {
        let keysym = u32::from(letter);
        let (least, most) = (self.connection.setup().min_keycode, self.connection.setup().max_keycode);
        let mapping = self.connection.get_keyboard_mapping(least, most - least + 1).unwrap().reply().unwrap();
        let per_code = usize::from(mapping.keysyms_per_keycode);
        let code = mapping.keysyms.chunks(per_code).position(|syms| syms.contains(&keysym)).unwrap() as u8 + least;
        for event in [xproto::KEY_PRESS_EVENT, xproto::KEY_RELEASE_EVENT] {
            self.connection.xtest_fake_input(event, code, x11rb::CURRENT_TIME, self.root, 0, 0, 0).unwrap();
        }
        self.connection.flush().unwrap();
        self.connection.sync().unwrap();
    }

    /// Presses and releases Escape.
    pub fn press_escape(&self) {
        self.press('\u{ff1b}');
    }

    /// Whether a window has the keyboard focus.
    pub fn has_focus(&self) -> bool {
        let focus = self.connection.get_input_focus().unwrap().reply().unwrap().focus;
        focus > 1 && focus != self.root
    }

    fn resources(&self) -> randr::GetScreenResourcesReply {
        self.connection.randr_get_screen_resources(self.root).unwrap().reply().unwrap()
    }

    fn output(&self, name: &str) -> u32 {
        let resources = self.resources();
        let name_of = |output: u32| {
            let info = self.connection.randr_get_output_info(output, x11rb::CURRENT_TIME).unwrap().reply().unwrap();
            String::from_utf8(info.name).unwrap()
        };
        resources.outputs.iter().copied().find(|output| name_of(*output) == name).unwrap()
    }

    /// Switches a second monitor of 1024 x 768 pixels on, to the right of the first one.
    pub fn connect_second(&self) {
        let (output, resources) = (self.output("DUMMY1"), self.resources());
        let mode = resources.modes.iter().find(|mode| (mode.width, mode.height) == (1024, 768)).unwrap().id;
        // An output counts as connected when it has a mode.
        self.connection.randr_add_output_mode(output, mode).unwrap().check().unwrap();
        self.connection.randr_set_screen_size(self.root, 2048, 768, 542, 203).unwrap().check().unwrap();
        self.set_crtc(self.resources().crtcs[1], 1024, mode, &[output]);
    }

    /// Disconnects the second monitor.
    pub fn disconnect_second(&self) {
        self.set_crtc(self.resources().crtcs[1], 0, 0, &[]);
    }

    fn set_crtc(&self, crtc: u32, x: i16, mode: u32, outputs: &[u32]) {
        let time = self.resources().config_timestamp;
        let set = self.connection.randr_set_crtc_config(
            crtc,
            x11rb::CURRENT_TIME,
            time,
            x,
            0,
            mode,
            randr::Rotation::ROTATE0,
            outputs,
        );
        assert_eq!(set.unwrap().reply().unwrap().status, randr::SetConfig::SUCCESS);
    }

    /// Gives a monitor an EDID.
    pub fn set_edid(&self, output: &str, edid: &[u8]) {
        let output = self.output(output);
        let atom = self.connection.intern_atom(false, b"EDID").unwrap().reply().unwrap().atom;
        let kind = u32::from(AtomEnum::INTEGER);
        let count = edid.len() as u32;
        let changed =
            self.connection.randr_change_output_property(output, atom, kind, 8, PropMode::REPLACE, count, edid);
        changed.unwrap().check().unwrap();
    }

    /// Moves the pointer to a position where it covers no window.
    pub fn park_pointer(&self, [x, y]: [i16; 2]) {
        self.connection.warp_pointer(x11rb::NONE, self.root, 0, 0, 0, 0, x, y).unwrap().check().unwrap();
    }
}
