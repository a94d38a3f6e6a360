//! `[[windows]]`: a view on a monitor of this machine, full screen or in a frame.

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::overlay::OverlayConfig;
use crate::ranges::KeyError;
use crate::view::{Part, Rig, View, check_name};

/// Maximum number of windows; each holds images on the adapter.
pub const MOST_WINDOWS: usize = 64;
/// Largest coordinate and largest side of a window, pixels: X11 stores them in 16 bits.
const MOST_PX: i32 = 32_767;

/// The monitor that a window is on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MonitorChoice {
    /// By a text from its EDID: `VENDOR-PRODUCT-SERIAL`, its name or its serial number.
    Edid(String),
    /// By its number from 1, from left to right and then from top to bottom.
    Number(u32),
    /// By the name of its connector, such as `DP-1`.
    Name(String),
}

impl std::fmt::Display for MonitorChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Edid(edid) => write!(f, "of EDID `{edid}`"),
            Self::Number(number) => write!(f, "number {number}"),
            Self::Name(name) => write!(f, "`{name}`"),
        }
    }
}

impl<'de> Deserialize<'de> for MonitorChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(MonitorVisitor)
    }
}

struct MonitorVisitor;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EdidEntry {
    edid: String,
}

impl<'de> Visitor<'de> for MonitorVisitor {
    type Value = MonitorChoice;

    fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("a name such as \"DP-1\", a number from 1, or { edid = \"DEL-40F1-00000123\" }")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<MonitorChoice, E> {
        if name.is_empty() {
            return Err(E::custom("the name is empty: must be the name of a connector, such as \"DP-1\""));
        }
        Ok(MonitorChoice::Name(name.to_owned()))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<MonitorChoice, E> {
        match u32::try_from(number) {
            Ok(number @ 1..) => Ok(MonitorChoice::Number(number)),
            _ => Err(E::custom(format!("{number}: numbers of monitors begin at 1"))),
        }
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<MonitorChoice, E> {
        self.visit_i64(i64::try_from(number).unwrap_or(0))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<MonitorChoice, A::Error> {
        let EdidEntry { edid } = EdidEntry::deserialize(MapAccessDeserializer::new(map))?;
        if edid.is_empty() {
            return Err(A::Error::custom(
                "edid: the text is empty: `steradian show --monitors` lists the EDIDs of this machine's monitors",
            ));
        }
        Ok(MonitorChoice::Edid(edid))
    }
}

/// Pixel format of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WindowFormat {
    /// The display image unchanged: 8 bits, sRGB.
    #[default]
    Srgb8,
    /// The same tone mapping, but with 10 bits and without dither.
    Rgb10,
    /// Linear light without tone mapping. 1 is display white; brighter values are shown up to the limit of the monitor.
    Hdr,
}

named!(WindowFormat {
    Srgb8 = "srgb8",
    Rgb10 = "rgb10",
    Hdr = "hdr",
});

/// One window.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WindowConfig {
    /// Unique name, in titles, logs and statistics: letters, digits, `_` and `-`. Absent: the name of the view, followed by `-` and the part, if any.
    #[serde(default)]
    pub name: String,
    /// Name of the view that it shows.
    pub view: String,
    /// Which image, if the view has several: `left`, `right`, or the name of a cube face.
    pub part: Option<String>,
    /// The monitor: its name, its number from 1, or `{ edid = "..." }`. Absent: the first monitor; for windows with a frame, the desktop chooses.
    #[serde(default)]
    #[schemars(schema_with = "super::reference::monitor")]
    pub monitor: Option<MonitorChoice>,
    /// Whether the window fills its monitor; otherwise it has a frame.
    #[serde(default)]
    pub fullscreen: bool,
    /// Position of the upper left corner on the monitor, or on the desktop if no monitor is named, pixels. Absent: the desktop chooses.
    #[schemars(inner(range(min = -MOST_PX, max = MOST_PX)), extend("x-unit" = "pixels"))]
    pub position: Option<[i32; 2]>,
    /// Width and height. Absent: the size of the image.
    #[schemars(inner(range(min = 1, max = MOST_PX)), extend("x-unit" = "pixels"))]
    pub size: Option<[u32; 2]>,
    /// Whether images wait for the monitor's refresh.
    #[serde(default = "yes")]
    pub vsync: bool,
    /// Whether the cursor is visible over the window.
    #[serde(default)]
    pub cursor: bool,
    /// Pixel format.
    #[serde(default)]
    pub format: WindowFormat,
}

fn yes() -> bool {
    true
}

impl WindowConfig {
    /// A window in a frame that shows an image of a view.
    pub fn of_image(view: &str, part: Part) -> Self {
        let part = part.name().map(str::to_owned);
        Self {
            name: part.as_ref().map_or_else(|| view.to_owned(), |part| format!("{view}-{part}")),
            view: view.to_owned(),
            part,
            monitor: None,
            fullscreen: false,
            position: None,
            size: None,
            vsync: true,
            cursor: false,
            format: WindowFormat::default(),
        }
    }

