//! Result of the audit of a frame, as plain data: errors of a sample of its pixels relative to a computation in f64, and images that were not
//! compared.

use serde::Serialize;

/// Errors of a frame's images.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Audit {
    /// Compared images, in the order of the frame.
    pub images: Vec<ImageAudit>,
    /// Images that were not compared, with the reason.
    pub not_audited: Vec<String>,
}

impl Audit {
    /// Images that exceed their budgets.
    pub fn broken(&self) -> impl Iterator<Item = &ImageAudit> {
        self.images.iter().filter(|image| !image.within_budget)
    }

    /// Whether a compared image exceeds its budget.
    pub fn is_broken(&self) -> bool {
        self.broken().next().is_some()
    }
}

/// Kind of image, which determines the unit of errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AuditedOutput {
    /// A display image: errors are in 8-bit codes, in excess of the rounding to a whole code.
    Display,
    /// An HDR image: errors are in multiples of the budget, which is `flux` of the stars' light plus `glare` of the veil.
    Hdr,
}

impl AuditedOutput {
    /// Unit of errors and budget.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Display => "codes of 8 bits beyond rounding",
            Self::Hdr => "multiples of the budget of flux and glare",
        }
    }
}

/// Errors of one image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageAudit {
    /// Name of the view.
    pub view: String,
    /// Part of the view; `None` if the view has only one image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Kind of image.
    pub output: AuditedOutput,
    /// Number of compared pixels.
    pub pixels: usize,
    /// Number of sampled pixels that were not compared: an overlay covers them, or f32 may draw a star differently because it is near a threshold.
    pub left_out: usize,
    /// 99.9th percentile of the errors of all channels of the compared pixels.
    pub error_999: f64,
    /// Largest error.
    pub largest: f64,
    /// Limit of `error_999`.
    pub budget: f64,
    /// Limit of `largest`.
    pub most: f64,
    /// Unit of these errors and limits.
    pub unit: &'static str,
    /// Whether both errors are within their limits.
    pub within_budget: bool,
    /// Pixel with the largest error; `None` if no pixel was compared.
    pub worst: Option<WorstPixel>,
}

impl ImageAudit {
    /// Name of the image: that of its view, with its part.
    pub fn image(&self) -> String {
        self.part.as_ref().map_or_else(|| self.view.clone(), |part| format!("{}.{part}", self.view))
    }

    /// The result in one line.
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

/// A compared pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstPixel {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Reason for sampling it: near a bright star, dark, at an edge, random.
    pub place: &'static str,
    /// Unit vector towards the pixel, world axes.
    pub towards: [f64; 3],
    /// `R`, `G` or `B`.
    pub channel: &'static str,
    /// Drawn value: a code from 0 to 255, or cd/m^2.
    pub drawn: f64,
    /// Exact value, before rounding.
    pub exact: f64,
}
