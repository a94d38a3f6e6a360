use super::*;
use crate::photometry::rec709::uv_prime;

/// Every operator with every option.
fn all_settings() -> Vec<ToneMapSettings> {
    let mut all = Vec::new();
    for operator in ToneMapOperator::ALL {
        for (desaturation, scotopic) in [(0.0, 0.0), (1.0, 0.0), (0.4, 0.0), (0.0, 1.0), (1.0, 0.5)] {
            let defaults = ToneMapSettings::of(operator);
            all.push(ToneMapSettings { desaturation, scotopic, peak_cd_m2: 4.0, ..defaults });
        }
    }
    all
}

/// Settings for an operator that clips or compresses each channel separately.
fn by_channel(operator: ToneMapOperator) -> ToneMapSettings {
    ToneMapSettings { desaturation: 0.0, ..ToneMapSettings::of(operator) }
}

#[test]
fn srgb_has_the_standards_values() {
    assert_eq!(srgb_from_linear(0.0), 0.0);
    assert!((srgb_from_linear(1.0) - 1.0).abs() < 1e-15);
    // Code 188 of 255 is the one nearest to half of white; 0.18 is encoded as 0.4614 (118).
    assert_eq!((255.0 * srgb_from_linear(0.5)).round(), 188.0);
    assert!((srgb_from_linear(0.18) - 0.461_356).abs() < 1e-6);
    assert!((linear_from_srgb(128.0 / 255.0) - 0.215_861).abs() < 1e-6);
    assert!((srgb_from_linear(0.001) - 0.012_92).abs() < 1e-15);
}

#[test]
fn srgb_and_its_inverse_agree_and_preserve_eight_bit_codes() {
    for code in 0..=255 {
        let value = f64::from(code) / 255.0;
        assert!((srgb_from_linear(linear_from_srgb(value)) - value).abs() < 1e-12, "code {code}");
        assert_eq!(i32::from(ToneMapSettings::byte(value)), code);
    }
    // The two thresholds are rounded independently, so the curves differ by 3e-8 at their joint.
    assert!((srgb_from_linear(0.003_130_8) - srgb_from_linear(0.003_130_800_001)).abs() < 5e-8);
}

#[test]
fn operators_increase_from_black_to_one_and_stay_in_range() {
    for settings in all_settings() {
        for colour in [[1.0; 3], [1.0, 0.4, 0.1], [0.1, 0.3, 1.0]] {
            let show = |value: f64| settings.display_rgb(colour.map(|channel| channel * value), 4.0);
            let mut previous = 0.0;
            assert_eq!(show(0.0), [0.0; 3]);
            for step in -400..400 {
                let rgb = show(10f64.powf(f64::from(step) / 40.0));
                assert!(rgb.iter().all(|channel| (0.0..=1.0).contains(channel)), "{settings:?} {step}: {rgb:?}");
                let seen = luminance(rgb.map(linear_from_srgb));
                assert!(seen >= previous - 1e-12, "{settings:?} {step}: {previous} to {seen}");
                previous = seen;
            }
            assert!(show(f64::INFINITY).iter().all(|channel| (channel - 1.0).abs() < 1e-9), "{settings:?}");
        }
    }
}

#[test]
fn nan_and_negative_channels_are_black_and_do_not_affect_the_others() {
    for settings in all_settings() {
        for wrong in [f64::NAN, -1.0, f64::NEG_INFINITY] {
            assert_eq!(settings.display_rgb([wrong; 3], 4.0), [0.0; 3], "{settings:?}");
            let (beside, alone) =
                (settings.display_rgb([wrong, 2.0, 1.0], 4.0), settings.display_rgb([0.0, 2.0, 1.0], 4.0));
            assert_eq!(beside, alone, "{settings:?}");
        }
    }
}

#[test]
fn display_white_is_white_for_srgb_and_below_white_for_filmic() {
    let clipped = by_channel(ToneMapOperator::Srgb).display_rgb([0.15, 0.075, 0.3], 0.15);
    for (shown, expected) in clipped.into_iter().zip([1.0, srgb_from_linear(0.5), 1.0]) {
        assert!((shown - expected).abs() < 1e-15, "{clipped:?}");
    }
    let [red, green, blue] = by_channel(ToneMapOperator::Filmic).display_rgb([0.15, 0.075, 0.3], 0.15);
    assert!(green < red && red < blue && blue < 0.95, "{red} {green} {blue}");
}

