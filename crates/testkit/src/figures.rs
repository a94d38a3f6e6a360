//! The figures of the table *Measured* in `README.md`, each with the bound that a test asserts.
//!
//! A test asserts a figure by its constant: `figures::CENTROID.check(value)`, or [`Figure::worst`] for many values.
//! Both print the measured value and fail above the bound; NaN fails. `tests/program/measured.rs` compares the table
//! with this one and with the sources of the tests, so a figure has one row, one bound and a test that uses it.
//!
//! Figures are measured on the software driver (llvmpipe, Mesa 25.0.7). A bound is about four times the figure: it
//! tolerates changes by rounding and still detects faults. A bound outside of two to six times the figure has a note
//! with the reason.

use std::fmt;

/// A measured figure in the README.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Name of the constant, which tests use.
    pub name: &'static str,
    /// Measured property: the first column of the table.
    pub property: &'static str,
    /// Value measured on the software driver: the second column.
    pub measured: f64,
    /// Largest allowed value.
    pub bound: f64,
    /// Path of the test that asserts it (binary, modules and function): the third column.
    pub test: &'static str,
    /// Reason why the bound is not between two and six times the figure; empty if it is.
    pub note: &'static str,
}

/// Declares the constants, and [`FIGURES`] with all of them.
macro_rules! figures {
    ($($name:ident: $property:literal, $measured:literal, $bound:literal, $test:literal $(, $note:literal)?;)*) => {
        $(pub const $name: Figure = Figure {
            name: stringify!($name),
            property: $property,
            measured: $measured,
            bound: $bound,
            test: $test,
            note: concat!($($note)?),
        };)*
        /// All figures, in the order of the table.
        pub const FIGURES: &[Figure] = &[$($name),*];
    };
}

figures! {
    SOLID_ANGLE_TABLE: "solid angle of a pixel against an independent table of all projections, relative",
        2.6e-6, 1e-5, "gpu::solid_angle::the_adapter_agrees_with_the_reference_table";
    SOLID_ANGLE_16K: "solid angle of a pixel in images of 16384 pixels a side, relative",
        4.6e-6, 1e-5, "gpu::solid_angle::the_adapter_agrees_with_f64_at_16k_and_at_256";
    STAR_FLUX: "flux of a star, 50 directions × 17 magnitudes × 12 projections, relative",
        1.8e-5, 7e-5, "gpu::stars::light::every_magnitude_has_its_illuminance_in_every_projection";
    STAR_FLUX_AT_EDGES: "flux of a star on cube edges and corners, poles and date line, relative",
        1.2e-5, 4.8e-5, "gpu::stars::light::stars_keep_their_light_on_edges_corners_poles_and_date_line";
    CENTROID: "centroid of a star (`bspline`), pixels",
        2.1e-6, 8e-6, "gpu::stars::light::sub_pixel_sweep_keeps_centroid_and_width";
    WIDTH: "width of a star (`bspline`), relative",
        9.2e-8, 3.7e-7, "gpu::stars::light::sub_pixel_sweep_keeps_centroid_and_width";
    MILLION_FAINT_STARS: "flux of a million stars of magnitude 20 in one pixel, relative",
        1.2e-5, 5e-5, "gpu::stars::sums::a_million_faint_stars_in_one_pixel_add_up";
    SIRIUS: "flux of Sirius beside a star of magnitude 21, relative",
        9.1e-6, 3.6e-5, "gpu::stars::sums::sirius_and_a_star_of_magnitude_21_both_keep_their_light";
    STAR_BESIDE_SIRIUS: "flux of a star of magnitude 21 beside Sirius, relative",
        2.0e-5, 8e-5, "gpu::stars::sums::sirius_and_a_star_of_magnitude_21_both_keep_their_light";
    STAR_BESIDE_THE_SUN: "flux of a star of magnitude 21 beside Sirius with the Sun in the view, relative",
        3.3e-3, 1.3e-2, "gpu::stars::sums::sirius_and_a_star_of_magnitude_21_both_keep_their_light";
    HEADSET_FLUX: "flux of stars in images of a headset, half floats, relative",
        3.1e-4, 1e-3, "headset::pixels::light::stars_have_the_light_of_the_catalogue";
    HEADSET_PIXELS: "images of a headset against `render`, 8 bits and half floats, share of differing channels",
        1.3e-5, 5e-5, "headset::pixels::rendering::pixels_are_those_of_render";
    HEADSET_DISPARITY: "disparity of a body at 1, 10 and 1000 m in a headset, pixels",
        1.5e-3, 6e-3, "headset::pixels::disparity::bodies_have_the_disparity_of_their_distance";
    HEADSET_VERTICAL_DISPARITY: "vertical disparity of the same, pixels",
        6.4e-5, 2.6e-4, "headset::pixels::disparity::bodies_have_the_disparity_of_their_distance";
    HEADSET_VEIL: "veil of Sirius, left eye against right eye, relative",
        4.9e-3, 1e-2, "headset::pixels::shared_light::glare_is_the_same_around_a_star_for_both_eyes";
    BODY_FLUX: "flux of a body from 0.01 to 100 pixels, relative",
        6.7e-3, 0.01, "gpu::bodies::light::a_body_has_its_illuminance_at_every_size",
        "the contract's limit is 0.01, and the error of bodies a few pixels wide is close to it";
    VEIL_OF_ONE_STAR: "veil of one star (`sky_cube`) against f64, rms, relative",
        2.6e-3, 1e-2, "gpu::verify::glare::sky_cube_glare_passes_every_check";
    VEIL_OF_9000_STARS: "veil of 9000 stars (`sky_cube`) against f64, rms, relative",
        9.6e-3, 0.02, "gpu::verify::glare::sky_cube_glare_passes_every_check";
}

impl Figure {
    /// Asserts and prints one measured value.
    pub fn check(self, measured: f64) {
        let mut worst = self.worst();
        worst.add(measured, "");
        worst.print();
    }

    /// Begins a check of many values: each is asserted, and the worst is printed.
    pub fn worst(self) -> Worst {
        Worst { figure: self, value: 0.0, of: String::new(), count: 0 }
    }

    /// Whether the absolute value is within the bound; false for NaN.
    pub fn holds(self, measured: f64) -> bool {
        measured.abs() <= self.bound
    }
}

/// The worst of the values of a figure.
#[must_use = "print() reports the measured value, and fails if there is none"]
pub struct Worst {
    figure: Figure,
    value: f64,
    of: String,
    count: usize,
}

impl Worst {
    /// Asserts a value; `of` describes it.
    pub fn add(&mut self, measured: f64, of: impl fmt::Display) {
        let Figure { property, bound, .. } = self.figure;
        assert!(self.figure.holds(measured), "{property}: {measured:.2e} is above the bound {bound:.1e} ({of})");
        self.count += 1;
        if self.count == 1 || measured.abs() > self.value {
            (self.value, self.of) = (measured.abs(), of.to_string());
        }
    }

    /// Prints the worst value. Fails if none was added.
    pub fn print(self) {
        let Self { figure: Figure { property, bound, measured, .. }, value, of, count } = self;
        assert!(count > 0, "{property}: nothing was measured");
        println!("figure: {property}: {value:.2e}, README {measured:.1e}, bound {bound:.1e}; worst of {count}: {of}");
    }
}
