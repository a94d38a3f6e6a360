//! Tests the pool that lends renderers to tests.

use glam::DVec3;
use steradian::{gpu::GpuOptions, plan::settings::StarMethod, render::Renderer, view::ViewKind};

use crate::common::{Pool, render_hdr, rig, settings, snapshot, star};

/// Draws a frame and returns its number.
fn draw(renderer: &mut Renderer) -> u64 {
    let rig = rig(vec![("view", ViewKind::Perspective { size: [9, 9], fov_y_rad: 0.5 })]);
    render_hdr(renderer, &snapshot(vec![star(DVec3::NEG_Z, 2.0)]), &rig, &settings(StarMethod::BSpline)).number
}

#[test]
fn a_returned_renderer_is_lent_again_with_default_settings() {
    static POOL: Pool = Pool::new();
    let mut first = POOL.lend(&GpuOptions::default());
    assert_eq!(draw(&mut first), 1);
    (first.culling, first.unit_factor, first.catalogue_order) = (false, 3.0, Some(1));
    drop(first);
    let mut again = POOL.lend(&GpuOptions::default());
    assert!(POOL.idle().is_empty(), "a lent renderer is not idle");
    assert_eq!((again.culling, again.unit_factor, again.catalogue_order), (true, 1.0, None));
    assert_eq!(draw(&mut again), 2, "the same renderer is lent again");
}

#[test]
fn other_options_get_another_renderer_and_the_pool_is_limited() {
    static POOL: Pool = Pool::new();
    let options = |mebibytes: u64| GpuOptions { binding_limit_bytes: Some(mebibytes << 20), ..GpuOptions::default() };
    let count = Pool::max_idle() as u64 + 1;
    for mebibytes in 1..=count {
        assert_eq!(draw(&mut POOL.lend(&options(mebibytes))), 1, "a new renderer");
    }
    assert_eq!(POOL.idle(), (2..=count).map(options).collect::<Vec<_>>(), "the renderer idle for longest is closed");
}

#[test]
fn a_renderer_held_by_a_failed_test_is_not_lent_again() {
    static POOL: Pool = Pool::new();
    let failed = std::thread::spawn(|| {
        let _held = POOL.lend(&GpuOptions::default());
        panic!("simulates a failed assertion");
    });
    assert!(failed.join().is_err());
    assert!(POOL.idle().is_empty());
}
