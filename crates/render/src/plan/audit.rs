//! What an audit of a frame has found, as plain data: the errors of a sample of its pixels against f64, and what was not compared.

use serde::Serialize;

/// The errors of a frame's images.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Audit {
    /// Images compared, in the order of the frame.
    pub images: Vec<ImageAudit>,
    /// What was not compared, and why; such images say nothing of the budget.
    pub not_audited: Vec<String>,
}

impl Audit {
    /// The images that break their budgets.
    pub fn broken(&self) -> impl Iterator<Item = &ImageAudit> {
        self.images.iter().filter(|image| !image.within_budget)
    }

    /// Whether a compared image breaks its budget.
    pub fn is_broken(&self) -> bool {
        self.broken().next().is_some()
    }
}

/// What an error of a pixel is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AuditedOutput {
    /// A display image: codes of 8 bits beyond what rounding to a whole code explains.
    Display,
    /// An HDR image: parts of what the budget allows, `flux` of the stars' light and `glare` of the veil.
    Hdr,
}

impl AuditedOutput {
    /// The unit of errors and budget.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Display => "codes of 8 bits beyond rounding",
            Self::Hdr => "parts of the budget of flux and glare",
        }
    }
}

/// The errors of one image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageAudit {
    /// The view's name.
    pub view: String,
    /// Which of its images; absent where it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Which kind of image.
    pub output: AuditedOutput,
    /// Pixels compared.
    pub pixels: usize,
    /// Pixels of the sample that were not: an overlay covers them, or a star stands so close to a threshold that f32 may draw it otherwise.
    pub left_out: usize,
    /// The error that 99.9 % of the channels of the pixels do not exceed.
    pub error_999: f64,
    /// The largest error.
    pub largest: f64,
    /// What `error_999` may be at most.
    pub budget: f64,
    /// What `largest` may be at most.
    pub most: f64,
    /// Unit of these four.
    pub unit: &'static str,
    /// Whether both are within it.
    pub within_budget: bool,
    /// Where the largest error is; absent where nothing was compared.
    pub worst: Option<WorstPixel>,
}

impl ImageAudit {
    /// The image's name: that of its view, with its part.
    pub fn image(&self) -> String {
        self.part.as_ref().map_or_else(|| self.view.clone(), |part| format!("{}.{part}", self.view))
    }

    /// What is told of it in one line.
    pub fn in_words(&self) -> String {
        let Self { pixels, error_999, largest, budget, most, unit, .. } = self;
        let kind = match self.output {
            AuditedOutput::Display => "display",
            AuditedOutput::Hdr => "HDR",
        };
        let verdict = if self.within_budget { "within the budget" } else { "BEYOND THE BUDGET" };
        let worst = self.worst.as_ref().map(|worst| {
            let WorstPixel { x, y, place, channel, drawn, exact, .. } = worst;
            let number = |value: &f64| match self.output {
                AuditedOutput::Display => format!("{value:.2}"),
                AuditedOutput::Hdr => format!("{value:.4e} cd/m^2"),
            };
            let (drawn, exact) = (number(drawn), number(exact));
            format!("; worst at ({x}, {y}), {place}, {channel}: drawn {drawn}, in f64 {exact}")
        });
        format!(
            "{} ({kind}): {pixels} pixels, 99.9 % {error_999:.3} of {budget}, largest {largest:.3} of {most} {unit}: {verdict}{}",
            self.image(),
            worst.unwrap_or_default()
        )
    }
}

/// A pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstPixel {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Why it is in the sample: near a bright star, dark, at an edge, anywhere.
    pub place: &'static str,
    /// Unit vector towards it, world axes.
    pub towards: [f64; 3],
    /// `R`, `G` or `B`.
    pub channel: &'static str,
    /// What was drawn: a code from 0 to 255, or cd/m^2.
    pub drawn: f64,
    /// What f64 gives, before rounding.
    pub exact: f64,
}
