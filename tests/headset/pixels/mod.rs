//! The images that the wearer sees: poses, fields of view, light, depth, exposure and glare of the images submitted to
//! the runtime. A program of the runtime reads the images from its swapchains (`program`); the tests here measure them
//! in f64.

mod disparity;
mod light;
mod poses;
mod program;
mod rendering;
mod shared_light;
mod shots;
mod smoke;

use crate::monado::harness::{Inner, Test};

pub const TESTS: &[Test] = &[
    Test::Long("three_hundred_frames_cause_no_complaint", smoke::three_hundred_frames),
    Test::WithMonado("eyes_are_those_sent", poses::eyes_are_those_sent),
    Test::WithMonado("stars_have_the_light_of_the_catalogue", light::stars_have_the_light_of_the_catalogue),
    Test::WithMonado("pixels_are_those_of_render", rendering::pixels_are_those_of_render),
    Test::WithMonado(
        "bodies_have_the_disparity_of_their_distance",
        disparity::bodies_have_the_disparity_of_their_distance,
    ),
    Test::WithMonado("both_eyes_have_one_exposure", shared_light::both_eyes_have_one_exposure),
    Test::WithMonado(
        "glare_is_the_same_around_a_star_for_both_eyes",
        shared_light::glare_is_the_same_around_a_star_for_both_eyes,
    ),
];

pub const INNERS: &[Inner] = &[("photograph", program::photograph), ("show_frames", program::show_frames)];