    /// Returns the view and the image that the window shows; `None` if they no longer exist.
    pub fn image_of<'a>(&self, rig: &'a Rig) -> Option<(usize, &'a View, usize)> {
        let (number, view) = rig.views().iter().enumerate().find(|(_, view)| view.name == self.view)?;
        let image = view.images.iter().position(|image| image.part.name() == self.part.as_deref())?;
        Some((number, view, image))
    }

    /// Gives the window a default name if it has none.
    fn named(mut self) -> Self {
        if self.name.is_empty() {
            self.name = self.part.as_ref().map_or_else(|| self.view.clone(), |part| format!("{}-{part}", self.view));
        }
        self
    }

    fn check(&self, rig: &Rig) -> Result<(), KeyError> {
        check_name(&self.name).map_err(|error| KeyError::new("name", error.to_string()))?;
        let Some(view) = rig.views().iter().find(|view| view.name == self.view) else {
            let names: Vec<&str> = rig.views().iter().map(|view| view.name.as_str()).collect();
            let allowed = if names.is_empty() { "none: there are no [[views]]".to_owned() } else { names.join(", ") };
            return Err(KeyError::new("view", format!("no view `{}`: must be one of {allowed}", self.view)));
        };
        if self.image_of(rig).is_none() {
            let parts: Vec<&str> = view.images.iter().filter_map(|image| image.part.name()).collect();
            let problem = match (&self.part, parts.is_empty()) {
                (Some(_), true) => format!("view `{}` has one image: leave it out", self.view),
                (Some(part), false) => {
                    format!("view `{}` has no image `{part}`: must be one of {}", self.view, parts.join(", "))
                }
                (None, _) => format!("view `{}` has several images: must be one of {}", self.view, parts.join(", ")),
            };
            return Err(KeyError::new("part", problem));
        }
        for (key, given) in [("position", self.position.is_some()), ("size", self.size.is_some())] {
            if self.fullscreen && given {
                let problem = "has no effect with fullscreen = true: the window fills its monitor; leave it out";
                return Err(KeyError::new(key, problem));
            }
        }
        Ok(())
    }

    /// Overlays are drawn only over display images.
    fn check_overlay(&self, overlay: &OverlayConfig, patterned: &[&str]) -> Result<(), KeyError> {
        if self.format == WindowFormat::Srgb8 || overlay.is_empty() && !patterned.contains(&self.view.as_str()) {
            return Ok(());
        }
        let problem =
            "only display images of 8 bits show overlays and test patterns: set format = \"srgb8\", or omit them";
        Err(KeyError::new("format", format!("`{}`: {problem}", self.format.name())))
    }
}

/// Returns all windows with their names, if they can be shown; an error has the window's index. `patterned` lists the views with test patterns.
pub(super) fn windows(
    windows: Vec<WindowConfig>,
    rig: &Rig,
    overlay: &OverlayConfig,
    patterned: &[&str],
) -> Result<Vec<WindowConfig>, (usize, KeyError)> {
    if windows.len() > MOST_WINDOWS {
        let problem = format!("{} windows: must be at most {MOST_WINDOWS}", windows.len());
        return Err((MOST_WINDOWS, KeyError::new("", problem)));
    }
    let windows: Vec<WindowConfig> = windows.into_iter().map(WindowConfig::named).collect();
    for (index, window) in windows.iter().enumerate() {
        window.check(rig).map_err(|fault| (index, fault))?;
        window.check_overlay(overlay, patterned).map_err(|fault| (index, fault))?;
        let before = || windows[..index].iter();
        if let Some(first) = before().position(|other| other.name == window.name) {
            let problem = format!("windows[{first}] also has the name `{}`: names must be unique", window.name);
            return Err((index, KeyError::new("name", problem)));
        }
        let fills = |other: &WindowConfig| other.fullscreen && window.fullscreen && other.monitor == window.monitor;
        if let Some(first) = before().position(fills) {
            let monitor = window.monitor.as_ref().map_or("the first one".to_owned(), MonitorChoice::to_string);
            let problem = format!("windows[{first}] also fills monitor {monitor}: only one window can");
            return Err((index, KeyError::new("monitor", problem)));
        }
    }
    Ok(windows)
}