#[test]
fn a_calibrated_display_reproduces_luminance_at_any_exposure() {
    let settings = ToneMapSettings { peak_cd_m2: 250.0, black_cd_m2: 0.3, ..by_channel(ToneMapOperator::Calibrated) };
    let given = |rgb: [f64; 3], white_cd_m2: f64| {
        settings.display_rgb(rgb, white_cd_m2).map(|value| 0.3 + (250.0 - 0.3) * linear_from_srgb(value))
    };
    for rgb in [[0.5, 20.0, 3.0], [249.0, 0.31, 100.0]] {
        for white_cd_m2 in [1e-6, 1.0, 1e6] {
            for (given, light) in given(rgb, white_cd_m2).into_iter().zip(rgb) {
                assert!((given / light - 1.0).abs() < 1e-4, "{given} for {light}");
            }
        }
    }
    // The display is limited to its black and its peak.
    assert_eq!(given([0.01, 0.3, 400.0], 1.0).map(|given| (given * 1e6).round() / 1e6), [0.3, 0.3, 250.0]);
    assert!((settings.white_ev100().unwrap() - (250.0_f64 / 1.2).log2()).abs() < 1e-12);
    assert_eq!(ToneMapSettings::default().white_ev100(), None);
}

/// Hue angle around white in u', v' by which an operator changes a colour, rad.
fn turned_rad(settings: &ToneMapSettings, rgb: [f64; 3]) -> f64 {
    let hue = |rgb: [f64; 3]| {
        let ([u, v], [white_u, white_v]) = (uv_prime(rgb), uv_prime([1.0; 3]));
        (v - white_v).atan2(u - white_u)
    };
    (hue(settings.display_rgb(rgb, 1.0).map(linear_from_srgb)) - hue(rgb)).abs()
}

#[test]
fn desaturation_keeps_the_hue_of_highlights() {
    for operator in ToneMapOperator::ALL {
        let settings =
            |desaturation| ToneMapSettings { desaturation, peak_cd_m2: 1.0, ..ToneMapSettings::of(operator) };
        let mut judged = 0;
        // Stars of 3000 K and 20000 K, and two purer colours, from well within the range to far beyond.
        for rgb in [[1.0, 0.49, 0.13], [0.55, 0.69, 1.0], [1.0, 0.25, 0.02], [0.1, 0.3, 1.0]] {
            for brighter in [0.05, 0.5, 1.0, 2.0] {
                let colour = rgb.map(|channel| channel * brighter);
                if luminance(settings(1.0).display_rgb(colour, 1.0).map(linear_from_srgb)) > 0.999 {
                    // White has no hue.
                    continue;
                }
                judged += 1;
                let turned = turned_rad(&settings(1.0), colour);
                assert!(turned < 2e-3, "{operator:?} turns {colour:?} by {turned} rad");
            }
        }
        assert!(judged >= 13, "{operator:?}: {judged} of 16 colours have a hue");
        // If channels are processed separately, a bright orange is off by more than a tenth of a radian; half of the
        // desaturation gives a value in between.
        let orange = [3.0, 1.2, 0.1].map(|channel| 6.0 * channel);
        let (whole, half) = (turned_rad(&settings(0.0), orange), turned_rad(&settings(0.5), orange));
        println!(
            "{}: hue of bright orange changed by {whole:.3} rad, with half of the desaturation {half:.3}",
            operator.name()
        );
        assert!(whole > 0.1, "{operator:?}: {whole}");
        // The light is so bright that it is white: no hue remains.
        let [red, green, blue] = settings(1.0).display_rgb(orange, 1.0);
        assert!(red >= green && green >= blue && blue > 0.8, "{operator:?}: {red} {green} {blue}");
    }
}

