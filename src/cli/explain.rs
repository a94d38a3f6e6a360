//! Prints the plan of a frame in words: how each part was drawn, and the bound of every approximation.

use std::fmt::Write;

use crate::{
    plan::{Approximation, DeepReport, FramePlan, audit::Audit},
    render::{AsteroidCounts, Frame, ViewStatistics},
};

/// Returns the text of `render --explain` for frames that show views of one rig, each with its own settings.
pub(super) fn text(frames: &[Frame]) -> String {
    let mut text = String::new();
    for frame in frames {
        text += &format!("exposure    EV100 {:.2}\n", frame.exposure_ev100);
        for view in &frame.views {
            text += &describe_view(view);
        }
        match &frame.hdr_plan {
            Some(hdr) => {
                text += &describe_plan("display images", &frame.plan);
                text += &describe_plan("HDR images", hdr);
            }
            None => text += &describe_plan("all images", &frame.plan),
        }
    }
    // The caller adds the line break after the last line.
    text.truncate(text.trim_end().len());
    text
}

fn describe_view(view: &ViewStatistics) -> String {
    let AsteroidCounts { meshes, impostors, hidden, points, unresolved, .. } = &view.asteroids;
    let asteroids = meshes.iter().sum::<u64>() + impostors + points + unresolved;
    let mut line = format!("view        {}: {} stars drawn", view.name, view.stars_drawn);
    let written = [
        view.limiting_magnitude.map(|magnitude| format!("shows stars to V = {magnitude:.2}")),
        (asteroids > 0).then(|| format!("{asteroids} asteroids drawn")),
        (*hidden > 0).then(|| format!("{hidden} of them hidden by nearer ones")),
    ];
    for part in written.into_iter().flatten() {
        line += ", ";
        line += &part;
    }
    line.push('\n');
    if view.stars_in_map > 0 {
        // The count of stars drawn does not include the stars of the map.
        let _ = writeln!(
            line,
            "faint stars {} in the whole sky, drawn from one map that {} reads",
            view.stars_in_map, view.name
        );
    }
    line
}

fn describe_plan(images: &str, plan: &FramePlan) -> String {
    let FramePlan { stars, accumulator, glare, budget: _, certificate, deep, audit } = plan;
    let mut text = format!("{images}\n  stars     {stars}\n  sums      {accumulator}\n  glare     {glare}\n");
    for Approximation { name, bound, unit, limit, within_budget } in certificate {
        // Writing to a string cannot fail.
        let _ = write!(text, "  bound     {name}: {bound:.2e} {unit}");
        if let Some((limit, is_within)) = limit.zip(*within_budget) {
            let side = if is_within { "within" } else { "beyond" };
            let _ = write!(text, ", {side} its limit of {limit:.2e}");
        }
        text.push('\n');
    }
    if let Some(DeepReport { stars, missing, residual_codes, .. }) = deep {
        let _ = writeln!(text, "  deep      {stars} stars and composite stars drawn");
        if *missing > 0 {
            let _ = writeln!(
                text,
                "  deep      {missing} pages not read yet: a pixel may be off by {residual_codes:.1} codes"
            );
        } else if *residual_codes > 0.0 {
            let _ = writeln!(
                text,
                "  deep      stars.memory is too small for the detail of these views: a pixel may be off by {residual_codes:.1} codes"
            );
        }
    }
    if let Some(Audit { images, not_audited }) = audit {
        let audited = images.iter().map(|image| format!("  audit     {}\n", image.in_words()));
        let left_out = not_audited.iter().map(|unaudited| format!("  audit     not audited: {unaudited}\n"));
        text.extend(audited.chain(left_out));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_printed_with_their_verdict() {
        let approximation = |limit| Approximation::new("a thing", 0.012, "px", limit);
        let certificate = vec![approximation(Some(0.02)), approximation(Some(0.01)), approximation(None)];
        let text = describe_plan("all images", &FramePlan { certificate, ..FramePlan::default() });
        let bounds: Vec<&str> = text.lines().filter(|line| line.contains("bound")).collect();
        assert_eq!(
            bounds,
            [
                "  bound     a thing: 1.20e-2 px, within its limit of 2.00e-2",
                "  bound     a thing: 1.20e-2 px, beyond its limit of 1.00e-2",
                "  bound     a thing: 1.20e-2 px"
            ]
        );
    }
}