#[test]
fn desaturation_keeps_the_operators_luminance() {
    for operator in ToneMapOperator::ALL {
        let settings =
            |desaturation| ToneMapSettings { desaturation, peak_cd_m2: 1.0, ..ToneMapSettings::of(operator) };
        let seen = |desaturation, rgb| luminance(settings(desaturation).display_rgb(rgb, 1.0).map(linear_from_srgb));
        let within = [0.5, 0.3, 0.1];
        assert!((seen(1.0, within) / seen(0.0, within) - 1.0).abs() < 1e-6, "{operator:?}");
        // A red whose channel is beyond the range although its luminance is within it: clipping loses most of its
        // light.
        let red = [3.0, 0.2, 0.1];
        let kept = match operator {
            ToneMapOperator::Filmic | ToneMapOperator::Aces => seen(0.0, red),
            ToneMapOperator::Reinhard => luminance(red) * reinhard_scale(luminance(red), 16.0),
            ToneMapOperator::Srgb | ToneMapOperator::Calibrated => luminance(red),
        };
        assert!((seen(1.0, red) / kept - 1.0).abs() < 1e-6, "{operator:?}: {} for {kept}", seen(1.0, red));
    }
    let clipped = by_channel(ToneMapOperator::Srgb).display_rgb([3.0, 0.2, 0.1], 1.0);
    assert!(luminance(clipped.map(linear_from_srgb)) < 0.5 * luminance([3.0, 0.2, 0.1]));
}

#[test]
fn light_of_code_inverts_display_rgb() {
    for settings in all_settings() {
        let white_cd_m2 = crate::photometry::exposure::white_luminance_cd_m2(settings.white_ev100().unwrap_or(0.0));
        for code in [1.0, 20.0, 100.0, 230.0] {
            let light = settings.light_of_code(code);
            let plain = ToneMapSettings { scotopic: 0.0, ..settings };
            let displayed = plain.display_rgb([light * white_cd_m2; 3], white_cd_m2)[1] * 255.0;
            assert!((displayed - code).abs() < 1e-6, "{settings:?}: {light} is displayed as {displayed} for {code}");
        }
    }
    // By hand: filmic's quadratic, the linear part of sRGB, and its power above.
    assert!((ToneMapSettings::default().light_of_code(20.0) - 0.010_962).abs() < 1e-5);
    assert!((ToneMapSettings::of(ToneMapOperator::Srgb).light_of_code(20.0) - 0.006_995).abs() < 1e-5);
    // The display's black is emitted without any light.
    let display =
        ToneMapSettings { peak_cd_m2: 5.0, black_cd_m2: 0.01, ..ToneMapSettings::of(ToneMapOperator::Calibrated) };
    assert!((display.light_of_code(20.0) * 5.0 - (0.01 + 4.99 * 0.006_995)).abs() < 1e-4);
}

#[test]
fn keys_without_effect_name_the_operator_that_they_need() {
    let problem = |general: ToneMapSettings, text: &str| {
        let keys: ToneMapKeys = toml::from_str(text).unwrap();
        general.check_effects(&keys).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let general = ToneMapSettings::default();
    for (text, expected) in [
        ("desaturation = 0.5\nscotopic = 1.0\ndither = false", ""),
        ("operator = 'reinhard'\nwhite = 4.0", ""),
        ("operator = 'calibrated'\npeak_cd_m2 = 5.0\nblack_cd_m2 = 0.1", ""),
        (
            "white = 4.0",
            "white: has no effect with operator = \"filmic\": leave it out, or set operator = \"reinhard\"",
        ),
        ("operator = 'aces'\npeak_cd_m2 = 100.0", "peak_cd_m2: has no effect with operator = \"aces\""),
        ("operator = 'reinhard'\nwhite = 4.0\nblack_cd_m2 = 0.0", "black_cd_m2: has no effect with operator"),
    ] {
        let problem = problem(general, text);
        assert!(problem.starts_with(expected) && problem.is_empty() == expected.is_empty(), "{text}: {problem}");
    }
    // The operator may come from the general settings.
    assert_eq!(problem(ToneMapSettings::of(ToneMapOperator::Calibrated), "peak_cd_m2 = 5.0"), "");
}
